//! How long steps are and how much work goes into each, and how both change as the descent goes on.
//!
//! The paper gives initial values: steps of 5·10⁻³ and batches of 8 pixels. At each level the step is half of what it was.
//! Of an error what the steps' own noise makes remains: it falls with the root of the step and with that of the colours'
//! noise. An ℓ1 loss takes the median of a noisy colour for its mean, so that the paths for an object's colour double too;
//! noise of the derivative, which is independent, does not bias. Patches descend on the squared loss, which has no such bias.
//!
//! | | step | pixels a batch | paths for a colour | for a derivative |
//! | --- | --- | --- | --- | --- |
//! | objects | 5·10⁻³ / 2^level | 8, 16, then 32 | 2^level | 2^level, 8 at most |
//! | patches | 5·10⁻³ / 2^level | 8 times patches / objects, 8192 at most | 4 | 2 |

use crate::inverse::paper::descent::Descent;
use crate::inverse::settings::Settings;

/// Doublings of an objects' batch at most.
const BATCH_DOUBLINGS: u32 = 2;
/// Doublings of the paths for a derivative at most.
const DERIVATIVE_DOUBLINGS: u32 = 3;
/// Pixels of a batch at most, unless the settings say more.
const MAX_BATCH: u64 = 8192;
/// Paths for a pixel's colour and for its derivative once there are patches, in those of the settings.
const PATCH_SAMPLES: [u64; 2] = [4, 2];

/// The work of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pace {
    /// Pixels drawn.
    pub batch: u64,
    /// Paths for a pixel's colour, and others for its derivative.
    pub samples: [u64; 2],
    level: u32,
}

impl Pace {
    /// Of the next step of a descent.
    pub fn of(descent: &Descent, settings: &Settings) -> Self {
        let level = descent.level;
        let (batch, samples) = match &descent.patches {
            None => {
                let derivative = settings.samples << level.min(DERIVATIVE_DOUBLINGS);
                let batch = settings.batch << level.min(BATCH_DOUBLINGS);
                (batch, [settings.samples << level, derivative])
            }
            // A step meets each patch about as often as a step at first met each object.
            Some(patches) => {
                let objects = descent.emission.len().max(1);
                let more = (patches.len() / objects).max(1) as u64;
                let batch = (settings.batch * more).min(MAX_BATCH.max(settings.batch));
                let samples = PATCH_SAMPLES.map(|more| settings.samples * more);
                (batch, samples)
            }
        };
        Self {
            batch,
            samples,
            level,
        }
    }

    /// Paths of a step.
    pub fn paths(&self) -> u64 {
        self.batch * (self.samples[0] + self.samples[1])
    }

    /// Length of a step, after so many.
    pub fn rate(&self, settings: &Settings, steps: u64) -> f64 {
        let decay = (1.0 - settings.decay).powf(steps as f64 / 1000.0);
        settings.learning_rate * decay * 0.5f64.powi(self.level as i32)
    }
}
