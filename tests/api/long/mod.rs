//! What takes minutes or root, and so is asked for by `.ci/long` alone.

mod full_disk;
mod kills;
mod load;
