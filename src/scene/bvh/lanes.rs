//! SIMD vectors of floats, and plain arrays with identical results.

/// `N` f32 lanes. `min` and `max` return the second operand where either is NaN; comparisons are then false.
///
/// All methods are `#[inline(always)]`: what is not inlined into a function with `#[target_feature]` lacks its instructions.
pub(super) trait Lanes<const N: usize>: Copy {
    fn splat(x: f32) -> Self;
    /// Floats from their bits.
    fn load(bits: &[u32; N]) -> Self;
    fn store(self) -> [f32; N];
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    /// Bit i is set where lane i of `self` ≤ lane i of `other`.
    fn le(self, other: Self) -> u32;
    /// Bit i is set where lane i of `self` < lane i of `other`.
    fn lt(self, other: Self) -> u32;
    /// Compacts the entries whose mask bits are set, in order, into `packed` (at least N long); the rest of these N is undefined.
    fn pack(entries: &[u32; N], mask: u32, packed: &mut [u32]);
}

/// Broadcasts three coordinates to all lanes.
#[inline(always)]
pub(super) fn splat<const N: usize, L: Lanes<N>>([x, y, z]: [f32; 3]) -> [L; 3] {
    [L::splat(x), L::splat(y), L::splat(z)]
}

/// Plain arrays, on any processor.
#[derive(Clone, Copy)]
pub(super) struct Portable<const N: usize>([f32; N]);

impl<const N: usize> Portable<N> {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }

    #[inline(always)]
    fn mask(self, other: Self, f: impl Fn(f32, f32) -> bool) -> u32 {
        let mut mask = 0;
        for i in 0..N {
            mask |= u32::from(f(self.0[i], other.0[i])) << i;
        }
        mask
    }
}

/// Methods of two vectors, lane by lane.
macro_rules! lanewise {
    ($($name:ident: $f:expr;)*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> Self {
            self.zip(other, $f)
        })*
    };
}

impl<const N: usize> Lanes<N> for Portable<N> {
    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self([x; N])
    }
    #[inline(always)]
    fn load(bits: &[u32; N]) -> Self {
        Self(bits.map(f32::from_bits))
    }
    #[inline(always)]
    fn store(self) -> [f32; N] {
        self.0
    }
    lanewise! {
        add: |a, b| a + b;
        sub: |a, b| a - b;
        mul: |a, b| a * b;
        div: |a, b| a / b;
        min: |a, b| if a < b { a } else { b };
        max: |a, b| if a > b { a } else { b };
    }
    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        self.mask(other, |a, b| a <= b)
    }
    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        self.mask(other, |a, b| a < b)
    }
    #[inline(always)]
    fn pack(entries: &[u32; N], mask: u32, packed: &mut [u32]) {
        pack_each(entries, mask, packed);
    }
}

#[inline(always)]
fn pack_each<const N: usize>(entries: &[u32; N], mut mask: u32, packed: &mut [u32]) {
    for slot in &mut packed[..N] {
        if mask == 0 {
            return;
        }
        *slot = entries[mask.trailing_zeros() as usize & (N - 1)];
        mask &= mask - 1;
    }
}

/// Prefetches four cache lines at an address, which need not be valid; no operation on other architectures.
#[inline(always)]
pub(super) fn prefetch<T>(address: *const T) {
    #[cfg(target_arch = "x86_64")]
    for line in 0..4 {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a prefetch touches no memory that the program can see, and SSE is always there.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast::<i8>().wrapping_add(64 * line)) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}

#[cfg(target_arch = "x86_64")]
pub(super) use vectors::{Eight, Four};

#[cfg(target_arch = "x86_64")]
mod vectors {
    use super::{Lanes, pack_each};
    use std::arch::x86_64::*;

    /// A 128-bit vector. Every x86-64 processor has SSE2.
    #[derive(Clone, Copy)]
    pub(in crate::scene::bvh) struct Four(__m128);

    /// A 256-bit vector. Made only inside functions that are entered after AVX2 was detected.
    #[derive(Clone, Copy)]
    pub(in crate::scene::bvh) struct Eight(__m256);

    macro_rules! lanes {
        ($name:ident, $width:literal: $set:ident $load:ident $store:ident $mask:ident $pack:ident;
         $($arithmetic:ident $intrinsic:ident,)*; $($comparison:ident $compare:expr,)*) => {
            // SAFETY of every block below: SSE2 is always there, and methods of `Eight` are reached only through
            // `traverse`'s functions with `#[target_feature(enable = "avx2")]`, which are called only where
            // `InstructionSet::widest` found AVX2; loads and stores are unaligned ones on references to arrays of
            // exactly the vector's size.
            impl Lanes<$width> for $name {
                #[inline(always)]
                fn splat(x: f32) -> Self {
                    Self(unsafe { $set(x) })
                }
                #[inline(always)]
                fn load(bits: &[u32; $width]) -> Self {
                    Self(unsafe { $load(bits.as_ptr().cast()) })
                }
                #[inline(always)]
                fn store(self) -> [f32; $width] {
                    let mut x = [0.0; $width];
                    unsafe { $store(x.as_mut_ptr(), self.0) };
                    x
                }
                $(#[inline(always)]
                fn $arithmetic(self, other: Self) -> Self {
                    Self(unsafe { $intrinsic(self.0, other.0) })
                })*
                $(#[inline(always)]
                fn $comparison(self, other: Self) -> u32 {
                    unsafe { $mask(($compare)(self.0, other.0)) as u32 }
                })*
                #[inline(always)]
                fn pack(entries: &[u32; $width], mask: u32, packed: &mut [u32]) {
                    $pack(entries, mask, packed);
                }
            }
        };
    }

    lanes! {
        Four, 4: _mm_set1_ps _mm_loadu_ps _mm_storeu_ps _mm_movemask_ps pack_each;
        add _mm_add_ps, sub _mm_sub_ps, mul _mm_mul_ps, div _mm_div_ps, min _mm_min_ps, max _mm_max_ps,;
        le _mm_cmple_ps, lt _mm_cmplt_ps,
    }
    lanes! {
        Eight, 8: _mm256_set1_ps _mm256_loadu_ps _mm256_storeu_ps _mm256_movemask_ps pack_eight;
        add _mm256_add_ps, sub _mm256_sub_ps, mul _mm256_mul_ps, div _mm256_div_ps, min _mm256_min_ps, max _mm256_max_ps,;
        le _mm256_cmp_ps::<_CMP_LE_OQ>, lt _mm256_cmp_ps::<_CMP_LT_OQ>,
    }

    /// For each mask, the lanes of its set bits in order, one byte per lane.
    static PACKING: [u64; 256] = packing();

    const fn packing() -> [u64; 256] {
        let mut table = [0; 256];
        let mut mask = 0;
        while mask < 256 {
            let (mut lane, mut place) = (0, 0);
            while lane < 8 {
                if mask >> lane & 1 == 1 {
                    table[mask] |= lane << place;
                    place += 8;
                }
                lane += 1;
            }
            mask += 1;
        }
        table
    }

    #[inline(always)]
    fn pack_eight(entries: &[u32; 8], mask: u32, packed: &mut [u32]) {
        let packed = &mut packed[..8];
        let lanes = PACKING[mask as usize & 0xff];
        // SAFETY: as above; a permutation takes its lanes modulo eight, and `packed` has room for all eight.
        unsafe {
            let lanes = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(lanes as i64));
            let entries = _mm256_loadu_si256(entries.as_ptr().cast());
            let ordered = _mm256_permutevar8x32_epi32(entries, lanes);
            _mm256_storeu_si256(packed.as_mut_ptr().cast(), ordered);
        }
    }
}
