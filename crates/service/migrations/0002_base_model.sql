-- A job may add scans to a finished model. The poses of that model are kept with the job as they were when it was
-- accepted, so that it ends the same whatever becomes of the model in the meantime.
ALTER TABLE job ADD COLUMN base_model_id TEXT;
ALTER TABLE job ADD COLUMN base_poses BLOB CHECK ((base_poses IS NULL) = (base_model_id IS NULL));
