//! What paths are to be traced by.

use std::str::FromStr;

/// What a person asks for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Device {
    /// A graphics card where there is one; software adapters are none.
    #[default]
    Auto,
    /// The processor.
    Cpu,
    /// Any graphics adapter, a software one too.
    Gpu,
}

impl FromStr for Device {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "cpu" => Ok(Self::Cpu),
            "gpu" => Ok(Self::Gpu),
            _ => Err("auto, cpu or gpu is wanted".to_owned()),
        }
    }
}
