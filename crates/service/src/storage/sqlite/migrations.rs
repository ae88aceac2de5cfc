//! The migrations, which the program brings along.

use sqlx::migrate::Migrator;

use crate::storage::migrations::files;

const FILES: [(&str, &str); 17] = files!["../../../migrations/";
    "0001_first",
    "0002_base_model",
    "0003_standards",
    "0004_folder",
    "0005_readings",
    "0006_hints",
    "0007_owners",
    "0008_passed_over",
    "0009_surfaces",
    "0010_keys",
    "0011_expiry",
    "0012_webhooks",
    "0013_clients",
    "0014_uploads",
    "0015_segments",
    "0016_bin",
    "0017_nodes",
];

/// All of them.
pub fn migrator() -> Migrator {
    crate::storage::migrations::migrator(&FILES)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_the_folder_is_listed_under_its_number() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/migrations");
        let name = |entry: std::io::Result<std::fs::DirEntry>| {
            entry.expect("an entry").file_name().to_string_lossy().into_owned()
        };
        let mut there: Vec<_> = std::fs::read_dir(folder).expect("the migrations").map(name).collect();
        // those of the other database have a folder of their own
        there.retain(|name| name != "postgres");
        there.sort();
        assert_eq!(there, FILES.map(|(name, _)| format!("{name}.sql")));
        for (migration, (name, sql)) in migrator().iter().zip(FILES) {
            assert!(name.starts_with(&format!("{:04}_", migration.version)), "{name} is no. {}", migration.version);
            assert_eq!(migration.sql.as_str(), sql);
        }
    }

    /// A database remembers by this sum what was done to it, and is refused when the file has changed since.
    #[test]
    fn a_migration_that_has_run_somewhere_does_not_change() {
        let first = migrator().iter().next().map(|migration| migration.checksum[..4].to_vec());
        assert_eq!(first, Some(vec![0x8a, 0xad, 0x17, 0x82]));
    }
}
