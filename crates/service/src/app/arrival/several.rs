//! Files that hold several scans, and scans that are no file of their own: each is written as one.

use super::{ArrivalError, CheckedScan, Coming, Content, Desk, ReceivedFile, check_count, scan_names};
use crate::storage::StagedFile;
use visage_formats::e57::{WrittenScan, write_scans};
use visage_formats::{Dropped, FormatError, ScanReading, read_scans};
use visage_geometry::Motion;

/// What scans are written as.
const ENDING: &str = "e57";

/// A file with its scans.
pub(super) struct ReadFile {
    name: String,
    pub scans: Vec<ReadScan>,
}

/// A scan of a file.
pub(super) struct ReadScan {
    /// What the file calls it.
    name: Option<String>,
    staged: StagedFile,
    points: u64,
    dropped: Dropped,
    /// Where its file says that it is, if it stands beside others there.
    world_from_scan: Option<Motion>,
}

/// Reads a file, and writes its scans as files of their own if it holds several.
pub(super) async fn read(desk: &Desk, coming: Coming) -> Result<ReadFile, ArrivalError> {
    desk.work(move |desk| {
        let Coming { name, archive, content } = coming;
        let unreadable = |error| ArrivalError::Unreadable { file: name.clone(), archive: archive.clone(), error };
        let scans = match content {
            Content::Depth(scan) => {
                let reading = scan.read(desk).map_err(|error| match error {
                    ArrivalError::Unreadable { file, error, .. } => {
                        ArrivalError::Unreadable { file, archive: archive.clone(), error }
                    }
                    error => error,
                })?;
                vec![written(desk, reading.into(), &unreadable)?]
            }
            Content::Textured(staged, beside) => {
                let bytes = desk.objects.read_staged(&staged)?;
                let read = beside.read(desk, &name, &bytes)?.map_err(unreadable)?;
                let staged = match read.colored {
                    Some(colored) => stage(desk, &colored, &unreadable)?,
                    None => staged,
                };
                vec![whole(staged, read.reading.into())]
            }
            Content::File(staged) => {
                let bytes = desk.objects.read_staged(&staged)?;
                let mut scans = read_scans(&name, &bytes, &desk.limits.read_limits()).map_err(unreadable)?;
                drop(bytes);
                // before any of them is written
                check_count(scans.len(), desk.limits.scans_per_set)?;
                match (scans.pop(), scans.is_empty()) {
                    (Some(scan), true) => vec![whole(staged, scan)],
                    (last, _) => {
                        let scans = scans.into_iter().chain(last);
                        scans.map(|scan| written(desk, scan, &unreadable)).collect::<Result<_, _>>()?
                    }
                }
            }
        };
        Ok(ReadFile { name, scans })
    })
    .await
}

/// The only scan of a file, which is kept as it is.
fn whole(staged: StagedFile, scan: ScanReading) -> ReadScan {
    let points = scan.reading.surface.cloud.len() as u64;
    ReadScan { name: None, staged, points, dropped: scan.reading.dropped, world_from_scan: None }
}

/// Writes a scan as a file of its own.
fn written(
    desk: &Desk,
    scan: ScanReading,
    unreadable: &impl Fn(FormatError) -> ArrivalError,
) -> Result<ReadScan, ArrivalError> {
    let ScanReading { name, mut reading, mut world_from_scan } = scan;
    let surface = &mut reading.surface;
    // the file that is written is in metres
    if let Some(factor) = reading.unit.map(|unit| unit.metres).filter(|metres| *metres != 1.0) {
        surface.cloud.points.iter_mut().chain(&mut surface.sensor).for_each(|point| *point *= factor);
        world_from_scan.iter_mut().for_each(|pose| pose.translation.vector *= factor);
    }
    // a scan that has a place of its own is seen from there
    let own = surface.sensor.map(|_| Motion::identity());
    let bytes = write_scans(&[WrittenScan {
        name: name.as_deref().unwrap_or_default(),
        cloud: &surface.cloud,
        grid: surface.grid.as_ref(),
        world_from_scan: own.as_ref(),
    }]);
    let staged = stage(desk, &bytes, unreadable)?;
    let (points, dropped) = (surface.cloud.len() as u64, reading.dropped);
    Ok(ReadScan { name, staged, points, dropped, world_from_scan })
}

/// Stages what was made of a scan.
fn stage(
    desk: &Desk,
    bytes: &[u8],
    unreadable: &impl Fn(FormatError) -> ArrivalError,
) -> Result<StagedFile, ArrivalError> {
    let (found, limit) = (bytes.len() as u64, desk.limits.file_bytes);
    if found > limit {
        return Err(unreadable(FormatError::TooManyBytes { what: "as a file of its own, a scan has", found, limit }));
    }
    Ok(desk.stage(bytes)?)
}

/// Names the scans, as `visage register` does, but that those written as files of their own end like these; gives the
/// poses that their files tell.
pub(super) fn named(read: Vec<ReadFile>, scans: &mut Vec<CheckedScan>) -> Vec<(String, Motion)> {
    let own: Vec<Vec<Option<String>>> =
        read.iter().map(|file| file.scans.iter().map(|scan| scan.name.clone()).collect()).collect();
    let files: Vec<(&str, Vec<Option<&str>>)> = read
        .iter()
        .zip(&own)
        .map(|(file, own)| (file.name.as_str(), own.iter().map(Option::as_deref).collect()))
        .collect();
    let plain: Vec<&str> = read.iter().filter(|file| file.scans.len() == 1).map(|file| file.name.as_str()).collect();
    let names = scan_names(&files, &plain);
    let mut poses = Vec::new();
    for (file, names) in read.into_iter().zip(names) {
        let is_one = file.scans.len() == 1;
        for (scan, name) in file.scans.into_iter().zip(names) {
            let name = if is_one { name } else { format!("{name}.{ENDING}") };
            poses.extend(scan.world_from_scan.map(|pose| (name.clone(), pose)));
            let ReadScan { staged, points, dropped, .. } = scan;
            scans.push(CheckedScan { file: ReceivedFile { name, staged }, points, dropped });
        }
    }
    poses
}
