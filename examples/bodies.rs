//! Faces on merged scans of whole persons, and false alarms on merges of other things; all made by code.
//!
//! `cargo run --release --example bodies -- registered SEED...` registers depth-camera views of a person for each seed
//! from rough poses (`alone SEED...` from the scans alone), `doubled SEED...` merges them at poses that are some
//! millimetres off, `others COUNT` merges things without a face. One line a merge: noise and views, the verdict, how far
//! the landmarks are from the true ones, CPU of describing.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use anyhow::{Context, Result, bail};
use visage::faces::judgement::MATCH_SCORE;
use visage::faces::modes::LANDMARKS;
use visage::faces::{self, MatchMethod, Signature, judge, standard};
use visage::geometry::{Mesh, Motion, Point3, Surface, Unit};
use visage::pipeline::{self, NamedScan, Options, Start};
use visage::progress::Progress;
use visage::registration::sensor::Sensor;
use visage::registration::view::View;
use visage::surface::merge::{PosedView, merge};
use visage::synthetic::depth_views::{ALL_AROUND, DepthCamera, depth_views, ring};
use visage::synthetic::scanner::ScanSet;
use visage::synthetic::shapes::catalogue;
use visage::synthetic::truth::disturb;
use visage::synthetic::{Specimen, body, objects, scene};

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let numbers = || arguments[1..].iter().map(|n| n.parse::<u64>().context(n.clone())).collect::<Result<Vec<u64>>>();
    match arguments.first().map(String::as_str) {
        Some("registered") => numbers()?.into_iter().try_for_each(|seed| registered(seed, false)),
        Some("alone") => numbers()?.into_iter().try_for_each(|seed| registered(seed, true)),
        Some("doubled") => numbers()?.into_iter().try_for_each(doubled),
        Some("others") => others(*numbers()?.first().context("how many?")?),
        _ => bail!("registered SEED..., alone SEED..., doubled SEED... or others COUNT"),
    }
}

/// How the person of a seed is scanned: 8 to 50 views, 1 to 3 mm of noise, standing still or swaying by up to 4 mm.
fn scanned(seed: u64) -> (usize, usize, DepthCamera) {
    let (views, turns) = [(8, 1), (13, 1), (20, 2), (50, 2)][(seed % 4) as usize];
    let noise = 1.0 + (seed / 4 % 5) as f64 * 0.5;
    let sway = (seed / 2 % 3) as f64 * 2.0;
    let resolution = [2.8, 3.6][(seed / 3 % 2) as usize];
    (views, turns, DepthCamera { noise, step: 1.2 * noise, sway, resolution, ..DepthCamera::default() })
}

/// Scans, registers and merges a person by the whole pipeline.
fn registered(seed: u64, alone: bool) -> Result<()> {
    let person = body::person(seed);
    let (views, turns, camera) = scanned(seed);
    let set = depth_views(&person.mesh, ring(&person.mesh, &camera, views, turns, ALL_AROUND), &camera, seed);
    let size = person.mesh.bounds().context("a person has points")?.diagonal();
    let names: Vec<String> = (0..views).map(|view| format!("view_{view:02}")).collect();
    let poses: BTreeMap<String, Motion> = match alone {
        true => BTreeMap::new(),
        false => names.iter().cloned().zip(disturb(&set.poses, 0.04, 0.02 * size, seed)).collect(),
    };
    // what comes from depth cameras is mostly bare points
    let bare = |surface: Surface| Surface { cloud: surface.cloud, ..Surface::default() };
    let scans = names.into_iter().zip(set.scans).map(|(name, scan)| NamedScan { name, surface: bare(scan) }).collect();
    let start = Start { poses, ..Start::default() };
    let options = Options { mesh: false, ..Options::default() };
    let outcome = pipeline::run_from(scans, &start, Unit::Mm, &options, &Progress::silent())?;
    let placed = outcome.poses.iter().filter(|(_, pose)| pose.is_some()).count();
    let first = outcome.poses[0].1.context("the first view was not placed")?;
    let world_from_body = first * set.poses[0].inverse();
    let signature = outcome.signature.context("no signature was made")?;
    let how = if alone { "alone" } else { "registered" };
    let head = format!("{how} {placed}/{views} {}", outcome.report.to_json()["verdict"]["quality"]);
    let truth = person.landmarks.iter().map(|(name, p)| (*name, world_from_body * p)).collect();
    print(&format!("{seed} {head}"), &camera, &signature, &truth, None);
    Ok(())
}

/// Merges a person's views at poses that are 2 to 5 mm off.
fn doubled(seed: u64) -> Result<()> {
    let person = body::person(seed);
    let (views, turns, camera) = scanned(seed);
    let set = depth_views(&person.mesh, ring(&person.mesh, &camera, views, turns, ALL_AROUND), &camera, seed);
    let shift = 2.0 + (seed % 4) as f64;
    for unit in [Unit::Mm, Unit::Unknown] {
        let (signature, cpu) = described(&merged(&set, shift, seed)?, unit)?;
        let head = format!("{seed} doubled {views} by {shift} mm, unit {}", unit.name());
        print(&head, &camera, &signature, &person.landmarks, Some(cpu));
    }
    Ok(())
}

/// Merges at true poses that are turned and shifted so that points at a person's head move by about `shift`.
fn merged(set: &ScanSet, shift: f64, seed: u64) -> Result<Surface> {
    let given = disturb(&set.poses, 0.5 * shift / 1700.0, 0.7 * shift, seed);
    let views: Vec<View> = set.scans.iter().map(|scan| Ok(View::new(&scan.cloud)?)).collect::<Result<_>>()?;
    let posed: Vec<PosedView> = (views.iter().zip(&set.scans).zip(&given))
        .map(|((view, scan), pose)| PosedView {
            view,
            scan: &scan.cloud,
            local_pose: view.local_pose(pose),
            placed: true,
            sensor: Some(Sensor::At(-view.center)),
        })
        .collect();
    let (model, _) = merge(&posed, &Progress::silent())?;
    Ok(Surface { cloud: model.cloud, ..Surface::default() })
}

fn described(surface: &Surface, unit: Unit) -> Result<(Signature, f64)> {
    let before = cpu_seconds();
    let signature = faces::describe(surface, unit, &Progress::silent())?;
    Ok((signature, cpu_seconds() - before))
}

/// Things without a face, or with it away from all cameras, each described with known and unknown unit.
fn others(count: u64) -> Result<()> {
    let mut worst: f64 = f64::INFINITY;
    let mut alarms = 0;
    for index in 0..count {
        let (name, set, camera) = other(index);
        let surface = merged(&set, 1.0 + (index % 4) as f64, index)?;
        for unit in [Unit::Mm, Unit::Unknown] {
            let (signature, cpu) = described(&surface, unit)?;
            let verdict = judge(&signature, &standard::face(), MatchMethod::Verified);
            alarms += u32::from(verdict.score >= MATCH_SCORE);
            worst = worst.min(verdict.fit.map_or(f64::INFINITY, |fit| fit.residual_mm));
            print(&format!("{index} {name}, unit {}", unit.name()), &camera, &signature, &BTreeMap::new(), Some(cpu));
        }
    }
    println!("{alarms} false alarms in {count} merges, each twice; the nearest residual {worst:.2} mm");
    Ok(())
}

/// A thing without a face as a depth camera sees it.
fn other(index: u64) -> (String, ScanSet, DepthCamera) {
    let seed = index / 5;
    let (views, turns, camera) = scanned(index);
    let around = |mesh: &Mesh, camera: &DepthCamera, views: usize, arc: (f64, f64)| {
        depth_views(mesh, ring(mesh, camera, views, turns, arc), camera, index)
    };
    let near =
        DepthCamera { distance: 700.0, resolution: 1.3, noise: 0.4 * camera.noise, step: 0.4 * camera.step, ..camera };
    let of_things = |specimen: &Specimen| around(&specimen.mesh, &near, views.min(13), ALL_AROUND);
    match index % 5 {
        0 => ("headless".into(), around(&body::headless(seed).mesh, &camera, views, ALL_AROUND), camera),
        1 => {
            let arc = (PI - TAU / 6.0, TAU / 3.0);
            ("person from behind".into(), around(&body::person(seed).mesh, &camera, views, arc), camera)
        }
        2 | 3 => {
            let shapes: Vec<_> = catalogue().into_iter().filter(|shape| shape.name != "head").collect();
            let shape = &shapes[((2 * seed + index % 5) % shapes.len() as u64) as usize];
            let specimen = Specimen { mesh: shape.mesh(seed), landmarks: BTreeMap::new() };
            (shape.name.into(), of_things(&specimen), near)
        }
        _ => match seed % 4 {
            0 => ("head with bumps".into(), of_things(&objects::head_with_bumps()), near),
            1 => ("jug".into(), of_things(&objects::jug()), near),
            2 => ("blob".into(), of_things(&objects::blob(seed, 20_000)), near),
            _ => {
                let ground = scene::SceneOptions { ground: scene::Ground::FloorAndWall, ..Default::default() };
                ("scene".into(), scene::scene_set(&objects::blob(seed, 20_000).mesh, &ground, seed).set, near)
            }
        },
    }
}

fn print(
    head: &str,
    camera: &DepthCamera,
    signature: &Signature,
    truth: &BTreeMap<&'static str, Point3>,
    cpu: Option<f64>,
) {
    let verdict = judge(signature, &standard::face(), MatchMethod::Verified);
    let residual = verdict.fit.map_or(f64::INFINITY, |fit| fit.residual_mm);
    let found = if verdict.score >= MATCH_SCORE { "face" } else { "no face" };
    let errors: Vec<f64> = signature.landmarks().map_or_else(Vec::new, |places| {
        let found = LANDMARKS.iter().zip(&places);
        found.filter_map(|(name, place)| Some((truth.get(*name)? - place).norm())).collect()
    });
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let cpu = cpu.map_or_else(String::new, |cpu| format!(", {cpu:.2} CPU s"));
    let (noise, sway) = (camera.noise, camera.sway);
    println!(
        "{head}, noise {noise:.1} sway {sway:.0}: {found} {:.2} ({residual:.2} mm), landmarks {mean:.1} mm{cpu}",
        verdict.score
    );
}

/// CPU seconds of this process, where the system tells.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |field: usize| fields.get(field).and_then(|ticks| ticks.parse::<f64>().ok()).unwrap_or(f64::NAN);
    (ticks(11) + ticks(12)) / 100.0
}
