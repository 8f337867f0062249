//! The seeds of the fuzz targets, as they are and spoilt, through every reader: no panic, no hang, no memory out of
//! proportion. A second for each reader; `RELIT_FUZZ_SECONDS` gives more.

#[path = "../../fuzz/src/lib.rs"]
mod targets;

use relit::math::rng::Stream;
use std::path::Path;
use std::time::{Duration, Instant};

/// Changes that fuzzers find most with: bits, bytes, numbers at the ends of their ranges, cuts, doubled pieces.
fn spoil(bytes: &mut Vec<u8>, other: &[u8], stream: &mut Stream) {
    const WORDS: [&[u8]; 12] = [
        b"-1",
        b"0",
        b"1e999",
        b"4611686018427387904",
        b"null",
        b"[",
        b"{\"a\":",
        b"../",
        b"\xff\xff\xff\xff",
        b"\0\0\0\x80",
        b"NaN",
        b"\n",
    ];
    for _ in 0..=stream.below(6) {
        let at = stream.below(bytes.len() + 1);
        match stream.below(7) {
            0 if at < bytes.len() => bytes[at] ^= 1 << stream.below(8),
            1 if at < bytes.len() => bytes[at] = stream.next_u32() as u8,
            2 => bytes.truncate(at),
            3 => {
                let word = WORDS[stream.below(WORDS.len())];
                let end = (at + stream.below(word.len() + 1)).min(bytes.len());
                bytes.splice(at..end, word.iter().copied());
            }
            4 => {
                let end = (at + stream.below(64)).min(bytes.len());
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
            5 => {
                let end = (at + stream.below(32)).min(bytes.len());
                bytes.drain(at..end);
            }
            // The rest of another seed.
            _ => {
                let from = stream.below(other.len() + 1);
                bytes.truncate(at);
                bytes.extend_from_slice(&other[from..]);
            }
        }
    }
}

/// Slower than this a reader hangs; these files are of a kilobyte.
const HANG: Duration = Duration::from_secs(10);
/// The program, with everything that the tests hold, never needs more than this.
const MAX_MEMORY: u64 = 1 << 30;

#[test]
fn spoilt_seeds_neither_panic_nor_hang_nor_fill_the_memory() {
    let seconds = std::env::var("RELIT_FUZZ_SECONDS")
        .ok()
        .and_then(|s| s.parse().ok());
    let each = Duration::from_secs_f64(seconds.unwrap_or(0.8));
    for (key, (name, read)) in (0u64..).zip(targets::READERS) {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("fuzz/seeds")
            .join(name);
        let mut paths: Vec<_> = (std::fs::read_dir(&folder).unwrap())
            .map(|e| e.unwrap().path())
            .collect();
        paths.sort();
        let seeds: Vec<Vec<u8>> = paths.iter().map(|p| std::fs::read(p).unwrap()).collect();
        assert!(!seeds.is_empty(), "{name} has no seeds");
        let started = Instant::now();
        let mut cases = 0u64;
        while cases < seeds.len() as u64 || started.elapsed() < each {
            let mut stream = Stream::new(151, key, 0, cases);
            let mut bytes = seeds[cases as usize % seeds.len()].clone();
            if cases >= seeds.len() as u64 {
                let other = &seeds[stream.below(seeds.len())];
                spoil(&mut bytes, other, &mut stream);
            }
            let begun = Instant::now();
            let fine = std::panic::catch_unwind(|| read(&bytes)).is_ok();
            assert!(fine, "{name}, case {cases}");
            assert!(
                begun.elapsed() < HANG,
                "{name}, case {cases} took {:?}",
                begun.elapsed()
            );
            cases += 1;
        }
        assert!(
            peak_memory().is_none_or(|bytes| bytes < MAX_MEMORY),
            "{name}: {:?}",
            peak_memory()
        );
        println!("{name}: {cases} cases");
    }
}

/// A seed of the fuzz targets.
fn seed(file: &str) -> Vec<u8> {
    let seeds = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds");
    std::fs::read(seeds.join(file)).unwrap()
}

/// The seeds that are sound must be read, or their spoilt copies would test nothing.
#[test]
fn sound_seeds_are_read() {
    use relit::capture::read::{ReadOptions, read};
    for (name, file) in [
        ("mesh.obj", "obj/triangle.obj"),
        ("mesh.obj", "obj/polygon.obj"),
        ("mesh.ply", "ply/ascii.ply"),
        ("mesh.ply", "ply/binary.ply"),
        ("mesh.ply", "ply/big.ply"),
        ("mesh.glb", "gltf/nodes.glb"),
        ("images/000.png", "photograph/grey.hdr"),
        ("transforms.json", "transforms/everything.json"),
    ] {
        let bytes = seed(file);
        let folder = targets::capture_with(name, &bytes).unwrap();
        let capture =
            read(folder.path(), &ReadOptions::default()).unwrap_or_else(|e| panic!("{file}: {e}"));
        capture.frames[0]
            .load()
            .unwrap_or_else(|e| panic!("{file}: {e}"));
    }
    for file in [
        "estimate/solved.json",
        "checkpoint/begun.json",
        "checkpoint/paper.json",
    ] {
        let bytes = seed(file);
        let name = if file.starts_with("estimate") {
            "estimate.json"
        } else {
            "checkpoint.json"
        };
        let folder = targets::results_with(name, &bytes).unwrap();
        let saved =
            relit::session::save::load(folder.path()).unwrap_or_else(|e| panic!("{file}: {e}"));
        saved
            .estimate_by_name(targets::opened().unwrap())
            .unwrap_or_else(|e| panic!("{file}: {e}"));
        assert_eq!(saved.checkpoint.is_some(), file.starts_with("checkpoint"));
    }
    for (scan, what) in [
        (
            targets::colmap(
                &seed("colmap_cameras/opencv.txt"),
                &seed("colmap_images/images.txt"),
            ),
            "text",
        ),
        (
            targets::colmap(
                &seed("colmap_cameras/fisheye.bin"),
                &seed("colmap_images/images.bin"),
            ),
            "binary",
        ),
        (
            targets::nerfstudio_scan(&seed("nerfstudio/fisheye.json")),
            "nerfstudio",
        ),
        (
            targets::trajectory_scan(&seed("trajectory/plain.log")),
            "log",
        ),
        (
            targets::trajectory_scan(&seed("trajectory/list.json")),
            "list",
        ),
    ] {
        use relit::capture::import::{ImportOptions, read};
        let scan = read(
            scan.unwrap().path(),
            &ImportOptions::default(),
            &mut |_, _| {},
        );
        assert_eq!(
            scan.unwrap_or_else(|e| panic!("{what}: {e}")).frames.len(),
            1,
            "{what}"
        );
    }
    let folder = targets::results_with("session.json", &seed("session/block.json")).unwrap();
    let held = relit::session::store::read_record(folder.path()).unwrap();
    assert_eq!(held.unwrap().inserted.len(), 2);
}

/// What a person is told of the most brazen claims, and how soon.
#[test]
fn brazen_claims_are_refused_at_once() {
    use relit::capture::read::{ReadOptions, read};
    let started = Instant::now();
    for (name, bytes, word) in [
        (
            "images/000.png",
            seed("photograph/claims-a-billion.png"),
            "000.png",
        ),
        ("mesh.ply", seed("ply/claims-2-to-62-faces.ply"), "mesh.ply"),
        ("mesh.ply", seed("ply/long-list.ply"), "mesh.ply"),
        ("mesh.glb", seed("gltf/past-its-end.glb"), "past the end"),
        ("transforms.json", seed("transforms/leaves.json"), "leaves"),
        ("transforms.json", b"[".repeat(1_000_000), "transforms.json"),
    ] {
        let folder = targets::capture_with(name, &bytes).unwrap();
        let error = read(folder.path(), &ReadOptions::default())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains(word) && !error.contains('\n'),
            "{name}: {error}"
        );
    }
    let deep = b"[".repeat(1_000_000);
    for name in ["estimate.json", "checkpoint.json"] {
        let folder = targets::results_with(name, &deep).unwrap();
        let error = relit::session::save::load(folder.path())
            .unwrap_err()
            .to_string();
        assert!(error.contains(name), "{error}");
    }
    assert!(started.elapsed() < HANG);
}

/// Results from someone else may not name maps elsewhere, nor parameters that no person could set, nor what no surface is.
#[test]
fn results_name_no_files_elsewhere_and_nothing_impossible() {
    let text = String::from_utf8(seed("estimate/solved.json")).unwrap();
    let sound: serde_json::Value = serde_json::from_str(&text).unwrap();
    for maps in ["../../etc/passwd", "/etc/passwd", "..", "a/b"] {
        let mut file = sound.clone();
        file["maps"] = maps.into();
        let folder = targets::results_with("estimate.json", file.to_string().as_bytes()).unwrap();
        let error = relit::session::save::load(folder.path()).unwrap_err();
        assert!(error.problem.contains("beside"), "{maps}: {error}");
    }
    for (name, value) in [("batch", u64::MAX), ("samples", 0), ("bounces", 1 << 40)] {
        let mut file = sound.clone();
        file["settings"][name] = value.into();
        let folder = targets::results_with("estimate.json", file.to_string().as_bytes()).unwrap();
        let error = relit::session::save::load(folder.path()).unwrap_err();
        assert!(error.place.contains(name), "{name}: {error}");
    }
    let name = sound["objects"].as_object().unwrap().keys().next().unwrap();
    for (field, value) in [
        ("albedo", serde_json::json!([0.5, 1.5, 0.5])),
        ("emission", serde_json::json!([0.0, -1.0, 0.0])),
        ("roughness", 0.0.into()),
        ("specular", 2.0.into()),
    ] {
        let mut file = sound.clone();
        file["objects"][name][field] = value;
        let folder = targets::results_with("estimate.json", file.to_string().as_bytes()).unwrap();
        let error = relit::session::save::load(folder.path()).unwrap_err();
        assert!(error.place.ends_with(field), "{field}: {error}");
    }
    let bent = |a: f32| serde_json::json!([[a, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]);
    for (field, value) in [
        ("exposures", serde_json::json!([[0.0, 1.0, 1.0]])),
        ("vignetting", serde_json::json!([1e9, 0.0, 0.0])),
        ("vignetting", serde_json::json!([null, 0.0, 0.0])),
        ("albedo_common_stderr", serde_json::json!(-0.1)),
        // Values that stand, or fall, as light grows.
        ("response", bent(-1.0)),
        ("response", bent(-3.0)),
    ] {
        let mut file = sound.clone();
        file[field] = value;
        let folder = targets::results_with("estimate.json", file.to_string().as_bytes()).unwrap();
        let error = relit::session::save::load(folder.path()).unwrap_err();
        assert!(error.place.ends_with(field), "{field}: {error}");
    }
    let mut file = sound.clone();
    file["response"] = bent(0.2);
    let folder = targets::results_with("estimate.json", file.to_string().as_bytes()).unwrap();
    relit::session::save::load(folder.path()).expect("a curve that rises");
}

/// The greatest resident memory so far, where the system keeps it.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}
