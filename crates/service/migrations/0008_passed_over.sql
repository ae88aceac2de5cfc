-- Files that came with the set and were not kept, with why (JSON); null if there were none.
ALTER TABLE scan_set ADD COLUMN passed_over TEXT;
