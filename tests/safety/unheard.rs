//! Nobody listens: pipes that are closed, disks behind them that are full.

use crate::place::Place;
use crate::{done, solve};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::process::Stdio;

#[test]
fn a_solve_whose_listener_goes_away_saves_its_results() {
    let place = Place::new();
    // Both go through one pipe, as with 2>&1 | head -1.
    let (reader, writer) = std::io::pipe().expect("a pipe");
    let mut relit = place
        .command(&solve("room", "out"))
        .stdout(writer.try_clone().expect("a pipe"))
        .stderr(writer)
        .spawn()
        .expect("relit starts");
    let mut first = String::new();
    BufReader::new(reader).read_line(&mut first).expect("reads");
    assert!(first.contains("room"), "{first}");
    assert_eq!(relit.wait().expect("ends").code(), Some(0));
    assert!(place.path("out/report.json").is_file());
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_behind_what_is_said_costs_no_results() {
    let place = Place::new();
    let full = || File::create("/dev/full").expect("opens");
    let solved = place
        .command(&solve("room", "out"))
        .stdout(full())
        .stderr(full())
        .status();
    assert_eq!(solved.expect("runs").code(), Some(0));
    assert!(place.path("out/report.json").is_file());

    // What is said nowhere else is missed.
    for more in [&[][..], &["--json"]] {
        let mut evaluate = place.command(&["evaluate", "out", "--truth", "room"]);
        evaluate.args(more);
        let lost = evaluate.stdout(full()).stderr(Stdio::piped()).output();
        crate::refused(&lost.expect("runs"), 1, &["standard output"]);
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let unread = evaluate.stdout(writer).output().expect("runs");
        done(&unread);
    }
    for command in [&["--help"][..], &["solve", "--help"], &["--version"]] {
        let status = place.command(command).stdout(full()).status();
        assert_eq!(status.expect("runs").code(), Some(0), "{command:?}");
    }
}
