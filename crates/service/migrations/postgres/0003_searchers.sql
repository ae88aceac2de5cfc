-- Servers that search a part of the gallery for others: where they are reached, and which parts they have whole.
CREATE TABLE gallery_searcher (
    node_id TEXT COLLATE "C" NOT NULL PRIMARY KEY REFERENCES node (id) ON DELETE CASCADE,
    address TEXT COLLATE "C" NOT NULL,
    -- a set of 256, as hexadecimal digits
    parts TEXT COLLATE "C" NOT NULL,
    -- when it has said so
    seen_at BIGINT NOT NULL
);

-- What those who use this database show each other: 244 random bits, from the server's own source for keys.
CREATE TABLE gallery_secret (
    only_row BIGINT NOT NULL PRIMARY KEY CHECK (only_row = 1),
    secret TEXT COLLATE "C" NOT NULL
);

INSERT INTO gallery_secret SELECT 1, replace(concat(gen_random_uuid(), gen_random_uuid()), '-', '');
