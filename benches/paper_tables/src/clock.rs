//! The clock of the work of one thread.

use rustix::time::{ClockId, clock_gettime};

/// CPU time of this thread so far, seconds.
pub fn thread_seconds() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 / 1e9
}
