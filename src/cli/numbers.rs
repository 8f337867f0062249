//! Parsers of numbers on the command line. The error of each says what is expected.

use glam::{DVec2, DVec3};
use std::ops::RangeInclusive;

type Parsed<T> = std::result::Result<T, String>;

pub fn whole<T: TryFrom<u64>>(text: &str) -> Parsed<T> {
    within(text, 0..=u64::MAX).ok_or_else(|| "a whole number from 0 is wanted".to_owned())
}

pub fn from_one<T: TryFrom<u64>>(text: &str) -> Parsed<T> {
    within(text, 1..=u64::MAX).ok_or_else(|| "a whole number from 1 is wanted".to_owned())
}

/// A width of the built-in room's photographs.
pub fn width(text: &str) -> Parsed<u32> {
    within(text, 16..=4096).ok_or_else(|| "a whole number from 16 to 4096 is wanted".to_owned())
}

pub fn threads(text: &str) -> Parsed<u16> {
    let range = 1..=u64::from(u16::MAX);
    within(text, range).ok_or_else(|| format!("a whole number from 1 to {} is wanted", u16::MAX))
}

pub fn seeds(text: &str) -> Parsed<u64> {
    within(text, 1..=1000).ok_or_else(|| "a whole number from 1 to 1000 is wanted".to_owned())
}

fn within<T: TryFrom<u64>>(text: &str, range: RangeInclusive<u64>) -> Option<T> {
    let number = text.parse().ok().filter(|number| range.contains(number))?;
    T::try_from(number).ok()
}

/// A signed offset in frames.
pub fn shift(text: &str) -> Parsed<i32> {
    text.parse()
        .map_err(|_| "a whole number such as 1 or -1 is wanted".to_owned())
}

/// A factor or length above 0.
pub fn above_zero(text: &str) -> Parsed<f64> {
    finite(text)
        .filter(|number| *number > 0.0)
        .ok_or_else(|| "a number above 0 is wanted".to_owned())
}

pub fn degrees(text: &str) -> Parsed<f64> {
    finite(text).ok_or_else(|| "a number of degrees is wanted".to_owned())
}

/// Quarter turns of an angle in degrees, modulo 4.
pub fn quarters(text: &str) -> Parsed<u8> {
    match text.parse::<i32>().map(|degrees| degrees.rem_euclid(360)) {
        Ok(degrees) if degrees % 90 == 0 => Ok((degrees / 90) as u8),
        _ => Err("90, 180 or 270 is wanted".to_owned()),
    }
}

pub fn pair(text: &str) -> Parsed<DVec2> {
    match numbers(text).as_deref() {
        Some(&[x, y]) => Ok(DVec2::new(x, y)),
        _ => Err("two numbers are wanted, e.g. 90,0".to_owned()),
    }
}

pub fn triple(text: &str) -> Parsed<DVec3> {
    match numbers(text).as_deref() {
        Some(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
        _ => Err("three numbers are wanted, e.g. 0,1,0".to_owned()),
    }
}

/// Focal lengths fx and fy, and the principal point cx and cy.
pub fn intrinsics(text: &str) -> Parsed<[f64; 4]> {
    match numbers(text).as_deref() {
        Some(&[fx, fy, cx, cy]) if fx > 0.0 && fy != 0.0 => Ok([fx, fy, cx, cy]),
        _ => Err("four numbers are wanted, e.g. 525,525,319.5,239.5".to_owned()),
    }
}

fn numbers(text: &str) -> Option<Vec<f64>> {
    text.split(',').map(|part| finite(part.trim())).collect()
}

fn finite(text: &str) -> Option<f64> {
    text.parse().ok().filter(|number: &f64| number.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_out_of_range_are_refused_with_what_is_wanted() {
        let wanted = |error: Parsed<u16>| error.expect_err("no such number");
        assert_eq!(whole::<usize>("0"), Ok(0));
        assert_eq!(from_one::<u32>("7"), Ok(7));
        assert_eq!(threads("65535"), Ok(65535));
        for text in ["0", "-1", "a", "", "1.5", "65536"] {
            let range = "a whole number from 1 to 65535 is wanted";
            assert_eq!(wanted(threads(text)), range);
        }
        assert_eq!((shift("-2"), quarters("-90")), (Ok(-2), Ok(3)));
        assert!(shift("a").is_err() && shift("0.5").is_err() && quarters("45").is_err());
        assert_eq!((above_zero("0.01"), degrees("-90")), (Ok(0.01), Ok(-90.0)));
        for text in ["0", "-1", "a", "inf", "NaN"] {
            assert!(above_zero(text).is_err(), "{text}");
        }
        assert!(degrees("inf").is_err() && triple("0,1").is_err() && triple("0,a,1").is_err());
    }
}
