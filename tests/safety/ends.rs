//! Work that is ended from outside: by a person, by the system, by a terminal that closes, by a disk that is full.

use crate::heard;
use crate::place::Place;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStderr, Command, Stdio};

/// Solves until it is ended, and waits until it is under way.
fn endless(place: &Place, command: &mut Command) -> (Child, BufReader<ChildStderr>) {
    let mut relit = command
        // Large batches, or the descent ends by itself in a room this small.
        .args(["--preset", "paper", "--batch", "4000"])
        .args(["--time", "10m", "--views", "none"])
        .current_dir(place.path(""))
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("relit starts");
    let mut said = String::new();
    let mut lines = BufReader::new(relit.stderr.take().expect("piped"));
    while !said.contains(", loss ") {
        let read = lines.read_line(&mut said).expect("reads");
        assert!(read > 0, "{said}");
    }
    (relit, lines)
}

fn send(relit: &Child, signal: &str) {
    let sent = Command::new("kill")
        .args([signal, &relit.id().to_string()])
        .status();
    assert!(sent.expect("kill runs").success());
}

#[test]
fn an_ended_solve_is_saved_and_its_exit_code_stops_what_was_to_follow() {
    let place = Place::new();
    for (signal, code) in [("-INT", 130), ("-TERM", 143), ("-HUP", 129)] {
        let out = format!("out{signal}");
        let mut command = place.command(&["solve", "room", "--out", &out]);
        let (mut relit, lines) = endless(&place, &mut command);
        if signal == "-HUP" {
            // The terminal is gone, and says so twice.
            drop(lines);
            send(&relit, signal);
        }
        send(&relit, signal);
        assert_eq!(relit.wait().expect("ends").code(), Some(code), "{signal}");
        let report = fs::read(place.path(&out).join("report.json")).expect("is saved");
        let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
        assert_eq!(report["stopped_because"], "cancelled");
    }
    let help = place.relit(&["solve", "--help"]);
    let help = String::from_utf8_lossy(&help.stdout).into_owned();
    for code in ["130", "143", "129"] {
        assert!(help.contains(code), "{help}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_solve_that_was_told_to_outlive_its_terminal_does() {
    let place = Place::new();
    let mut shell = Command::new("sh");
    let script = "trap '' HUP; exec \"$0\" solve room --out out \"$@\"";
    shell.args(["-c", script, env!("CARGO_BIN_EXE_relit")]);
    let (mut relit, mut lines) = endless(&place, &mut shell);
    send(&relit, "-HUP");
    // It goes on saying how far it is.
    let mut line = String::new();
    lines.read_line(&mut line).expect("reads");
    assert!(line.contains(" s  "), "{line}");
    send(&relit, "-TERM");
    lines.read_to_string(&mut line).expect("reads");
    assert_eq!(relit.wait().expect("ends").code(), Some(143), "{line}");
}

/// No file may grow beyond what the estimate needs, as on a disk that fills up while pictures are written.
#[test]
fn a_disk_that_is_full_of_pictures_has_room_for_the_estimate() {
    let place = Place::new();
    let solve = ["solve", "room", "--out", "out", "--preset", "preview"];
    crate::done(&place.relit(&solve));
    let size = |name: &str| fs::metadata(place.path(name)).map_or(0, |file| file.len());
    let estimate = [
        "estimate.json",
        "report.json",
        "loss.csv",
        "checkpoint.json",
    ]
    .map(|name| size(&format!("out/{name}")));
    let blocks = estimate.iter().max().expect("four").div_ceil(512) + 1;
    let shown = [
        "scene.glb",
        "loss.png",
        "views/000.render.exr",
        "views/000.error.png",
    ];
    let shown = shown.map(|name| size(&format!("out/{name}")));
    assert!(
        shown.iter().any(|&size| size > blocks * 512),
        "{blocks} {shown:?}"
    );

    fs::remove_dir_all(place.path("out")).expect("removes");
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\"");
    let full = Command::new("sh")
        .args(["-c", &script, env!("CARGO_BIN_EXE_relit")])
        .args(solve)
        .current_dir(place.path(""))
        .output()
        .expect("sh starts");
    let words = [
        "out/",
        "the estimate is saved, its pictures and scene.glb are not",
    ];
    crate::refused(&full, 1, &words);
    assert!(
        !heard(&full).contains(".relit-unfinished"),
        "{}",
        heard(&full)
    );
    for name in ["estimate.json", "report.json", "loss.csv"] {
        assert!(place.path("out").join(name).is_file(), "{name}");
    }
    assert!(!place.path("out/views").exists());
    let render = [
        "render", "out", "--frame", "0", "--spp", "1", "--out", "a.png",
    ];
    crate::done(&place.relit(&render));
}
