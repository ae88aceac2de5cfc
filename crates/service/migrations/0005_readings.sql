-- What of a file was not taken when it was read (JSON); null if all of it was, and for what was stored before.
ALTER TABLE scan ADD COLUMN reading TEXT;
ALTER TABLE model ADD COLUMN reading TEXT;
