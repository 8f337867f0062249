//! Detects truncated JPEG files, such as interrupted copies: decoders would fill the missing rows with grey.

use std::fs;
use std::io::{Read, Result};
use std::path::Path;

/// Start-of-image marker.
const SOI: u8 = 0xd8;
/// End-of-image marker.
const EOI: u8 = 0xd9;

/// Whether a file is a truncated JPEG; false for other formats.
pub fn jpeg(path: &Path) -> Result<bool> {
    let mut file = fs::File::open(path)?;
    let mut start = [0; 2];
    if file.read_exact(&mut start).is_err() || start != [0xff, SOI] {
        return Ok(false);
    }
    Ok(!reaches_end(&fs::read(path)?))
}

/// Whether the segments and scans of a JPEG lead to its end marker. End markers inside segments (thumbnails) do not count.
fn reaches_end(bytes: &[u8]) -> bool {
    let mut rest = bytes.get(2..).unwrap_or_default();
    loop {
        // Find the next marker; compressed data before it has 0xff only before 0 or a restart marker.
        let Some(at) = rest.iter().position(|&byte| byte == 0xff) else {
            return false;
        };
        rest = &rest[at + 1..];
        match rest.first() {
            None => return false,
            Some(&EOI) => return true,
            // Fill byte.
            Some(0xff) => {}
            // Stuffed data byte, restart marker, or marker without content.
            Some(0x00 | 0x01 | 0xd0..=0xd7) => rest = &rest[1..],
            Some(_) => {
                let Some(&[_, high, low]) = rest.first_chunk() else {
                    return false;
                };
                let length = usize::from(u16::from_be_bytes([high, low]));
                let Some(after) = rest.get(1 + length..) else {
                    return false;
                };
                rest = after;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_counts_behind_the_data_and_not_within_a_segment() {
        // A segment with a thumbnail's end in it, a scan with a stuffed byte and a restart, the end, and what a phone adds.
        let whole = [
            &[0xff, SOI, 0xff, 0xe1, 0, 6, 0xff, EOI, 1, 2][..],
            &[0xff, 0xda, 0, 3, 9, 5, 0xff, 0, 7, 0xff, 0xd0, 8],
            &[0xff, EOI, 1, 2, 3],
        ]
        .concat();
        let end = whole.len() - 3;
        assert!(reaches_end(&whole) && reaches_end(&whole[..end]));
        for length in 2..end {
            assert!(!reaches_end(&whole[..length]), "{length}");
        }
    }
}
