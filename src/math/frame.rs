//! Orthonormal frames around a normal.

use glam::Vec3;

/// An orthonormal frame; `n` is the local z axis.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// First tangent.
    pub s: Vec3,
    /// Second tangent.
    pub t: Vec3,
    /// Normal.
    pub n: Vec3,
}

impl Frame {
    /// The frame around a unit vector (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
    #[inline]
    pub fn around(n: Vec3) -> Self {
        let sign = 1f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// Local coordinates of a world direction.
    #[inline]
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// World coordinates of a local direction.
    #[inline]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;
    use crate::math::warp;

    #[test]
    fn frames_are_orthonormal_at_every_normal_poles_included() {
        let mut stream = Stream::new(3, 0, 0, 0);
        let poles = [Vec3::Z, -Vec3::Z, Vec3::new(0.0, 1e-20, -1.0)];
        let random = (0..10_000).map(|_| warp::uniform_sphere(stream.uniform2()));
        for n in poles.into_iter().chain(random) {
            let f = Frame::around(n);
            for (a, b, want) in [
                (f.s, f.s, 1.0),
                (f.t, f.t, 1.0),
                (f.s, f.t, 0.0),
                (f.s, n, 0.0),
                (f.t, n, 0.0),
            ] {
                assert!((a.dot(b) - want).abs() < 2e-6, "{n}");
            }
        }
    }
}
