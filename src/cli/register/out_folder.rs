//! The folder for the results.

use std::path::Path;

use anyhow::{Context, ensure};

/// Makes the folder for the results, and refuses one that can't be written or that holds the scans, before any work.
pub fn make_out(out: &Path, scans: &Path) -> anyhow::Result<()> {
    ensure!(
        out.is_dir() || !out.exists(),
        "--out {} is a file: give a folder, or the name of a new one",
        out.display()
    );
    let is_same = |a: &Path, b: &Path| a.canonicalize().ok().zip(b.canonicalize().ok()).is_some_and(|(a, b)| a == b);
    ensure!(
        !is_same(out, scans),
        "--out {} is the folder of the scans: the next run would take the results for scans; give another folder",
        out.display()
    );
    std::fs::create_dir_all(out).with_context(|| format!("making {}", out.display()))?;
    tempfile::tempfile_in(out).with_context(|| format!("writing to {}", out.display()))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_go_to_a_folder_of_their_own() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join("file"), "").expect("written");
        let refused = |out: &Path| make_out(out, folder.path()).expect_err("refused").to_string();
        assert!(refused(&folder.path().join("file")).ends_with("is a file: give a folder, or the name of a new one"));
        assert!(refused(&folder.path().join(".")).contains("is the folder of the scans"));
        assert!(refused(&folder.path().join("file/out")).starts_with("making "));
        make_out(&folder.path().join("new/out"), folder.path()).expect("made");
        assert!(folder.path().join("new/out").is_dir());
    }
}
