//! Peak memory of the program.

use std::fs;
use sysinfo::{ProcessRefreshKind, ProcessesToUpdate, System, get_current_pid};

/// Peak resident memory in bytes where the system records it (Linux), else the current one.
pub fn peak_memory_bytes() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok();
    let peak = status.and_then(|status| high_water_mark(&status));
    peak.or_else(resident_bytes)
}

/// Peak memory in bytes from the `VmHWM` line of a Linux process status, in KiB.
fn high_water_mark(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1024)
}

pub fn resident_bytes() -> Option<u64> {
    let pid = get_current_pid().ok()?;
    let mut system = System::new().ok()?;
    let memory = ProcessRefreshKind::nothing().with_memory();
    system.refresh_processes_specifics(ProcessesToUpdate::Some(&[pid]), false, memory);
    system.process(pid).map(sysinfo::Process::memory)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ways_agree_on_the_order_of_magnitude() {
        let mark = high_water_mark("Name:\tx\nVmHWM:\t    1234 kB\n");
        assert_eq!(mark, Some(1234 * 1024));
        assert_eq!(high_water_mark("VmPeak: 3 kB"), None);
        let (peak, now) = (peak_memory_bytes(), resident_bytes());
        let near = |(peak, now)| now > 100_000 && peak < now * 100;
        assert!(peak.zip(now).is_none_or(near), "{peak:?} {now:?}");
    }
}
