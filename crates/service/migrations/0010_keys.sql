-- Who may ask the service, and for what. A revoked key stays: the audit log names it, and a service that had keys once is never
-- open to everybody because the last was revoked.
CREATE TABLE api_key (
    id         TEXT    NOT NULL PRIMARY KEY,
    name       TEXT    NOT NULL,
    scope      TEXT    NOT NULL CHECK (scope IN ('metrics', 'read', 'write', 'admin')),
    -- BLAKE3 of the secret, which is stored nowhere
    secret     BLOB    NOT NULL CHECK (length(secret) = 32),
    expires_at INTEGER,
    revoked_at INTEGER
) STRICT;

-- Browsers that have shown a key.
CREATE TABLE session (
    id         TEXT    NOT NULL PRIMARY KEY,
    key_id     TEXT    NOT NULL REFERENCES api_key (id) ON DELETE CASCADE,
    secret     BLOB    NOT NULL CHECK (length(secret) = 32),
    expires_at INTEGER NOT NULL
) STRICT;

CREATE INDEX session_by_end ON session (expires_at);

-- Who did what to what. A deleted thing stays named here by its id alone.
CREATE TABLE audit (
    id      TEXT    NOT NULL PRIMARY KEY,
    -- null for who needed no key
    key_id  TEXT,
    -- the request's, as in the log
    request TEXT    NOT NULL,
    method  TEXT    NOT NULL,
    -- as in the contract: /v1/models/{id}
    route   TEXT    NOT NULL,
    -- the id or name in the path, or of what was made
    target  TEXT,
    status  INTEGER NOT NULL
) STRICT;

CREATE INDEX audit_by_target ON audit (target, id);
CREATE INDEX audit_by_key ON audit (key_id, id);

-- Which key has made what: its quotas count it.
CREATE TABLE made_by (
    id     TEXT NOT NULL PRIMARY KEY,
    -- null for who needed no key
    key_id TEXT
) STRICT, WITHOUT ROWID;

CREATE INDEX made_by_key ON made_by (key_id);
