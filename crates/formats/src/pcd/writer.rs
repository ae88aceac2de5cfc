//! Clouds to binary PCD 0.7.

use crate::precision::fits_float;
use visage_geometry::Cloud;

/// Writes a cloud with the attributes it has. Positions are of four bytes, or of eight where four would round them visibly
/// (far from the origin; older programs of the Point Cloud Library read only four). Colours are packed as that library
/// packs them. The same cloud always gives the same bytes.
pub fn write_cloud(cloud: &Cloud) -> Vec<u8> {
    let as_float = fits_float(&cloud.points);
    let mut fields: Vec<(&str, usize)> = ["x", "y", "z"].map(|name| (name, if as_float { 4 } else { 8 })).to_vec();
    if cloud.normals.is_some() {
        fields.extend(["normal_x", "normal_y", "normal_z"].map(|name| (name, 4)));
    }
    if cloud.colors.is_some() {
        fields.push(("rgb", 4));
    }
    if cloud.intensities.is_some() {
        fields.push(("intensity", 4));
    }
    let line = |value: &dyn Fn(&(&str, usize)) -> String| fields.iter().map(value).collect::<Vec<_>>().join(" ");
    let names = line(&|(name, _)| (*name).to_owned());
    let sizes = line(&|(_, size)| size.to_string());
    let (types, counts) = (line(&|_| "F".to_owned()), line(&|_| "1".to_owned()));
    let points = cloud.len();
    let header = format!(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS {names}\nSIZE {sizes}\nTYPE {types}\n\
         COUNT {counts}\nWIDTH {points}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA binary\n"
    );
    let stride: usize = fields.iter().map(|(_, size)| size).sum();
    let mut bytes = header.into_bytes();
    bytes.reserve(points * stride);
    for (index, point) in cloud.points.iter().enumerate() {
        for x in point.iter() {
            if as_float {
                bytes.extend((*x as f32).to_le_bytes());
            } else {
                bytes.extend(x.to_le_bytes());
            }
        }
        if let Some(normals) = &cloud.normals {
            normals[index].iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        }
        if let Some(colors) = &cloud.colors {
            let [red, green, blue] = colors[index];
            bytes.extend([blue, green, red, 0]);
        }
        if let Some(intensities) = &cloud.intensities {
            bytes.extend(intensities[index].to_le_bytes());
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ReadLimits, pcd};
    use visage_geometry::Point3;

    #[test]
    fn a_cloud_comes_back_with_all_attributes_near_and_far() {
        let cloud = Cloud {
            points: vec![Point3::new(0.0, 0.0, 0.0), Point3::new(1.0, 2.0, 3.0)],
            normals: Some(vec![nalgebra::Vector3::x(), nalgebra::Vector3::y()]),
            colors: Some(vec![[1, 2, 3], [254, 5, 255]]),
            intensities: Some(vec![0.5, 100.0]),
        };
        let bytes = write_cloud(&cloud);
        let header = String::from_utf8_lossy(&bytes);
        assert!(header.contains("FIELDS x y z normal_x normal_y normal_z rgb intensity\nSIZE 4 4 4 4 4 4 4 4\n"));
        let read = |bytes: &[u8]| pcd::read(bytes, &ReadLimits::default()).expect("own files").surface.cloud;
        assert_eq!(read(&bytes), cloud);
        let mut far = cloud;
        far.points.iter_mut().for_each(|p| p.x += 4.0e5 + 0.001);
        let bytes = write_cloud(&far);
        assert!(String::from_utf8_lossy(&bytes).contains("SIZE 8 8 8 4"));
        assert_eq!(read(&bytes), far);
        let bare = Cloud::from_points(far.points);
        assert_eq!(read(&write_cloud(&bare)), bare);
    }
}
