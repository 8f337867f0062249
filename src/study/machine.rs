//! What a measurement of seconds was made on.

use serde::{Deserialize, Serialize};
use sysinfo::{CpuRefreshKind, System};

/// The processor and how much of it was used.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Name of the processor as it calls itself; "unknown" where it does not.
    pub cpu: String,
    /// Logical cores that there are.
    pub cores: usize,
    /// Threads that worked.
    pub threads: usize,
}

impl Machine {
    /// This machine, with the threads that work now.
    pub fn here() -> Self {
        let brand = System::new().ok().and_then(|mut system| {
            system.refresh_cpu_list(CpuRefreshKind::nothing());
            let brand = system.cpus().first()?.brand().trim().to_owned();
            (!brand.is_empty()).then_some(brand)
        });
        Self {
            cpu: brand.unwrap_or_else(|| "unknown".to_owned()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            threads: rayon::current_num_threads(),
        }
    }

    /// In words: "2 threads of Intel Xeon (2 cores)".
    pub fn words(&self) -> String {
        let Self {
            cpu,
            cores,
            threads,
        } = self;
        let s = if *threads == 1 { "" } else { "s" };
        format!("{threads} thread{s} of {cpu} ({cores} cores)")
    }
}
