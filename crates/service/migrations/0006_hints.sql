-- What a person said of the scans (JSON) when the job was posted: a retry and a crash keep it. Null if nothing was said.
ALTER TABLE job ADD COLUMN hints TEXT;
