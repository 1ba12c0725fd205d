//! What the system tells about this process.

use std::sync::Once;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// The largest private memory seen so far, bytes.
static PEAK: AtomicU64 = AtomicU64::new(0);

/// How often private memory is looked at. Touching so much new memory that it matters takes longer.
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// Begins to watch this process's private memory. The system itself keeps only the peak of all resident memory, which says
/// nothing where files are mapped: they may be resident at one time and not at another.
pub fn watch_private_memory() {
    static WATCH: Once = Once::new();
    let watch = || {
        while look().is_some() {
            std::thread::sleep(LOOK_EVERY);
        }
    };
    // Without the watch, only what is there at the end is told.
    WATCH.call_once(|| drop(std::thread::Builder::new().name("memory".into()).stack_size(1 << 16).spawn(watch)));
}

/// The largest private memory of this process since it is watched, bytes; 0 where the system does not tell. Mapped files do
/// not count.
pub fn peak_private_memory() -> u64 {
    look();
    PEAK.load(Ordering::Relaxed)
}

/// Notes the private memory of this moment.
fn look() -> Option<()> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    PEAK.fetch_max(1024 * kilobytes, Ordering::Relaxed);
    Some(())
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
        watch_private_memory();
        let held = vec![1u8; 64 << 20];
        assert!(peak_private_memory() >= before + (60 << 20));
        assert!(held.iter().map(|&x| u64::from(x)).sum::<u64>() > 0 && cpu_seconds() > 0.0);
    }
}
