//! Dispatches traversals to instruction sets.

#[cfg(target_arch = "x86_64")]
use crate::scene::bvh::lanes::{Eight, Four, Portable};
use crate::scene::bvh::nearest;
use crate::scene::bvh::{Bvh, GROUP, InstructionSet, WIDTH, any};
use crate::scene::geometry::{Hit, Ray};
use std::cell::RefCell;

/// Entries of each thread's stacks; deeper hierarchies allocate a stack per ray.
const STACK_SIZE: usize = 128;

thread_local! {
    // Thread-local, since a stack on the call stack would be cleared for every ray.
    static NEAREST: RefCell<[nearest::Entry; STACK_SIZE]> = const { RefCell::new([0; STACK_SIZE]) };
    // `Lanes::pack` writes a whole vector at a time.
    static ANY: RefCell<[u32; STACK_SIZE + WIDTH]> = const { RefCell::new([0; STACK_SIZE + WIDTH]) };
}

#[inline]
pub(super) fn intersect(bvh: &Bvh, ray: &Ray) -> Option<Hit> {
    if bvh.nodes.is_empty() {
        return None;
    }
    let hit = if bvh.stack_size <= STACK_SIZE {
        NEAREST.with_borrow_mut(|stack| nearest_hit(bvh, ray, stack))
    } else {
        nearest_hit(bvh, ray, &mut vec![0; bvh.stack_size])
    };
    (hit.triangle != u32::MAX).then_some(hit)
}

#[inline]
pub(super) fn occluded(bvh: &Bvh, ray: &Ray) -> bool {
    if bvh.nodes.is_empty() {
        return false;
    }
    if bvh.stack_size <= STACK_SIZE {
        ANY.with_borrow_mut(|stack| any_hit(bvh, ray, stack))
    } else {
        any_hit(bvh, ray, &mut vec![0; bvh.stack_size + WIDTH])
    }
}

/// A traversal of a module, compiled for each instruction set.
macro_rules! dispatched {
    ($name:ident, $module:ident, $entry:ty, $found:ty) => {
        #[inline(always)]
        fn $name(bvh: &Bvh, ray: &Ray, stack: &mut [$entry]) -> $found {
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,bmi1,bmi2,lzcnt,popcnt")]
            fn avx512(bvh: &Bvh, ray: &Ray, stack: &mut [$entry]) -> $found {
                $module::traverse::<Eight, Four>(bvh, ray, stack)
            }
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
            fn avx2(bvh: &Bvh, ray: &Ray, stack: &mut [$entry]) -> $found {
                $module::traverse::<Eight, Four>(bvh, ray, stack)
            }
            match bvh.instructions {
                // SAFETY: `Bvh::instructions` is at most what `InstructionSet::widest` detected.
                #[cfg(target_arch = "x86_64")]
                InstructionSet::Avx512 => unsafe { avx512(bvh, ray, stack) },
                #[cfg(target_arch = "x86_64")]
                InstructionSet::Avx2 => unsafe { avx2(bvh, ray, stack) },
                _ => $module::traverse::<Portable<WIDTH>, Portable<GROUP>>(bvh, ray, stack),
            }
        }
    };
}

dispatched!(nearest_hit, nearest, nearest::Entry, Hit);
dispatched!(any_hit, any, u32, bool);

#[cfg(test)]
mod tests {
    use super::STACK_SIZE;
    use crate::scene::bvh::Bvh;
    use crate::scene::geometry::Ray;
    use glam::Vec3;

    /// Triangles across the x axis, each a little farther and larger than the one before: nothing splits them evenly.
    fn chain() -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let sizes = (-700..700).map(|step| 1.04f32.powi(step));
        let positions: Vec<Vec3> = sizes
            .flat_map(|x| {
                [[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]].map(|[y, z]| Vec3::new(1.0, y, z) * x)
            })
            .collect();
        let triangles = (0..positions.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
        let triangles = triangles.collect();
        (positions, triangles)
    }

    #[test]
    fn hierarchies_deeper_than_the_threads_stacks_are_traversed_whole() {
        let (positions, triangles) = chain();
        let bvh = Bvh::new(&positions, &triangles);
        assert!(bvh.stack_size > STACK_SIZE, "only {}", bvh.stack_size);
        for (index, _) in triangles.iter().enumerate().step_by(50) {
            // Between this triangle and the next, forward and back.
            let x = positions[3 * index].x;
            let origin = Vec3::X * x * 1.02;
            let hit = |direction| {
                let ray = Ray::new(origin, direction);
                let hit = bvh.intersect(&ray);
                assert_eq!(bvh.occluded(&ray), hit.is_some());
                hit.map(|hit| hit.triangle as usize)
            };
            let next = Some(index + 1).filter(|&next| next < triangles.len());
            assert_eq!(hit(Vec3::X), next);
            assert_eq!(hit(-Vec3::X), Some(index));
            // Across the line, nothing is met: each triangle lies in a plane of its own.
            assert_eq!(hit(Vec3::Y), None);
        }
    }
}
