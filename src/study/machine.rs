//! The machine that times were measured on.

use serde::{Deserialize, Serialize};
use sysinfo::{CpuRefreshKind, System};

/// Processor and number of threads.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Brand of the processor; "unknown" if it has none.
    pub cpu: String,
    /// Number of logical cores.
    pub cores: usize,
    /// Number of worker threads.
    pub threads: usize,
}

impl Machine {
    /// This machine, with the current number of worker threads.
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

    /// As text: "2 threads of Intel Xeon (2 cores)".
    pub fn words(&self) -> String {
        let (cores, threads) = (self.cores, self.threads);
        let s = if threads == 1 { "" } else { "s" };
        format!("{threads} thread{s} of {} ({cores} cores)", self.cpu)
    }
}
