//! What the documents promise is tested: the tests that they name are there.

use std::collections::BTreeSet;
use std::path::Path;

fn read_sources(folder: &Path, read: &mut dyn FnMut(&str)) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            read_sources(&path, read);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            read(&std::fs::read_to_string(path).expect("UTF-8"));
        }
    }
}

#[test]
fn every_test_that_a_document_names_is_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut sources = String::new();
    for folder in ["tests", "crates", "src"] {
        read_sources(&root.join(folder), &mut |source| sources.push_str(source));
    }
    for (document, rows) in [("RELIABILITY.md", 20), ("SECURITY.md", 10)] {
        let text = std::fs::read_to_string(root.join("docs").join(document)).expect("a document");
        // names of tests are sentences
        let is_test = |word: &&str| {
            word.matches('_').count() >= 3
                && word.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        };
        let named: BTreeSet<&str> = text.split('`').filter(is_test).collect();
        assert!(named.len() > rows, "{document}: {named:?}");
        let missing: Vec<&&str> = named
            .iter()
            .filter(|name| ![format!("fn {name}("), format!("fn {name}<")].iter().any(|head| sources.contains(head)))
            .collect();
        assert!(missing.is_empty(), "{document} names what there is not: {missing:?}");
    }
}

/// No crate of the service can open a connection to anywhere, but for one folder that messages to webhooks leave from, and in a build
/// with `s3` one that goes to the bucket that the operator names.
#[test]
fn what_the_service_is_made_of_asks_nobody_but_webhooks() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates");
    for crate_name in ["http", "service", "pipeline", "formats", "domain", "gallery"] {
        let manifest = std::fs::read_to_string(root.join(crate_name).join("Cargo.toml")).expect("a manifest");
        for client in ["reqwest", "ureq", "hyper-rustls", "curl", "isahc"] {
            let is_of_bucket = |line: &str| line.starts_with("s3 = ") || line.contains("optional = true");
            let mut uses = manifest.lines().filter(|line| line.contains(client));
            assert!(uses.all(|line| crate_name == "service" && is_of_bucket(line)), "{crate_name} uses {client}");
        }
        let mut sources = String::new();
        // tests of the service ask it
        let without_tests = |source: &str| source.split("#[cfg(test)]").next().unwrap_or_default().to_owned();
        for entry in std::fs::read_dir(root.join(crate_name).join("src")).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() && !path.ends_with("http/src/outgoing") {
                read_sources(&path, &mut |source| sources.push_str(&without_tests(source)));
            } else if path.is_file() {
                sources.push_str(&without_tests(&std::fs::read_to_string(&path).expect("UTF-8")));
            }
        }
        for opening in ["TcpStream::connect", "UdpSocket", "client::conn", "UnixStream::connect"] {
            assert!(!sources.contains(opening), "{crate_name} names {opening}");
        }
    }
}
