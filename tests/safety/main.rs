//! What becomes of work when something goes wrong: nothing is lost, and nothing is silently wrong.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/files.rs"]
mod files;
#[path = "../common/place.rs"]
mod place;
#[path = "../common/said.rs"]
mod said;

mod accepted;
#[cfg(unix)]
mod ends;
#[cfg(unix)]
mod kill;
mod overwritten;
#[cfg(unix)]
mod unheard;
mod unusable;
mod words;

use place::Place;
use said::{done, refused};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Output;

/// A solve of a capture in a second or two, without pictures.
fn solve<'a>(capture: &'a str, out: &'a str) -> Vec<&'a str> {
    let quick = ["--preset", "preview", "--time", "20s", "--views", "none"];
    [&["solve", capture, "--out", out], &quick[..]].concat()
}

/// What was said beside the results.
fn heard(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Changes transforms.json of a capture.
fn change(place: &Place, capture: &str, change: impl FnOnce(&mut Value)) {
    let path = place.path(capture).join("transforms.json");
    let text = fs::read(&path).expect("reads");
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&text);
    let mut file: Value = serde_json::from_slice(text).expect("JSON");
    change(&mut file);
    fs::write(&path, file.to_string()).expect("writes");
}

/// All files below a folder with their bytes, in the order of their names.
fn all_files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).expect("lists") {
        let path = entry.expect("lists").path();
        if path.is_dir() {
            files.extend(all_files(&path));
        } else {
            files.push((path.display().to_string(), fs::read(&path).expect("reads")));
        }
    }
    files.sort();
    files
}
