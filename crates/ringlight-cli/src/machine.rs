//! What the system tells about this process.

/// The largest private memory of this process so far, bytes; 0 where the system does not tell. Mapped files do not count:
/// of the peak of all resident memory, the pages of files that are resident now are taken off.
pub fn peak_private_memory() -> u64 {
    let Ok(status) = std::fs::read_to_string("/proc/self/status") else { return 0 };
    let kilobytes = |name: &str| -> u64 {
        let line = status.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'));
        line.and_then(|line| line.trim().strip_suffix("kB")?.trim().parse().ok()).unwrap_or(0)
    };
    let files = kilobytes("RssFile") + kilobytes("RssShmem");
    1024 * kilobytes("VmHWM").saturating_sub(files).max(kilobytes("RssAnon"))
}

/// CPU time of all threads of this process so far, seconds; 0 where the system does not tell.
#[cfg(unix)]
pub fn cpu_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 / 1e9
}

/// CPU time of all threads of this process so far, seconds; 0 where the system does not tell.
#[cfg(not(unix))]
pub fn cpu_seconds() -> f64 {
    0.0
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn private_memory_and_cpu_time_grow() {
        let before = peak_private_memory();
        let held = vec![1u8; 64 << 20];
        assert!(peak_private_memory() >= before + (60 << 20));
        assert!(held.iter().map(|&x| u64::from(x)).sum::<u64>() > 0 && cpu_seconds() > 0.0);
    }
}
