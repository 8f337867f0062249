//! The step size, the batch size and the number of paths, as functions of the level of the descent.
//!
//! The paper gives initial values: a step of 5·10⁻³ and batches of 8 pixels. The step is halved at each level. The error that
//! remains is that of the steps' noise, which falls with the square root of the step and with the noise of the colours. An ℓ1
//! loss fits the median of a noisy colour instead of its mean, so the paths for a colour are doubled too; noise of the
//! derivative is independent and causes no bias. Patches use the squared loss, which has no such bias.
//!
//! | | step | pixels per batch | paths for a colour | for a derivative |
//! | --- | --- | --- | --- | --- |
//! | objects | 5·10⁻³ / 2^level | 8, 16, then 32 | 2^level | 2^level, 8 at most |
//! | patches | 5·10⁻³ / 2^level | 8 × patches / objects, 1024 at most | 4 | 2 |

use crate::inverse::paper::descent::Descent;
use crate::inverse::settings::Settings;

/// Greatest number of doublings of the batch, for objects.
const BATCH_DOUBLINGS: u32 = 2;
/// Greatest number of doublings of the paths for a derivative.
const DERIVATIVE_DOUBLINGS: u32 = 3;
/// Greatest number of pixels in a batch, unless the settings ask for more.
const MAX_BATCH: u64 = 1024;
/// Paths for a pixel's colour and for its derivative once there are patches, relative to the settings.
const PATCH_SAMPLES: [u64; 2] = [4, 2];

/// The amount of work in a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pace {
    pub batch: u64,
    /// Paths for a pixel's colour, and independent ones for its derivative.
    pub samples: [u64; 2],
    level: u32,
}

impl Pace {
    /// The pace of the next step of a descent.
    pub fn new(descent: &Descent, settings: &Settings) -> Self {
        let level = descent.level;
        let (batch, samples) = match &descent.patches {
            None => {
                let derivative = settings.samples << level.min(DERIVATIVE_DOUBLINGS);
                let batch = settings.batch << level.min(BATCH_DOUBLINGS);
                (batch, [settings.samples << level, derivative])
            }
            // A step meets each patch about as often as the first steps met each object.
            Some(patches) => {
                let objects = descent.emission.len().max(1);
                let ratio = (patches.len() / objects).max(1) as u64;
                let batch = (settings.batch * ratio).min(MAX_BATCH.max(settings.batch));
                let samples = PATCH_SAMPLES.map(|factor| settings.samples * factor);
                (batch, samples)
            }
        };
        Self {
            batch,
            samples,
            level,
        }
    }

    pub fn paths(&self) -> u64 {
        self.batch * (self.samples[0] + self.samples[1])
    }

    pub fn rate(&self, settings: &Settings, steps: u64) -> f64 {
        let decay = (1.0 - settings.decay).powf(steps as f64 / 1000.0);
        settings.learning_rate * decay * 0.5f64.powi(self.level as i32)
    }
}
