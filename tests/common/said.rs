//! Runs of the program and what they said.

use crate::place::Place;
use std::process::Output;

impl Place {
    /// Runs the program to its end.
    pub fn relit(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("relit starts")
    }
}

/// Succeeds, or shows what was said.
pub fn done(output: &Output) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
}

/// Fails with a code, and with one line that holds each of the words.
pub fn refused(output: &Output, code: i32, words: &[&str]) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{said}");
    let errors: Vec<&str> = said.lines().filter(|l| l.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "{said}");
    assert!(said.ends_with(&format!("{}\n", errors[0])), "{said}");
    assert!(!said.contains("panicked"), "{said}");
    for word in words {
        assert!(errors[0].contains(word), "{word} is not in: {said}");
    }
}
