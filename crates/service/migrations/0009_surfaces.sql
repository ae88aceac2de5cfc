-- Jobs that give a stored model a surface have no scan set: the model is their base, whose poses don't matter. SQLite can't change a
-- table's constraints, so it is built anew.
CREATE TABLE job_of_kind (
    id            TEXT    NOT NULL PRIMARY KEY,
    kind          TEXT    NOT NULL CHECK (kind IN ('register', 'surface', 'evaluate')),
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
    hints         TEXT,
    seat          TEXT,
    CHECK ((base_poses IS NULL) = (base_model_id IS NULL)),
    CHECK ((kind = 'register') = (scan_set_id IS NOT NULL)),
    CHECK (kind <> 'surface' OR base_model_id IS NOT NULL),
    CHECK ((status = 'running') = (worker IS NOT NULL)),
    CHECK ((status = 'running') = (leased_until IS NOT NULL))
) STRICT;

INSERT INTO job_of_kind (id, kind, scan_set_id, label, options, status, stage, progress, stage_seconds, attempts,
                         cancel_asked, worker, leased_until, error, started_at, finished_at, base_model_id, base_poses,
                         hints, seat)
SELECT id, kind, scan_set_id, label, options, status, stage, progress, stage_seconds, attempts,
       cancel_asked, worker, leased_until, error, started_at, finished_at, base_model_id, base_poses, hints, seat
FROM job;

DROP TABLE job;
ALTER TABLE job_of_kind RENAME TO job;
CREATE INDEX job_by_status ON job (status, id);
CREATE INDEX job_by_scan_set ON job (scan_set_id);
