//! Exposures from the photographs' own EXIF records.

use crate::capture::Frame;
use crate::capture::photograph::Encoding;
use crate::capture::read::image::Header;
use crate::math::stats::quantile;

/// Gives 8- and 16-bit frames without an exposure field the one of their EXIF, relative to the median frame.
///
/// Only if every such frame has one: a mixture of known and unknown exposures would be worse than none.
pub fn from_exif(
    frames: &mut [Frame],
    headers: &[Header],
    place: &str,
    warnings: &mut Vec<String>,
) {
    let wants = |frame: &Frame, header: &Header| {
        frame.exposure.is_none() && header.encoding != Encoding::Linear
    };
    let known: Vec<f64> = frames
        .iter()
        .zip(headers)
        .filter(|(frame, header)| wants(frame, header))
        .filter_map(|(_, header)| header.exif_exposure)
        .collect();
    let wanted = frames
        .iter()
        .zip(headers)
        .filter(|(frame, header)| wants(frame, header))
        .count();
    if known.is_empty() {
        return;
    }
    if known.len() < wanted {
        warnings.push(format!(
            "{place}: only {} of {wanted} photographs have an EXIF exposure; none of them is used",
            known.len()
        ));
        return;
    }
    let Some(median) = quantile(&mut known.clone(), 0.5) else {
        return;
    };
    for (frame, header) in frames.iter_mut().zip(headers) {
        if wants(frame, header) {
            frame.exposure = header.exif_exposure.map(|exposure| exposure / median);
        }
    }
}

/// Time × ISO / F² of an EXIF record, the linear multiplier up to the sensor's own scale.
///
/// `None` where the time is absent or the numbers are impossible. ISO and F-number count as 100 and 1 where absent:
/// a phone's lens has but one.
pub fn of_exif(exif: &exif::Exif) -> Option<f64> {
    let number = |tag| -> Option<f64> {
        let field = exif.get_field(tag, exif::In::PRIMARY)?;
        match &field.value {
            exif::Value::Rational(v) => v.first().map(exif::Rational::to_f64),
            value => value.get_uint(0).map(f64::from),
        }
    };
    let time = number(exif::Tag::ExposureTime)?;
    let iso = number(exif::Tag::PhotographicSensitivity).unwrap_or(100.0);
    let aperture = number(exif::Tag::FNumber).unwrap_or(1.0);
    let exposure = time * iso / 100.0 / (aperture * aperture);
    (exposure.is_finite() && exposure > 0.0).then_some(exposure)
}
