//! What the system tells about this process and where it runs.

use std::path::{Path, PathBuf};
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
    PEAK.fetch_max(kilobytes(&status, "RssAnon")?, Ordering::Relaxed);
    Some(())
}

/// The bytes that a line `name: … kB` tells.
fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'))?;
    Some(1024 * line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?)
}

/// CPU time of the calling thread so far, seconds; 0 where the system does not tell.
#[cfg(unix)]
pub fn thread_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 / 1e9
}

/// CPU time of the calling thread so far, seconds; 0 where the system does not tell.
#[cfg(not(unix))]
pub fn thread_seconds() -> f64 {
    0.0
}

/// CPU time of the threads of the calling thread's pool so far, seconds; 0 where the system does not tell. These are the
/// threads of one rank, whether it is a process or a thread itself.
#[cfg(unix)]
pub fn busy_seconds() -> f64 {
    rayon::broadcast(|_| thread_seconds()).iter().sum()
}

/// CPU time of the threads of the calling thread's pool so far, seconds; 0 where the system does not tell.
#[cfg(not(unix))]
pub fn busy_seconds() -> f64 {
    0.0
}

/// The name of the machine; empty where the system does not tell.
pub fn host() -> String {
    std::fs::read_to_string("/proc/sys/kernel/hostname").map_or_else(|_| String::new(), |name| name.trim().into())
}

/// The cores that this process may use, in words; empty where the system does not tell.
pub fn allowed_cores() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:"));
    line.map_or_else(String::new, |cores| cores.trim().into())
}

/// Memory that is left, bytes, by what limits it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryLeft {
    /// For all processes of this machine, or of this container.
    pub together: Option<u64>,
    /// For this process alone, by its resource limits.
    pub process: Option<u64>,
}

/// Asks the system, whose words may be out of date the moment after.
pub fn memory_left() -> MemoryLeft {
    let read = |path: &str| std::fs::read_to_string(path).ok();
    let free = read("/proc/meminfo").and_then(|text| kilobytes(&text, "MemAvailable"));
    let group = read("/proc/self/cgroup").and_then(|text| left_in_groups(&text, Path::new("/sys/fs/cgroup")));
    MemoryLeft { together: free.into_iter().chain(group).min(), process: left_by_limits() }
}

#[cfg(unix)]
fn left_by_limits() -> Option<u64> {
    use rustix::process::{Resource, getrlimit};
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let left = |resource: Resource, used: &str| {
        Some(getrlimit(resource).current?.saturating_sub(kilobytes(&status, used).unwrap_or(0)))
    };
    left(Resource::Data, "VmData").into_iter().chain(left(Resource::As, "VmSize")).min()
}

#[cfg(not(unix))]
fn left_by_limits() -> Option<u64> {
    None
}

/// What the control groups named in `/proc/self/cgroup` leave: the least of this process's group and those around it.
/// Memory that only remembers files counts as free, because the system gives it back.
fn left_in_groups(groups: &str, root: &Path) -> Option<u64> {
    let mut left: Vec<u64> = Vec::new();
    for line in groups.lines() {
        // hierarchy:controllers:path, without controllers in version 2.
        let mut parts = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(path)) = (parts.next(), parts.next()) else { continue };
        let (base, files) = match controllers {
            "" => (root.to_owned(), ["memory.max", "memory.current", "file"]),
            "memory" => {
                (root.join("memory"), ["memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"])
            }
            _ => continue,
        };
        // In a container the path may be one of the machine outside, and the container's own group the root.
        let own: PathBuf = base.join(path.trim_start_matches('/'));
        left.extend(own.ancestors().take_while(|folder| folder.starts_with(&base)).filter_map(|f| left_in(f, files)));
    }
    left.into_iter().min()
}

fn left_in(group: &Path, [limit, used, remembered]: [&str; 3]) -> Option<u64> {
    let number = |file: &str| std::fs::read_to_string(group.join(file)).ok()?.trim().parse::<u64>().ok();
    let statistics = std::fs::read_to_string(group.join("memory.stat")).unwrap_or_default();
    let remembered = statistics.lines().find_map(|line| line.strip_prefix(remembered)?.trim().parse().ok());
    // Without a limit, version 2 says `max` and version 1 a number beyond any memory.
    Some(number(limit)?.saturating_sub(number(used)?.saturating_sub(remembered.unwrap_or(0))))
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn private_memory_and_cpu_time_grow() {
        let (before, busy_before) = (peak_private_memory(), busy_seconds());
        watch_private_memory();
        let held = vec![1u8; 64 << 20];
        assert!(peak_private_memory() >= before + (60 << 20));
        assert!(held.iter().map(|&x| u64::from(x)).sum::<u64>() > 0 && busy_seconds() > 0.0);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        let spin = || (0..20_000_000u64).fold(1u64, |a, b| a.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(b));
        assert!(pool.broadcast(|_| std::hint::black_box(spin())).len() == 3 && pool.install(busy_seconds) > 0.01);
        // The pool of this thread has done nothing of that.
        assert!(busy_seconds() >= busy_before);
    }

    #[test]
    fn this_machine_tells_its_memory_and_name() {
        assert!(memory_left().together.is_some_and(|bytes| bytes > 1 << 20));
        assert!(!host().is_empty() && !allowed_cores().is_empty());
    }

    #[test]
    fn groups_limit_with_those_around_them() {
        let folder = tempfile::tempdir().unwrap();
        let put = |path: &str, text: &str| {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        let left = |groups: &str| left_in_groups(groups, folder.path());
        assert_eq!(left("0::/job/step\n"), None);
        put("job/step/memory.max", "max\n");
        put("job/step/memory.current", "10\n");
        assert_eq!(left("0::/job/step\n"), None);
        put("job/memory.max", "1000\n");
        put("job/memory.current", "700\n");
        put("job/memory.stat", "anon 400\nfile 300\nfile_mapped 20\n");
        assert_eq!(left("0::/job/step\n"), Some(600));
        put("memory/memory.limit_in_bytes", "500\n");
        put("memory/memory.usage_in_bytes", "100\n");
        assert_eq!(left("5:cpu:/x\n4:memory:/not/here\n0::/job/step\n"), Some(400));
    }
}
