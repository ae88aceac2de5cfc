//! Scans in the coordinates of a map (UTM), hundreds of kilometres from the origin, keep their millimetres.

use visage_formats::{ReadLimits, columns, e57, las, ply, read};
use visage_geometry::{Cloud, Point3};

/// Places to the millimetre.
fn points() -> Vec<Point3> {
    let milli = |x: f64| (x * 1000.0).round() / 1000.0;
    let place =
        |k: f64| [500_123.0 + milli(0.37 * k.sin()), 4_512_345.0 + milli(0.0013 * k), 187.0 + milli(0.2 * k.cos())];
    (0..2000).map(|k| Point3::from(place(f64::from(k)))).collect()
}

/// The points as a program prints them.
fn rows() -> String {
    points().iter().map(|p| format!("{:.3} {:.3} {:.3}\n", p.x, p.y, p.z)).collect()
}

#[test]
fn millimetres_of_map_coordinates_are_kept() {
    let cloud = Cloud::from_points(points());
    let head = "property double x\nproperty double y\nproperty double z\nend_header\n";
    let text_ply = format!("ply\nformat ascii 1.0\nelement vertex 2000\n{head}{}", rows());
    let files: [(&str, Vec<u8>); 6] = [
        ("tile.las", las::write_cloud(&cloud)),
        ("room.e57", e57::write_cloud(&cloud)),
        ("scan.ply", ply::write_cloud(&cloud, None)),
        ("text.ply", text_ply.replace("double", "float").into_bytes()),
        ("scan.xyz", rows().into_bytes()),
        ("own.xyz", columns::write_cloud(&cloud)),
    ];
    for (name, bytes) in files {
        let reading = read(name, &bytes, &ReadLimits::default()).expect(name);
        let off = reading.surface.cloud.points.iter().zip(points()).map(|(a, b)| (a - b).amax()).fold(0.0, f64::max);
        assert!(off < 1e-4 && reading.surface.cloud.len() == 2000, "{name} is off by {off}");
        assert!(!reading.dropped.to_string().contains("rounded"), "{name}: {}", reading.dropped);
    }
}

#[test]
fn millimetres_that_were_lost_before_are_noticed() {
    let head = "property float x\nproperty float y\nproperty float z\nend_header\n";
    let mut floats = format!("ply\nformat binary_little_endian 1.0\nelement vertex 2000\n{head}").into_bytes();
    floats.extend(points().iter().flat_map(|p| [p.x, p.y, p.z]).flat_map(|x| (x as f32).to_le_bytes()));
    let reading = read("scan.ply", &floats, &ReadLimits::default()).expect("it is read");
    let said = reading.dropped.to_string();
    assert!(said.contains("rounded to steps of up to 0.5") && said.contains("subtract an offset"), "{said}");
}
