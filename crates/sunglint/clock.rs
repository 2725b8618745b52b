//! Processor time.

/// Processor time of this thread \[s\]: what other programs take of the machine does not count.
#[cfg(any(target_os = "linux", target_os = "macos", target_os = "freebsd"))]
pub(crate) fn thread_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Time of the clock on the wall \[s\], where threads have no clock of their own: right on an idle machine.
#[cfg(not(any(target_os = "linux", target_os = "macos", target_os = "freebsd")))]
pub(crate) fn thread_seconds() -> f64 {
    use std::sync::OnceLock;
    use std::time::Instant;
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sleeping costs nothing, where threads have a clock of their own.
    #[cfg(any(target_os = "linux", target_os = "macos", target_os = "freebsd"))]
    #[test]
    fn only_computing_counts() {
        let begun = thread_seconds();
        std::thread::sleep(std::time::Duration::from_millis(60));
        let slept = thread_seconds() - begun;
        assert!((0.0..0.03).contains(&slept), "{slept}");
    }
}
