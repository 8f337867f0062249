//! No output takes the place of an input or of somebody else's results.

use crate::place::Place;
use crate::{all_files, change, done, refused, solve};
use relit::inverse::settings::Settings;
use relit::session::Session;
use relit::session::command::{Command, ExportFormat, ExportRequest, OpenOptions, Source, Start};
use relit::session::snapshot::{Level, Phase};
use std::fs;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A place with results of its room in `out`.
fn solved() -> Place {
    let place = Place::new();
    done(&place.relit(&solve("room", "out")));
    place
}

#[test]
fn files_of_captures_and_of_results_stay_unless_a_person_says_so() {
    let place = solved();
    done(&place.relit(&solve("room", "other")));
    fs::create_dir(place.path("scan")).expect("makes it");
    let before = ["room", "out", "other"].map(|folder| all_files(&place.path(folder)));
    let photograph = "room/images/000.exr";
    let render = ["render", "out", "--frame", "0", "--spp", "1", "--out"];
    let export = |format, file| ["export", "out", "--format", format, "--out", file];
    let edit = ["edit", "out", "--albedo", "floor=0.1,0.1,0.1", "--out"];
    let cases: [(&[&str], &str, &str); 9] = [
        (&["demo", "--out", "room"], "room", "holds a capture"),
        (&["import", "scan", "--out", "out"], "scan", ""),
        (
            &[&render[..], &[photograph]].concat(),
            photograph,
            "a photograph",
        ),
        (&export("obj", "room/mesh.obj"), "room/mesh.obj", "the mesh"),
        (
            &export("csv", "room/truth.json"),
            "room/truth.json",
            "the truth",
        ),
        (
            &export("csv", "room/transforms.json"),
            "transforms.json",
            "the cameras",
        ),
        (
            &export("csv", "out/estimate.json"),
            "out/estimate.json",
            "the results",
        ),
        (
            &export("csv", "out/loss.csv"),
            "out/loss.csv",
            "the results",
        ),
        (
            &[&edit[..], &["other"]].concat(),
            "other/report.json",
            "the results",
        ),
    ];
    for (command, file, what) in cases {
        let remedy = if what.is_empty() { "" } else { "--overwrite" };
        refused(&place.relit(command), 1, &[file, what, remedy]);
    }
    let after = ["room", "out", "other"].map(|folder| all_files(&place.path(folder)));
    assert!(before == after, "a refused command has changed a file");

    // The habits: a picture or an edit again, and the same capture into its own results.
    for _ in 0..2 {
        done(&place.relit(&[&render[..], &["picture.exr"]].concat()));
        done(&place.relit(&[&render[..], &["out/picture.exr"]].concat()));
        done(&place.relit(&[&edit[..], &["edited", "--views", "none"]].concat()));
        done(&place.relit(&solve("room", "out")));
    }

    // A person means it.
    let meant = |command: &[&str]| done(&place.relit(&[command, &["--overwrite"]].concat()));
    meant(&export("csv", "out/loss.csv"));
    meant(&[&edit[..], &["other", "--views", "none"]].concat());
    meant(&[&render[..], &[photograph]].concat());
    assert_ne!(all_files(&place.path("room")), before[0]);
    meant(&["demo", "--out", "room"]);
    done(&place.relit(&solve("room", "demo")));
}

/// What a command reads from elsewhere is no capture's, and stays all the same.
#[test]
fn what_a_command_has_read_outside_of_the_capture_stays() {
    let place = solved();
    let photographs = place.path("photographs");
    fs::rename(place.path("room/images"), &photographs).expect("moves");
    change(&place, "room", |file| {
        for frame in 0..2 {
            let name = format!("../photographs/00{frame}.exr");
            file["frames"][frame]["file_path"] = name.into();
        }
        let mut camera = file["frames"][0].clone();
        for field in ["w", "h", "fl_x", "fl_y", "cx", "cy"] {
            camera[field] = file[field].clone();
        }
        fs::write(place.path("camera.png"), camera.to_string()).expect("writes");
    });
    let object = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n";
    fs::write(place.path("a.obj"), object).expect("writes");
    fs::write(place.path("a.mtl"), "newmtl a\nmap_Kd a.naive.png\n").expect("writes");
    let texture = image::RgbImage::from_pixel(2, 2, image::Rgb([90, 80, 70]));
    texture.save(place.path("a.naive.png")).expect("writes");
    let before = all_files(&place.path(""));

    let render = ["render", "out", "--allow-outside", "--spp", "1", "--out"];
    let insert = [
        "insert",
        "out",
        "--allow-outside",
        "--frame",
        "0",
        "--spp",
        "1",
        "--object",
        "a.obj",
        "--at",
        "0,0,0",
        "--out",
        "a",
    ];
    for (command, file) in [
        (
            [&render[..], &["photographs/001.exr", "--frame", "0"]].concat(),
            "photographs/001.exr",
        ),
        (
            [&render[..], &["camera.png", "--camera", "camera.png"]].concat(),
            "camera.png",
        ),
        (insert.to_vec(), "a.naive.png"),
    ] {
        refused(
            &place.relit(&command),
            1,
            &[file, "was read", "--overwrite"],
        );
        let kept = fs::read(place.path(file)).expect("reads");
        let was = before.iter().find(|(name, _)| name.ends_with(file));
        assert!(was.is_some_and(|(_, bytes)| *bytes == kept), "{file}");
    }
    done(&place.relit(&[&render[..], &["new.exr", "--frame", "0"]].concat()));
    done(
        &place.relit(
            &[
                &render[..],
                &["camera.png", "--camera", "camera.png", "--overwrite"],
            ]
            .concat(),
        ),
    );
}

#[test]
fn results_make_room_only_for_those_of_the_same_capture() {
    let place = solved();
    fs::create_dir_all(place.path("hall/images")).expect("makes it");
    for (name, bytes) in all_files(&place.path("room")) {
        fs::write(name.replace("/room/", "/hall/"), bytes).expect("writes");
    }
    // The same content elsewhere is the same capture; another focal length is another one.
    done(&place.relit(&solve("hall", "out")));
    change(&place, "hall", |file| file["fl_x"] = 12.5.into());
    done(&place.relit(&solve("room", "out")));
    let before = all_files(&place.path("out"));
    let started = Instant::now();
    let endless = [
        "solve", "hall", "--out", "out", "--preset", "paper", "--time", "10m",
    ];
    refused(
        &place.relit(&endless),
        1,
        &["out", "another capture, room", "--overwrite"],
    );
    assert!(
        started.elapsed() < Duration::from_secs(60),
        "it solved first"
    );
    assert!(before == all_files(&place.path("out")));

    // A capture that was corrected is still the one that lies there.
    change(&place, "room", |file| file["fl_x"] = 12.25.into());
    done(&place.relit(&solve("room", "out")));

    // Somebody's file of a name that results have.
    fs::create_dir(place.path("mine")).expect("makes it");
    fs::write(place.path("mine/report.json"), "{}").expect("writes");
    refused(
        &place.relit(&solve("room", "mine")),
        1,
        &["mine/report.json", "no results"],
    );
    done(&place.relit(&[&solve("hall", "out")[..], &["--overwrite"]].concat()));
}

#[test]
fn the_window_is_refused_the_same() {
    let place = solved();
    let before = all_files(&place.path(""));
    let source = Source::Folder(place.path("room"));
    let settings = Settings {
        steps: 1,
        ..Settings::default()
    };
    let opened = Some(Start::Capture(source, OpenOptions::default()));
    let session = Session::spawn(opened, settings, Arc::new(|| {})).expect("a thread");
    let until = |holds: &dyn Fn(&relit::session::snapshot::Snapshot) -> bool| {
        let started = Instant::now();
        while !holds(&session.latest()) {
            assert!(
                started.elapsed() < Duration::from_secs(60),
                "{:?}",
                session.latest().events
            );
            std::thread::sleep(Duration::from_millis(5));
        }
    };
    until(&|seen| matches!(seen.phase, Phase::Finished(_)));
    let refusals = |count: usize| {
        until(&|seen| {
            let errors = seen.events.iter().filter(|e| e.level == Level::Error);
            let refused = errors.filter(|e| e.message.contains("--overwrite"));
            refused.count() == count
        });
    };
    for (count, file) in [(1, "room/mesh.obj"), (2, "out/estimate.json")] {
        assert!(session.send(Command::Export(ExportRequest {
            format: ExportFormat::Obj,
            path: place.path(file),
        })));
        refusals(count);
    }
    // Results of another capture.
    let estimate = place.path("out/estimate.json");
    let text = fs::read_to_string(&estimate).expect("reads");
    let of_another = text
        .replace("\"hash\": \"", "\"hash\": \"0")
        .replace("room\"", "hall\"");
    fs::write(&estimate, &of_another).expect("writes");
    assert!(session.send(Command::Save(place.path("out"))));
    refusals(3);
    fs::write(&estimate, text).expect("writes");
    session.join();
    assert!(before == all_files(&place.path("")));
}
