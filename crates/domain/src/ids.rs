//! Identifiers: UUIDs of version 7, so that they sort by the time of creation.

use uuid::Uuid;

macro_rules! id_type {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(Uuid);

        impl $name {
            /// A new one, later than all made before in this process.
            pub fn new() -> Self {
                $name(Uuid::now_v7())
            }

            /// Reads the usual form with hyphens; `None` for anything else.
            pub fn parse(text: &str) -> Option<Self> {
                // other spellings of the same id would name the same thing by two addresses
                let id = Uuid::parse_str(text).ok()?;
                (id.get_version_num() == 7 && id.hyphenated().to_string() == text).then_some($name(id))
            }

            /// When it was made, to the millisecond.
            pub fn created_at(self) -> jiff::Timestamp {
                // every id here is of version 7, which holds the time
                let (seconds, nanoseconds) = self.0.get_timestamp().map_or((0, 0), |time| time.to_unix());
                let seconds = i64::try_from(seconds).unwrap_or(0);
                let nanoseconds = i32::try_from(nanoseconds).unwrap_or(0);
                jiff::Timestamp::new(seconds, nanoseconds).unwrap_or_default()
            }

            /// What sorts before all made at this time or later, and after all made before.
            pub fn earliest_at(time: jiff::Timestamp) -> Self {
                let milliseconds = u128::try_from(time.as_millisecond()).unwrap_or(0);
                // version 7 and the variant of RFC 9562, and nothing random
                $name(Uuid::from_u128((milliseconds << 80) | (7 << 76) | (2 << 62)))
            }

            /// The id as a number, in the same order.
            pub fn number(self) -> u128 {
                self.0.as_u128()
            }

            /// The inverse of [`Self::number`].
            pub fn from_number(number: u128) -> Self {
                $name(Uuid::from_u128(number))
            }
        }

        impl Default for $name {
            fn default() -> Self {
                Self::new()
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                self.0.hyphenated().fmt(f)
            }
        }
    };
}

id_type!(
    /// Names a scan set.
    ScanSetId
);
id_type!(
    /// Names a job.
    JobId
);
id_type!(
    /// Names a model.
    ModelId
);
id_type!(
    /// Names a standard that a user has made.
    StandardId
);
id_type!(
    /// Names a data folder: the folder and its database hold the same.
    FolderId
);
id_type!(
    /// Names a stored scan file: users' file names never reach the disk.
    FileId
);

id_type!(
    /// Names a file of the index: a segment of the gallery.
    SegmentId
);
id_type!(
    /// Names a process for as long as it runs.
    ProcessId
);
id_type!(
    /// Names what only one process has at a time, and the next one after it; see [`Owner`](super::Owner).
    SeatId
);

id_type!(
    /// Names a key.
    KeyId
);
id_type!(
    /// Names a session of the page.
    SessionId
);
id_type!(
    /// Names an entry of the audit log.
    AuditId
);
id_type!(
    /// Names a webhook.
    WebhookId
);
id_type!(
    /// Names a message to a webhook.
    DeliveryId
);
id_type!(
    /// Names an entry of the recycle bin.
    BinId
);
id_type!(
    /// Names a file that comes piece by piece.
    UploadId
);

impl From<FolderId> for SeatId {
    /// The lock of a data folder is a seat.
    fn from(folder: FolderId) -> Self {
        SeatId(folder.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_survives_text_and_number() {
        let id = ModelId::new();
        assert_eq!(ModelId::parse(&id.to_string()), Some(id));
        assert_eq!(ModelId::from_number(id.number()), id);
    }

    #[test]
    fn ids_sort_by_time_as_text_too() {
        let ids: Vec<String> = (0..100).map(|_| JobId::new().to_string()).collect();
        assert!(ids.is_sorted());
    }

    #[test]
    fn an_id_holds_the_time() {
        let age = jiff::Timestamp::now().duration_since(JobId::new().created_at());
        assert!((0..1000).contains(&age.as_millis()), "{age:?}");
    }

    #[test]
    fn a_time_stands_between_the_ids_before_and_after_it() {
        let id = JobId::new();
        let before = JobId::earliest_at(id.created_at());
        let after = JobId::earliest_at(id.created_at() + jiff::SignedDuration::from_millis(1));
        assert!(before <= id && id < after, "{before} {id} {after}");
        assert_eq!(JobId::parse(&before.to_string()), Some(before));
        assert_eq!(before.created_at().as_millisecond(), id.created_at().as_millisecond());
    }

    #[test]
    fn other_spellings_are_refused() {
        let id = JobId::new().to_string();
        assert_eq!(JobId::parse(&id.to_uppercase()), None);
        assert_eq!(JobId::parse(&id.replace('-', "")), None);
        assert_eq!(JobId::parse("../../etc/passwd"), None);
        assert_eq!(JobId::parse("00000000-0000-4000-8000-000000000000"), None);
    }
}
