-- Each node has files of the index of its own, in its own folder: those that count, and what they don't tell, is by node.
CREATE TABLE node (
    id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    -- when it was last there
    seen_at BIGINT NOT NULL
);

INSERT INTO node SELECT id, checked_at FROM folder;

ALTER TABLE segment ADD COLUMN node_id TEXT COLLATE "C" REFERENCES node (id) ON DELETE CASCADE;
UPDATE segment SET node_id = (SELECT id FROM folder);
ALTER TABLE segment ALTER COLUMN node_id SET NOT NULL;
CREATE INDEX segment_by_node ON segment (node_id);

ALTER TABLE unfiled ADD COLUMN node_id TEXT COLLATE "C" REFERENCES node (id) ON DELETE CASCADE;
UPDATE unfiled SET node_id = (SELECT id FROM folder);
ALTER TABLE unfiled DROP CONSTRAINT unfiled_pkey;
ALTER TABLE unfiled ADD PRIMARY KEY (node_id, model_id);

-- What became of which model, in the order of the commits: whoever knows all up to a number asks for what came after it. Signatures are written
-- under the write lock, so a number that can be seen has all smaller ones before it.
CREATE TABLE gallery_change (
    model_id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    version BIGINT NOT NULL,
    at BIGINT NOT NULL
);

CREATE INDEX gallery_change_by_version ON gallery_change (version);
CREATE INDEX gallery_change_by_time ON gallery_change (at);

CREATE TABLE gallery_version (
    only_row BIGINT NOT NULL PRIMARY KEY CHECK (only_row = 1),
    -- of the last change
    version BIGINT NOT NULL,
    -- changes up to this one may have been forgotten
    forgotten BIGINT NOT NULL
);

INSERT INTO gallery_version VALUES (1, 0, 0);

CREATE OR REPLACE FUNCTION signature_is_unfiled() RETURNS trigger LANGUAGE plpgsql AS $$
DECLARE
    changed TEXT := CASE WHEN TG_OP = 'DELETE' THEN OLD.model_id ELSE NEW.model_id END;
    now_ms BIGINT := CAST(extract(epoch FROM clock_timestamp()) * 1000 AS BIGINT);
    number BIGINT;
BEGIN
    INSERT INTO unfiled (node_id, model_id) SELECT id, changed FROM node ON CONFLICT DO NOTHING;
    UPDATE gallery_version SET version = version + 1 RETURNING version INTO number;
    INSERT INTO gallery_change VALUES (changed, number, now_ms)
        ON CONFLICT (model_id) DO UPDATE SET version = excluded.version, at = excluded.at;
    PERFORM pg_notify('visage', 'gallery');
    RETURN NULL;
END $$;

-- A bell for all processes, which look at the tables when it rings. What rings it twice in a transaction rings once.
CREATE FUNCTION rings() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    PERFORM pg_notify('visage', TG_ARGV[0]);
    RETURN NULL;
END $$;

CREATE TRIGGER job_is_new AFTER INSERT ON job FOR EACH STATEMENT EXECUTE FUNCTION rings('work');
CREATE TRIGGER job_is_gone AFTER DELETE ON job FOR EACH STATEMENT EXECUTE FUNCTION rings('work');
CREATE TRIGGER job_is_other AFTER UPDATE ON job FOR EACH ROW
    WHEN (OLD.status <> NEW.status OR OLD.cancel_asked <> NEW.cancel_asked) EXECUTE FUNCTION rings('work');
CREATE TRIGGER job_goes_on AFTER UPDATE ON job FOR EACH ROW
    WHEN (OLD.progress <> NEW.progress OR OLD.stage IS DISTINCT FROM NEW.stage) EXECUTE FUNCTION rings('progress');
CREATE TRIGGER delivery_is_new AFTER INSERT ON delivery FOR EACH STATEMENT EXECUTE FUNCTION rings('messages');
CREATE TRIGGER delivery_is_other AFTER UPDATE ON delivery FOR EACH ROW
    WHEN (OLD.status <> NEW.status) EXECUTE FUNCTION rings('messages');
