//! Reads the captures beside the repository, where they are present.

use crate::beside::beside;
use relit::capture::photograph::Encoding;
use relit::capture::read::{ReadOptions, read};
use relit::capture::working::load_working;
use relit::scene::Scene;
use relit::scene::prepare::prepare;
use relit::session::command::{OpenOptions, Source};
use relit::session::open::open;
#[test]
fn rendered_rooms_load_with_objects_and_linear_photographs() {
    for (name, objects, triangles, frames, pixels) in [
        ("cornell", 8, 36, 5, 128 * 128),
        ("staircase", 31, 31_131, 16, 256 * 192),
    ] {
        let Some(folder) = beside(&format!("captures/{name}")) else {
            continue;
        };
        let capture = read(&folder, &ReadOptions::default()).unwrap();
        assert_eq!(capture.name, name);
        assert_eq!(capture.mesh.objects.len(), objects);
        assert_eq!(capture.mesh.triangles.len(), triangles);
        assert_eq!(capture.frames.len(), frames);
        assert!(capture.up.y > 0.9, "{}", capture.up);
        let photograph = capture.frames[0].load().unwrap();
        assert_eq!(photograph.encoding, Encoding::Linear);
        assert_eq!(photograph.pixels.len(), pixels);
        let sum: f32 = photograph.pixels.iter().map(|p| p.x + p.y + p.z).sum();
        println!("{name}: {sum} in its first photograph");
        assert!(sum.is_finite() && sum > 0.0);
        let scene = Scene::new(&capture).unwrap();
        assert_eq!(scene.cameras.len(), frames);
        let prepared = prepare(&capture, &load_working(&capture, u64::MAX).unwrap()).unwrap();
        println!("{name}: {:#?} {:#?}", prepared.summary(), prepared.warnings);
        assert_eq!(prepared.capture.mesh.triangles, capture.mesh.triangles);
    }
}

#[test]
fn a_scan_without_objects_is_cut_into_segments_and_reduced_to_a_budget() {
    let Some(folder) = beside("captures/office") else {
        return;
    };
    let capture = read(&folder, &ReadOptions::default()).unwrap();
    assert_eq!(capture.mesh.triangles.len(), 309_026);
    assert!(capture.segmentation.is_some() && capture.mesh.objects.len() == 1);
    let open = open(&Source::Folder(folder), &OpenOptions::default()).unwrap();
    // 158 were seen, and a twentieth more or fewer are as good.
    let segments = open.capture.mesh.objects.len();
    assert!((150..=166).contains(&segments), "{segments}");
    assert_eq!(capture.frames.len(), 75);
    assert!(capture.frames.iter().all(|frame| frame.depth.is_some()));
    println!("{:#?} {:#?}", open.summary, open.warnings);

    let working = load_working(&capture, 1 << 20).unwrap();
    let pixels: usize = working.photographs.iter().map(|p| p.pixels.len()).sum();
    assert!(pixels <= 1 << 20 && working.factor == 4, "{pixels}");
    assert_eq!(working.photographs[0].encoding, Encoding::Srgb8);
    let prepared = prepare(&capture, &working).unwrap();
    assert_eq!(prepared.scene.cameras[0].intrinsics, working.intrinsics[0]);
    println!("{:#?} {:#?}", prepared.summary(), prepared.warnings);
}
