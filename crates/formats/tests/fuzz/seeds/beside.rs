//! What stands beside scans: depth images with pictures, intrinsics, names of folders, materials.

use super::{Seed, rows};

/// Parts of a file here that are several files elsewhere.
const MARK: &[u8] = b"\n=====\n";

/// The parts of a file.
pub fn parts(bytes: &[u8]) -> Vec<&[u8]> {
    let mut parts = Vec::new();
    let mut start = 0;
    for at in memchr::memmem::find_iter(bytes, MARK) {
        if at >= start {
            parts.push(&bytes[start..at]);
            start = at + MARK.len();
        }
    }
    parts.push(&bytes[start..]);
    parts
}

/// A file of parts.
pub fn joined(parts: &[&[u8]]) -> Vec<u8> {
    parts.join(MARK)
}

fn png(color: png::ColorType, depth: png::BitDepth, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 8, 6);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.write_header().expect("a header").write_image_data(data).expect("data");
    bytes
}

/// A picture of 8 x 6 pixels.
pub fn rgb_png() -> Vec<u8> {
    let data: Vec<u8> = (0..144u8).collect();
    png(png::ColorType::Rgb, png::BitDepth::Eight, &data)
}

/// The checksums of chunks made right, as far as they can be walked over; of each part.
fn summed(bytes: &[u8]) -> Vec<u8> {
    let mut parts: Vec<Vec<u8>> = parts(bytes).into_iter().map(<[u8]>::to_vec).collect();
    for file in &mut parts {
        let mut at = 8;
        while let Some(length) = file.get(at..at + 4).map(|n| u32::from_be_bytes([n[0], n[1], n[2], n[3]]) as usize) {
            let end = at + 8 + length;
            if end + 4 > file.len() {
                break;
            }
            let mut sum = flate2::Crc::new();
            sum.update(&file[at + 4..end]);
            file[end..end + 4].copy_from_slice(&sum.sum().to_be_bytes());
            at = end + 4;
        }
    }
    joined(&parts.iter().map(Vec::as_slice).collect::<Vec<_>>())
}

pub fn depth() -> Vec<Seed> {
    let data: Vec<u8> = (0..48u16).flat_map(|k| (900 + 7 * k).to_be_bytes()).collect();
    let depth = png(png::ColorType::Grayscale, png::BitDepth::Sixteen, &data);
    let palette = {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 8, 6);
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_depth(png::BitDepth::Four);
        encoder.set_palette((0..48).collect::<Vec<u8>>());
        encoder.write_header().expect("a header").write_image_data(&[0x1a; 24]).expect("data");
        bytes
    };
    let alpha = png(png::ColorType::GrayscaleAlpha, png::BitDepth::Eight, &[7; 96]);
    [rgb_png(), palette, alpha]
        .iter()
        .map(|picture| Seed { name: "depth.png".into(), bytes: joined(&[&depth, picture]), wrap: summed })
        .collect()
}

pub fn layout() -> Vec<Seed> {
    let frames = "depth/10.png\ndepth/9.png\ncolor/9.png\ncolor/10.jpg\n";
    [
        ("scan", format!("{frames}camera_intrinsic.json\n")),
        ("rgbd_dataset_freiburg2_desk", "depth.txt\ndepth/1.5.png\nrgb.txt\nrgb/1.5.png\n".into()),
        ("x", "depth\\000000.png\ncamera_matrix.csv\nodometry.csv\nconfidence/000000.png\n".into()),
        ("x", "a_Depth.png\na_Color.png\na_Depth_metadata.csv\n".into()),
        ("x", "depth_00001.png\nframe_00001.json\nframe_00001.jpg\ninfo.json\n".into()),
    ]
    .map(|(folder, names)| Seed::plain(folder, names))
    .into()
}

pub fn intrinsics() -> Vec<Seed> {
    let matrix = "[500, 0, 0, 0, 501, 0, 320, 240, 1]";
    [
        format!("{{\"width\": 640, \"height\": 480, \"intrinsic_matrix\": {matrix}}}"),
        "{\"camera\": {\"fx\": 500.5, \"fy\": 501, \"cx\": 319.5, \"cy\": 239.5}, \"w\": 640, \"h\": 480}".into(),
        "{\"intrinsics\": [500, 0, 320, 0, 501, 240, 0, 0, 1]}".into(),
        "500 0 320\n0 501 240\n0 0 1\n".into(),
        "Fx,603.4\nFy,603.1\nPPx,315.2\nPPy,241.9\nResolution x,640\nResolution y,480\n".into(),
        "500 501 320 240\n".into(),
    ]
    .map(|text| Seed::plain("camera.json", text))
    .into()
}

pub fn textures() -> Vec<Seed> {
    let vertices = rows(|p| format!("v {} {} {}\nvt {} {}\n", p.x, p.y, p.z, p.x / 5.0, p.y / 4.0));
    let obj = format!("mtllib a.mtl\n{vertices}usemtl m\nf 1/1 2/2 7/7\nusemtl n\nf 1/1 7/7 6/6 5/5\n");
    let materials = b"newmtl m\nKd 0.5 0.25 1\nmap_Kd -s 1 1 a.png\nnewmtl n\nKd 1 0 0\n";
    // a small grey JPEG
    let jpeg = base64_jpeg();
    [rgb_png(), jpeg]
        .iter()
        .map(|picture| Seed {
            name: "mesh.obj".into(),
            bytes: joined(&[obj.as_bytes(), materials, picture]),
            wrap: summed,
        })
        .collect()
}

/// A JPEG of 8 x 8 grey pixels.
fn base64_jpeg() -> Vec<u8> {
    use base64::Engine;
    const TEXT: &str = include_str!("grey.jpg.base64");
    base64::engine::general_purpose::STANDARD.decode(TEXT.trim()).expect("a picture")
}
