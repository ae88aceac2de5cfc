//! `visage openapi`: the contract on standard output.

/// Prints the contract.
pub(super) fn run() -> anyhow::Result<()> {
    print!("{}", crate::http::openapi_yaml()?);
    Ok(())
}
