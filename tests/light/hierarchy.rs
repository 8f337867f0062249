//! The eight-wide hierarchy against brute force in f64, against itself without vectors, and at shared edges.

use glam::{DVec3, Vec3};
use relit::math::rng::Stream;
use relit::math::warp;
use relit::scene::bvh::{Bvh, InstructionSet};
use relit::scene::geometry::{Hit, Ray};

struct Soup {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Soup {
    fn random(seed: u64, count: usize, size: f32) -> Self {
        let mut stream = Stream::new(seed, 0, 0, 0);
        let mut soup = Self {
            positions: Vec::new(),
            triangles: Vec::new(),
        };
        for _ in 0..count {
            let first = soup.positions.len() as u32;
            let center = Vec3::from_array([0; 3].map(|_| stream.uniform() * 2.0 - 1.0));
            for _ in 0..3 {
                let arm = warp::uniform_sphere(stream.uniform2()) * size * stream.uniform();
                soup.positions.push(center + arm);
            }
            soup.triangles.push([first, first + 1, first + 2]);
        }
        soup
    }

    /// A sphere of unit radius as a closed mesh of shared vertices.
    fn sphere(rings: u32, sectors: u32) -> Self {
        let mut soup = Self {
            positions: vec![Vec3::Y],
            triangles: Vec::new(),
        };
        for ring in 1..rings {
            for sector in 0..sectors {
                let theta = std::f32::consts::PI * ring as f32 / rings as f32;
                let phi = 2.0 * std::f32::consts::PI * sector as f32 / sectors as f32;
                soup.positions.push(Vec3::new(
                    theta.sin() * phi.cos(),
                    theta.cos(),
                    theta.sin() * phi.sin(),
                ));
            }
        }
        let south = soup.positions.len() as u32;
        soup.positions.push(-Vec3::Y);
        let at = |ring: u32, sector: u32| 1 + (ring - 1) * sectors + sector % sectors;
        for s in 0..sectors {
            soup.triangles.push([0, at(1, s + 1), at(1, s)]);
            soup.triangles
                .push([south, at(rings - 1, s), at(rings - 1, s + 1)]);
            for ring in 1..rings - 1 {
                soup.triangles
                    .push([at(ring, s), at(ring, s + 1), at(ring + 1, s)]);
                soup.triangles
                    .push([at(ring, s + 1), at(ring + 1, s + 1), at(ring + 1, s)]);
            }
        }
        soup
    }

    fn bvh(&self) -> Bvh {
        Bvh::new(&self.positions, &self.triangles)
    }

    /// All distances at which a ray meets triangles, with the distance to the nearest edge in barycentric terms.
    fn all_hits_f64(&self, ray: &Ray) -> Vec<(f64, u32, f64)> {
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let mut hits = Vec::new();
        for (index, t) in self.triangles.iter().enumerate() {
            let [a, b, c]: [DVec3; 3] = t.map(|i| self.positions[i as usize].as_dvec3());
            let (e1, e2) = (b - a, c - a);
            let p = d.cross(e2);
            let determinant = e1.dot(p);
            let s = o - a;
            let u = s.dot(p) / determinant;
            let q = s.cross(e1);
            let v = d.dot(q) / determinant;
            let t = e2.dot(q) / determinant;
            let margin = u.min(v).min(1.0 - u - v);
            if margin >= 0.0 && t > 0.0 {
                hits.push((t, index as u32, margin));
            }
        }
        hits.sort_by(|a, b| a.0.total_cmp(&b.0));
        hits
    }
}

fn random_ray(stream: &mut Stream) -> Ray {
    let origin = Vec3::from_array([0; 3].map(|_| stream.uniform() * 3.0 - 1.5));
    Ray::new(origin, warp::uniform_sphere(stream.uniform2()))
}

#[test]
fn nearest_hits_and_visibility_agree_with_brute_force_in_f64() {
    for (seed, count, size) in [(1, 1, 1.0), (2, 7, 1.0), (3, 500, 0.4), (4, 3000, 0.05)] {
        let soup = Soup::random(seed, count, size);
        let bvh = soup.bvh();
        let mut stream = Stream::new(seed, 1, 0, 0);
        let mut compared = 0;
        for _ in 0..2_000 {
            let ray = random_ray(&mut stream);
            let exact = soup.all_hits_f64(&ray);
            // Rays that graze an edge within rounding may go either way.
            if exact.iter().any(|h| h.2 < 1e-4) {
                continue;
            }
            compared += 1;
            let hit = bvh.intersect(&ray);
            match (hit, exact.first()) {
                (None, None) => {}
                (Some(hit), Some(&(t, triangle, _))) => {
                    assert!(
                        (f64::from(hit.t) - t).abs() < 1e-3 * t.max(1e-2),
                        "{} against {t}",
                        hit.t
                    );
                    assert!(hit.triangle == triangle || (exact[1].0 - t).abs() < 1e-4);
                }
                (hit, exact) => panic!("{hit:?} against {exact:?}"),
            }
            assert_eq!(bvh.occluded(&ray), hit.is_some());
            if let Some(hit) = hit {
                assert!(
                    !bvh.occluded(&Ray {
                        t_max: hit.t,
                        ..ray
                    }),
                    "nothing is nearer than the nearest hit"
                );
                assert!(bvh.occluded(&Ray {
                    t_max: hit.t * 1.0001,
                    ..ray
                }));
            }
        }
        assert!(compared > 1000);
    }
}

/// The instruction sets beyond plain arrays that this processor has.
fn wider() -> Vec<InstructionSet> {
    let wider: Vec<_> = [InstructionSet::Avx2, InstructionSet::Avx512]
        .into_iter()
        .filter(|&set| set <= InstructionSet::widest())
        .collect();
    if wider.is_empty() {
        println!("skipped: this processor has no wider instruction set");
    }
    wider
}

/// Every wider instruction set sees along rays what plain arrays see, to the bit; how many rays hit something.
fn assert_same_bits(soup: &Soup, rays: &[Ray]) -> usize {
    let plain = soup.bvh().with_instructions(InstructionSet::Portable);
    let bits =
        |hit: Option<Hit>| hit.map(|h| (h.t.to_bits(), h.triangle, h.b1.to_bits(), h.b2.to_bits()));
    for set in wider() {
        let wide = soup.bvh().with_instructions(set);
        for ray in rays {
            let (met, expected) = (bits(wide.intersect(ray)), bits(plain.intersect(ray)));
            assert_eq!(met, expected, "{set:?}: {ray:?}");
            assert_eq!(wide.occluded(ray), plain.occluded(ray), "{set:?}: {ray:?}");
        }
    }
    rays.iter()
        .filter(|ray| plain.intersect(ray).is_some())
        .count()
}

/// How many of so many cases are tried under Miri, which takes a thousand times as long.
fn cases(many: usize) -> usize {
    if cfg!(miri) { many / 100 } else { many }
}

/// How large their triangles are: the fewer, the larger, so that as many rays meet one.
fn size(usual: f32) -> f32 {
    if cfg!(miri) { usual * 10.0 } else { usual }
}

#[test]
fn vectors_and_plain_arrays_give_the_same_bits() {
    let soup = Soup::random(9, cases(5000), size(0.2));
    let mut stream = Stream::new(9, 1, 0, 0);
    let rays: Vec<Ray> = (0..cases(20_000))
        .map(|_| random_ray(&mut stream))
        .collect();
    assert!(assert_same_bits(&soup, &rays) > rays.len() / 20);
}

/// Where `min`, `max` and comparisons of vectors could differ from those of single numbers: signed zeros, infinities,
/// numbers next to zero, and what is no number, in meshes, in rays and in their ends.
#[test]
fn vectors_and_plain_arrays_give_the_same_bits_of_numbers_at_the_ends_of_their_range() {
    const ENDS: [f32; 14] = [
        0.0,
        -0.0,
        1e-45,
        -1e-45,
        1.2e-38,
        0.5,
        -0.5,
        1.0,
        1e18,
        -1e30,
        f32::MAX,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
    ];
    let mut stream = Stream::new(10, 0, 0, 0);
    // One number in eight is extreme.
    let mut number = |calm: f32| match stream.below(8) {
        0 => ENDS[stream.below(ENDS.len())],
        _ => calm * (2.0 * stream.uniform() - 1.0),
    };
    let mut soup = Soup::random(10, cases(1000), size(0.4));
    soup.positions = (soup.positions.iter())
        .map(|p| *p + Vec3::from_array([0; 3].map(|_| number(0.0))))
        .collect();
    let rays: Vec<Ray> = (0..cases(20_000))
        .map(|_| Ray {
            origin: Vec3::from_array([0; 3].map(|_| number(1.0))),
            direction: Vec3::from_array([0; 3].map(|_| number(1.0))),
            t_min: number(0.0).abs(),
            t_max: if number(1.0) > 0.0 {
                f32::INFINITY
            } else {
                number(3.0)
            },
        })
        .collect();
    assert!(assert_same_bits(&soup, &rays) > rays.len() / 100);
}

/// More triangles than are built in one piece and than lie on small pages.
#[test]
fn a_large_mesh_is_hit_as_by_each_of_its_parts() {
    let soup = Soup::random(6, 40_000, 0.05);
    let bvh = soup.bvh();
    let parts: Vec<Bvh> = (0..4)
        .map(|part| Bvh::new(&soup.positions, &soup.triangles[part * 10_000..][..10_000]))
        .collect();
    let mut stream = Stream::new(6, 1, 0, 0);
    for _ in 0..5_000 {
        let ray = random_ray(&mut stream);
        let nearest = parts
            .iter()
            .enumerate()
            .filter_map(|(part, bvh)| {
                let hit = bvh.intersect(&ray)?;
                let triangle = hit.triangle + part as u32 * 10_000;
                Some(Hit { triangle, ..hit })
            })
            .min_by(|a, b| a.t.total_cmp(&b.t));
        assert_eq!(bvh.intersect(&ray), nearest);
        assert_eq!(bvh.occluded(&ray), nearest.is_some());
    }
}

#[test]
fn no_ray_leaks_through_the_edges_and_corners_of_a_closed_mesh() {
    let soup = Soup::sphere(24, 48);
    let bvh = soup.bvh();
    let mut stream = Stream::new(4, 1, 0, 0);
    for _ in 0..50 {
        let origin = warp::uniform_sphere(stream.uniform2()) * 0.9 * stream.uniform();
        for t in &soup.triangles {
            let corners = t.map(|i| soup.positions[i as usize]);
            let along = stream.uniform();
            for target in [
                corners[0],
                corners[0].lerp(corners[1], along),
                corners[1].lerp(corners[2], 0.5),
            ] {
                assert!(bvh.intersect(&Ray::new(origin, target - origin)).is_some());
            }
        }
    }
}

#[test]
fn of_coincident_triangles_the_first_is_hit_whatever_the_hierarchy() {
    let mut soup = Soup::random(5, 1, 1.0);
    let triangle = soup.triangles[0];
    soup.triangles = vec![triangle; 500];
    let bvh = soup.bvh();
    let [a, b, c] = triangle.map(|i| soup.positions[i as usize]);
    let target = (a + b + c) / 3.0;
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let hit = bvh
        .intersect(&Ray::new(target + normal, -normal))
        .expect("the middle is hit");
    assert_eq!(hit.triangle, 0);
}

#[test]
fn degenerate_meshes_build_and_are_never_hit() {
    let nan = Soup {
        positions: vec![Vec3::NAN, Vec3::X, Vec3::Y],
        triangles: vec![[0, 1, 2]],
    };
    let point = Soup {
        positions: vec![Vec3::ZERO],
        triangles: vec![[0, 0, 0]; 20],
    };
    let empty = Soup {
        positions: Vec::new(),
        triangles: Vec::new(),
    };
    for soup in [nan, point, empty] {
        let bvh = soup.bvh();
        for direction in [Vec3::X, -Vec3::Z, Vec3::ONE] {
            assert!(bvh.intersect(&Ray::new(-direction, direction)).is_none());
        }
    }
}

#[test]
fn rays_along_the_axes_meet_boxes_that_they_lie_in() {
    let quad = Soup {
        positions: vec![
            Vec3::new(-1.0, 0.0, -1.0),
            Vec3::new(1.0, 0.0, -1.0),
            Vec3::new(1.0, 0.0, 1.0),
            Vec3::new(-1.0, 0.0, 1.0),
        ],
        triangles: vec![[0, 2, 1], [0, 3, 2]],
    };
    let bvh = quad.bvh();
    for x in [-1.0, -0.5, 0.0, 0.5, 1.0] {
        let ray = Ray::new(Vec3::new(x, 1.0, 0.25), -Vec3::Y);
        let hit = bvh.intersect(&ray).expect("the quad lies below");
        assert_eq!(hit.t, 1.0);
    }
}
