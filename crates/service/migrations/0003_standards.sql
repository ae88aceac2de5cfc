-- Standards made by users, the examples they mark, and the verdict on every model against each. Jobs get a kind: beside
-- registrations there are evaluations, which work on no scan set. SQLite can't change a constraint in place, so the
-- table is built anew; foreign keys are not enforced while migrations run, else dropping it would take its models along.

CREATE TABLE job_of_kind (
    id            TEXT    NOT NULL PRIMARY KEY,
    kind          TEXT    NOT NULL CHECK (kind IN ('register', 'evaluate')),
    scan_set_id   TEXT    REFERENCES scan_set (id) ON DELETE CASCADE,
    label         TEXT,
    options       TEXT    NOT NULL,
    status        TEXT    NOT NULL CHECK (status IN ('queued', 'running', 'succeeded', 'failed', 'canceled')),
    stage         TEXT,
    progress      REAL    NOT NULL DEFAULT 0 CHECK (progress BETWEEN 0 AND 1),
    stage_seconds TEXT    NOT NULL DEFAULT '{}',
    attempts      INTEGER NOT NULL DEFAULT 0,
    cancel_asked  INTEGER NOT NULL DEFAULT 0,
    worker        TEXT,
    leased_until  INTEGER,
    error         TEXT,
    started_at    INTEGER,
    finished_at   INTEGER,
    base_model_id TEXT,
    base_poses    BLOB,
    CHECK ((base_poses IS NULL) = (base_model_id IS NULL)),
    CHECK ((kind = 'register') = (scan_set_id IS NOT NULL)),
    CHECK ((status = 'running') = (worker IS NOT NULL)),
    CHECK ((status = 'running') = (leased_until IS NOT NULL))
) STRICT;

INSERT INTO job_of_kind (id, kind, scan_set_id, label, options, status, stage, progress, stage_seconds, attempts,
                         cancel_asked, worker, leased_until, error, started_at, finished_at, base_model_id, base_poses)
SELECT id, 'register', scan_set_id, label, options, status, stage, progress, stage_seconds, attempts,
       cancel_asked, worker, leased_until, error, started_at, finished_at, base_model_id, base_poses
FROM job;

DROP TABLE job;
ALTER TABLE job_of_kind RENAME TO job;
CREATE INDEX job_by_status ON job (status, id);
CREATE INDEX job_by_scan_set ON job (scan_set_id);

CREATE TABLE standard (
    id         TEXT    NOT NULL PRIMARY KEY,
    name       TEXT    NOT NULL UNIQUE,
    -- the file it was made of, on disk under a name of ours
    asset      TEXT    NOT NULL,
    bytes      INTEGER NOT NULL CHECK (bytes >= 0),
    checksum   TEXT    NOT NULL,
    unit       TEXT    NOT NULL CHECK (unit IN ('mm', 'cm', 'm', 'in', 'unknown')),
    -- JSON: the landmarks and the triangle as the user gave them
    annotation TEXT    NOT NULL,
    -- JSON: what the operator of this version made of them
    version    INTEGER NOT NULL,
    class      TEXT    NOT NULL
) STRICT;

-- Models that the user has marked as of the class or as other things.
CREATE TABLE example (
    standard_id TEXT    NOT NULL REFERENCES standard (id) ON DELETE CASCADE,
    model_id    TEXT    NOT NULL REFERENCES model (id) ON DELETE CASCADE,
    is_positive INTEGER NOT NULL CHECK (is_positive IN (0, 1)),
    PRIMARY KEY (standard_id, model_id)
) STRICT, WITHOUT ROWID;

CREATE INDEX example_by_model ON example (model_id);

-- One for each model that was looked at. Of two models the one with the lower residual is more of the class.
CREATE TABLE verdict (
    standard_id TEXT    NOT NULL REFERENCES standard (id) ON DELETE CASCADE,
    model_id    TEXT    NOT NULL REFERENCES model (id) ON DELETE CASCADE,
    version     INTEGER NOT NULL,
    residual_mm REAL    NOT NULL,
    -- JSON: where the class was found; null if nowhere
    found       TEXT,
    -- why the model could not be looked at; null if it was
    reason      TEXT,
    PRIMARY KEY (standard_id, model_id)
) STRICT, WITHOUT ROWID;

CREATE INDEX verdict_by_residual ON verdict (standard_id, version, residual_mm, model_id);
CREATE INDEX verdict_by_model ON verdict (model_id);

-- Signatures of older versions are looked for when a server starts.
CREATE INDEX signature_by_version ON signature (version, model_id);
