//! What the machine has and what this process takes of it.

mod workers;

pub use workers::{giving_way, workers};

use std::fs;

/// The most memory this process has ever held, in bytes; `None` where the system does not say. Of this program alone:
/// `getrusage` counts what its parent held before it started this one.
pub fn peak_memory_bytes() -> Option<u64> {
    if let Some(kib) = field("/proc/self/status", "VmHWM:") {
        return Some(kib * 1024);
    }
    let usage = nix::sys::resource::getrusage(nix::sys::resource::UsageWho::RUSAGE_SELF).ok()?;
    // Linux counts in KiB, macOS in bytes
    let unit = if cfg!(target_os = "macos") { 1 } else { 1024 };
    u64::try_from(usage.max_rss()).ok().map(|size| size * unit)
}

/// The memory that this process holds now, in bytes; `None` where the system does not say.
pub fn resident_memory_bytes() -> Option<u64> {
    field("/proc/self/status", "VmRSS:").map(|kib| kib * 1024)
}

/// Seconds that all processors together have worked for this process; `None` where the system does not say.
pub fn cpu_seconds() -> Option<f64> {
    let usage = nix::sys::resource::getrusage(nix::sys::resource::UsageWho::RUSAGE_SELF).ok()?;
    let seconds = |time: nix::sys::time::TimeVal| time.tv_sec() as f64 + time.tv_usec() as f64 * 1e-6;
    Some(seconds(usage.user_time()) + seconds(usage.system_time()))
}

/// The memory that this process may use, in bytes: the machine's, or what its control group is held to. `None` where
/// the system does not say.
pub fn memory_bytes() -> Option<u64> {
    let machine = field("/proc/meminfo", "MemTotal:").map(|kib| kib * 1024);
    let group = ["/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"];
    let groups = group.iter().filter_map(|file| fs::read_to_string(file).ok()?.trim().parse().ok());
    machine.into_iter().chain(groups).min()
}

/// The number after a name in one of the system's tables.
fn field(file: &str, name: &str) -> Option<u64> {
    let text = fs::read_to_string(file).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn a_process_is_smaller_than_its_machine() {
        let (peak, memory) = (peak_memory_bytes().expect("Linux says"), memory_bytes().expect("Linux says"));
        assert!(1 << 20 < peak && peak < memory, "{peak} of {memory}");
        let now = resident_memory_bytes().expect("Linux says");
        assert!(1 << 20 < now && now < memory, "{now} of {memory}");
    }
}
