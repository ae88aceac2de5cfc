//! Clouds to text.

use std::fmt::{Display, Write};

use visage_geometry::Cloud;

/// Writes one point a line, behind a comment that names the columns. The numbers are those that are read back as the same
/// values, whatever the distance from the origin.
pub fn write_cloud(cloud: &Cloud) -> Vec<u8> {
    let mut text = "# x y z".to_owned();
    let attributes = [
        (cloud.normals.is_some(), " nx ny nz"),
        (cloud.colors.is_some(), " red green blue"),
        (cloud.intensities.is_some(), " intensity"),
    ];
    attributes.iter().filter(|(has, _)| *has).for_each(|(_, names)| text.push_str(names));
    text.push('\n');
    for (index, point) in cloud.points.iter().enumerate() {
        put(&mut text, point.iter());
        if let Some(normals) = &cloud.normals {
            put(&mut text, normals[index].iter());
        }
        if let Some(colors) = &cloud.colors {
            put(&mut text, colors[index].iter());
        }
        if let Some(intensities) = &cloud.intensities {
            put(&mut text, [intensities[index]]);
        }
        text.pop();
        text.push('\n');
    }
    text.into_bytes()
}

fn put(text: &mut String, values: impl IntoIterator<Item = impl Display>) {
    for value in values {
        // writing to a string can't fail
        let _ = write!(text, "{value} ");
    }
}
