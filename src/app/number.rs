//! Numbers and words as people read them.

use glam::Vec3;

/// A number in few characters.
pub fn number(v: f32) -> String {
    let magnitude = v.abs();
    if v == 0.0 {
        "0".to_owned()
    } else if !v.is_finite() {
        v.to_string()
    } else if !(1e-3..1e4).contains(&magnitude) {
        format!("{v:.1e}")
    } else if magnitude < 1.0 {
        let decimals = (2.0 - magnitude.log10().floor()) as usize;
        format!("{v:.decimals$}")
    } else if magnitude < 100.0 {
        format!("{v:.2}")
    } else {
        format!("{v:.0}")
    }
}

/// Three numbers with a space between.
pub fn triple(v: Vec3) -> String {
    let [r, g, b] = v.to_array().map(number);
    format!("{r} {g} {b}")
}

/// Words with a capital letter.
pub fn capitalized(words: &str) -> String {
    let mut letters = words.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_keep_their_size() {
        for (value, text) in [
            (0.0, "0"),
            (0.12345, "0.123"),
            (0.02344, "0.0234"),
            (-3.456, "-3.46"),
            (1234.5, "1234"),
            (1e-5, "1.0e-5"),
            (2.5e7, "2.5e7"),
        ] {
            assert_eq!(number(value), text);
        }
        assert_eq!(number(f32::NAN), "NaN");
    }
}
