//! Reads TUM RGB-D (Sturm et al. 2012) and ICL-NUIM (Handa et al. 2014), which has TUM's layout.
//!
//! `rgb.txt` and `depth.txt` list `timestamp file`, the trajectory `timestamp tx ty tz qx qy qz qw` (camera to world,
//! OpenCV's axes); depth is in 1/5000 m. Photographs, depth and poses are matched by timestamp.
//!
//! ICL-NUIM lists both images in `associations.txt`, its timestamps count frames, and its camera has fy = −480: its axes are
//! x right, y *up*, z forwards, left-handed like its world. Mirroring the camera in y and the world in z gives a
//! right-handed scene that keeps y up.

use crate::capture::camera::Pose;
use crate::capture::import::folder::Folder;
use crate::capture::import::matrix::{from_opencv, no_quaternion, number, rotation};
use crate::capture::import::rgbd::{Frames, depth_size, opencv_lens, photograph_size};
use crate::capture::import::{ImportOptions, Scan};
use crate::capture::scan::lens::{Lens, Model};
use crate::error::{Error, Result};
use glam::{DMat3, DVec3};

/// Maximum difference between matched timestamps in seconds.
const MAX_DIFFERENCE: f64 = 0.02;
/// Metres per unit of depth.
const UNIT: f64 = 1.0 / 5000.0;
/// Names of the trajectory in TUM's layout.
const TRAJECTORIES: [&str; 4] = [
    "groundtruth.txt",
    "trajectory.txt",
    "CameraTrajectory.txt",
    "poses.txt",
];
const ASSOCIATIONS: [&str; 2] = ["associations.txt", "associated.txt"];

/// A line of a list: timestamp and the words after it.
struct Entry {
    stamp: f64,
    words: Vec<String>,
}

pub fn is_here(folder: &Folder) -> bool {
    let images =
        (folder.has("rgb.txt") && folder.has("depth.txt")) || folder.first(&ASSOCIATIONS).is_some();
    images && folder.first(&TRAJECTORIES).is_some()
}

/// Whether a folder is ICL-NUIM's: a trajectory called `*.gt.freiburg` beside the images.
pub fn is_icl_nuim(folder: &Folder) -> Result<bool> {
    Ok(folder.has_folder("depth") && folder.has_folder("rgb") && freiburg(folder)?.is_some())
}

fn freiburg(folder: &Folder) -> Result<Option<String>> {
    let names = folder.names("")?;
    let mut found = names.into_iter().filter(|name| name.ends_with(".freiburg"));
    Ok(found.next())
}

/// Reads the frames; `left_handed` for ICL-NUIM's cameras.
pub fn read(folder: &Folder, options: &ImportOptions, left_handed: bool) -> Result<Scan> {
    let mut frames = Frames::new(UNIT, None);
    frames.scan.mirrored = left_handed;
    let (colors, depths) = images(folder, left_handed)?;
    let trajectory_name = match (freiburg(folder)?, folder.first(&TRAJECTORIES)) {
        (Some(name), _) => name,
        (None, Some(name)) => name.to_owned(),
        (None, None) => {
            return Err(Error::file(
                &folder.path(TRAJECTORIES[0]),
                "there is no trajectory",
                "add the poses as lines of: timestamp tx ty tz qx qy qz qw",
            ));
        }
    };
    let poses = entries(folder, &trajectory_name, 7)?;
    // ICL-NUIM's timestamps are frame numbers.
    let tolerance = if left_handed { 0.5 } else { MAX_DIFFERENCE };

    let (mut without_depth, mut without_pose) = (0, 0);
    for color in &colors {
        let Some(depth) = nearest(&depths, color.stamp, tolerance) else {
            without_depth += 1;
            continue;
        };
        let Some(line) = nearest(&poses, color.stamp, tolerance) else {
            without_pose += 1;
            continue;
        };
        let place = folder.path(&trajectory_name).display().to_string();
        let pose = pose(&place, line, left_handed)?;
        let names = [color, depth].map(|entry| entry.words[0].as_str());
        let file = |name: &str| folder.existing(name);
        frames.add(pose, names, file, |remarks| {
            cameras(folder, names, options, left_handed, remarks)
        })?;
    }
    for (count, lacking) in [(without_depth, "depth image"), (without_pose, "pose")] {
        if count > 0 {
            frames.scan.remarks.push(format!(
                "{count} photographs left out: no {lacking} within {tolerance} of their timestamp"
            ));
        }
    }
    let mut scan = frames.scan();
    if left_handed {
        scan.remarks.push(
            "the left-handed cameras (negative fy) and their world are mirrored: z changes its sign"
                .into(),
        );
    }
    Ok(scan)
}

/// The lists of photographs and depth images, ordered by timestamp.
fn images(folder: &Folder, numbered: bool) -> Result<(Vec<Entry>, Vec<Entry>)> {
    if folder.has("rgb.txt") && folder.has("depth.txt") {
        return Ok((
            entries(folder, "rgb.txt", 1)?,
            entries(folder, "depth.txt", 1)?,
        ));
    }
    if let Some(name) = folder.first(&ASSOCIATIONS) {
        // Lines of: stamp file stamp file. The depth image is the one in a folder "depth".
        let mut lists = (Vec::new(), Vec::new());
        for entry in entries(folder, name, 3)? {
            let second = Entry {
                stamp: entry.stamp,
                words: entry.words[2..].to_vec(),
            };
            if entry.words[0].contains("depth") {
                lists.0.push(second);
                lists.1.push(entry);
            } else {
                lists.0.push(entry);
                lists.1.push(second);
            }
        }
        return Ok(lists);
    }
    if numbered {
        let list = |inside: &str| -> Result<Vec<Entry>> {
            let names = folder.names(inside)?;
            let stamped = names.into_iter().filter_map(|name| {
                let stamp = name.split('.').next()?.parse().ok()?;
                let words = vec![format!("{inside}/{name}")];
                Some(Entry { stamp, words })
            });
            Ok(stamped.collect())
        };
        return Ok((list("rgb")?, list("depth")?));
    }
    Err(Error::file(
        &folder.path("rgb.txt"),
        "there is neither rgb.txt with depth.txt nor associations.txt",
        "add the lists of images",
    ))
}

/// The lines of a list with at least `min_words` words after the timestamp, ordered by timestamp; `#` begins a comment.
fn entries(folder: &Folder, name: &str, min_words: usize) -> Result<Vec<Entry>> {
    let text = folder.text(name)?;
    let path = folder.path(name);
    let mut entries = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default();
        let mut words = line
            .split(|c: char| c.is_whitespace() || c == ',')
            .filter(|word| !word.is_empty());
        let Some(first) = words.next() else { continue };
        let words: Vec<String> = words.map(str::to_owned).collect();
        let stamp = number(first).filter(|stamp| stamp.is_finite());
        let (Some(stamp), true) = (stamp, words.len() >= min_words) else {
            return Err(Error::new(
                format!("{} line {}", path.display(), index + 1),
                format!("is not a timestamp with {min_words} words after it"),
                "correct the line",
            ));
        };
        entries.push(Entry { stamp, words });
    }
    entries.sort_by(|a, b| a.stamp.total_cmp(&b.stamp));
    Ok(entries)
}

/// The entry with the nearest timestamp, within `tolerance`.
fn nearest(entries: &[Entry], stamp: f64, tolerance: f64) -> Option<&Entry> {
    let after = entries.partition_point(|entry| entry.stamp < stamp);
    let before = after.checked_sub(1).and_then(|i| entries.get(i));
    let difference = |entry: &&Entry| (entry.stamp - stamp).abs();
    [before, entries.get(after)]
        .into_iter()
        .flatten()
        .filter(|entry| difference(entry) <= tolerance)
        .min_by(|a, b| difference(a).total_cmp(&difference(b)))
}

/// The pose of a trajectory's line; `None` if a number is not finite.
fn pose(place: &str, line: &Entry, left_handed: bool) -> Result<Option<Pose>> {
    let numbers: Option<Vec<f64>> = line.words[..7].iter().map(|word| number(word)).collect();
    let Some(&[x, y, z, qx, qy, qz, qw]) = numbers.as_deref() else {
        return Err(Error::new(
            place,
            format!(
                "the line of timestamp {} holds a word that is not a number",
                line.stamp
            ),
            "correct the line",
        ));
    };
    let center = DVec3::new(x, y, z);
    if !center.is_finite() || ![qx, qy, qz, qw].iter().all(|q| q.is_finite()) {
        return Ok(None);
    }
    let Some(to_world) = rotation(qx, qy, qz, qw) else {
        return Err(no_quaternion(&format!("{place} timestamp {}", line.stamp)));
    };
    Ok(Some(if left_handed {
        let world = DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0));
        let camera = DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
        from_opencv(world * to_world * camera, world * center)
    } else {
        from_opencv(to_world, center)
    }))
}

/// The colour and the depth camera; TUM's images are registered to each other pixel by pixel.
fn cameras(
    folder: &Folder,
    [color, depth]: [&str; 2],
    options: &ImportOptions,
    left_handed: bool,
    remarks: &mut Vec<String>,
) -> Result<[Lens; 2]> {
    let size = photograph_size(folder, color)?;
    let depth_size = depth_size(folder, depth)?;
    if let Some(given) = options.intrinsics {
        let [fx, fy, cx, cy] = given;
        let lens = opencv_lens(size, [fx, fy.abs(), cx, cy]);
        return Ok([lens, lens.resized(depth_size)]);
    }
    let own = folder.confine().folder().canonicalize();
    let name = own
        .ok()
        .and_then(|path| Some(path.file_name()?.to_string_lossy().to_ascii_lowercase()))
        .unwrap_or_default();
    // Calibrations as the data sets' own pages state them, for 640 × 480 pixels.
    let rational = |k1, k2, p1, p2, k3| Model::Rational {
        k: [k1, k2, k3, 0.0, 0.0, 0.0],
        p: [p1, p2],
    };
    let none = Model::Brown([0.0; 4]);
    let (source, numbers, model) = if left_handed {
        ("ICL-NUIM", [481.2, 480.0, 319.5, 239.5], none)
    } else if name.contains("freiburg1") {
        let model = rational(0.2624, -0.9531, -0.0054, 0.0026, 1.1633);
        ("freiburg1", [517.3, 516.5, 318.6, 255.3], model)
    } else if name.contains("freiburg2") {
        let model = rational(0.2312, -0.7849, -0.0033, -0.0001, 0.9172);
        ("freiburg2", [520.9, 521.0, 325.1, 249.7], model)
    } else if name.contains("freiburg3") {
        ("freiburg3", [535.4, 539.2, 320.1, 247.6], none)
    } else {
        ("the ROS default", [525.0, 525.0, 319.5, 239.5], none)
    };
    remarks.push(format!(
        "intrinsics: those of {source} by the folder's layout and name; --intrinsics overrides"
    ));
    let lens = opencv_lens([640, 480], numbers).with(model);
    Ok([lens.resized(size), lens.resized(depth_size)])
}
