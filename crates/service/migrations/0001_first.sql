-- Times are milliseconds since 1970 (UTC). Ids are UUIDs of version 7 as text:
-- they sort by the time of creation, and hold it.

CREATE TABLE scan_set (
    id         TEXT    NOT NULL PRIMARY KEY,
    name       TEXT    NOT NULL,
    unit       TEXT    NOT NULL CHECK (unit IN ('mm', 'cm', 'm', 'in', 'unknown')),
    -- the pose file as it was sent: parsing it again gives the same poses to the last bit
    poses_name TEXT,
    poses      BLOB,
    CHECK ((poses IS NULL) = (poses_name IS NULL))
) STRICT;

CREATE TABLE scan (
    scan_set_id TEXT    NOT NULL REFERENCES scan_set (id) ON DELETE CASCADE,
    name        TEXT    NOT NULL,
    -- the file's name on disk: never the user's name
    file_id     TEXT    NOT NULL UNIQUE,
    points      INTEGER NOT NULL CHECK (points >= 0),
    bytes       INTEGER NOT NULL CHECK (bytes >= 0),
    checksum    TEXT    NOT NULL,
    PRIMARY KEY (scan_set_id, name)
) STRICT, WITHOUT ROWID;

-- The table is the queue.
CREATE TABLE job (
    id            TEXT    NOT NULL PRIMARY KEY,
    scan_set_id   TEXT    NOT NULL REFERENCES scan_set (id) ON DELETE CASCADE,
    label         TEXT,
    options       TEXT    NOT NULL,
    status        TEXT    NOT NULL CHECK (status IN ('queued', 'running', 'succeeded', 'failed', 'canceled')),
    stage         TEXT,
    progress      REAL    NOT NULL DEFAULT 0 CHECK (progress BETWEEN 0 AND 1),
    stage_seconds TEXT    NOT NULL DEFAULT '{}',
    attempts      INTEGER NOT NULL DEFAULT 0,
    cancel_asked  INTEGER NOT NULL DEFAULT 0,
    -- who runs it, and until when nobody else may; only set while running
    worker        TEXT,
    leased_until  INTEGER,
    -- JSON {code, message, scan, hint}, once failed
    error         TEXT,
    started_at    INTEGER,
    finished_at   INTEGER,
    CHECK ((status = 'running') = (worker IS NOT NULL)),
    CHECK ((status = 'running') = (leased_until IS NOT NULL))
) STRICT;

CREATE INDEX job_by_status ON job (status, id);
CREATE INDEX job_by_scan_set ON job (scan_set_id);

CREATE TABLE model (
    id          TEXT    NOT NULL PRIMARY KEY,
    -- both are null for a model that was uploaded as such
    job_id      TEXT    UNIQUE REFERENCES job (id) ON DELETE CASCADE,
    scan_set_id TEXT    REFERENCES scan_set (id) ON DELETE CASCADE,
    name        TEXT    NOT NULL,
    label       TEXT,
    unit        TEXT    NOT NULL CHECK (unit IN ('mm', 'cm', 'm', 'in', 'unknown')),
    points      INTEGER NOT NULL CHECK (points >= 0),
    quality     TEXT
) STRICT;

CREATE INDEX model_by_scan_set ON model (scan_set_id);
CREATE INDEX model_by_label ON model (label, id);

CREATE TABLE asset (
    model_id TEXT    NOT NULL REFERENCES model (id) ON DELETE CASCADE,
    name     TEXT    NOT NULL,
    bytes    INTEGER NOT NULL CHECK (bytes >= 0),
    checksum TEXT    NOT NULL,
    PRIMARY KEY (model_id, name)
) STRICT, WITHOUT ROWID;

-- One BLOB a model, beside the version of the operator that made it.
CREATE TABLE signature (
    model_id TEXT    NOT NULL PRIMARY KEY REFERENCES model (id) ON DELETE CASCADE,
    version  INTEGER NOT NULL,
    summary  TEXT    NOT NULL,
    content  BLOB    NOT NULL
) STRICT;

-- Answers to POSTs that carried an Idempotency-Key, so that a repeated request gets the same one.
CREATE TABLE replay (
    route       TEXT    NOT NULL,
    key         TEXT    NOT NULL,
    body_hash   TEXT    NOT NULL,
    status      INTEGER NOT NULL,
    location    TEXT    NOT NULL,
    body        TEXT    NOT NULL,
    -- what was created: the answer goes when it goes
    resource_id TEXT    NOT NULL,
    created_at  INTEGER NOT NULL,
    PRIMARY KEY (route, key)
) STRICT, WITHOUT ROWID;

CREATE INDEX replay_by_resource ON replay (resource_id);
