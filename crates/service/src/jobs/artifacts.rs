//! The files of a registered model, as bytes. Pure but for [`RunFacts::here`], which asks the machine.

use std::collections::BTreeMap;

use crate::app::tracker::Snapshot;
use visage_domain::asset::Asset;
use visage_formats::ply::VertexAttributes;
use visage_formats::{Dropped, Format, MeshContent, gltf, ply};
use visage_geometry::{Unit, se3};
use visage_pipeline::report::ModelReport;
use visage_pipeline::surface::SurfaceMesh;
use visage_pipeline::{PoseMatrix, RegisteredModel};

/// Where something ran and what it took: `report.run`. Apart from the result, since it differs from run to run.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct RunFacts {
    /// The job, if it was one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub job_id: Option<String>,
    /// Version of visage.
    pub version: &'static str,
    /// Version of the operator that makes signatures.
    pub signature_version: u32,
    /// Worker threads used.
    pub threads: usize,
    /// Seconds by stage, up to the writing of the report.
    pub seconds: BTreeMap<String, f64>,
    /// Processor seconds of the whole process by stage; those of jobs that run beside this one count too.
    pub cpu_seconds: BTreeMap<String, f64>,
    /// The most memory this process has ever held (bytes); null where the system does not say.
    pub peak_memory_bytes: Option<u64>,
    /// The machine.
    pub host: Host,
}

/// The machine something ran on.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Host {
    /// Operating system.
    pub os: &'static str,
    /// Processor architecture.
    pub arch: &'static str,
    /// Hardware threads.
    pub cpus: usize,
}

impl RunFacts {
    /// The facts of a run on this machine.
    pub fn here(job_id: Option<String>, threads: usize, spent: Snapshot) -> Self {
        RunFacts {
            job_id,
            version: env!("CARGO_PKG_VERSION"),
            signature_version: visage_shape::faces::Signature::VERSION,
            threads,
            seconds: spent.stage_seconds,
            cpu_seconds: spent.stage_cpu_seconds,
            peak_memory_bytes: crate::machine::peak_memory_bytes(),
            host: Host {
                os: std::env::consts::OS,
                arch: std::env::consts::ARCH,
                cpus: crate::config::available_threads(),
            },
        }
    }
}

/// Says in a report what of the scans' files was not taken, view by view (`reading`), and what was done to make
/// the pose file fit (`pose_notes`). What was taken whole is not mentioned.
pub fn add_readings(report: &mut ModelReport, dropped: &BTreeMap<String, Dropped>, pose_notes: &[String]) {
    for row in &mut report.registration.views {
        row.reading = dropped.get(&row.view.name).filter(|dropped| !dropped.is_empty()).cloned();
    }
    report.pose_notes = pose_notes.to_vec();
}

/// `report.json`: the deterministic result and, apart from it, the run.
pub fn report_json(result: serde_json::Value, run: &RunFacts) -> Result<Vec<u8>, serde_json::Error> {
    #[derive(serde::Serialize)]
    struct Report<'a> {
        result: serde_json::Value,
        run: &'a RunFacts,
    }
    let mut bytes = serde_json::to_vec_pretty(&Report { result, run })?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// Hands all files of a model to `sink`, in the order in which they are written. `run` is asked when the report is
/// made: its times are those up to there.
pub fn write_assets<E: From<serde_json::Error>>(
    outcome: &RegisteredModel,
    run: impl Fn() -> RunFacts,
    mut sink: impl FnMut(Asset, &[u8]) -> Result<(), E>,
) -> Result<(), E> {
    for asset in Asset::RESULTS {
        if let Some(content) = content(*asset, outcome, &run)? {
            sink(*asset, &content)?;
        }
    }
    Ok(())
}

/// What a file of a model holds; `None` if this model has no such file.
fn content(
    asset: Asset,
    outcome: &RegisteredModel,
    run: impl Fn() -> RunFacts,
) -> Result<Option<Vec<u8>>, serde_json::Error> {
    Ok(match asset {
        Asset::Poses => Some(visage_formats::poses::write_matrices(&outcome.matrices).into_bytes()),
        Asset::PosesConf => poses_conf(outcome).map(String::into_bytes),
        Asset::Cloud => {
            outcome.cloud.as_ref().map(|merged| visage_formats::ply::write_cloud(&merged.cloud, Some(&merged.views)))
        }
        Asset::Mesh => outcome.mesh.as_ref().and_then(|made| write_mesh(&made.surface, unit_of(outcome), &ply::FORMAT)),
        Asset::Medium => outcome.mesh.as_ref().and_then(|made| copy(made.medium.as_ref(), outcome)),
        Asset::Preview => outcome.mesh.as_ref().and_then(|made| copy(made.preview.as_ref(), outcome)),
        Asset::Report => Some(report_json(outcome.report.to_json(), &run())?),
        Asset::UploadedMesh(_) | Asset::UploadedCloud(_) | Asset::Thumbnail | Asset::Annotated(_) => None,
    })
}

/// A coarse copy of the surface, if there is one.
fn copy(surface: Option<&SurfaceMesh>, outcome: &RegisteredModel) -> Option<Vec<u8>> {
    write_mesh(surface?, unit_of(outcome), &gltf::GLB)
}

/// The unit of a model's coordinates.
fn unit_of(outcome: &RegisteredModel) -> Unit {
    outcome.report.registration.unit.parse().unwrap_or_default()
}

/// A surface in a format, with its normals, its colours if it has some, and how much data stands for each vertex, as far as the
/// format can hold them; `None` if it can hold no mesh.
pub fn write_mesh(surface: &SurfaceMesh, unit: Unit, format: &Format) -> Option<Vec<u8>> {
    let write = format.writers.mesh?;
    let attributes = VertexAttributes {
        normals: Some(&surface.mesh.vertex_normals()),
        colors: surface.colors.as_deref(),
        support: surface.support.as_deref(),
        ..VertexAttributes::default()
    };
    Some(write(&MeshContent { mesh: &surface.mesh, attributes, unit }))
}

/// `poses.conf` in Stanford's convention; views without a place are left out. `None` when a name has a blank or a view
/// a scale, which that format can't hold.
fn poses_conf(outcome: &RegisteredModel) -> Option<String> {
    let has_blank = |name: &str| name.chars().any(char::is_whitespace);
    let is_scaled = |matrix: &PoseMatrix| se3::from_rows(matrix).is_err();
    let holds =
        |(name, matrix): &(String, Option<PoseMatrix>)| !(has_blank(name) || matrix.as_ref().is_some_and(is_scaled));
    outcome.matrices.iter().all(holds).then(|| visage_formats::poses::write_conf(&outcome.poses))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use visage_geometry::Motion;

    fn report(names: &[&str]) -> ModelReport {
        ModelReport::example(names)
    }

    fn outcome(name: &str, scale: f64) -> RegisteredModel {
        let pose = Motion::identity();
        RegisteredModel {
            poses: vec![(name.to_owned(), Some(pose))],
            matrices: vec![(name.to_owned(), Some(se3::to_scaled_rows(&pose, scale)))],
            report: report(&[name]),
            cloud: None,
            mesh: None,
            signature: None,
        }
    }

    #[test]
    fn what_there_is_not_is_not_written() {
        let written = |name: &str| {
            let mut written = Vec::new();
            let run = || RunFacts::here(None, 2, Snapshot::default());
            let sink = |asset: Asset, content: &[u8]| -> Result<(), serde_json::Error> {
                assert!(!content.is_empty());
                written.push(asset);
                Ok(())
            };
            write_assets(&outcome(name, 1.0), run, sink).expect("plain data");
            written
        };
        assert_eq!(written("scan.ply"), [Asset::Poses, Asset::PosesConf, Asset::Report]);
        assert_eq!(written("my scan.ply"), [Asset::Poses, Asset::Report]);
    }

    #[test]
    fn a_name_with_a_blank_or_a_scale_has_no_conf() {
        let conf = |name: &str, scale: f64| poses_conf(&outcome(name, scale));
        assert_eq!(conf("my scan.ply", 1.0), None);
        assert_eq!(conf("scan.ply", 1.1), None);
        assert!(conf("scan.ply", 1.0).is_some_and(|text| text.starts_with("bmesh scan.ply ")));
    }

    #[test]
    fn what_was_dropped_is_said_of_its_view_alone() {
        let mut report = report(&["a.ply", "b.ply"]);
        let some = Dropped { no_return: 2, ..Dropped::default() };
        let dropped = [("a.ply".to_owned(), Dropped::default()), ("b.ply".to_owned(), some)].into();
        add_readings(&mut report, &dropped, &["rounded".to_owned()]);
        let report = report.to_json();
        assert_eq!(report["views"][0].get("reading"), None);
        assert_eq!(report["views"][1]["reading"]["no_return"], 2);
        assert_eq!(report["pose_notes"], json!(["rounded"]));
    }

    #[test]
    fn the_run_stands_apart_from_the_result() {
        let spent = Snapshot { stage_seconds: [("loading".to_owned(), 0.5)].into(), ..Snapshot::default() };
        let run = RunFacts::here(None, 2, spent);
        let result = report(&["a.ply"]);
        let report: serde_json::Value =
            serde_json::from_slice(&report_json(result.to_json(), &run).expect("plain data")).expect("JSON");
        assert_eq!(report["result"], result.to_json());
        assert_eq!(report["run"]["seconds"]["loading"], json!(0.5));
        assert!(report["run"]["peak_memory_bytes"].as_u64().is_none_or(|bytes| bytes > 1 << 20));
    }
}
