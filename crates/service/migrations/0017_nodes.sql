-- Each node has files of the index of its own, in its own folder: those that count, and what they don't tell, is by node. A database in a
-- file has one node, its folder.
CREATE TABLE node (
    id      TEXT    NOT NULL PRIMARY KEY,
    -- when it was last there
    seen_at INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

INSERT INTO node SELECT id, checked_at FROM folder;

DROP TRIGGER signature_is_new;
DROP TRIGGER signature_is_other;
DROP TRIGGER signature_is_gone;

ALTER TABLE segment RENAME TO segment_before;
ALTER TABLE unfiled RENAME TO unfiled_before;

CREATE TABLE segment (
    id       TEXT    NOT NULL PRIMARY KEY,
    node_id  TEXT    NOT NULL REFERENCES node (id) ON DELETE CASCADE,
    models   INTEGER NOT NULL,
    bytes    INTEGER NOT NULL,
    -- of its head, which holds those of all else
    checksum INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

CREATE INDEX segment_by_node ON segment (node_id);

CREATE TABLE unfiled (
    node_id  TEXT NOT NULL REFERENCES node (id) ON DELETE CASCADE,
    model_id TEXT NOT NULL,
    PRIMARY KEY (node_id, model_id)
) STRICT, WITHOUT ROWID;

INSERT INTO segment SELECT segment_before.id, node.id, models, bytes, checksum FROM segment_before, node;
INSERT INTO unfiled SELECT node.id, model_id FROM unfiled_before, node;

DROP TABLE segment_before;
DROP TABLE unfiled_before;

CREATE TRIGGER signature_is_new AFTER INSERT ON signature BEGIN
    INSERT OR IGNORE INTO unfiled SELECT id, NEW.model_id FROM node;
END;

CREATE TRIGGER signature_is_other AFTER UPDATE OF content, checksum ON signature BEGIN
    INSERT OR IGNORE INTO unfiled SELECT id, NEW.model_id FROM node;
END;

CREATE TRIGGER signature_is_gone AFTER DELETE ON signature BEGIN
    INSERT OR IGNORE INTO unfiled SELECT id, OLD.model_id FROM node;
END;
