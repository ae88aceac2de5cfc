//! PCD, NumPy arrays and KITTI's rows of floats.

use visage_formats::pcd;

use super::{Seed, cloud, floats, rows};

pub fn pcd() -> Vec<Seed> {
    let head = |data: &str| {
        format!(
            "VERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 5\nHEIGHT 4\n\
             VIEWPOINT 0 0 9 1 0 0 0\nPOINTS 20\nDATA {data}\n"
        )
    };
    let binary = floats();
    let literal: Vec<u8> = binary.chunks(32).flat_map(|run| [&[run.len() as u8 - 1], run].concat()).collect();
    // a run of one byte, copied from the byte before it
    let run = [&[0u8, 7, 0xe0, 255, 0][..], &[0xe0, 46, 0]].concat();
    let sizes =
        |packed: usize, unpacked: usize| [(packed as u32).to_le_bytes(), (unpacked as u32).to_le_bytes()].concat();
    let wide = "FIELDS x y z _ normal_x normal_y normal_z intensity\nSIZE 8 8 8 1 4 4 4 2\nTYPE F F F U F F F U\nCOUNT 1 1 1 8 1 1 1 1\n";
    vec![
        Seed::plain("text.pcd", head("ascii") + &rows(|p| format!("{} {} {} 66051\n", p.x, p.y, p.z))),
        Seed::plain("binary.pcd", [head("binary").as_bytes(), &binary].concat()),
        Seed::plain(
            "packed.pcd",
            [head("binary_compressed").as_bytes(), &sizes(literal.len(), binary.len()), &literal].concat(),
        ),
        Seed::plain("run.pcd", [head("binary_compressed").as_bytes(), &sizes(run.len(), 320), &run].concat()),
        Seed::plain(
            "wide.pcd",
            [format!("{wide}WIDTH 4\nHEIGHT 1\nPOINTS 4\nDATA binary\n").as_bytes(), &[0; 4 * 46]].concat(),
        ),
        Seed::plain("cloud.pcd", pcd::write_cloud(&cloud())),
    ]
}

/// An array as NumPy saves it.
pub fn array(descr: &str, order: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let mut header = format!("{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}");
    while !(header.len() + 11).is_multiple_of(64) {
        header.push(' ');
    }
    header.push('\n');
    [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), data].concat()
}

pub fn npy() -> Vec<Seed> {
    let named = "[('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('rgb', '<u4')]";
    vec![
        Seed::plain("rows.npy", array("'<f4'", "False", "(20, 4)", &floats())),
        Seed::plain("columns.npy", array("'>i2'", "True", "(40, 4)", &floats())),
        Seed::plain("image.npy", array("'|u1'", "False", "(4, 5, 3)", &floats()[..60])),
        Seed::plain("named.npy", array(named, "False", "(20,)", &floats())),
        Seed::plain("whole.npy", array("'<i2'", "False", "(40, 4)", &floats())),
    ]
}

pub fn kitti() -> Vec<Seed> {
    let five: Vec<u8> = floats().chunks(16).skip(1).flat_map(|row| [row, &[0; 4]].concat()).collect();
    vec![Seed::plain("lidar.bin", floats().repeat(8)), Seed::plain("lidar.pcd.bin", five)]
}
