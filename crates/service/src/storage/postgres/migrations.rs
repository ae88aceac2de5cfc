//! The migrations of PostgreSQL.

use sqlx::migrate::Migrator;

use crate::storage::migrations::files;

const FILES: [(&str, &str); 3] = files!["../../../migrations/postgres/"; "0001_first", "0002_nodes", "0003_searchers"];

/// All of them.
pub(super) fn migrator() -> Migrator {
    crate::storage::migrations::migrator(&FILES)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_the_folder_is_listed_under_its_number() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/migrations/postgres");
        let there = std::fs::read_dir(folder).expect("the migrations").count();
        assert_eq!(there, FILES.len());
        for (migration, (name, _)) in migrator().iter().zip(FILES) {
            assert!(name.starts_with(&format!("{:04}_", migration.version)), "{name} is no. {}", migration.version);
        }
    }
}
