//! What is kept as files, and which of them the database knows.

use std::collections::BTreeSet;

use super::{FileId, ModelId, Owner, ScanSetId, StandardId};

/// How long a file may be without a row: it gets one within moments, or never.
const LONGEST_ARRIVAL: jiff::SignedDuration = jiff::SignedDuration::from_hours(1);

/// Something in the data folder that has a row, or is about to have one, or had one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum StoredFile {
    /// All files of a scan set.
    ScanSet(ScanSetId),
    /// One scan of a set.
    Scan(ScanSetId, FileId),
    /// All files of a model.
    Model(ModelId),
    /// All files of a standard.
    Standard(StandardId),
}

impl std::fmt::Display for StoredFile {
    /// The place below the data folder.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            StoredFile::ScanSet(set) => write!(f, "scan-sets/{set}"),
            StoredFile::Scan(set, scan) => write!(f, "scan-sets/{set}/{scan}"),
            StoredFile::Model(model) => write!(f, "models/{model}"),
            StoredFile::Standard(standard) => write!(f, "standards/{standard}"),
        }
    }
}

/// A file that no row needs to know.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LooseFile {
    /// Which one.
    pub file: StoredFile,
    /// Whether its row was deleted; otherwise it was being stored.
    pub is_deleted: bool,
    /// Since when.
    pub since: jiff::Timestamp,
    /// Who stores it; `None` if nobody does any more.
    pub owner: Option<Owner>,
}

impl LooseFile {
    /// Whether nobody will give it a row any more, as `me` sees it: its process had my seat before me, or has taken too
    /// long.
    pub fn is_left(&self, me: Owner, now: jiff::Timestamp) -> bool {
        let is_at_work = self.owner.is_some_and(|owner| owner.seat != me.seat || owner.process == me.process);
        self.is_deleted || !is_at_work || now.duration_since(self.since) > LONGEST_ARRIVAL
    }
}

/// All files that rows refer to.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct KnownFiles {
    /// Scan sets, also those without a scan.
    pub scan_sets: BTreeSet<ScanSetId>,
    /// Scan files.
    pub scans: BTreeSet<(ScanSetId, FileId)>,
    /// Models.
    pub models: BTreeSet<ModelId>,
    /// Standards.
    pub standards: BTreeSet<StandardId>,
}

impl KnownFiles {
    /// Whether a row refers to it.
    pub fn knows(&self, file: StoredFile) -> bool {
        match file {
            StoredFile::ScanSet(id) => self.scan_sets.contains(&id),
            StoredFile::Scan(set, id) => self.scans.contains(&(set, id)),
            StoredFile::Model(id) => self.models.contains(&id),
            StoredFile::Standard(id) => self.standards.contains(&id),
        }
    }

    /// Everything that has to be on disk.
    pub fn needed(&self) -> impl Iterator<Item = StoredFile> {
        let scans = self.scans.iter().map(|(set, id)| StoredFile::Scan(*set, *id));
        let models = self.models.iter().map(|id| StoredFile::Model(*id));
        scans.chain(models).chain(self.standards.iter().map(|id| StoredFile::Standard(*id)))
    }
}

#[cfg(test)]
mod tests {
    use super::super::SeatId;
    use super::*;

    #[test]
    fn a_file_on_its_way_is_left_when_its_seat_has_changed_hands_or_after_a_while() {
        let (seat, now) = (SeatId::new(), jiff::Timestamp::now());
        let (owner, next, other) = (Owner::on(seat), Owner::on(seat), Owner::on(SeatId::new()));
        let file = StoredFile::Model(ModelId::new());
        let arriving = LooseFile { file, is_deleted: false, since: now, owner: Some(owner) };
        assert_eq!([owner, next, other].map(|me| arriving.is_left(me, now)), [false, true, false]);
        let later = now + LONGEST_ARRIVAL + jiff::SignedDuration::from_secs(1);
        assert_eq!([owner, other].map(|me| arriving.is_left(me, later)), [true, true]);
        let nobodys = LooseFile { owner: None, ..arriving };
        assert!(nobodys.is_left(other, now));
    }
}
