//! Two ways to answer the same rays, timed in turn on one thread.

use relit::scene::geometry::Ray;
use std::hint::black_box;

/// Struct timespec of 64-bit systems.
#[repr(C)]
struct TimeSpec {
    seconds: i64,
    nanoseconds: i64,
}

unsafe extern "C" {
    fn clock_gettime(clock: i32, time: *mut TimeSpec) -> i32;
}

/// Seconds that this thread has run, so that other work on the machine counts less.
fn thread_seconds() -> f64 {
    const CLOCK_THREAD_CPUTIME_ID: i32 = 3;
    let mut time = TimeSpec {
        seconds: 0,
        nanoseconds: 0,
    };
    // SAFETY: the struct has the system's layout.
    unsafe { clock_gettime(CLOCK_THREAD_CPUTIME_ID, &mut time) };
    time.seconds as f64 + time.nanoseconds as f64 * 1e-9
}

/// Min, median and max of the first and of the second way in million rays a second, and of their ratio pair by pair.
pub fn paired(
    runs: usize,
    rays: &[Ray],
    first: impl Fn(&Ray) -> f32,
    second: impl Fn(&Ray) -> f32,
) -> [[f64; 3]; 3] {
    let speed = |f: &dyn Fn() -> f32| {
        let start = thread_seconds();
        black_box(f());
        rays.len() as f64 / (thread_seconds() - start) * 1e-6
    };
    let run_first = || rays.iter().map(&first).sum();
    let run_second = || rays.iter().map(&second).sum();
    let mut pairs = Vec::new();
    for run in 0..=runs {
        // The first pair only warms up; who goes first alternates.
        let pair = if run % 2 == 0 {
            let a = speed(&run_first);
            [a, speed(&run_second)]
        } else {
            let b = speed(&run_second);
            [speed(&run_first), b]
        };
        if run > 0 {
            pairs.push(pair);
        }
    }
    let spread = |f: &dyn Fn(&[f64; 2]) -> f64| {
        let mut values: Vec<f64> = pairs.iter().map(f).collect();
        values.sort_by(f64::total_cmp);
        [
            values[0],
            values[values.len() / 2],
            values[values.len() - 1],
        ]
    };
    [
        spread(&|p| p[0]),
        spread(&|p| p[1]),
        spread(&|p| p[0] / p[1]),
    ]
}
