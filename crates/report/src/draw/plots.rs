//! What the report says, as plots.

use super::lacking;
use crate::found::{Findings, Found};
use crate::kind::Kind;
use crate::material::{Material, PictureError, Wish};
use visage_picture::color::category;
use visage_picture::drawing::Drawing;
use visage_picture::plots::{self, Edge, Node, Series};

/// The report of a registration.
fn found(kind: Kind, of: &Material) -> Result<&Found, PictureError> {
    of.found.as_ref().filter(|found| !found.result.views.is_empty()).ok_or_else(|| {
        lacking(kind, "the model was not made of scans here", "only models that were registered from scans have one")
    })
}

/// Share of each scan that the others saw.
pub(super) fn overlap(of: &Material, wish: &Wish) -> Result<Drawing, PictureError> {
    let Findings { overlaps, .. } = &found(Kind::Overlap, of)?.result;
    let names = found(Kind::Overlap, of)?.names();
    Ok(plots::matrix(wish.size, "share of a row's scan that a column's saw", &names, overlaps))
}

/// Which scans hold which.
pub(super) fn graph(of: &Material, wish: &Wish) -> Result<Drawing, PictureError> {
    let found = found(Kind::Graph, of)?;
    let views = found.result.views.iter().enumerate();
    let nodes: Vec<Node> = views
        .map(|(index, view)| Node { name: view.name.clone(), color: category(index), is_placed: view.placed })
        .collect();
    let edge = |(pair, is_weak): (&crate::found::Pair, bool)| {
        let share = (pair.overlap_i_j + pair.overlap_j_i) / 2.0;
        Edge { i: pair.i, j: pair.j, share: if share.is_finite() { share } else { 0.0 }, is_weak }
    };
    let edges: Vec<Edge> = found.links().iter().zip(found.weak()).map(edge).collect();
    Ok(plots::graph(wish.size, "which scans hold which", &nodes, &edges))
}

/// How the poses came to rest.
pub(super) fn convergence(of: &Material, wish: &Wish) -> Result<Drawing, PictureError> {
    let rounds = &found(Kind::Convergence, of)?.result.rounds;
    if rounds.is_empty() {
        let remedy = "ask for the overlap or the graph";
        return Err(lacking(Kind::Convergence, "the poses were kept as they came: there were no rounds", remedy));
    }
    let unit = match of.unit {
        visage_geometry::Unit::Unknown => "in the unit of the scans",
        unit => unit.name(),
    };
    let series = [
        Series {
            name: "largest turn of a scan, degrees".to_owned(),
            values: rounds.iter().map(|round| round.rotation_change.to_degrees()).collect(),
        },
        Series {
            name: format!("how far apart what belongs together may be, {unit}"),
            values: rounds.iter().map(|round| round.tolerance).collect(),
        },
    ];
    let level = |index: usize| rounds.get(index).map(|round| round.level);
    let breaks: Vec<(usize, String)> = (0..rounds.len())
        .filter(|index| *index == 0 || level(*index) != level(index - 1))
        .map(|index| (index, format!("level {}", level(index).map_or(0, |level| level + 1))))
        .collect();
    Ok(plots::curves(wish.size, "how the poses came to rest", "round", &series, &breaks))
}
