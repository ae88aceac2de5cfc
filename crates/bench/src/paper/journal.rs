//! Finished trials, one JSON line each: appended as they end, read again by the next run.

use std::collections::BTreeMap;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use serde::{Deserialize, Serialize};

use super::trial::{TrialKey, TrialRecord};

/// What has to be the same for trials to be compared: the journal's first line.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings {
    /// The program's version.
    visage: String,
    /// Whether the paper's methods ran on all points.
    full: bool,
}

impl Settings {
    /// Those of this program.
    pub fn of(full: bool) -> Settings {
        Settings { visage: env!("CARGO_PKG_VERSION").to_owned(), full }
    }
}

/// The journal.
pub struct Journal {
    path: PathBuf,
    file: std::fs::File,
    records: BTreeMap<TrialKey, TrialRecord>,
}

impl Journal {
    /// Opens the journal or begins one. A last line that was cut off, since the program was stopped while writing it,
    /// is dropped.
    pub fn open(path: &Path, settings: Settings) -> anyhow::Result<Journal> {
        let reading = || format!("reading {}", path.display());
        let mut file = std::fs::OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .with_context(reading)?;
        let text = std::fs::read_to_string(path).with_context(reading)?;
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        file.set_len(whole as u64).with_context(reading)?;
        file.seek(SeekFrom::End(0)).with_context(reading)?;
        let mut journal = Journal { path: path.to_owned(), file, records: BTreeMap::new() };
        let mut lines = text[..whole].lines();
        match lines.next() {
            None => journal.write_line(&settings)?,
            Some(line) => {
                let found: Settings = serde_json::from_str(line).with_context(reading)?;
                ensure!(
                    found == settings,
                    "{} is of a run with other settings ({line}); give another --out",
                    path.display()
                );
            }
        }
        for (number, line) in lines.enumerate() {
            match serde_json::from_str::<TrialRecord>(line) {
                Ok(record) => journal.records.insert(record.key.clone(), record),
                Err(error) => bail!("{}, line {}: {error}; delete the line", path.display(), number + 2),
            };
        }
        Ok(journal)
    }

    /// Whether a trial is finished.
    pub fn holds(&self, key: &TrialKey) -> bool {
        self.records.contains_key(key)
    }

    /// A finished trial.
    pub fn record(&self, key: &TrialKey) -> Option<&TrialRecord> {
        self.records.get(key)
    }

    /// Keeps a finished trial.
    pub fn append(&mut self, record: TrialRecord) -> anyhow::Result<()> {
        self.write_line(&record)?;
        self.records.insert(record.key.clone(), record);
        Ok(())
    }

    fn write_line(&mut self, value: &impl Serialize) -> anyhow::Result<()> {
        let mut line = serde_json::to_string(value)?;
        line.push('\n');
        self.file.write_all(line.as_bytes()).with_context(|| format!("writing {}", self.path.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(trial: u32) -> TrialRecord {
        TrialRecord { key: TrialKey { set: "bunny".to_owned(), noise: 1, trial }, start_mm2: 3.5, results: Vec::new() }
    }

    #[test]
    fn a_line_cut_off_is_dropped_and_written_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("trials.jsonl");
        let mut journal = Journal::open(&path, Settings::of(false)).expect("a new journal");
        journal.append(record(0)).expect("written");
        journal.append(record(1)).expect("written");
        drop(journal);
        let text = std::fs::read_to_string(&path).expect("there");
        std::fs::write(&path, &text[..text.len() - 10]).expect("cut");

        let mut journal = Journal::open(&path, Settings::of(false)).expect("half a line is no harm");
        assert!(journal.holds(&record(0).key) && !journal.holds(&record(1).key));
        journal.append(record(1)).expect("written");
        drop(journal);
        assert_eq!(std::fs::read_to_string(&path).expect("there"), text);
    }

    #[test]
    fn trials_of_other_settings_are_not_mixed_in() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("trials.jsonl");
        drop(Journal::open(&path, Settings::of(false)).expect("a new journal"));
        let refused = Journal::open(&path, Settings::of(true)).err().expect("other settings");
        assert!(refused.to_string().contains("--out"), "{refused}");
    }
}
