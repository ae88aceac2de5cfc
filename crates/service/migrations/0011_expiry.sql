-- When a scan set is to be deleted, with all that was made of it; none if it is kept.
CREATE TABLE expiry (
    scan_set_id TEXT    NOT NULL PRIMARY KEY REFERENCES scan_set (id) ON DELETE CASCADE,
    at          INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

CREATE INDEX expiry_by_time ON expiry (at);
