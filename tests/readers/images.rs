//! Photographs of every format come out in linear light, and no header is believed.

use crate::{folder, open, transforms, write};
use glam::Vec3;
use image::{DynamicImage, ImageBuffer, ImageFormat, Rgb, Rgba};
use relit::capture::camera::Intrinsics;
use relit::capture::orientation::Orientation;
use relit::capture::photograph::{Encoding, Photograph};
use relit::capture::read::image::read;
use std::io::Cursor;
use std::path::Path;

fn lens(width: u32, height: u32) -> Intrinsics {
    Intrinsics {
        width,
        height,
        fx: 1.0,
        fy: 1.0,
        cx: 0.0,
        cy: 0.0,
        distortion: [0.0; 4],
    }
}

fn decode(image: &DynamicImage, format: ImageFormat, exposure: Option<f64>) -> (Photograph, usize) {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).unwrap();
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "image", bytes.get_ref());
    read(
        &folder.path().join("image"),
        Orientation::default(),
        &lens(image.width(), image.height()),
        exposure,
    )
    .unwrap()
}

/// A Radiance file of one row of one colour, (r, g, b) · 2^(e − 136), with lines in its header.
fn radiance(lines: &str, pixel: [u8; 4]) -> Vec<u8> {
    let mut bytes =
        format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n{lines}\n-Y 1 +X 3\n").into_bytes();
    bytes.extend([pixel; 3].as_flattened());
    bytes
}

#[test]
fn exposures_in_radiance_files_are_divided_out() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path().join("image");
    let read_with = |lines: &str| {
        write(folder.path(), "image", &radiance(lines, [128, 64, 32, 129]));
        read(&at, Orientation::default(), &lens(3, 1), None)
    };
    let (plain, _) = read_with("").unwrap();
    assert!(
        (plain.pixels[0] - Vec3::new(1.0, 0.5, 0.25))
            .abs()
            .max_element()
            < 0.01
    );
    // All exposures count, as those of tools that ran one after the other do.
    let (exposed, _) = read_with("EXPOSURE=4\nEXPOSURE=0.5\n").unwrap();
    assert!((exposed.pixels[0] * 2.0 - plain.pixels[0]).length() < 1e-6);
    let (corrected, _) = read_with("EXPOSURE=2\nCOLORCORR=1 2 4\n").unwrap();
    let multiplied = corrected.pixels[0] * Vec3::new(2.0, 4.0, 8.0);
    assert!((multiplied - plain.pixels[0]).length() < 1e-6);
    for impossible in ["EXPOSURE=0\n", "EXPOSURE=-1\n", "EXPOSURE=NaN\n"] {
        let error = read_with(impossible).unwrap_err().to_string();
        assert!(error.contains("EXPOSURE"), "{error}");
    }
}

#[test]
fn every_format_is_decoded_to_linear_light() {
    let png8 = DynamicImage::ImageRgb8(ImageBuffer::from_pixel(3, 2, Rgb([0, 128, 255])));
    let png16 = DynamicImage::ImageRgb16(ImageBuffer::from_pixel(3, 2, Rgb([0, 32_768, 65_535])));
    let float = DynamicImage::ImageRgb32F(ImageBuffer::from_pixel(3, 2, Rgb([0.0, 0.25, 40.0])));
    let half = 0.214_041_14; // the sRGB curve at one half
    for (image, format, want, encoding, tolerance) in [
        (
            &png8,
            ImageFormat::Png,
            [0.0, 0.215_860_5, 1.0],
            Encoding::Srgb8,
            1e-6,
        ),
        (
            &png16,
            ImageFormat::Png,
            [0.0, half, 1.0],
            Encoding::Srgb16,
            1e-4,
        ),
        (
            &png8,
            ImageFormat::Jpeg,
            [0.0, 0.215_860_5, 1.0],
            Encoding::Srgb8,
            0.02,
        ),
        (
            &float,
            ImageFormat::OpenExr,
            [0.0, 0.25, 40.0],
            Encoding::Linear,
            1e-6,
        ),
        (
            &float,
            ImageFormat::Hdr,
            [0.0, 0.25, 40.0],
            Encoding::Linear,
            0.3,
        ),
    ] {
        let (photograph, invalid) = decode(image, format, Some(0.5));
        assert_eq!((photograph.width, photograph.height, invalid), (3, 2, 0));
        assert_eq!(photograph.encoding, encoding);
        assert!(photograph.usable.is_empty());
        let linear = encoding == Encoding::Linear;
        assert_eq!(
            photograph.saturation,
            if linear {
                Vec3::INFINITY
            } else {
                Vec3::splat(2.0)
            }
        );
        for pixel in &photograph.pixels {
            let error = (*pixel * 0.5 - Vec3::from(want)).abs().max_element();
            assert!(error <= tolerance, "{format:?}: {pixel}");
        }
    }
}

#[test]
fn alpha_and_impossible_values_make_pixels_unusable() {
    let values = [
        [1.0, 1.0, 1.0, 1.0],
        [1.0, 1.0, 1.0, 0.0],
        [f32::NAN, 1.0, 1.0, 1.0],
        [1.0, -0.5, 1.0, 1.0],
    ];
    let image = ImageBuffer::from_fn(4, 1, |x, _| Rgba(values[x as usize]));
    let (photograph, invalid) = decode(
        &DynamicImage::ImageRgba32F(image),
        ImageFormat::OpenExr,
        None,
    );
    assert_eq!(photograph.usable, [true, false, false, false]);
    assert_eq!(invalid, 2);
    assert!(photograph.pixels.iter().all(|p| p.is_finite()));
}

#[test]
fn a_header_that_claims_a_huge_picture_is_refused_before_anything_is_allocated() {
    let folder = folder(&transforms(""));
    let path = folder.path().join("images/000.png");
    let mut bytes = std::fs::read(&path).unwrap();
    for side in [1_000_000_000u32, 65_536] {
        bytes[16..20].copy_from_slice(&side.to_be_bytes());
        bytes[20..24].copy_from_slice(&side.to_be_bytes());
        let checksum = crc32(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&checksum.to_be_bytes());
        write(folder.path(), "images/000.png", &bytes);
        let error = open(folder.path()).unwrap_err();
        assert!(error.place.contains("000.png"), "{error}");
        assert!(
            error.problem.contains("claims") || error.problem.contains("decoded"),
            "{error}"
        );
    }
}

#[test]
fn an_exr_that_claims_huge_windows_is_refused_before_anything_is_allocated() {
    let folder = folder(&transforms(""));
    let mut bytes = Cursor::new(Vec::new());
    let picture = DynamicImage::ImageRgb32F(ImageBuffer::from_pixel(4, 2, Rgb([1.0; 3])));
    picture.write_to(&mut bytes, ImageFormat::OpenExr).unwrap();
    // Width and height of both windows, and windows whose rows alone would take a gigabyte.
    for (window, corner, problem) in [
        ("data", [999_999_999, 999_999_999], "claims 1000000000"),
        ("display", [999_999_999, 999_999_999], "claims 1000000000"),
        (
            "data",
            [0x0400_0003, 1],
            "stores 67108868×2 pixels for a picture of 4×2",
        ),
    ] {
        let mut bytes = bytes.get_ref().clone();
        let name = format!("{window}Window\0box2i\0").into_bytes();
        let found = bytes.windows(name.len()).position(|w| w == name).unwrap();
        let at = found + name.len() + 4 + 8;
        bytes[at..at + 8].copy_from_slice(&corner.map(i32::to_le_bytes).concat());
        write(folder.path(), "images/000.png", &bytes);
        let error = open(folder.path()).unwrap_err();
        assert!(error.problem.contains(problem), "{window}: {error}");
    }
}

/// A grey JPEG whose EXIF states an exposure time and a sensitivity.
fn jpeg(time: [u32; 2], iso: u16) -> Vec<u8> {
    let mut jpeg = Cursor::new(Vec::new());
    let picture = DynamicImage::ImageRgb8(ImageBuffer::from_pixel(4, 2, Rgb([128; 3])));
    picture.write_to(&mut jpeg, ImageFormat::Jpeg).unwrap();
    let mut block = b"Exif\0\0II*\0\x08\0\0\0".to_vec();
    let mut directory = |entries: &[(u16, u16, u32)]| {
        block.extend((entries.len() as u16).to_le_bytes());
        for &(tag, kind, value) in entries {
            block.extend([tag, kind].map(u16::to_le_bytes).concat());
            block.extend([1, value].map(u32::to_le_bytes).concat());
        }
        block.extend(0u32.to_le_bytes());
    };
    // The first directory, at 8, points to the second, at 26, whose exposure time lies behind it, at 56.
    directory(&[(0x8769, 4, 26)]);
    directory(&[(0x829a, 5, 56), (0x8827, 3, u32::from(iso))]);
    block.extend(time.map(u32::to_le_bytes).concat());
    let mut bytes = vec![0xff, 0xd8, 0xff, 0xe1];
    bytes.extend((block.len() as u16 + 2).to_be_bytes());
    bytes.extend(block);
    bytes.extend(&jpeg.get_ref()[2..]);
    bytes
}

#[test]
fn exposures_come_from_exif_relative_to_the_median_frame_if_all_have_them() {
    let pose = "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]";
    let frames: Vec<String> = (0..3)
        .map(|i| format!(r#"{{"file_path": "{i}.jpg", "transform_matrix": {pose}}}"#))
        .collect();
    let text = format!(
        r#"{{"fl_x": 3, "fl_y": 3, "frames": [{}]}}"#,
        frames.join(",")
    );
    let folder = folder(&text);
    for (index, (time, iso)) in [([1, 100], 100), ([1, 100], 400), ([1, 50], 100)]
        .iter()
        .enumerate()
    {
        write(folder.path(), &format!("{index}.jpg"), &jpeg(*time, *iso));
    }
    let exposures = || -> Vec<Option<f64>> {
        let capture = open(folder.path()).unwrap();
        capture.frames.iter().map(|frame| frame.exposure).collect()
    };
    assert_eq!(exposures(), [Some(0.5), Some(2.0), Some(1.0)]);
    std::fs::copy(
        folder.path().join("images/000.png"),
        folder.path().join("1.jpg"),
    )
    .unwrap();
    assert_eq!(exposures(), [None, None, None]);
}

#[test]
fn a_photograph_of_another_size_than_its_camera_is_an_error() {
    let folder = folder(&transforms(""));
    let path = folder.path().join("images/000.png");
    let error = read(&path, Orientation::default(), &lens(5, 5), None).unwrap_err();
    assert!(error.problem.contains("4×2") && error.problem.contains("5×5"));
    assert!(
        read(
            Path::new("none.exr"),
            Orientation::default(),
            &lens(1, 1),
            None
        )
        .is_err()
    );
}

/// The checksum of PNG chunks.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| {
            (crc >> 1) ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 }
        })
    })
}
