-- Files of the index over the signatures that count. A model is what these say of it, unless it is unfiled.
CREATE TABLE segment (
    id       TEXT    NOT NULL PRIMARY KEY,
    models   INTEGER NOT NULL,
    bytes    INTEGER NOT NULL,
    -- of its head, which holds those of all else
    checksum INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

-- Models of which no file tells what their signature does: those with one that came or changed since, and those without one that a
-- file may still know.
CREATE TABLE unfiled (
    model_id TEXT NOT NULL PRIMARY KEY
) STRICT, WITHOUT ROWID;

INSERT INTO unfiled SELECT model_id FROM signature;

CREATE TRIGGER signature_is_new AFTER INSERT ON signature BEGIN
    INSERT OR IGNORE INTO unfiled VALUES (NEW.model_id);
END;

CREATE TRIGGER signature_is_other AFTER UPDATE OF content, checksum ON signature BEGIN
    INSERT OR IGNORE INTO unfiled VALUES (NEW.model_id);
END;

CREATE TRIGGER signature_is_gone AFTER DELETE ON signature BEGIN
    INSERT OR IGNORE INTO unfiled VALUES (OLD.model_id);
END;
