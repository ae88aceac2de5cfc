-- Whom the service tells by itself of what happens. A webhook goes with the key that has made it.
CREATE TABLE webhook (
    id     TEXT    NOT NULL PRIMARY KEY,
    -- null for who needed no key
    key_id TEXT REFERENCES api_key (id) ON DELETE CASCADE,
    name   TEXT    NOT NULL,
    url    TEXT    NOT NULL,
    -- names of kinds of events, as JSON
    events TEXT    NOT NULL,
    -- messages are signed with it, so no hash would do
    secret BLOB    NOT NULL CHECK (length(secret) = 32),
    -- messages that were not queued since too many waited
    missed INTEGER NOT NULL DEFAULT 0
) STRICT;

CREATE INDEX webhook_by_key ON webhook (key_id);

-- Messages: written in the transaction of what they tell, so that a crash loses none.
CREATE TABLE delivery (
    id         TEXT    NOT NULL PRIMARY KEY,
    webhook_id TEXT    NOT NULL REFERENCES webhook (id) ON DELETE CASCADE,
    event      TEXT    NOT NULL,
    body       TEXT    NOT NULL,
    status     TEXT    NOT NULL DEFAULT 'pending' CHECK (status IN ('pending', 'delivered', 'dead')),
    attempts   INTEGER NOT NULL DEFAULT 0,
    -- when it is sent next if it waits, else when it ended
    at         INTEGER NOT NULL,
    -- the status of the last answer, and why the last attempt failed
    answer     INTEGER,
    error      TEXT,
    -- from where it is being sent: a process that begins there knows that the one before is gone
    seat       TEXT
) STRICT;

CREATE INDEX delivery_by_time ON delivery (status, at);
CREATE INDEX delivery_by_webhook ON delivery (webhook_id, status, id);
