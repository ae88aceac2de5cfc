//! What a signature with its verdict costs, on one thread.

use std::fmt::Write;
use std::time::Duration;

use anyhow::Context;
use nix::sys::resource::{UsageWho, getrusage};

use super::disturbances::subdivided;
use super::{Judged, described};
use visage::geometry::{Cloud, Mesh, Point3, Surface, Vector3};

/// Every mesh is also measured with this many vertices.
const USUAL_VERTICES: usize = 20_000;

/// A model's CPU seconds, as it is and with the usual number of vertices.
struct Cost<'a> {
    model: &'a Judged,
    as_it_is: f64,
    usual: f64,
}

/// CPU seconds and vertices of every model, the dearest first, each described once more on a single thread.
pub fn table(all: &[Judged]) -> anyhow::Result<String> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().context("starting the worker thread")?;
    let mut costs: Vec<Cost> = pool.install(|| all.iter().map(cost).collect::<anyhow::Result<_>>())?;
    costs.sort_by(|a, b| b.usual.total_cmp(&a.usual));
    let mut text = String::from("\n## CPU seconds for signature and verdict, one thread\n\n");
    let _ = writeln!(text, "| models | number | mean | mean with {USUAL_VERTICES} vertices | dearest of these |");
    let _ = writeln!(text, "| --- | ---: | ---: | ---: | ---: |");
    for (name, wanted) in [("faces", Some(true)), ("other things", Some(false)), ("all", None)] {
        let chosen: Vec<&Cost> = costs.iter().filter(|c| wanted.is_none_or(|face| c.model.row.face == face)).collect();
        let mean = |of: fn(&Cost) -> f64| chosen.iter().map(|c| of(c)).sum::<f64>() / chosen.len().max(1) as f64;
        let (as_it_is, usual) = (mean(|c| c.as_it_is), mean(|c| c.usual));
        let dearest = chosen.first().map_or(0.0, |c| c.usual);
        let _ = writeln!(text, "| {name} | {} | {as_it_is:.3} | {usual:.3} | {dearest:.3} |", chosen.len());
    }
    let _ = writeln!(text, "\n| model | vertices | CPU s | with {USUAL_VERTICES} |\n| --- | ---: | ---: | ---: |");
    for Cost { model, as_it_is, usual } in costs {
        let vertices = model.surface.cloud.len();
        let _ = writeln!(text, "| {} | {vertices} | {as_it_is:.3} | {usual:.3} |", model.row.file);
    }
    Ok(text)
}

fn cost(model: &Judged) -> anyhow::Result<Cost<'_>> {
    Ok(Cost { model, as_it_is: seconds(&model.surface)?, usual: seconds(&filled_up(&model.surface))? })
}

fn seconds(surface: &Surface) -> anyhow::Result<f64> {
    let before = cpu_time()?;
    described(surface)?;
    Ok((cpu_time()? - before).as_secs_f64())
}

/// The same mesh with the usual number of vertices, if it has fewer: faces cut in four while there are too few, then the
/// largest of them cut in three.
fn filled_up(surface: &Surface) -> Surface {
    if surface.faces.is_empty() || surface.cloud.len() >= USUAL_VERTICES {
        return surface.clone();
    }
    let mut filled = surface.clone();
    while filled.faces.len() + filled.cloud.len() < USUAL_VERTICES {
        filled = subdivided(&filled);
    }
    let mesh = Mesh { vertices: filled.cloud.points, faces: filled.faces };
    let missing = USUAL_VERTICES.saturating_sub(mesh.vertices.len());
    let area = |face: usize| mesh.area_normal(face).norm();
    let mut order: Vec<usize> = (0..mesh.faces.len()).collect();
    order.sort_by(|&a, &b| area(b).total_cmp(&area(a)));
    let (mut points, mut faces) = (mesh.vertices.clone(), mesh.faces.clone());
    for face in order.into_iter().take(missing) {
        let ([a, b, c], middle) = (mesh.faces[face], points.len() as u32);
        points.push(Point3::from(mesh.corners(face).iter().map(|p| p.coords).sum::<Vector3>() / 3.0));
        faces[face] = [a, b, middle];
        faces.extend([[b, c, middle], [c, a, middle]]);
    }
    Surface { cloud: Cloud::from_points(points), faces, ..Surface::default() }
}

/// CPU time of the calling thread.
fn cpu_time() -> anyhow::Result<Duration> {
    let usage = getrusage(UsageWho::RUSAGE_THREAD).context("asking for the CPU time")?;
    let seconds = |time: nix::sys::time::TimeVal| {
        Duration::from_secs(time.tv_sec().unsigned_abs()) + Duration::from_micros(time.tv_usec().unsigned_abs())
    };
    Ok(seconds(usage.user_time()) + seconds(usage.system_time()))
}
