//! Keyed random streams: the same key gives the same numbers on any thread.

/// A stream of uniform numbers from a key; streams of different keys are independent.
///
/// The generator is PCG-XSH-RR 32 (O'Neill 2014), with state and increment hashed from the key by SplitMix64.
#[derive(Debug, Clone)]
pub struct Stream {
    state: u64,
    increment: u64,
}

/// One round of SplitMix64 (Steele et al. 2014): a bijective hash of 64 bits.
#[inline]
pub fn splitmix64(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

impl Stream {
    /// The stream of a (seed, frame, pixel, sample) key.
    #[inline]
    pub fn new(seed: u64, frame: u64, pixel: u64, sample: u64) -> Self {
        let mut h = splitmix64(seed);
        for key in [frame, pixel, sample] {
            h = splitmix64(h ^ key);
        }
        let mut stream = Self {
            state: splitmix64(h),
            increment: splitmix64(h ^ 0x5851_f42d_4c95_7f2d) | 1,
        };
        stream.next_u32();
        stream
    }

    /// A uniform 32-bit number.
    #[inline]
    pub fn next_u32(&mut self) -> u32 {
        let old = self.state;
        self.state = old
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(self.increment);
        let xorshifted = (((old >> 18) ^ old) >> 27) as u32;
        xorshifted.rotate_right((old >> 59) as u32)
    }

    /// A uniform number in [0, 1), a multiple of 2⁻²⁴.
    #[inline]
    pub fn uniform(&mut self) -> f32 {
        (self.next_u32() >> 8) as f32 * (1.0 / 16_777_216.0)
    }

    /// A uniform number in [0, 1) with 53 bits, for choices among many or very unequal probabilities.
    #[inline]
    pub fn uniform_f64(&mut self) -> f64 {
        let bits = (u64::from(self.next_u32()) << 32) | u64::from(self.next_u32());
        (bits >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// Two independent uniform numbers in [0, 1).
    #[inline]
    pub fn uniform2(&mut self) -> [f32; 2] {
        [self.uniform(), self.uniform()]
    }

    /// A standard normal number (Box and Muller 1958).
    #[inline]
    pub fn normal(&mut self) -> f32 {
        let [u, v] = self.uniform2();
        (-2.0 * (1.0 - u).ln()).sqrt() * (std::f32::consts::TAU * v).cos()
    }

    /// A uniform index below `n` (`n` > 0), by Lemire's multiply-shift.
    #[inline]
    pub fn below(&mut self, n: usize) -> usize {
        let bits = (u64::from(self.next_u32()) << 32) | u64::from(self.next_u32());
        ((u128::from(bits) * n as u128) >> 64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::stats::chi_square;

    #[test]
    fn the_same_key_gives_the_same_stream_and_another_key_another() {
        let numbers = |[seed, frame, pixel, sample]: [u64; 4]| {
            let mut stream = Stream::new(seed, frame, pixel, sample);
            [(); 8].map(|()| stream.next_u32())
        };
        let [a, b] = [[1, 2, 3, 4]; 2].map(numbers);
        assert_eq!(a, b);
        let others = [[9, 2, 3, 4], [1, 9, 3, 4], [1, 2, 9, 4], [1, 2, 3, 9]];
        for other in others.into_iter().chain([[2, 1, 3, 4]]).map(numbers) {
            assert!(a.iter().zip(other).all(|(a, b)| *a != b));
        }
    }

    /// Chi-square over 64 cells of pairs from neighbouring keys; critical value at significance 1e-4.
    #[test]
    fn neighbouring_keys_are_jointly_uniform() {
        let mut cells = [0u32; 64];
        for pixel in 0..64_000 {
            let a = Stream::new(7, 0, pixel, 0).uniform();
            let b = Stream::new(7, 0, pixel + 1, 0).uniform();
            cells[(a * 8.0) as usize * 8 + (b * 8.0) as usize] += 1;
        }
        let chi2 = chi_square(&cells);
        assert!(chi2 < 113.5, "{chi2}");
    }
}
