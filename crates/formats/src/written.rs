//! What formats are to those who choose one to be written: by ending or by media type, and in which unit.

use super::format::Format;
use super::{DeclaredUnit, FORMATS, e57, gltf, las, obj, poses, stl, threemf};
use visage_geometry::{Motion, Surface, Unit};

/// What is to be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Written {
    /// Points with their attributes.
    Cloud,
    /// Triangles.
    Mesh,
    /// Where scans are.
    Poses,
}

impl Written {
    /// The formats that it can be written in, in the order in which people read about them.
    pub fn formats(self) -> impl Iterator<Item = &'static Format> + Clone {
        FORMATS.iter().copied().filter(move |format| match self {
            Written::Cloud => format.writers.cloud.is_some(),
            Written::Mesh => format.writers.mesh.is_some(),
            // what has no ending of its own can't be asked for
            Written::Poses => format.writers.poses.is_some() && !format.endings.is_empty(),
        })
    }

    /// Their endings, each that which is written.
    pub fn endings(self) -> Vec<&'static str> {
        self.formats().map(Format::ending).collect()
    }

    /// The format of files that end like this (in any case, with or without a dot).
    pub fn of_ending(self, ending: &str) -> Option<&'static Format> {
        let ending = ending.trim_start_matches('.').to_ascii_lowercase();
        self.formats().find(|format| format.endings.contains(&ending.as_str()))
    }
}

/// Media types by which formats are known beside those they are sent as, registered or not.
const MEDIA_TYPES: &[(&Format, &[&str])] = &[
    (&super::ply::FORMAT, &["model/ply", "application/ply", "text/ply"]),
    (&super::pcd::FORMAT, &["application/vnd.pcl.pcd", "model/pcd"]),
    (&obj::FORMAT, &["model/obj"]),
    (&stl::FORMAT, &["model/stl", "application/sla", "model/x.stl-binary"]),
    (&super::columns::XYZ, &["text/plain", "text/csv"]),
    (&gltf::GLB, &["model/gltf-binary"]),
    (&threemf::FORMAT, &["model/3mf", "application/vnd.ms-package.3dmanufacturing-3dmodel+xml"]),
    (&e57::FORMAT, &["model/e57", "application/e57"]),
    (&las::LAS, &["application/vnd.las"]),
    (&las::LAZ, &["application/vnd.laszip"]),
    (&poses::MLP, &["text/xml"]),
];

impl Format {
    /// Media types that mean this format and no other, beside the one that its files are sent as.
    pub fn media_types(&self) -> &'static [&'static str] {
        MEDIA_TYPES.iter().find(|(format, _)| *format == self).map_or(&[], |(_, types)| types)
    }

    /// The unit that files of this format are in by its definition.
    pub fn fixed_unit(&self) -> Option<DeclaredUnit> {
        let in_metres = [&e57::FORMAT, &gltf::GLB, &gltf::GLTF];
        in_metres.contains(&self).then_some(DeclaredUnit::METRE)
    }

    /// What lengths in `unit` are multiplied by to be written in this format; 1 for one that knows no unit, and where
    /// the unit is not known.
    pub fn factor_from(&self, unit: Unit) -> f64 {
        match (self.fixed_unit(), unit.in_mm()) {
            (Some(fixed), Some(mm)) => mm / 1000.0 / fixed.metres,
            _ => 1.0,
        }
    }
}

/// A surface with all its lengths multiplied.
pub fn scaled(mut surface: Surface, factor: f64) -> Surface {
    if factor != 1.0 {
        surface.cloud.points.iter_mut().chain(&mut surface.sensor).for_each(|point| *point *= factor);
    }
    surface
}

/// A scan where its motion takes it, as points alone: the grid and the place of the scanner belong to its own frame.
pub fn placed(scan: Surface, scale: f64, motion: &Motion) -> Surface {
    let Surface { cloud, .. } = scaled(scan, scale);
    Surface { cloud: cloud.moved(motion), ..Surface::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Cloud, Point3};

    #[test]
    fn a_format_is_found_by_its_ending_among_those_that_are_written() {
        assert_eq!(Written::Cloud.of_ending(".LAS").map(Format::ending), Some("las"));
        assert_eq!(Written::Cloud.of_ending("csv").map(Format::ending), Some("xyz"));
        assert!(Written::Cloud.of_ending("stl").is_none() && Written::Mesh.of_ending("las").is_none());
        assert!(Written::Poses.endings().contains(&"conf") && Written::Mesh.endings().contains(&"glb"));
        assert!(Written::Poses.endings().iter().all(|ending| !ending.is_empty()));
    }

    #[test]
    fn a_media_type_means_one_format() {
        let mut types: Vec<&str> = MEDIA_TYPES.iter().flat_map(|(_, types)| *types).copied().collect();
        let count = types.len();
        types.sort_unstable();
        types.dedup();
        assert_eq!(types.len(), count);
        assert!(types.iter().all(|kind| *kind == kind.to_ascii_lowercase() && kind.contains('/')));
    }

    #[test]
    fn formats_that_are_in_metres_get_metres() {
        assert_eq!(gltf::GLB.factor_from(Unit::Mm), 0.001);
        assert_eq!((gltf::GLB.factor_from(Unit::Unknown), obj::FORMAT.factor_from(Unit::Mm)), (1.0, 1.0));
        let scan = Surface { cloud: Cloud::from_points(vec![Point3::new(1.0, 2.0, 3.0)]), ..Surface::default() };
        let placed = placed(scan, 2.0, &Motion::translation(1.0, 0.0, 0.0));
        assert_eq!(placed.cloud.points, [Point3::new(3.0, 4.0, 6.0)]);
    }
}
