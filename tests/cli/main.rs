//! The command line as a person meets it: exit codes, one-line errors, complete results, nothing lost.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/files.rs"]
mod files;
#[path = "../common/place.rs"]
mod place;

mod evaluate;
mod export;
mod insert;
mod interrupted;
mod render;
mod solve;
mod trade;

use place::Place;
use serde_json::Value;
use std::fs;
use std::process::Output;

impl Place {
    fn relit(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("relit starts")
    }

    fn json(&self, name: &str) -> Value {
        let text = fs::read_to_string(self.path(name)).expect("the file is there");
        assert!(!text.contains("NaN"), "{name} holds NaN");
        serde_json::from_str(&text).expect("the file is JSON")
    }
}

/// Succeeds, or shows what was said.
fn done(output: &Output) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
}

/// Fails with a code, and with one line that holds each of the words.
fn refused(output: &Output, code: i32, words: &[&str]) {
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

const QUICK: [&str; 4] = ["--preset", "preview", "--time", "20s"];

fn solve<'a>(more: &[&'a str]) -> Vec<&'a str> {
    let mut all = vec!["solve", "room"];
    all.extend(QUICK);
    all.extend(more);
    all
}
