-- Several processes may use one database. Each has a seat, which only one process has at a time (the lock of a data
-- folder): whoever had it before is gone. Of processes on other seats only the end of their leases tells.

-- whose process runs the job; only of interest while it is running
ALTER TABLE job ADD COLUMN seat TEXT;
-- until now one process had the database: whoever brings it to this version is alone, and what runs was left by a dead one
UPDATE job SET leased_until = 0 WHERE status = 'running';

-- who stores the file; null for what was deleted, and for what was left before there were owners
ALTER TABLE loose_file ADD COLUMN seat TEXT;
ALTER TABLE loose_file ADD COLUMN process TEXT CHECK ((process IS NULL) = (seat IS NULL));
