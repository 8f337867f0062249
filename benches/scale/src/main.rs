//! Writes a capture of a hall with boxes: `scale-bench OUT TRIANGLES PHOTOGRAPHS OBJECTS`.

use glam::{DVec3, Vec3};
use relit::capture::mesh::Mesh;
use relit::export::capture::write;
use relit::math::rng::Stream;
use relit::room::Room;
use relit::room::cameras::View;
use relit::room::photographs::Rendering;
use relit::transport::material::Material;
use std::path::Path;

/// Half the hall's width and depth, and its height, in metres.
const HALF: f64 = 5.0;
/// See [`HALF`].
const HEIGHT: f64 = 3.0;
/// Floor, ceiling, four walls and a lamp.
const SHELL: usize = 7;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [out, numbers @ ..] = arguments.as_slice() else {
        panic!("usage: scale-bench OUT TRIANGLES PHOTOGRAPHS OBJECTS");
    };
    let numbers: Vec<usize> = numbers
        .iter()
        .map(|n| n.parse().expect("a whole number"))
        .collect();
    let [triangles, photographs, objects] = numbers[..] else {
        panic!("usage: scale-bench OUT TRIANGLES PHOTOGRAPHS OBJECTS");
    };
    let room = hall(triangles, photographs, objects.max(SHELL + 1));
    let rendering = Rendering {
        seed: 1,
        samples: 16,
        size: [32, 24],
    };
    let capture = room.photographed(&rendering).expect("the hall renders");
    write(Path::new(out), &capture).expect("the capture is written");
    println!("{} {}", room.mesh.triangles.len(), room.mesh.objects.len());
}

fn hall(triangles: usize, photographs: usize, objects: usize) -> Room {
    let boxes = objects - SHELL;
    let mut builder = Builder {
        mesh: Mesh::default(),
        materials: Vec::new(),
        stream: Stream::new(5, 0, 0, 0),
    };
    // Half of the triangles go to the shell, half to the boxes; all are split evenly.
    let steps =
        |faces: usize| ((triangles as f64 / 4.0 / faces as f64).sqrt().round() as u32).max(1);
    let (x, y, z) = (
        DVec3::X * 2.0 * HALF,
        DVec3::Y * HEIGHT,
        DVec3::Z * 2.0 * HALF,
    );
    let low = DVec3::new(-HALF, 0.0, -HALF);
    let high = -low + DVec3::Y * HEIGHT;
    let shell = steps(SHELL);
    for (name, corner, u, v) in [
        ("floor", low, z, x),
        ("ceiling", high, -x, -z),
        ("north", low, x, y),
        ("south", high, -y, -x),
        ("west", low, y, z),
        ("east", high, -z, -y),
    ] {
        builder.object(name, Vec3::ZERO);
        builder.grid(corner, u, v, shell);
    }
    builder.object("lamp", Vec3::splat(12.0));
    let lamp = DVec3::new(1.0, HEIGHT - 0.05, 1.0);
    builder.grid(lamp, DVec3::X * -2.0, DVec3::Z * -2.0, shell);

    // Boxes stand on a lattice.
    let columns = (boxes as f64).sqrt().ceil().max(1.0) as usize;
    let cell = 2.0 * (HALF - 0.3) / columns as f64;
    for index in 0..boxes {
        builder.object(&format!("box{index}"), Vec3::ZERO);
        let mut between =
            |low: f64, high: f64| low + (high - low) * f64::from(builder.stream.uniform());
        let size = DVec3::new(
            cell * between(0.3, 0.6),
            between(0.2, 1.2),
            cell * between(0.3, 0.6),
        );
        let place = DVec3::new((index % columns) as f64, 0.0, (index / columns) as f64) * cell;
        let low = DVec3::new(0.3 - HALF, 1e-3, 0.3 - HALF) + place;
        builder.cuboid(low, size, steps(6 * boxes));
    }

    let views = (0..photographs)
        .map(|_| {
            let mut within = |half: f64| (f64::from(builder.stream.uniform()) * 2.0 - 1.0) * half;
            let eye = DVec3::new(within(4.5), 2.1 + within(0.5), within(4.5));
            let target = DVec3::new(within(4.0), 0.9 + within(0.9), within(4.0));
            View::towards(eye, target)
        })
        .collect();
    Room {
        name: "hall".to_owned(),
        mesh: builder.mesh,
        materials: builder.materials,
        views,
    }
}

struct Builder {
    mesh: Mesh,
    materials: Vec<Material>,
    stream: Stream,
}

impl Builder {
    fn object(&mut self, name: &str, emission: Vec3) {
        self.mesh.objects.push(name.to_owned());
        let albedo = Vec3::from_array([0; 3].map(|_| 0.2 + 0.6 * self.stream.uniform()));
        self.materials.push(Material::diffuse(albedo, emission));
    }

    /// A parallelogram whose front is to the side of u × v.
    fn grid(&mut self, corner: DVec3, u: DVec3, v: DVec3, steps: u32) {
        let first = self.mesh.positions.len() as u32;
        let step = 1.0 / f64::from(steps);
        for i in 0..=steps {
            for j in 0..=steps {
                let point = corner + u * (f64::from(i) * step) + v * (f64::from(j) * step);
                self.mesh.positions.push(point);
            }
        }
        let at = |i: u32, j: u32| first + i * (steps + 1) + j;
        for i in 0..steps {
            for j in 0..steps {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                self.mesh.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        let object = self.mesh.objects.len() as u32 - 1;
        self.mesh
            .object_of
            .resize(self.mesh.triangles.len(), object);
    }

    fn cuboid(&mut self, low: DVec3, size: DVec3, steps: u32) {
        let [x, y, z] = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
        let high = low + size;
        for (corner, u, v) in [
            (low, x, z),
            (high, -z, -x),
            (low, y, x),
            (high, -x, -y),
            (low, z, y),
            (high, -y, -z),
        ] {
            self.grid(corner, u, v, steps);
        }
    }
}
