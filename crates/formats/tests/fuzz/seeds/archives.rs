//! Zip and tar.

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use zip::CompressionMethod;

use super::packed::{gzip, zipped};
use super::{Seed, cloud};

/// A tar of files, a folder and a link; the long name takes a block of its own.
fn tar() -> Vec<u8> {
    let mut builder = tar::Builder::new(Vec::new());
    let mut header = tar::Header::new_gnu();
    let long = format!("scans/{}.ply", "long".repeat(40));
    for (name, bytes) in [("scans/a.ply", &b"ply\n"[..]), (&long, b"b"), ("._a.ply", b"c")] {
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        builder.append_data(&mut header, name, bytes).expect("to memory");
    }
    let mut link = tar::Header::new_gnu();
    link.set_entry_type(tar::EntryType::Symlink);
    link.set_size(0);
    builder.append_link(&mut link, "link", "scans/a.ply").expect("to memory");
    builder.into_inner().expect("to memory")
}

/// The checksums of a tar's heads made right, where blocks look like heads.
fn summed(tar: &[u8]) -> Vec<u8> {
    let mut tar = tar.to_vec();
    for block in tar.chunks_exact_mut(512).filter(|block| block[257..262] == *b"ustar") {
        block[148..156].fill(b' ');
        let sum: u32 = block.iter().map(|byte| u32::from(*byte)).sum();
        block[148..156].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
    }
    tar
}

fn summed_and_packed(tar: &[u8]) -> Vec<u8> {
    gzip(&summed(tar))
}

pub fn all() -> Vec<Seed> {
    let ply = visage_formats::ply::write_cloud(&cloud(), None);
    let files: [(&str, &[u8]); 4] =
        [("a.ply", &ply), ("folder/b.ply", &ply), ("__MACOSX/._a.ply", b"x"), ("poses.txt", b"1 0 0 0\n")];
    let mut best = GzEncoder::new(Vec::new(), Compression::best());
    best.write_all(&tar()).expect("to memory");
    vec![
        Seed::plain("scans.zip", zipped(&files, CompressionMethod::Deflated)),
        Seed::plain("stored.zip", zipped(&files, CompressionMethod::Stored)),
        Seed { name: "scans.tar".into(), bytes: tar(), wrap: summed },
        Seed { name: "scans.tar.gz".into(), bytes: tar(), wrap: summed_and_packed },
        Seed::plain("raw.tgz", best.finish().expect("to memory")),
    ]
}
