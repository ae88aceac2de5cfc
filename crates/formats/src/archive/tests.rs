use super::*;
use std::io::{Cursor, Write};
use zip::write::SimpleFileOptions;

fn zipped(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (path, bytes) in files {
        writer.start_file(*path, SimpleFileOptions::default()).expect("in memory");
        writer.write_all(bytes).expect("in memory");
    }
    writer.finish().expect("in memory").into_inner()
}

fn header(size: u64, kind: tar::EntryType) -> tar::Header {
    let mut header = tar::Header::new_gnu();
    header.set_size(size);
    header.set_entry_type(kind);
    header.set_mode(0o644);
    header
}

fn tarred(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut builder = tar::Builder::new(Vec::new());
    for (path, bytes) in files {
        let mut header = header(bytes.len() as u64, tar::EntryType::Regular);
        // as it is, whatever it names
        let short = header.as_old_mut().name.iter_mut().zip(path.bytes());
        short.for_each(|(to, from)| *to = from);
        header.set_cksum();
        builder.append(&header, *bytes).expect("in memory");
    }
    builder.into_inner().expect("in memory")
}

fn gzipped(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).expect("in memory");
    encoder.finish().expect("in memory")
}

/// The same files as archives of every kind.
fn archives(files: &[(&str, &[u8])]) -> [(&'static str, Vec<u8>); 3] {
    let tar = tarred(files);
    [("set.ZIP", zipped(files)), ("set.tgz", gzipped(&tar)), ("set.tar", tar)]
}

fn read(name: &str, bytes: &[u8]) -> Result<Contents, FormatError> {
    entries(name, bytes, &ArchiveLimits::default())
}

fn message(name: &str, bytes: &[u8]) -> String {
    read(name, bytes).expect_err(name).to_string()
}

#[test]
fn names_tell_archives() {
    for name in ["a.zip", "A.ZIP", "a.tar", "a.tar.gz", "a.tgz"] {
        assert!(is_archive(name), "{name}");
    }
    for name in ["a.ply.gz", "zip", "a.7z", "a.zip.ply"] {
        assert!(!is_archive(name), "{name}");
        assert!(message(name, b"").contains("is no archive that can be unfolded; send a .zip"), "{name}");
    }
}

#[test]
fn files_come_in_order_and_the_rest_is_listed() {
    let files: [(&str, &[u8]); 9] = [
        ("set/scan 2.ply", b"two"),
        ("./set/scan 1.ply", b"one"),
        ("__MACOSX/set/._scan 1.ply", b"x"),
        ("set/._scan 1.ply", b"x"),
        ("set/.DS_Store", b"x"),
        ("set/Thumbs.db", b"x"),
        ("../../etc/passwd", b"x"),
        ("/etc/passwd", b"x"),
        ("C:\\a.ply", b"x"),
    ];
    for (name, bytes) in archives(&files) {
        let contents = read(name, &bytes).expect(name);
        let entry = |path: &str, bytes: &[u8]| Entry { path: path.into(), bytes: bytes.to_vec() };
        assert_eq!(contents.entries, [entry("set/scan 2.ply", b"two"), entry("set/scan 1.ply", b"one")], "{name}");
        let reasons: Vec<&str> = contents.passed_over.iter().map(|(_, why)| *why).collect();
        let mac = "is what a Mac notes of a file";
        let windows = "is what Windows notes of a folder";
        let out = ["leads out of the archive", "has an absolute path", "has an absolute path"];
        assert_eq!(reasons, [&[mac, mac, "is hidden", windows][..], &out].concat(), "{name}");
    }
}

#[test]
fn two_files_of_one_name_are_refused() {
    for (first, second) in [("a/b.ply", "a\\b.ply"), ("a.ply", "./a.ply"), ("a.ply", "A.PLY")] {
        for (name, bytes) in archives(&[(first, b"1"), (second, b"2")]) {
            assert!(message(name, &bytes).contains("two files in the archive are named"), "{name} {second}");
        }
    }
    let twice = tarred(&[("a.ply", b"1"), ("a.ply", b"2")]);
    assert!(message("a.tar", &twice).contains("two files in the archive are named \"a.ply\""));
    let mut twice = zipped(&[("a.ply", b"1"), ("b.ply", b"2")]);
    while let Some(place) = memchr::memmem::find(&twice, b"b.ply") {
        twice[place] = b'a';
    }
    assert!(message("a.zip", &twice).contains("two files in the archive have the same name"));
}

#[test]
fn links_are_passed_over_and_an_archive_without_files_is_refused() {
    let mut builder = tar::Builder::new(Vec::new());
    for (kind, path) in
        [(tar::EntryType::Symlink, "a.ply"), (tar::EntryType::Link, "b.ply"), (tar::EntryType::Fifo, "c")]
    {
        builder.append_link(&mut header(0, kind), path, "/etc/passwd").expect("in memory");
    }
    let links = builder.into_inner().expect("in memory");
    let error = message("a.tar", &links);
    assert!(
        error.starts_with("the whole archive: there are no files in the archive: \"a.ply\" is a link; pack"),
        "{error}"
    );
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    writer.add_directory("folder", SimpleFileOptions::default()).expect("in memory");
    writer.add_symlink("a.ply", "/etc/passwd", SimpleFileOptions::default()).expect("in memory");
    let links = writer.finish().expect("in memory").into_inner();
    assert!(message("a.zip", &links).contains("\"a.ply\" is a link"));
    assert!(message("a.zip", &zipped(&[])).contains("there are no files in the archive; pack the scans"));
}

#[test]
fn limits_hold_for_counts_sizes_and_the_sum() {
    let files: Vec<(String, Vec<u8>)> = (0..5).map(|k| (format!("{k}.ply"), vec![k; 1000])).collect();
    let files: Vec<(&str, &[u8])> = files.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())).collect();
    let limits = ArchiveLimits { max_entries: 5, max_file_bytes: 1000, max_total_bytes: 5000 };
    for (name, bytes) in archives(&files) {
        assert_eq!(entries(name, &bytes, &limits).expect(name).entries.len(), 5);
        let refused = |limits: ArchiveLimits| entries(name, &bytes, &limits).expect_err(name).to_string();
        let error = refused(ArchiveLimits { max_entries: 4, ..limits });
        assert!(error.starts_with("entries of the archive 5 exceeds the limit of 4"), "{name}: {error}");
        let error = refused(ArchiveLimits { max_file_bytes: 999, ..limits });
        assert!(error.starts_with("a file of the archive has 1000 bytes, more than the 999"), "{name}: {error}");
        let error = refused(ArchiveLimits { max_total_bytes: 4999, ..limits });
        assert!(error.starts_with("unpacked, the archive has 5000 bytes, more than the 4999"), "{name}: {error}");
    }
}

#[test]
fn bombs_are_stopped_by_what_they_grow_to() {
    let zeros = vec![0; 17 << 20];
    for (name, bytes) in archives(&[("a.ply", &zeros)]) {
        let result = read(name, &bytes);
        match name {
            "set.tar" => assert!(result.is_ok(), "it is not packed"),
            _ => {
                let error = result.expect_err(name).to_string();
                assert!(
                    error.contains("more than the 16777216") || error.contains("unpacked, it has"),
                    "{name}: {error}"
                );
            }
        }
    }
}

#[test]
fn what_is_damaged_cut_short_or_encrypted_is_refused_whole() {
    let body: Vec<u8> = (0..600u32).flat_map(|k| (k * k).to_le_bytes()).collect();
    for (name, whole) in archives(&[("a.ply", &body), ("b.ply", b"two")]) {
        let sound = read(name, &whole).expect(name);
        for length in (0..whole.len() - 1024).step_by(7) {
            assert!(read(name, &whole[..length]).is_err(), "{name} {length}");
        }
        for place in 0..whole.len() {
            let mut changed = whole.clone();
            changed[place] ^= 0x55;
            // never a panic; what is read of a zip or a packed tar was checked
            if let Ok(contents) = read(name, &changed)
                && name == "set.ZIP"
            {
                assert!(contents.entries.iter().all(|e| sound.entries.iter().any(|s| s.bytes == e.bytes)), "{place}");
            }
        }
    }
    let mut encrypted = zipped(&[("a.ply", b"1")]);
    for (signature, flags) in [(&b"PK\x03\x04"[..], 6), (b"PK\x01\x02", 8)] {
        let place = memchr::memmem::find(&encrypted, signature).expect("it is there");
        encrypted[place + flags] |= 1;
    }
    let error = message("a.zip", &encrypted);
    assert_eq!(error, "file \"\\\"a.ply\\\"\": it is encrypted; pack the files without a password".replace("\\\"", ""));
}
