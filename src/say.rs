//! Terminal output.
//!
//! Failures of writing (a closed pipe or terminal, a full disk) do not stop the program. Control characters, which names from files
//! may hold, are escaped.

use crate::error::{Error, Result};
use std::borrow::Cow;
use std::fmt::{Display, Write as _};
use std::io::{ErrorKind, Write};

/// Writes a line to standard output.
pub fn line(text: impl Display) {
    // A failure cannot be reported anywhere.
    let _ = writeln!(std::io::stdout(), "{}", plain(&text.to_string()));
}

/// Writes a line to standard error.
pub fn note(text: impl Display) {
    let _ = writeln!(std::io::stderr(), "{}", plain(&text.to_string()));
}

/// Writes a warning to standard error.
pub fn warning(text: impl Display) {
    note(format_args!("warning: {text}"));
}

/// Writes the lines of a table to standard output. Names in the table must be [`plain`] already, since line ends are kept.
pub fn table(text: &str) {
    for row in text.lines() {
        line(row);
    }
}

/// Writes a result to standard output. A closed pipe is not an error.
///
/// # Errors
/// Writing fails for another reason, such as a full disk.
pub fn result(text: &str) -> Result<()> {
    let mut out = std::io::stdout();
    let written = writeln!(out, "{text}").and_then(|()| out.flush());
    match written {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Error::new(
            "standard output",
            error,
            "redirect it to where something can be written",
        )),
        _ => Ok(()),
    }
}

/// Names in a list before the rest is only counted.
const LISTED: usize = 5;

/// The first few names, and the number of the others.
pub fn listed<S: AsRef<str>>(names: &[S]) -> String {
    let shown: Vec<&str> = names.iter().take(LISTED).map(AsRef::as_ref).collect();
    let shown = shown.join(", ");
    match names.len().saturating_sub(LISTED) {
        0 => shown,
        others => format!("{shown} and {others} more"),
    }
}

/// JSON without control characters in its strings.
pub fn json(text: &str) -> String {
    let escaped = |c: char| match c != '\n' && is_control(c) {
        true => format!("\\u{:04x}", u32::from(c)),
        false => c.to_string(),
    };
    text.chars().map(escaped).collect()
}

/// A text with control characters escaped.
pub fn plain(text: &str) -> Cow<'_, str> {
    if !text.chars().any(is_control) {
        return text.into();
    }
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        match is_control(c) {
            // Writing to a string cannot fail.
            true => drop(write!(shown, "{}", c.escape_default())),
            false => shown.push(c),
        }
    }
    shown.into()
}

/// Whether a character controls the terminal or the order of text (bidirectional overrides).
fn is_control(c: char) -> bool {
    c.is_control() || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_shown_and_all_others_stay() {
        assert_eq!(plain("wall Türe 扉 é"), "wall Türe 扉 é");
        assert_eq!(plain("a\u{1b}[2Jb"), r"a\u{1b}[2Jb");
        assert_eq!(plain("a\nerror: b\r"), r"a\nerror: b\r");
        assert_eq!(json("{\n\"a\u{9b}\": 1}"), "{\n\"a\\u009b\": 1}");
        assert_eq!(plain("\u{9b}31m \u{202e}"), r"\u{9b}31m \u{202e}");
    }
}
