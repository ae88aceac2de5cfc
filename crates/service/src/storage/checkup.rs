//! What is sound of a database and its files: `visage doctor`.

use super::inventory::{Storage, StorageError};
use super::{ObjectError, ObjectStore};
use visage_domain::{AssetRecord, ModelId, PageRequest, StoredContent, StoredFile};

/// Rows that are asked for at a time.
const PAGE: usize = 500;

/// Everything that was found.
#[derive(Debug, Default)]
pub struct Findings {
    /// What the database finds wrong with itself.
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
    /// What is wrong with files of the index; whoever reads segments fills it in.
    pub damaged_segments: Vec<String>,
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
            && self.damaged_segments.is_empty()
    }
}

/// Reads all files and holds them against the database.
pub async fn examine(storage: &Storage) -> Result<Findings, StorageError> {
    let inventory = storage.inventory(jiff::Timestamp::now()).await?;
    let mut findings = Findings {
        database: storage.database.integrity().await?,
        missing: inventory.missing,
        unknown: inventory.unknown,
        left_over: inventory.arriving.len() + inventory.deleted.len(),
        ..Findings::default()
    };
    scans(storage, &mut findings).await?;
    models(storage, &mut findings).await?;
    for standard in storage.database.standards().await? {
        let (id, asset) = (standard.id, standard.asset);
        check(storage, &mut findings, move |objects: &dyn ObjectStore| objects.read_standard(id, &asset).map(drop))
            .await?;
    }
    signatures(storage, &mut findings).await?;
    Ok(findings)
}

async fn scans(storage: &Storage, findings: &mut Findings) -> Result<(), StorageError> {
    let mut page = PageRequest { before: None, limit: PAGE };
    loop {
        let sets = storage.database.scan_sets(&page).await?;
        page.before = sets.next_cursor(|set| set.id.to_string());
        for set in sets.items {
            for scan in set.scans {
                let id = set.id;
                check(storage, findings, move |objects: &dyn ObjectStore| objects.check_scan(id, &scan)).await?;
            }
        }
        if page.before.is_none() {
            break;
        }
    }
    for (set, scan) in storage.database.binned_scans().await? {
        check(storage, findings, move |objects: &dyn ObjectStore| objects.check_scan(set, &scan)).await?;
    }
    Ok(())
}

async fn models(storage: &Storage, findings: &mut Findings) -> Result<(), StorageError> {
    let mut page = PageRequest { before: None, limit: PAGE };
    loop {
        let models = storage.database.models(&Default::default(), &page).await?;
        page.before = models.next_cursor(|model| model.id.to_string());
        for model in models.items {
            for asset in storage.database.assets(model.id).await? {
                check_asset(storage, findings, model.id, asset).await?;
            }
        }
        if page.before.is_none() {
            break;
        }
    }
    for (model, asset) in storage.database.binned_assets().await? {
        check_asset(storage, findings, model, asset).await?;
    }
    Ok(())
}

async fn check_asset(
    storage: &Storage,
    findings: &mut Findings,
    model: ModelId,
    asset: AssetRecord,
) -> Result<(), StorageError> {
    let check_asset = move |objects: &dyn ObjectStore| match objects.check_asset(model, &asset)? {
        true => Ok(()),
        false => Err(ObjectError::Damaged { what: format!("{} of model {model} is missing and", asset.name) }),
    };
    check(storage, findings, check_asset).await
}

async fn signatures(storage: &Storage, findings: &mut Findings) -> Result<(), StorageError> {
    let mut after = None;
    loop {
        let page = storage.database.signatures_after(after, PAGE).await?;
        let Some((last, _)) = page.last() else { return Ok(()) };
        after = Some(*last);
        findings.signatures_read += page.len();
        let damaged = page.iter().filter(|(_, content)| *content == StoredContent::Damaged).map(|(id, _)| *id);
        findings.damaged_signatures.extend(damaged);
    }
}

/// Reads one file; what it says of it is a finding and no error.
async fn check(
    storage: &Storage,
    findings: &mut Findings,
    read: impl FnOnce(&dyn ObjectStore) -> Result<(), ObjectError> + Send + 'static,
) -> Result<(), StorageError> {
    findings.files_read += 1;
    match storage.blocking(read).await {
        Err(StorageError::Objects(error)) => findings.damaged_files.push(error.to_string()),
        checked => checked?,
    }
    Ok(())
}

/// Sets aside what no row knows, so that a server starts on the folder again; answers with where it is now.
pub async fn set_aside(storage: &Storage, findings: &mut Findings) -> Result<String, StorageError> {
    storage.set_aside(std::mem::take(&mut findings.unknown)).await
}
