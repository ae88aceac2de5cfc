//! The browser of the person at this machine.

use std::process::{Command, Stdio};

use anyhow::{Context, ensure};

#[cfg(target_os = "macos")]
const PROGRAM: &[&str] = &["open"];
#[cfg(windows)]
const PROGRAM: &[&str] = &["rundll32", "url.dll,FileProtocolHandler"];
#[cfg(not(any(target_os = "macos", windows)))]
const PROGRAM: &[&str] = &["xdg-open"];

/// Asks the desktop to open an address.
pub(super) fn open(address: &str) -> anyhow::Result<()> {
    let [program, arguments @ ..] = PROGRAM else { return Ok(()) };
    let failed = || format!("{program} did not open the page: open {address} yourself");
    let quiet = || Stdio::null();
    let mut command = Command::new(program);
    let status = command.args(arguments).arg(address).stdin(quiet()).stdout(quiet()).stderr(quiet()).status();
    ensure!(status.with_context(failed)?.success(), failed());
    Ok(())
}
