//! Work that is never lost: a program that is killed at any moment leaves only files that can be read, and what it had
//! done is taken up again.

use crate::place::Place;
use relit::math::rng::Stream;
use relit::session::save;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

impl Place {
    /// The command with its output discarded.
    fn quiet(&self, arguments: &[&str]) -> Command {
        let mut command = self.command(arguments);
        command.stdout(Stdio::null()).stderr(Stdio::null());
        command
    }

    /// Runs to the end; what it said.
    fn said(&self, arguments: &[&str]) -> (Option<i32>, String) {
        let Output { status, stderr, .. } = (self.quiet(arguments))
            .stderr(Stdio::piped())
            .output()
            .expect("relit starts");
        (status.code(), String::from_utf8_lossy(&stderr).into_owned())
    }

    fn done(&self, arguments: &[&str]) {
        let (code, said) = self.said(arguments);
        assert_eq!(code, Some(0), "{said}");
    }
}

/// Whether every file below a folder is whole: pictures decode, JSON parses, tables have all their columns.
fn assert_whole(folder: &Path) -> usize {
    let mut count = 0;
    for entry in fs::read_dir(folder)
        .expect("lists")
        .map(|e| e.expect("entry"))
    {
        let path = entry.path();
        let name = entry.file_name().to_string_lossy().into_owned();
        // What was being written aside.
        if name.starts_with(".relit-") {
            continue;
        }
        if path.is_dir() {
            count += assert_whole(&path);
            continue;
        }
        count += 1;
        let bytes = fs::read(&path).expect("reads");
        let what = path.display();
        match path.extension().and_then(|e| e.to_str()) {
            Some("json") => {
                serde_json::from_slice::<serde_json::Value>(&bytes)
                    .unwrap_or_else(|e| panic!("{what}: {e}"));
            }
            Some("png" | "exr") => {
                let format = image::ImageFormat::from_path(&path).expect("known");
                image::load_from_memory_with_format(&bytes, format)
                    .unwrap_or_else(|e| panic!("{what}: {e}"));
            }
            Some("glb") => {
                gltf::import_slice(&bytes).unwrap_or_else(|e| panic!("{what}: {e}"));
            }
            Some("safetensors") => {
                safetensors::SafeTensors::deserialize(&bytes)
                    .unwrap_or_else(|e| panic!("{what}: {e}"));
            }
            Some("csv") => {
                let text = String::from_utf8(bytes).unwrap_or_else(|e| panic!("{what}: {e}"));
                let mut widths = text.lines().map(|line| line.split(',').count());
                let first = widths.next();
                assert!(
                    text.ends_with('\n') && widths.all(|w| Some(w) == first),
                    "{what}"
                );
            }
            Some("ply" | "obj" | "mtl" | "xml") => assert!(!bytes.is_empty(), "{what}"),
            other => panic!("{what}: what is a {other:?}?"),
        }
    }
    count
}

/// A solve whose end is seconds away, that leaves a checkpoint every 20 ms and goes on from one that is there.
const ENDLESS: [&str; 15] = [
    "solve",
    "room",
    "--out",
    "out",
    "--preset",
    "paper",
    "--batch",
    "1000",
    "--time",
    "10m",
    "--checkpoint",
    "0.02s",
    "--steps",
    "0",
    "--resume",
];
/// From so many steps on it is begun anew: it stands still by itself after some 2,000, and a moment is worth a quarter of them.
const FAR: u64 = 500;
/// A solve that comes to its end and writes everything.
const WHOLE: [&str; 10] = [
    "solve",
    "room",
    "--out",
    "out",
    "--preset",
    "preview",
    "--views",
    "2",
    "--checkpoint",
    "0.02s",
];
const EXPORT: [&str; 6] = [
    "export",
    "out",
    "--format",
    "glb",
    "--out",
    "exported/scene.glb",
];
const EDIT: [&str; 6] = ["edit", "out", "--emission", "lamp=1,1,1", "--out", "edited"];

/// How far a folder's checkpoint has come.
fn iterations(folder: &Path) -> Option<u64> {
    let saved = save::load_checkpoint(folder).unwrap_or_else(|error| panic!("{error}"));
    saved.checkpoint.map(|c| c.progress.iterations)
}

/// Kills saves, exports and edits at random moments, and an endless solve that is resumed each time. 24 moments;
/// `RELIT_KILLS=100 cargo test --release --test safety kill::` takes a hundred.
#[test]
fn a_kill_at_any_moment_leaves_only_whole_files_and_work_goes_on() {
    let moments = std::env::var("RELIT_KILLS")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(24u64);
    let place = Place::new();
    place.done(&WHOLE);
    let (out, endless) = (place.path("out"), &ENDLESS[..]);
    // How long each takes when nobody kills it, once its files are in memory; the endless one about as long as it takes to get
    // going twice.
    let lasts = |arguments: &[&str]| {
        let once = || {
            let started = Instant::now();
            place.done(arguments);
            started.elapsed()
        };
        once().min(once())
    };
    let (whole, export, edit) = (lasts(&WHOLE), lasts(&EXPORT), lasts(&EDIT));
    let first = [&ENDLESS[..12], &["--steps", "3"]].concat();
    place.done(&first);
    let jobs = [
        (endless, whole * 2),
        (&WHOLE[..], whole),
        (&EXPORT[..], export),
        (endless, whole * 2),
        (&EDIT[..], edit),
    ];

    let mut stream = Stream::new(141, 0, 0, 0);
    let (mut killed, mut advanced) = (0, 0);
    // More moments where a quick machine ends half of the work before it is killed.
    for moment in 0..4 * moments {
        if moment >= moments && u64::from(killed) > moments / 2 {
            break;
        }
        let (arguments, length) = jobs[moment as usize % jobs.len()];
        let resuming = arguments == endless;
        if resuming && iterations(&out).is_none_or(|n| n > FAR) {
            place.done(&first);
        }
        let before = if resuming { iterations(&out) } else { None };
        let mut relit = place.quiet(arguments).spawn().expect("relit starts");
        std::thread::sleep(length.mul_f64(1.1 * stream.uniform_f64()));
        relit.kill().expect("kills");
        let ended = relit.wait().expect("ends").success();
        killed += u32::from(!ended);
        for folder in ["out", "edited", "exported"].map(|f| place.path(f)) {
            assert!(assert_whole(&folder) > 0, "moment {moment}");
        }
        save::load(&out).unwrap_or_else(|error| panic!("moment {moment}: {error}"));
        if resuming {
            let after = iterations(&out);
            assert!(
                after >= before,
                "moment {moment}: {after:?} after {before:?}, ended by itself: {ended}"
            );
            advanced += u32::from(after > before);
        }
    }
    println!(
        "{killed} were killed before their end, of {moments} or more; {advanced} resumed solves had come further"
    );
    assert!(u64::from(killed) > moments / 2 && advanced > 0);

    // The next whole run leaves nothing of the killed ones behind.
    place.done(&WHOLE);
    let names = fs::read_dir(&out)
        .expect("lists")
        .map(|e| e.expect("entry").file_name());
    let left: Vec<_> = names
        .filter(|n| n.to_string_lossy().starts_with(".relit-"))
        .collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn two_programs_in_one_folder_leave_whole_results() {
    let place = Place::new();
    place.done(&[&ENDLESS[..12], &["--steps", "3"]].concat());
    let mut endless = place.quiet(&ENDLESS).spawn().expect("relit starts");
    let out = place.path("out");
    for _ in 0..3 {
        let mut pair = [&WHOLE, &WHOLE].map(|w| place.quiet(w).spawn().expect("relit starts"));
        for relit in &mut pair {
            assert!(relit.wait().expect("ends").success());
        }
        save::load(&out).expect("whole results");
    }
    assert!(
        endless.try_wait().expect("asks").is_none(),
        "the endless solve ended"
    );
    endless.kill().expect("kills");
    endless.wait().expect("ends");
    assert!(assert_whole(&out) > 0);
    save::load(&out).expect("whole results");
}

/// Exactly one line that begins with "error", and exit code 1.
fn refused((code, said): (Option<i32>, String), word: &str) {
    assert_eq!(code, Some(1), "{said}");
    let errors: Vec<&str> = said.lines().filter(|l| l.starts_with("error: ")).collect();
    assert!(errors.len() == 1 && errors[0].contains(word), "{said}");
    assert!(!said.contains("panicked"), "{said}");
}

#[test]
fn a_place_that_cannot_be_written_is_said_before_the_work() {
    let place = Place::new();
    let started = Instant::now();
    for out in ["room/mesh.obj/out", "/proc/relit"] {
        refused(
            place.said(&[
                "solve", "room", "--preset", "paper", "--time", "10m", "--out", out,
            ]),
            out,
        );
        assert!(
            started.elapsed() < Duration::from_secs(60),
            "it solved first"
        );
    }
    place.done(&WHOLE);
    std::os::unix::net::UnixListener::bind(place.path("socket")).expect("binds");
    refused(
        place.said(&["export", "out", "--format", "csv", "--out", "socket"]),
        "regular",
    );
}

/// No file may grow beyond a few kilobytes, as on a disk that is full: earlier results stay, the error is one line.
#[test]
fn a_full_disk_is_one_line_and_leaves_what_was_there() {
    let place = Place::new();
    place.done(&WHOLE);
    let before = fs::read(place.path("out/estimate.json")).expect("reads");
    let limited = |arguments: &[&str]| {
        let script = "trap '' XFSZ; ulimit -f 1; exec \"$0\" \"$@\"";
        let output = Command::new("sh")
            .args(["-c", script, env!("CARGO_BIN_EXE_relit")])
            .args(arguments)
            .current_dir(place.path(""))
            .output()
            .expect("sh starts");
        (
            output.status.code(),
            String::from_utf8_lossy(&output.stderr).into_owned(),
        )
    };
    refused(limited(&WHOLE), "out/");
    refused(
        limited(&["export", "out", "--format", "glb", "--out", "scene.glb"]),
        "scene.glb",
    );
    assert_eq!(
        fs::read(place.path("out/estimate.json")).expect("reads"),
        before
    );
    assert!(assert_whole(&place.path("out")) > 0);
    let left = fs::read_dir(place.path("out"))
        .expect("lists")
        .map(|e| e.expect("entry").file_name());
    assert!(
        !left
            .into_iter()
            .any(|n| n.to_string_lossy().starts_with(".relit-"))
    );
}

/// Runs a script where anybody may mount a disk.
#[cfg(target_os = "linux")]
fn in_name_space(place: &Place, script: &str) -> std::io::Result<Output> {
    Command::new("unshare")
        .args(["-rm", "sh", "-c", script, env!("CARGO_BIN_EXE_relit")])
        .current_dir(place.path(""))
        .output()
}

/// Whether a disk can be mounted here and made read-only; says so where not. The program plays no part in it.
#[cfg(target_os = "linux")]
fn can_mount(place: &Place) -> bool {
    let probe = "mkdir probe && mount -t tmpfs -o size=1m none probe && mount -o remount,ro probe";
    let probed = in_name_space(place, probe);
    let can = (probed.as_ref()).is_ok_and(|output| output.status.success());
    if !can {
        println!("skipped, as nothing can be mounted here: {probed:?}");
    }
    can
}

/// A disk of a megabyte that fills up and is then made read-only.
#[cfg(target_os = "linux")]
#[test]
fn a_disk_that_fills_up_or_cannot_be_written_costs_no_earlier_work() {
    let place = Place::new();
    if !can_mount(&place) {
        return;
    }
    let script = r#"
        mkdir disk && mount -t tmpfs -o size=1m none disk || exit 2
        solve() { "$0" solve room --out disk/out --preset paper --batch 50 --views none --checkpoint 0.02s "$@"; }
        solve --steps 3 2>first || { cat first; exit 3; }
        head -c 2m /dev/zero >disk/filler 2>/dev/null
        solve --time 1s --steps 0 --resume 2>full; echo "full $?"
        cp disk/out/checkpoint.json disk/out/estimate.json . || exit 4
        rm disk/filler
        solve --steps 6 --resume 2>again; echo "again $?"
        mount -o remount,ro disk || exit 5
        solve --steps 9 --resume 2>readonly; echo "readonly $?"
    "#;
    let output = in_name_space(&place, script).expect("unshare starts again");
    assert!(output.status.success(), "{output:?}");
    let said = String::from_utf8_lossy(&output.stdout);
    let codes: Vec<&str> = (said.lines())
        .filter(|l| {
            ["full ", "again ", "readonly "]
                .iter()
                .any(|w| l.starts_with(w))
        })
        .collect();
    assert_eq!(codes, ["full 1", "again 0", "readonly 1"], "{said}");
    let errors = |name: &str| fs::read_to_string(place.path(name)).expect("was said");
    refused((Some(1), errors("full")), "disk/out");
    assert!(
        errors("full").contains("warning: "),
        "it went on without checkpoints"
    );
    refused((Some(1), errors("readonly")), "disk/out");
    for name in ["checkpoint.json", "estimate.json"] {
        let bytes = fs::read(place.path(name)).expect("copied");
        serde_json::from_slice::<serde_json::Value>(&bytes)
            .unwrap_or_else(|error| panic!("{name}: {error}"));
    }
}

#[test]
fn a_folder_that_vanishes_while_solving_is_made_again() {
    let place = Place::new();
    let arguments = [
        "solve",
        "room",
        "--out",
        "out",
        "--preset",
        "paper",
        "--time",
        "2s",
        "--checkpoint",
        "0.02s",
        "--views",
        "none",
    ];
    let mut relit = place.quiet(&arguments).spawn().expect("relit starts");
    let out = place.path("out");
    // Removing fails where the folder is not there yet or a file comes in meanwhile.
    let mut vanished = 0;
    for _ in 0..10 {
        std::thread::sleep(Duration::from_millis(150));
        vanished += u32::from(fs::remove_dir_all(&out).is_ok());
    }
    assert!(relit.wait().expect("ends").success());
    assert!(vanished > 0, "the folder never vanished");
    save::load(&out).expect("whole results");
    assert!(assert_whole(&out) >= 4);
}
