//! What registration costs as a whole process, on the real scans in the folder `VISAGE_DATA`. Alone in its program: the
//! system tells the largest size of all children together, so no other test may start one beside this.

use std::path::Path;

use visage::pipeline::Method;

#[test]
#[ignore = "needs VISAGE_DATA"]
fn the_bunny_as_a_whole_process_takes_under_ten_cpu_seconds_and_300_mb() {
    let data = std::env::var_os("VISAGE_DATA").expect("VISAGE_DATA names the folder of the real data");
    let data = Path::new(&data);
    let out = tempfile::tempdir().expect("a folder");
    let mut cpu_before = 0.0;
    for method in [Method::Joint, Method::MaAticp] {
        let status = std::process::Command::new(env!("CARGO_BIN_EXE_visage"))
            .args(["register", "--unit", "m", "--method", method.name(), "--poses"])
            .arg(data.join("init/bunny_a0.04_o_s0.json"))
            .arg("--out")
            .arg(out.path())
            .arg(data.join("stanford/bunny"))
            .status()
            .expect("the binary runs");
        assert!(status.success());
        let (cpu_after, peak_kb) = children();
        let cpu_seconds = cpu_after - cpu_before;
        cpu_before = cpu_after;
        println!("{method}: {cpu_seconds:.2} CPU s, at most {} MB", peak_kb / 1024);
        assert!(cpu_seconds < 10.0, "{cpu_seconds}");
        assert!(peak_kb < 300 * 1024, "{peak_kb} kB");
    }
}

/// CPU seconds of all finished child processes so far, and the largest resident size of one in kB.
fn children() -> (f64, i64) {
    use nix::sys::resource::{UsageWho, getrusage};
    use nix::sys::time::TimeValLike;
    let usage = getrusage(UsageWho::RUSAGE_CHILDREN).expect("the system counts");
    let micros = usage.user_time().num_microseconds() + usage.system_time().num_microseconds();
    (micros as f64 * 1e-6, usage.max_rss())
}
