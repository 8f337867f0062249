//! The `--device` option.

use std::str::FromStr;

/// The device that traces paths.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Device {
    /// A graphics card if there is one (not a software adapter), else the processor.
    #[default]
    Auto,
    /// The processor.
    Cpu,
    /// Any graphics adapter, including software ones.
    Gpu,
}

impl FromStr for Device {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "cpu" => Ok(Self::Cpu),
            "gpu" => Ok(Self::Gpu),
            _ => Err("expected auto, cpu or gpu".to_owned()),
        }
    }
}
