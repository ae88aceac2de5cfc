//! What a report says, as far as it is shown. Reports of other versions are read too: what one lacks is not shown.

use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};

/// Links that disagree with the whole by more than this many spacings are weak, as for the verdict.
const DISAGREEMENT: f64 = 2.0;
/// Links that count for less than this in averaging are weak.
const TRUST: f64 = 0.5;

/// JSON has null for what is no number.
fn number<'de, D: Deserializer<'de>>(of: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(of)?.unwrap_or(f64::NAN))
}

fn rows<'de, D: Deserializer<'de>>(of: D) -> Result<Vec<Vec<f64>>, D::Error> {
    let rows: Vec<Vec<Option<f64>>> = Vec::deserialize(of)?;
    Ok(rows.into_iter().map(|row| row.into_iter().map(|x| x.unwrap_or(f64::NAN)).collect()).collect())
}

/// `report.json`.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Found {
    /// What was found out.
    pub result: Findings,
    /// Where and in what time.
    pub run: Run,
}

/// `result`.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Findings {
    /// The method of registration.
    pub method: Option<String>,
    /// The unit of lengths.
    pub unit: String,
    /// The distance of neighbours in a scan.
    #[serde(deserialize_with = "number")]
    pub spacing: f64,
    /// The verdict, if scans were registered.
    pub verdict: Option<Verdict>,
    /// The scans.
    pub views: Vec<View>,
    /// Pairs of scans.
    pub pairs: Vec<Pair>,
    /// Share of a scan that another saw.
    #[serde(deserialize_with = "rows")]
    pub overlaps: Vec<Vec<f64>>,
    /// Rounds of registration.
    pub rounds: Vec<Round>,
    /// How sure the whole is.
    pub confidence: Option<f64>,
    /// The mesh.
    pub surface: Option<SurfaceFound>,
    /// What was done to make poses fit.
    pub pose_notes: Vec<String>,
    /// How units were found.
    pub unit_notes: Vec<String>,
    /// The model whose points it has, if it was given a surface alone.
    pub of_model: Option<String>,
}

/// The verdict.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Verdict {
    /// good, doubtful, failed
    pub quality: String,
    /// Why it is not better.
    pub reasons: Vec<String>,
}

/// A scan.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct View {
    /// Its name.
    pub name: String,
    /// Its points.
    pub points: u64,
    /// Whether it has a place.
    pub placed: bool,
    /// Distance of what is left, in spacings.
    pub residual_spacings: Option<f64>,
    /// How sure its place is.
    pub confidence: Option<f64>,
    /// Why it has no place.
    pub unplaced: Option<String>,
    /// The scan that it repeats.
    pub copy_of: Option<String>,
    /// How well its pose is known.
    pub uncertainty: Option<Uncertainty>,
    /// Moves its points in the model to where they were before refinement: 4x4, row by row.
    pub start_from_final: Option<[[f64; 4]; 4]>,
}

/// How well a pose is known.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Uncertainty {
    /// By how much it may be off, in spacings.
    pub displacement_spacings: Option<f64>,
}

/// Two scans.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Pair {
    /// The one.
    pub i: usize,
    /// The other.
    pub j: usize,
    /// The share of the one that the other saw.
    #[serde(deserialize_with = "number")]
    pub overlap_i_j: f64,
    /// And the other way.
    #[serde(deserialize_with = "number")]
    pub overlap_j_i: f64,
    /// Distance of what is left.
    #[serde(deserialize_with = "number")]
    pub trimmed_rms: f64,
    /// How far it disagrees with the whole.
    #[serde(deserialize_with = "number")]
    pub disagreement: f64,
    /// How much it counts.
    #[serde(deserialize_with = "number")]
    pub trust: f64,
}

/// A round of registration.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Round {
    /// Its level, coarse to fine.
    pub level: usize,
    /// How far apart what belongs together may be.
    #[serde(deserialize_with = "number")]
    pub tolerance: f64,
    /// The largest turn of a scan, radians.
    #[serde(deserialize_with = "number")]
    pub rotation_change: f64,
    /// Pairs that were registered.
    pub pairs: usize,
}

/// The mesh.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct SurfaceFound {
    /// Its triangles.
    pub triangles: u64,
    /// The cells that it was made in.
    #[serde(deserialize_with = "number")]
    pub cell: f64,
    /// Holes that were closed.
    pub closed_holes: u64,
    /// Holes that were left open.
    pub open_holes: u64,
    /// Share of it that nobody saw.
    #[serde(deserialize_with = "number")]
    pub unseen_area: f64,
    /// Whether it is coarser than the scans, to stay within memory.
    pub widened: bool,
}

/// `run`.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Run {
    /// Version of visage.
    pub version: Option<String>,
    /// Version of what describes models.
    pub signature_version: Option<u64>,
    /// Threads that worked.
    pub threads: Option<u64>,
    /// Seconds by stage.
    pub seconds: Map<String, Value>,
    /// The most memory, bytes.
    pub peak_memory_bytes: Option<u64>,
    /// The machine.
    pub host: Host,
}

/// The machine.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Host {
    /// Operating system.
    pub os: Option<String>,
    /// Processor architecture.
    pub arch: Option<String>,
}

/// Why a report can't be shown.
#[derive(Debug, thiserror::Error)]
#[error("the report can't be read: {0}")]
pub struct FoundError(#[from] serde_json::Error);

impl Found {
    /// Reads `report.json`.
    ///
    /// # Errors
    /// It is not JSON, or a field has another type.
    pub fn read(bytes: &[u8]) -> Result<Found, FoundError> {
        Ok(serde_json::from_slice(bytes)?)
    }

    /// The names of all scans.
    pub fn names(&self) -> Vec<String> {
        self.result.views.iter().map(|view| view.name.clone()).collect()
    }

    /// The pairs of scans that are there and share something.
    pub fn links(&self) -> Vec<Pair> {
        let count = self.result.views.len();
        self.result.pairs.iter().filter(|pair| pair.i < count && pair.j < count && pair.i != pair.j).cloned().collect()
    }

    /// For each of [`Found::links`] whether it is weak: overruled by the others, or nothing else holds what is behind it.
    pub fn weak(&self) -> Vec<bool> {
        let links = self.links();
        let alone = bridges(self.result.views.len(), &links);
        let is_overruled = |pair: &Pair| {
            pair.trust < TRUST || (self.result.spacing > 0.0 && pair.disagreement > DISAGREEMENT * self.result.spacing)
        };
        // two scans have but one link
        let is_chain = self.result.views.len() > 2;
        links.iter().zip(alone).map(|(pair, alone)| is_overruled(pair) || (alone && is_chain)).collect()
    }
}

/// For each link whether the graph falls apart without it.
fn bridges(count: usize, links: &[Pair]) -> Vec<bool> {
    use visage_geometry::UnionFind;
    let mut forest = UnionFind::new(count);
    // only links that a spanning forest needs can be bridges
    let needed: Vec<bool> = links.iter().map(|link| forest.join(link.i, link.j)).collect();
    let is_bridge = |skipped: usize| {
        let mut rest = UnionFind::new(count);
        links.iter().enumerate().filter(|(index, _)| *index != skipped).for_each(|(_, link)| {
            rest.join(link.i, link.j);
        });
        rest.find(links[skipped].i) != rest.find(links[skipped].j)
    };
    needed.iter().enumerate().map(|(index, needed)| *needed && is_bridge(index)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(pairs: &[(usize, usize)], count: usize) -> Found {
        let pair = |(i, j): &(usize, usize)| Pair { i: *i, j: *j, trust: 1.0, ..Pair::default() };
        let views = (0..count).map(|k| View { name: format!("scan_{k}"), placed: true, ..View::default() }).collect();
        let result = Findings { views, spacing: 0.5, pairs: pairs.iter().map(pair).collect(), ..Findings::default() };
        Found { result, run: Run::default() }
    }

    #[test]
    fn a_link_that_alone_holds_something_is_weak() {
        let ring = report(&[(0, 1), (1, 2), (2, 0), (2, 3)], 4);
        assert_eq!(ring.weak(), [false, false, false, true]);
        assert_eq!(report(&[(0, 1)], 2).weak(), [false]);
        assert_eq!(report(&[(0, 9), (1, 1)], 4).links(), []);
        let mut overruled = report(&[(0, 1), (1, 2), (2, 0)], 3);
        overruled.result.pairs[1].disagreement = 1.5;
        overruled.result.pairs[2].trust = 0.2;
        assert_eq!(overruled.weak(), [false, true, true]);
    }

    #[test]
    fn what_a_report_lacks_or_has_too_much_is_no_matter_and_nulls_are_no_numbers() {
        let text =
            br#"{"result": {"spacing": null, "overlaps": [[null, 0.5]], "pairs": [{"i": 0, "j": 1, "end": "joint",
            "trimmed_rms": null}], "future": {}, "verdict": {"quality": "good"}}}"#;
        let found = Found::read(text).expect("read");
        assert!(found.result.spacing.is_nan() && found.result.overlaps[0][0].is_nan());
        assert_eq!(found.result.verdict.map(|verdict| verdict.quality), Some("good".to_owned()));
        assert_eq!(Found::read(b"{}").map(|found| found.result.views.len()).ok(), Some(0));
        assert!(Found::read(b"[1").is_err() && Found::read(br#"{"result": 3}"#).is_err());
    }
}
