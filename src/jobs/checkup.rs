//! What of a data folder is sound: `visage doctor`.

use std::sync::Arc;

use super::opening::{DataFolder, OpenError};
use crate::blobs::{BlobError, Blobs};
use crate::store::{ModelId, PageRequest, StoreError, StoredContent, StoredFile};

/// Rows that are asked for at a time.
const PAGE: usize = 500;

/// Everything that was found.
#[derive(Debug, Default)]
pub struct Findings {
    /// What SQLite says of its file.
    pub database: Vec<String>,
    /// What has a row but no file.
    pub missing: Vec<StoredFile>,
    /// Files without a row that nothing explains.
    pub unknown: Vec<StoredFile>,
    /// Files that a crash or a deletion has left: the next start takes care of them.
    pub left_over: usize,
    /// Files that are not what was stored.
    pub damaged_files: Vec<String>,
    /// Models whose signature is not what was stored.
    pub damaged_signatures: Vec<ModelId>,
    /// How many files were read.
    pub files_read: usize,
    /// How many signatures were read.
    pub signatures_read: usize,
}

impl Findings {
    /// Whether nothing has to be done.
    pub fn is_sound(&self) -> bool {
        self.database.is_empty()
            && self.missing.is_empty()
            && self.unknown.is_empty()
            && self.damaged_files.is_empty()
            && self.damaged_signatures.is_empty()
    }
}

/// Reads all of a data folder and holds it against the database.
pub async fn examine(data: &DataFolder) -> Result<Findings, OpenError> {
    let inventory = data.inventory().await?;
    let mut findings = Findings {
        database: data.store.integrity().await?,
        missing: inventory.missing,
        unknown: inventory.unknown,
        left_over: inventory.arriving.len() + inventory.deleted.len(),
        ..Findings::default()
    };
    scans(data, &mut findings).await?;
    models(data, &mut findings).await?;
    for standard in data.store.standards().await? {
        let (id, asset) = (standard.id, standard.asset);
        check(&data.blobs, &mut findings, move |blobs| blobs.read_standard(id, &asset).map(drop)).await?;
    }
    signatures(data, &mut findings).await?;
    Ok(findings)
}

async fn scans(data: &DataFolder, findings: &mut Findings) -> Result<(), OpenError> {
    let mut page = PageRequest { before: None, limit: PAGE };
    loop {
        let sets = data.store.scan_sets(&page).await?;
        page.before = sets.next_cursor(|set| set.id.to_string());
        for set in sets.items {
            for scan in set.scans {
                let id = set.id;
                check(&data.blobs, findings, move |blobs| blobs.check_scan(id, &scan)).await?;
            }
        }
        if page.before.is_none() {
            return Ok(());
        }
    }
}

async fn models(data: &DataFolder, findings: &mut Findings) -> Result<(), OpenError> {
    let mut page = PageRequest { before: None, limit: PAGE };
    loop {
        let models = data.store.models(&Default::default(), &page).await?;
        page.before = models.next_cursor(|model| model.id.to_string());
        for model in models.items {
            for asset in data.store.assets(model.id).await? {
                let check_asset = move |blobs: &Blobs| match blobs.open_sound(model.id, &asset)? {
                    Some(_) => Ok(()),
                    None => {
                        Err(BlobError::Damaged { what: format!("{} of model {} is missing and", asset.name, model.id) })
                    }
                };
                check(&data.blobs, findings, check_asset).await?;
            }
        }
        if page.before.is_none() {
            return Ok(());
        }
    }
}

async fn signatures(data: &DataFolder, findings: &mut Findings) -> Result<(), OpenError> {
    let mut after = None;
    loop {
        let page = data.store.signatures_after(after, PAGE).await?;
        let Some((last, _)) = page.last() else { return Ok(()) };
        after = Some(*last);
        findings.signatures_read += page.len();
        let damaged = page.iter().filter(|(_, content)| *content == StoredContent::Damaged).map(|(id, _)| *id);
        findings.damaged_signatures.extend(damaged);
    }
}

/// Reads one file; what it says of it is a finding and no error.
async fn check(
    blobs: &Arc<Blobs>,
    findings: &mut Findings,
    read: impl FnOnce(&Blobs) -> Result<(), BlobError> + Send + 'static,
) -> Result<(), OpenError> {
    let blobs = blobs.clone();
    findings.files_read += 1;
    if let Err(error) = tokio::task::spawn_blocking(move || read(&blobs)).await? {
        findings.damaged_files.push(error.to_string());
    }
    Ok(())
}

/// Sets aside what no row knows, so that a server starts on the folder again; answers with where it is now.
pub async fn set_aside(data: &DataFolder, findings: &mut Findings) -> Result<std::path::PathBuf, OpenError> {
    data.set_aside(std::mem::take(&mut findings.unknown)).await
}

/// Whether the database itself is what is broken, so that nothing else can be looked at.
pub fn is_of_database(error: &OpenError) -> bool {
    matches!(error, OpenError::Store(StoreError::Corrupt { .. }))
}
