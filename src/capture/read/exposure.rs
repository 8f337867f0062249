//! Exposures from EXIF records.

use crate::capture::Frame;
use crate::capture::photograph::Encoding;
use crate::capture::read::image::Header;
use crate::math::stats::quantile;

/// Sets the exposure of 8- and 16-bit frames without an exposure field from EXIF, relative to the median frame.
///
/// Does so only if all such frames have an EXIF exposure: a mixture of known and unknown exposures is worse than none.
pub fn from_exif(
    frames: &mut [Frame],
    headers: &[Header],
    place: &str,
    warnings: &mut Vec<String>,
) {
    let missing: Vec<(&mut Frame, Option<f64>)> = (frames.iter_mut().zip(headers))
        .filter(|(frame, header)| frame.exposure.is_none() && header.encoding != Encoding::Linear)
        .map(|(frame, header)| (frame, header.exif_exposure))
        .collect();
    let mut known: Vec<f64> = missing.iter().filter_map(|(_, exif)| *exif).collect();
    let Some(median) = quantile(&mut known, 0.5) else {
        return;
    };
    if known.len() < missing.len() {
        warnings.push(format!(
            "{place}: only {} of {} photographs have an EXIF exposure; none of them is used",
            known.len(),
            missing.len()
        ));
        return;
    }
    for (frame, exif) in missing {
        frame.exposure = exif.map(|exposure| exposure / median);
    }
}
