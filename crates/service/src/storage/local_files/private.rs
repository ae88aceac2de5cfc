//! Files and folders that only their owner may read, whatever the umask says: scans of people are nobody else's
//! business.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::Path;

/// Options that create files for the owner alone.
pub(super) fn options() -> OpenOptions {
    let mut options = File::options();
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options
}

/// Creates a file that must not be there yet.
pub(super) fn create_new(path: &Path) -> io::Result<File> {
    options().write(true).create_new(true).open(path)
}

/// Creates a folder, and those above it.
pub(super) fn create_folder(folder: &Path) -> io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(folder)
}

/// Takes the rights of others away from what is there already.
pub(super) fn restrict(path: &Path) -> io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let found = fs::metadata(path)?.permissions();
        if found.mode() & 0o077 != 0 {
            return fs::set_permissions(path, fs::Permissions::from_mode(found.mode() & 0o700));
        }
    }
    Ok(())
}
