//! What the program says on the terminal.
//!
//! Whoever listens may have gone: a closed pipe, a closed terminal or a full disk behind it stops no work. Control characters,
//! which come with names out of files, are shown and not obeyed.

use crate::error::{Error, Result};
use std::borrow::Cow;
use std::fmt::{Display, Write as _};
use std::io::{ErrorKind, Write};

/// A line of what a command has to say, on standard output.
pub fn line(text: impl Display) {
    // Nobody is left to be told that nobody listens; the same below.
    let _ = writeln!(std::io::stdout(), "{}", plain(&text.to_string()));
}

/// A line beside the results, on standard error.
pub fn aside(text: impl Display) {
    let _ = writeln!(std::io::stderr(), "{}", plain(&text.to_string()));
}

/// What a person should look at, on standard error.
pub fn warning(text: impl Display) {
    aside(format_args!("warning: {text}"));
}

/// Lines of a table, on standard output. Line ends are obeyed, so that names in it must be [`plain`] already.
pub fn table(text: &str) {
    for row in text.lines() {
        line(row);
    }
}

/// A result that is written nowhere else, on standard output; whoever closed the pipe has had enough of it.
///
/// # Errors
/// It cannot be written, as on a full disk.
pub fn result(text: &str) -> Result<()> {
    let mut out = std::io::stdout();
    let written = writeln!(out, "{text}").and_then(|()| out.flush());
    match written {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Error::new(
            "standard output",
            error,
            "let it lead to where something can be written",
        )),
        _ => Ok(()),
    }
}

/// JSON without control characters in its texts.
pub fn json(text: &str) -> String {
    let escaped = |c: char| match c != '\n' && is_obeyed(c) {
        true => format!("\\u{:04x}", u32::from(c)),
        false => c.to_string(),
    };
    text.chars().map(escaped).collect()
}

/// A text without control characters: each is written as its code.
pub fn plain(text: &str) -> Cow<'_, str> {
    if !text.chars().any(is_obeyed) {
        return text.into();
    }
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        match is_obeyed(c) {
            // Writing to a string cannot fail.
            true => drop(write!(shown, "{}", c.escape_default())),
            false => shown.push(c),
        }
    }
    shown.into()
}

/// Whether a terminal does something at a character instead of showing it, or shows others in another order.
fn is_obeyed(c: char) -> bool {
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
