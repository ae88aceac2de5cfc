-- From where a request came, as far as the proxies that are trusted tell; null before.
ALTER TABLE audit ADD COLUMN client TEXT;
