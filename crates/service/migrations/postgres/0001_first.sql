-- As the migrations of SQLite leave it with their sixteenth; what stands there about a column holds here too. Later changes have
-- a file in both folders.
--
-- Text is compared byte by byte, whatever the language of the server: ids sort by the time of creation, pages go on after a name.

-- A list is one parameter, as text, for SQLite and for this.
CREATE FUNCTION json_each(list TEXT) RETURNS TABLE (value TEXT) LANGUAGE sql IMMUTABLE ROWS 100 AS
    'SELECT element FROM json_array_elements_text(list::json) AS elements (element)';

CREATE TABLE scan_set (
    id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    name TEXT COLLATE "C" NOT NULL,
    unit TEXT COLLATE "C" NOT NULL CHECK (unit IN ('mm', 'cm', 'm', 'in', 'unknown')),
    -- the pose file as it was sent: parsing it again gives the same poses to the last bit
    poses_name TEXT COLLATE "C",
    poses BYTEA,
    passed_over TEXT COLLATE "C",
    CHECK ((poses IS NULL) = (poses_name IS NULL))
);

CREATE TABLE scan (
    scan_set_id TEXT COLLATE "C" NOT NULL REFERENCES scan_set (id) ON DELETE CASCADE,
    name TEXT COLLATE "C" NOT NULL,
    -- the file's name on disk: never the user's name
    file_id TEXT COLLATE "C" NOT NULL UNIQUE,
    points BIGINT NOT NULL CHECK (points >= 0),
    bytes BIGINT NOT NULL CHECK (bytes >= 0),
    checksum TEXT COLLATE "C" NOT NULL,
    reading TEXT COLLATE "C",
    PRIMARY KEY (scan_set_id, name)
);

CREATE TABLE job (
    id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    kind TEXT COLLATE "C" NOT NULL CHECK (kind IN ('register', 'surface', 'evaluate')),
    scan_set_id TEXT COLLATE "C" REFERENCES scan_set (id) ON DELETE CASCADE,
    label TEXT COLLATE "C",
    options TEXT COLLATE "C" NOT NULL,
    status TEXT COLLATE "C" NOT NULL CHECK (status IN ('queued', 'running', 'succeeded', 'failed', 'canceled')),
    stage TEXT COLLATE "C",
    progress DOUBLE PRECISION NOT NULL DEFAULT 0 CHECK (progress BETWEEN 0 AND 1),
    stage_seconds TEXT COLLATE "C" NOT NULL DEFAULT '{}',
    attempts BIGINT NOT NULL DEFAULT 0,
    cancel_asked BOOLEAN NOT NULL DEFAULT FALSE,
    worker TEXT COLLATE "C",
    leased_until BIGINT,
    error TEXT COLLATE "C",
    started_at BIGINT,
    finished_at BIGINT,
    base_model_id TEXT COLLATE "C",
    base_poses BYTEA,
    hints TEXT COLLATE "C",
    seat TEXT COLLATE "C",
    CHECK ((base_poses IS NULL) = (base_model_id IS NULL)),
    CHECK ((kind = 'register') = (scan_set_id IS NOT NULL)),
    CHECK (kind <> 'surface' OR base_model_id IS NOT NULL),
    CHECK ((status = 'running') = (worker IS NOT NULL)),
    CHECK ((status = 'running') = (leased_until IS NOT NULL))
);

CREATE INDEX job_by_status ON job (status, id);
CREATE INDEX job_by_scan_set ON job (scan_set_id);

CREATE TABLE model (
    id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    -- both are null for a model that was uploaded as such
    job_id TEXT COLLATE "C" UNIQUE REFERENCES job (id) ON DELETE CASCADE,
    scan_set_id TEXT COLLATE "C" REFERENCES scan_set (id) ON DELETE CASCADE,
    name TEXT COLLATE "C" NOT NULL,
    label TEXT COLLATE "C",
    unit TEXT COLLATE "C" NOT NULL CHECK (unit IN ('mm', 'cm', 'm', 'in', 'unknown')),
    points BIGINT NOT NULL CHECK (points >= 0),
    quality TEXT COLLATE "C",
    reading TEXT COLLATE "C"
);

CREATE INDEX model_by_scan_set ON model (scan_set_id);
CREATE INDEX model_by_label ON model (label, id);

CREATE TABLE asset (
    model_id TEXT COLLATE "C" NOT NULL REFERENCES model (id) ON DELETE CASCADE,
    name TEXT COLLATE "C" NOT NULL,
    bytes BIGINT NOT NULL CHECK (bytes >= 0),
    checksum TEXT COLLATE "C" NOT NULL,
    PRIMARY KEY (model_id, name)
);

CREATE TABLE signature (
    model_id TEXT COLLATE "C" NOT NULL PRIMARY KEY REFERENCES model (id) ON DELETE CASCADE,
    version BIGINT NOT NULL,
    summary TEXT COLLATE "C" NOT NULL,
    content BYTEA NOT NULL,
    checksum TEXT COLLATE "C"
);

CREATE INDEX signature_by_version ON signature (version, model_id);
CREATE INDEX signature_without_checksum ON signature (model_id) WHERE checksum IS NULL;

CREATE TABLE replay (
    route TEXT COLLATE "C" NOT NULL,
    key TEXT COLLATE "C" NOT NULL,
    body_hash TEXT COLLATE "C" NOT NULL,
    status BIGINT NOT NULL,
    location TEXT COLLATE "C" NOT NULL,
    body TEXT COLLATE "C" NOT NULL,
    -- what was created: the answer goes when it goes
    resource_id TEXT COLLATE "C" NOT NULL,
    created_at BIGINT NOT NULL,
    PRIMARY KEY (route, key)
);

CREATE INDEX replay_by_resource ON replay (resource_id);

CREATE TABLE standard (
    id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    name TEXT COLLATE "C" NOT NULL UNIQUE,
    -- the file it was made of, on disk under a name of ours
    asset TEXT COLLATE "C" NOT NULL,
    bytes BIGINT NOT NULL CHECK (bytes >= 0),
    checksum TEXT COLLATE "C" NOT NULL,
    unit TEXT COLLATE "C" NOT NULL CHECK (unit IN ('mm', 'cm', 'm', 'in', 'unknown')),
    -- JSON: the landmarks and the triangle as the user gave them
    annotation TEXT COLLATE "C" NOT NULL,
    -- JSON: what the operator of this version made of them
    version BIGINT NOT NULL,
    class TEXT COLLATE "C" NOT NULL
);

CREATE TABLE example (
    standard_id TEXT COLLATE "C" NOT NULL REFERENCES standard (id) ON DELETE CASCADE,
    model_id TEXT COLLATE "C" NOT NULL REFERENCES model (id) ON DELETE CASCADE,
    is_positive BOOLEAN NOT NULL,
    PRIMARY KEY (standard_id, model_id)
);

CREATE INDEX example_by_model ON example (model_id);

CREATE TABLE verdict (
    standard_id TEXT COLLATE "C" NOT NULL REFERENCES standard (id) ON DELETE CASCADE,
    model_id TEXT COLLATE "C" NOT NULL REFERENCES model (id) ON DELETE CASCADE,
    version BIGINT NOT NULL,
    residual_mm DOUBLE PRECISION NOT NULL,
    -- JSON: where the class was found; null if nowhere
    found TEXT COLLATE "C",
    -- why the model could not be looked at; null if it was
    reason TEXT COLLATE "C",
    PRIMARY KEY (standard_id, model_id)
);

CREATE INDEX verdict_by_residual ON verdict (standard_id, version, residual_mm, model_id);
CREATE INDEX verdict_by_model ON verdict (model_id);

CREATE TABLE folder (
    only_row BIGINT NOT NULL PRIMARY KEY CHECK (only_row = 1),
    id TEXT COLLATE "C" NOT NULL,
    -- when it was last tried whether something can be written
    checked_at BIGINT NOT NULL DEFAULT 0
);

CREATE TABLE loose_file (
    kind TEXT COLLATE "C" NOT NULL CHECK (kind IN ('scan_set', 'scan', 'model', 'standard')),
    id TEXT COLLATE "C" NOT NULL,
    -- of a scan
    scan_set_id TEXT COLLATE "C" CHECK ((scan_set_id IS NOT NULL) = (kind = 'scan')),
    is_deleted BOOLEAN NOT NULL,
    since BIGINT NOT NULL,
    seat TEXT COLLATE "C",
    process TEXT COLLATE "C" CHECK ((process IS NULL) = (seat IS NULL)),
    PRIMARY KEY (kind, id)
);

CREATE TABLE api_key (
    id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    name TEXT COLLATE "C" NOT NULL,
    scope TEXT COLLATE "C" NOT NULL CHECK (scope IN ('metrics', 'read', 'write', 'admin')),
    -- BLAKE3 of the secret, which is stored nowhere
    secret BYTEA NOT NULL CHECK (length(secret) = 32),
    expires_at BIGINT,
    revoked_at BIGINT
);

CREATE TABLE session (
    id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    key_id TEXT COLLATE "C" NOT NULL REFERENCES api_key (id) ON DELETE CASCADE,
    secret BYTEA NOT NULL CHECK (length(secret) = 32),
    expires_at BIGINT NOT NULL
);

CREATE INDEX session_by_end ON session (expires_at);

CREATE TABLE audit (
    id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    -- null for who needed no key
    key_id TEXT COLLATE "C",
    -- the request's, as in the log
    request TEXT COLLATE "C" NOT NULL,
    method TEXT COLLATE "C" NOT NULL,
    -- as in the contract: /v1/models/{id}
    route TEXT COLLATE "C" NOT NULL,
    -- the id or name in the path, or of what was made
    target TEXT COLLATE "C",
    status BIGINT NOT NULL,
    client TEXT COLLATE "C"
);

CREATE INDEX audit_by_target ON audit (target, id);
CREATE INDEX audit_by_key ON audit (key_id, id);

CREATE TABLE made_by (
    id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    -- null for who needed no key
    key_id TEXT COLLATE "C"
);

CREATE INDEX made_by_key ON made_by (key_id);

CREATE TABLE expiry (
    scan_set_id TEXT COLLATE "C" NOT NULL PRIMARY KEY REFERENCES scan_set (id) ON DELETE CASCADE,
    at BIGINT NOT NULL
);

CREATE INDEX expiry_by_time ON expiry (at);

CREATE TABLE webhook (
    id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    -- null for who needed no key
    key_id TEXT COLLATE "C" REFERENCES api_key (id) ON DELETE CASCADE,
    name TEXT COLLATE "C" NOT NULL,
    url TEXT COLLATE "C" NOT NULL,
    -- names of kinds of events, as JSON
    events TEXT COLLATE "C" NOT NULL,
    -- messages are signed with it, so no hash would do
    secret BYTEA NOT NULL CHECK (length(secret) = 32),
    -- messages that were not queued since too many waited
    missed BIGINT NOT NULL DEFAULT 0
);

CREATE INDEX webhook_by_key ON webhook (key_id);

CREATE TABLE delivery (
    id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    webhook_id TEXT COLLATE "C" NOT NULL REFERENCES webhook (id) ON DELETE CASCADE,
    event TEXT COLLATE "C" NOT NULL,
    body TEXT COLLATE "C" NOT NULL,
    status TEXT COLLATE "C" NOT NULL DEFAULT 'pending' CHECK (status IN ('pending', 'delivered', 'dead')),
    attempts BIGINT NOT NULL DEFAULT 0,
    -- when it is sent next if it waits, else when it ended
    at BIGINT NOT NULL,
    -- the status of the last answer, and why the last attempt failed
    answer BIGINT,
    error TEXT COLLATE "C",
    -- from where it is being sent: a process that begins there knows that the one before is gone
    seat TEXT COLLATE "C"
);

CREATE INDEX delivery_by_time ON delivery (status, at);
CREATE INDEX delivery_by_webhook ON delivery (webhook_id, status, id);

CREATE TABLE upload (
    id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    scan_set_id TEXT COLLATE "C" NOT NULL REFERENCES scan_set (id) ON DELETE CASCADE,
    name TEXT COLLATE "C" NOT NULL,
    bytes BIGINT NOT NULL CHECK (bytes > 0),
    -- as Content-Digest has it
    digest TEXT COLLATE "C",
    expires_at BIGINT NOT NULL,
    -- it has become a scan; the row tells those who ask again
    is_done BOOLEAN NOT NULL DEFAULT FALSE
);

CREATE INDEX upload_by_scan_set ON upload (scan_set_id, is_done);
CREATE INDEX upload_by_end ON upload (expires_at);

CREATE TABLE segment (
    id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    models BIGINT NOT NULL,
    bytes BIGINT NOT NULL,
    -- of its head, which holds those of all else
    checksum BIGINT NOT NULL
);

CREATE TABLE unfiled (
    model_id TEXT COLLATE "C" NOT NULL PRIMARY KEY
);

CREATE TABLE bin (
    -- holds the time of the deletion
    id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    kind TEXT COLLATE "C" NOT NULL CHECK (kind IN ('scan_set', 'job', 'model')),
    -- the id of what was deleted
    thing TEXT COLLATE "C" NOT NULL UNIQUE,
    name TEXT COLLATE "C" NOT NULL,
    label TEXT COLLATE "C"
);

CREATE FUNCTION signature_is_unfiled() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO unfiled VALUES (CASE WHEN TG_OP = 'DELETE' THEN OLD.model_id ELSE NEW.model_id END) ON CONFLICT DO NOTHING;
    RETURN NULL;
END $$;

CREATE TRIGGER signature_is_new AFTER INSERT ON signature FOR EACH ROW EXECUTE FUNCTION signature_is_unfiled();
CREATE TRIGGER signature_is_other AFTER UPDATE OF content, checksum ON signature
    FOR EACH ROW EXECUTE FUNCTION signature_is_unfiled();
CREATE TRIGGER signature_is_gone AFTER DELETE ON signature FOR EACH ROW EXECUTE FUNCTION signature_is_unfiled();

CREATE TABLE binned_scan_set AS SELECT '' COLLATE "C" AS bin_id, * FROM scan_set WHERE FALSE;
CREATE TABLE binned_scan AS SELECT '' COLLATE "C" AS bin_id, * FROM scan WHERE FALSE;
CREATE TABLE binned_expiry AS SELECT '' COLLATE "C" AS bin_id, * FROM expiry WHERE FALSE;
CREATE TABLE binned_job AS SELECT '' COLLATE "C" AS bin_id, * FROM job WHERE FALSE;
CREATE TABLE binned_model AS SELECT '' COLLATE "C" AS bin_id, * FROM model WHERE FALSE;
CREATE TABLE binned_asset AS SELECT '' COLLATE "C" AS bin_id, * FROM asset WHERE FALSE;
CREATE TABLE binned_signature AS SELECT '' COLLATE "C" AS bin_id, * FROM signature WHERE FALSE;
CREATE TABLE binned_example AS SELECT '' COLLATE "C" AS bin_id, * FROM example WHERE FALSE;

CREATE INDEX binned_scan_set_by_entry ON binned_scan_set (bin_id);
CREATE INDEX binned_scan_by_entry ON binned_scan (bin_id);
CREATE INDEX binned_expiry_by_entry ON binned_expiry (bin_id);
CREATE INDEX binned_job_by_entry ON binned_job (bin_id);
CREATE INDEX binned_model_by_entry ON binned_model (bin_id);
CREATE INDEX binned_asset_by_entry ON binned_asset (bin_id);
CREATE INDEX binned_signature_by_entry ON binned_signature (bin_id);
CREATE INDEX binned_example_by_entry ON binned_example (bin_id);
CREATE INDEX binned_asset_by_model ON binned_asset (model_id);
