//! Files that were cut, overwritten or spliced at random: an error or a capture, never a panic or a hang.
//!
//! The same 256 cases each time; the environment variables PROPTEST_CASES and PROPTEST_RNG_SEED ask for more and for others.

use crate::meshes::glb;
use crate::{OBJ, folder, open, transforms, with_mesh, write};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::io::Cursor;

/// One way of spoiling a file.
#[derive(Debug, Clone)]
enum Damage {
    Cut(prop::sample::Index),
    Overwrite(prop::sample::Index, u8),
    Repeat(prop::sample::Index, prop::sample::Index),
    Digits(prop::sample::Index),
}

fn damage() -> impl Strategy<Value = Vec<Damage>> {
    let one = prop_oneof![
        1 => any::<prop::sample::Index>().prop_map(Damage::Cut),
        6 => any::<(prop::sample::Index, u8)>().prop_map(|(at, byte)| Damage::Overwrite(at, byte)),
        2 => any::<(prop::sample::Index, prop::sample::Index)>().prop_map(|(a, b)| Damage::Repeat(a, b)),
        2 => any::<prop::sample::Index>().prop_map(Damage::Digits),
    ];
    prop::collection::vec(one, 1..6)
}

fn spoil(mut bytes: Vec<u8>, damages: &[Damage]) -> Vec<u8> {
    for damage in damages {
        if bytes.is_empty() {
            break;
        }
        match damage {
            Damage::Cut(at) => bytes.truncate(at.index(bytes.len())),
            Damage::Overwrite(at, byte) => {
                let at = at.index(bytes.len());
                bytes[at] = *byte;
            }
            Damage::Repeat(a, b) => {
                let (a, b) = (a.index(bytes.len()), b.index(bytes.len()));
                let piece = bytes[a.min(b)..a.max(b)].to_vec();
                bytes.splice(a..a, piece);
            }
            Damage::Digits(at) => {
                let at = at.index(bytes.len());
                if bytes[at].is_ascii_digit() {
                    bytes.splice(at..at, *b"9223372036854775807");
                }
            }
        }
    }
    bytes
}

/// Photographs of every format, 4 × 2.
fn photographs() -> Vec<Vec<u8>> {
    use image::ImageFormat::{Hdr, Jpeg, OpenExr, Png};
    let eight =
        image::DynamicImage::ImageRgb8(image::RgbImage::from_pixel(4, 2, image::Rgb([9; 3])));
    let float = eight.clone().into_rgb32f().into();
    [
        (&eight, Png),
        (&eight, Jpeg),
        (&float, OpenExr),
        (&float, Hdr),
    ]
    .map(|(image, format)| {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    })
    .into()
}

const PLY: &[u8] = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n\
    property list uchar int vertex_indices\nproperty int object_id\nend_header\n\
    0 0 0 1 2 3\n1 0 0 1 2 3\n0 1 0 1 2 3\n3 0 1 2 4\n";

/// A binary PLY of one triangle.
fn binary_ply() -> Vec<u8> {
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uint int vertex_indices\nend_header\n"
        .to_vec();
    let positions: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    bytes.extend(positions.iter().flat_map(|x| x.to_le_bytes()));
    bytes.extend([3i32, 0, 1, 2].iter().flat_map(|x| x.to_le_bytes()));
    bytes
}

fn seeded() -> ProptestConfig {
    let mut config = ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::default()
    };
    if config.rng_seed == RngSeed::Random {
        config.rng_seed = RngSeed::Fixed(151);
    }
    config
}

proptest! {
    #![proptest_config(seeded())]

    #[test]
    fn spoilt_transforms(damages in damage()) {
        let folder = folder("");
        let text = transforms(r#""up": [0, 1, 0], "k1": 0.1, "exposure": 2,"#);
        write(folder.path(), "transforms.json", &spoil(text.into_bytes(), &damages));
        let _ = open(folder.path());
    }

    #[test]
    fn spoilt_meshes(damages in damage()) {
        for (name, bytes) in [
            ("a.obj", OBJ.as_bytes().to_vec()),
            ("a.ply", PLY.to_vec()),
            ("b.ply", binary_ply()),
            ("a.glb", glb(|_| {})),
        ] {
            if let Ok(capture) = with_mesh(name, &spoil(bytes, &damages)) {
                let mesh = &capture.mesh;
                prop_assert!(mesh.positions.iter().all(|p| p.is_finite()));
                let corners = mesh.triangles.iter().flatten();
                prop_assert!(corners.clone().all(|&i| (i as usize) < mesh.positions.len()));
                prop_assert_eq!(mesh.object_of.len(), mesh.triangles.len());
                prop_assert!(mesh.object_of.iter().all(|&o| (o as usize) < mesh.objects.len()));
            }
        }
    }

    #[test]
    fn spoilt_photographs(damages in damage()) {
        let folder = folder(&transforms(""));
        for bytes in photographs() {
            write(folder.path(), "images/000.png", &spoil(bytes, &damages));
            if let Ok(capture) = open(folder.path())
                && let Ok(photograph) = capture.frames[0].load()
            {
                prop_assert!(photograph.pixels.iter().all(|p| p.is_finite()));
            }
        }
    }
}
