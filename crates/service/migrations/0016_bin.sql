-- What was deleted and can still be put back. Its rows are taken out of the tables that answers are made of, into tables of the same
-- columns: so no statement but those of the bin can find them.
CREATE TABLE bin (
    -- holds the time of the deletion
    id    TEXT NOT NULL PRIMARY KEY,
    kind  TEXT NOT NULL CHECK (kind IN ('scan_set', 'job', 'model')),
    -- the id of what was deleted
    thing TEXT NOT NULL UNIQUE,
    name  TEXT NOT NULL,
    label TEXT
) STRICT;

-- A later migration that adds a column to one of these tables adds it to the one of the bin, too (a test compares them).
CREATE TABLE binned_scan_set AS SELECT '' AS bin_id, * FROM scan_set WHERE 0;
CREATE TABLE binned_scan AS SELECT '' AS bin_id, * FROM scan WHERE 0;
CREATE TABLE binned_expiry AS SELECT '' AS bin_id, * FROM expiry WHERE 0;
CREATE TABLE binned_job AS SELECT '' AS bin_id, * FROM job WHERE 0;
CREATE TABLE binned_model AS SELECT '' AS bin_id, * FROM model WHERE 0;
CREATE TABLE binned_asset AS SELECT '' AS bin_id, * FROM asset WHERE 0;
CREATE TABLE binned_signature AS SELECT '' AS bin_id, * FROM signature WHERE 0;
CREATE TABLE binned_example AS SELECT '' AS bin_id, * FROM example WHERE 0;

CREATE INDEX binned_scan_set_by_entry ON binned_scan_set (bin_id);
CREATE INDEX binned_scan_by_entry ON binned_scan (bin_id);
CREATE INDEX binned_expiry_by_entry ON binned_expiry (bin_id);
CREATE INDEX binned_job_by_entry ON binned_job (bin_id);
CREATE INDEX binned_model_by_entry ON binned_model (bin_id);
CREATE INDEX binned_asset_by_entry ON binned_asset (bin_id);
CREATE INDEX binned_asset_by_model ON binned_asset (model_id);
CREATE INDEX binned_signature_by_entry ON binned_signature (bin_id);
CREATE INDEX binned_example_by_entry ON binned_example (bin_id);
