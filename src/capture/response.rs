//! The camera response: pixel value against light, where it is not the curve that the file format prescribes.

use glam::{DVec3, Vec3};

/// Number of basis functions of a response.
pub const TERMS: usize = 3;
/// Minimum and maximum d ln(light) / d ln(value) of a response; beyond them it cannot be measured through noise.
const SLOPES: [f64; 2] = [0.1, 10.0];
/// Maximum number of Newton steps of the inverse, and the change of a logarithm at which they stop.
const STEPS: usize = 60;
const TOLERANCE: f64 = 1e-10;

/// The inverse response of a camera, from value V to light: ln light = y + a y + b (√V − 1) + c (V − 1), where y = ln V. V is the
/// value after the file's own curve (sRGB) is undone; V and light are fractions of their saturation values.
///
/// a is a power; b and c bend the midtones and the highlights. The curve tends to a power in the dark and continues as one above
/// saturation. A power of such a curve is again such a curve, so unknown exposures leave the power undetermined (Grossberg and
/// Nayar 2003); then the terms are chosen such that over the photographs' values ln light has a mean slope of 1 in ln V.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Response {
    /// a, b and c, each per channel.
    pub terms: [Vec3; TERMS],
}

impl Response {
    /// The basis functions of a, b and c at ln V, each with its derivative.
    pub fn basis(log_value: f64) -> [[f64; 2]; TERMS] {
        let inside = log_value.min(0.0);
        let beyond = log_value - inside;
        let root = (0.5 * inside).exp();
        [
            [log_value, 1.0],
            [(0.5 * inside).exp_m1() + 0.5 * beyond, 0.5 * root],
            [inside.exp_m1() + beyond, root * root],
        ]
    }

    /// ln light at ln V in a channel, and its derivative d ln light / d ln V.
    pub fn log_light(&self, channel: usize, log_value: f64) -> [f64; 2] {
        let mut sum = [log_value, 1.0];
        for (term, function) in self.terms.iter().zip(Self::basis(log_value)) {
            let term = f64::from(term[channel]);
            sum = [sum[0] + term * function[0], sum[1] + term * function[1]];
        }
        sum
    }

    /// ln V at ln light: the inverse of [`Response::log_light`], by Newton's method safeguarded by bisection.
    pub fn log_value(&self, channel: usize, log_light: f64) -> f64 {
        let [mut low, mut high] = [f64::NEG_INFINITY, f64::INFINITY];
        let mut value = log_light;
        for _ in 0..STEPS {
            let [light, slope] = self.log_light(channel, value);
            let excess = light - log_light;
            if excess > 0.0 {
                high = value;
            } else {
                low = value;
            }
            let mut next = value - excess / slope;
            if !(low..=high).contains(&next) {
                next = 0.5 * (low + high);
            }
            let change = (next - value).abs();
            value = next;
            if change < TOLERANCE {
                break;
            }
        }
        value
    }

    /// The light of a value, both in the photograph's units, in which values saturate at `saturation`. Channels with infinite
    /// saturation are linear.
    pub fn light(&self, value: Vec3, saturation: Vec3) -> Vec3 {
        map_log(value, saturation, |channel, log| {
            self.log_light(channel, log)[0]
        })
    }

    /// The value of light: the inverse of [`Response::light`].
    pub fn value(&self, light: Vec3, saturation: Vec3) -> Vec3 {
        map_log(light, saturation, |channel, log| {
            self.log_value(channel, log)
        })
    }

    /// Whether the slope lies between the limits at every value.
    pub fn is_possible(&self) -> bool {
        let terms = self.terms.map(Vec3::as_dvec3);
        let [min, max] = SLOPES.map(DVec3::splat);
        let slope =
            |root: DVec3| DVec3::ONE + terms[0] + terms[1] * root * 0.5 + terms[2] * root * root;
        // The slope is a parabola in √V: its extremes lie at the ends of [0, 1] or at the vertex.
        let vertex = -terms[1] / (4.0 * terms[2]);
        let vertex = DVec3::select(vertex.is_finite_mask(), vertex, DVec3::ZERO);
        let vertex = vertex.clamp(DVec3::ZERO, DVec3::ONE);
        let possible = |root| slope(root).cmpge(min).all() && slope(root).cmple(max).all();
        terms.iter().all(|term| term.is_finite())
            && [DVec3::ZERO, DVec3::ONE, vertex].into_iter().all(possible)
    }
}

/// Maps ln(colour / saturation) by `change`, in channels with a positive value and a finite saturation.
fn map_log(color: Vec3, saturation: Vec3, change: impl Fn(usize, f64) -> f64) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|channel| {
        let limit = f64::from(saturation[channel]);
        let fraction = f64::from(color[channel]) / limit;
        if limit.is_finite() && fraction > 0.0 {
            (change(channel, fraction.ln()).exp() * limit) as f32
        } else {
            color[channel]
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A curve of raised contrast, with a shoulder; a power; none.
    fn bent() -> Response {
        Response {
            terms: [
                Vec3::new(0.35, 0.2, 0.0),
                Vec3::new(0.4, 0.0, 0.0),
                Vec3::new(-0.45, 0.0, 0.0),
            ],
        }
    }

    #[test]
    fn light_and_values_are_told_from_each_other_at_every_level() {
        let response = bent();
        assert!(response.is_possible());
        for full in [1.0, 1e-6, 3e5] {
            let saturation = Vec3::splat(full);
            for level in -60..=6 {
                let light = saturation * (f32::from(level as i8) * 0.25).exp();
                let value = response.value(light, saturation);
                let back = response.light(value, saturation);
                let off = (back / light - Vec3::ONE).abs().max_element();
                assert!(off < 1e-5, "{full} {level}: {off}");
                // A power by its definition, and nothing where nothing bends.
                let power = full * (value.y / full).powf(1.2);
                assert!((light.y / power - 1.0).abs() < 1e-5);
                assert!((value.z / light.z - 1.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn slopes_are_those_of_finite_differences() {
        let response = bent();
        for level in -40..=10 {
            let at = f64::from(level) * 0.2 + 0.01;
            let step = 1e-5;
            let [[above, _], [below, _]] = [at + step, at - step].map(|y| response.log_light(0, y));
            let off = (above - below) / (2.0 * step) - response.log_light(0, at)[1];
            assert!(off.abs() < 1e-8, "{at}");
        }
    }

    #[test]
    fn what_shows_no_light_or_never_saturates_stays() {
        let response = bent();
        for color in [Vec3::ZERO, Vec3::new(-0.1, 0.0, 0.0)] {
            assert_eq!(response.light(color, Vec3::ONE), color);
            assert_eq!(response.value(color, Vec3::ONE), color);
        }
        let radiance = Vec3::new(0.3, 70.0, 1e-5);
        assert_eq!(response.light(radiance, Vec3::INFINITY), radiance);
    }

    #[test]
    fn curves_that_fall_or_stand_or_are_no_numbers_are_not_possible() {
        let with = |a: f32, b: f32, c: f32| Response {
            terms: [a, b, c].map(Vec3::splat),
        };
        assert!(with(0.0, 0.0, 0.0).is_possible());
        assert!(!with(-0.95, 0.0, 0.0).is_possible());
        // It falls in the middle alone, and in the highlights alone.
        assert!(!with(0.0, -6.0, 2.0).is_possible());
        assert!(!with(0.0, 0.0, -1.0).is_possible());
        assert!(!with(f32::NAN, 0.0, 0.0).is_possible());
        assert!(!with(0.0, 0.0, 10.0).is_possible());
    }
}
