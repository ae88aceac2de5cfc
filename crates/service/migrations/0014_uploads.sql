-- Files that come piece by piece. What has arrived of each lies in the folder of uploads under its id; how much that is tells its size.
CREATE TABLE upload (
    id          TEXT    NOT NULL PRIMARY KEY,
    scan_set_id TEXT    NOT NULL REFERENCES scan_set (id) ON DELETE CASCADE,
    name        TEXT    NOT NULL,
    bytes       INTEGER NOT NULL CHECK (bytes > 0),
    -- as Content-Digest has it
    digest      TEXT,
    expires_at  INTEGER NOT NULL,
    -- it has become a scan; the row tells those who ask again
    is_done     INTEGER NOT NULL DEFAULT 0 CHECK (is_done IN (0, 1))
) STRICT, WITHOUT ROWID;

CREATE INDEX upload_by_scan_set ON upload (scan_set_id, is_done);
CREATE INDEX upload_by_end ON upload (expires_at);
