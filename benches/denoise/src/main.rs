//! The built-in denoiser beside Open Image Denoise, on renders of the built-in room.
//!
//! `RELIT_OIDN=.../libOpenImageDenoise.so.2 cargo run --release [-- REFERENCE]`: mean relative squared error (error² over reference² + 0.01)
//! and mean relative deviation against REFERENCE samples a pixel (default 512), and milliseconds, over three photographs.

use relit::math::color::luminance;
use relit::math::picture::Picture;
use relit::room::Room;
use relit::transport::denoise::{Denoiser, guides};
use relit::transport::film::Film;
use relit::transport::lit::LitScene;
use relit::transport::path::PathOptions;
use std::time::Instant;

/// Photographs whose views are rendered.
const FRAMES: [usize; 3] = [0, 5, 11];

fn main() {
    let reference = std::env::args()
        .nth(1)
        .map_or(512, |n| n.parse().expect("a whole number"));
    let lit = Room::new().lit([160, 120]).expect("the room is sound");
    let truths: Vec<Picture> = FRAMES
        .iter()
        .map(|&f| render(&lit, f, 1000, reference))
        .collect();
    println!("| samples | what | relative squared error | mean deviation, % | ms |");
    println!("| --- | --- | --- | --- | --- |");
    for samples in [4, 16, 64] {
        let halves: Vec<[Picture; 2]> = (FRAMES.iter())
            .map(|&f| [1, 2].map(|seed| render(&lit, f, seed, samples / 2)))
            .collect();
        let row = |what: &str, of: &dyn Fn(usize) -> Picture| {
            let (mut square, mut off, mut ms) = (0.0, 0.0, 0.0);
            for (index, truth) in truths.iter().enumerate() {
                let start = Instant::now();
                let picture = of(index);
                ms += start.elapsed().as_secs_f64() * 1e3;
                let [s, o] = errors(&picture, truth);
                square += s;
                off += o;
            }
            let n = truths.len() as f64;
            println!(
                "| {samples} | {what} | {:.4} | {:+.2} | {:.0} |",
                square / n,
                100.0 * off / n,
                ms / n
            );
        };
        row("as rendered", &|index| mean(&halves[index]));
        let mut denoisers = vec![Denoiser::Builtin];
        if Denoiser::best() == Denoiser::Oidn {
            denoisers.push(Denoiser::Oidn);
        }
        for denoiser in denoisers {
            row(denoiser.name(), &|index| {
                let [a, b] = &halves[index];
                let camera = &lit.scene.cameras[FRAMES[index]];
                denoiser.denoise(a, b, &guides(&lit, camera))
            });
        }
    }
}

/// A view by so many samples a pixel.
fn render(lit: &LitScene, frame: usize, seed: u64, samples: u32) -> Picture {
    let camera = &lit.scene.cameras[frame];
    let mut film = Film::new(camera);
    film.add(
        lit,
        camera,
        &PathOptions::default(),
        seed,
        frame as u64,
        samples,
    );
    Picture {
        width: film.width,
        height: film.height,
        pixels: film.mean(),
    }
}

fn mean([a, b]: &[Picture; 2]) -> Picture {
    Picture {
        pixels: a
            .pixels
            .iter()
            .zip(&b.pixels)
            .map(|(a, b)| (*a + *b) * 0.5)
            .collect(),
        ..*a
    }
}

/// Mean relative squared error of luminance, and the deviation of its mean.
fn errors(picture: &Picture, truth: &Picture) -> [f64; 2] {
    let pairs = || {
        let pixels = picture.pixels.iter().zip(&truth.pixels);
        pixels.map(|(a, b)| [*a, *b].map(|p| f64::from(luminance(p))))
    };
    let square = pairs()
        .map(|[a, b]| (a - b).powi(2) / (b * b + 0.01))
        .sum::<f64>();
    let [sum, wanted] = pairs().fold([0.0; 2], |[s, w], [a, b]| [s + a, w + b]);
    [square / truth.pixels.len() as f64, sum / wanted - 1.0]
}
