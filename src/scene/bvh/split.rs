//! Splits a set of boxes in two by the binned surface area heuristic (Wald 2007).

use crate::scene::bvh::GROUP;
use glam::{Vec3, Vec3A};

/// A triangle's bounding box.
#[derive(Clone, Copy)]
pub(super) struct Primitive {
    bounds: Bounds,
    pub triangle: u32,
}

impl Primitive {
    pub fn of(triangle: u32, corners: [Vec3; 3]) -> Self {
        let [a, b, c] = corners.map(Vec3A::from);
        let bounds = Bounds {
            low: a.min(b).min(c),
            high: a.max(b).max(c),
        };
        Self { bounds, triangle }
    }

    /// Twice the box's centre.
    #[inline(always)]
    fn center(&self) -> Vec3A {
        self.bounds.low + self.bounds.high
    }
}

/// An axis-aligned box; the empty box is inverted (infinite).
#[derive(Clone, Copy)]
pub(super) struct Bounds {
    pub low: Vec3A,
    pub high: Vec3A,
}

impl Bounds {
    const EMPTY: Self = Self {
        low: Vec3A::INFINITY,
        high: Vec3A::NEG_INFINITY,
    };

    pub fn of(primitives: &[Primitive]) -> Self {
        (primitives.iter()).fold(Self::EMPTY, |bounds, p| bounds.union(&p.bounds))
    }

    #[inline(always)]
    fn union(&self, other: &Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// Half the surface area; zero for the empty box.
    #[inline]
    pub fn half_area(&self) -> f32 {
        let size = (self.high - self.low).max(Vec3A::ZERO);
        size.x * size.y + size.y * size.z + size.z * size.x
    }
}

const BINS: usize = 16;

#[derive(Clone, Copy)]
struct Bin {
    bounds: Bounds,
    count: usize,
}

impl Bin {
    const EMPTY: Self = Self {
        bounds: Bounds::EMPTY,
        count: 0,
    };

    #[inline(always)]
    fn join(&self, other: &Self) -> Self {
        Self {
            bounds: self.bounds.union(&other.bounds),
            count: self.count + other.count,
        }
    }

    /// Surface area times the number of triangle groups.
    fn cost(&self) -> f32 {
        self.bounds.half_area() * self.count.div_ceil(GROUP) as f32
    }
}

/// Reorders primitives so that those left of the plane of minimum surface area cost come first; returns their number. Where no
/// plane separates the centres, it is the first half.
pub(super) fn split(primitives: &mut [Primitive]) -> usize {
    let (low, high) = primitives
        .iter()
        .fold((Vec3A::INFINITY, Vec3A::NEG_INFINITY), |(low, high), p| {
            (low.min(p.center()), high.max(p.center()))
        });
    // Bin boxes by their centres; an axis without extent has one bin.
    let size = high - low;
    let scale = Vec3A::from_array(size.to_array().map(|s| {
        let scale = BINS as f32 * (1.0 - 1e-6) / s;
        if scale.is_finite() { scale } else { 0.0 }
    }));
    let bins_of = |primitive: &Primitive| {
        let bin = (primitive.center() - low) * scale;
        bin.min(Vec3A::splat(BINS as f32 - 1.0)).as_uvec3()
    };
    let mut bins = [[Bin::EMPTY; BINS]; 3];
    for primitive in primitives.iter() {
        let one = Bin {
            bounds: primitive.bounds,
            count: 1,
        };
        let [x, y, z] = bins_of(primitive).to_array();
        for (axis, bin) in [x, y, z].into_iter().enumerate() {
            let bin = &mut bins[axis][bin as usize & (BINS - 1)];
            *bin = bin.join(&one);
        }
    }
    // Evaluate the planes between bins by sweeps from both sides.
    let mut best = (f32::INFINITY, 0, 0);
    for (axis, bins) in bins.iter().enumerate() {
        let mut right = [Bin::EMPTY; BINS];
        let mut sum = Bin::EMPTY;
        for bin in (1..BINS).rev() {
            sum = sum.join(&bins[bin]);
            right[bin] = sum;
        }
        let mut left = Bin::EMPTY;
        for bin in 1..BINS {
            left = left.join(&bins[bin - 1]);
            if left.count > 0 && right[bin].count > 0 {
                let cost = left.cost() + right[bin].cost();
                if cost < best.0 {
                    best = (cost, axis, bin);
                }
            }
        }
    }
    let (_, axis, bin) = best;
    if bin == 0 {
        return primitives.len() / 2;
    }
    let mut middle = 0;
    for index in 0..primitives.len() {
        if bins_of(&primitives[index])[axis] < bin as u32 {
            primitives.swap(middle, index);
            middle += 1;
        }
    }
    middle
}
