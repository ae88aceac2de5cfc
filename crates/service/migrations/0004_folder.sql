-- Which data folder this is the database of: the folder holds the same id in a file of its own.
CREATE TABLE folder (
    only_row   INTEGER NOT NULL PRIMARY KEY CHECK (only_row = 1),
    id         TEXT    NOT NULL,
    -- when it was last tried whether something can be written
    checked_at INTEGER NOT NULL DEFAULT 0
) STRICT;

-- Files that may be on disk without a row that knows them: those that are being stored (written before the file is put
-- in its place, and deleted with the row that knows it), and those of rows that were deleted (until they are removed).
CREATE TABLE loose_file (
    kind       TEXT    NOT NULL CHECK (kind IN ('scan_set', 'scan', 'model', 'standard')),
    id         TEXT    NOT NULL,
    -- of a scan
    scan_set_id TEXT   CHECK ((scan_set_id IS NOT NULL) = (kind = 'scan')),
    is_deleted INTEGER NOT NULL CHECK (is_deleted IN (0, 1)),
    since      INTEGER NOT NULL,
    PRIMARY KEY (kind, id)
) STRICT, WITHOUT ROWID;

-- BLAKE3 of the content, hexadecimal; null for those from before, until the next start has filled it in.
ALTER TABLE signature ADD COLUMN checksum TEXT;
CREATE INDEX signature_without_checksum ON signature (model_id) WHERE checksum IS NULL;
