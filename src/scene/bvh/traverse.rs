//! Which instructions a ray is traced with.

#[cfg(target_arch = "x86_64")]
use super::lanes::{Eight, Four};
use super::lanes::{Lanes, Portable};
use super::{Bvh, GROUP, InstructionSet, WIDTH, any, nearest};
use crate::scene::geometry::{Hit, Ray};

/// Stack entries kept in the frame; deeper hierarchies take theirs from the heap.
const SHALLOW: usize = 64;

#[inline]
pub(super) fn intersect(bvh: &Bvh, ray: &Ray) -> Option<Hit> {
    if bvh.nodes.is_empty() {
        return None;
    }
    let hit = match bvh.instructions {
        // SAFETY: `Bvh::instructions` is at most what `InstructionSet::widest` detected.
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx512 => unsafe { nearest_avx512(bvh, ray) },
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx2 => unsafe { nearest_avx2(bvh, ray) },
        _ => nearest_with::<Portable<WIDTH>, Portable<GROUP>>(bvh, ray),
    };
    (hit.triangle != u32::MAX).then_some(hit)
}

#[inline]
pub(super) fn occluded(bvh: &Bvh, ray: &Ray) -> bool {
    if bvh.nodes.is_empty() {
        return false;
    }
    match bvh.instructions {
        // SAFETY: `Bvh::instructions` is at most what `InstructionSet::widest` detected.
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx512 => unsafe { any_avx512(bvh, ray) },
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx2 => unsafe { any_avx2(bvh, ray) },
        _ => any_with::<Portable<WIDTH>, Portable<GROUP>>(bvh, ray),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,bmi1,bmi2,lzcnt,popcnt")]
fn nearest_avx512(bvh: &Bvh, ray: &Ray) -> Hit {
    nearest_with::<Eight, Four>(bvh, ray)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn nearest_avx2(bvh: &Bvh, ray: &Ray) -> Hit {
    nearest_with::<Eight, Four>(bvh, ray)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,bmi1,bmi2,lzcnt,popcnt")]
fn any_avx512(bvh: &Bvh, ray: &Ray) -> bool {
    any_with::<Eight, Four>(bvh, ray)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn any_avx2(bvh: &Bvh, ray: &Ray) -> bool {
    any_with::<Eight, Four>(bvh, ray)
}

#[inline(always)]
fn nearest_with<B: Lanes<WIDTH>, T: Lanes<GROUP>>(bvh: &Bvh, ray: &Ray) -> Hit {
    if bvh.stack_size <= SHALLOW {
        nearest::traverse::<B, T>(bvh, ray, &mut [0; SHALLOW])
    } else {
        nearest::traverse::<B, T>(bvh, ray, &mut vec![0; bvh.stack_size])
    }
}

#[inline(always)]
fn any_with<B: Lanes<WIDTH>, T: Lanes<GROUP>>(bvh: &Bvh, ray: &Ray) -> bool {
    // A whole vector is put on the stack at a time.
    if bvh.stack_size <= SHALLOW {
        any::traverse::<B, T>(bvh, ray, &mut [0; SHALLOW + WIDTH])
    } else {
        any::traverse::<B, T>(bvh, ray, &mut vec![0; bvh.stack_size + WIDTH])
    }
}
