//! What a report says of how the views came to their poses.

use serde::Serialize;

use super::placement::{Origin, PlacedGroup, Placement};
use crate::geometry::se3;
use crate::registration::multiview::Multiview;
use crate::registration::view::View;

/// How the views came to their poses.
#[derive(Debug, Clone)]
pub struct PlacementReport {
    origins: Vec<Option<Origin>>,
    groups: Vec<PlacedGroup>,
}

/// A further group of views that hang together, but not with the placed ones.
#[derive(Debug, Clone, Serialize)]
struct GroupReport<'a> {
    /// Its scans.
    views: Vec<&'a str>,
    /// For each its 4x4 row-major pose: scan to the frame of the group's first scan.
    poses: Vec<[[f64; 4]; 4]>,
}

impl PlacementReport {
    /// All poses were given, and refined from there.
    pub fn of_given(result: &Multiview) -> Self {
        PlacementReport {
            origins: result.placed.iter().map(|p| p.then_some(Origin::Given)).collect(),
            groups: Vec::new(),
        }
    }

    /// The views were placed by their surface.
    pub fn of(placement: &Placement) -> Self {
        PlacementReport { origins: placement.origins.clone(), groups: placement.groups.clone() }
    }

    /// Adds `pose` (`given`, `corrected`, `found` or null) to each view of a report, and the groups.
    pub fn write_into(&self, report: &mut serde_json::Value, names: &[String], views: &[View]) {
        if let Some(rows) = report["views"].as_array_mut() {
            for (row, origin) in rows.iter_mut().zip(&self.origins) {
                row["pose"] = serde_json::json!(origin);
            }
        }
        report["groups"] =
            serde_json::json!(self.groups.iter().map(|group| group_report(group, names, views)).collect::<Vec<_>>());
    }
}

fn group_report<'a>(group: &PlacedGroup, names: &'a [String], views: &[View]) -> GroupReport<'a> {
    let first = group.views.first().map(|view| views[*view].scan_pose(&group.local_poses[0]).inverse());
    let pose = |(view, local_pose): (&usize, &crate::geometry::Motion)| {
        se3::to_rows(&(first.unwrap_or_default() * views[*view].scan_pose(local_pose)))
    };
    GroupReport {
        views: group.views.iter().map(|view| names[*view].as_str()).collect(),
        poses: group.views.iter().zip(&group.local_poses).map(pose).collect(),
    }
}
