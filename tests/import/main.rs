//! Every importer on a small sample of its format: a box-shaped room whose depth and colours are known in closed form.

mod colmap;
mod command;
mod hostile;
mod icl_nuim;
mod matterport;
mod nerfstudio;
mod open3d;
mod poses;
mod scannet;
mod seven_scenes;
mod tum;

use glam::{DMat3, DVec2, DVec3};
use image::{ImageBuffer, Luma, Rgb, RgbImage};
use relit::capture::camera::{Intrinsics, Pose};
use relit::capture::import::{Import, ImportOptions, read};
use relit::capture::mesh::Mesh;
use relit::error::Error;
use std::path::Path;

/// Corners of the room.
pub const LOW: DVec3 = DVec3::new(-1.6, -1.1, -1.3);
/// The opposite corner.
pub const HIGH: DVec3 = DVec3::new(1.5, 1.2, 1.4);
/// sRGB of the walls −x, +x, −y, +y, −z, +z.
pub const COLORS: [[u8; 3]; 6] = [
    [200, 40, 40],
    [40, 200, 40],
    [90, 90, 90],
    [230, 230, 230],
    [40, 40, 200],
    [200, 200, 40],
];

/// A camera by its world-to-pixel map: OpenCV's axes, pixel centres at whole numbers.
#[derive(Debug, Clone, Copy)]
pub struct Camera {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Focal lengths in pixels.
    pub fx: f64,
    /// The same along y.
    pub fy: f64,
    /// Principal point in pixels.
    pub cx: f64,
    /// The same along y.
    pub cy: f64,
    /// Columns: right, down, forwards in the world.
    pub rotation: DMat3,
    /// Where it stands, in metres.
    pub center: DVec3,
}

impl Camera {
    /// A camera in the room, turned about +y and tilted.
    pub fn turned(yaw: f64, pitch: f64, center: DVec3) -> Self {
        let forward = DVec3::new(
            yaw.sin() * pitch.cos(),
            pitch.sin(),
            yaw.cos() * pitch.cos(),
        );
        let right = forward.cross(DVec3::Y).normalize();
        Self {
            size: [80, 60],
            fx: 50.0,
            fy: 51.0,
            cx: 39.2,
            cy: 29.6,
            rotation: DMat3::from_cols(right, forward.cross(right), forward),
            center,
        }
    }

    /// The same view with another lens.
    pub fn with_lens(self, size: [u32; 2], [fx, fy, cx, cy]: [f64; 4]) -> Self {
        Self {
            size,
            fx,
            fy,
            cx,
            cy,
            ..self
        }
    }

    /// Where a point is seen, pixel centres at whole numbers, and how far along the axis.
    pub fn see(&self, point: DVec3) -> (DVec2, f64) {
        let p = self.rotation.transpose() * (point - self.center);
        let pixel = DVec2::new(p.x / p.z * self.fx + self.cx, p.y / p.z * self.fy + self.cy);
        (pixel, p.z)
    }

    /// Depth along the axis and wall of the pixel.
    fn hit(&self, x: u32, y: u32) -> (f64, usize) {
        self.hit_at(f64::from(x), f64::from(y))
    }

    /// What is seen at a pixel position, pixel centres at whole numbers: the point in the world and its wall.
    pub fn point(&self, x: f64, y: f64) -> (DVec3, usize) {
        let (depth, wall) = self.hit_at(x, y);
        (self.center + self.ray(x, y) * depth, wall)
    }

    /// The direction of a pixel position in the world, of length 1 along the axis.
    fn ray(&self, x: f64, y: f64) -> DVec3 {
        self.rotation * DVec3::new((x - self.cx) / self.fx, (y - self.cy) / self.fy, 1.0)
    }

    fn hit_at(&self, x: f64, y: f64) -> (f64, usize) {
        let d = self.ray(x, y);
        (0..6)
            .filter_map(|wall| {
                let axis = wall / 2;
                let plane = if wall % 2 == 0 { LOW[axis] } else { HIGH[axis] };
                let t = (plane - self.center[axis]) / d[axis];
                (t > 0.0).then_some((t, wall))
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .expect("the camera is inside")
    }

    /// The photograph.
    pub fn photograph(&self) -> RgbImage {
        RgbImage::from_fn(self.size[0], self.size[1], |x, y| {
            Rgb(COLORS[self.hit(x, y).1])
        })
    }

    /// Depth in units of `1/per_metre` metres.
    pub fn depth(&self, per_metre: f64) -> ImageBuffer<Luma<u16>, Vec<u16>> {
        ImageBuffer::from_fn(self.size[0], self.size[1], |x, y| {
            Luma([(self.hit(x, y).0 * per_metre).round() as u16])
        })
    }

    /// Rows of the 4×4 camera-to-world matrix.
    pub fn matrix(&self) -> [[f64; 4]; 4] {
        let r = self.rotation;
        let row = |i: usize| [r.x_axis[i], r.y_axis[i], r.z_axis[i], self.center[i]];
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }

    /// The matrix as text.
    pub fn matrix_text(&self) -> String {
        let row = |row: [f64; 4]| row.map(|x| x.to_string()).join(" ");
        self.matrix().map(row).join("\n") + "\n"
    }

    /// tx ty tz qx qy qz qw.
    pub fn trajectory_text(&self) -> String {
        let q = glam::DQuat::from_mat3(&self.rotation);
        let c = self.center;
        format!("{} {} {} {} {} {} {}", c.x, c.y, c.z, q.x, q.y, q.z, q.w)
    }
}

/// Views that see the whole room with the usual lens.
pub fn cameras() -> Vec<Camera> {
    around(8, &[-0.15, 0.9, -0.9])
}

/// Views that see the whole room with a narrower lens.
pub fn many_cameras() -> Vec<Camera> {
    around(10, &[0.0, 0.5, -0.5, 1.0, -1.0, 1.5, -1.5])
}

fn around(turns: u32, pitches: &[f64]) -> Vec<Camera> {
    let yaw = |i: u32| f64::from(i) * std::f64::consts::TAU / f64::from(turns) + 0.1;
    let center = |yaw: f64| DVec3::new(0.3 * yaw.cos(), 0.05, -0.2 * yaw.sin());
    (0..turns)
        .flat_map(|i| pitches.iter().map(move |&pitch| (yaw(i), pitch)))
        .map(|(yaw, pitch)| Camera::turned(yaw, pitch, center(yaw)))
        .collect()
}

/// Writes a file below a folder, making the folders on the way.
pub fn write(folder: &Path, name: &str, bytes: impl AsRef<[u8]>) {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, bytes).unwrap();
}

/// Writes a camera's photograph and depth.
pub fn write_images(folder: &Path, camera: &Camera, color: &str, depth: &str, per_metre: f64) {
    write(folder, color, []);
    write(folder, depth, []);
    camera.photograph().save(folder.join(color)).unwrap();
    camera.depth(per_metre).save(folder.join(depth)).unwrap();
}

/// Imports with the given options.
pub(crate) fn import_with(folder: &Path, options: &ImportOptions) -> Result<Import, Error> {
    read(folder, options, &mut |_, _| {})
}

/// Imports with voxels of 5 cm.
pub(crate) fn import(folder: &Path) -> Result<Import, Error> {
    let options = ImportOptions {
        voxel: Some(0.05),
        ..ImportOptions::default()
    };
    import_with(folder, &options)
}

/// Whether one of the lines holds the words.
pub fn says(import: &Import, words: &str) -> bool {
    import.remarks.iter().any(|line| line.contains(words))
}

/// The pixel position (corners at whole numbers) at which a capture's camera sees a point.
pub fn project(pose: &Pose, k: &Intrinsics, point: DVec3) -> DVec2 {
    let p = pose.rotation.transpose() * (point - pose.center);
    let p = DVec2::new(p.x / -p.z, -p.y / -p.z);
    let p = k.distort(p).expect("within the lens");
    DVec2::new(p.x * k.fx + k.cx, p.y * k.fy + k.cy)
}

/// Checks that the frames see points of the room where the cameras do; `world` maps the room's points to the import's.
pub fn check_cameras(import: &Import, cameras: &[Camera], world: impl Fn(DVec3) -> DVec3) {
    assert_eq!(import.frames.len(), cameras.len());
    for (frame, camera) in import.frames.iter().zip(cameras) {
        for (x, y) in [(0.1, 0.2), (0.5, 0.5), (0.9, 0.7)] {
            let ray = DVec3::new(
                (x * f64::from(camera.size[0]) - camera.cx) / camera.fx,
                (y * f64::from(camera.size[1]) - camera.cy) / camera.fy,
                1.0,
            );
            let point = camera.center + camera.rotation * ray * 1.7;
            let expected = camera.see(point).0 + DVec2::splat(0.5);
            let seen = project(&frame.pose, &frame.lens.intrinsics(), world(point));
            assert!((seen - expected).length() < 1e-6, "{seen} not {expected}");
        }
    }
}

/// Distance of a point to the room's surface, and the nearest wall.
pub fn to_wall(p: DVec3) -> (f64, usize) {
    (0..6)
        .map(|wall| {
            let plane = if wall % 2 == 0 { LOW } else { HIGH };
            ((p[wall / 2] - plane[wall / 2]).abs(), wall)
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .unwrap()
}

/// Distance of a point on a wall to the nearest other wall.
fn to_edge(p: DVec3, wall: usize) -> f64 {
    (0..3)
        .filter(|axis| *axis != wall / 2)
        .map(|axis| (p[axis] - LOW[axis]).min(HIGH[axis] - p[axis]))
        .fold(f64::INFINITY, f64::min)
}

/// Checks that every vertex lies on a wall within half a voxel, or within one where walls meet, which surface nets round.
pub fn check_vertices(mesh: &Mesh, voxel: f64, world: impl Fn(DVec3) -> DVec3) {
    assert!(
        mesh.positions.len() > 1000,
        "{} vertices",
        mesh.positions.len()
    );
    for &p in &mesh.positions {
        let p = world(p);
        let (distance, wall) = to_wall(p);
        let bound = if to_edge(p, wall) > 1.5 * voxel {
            0.5
        } else {
            1.0
        };
        assert!(distance < bound * voxel, "{p} is {distance} from the walls");
    }
}

/// Checks that a fused mesh is the room: on its walls within half a voxel, facing inwards, whole, with the walls' colours.
/// `world` maps the import's points to the room's.
pub fn check_room(mesh: &Mesh, voxel: f64, world: impl Fn(DVec3) -> DVec3) {
    let (mut area, mut outwards, mut colored) = (0.0, 0.0, 0);
    assert_eq!(mesh.vertex_colors.len(), mesh.positions.len());
    let mirrored = world(DVec3::X).cross(world(DVec3::Y)).dot(world(DVec3::Z)) < 0.0;
    check_vertices(mesh, voxel, &world);
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| world(mesh.positions[i as usize]));
        let normal = (b - a).cross(c - a) * if mirrored { -0.5 } else { 0.5 };
        let middle = (a + b + c) / 3.0;
        area += normal.length();
        if normal.dot(-middle) < 0.0 {
            outwards += normal.length();
        }
    }
    // Where a wall lies on the voxels themselves, rounded depths fold slivers over.
    assert!(
        outwards < 0.002 * area,
        "{outwards} of {area} faces outwards"
    );
    let size = HIGH - LOW;
    let truth = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
    assert!((area / truth - 1.0).abs() < 0.05, "area {area} of {truth}");
    for (p, color) in mesh.positions.iter().zip(&mesh.vertex_colors) {
        let p = world(*p);
        let (_, wall) = to_wall(p);
        let margin = to_edge(p, wall);
        if margin > 4.0 * voxel {
            let expected =
                COLORS[wall].map(|v| relit::math::color::srgb_to_linear(f32::from(v) / 255.0));
            let difference = *color - glam::Vec3::from_array(expected);
            assert!(difference.length() < 0.02, "{color} on wall {wall} at {p}");
            colored += 1;
        }
    }
    assert!(colored > 1000, "{colored} vertices lie far from edges");
}
