//! How much memory there is, and how much was used.

/// Bytes that can be had now without swapping: what the system calls available, and no more than a container allows. Where
/// the system does not tell, all there can be.
pub fn available() -> u64 {
    let Ok(mut system) = sysinfo::System::new() else { return u64::MAX };
    system.refresh_memory();
    let free = system.available_memory();
    match system.cgroup_limits() {
        Some(limits) if limits.total_memory < system.total_memory() => free.min(limits.free_memory),
        _ => free,
    }
}

/// Most bytes this process has had in memory so far; 0 where the system does not tell.
pub fn peak() -> u64 {
    // "VmHWM:    123456 kB", the high water mark that Linux keeps.
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|rest| rest.split_whitespace().next()?.parse::<u64>().ok()).map_or(0, |kib| 1024 * kib)
}

/// Bytes for people.
pub fn people(bytes: u64) -> String {
    let bytes = bytes as f64;
    let (factor, unit) = match bytes {
        b if b >= 1e9 => (1e9, "GB"),
        b if b >= 1e6 => (1e6, "MB"),
        b if b >= 1e3 => (1e3, "kB"),
        _ => (1.0, "bytes"),
    };
    let value = bytes / factor;
    if value >= 100.0 || factor == 1.0 { format!("{value:.0} {unit}") } else { format!("{value:.1} {unit}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_is_memory_and_some_of_it_is_used() {
        assert!(available() > 1 << 20);
        assert!(cfg!(not(target_os = "linux")) || peak() > 1 << 20);
        assert_eq!([people(12), people(4_300), people(123_000_000)], ["12 bytes", "4.3 kB", "123 MB"]);
    }
}
