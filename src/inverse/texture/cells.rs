//! The cells of an object: parts of its surface with one unknown albedo each, about as large as the pixels that see them.
//!
//! Triangles larger than a pixel's footprint are subdivided into four recursively. Triangles much smaller than a footprint share
//! a cell with their neighbours. The number of cells is limited by the number of pixels, for any mesh.

use crate::inverse::texture::look::{PixelHit, RAYS, SeenPixel};
use crate::scene::Scene;
use crate::scene::geometry::Hit;
use glam::Vec3;
use std::collections::HashMap;

/// Least number of pixels on a part of a triangle that is subdivided.
const MIN_PIXELS: usize = 2;
/// Least length of the longest edge of a part that is subdivided, in footprints.
const EDGE_FOOTPRINTS: f32 = 1.25;
/// Triangles whose longest edge is below this many footprints share cells.
const SMALL_FOOTPRINTS: f32 = 0.5;
/// Greatest number of parts of a triangle per pixel that sees it.
const TEXELS_PER_PIXEL: usize = 16;
/// Greatest depth of subdivision.
const MAX_CUTS: u8 = 10;

/// A part of a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece {
    /// Triangle index.
    pub triangle: u32,
    /// Its corners, in barycentric coordinates (b1, b2) of the triangle.
    pub corners: [[f32; 2]; 3],
}

/// A part of a surface with one albedo.
#[derive(Debug, Clone, Default)]
pub struct Cell {
    /// Centroid.
    pub center: Vec3,
    /// Unit normal of the side that is seen.
    pub normal: Vec3,
    /// Square root of its area, in metres.
    pub size: f32,
    /// The parts of triangles that it consists of.
    pub pieces: Vec<Piece>,
}

/// The cells of one object's seen triangles.
#[derive(Debug, Clone, Default)]
pub struct Cells {
    /// The cells.
    pub cells: Vec<Cell>,
    /// The root of each seen triangle's quadtree.
    roots: HashMap<u32, Root>,
    nodes: Vec<Node>,
}

#[derive(Debug, Clone, Copy)]
struct Root {
    node: u32,
    /// Whether the front is the side that is seen.
    front: bool,
    depth: u8,
}

#[derive(Debug, Clone, Copy)]
enum Node {
    Leaf(u32),
    /// The first of four children.
    Cut(u32),
}

/// Barycentric position within a part of a triangle, and footprint, of a ray's hit.
type Spot = ([f32; 2], f32);

impl Cells {
    /// Subdivides the triangles that the pixels see, into cells `width` times as wide as the pixels' footprints.
    pub fn new(scene: &Scene, pixels: &[SeenPixel], width: f32) -> Self {
        let mut hits: Vec<PixelHit> = (pixels.iter().flat_map(|p| &p.hits))
            .map(|&hit| PixelHit {
                footprint: hit.footprint * width,
                ..hit
            })
            .collect();
        hits.sort_by_key(|l| l.hit.triangle);
        let mut cells = Self::default();
        let mut shared = HashMap::new();
        for group in hits.chunk_by(|a, b| a.hit.triangle == b.hit.triangle) {
            cells.triangle(scene, group, &mut shared);
        }
        for cell in &mut cells.cells {
            cell.describe(scene);
        }
        cells
    }

    fn triangle(&mut self, scene: &Scene, group: &[PixelHit], shared: &mut HashMap<[i64; 5], u32>) {
        let triangle = group[0].hit.triangle;
        let fronts = group.iter().filter(|l| l.front).count();
        let front = 2 * fronts >= group.len();
        let mut spots: Vec<Spot> = (group.iter().filter(|l| l.front == front))
            .map(|l| ([l.hit.b1, l.hit.b2], l.footprint))
            .collect();
        let [a, b, c] = scene.corners(triangle);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        let footprint = median_footprint(&mut spots);
        let node = self.nodes.len() as u32;
        let whole = Piece {
            triangle,
            corners: [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        };
        let normal = scene.normals[triangle as usize] * if front { 1.0 } else { -1.0 };

        // Small triangles in one cube of space with the same dominant axis of the normal share a cell.
        if longest < SMALL_FOOTPRINTS * footprint {
            let scale = footprint.log2().floor();
            let cube = ((a + b + c) / (3.0 * scale.exp2())).floor();
            let axis = normal.abs().max_position();
            let facing = 2 * axis as i64 + i64::from(normal[axis] < 0.0);
            let [x, y, z] = cube.to_array().map(|v| v as i64);
            let cell = *shared
                .entry([scale as i64, x, y, z, facing])
                .or_insert_with(|| {
                    self.cells.push(Cell::default());
                    self.cells.len() as u32 - 1
                });
            self.cells[cell as usize].pieces.push(whole);
            self.cells[cell as usize].normal += normal;
            self.nodes.push(Node::Leaf(cell));
            self.roots.insert(
                triangle,
                Root {
                    node,
                    front,
                    depth: 0,
                },
            );
            return;
        }

        // A large triangle is subdivided.
        let max_parts = spots.len() / RAYS as usize * TEXELS_PER_PIXEL;
        let max_cuts = (max_parts.max(1).ilog2() / 2).min(u32::from(MAX_CUTS)) as u8;
        self.nodes.push(Node::Leaf(0));
        let depth = self.cut(node, whole, normal, &mut spots, longest, max_cuts);
        self.roots.insert(triangle, Root { node, front, depth });
    }

    /// Subdivides a part of a triangle recursively, or makes it a cell; returns the depth.
    fn cut(
        &mut self,
        node: u32,
        piece: Piece,
        normal: Vec3,
        spots: &mut [Spot],
        longest: f32,
        max_cuts: u8,
    ) -> u8 {
        let fine = spots.len() >= MIN_PIXELS * RAYS as usize
            && longest > EDGE_FOOTPRINTS * median_footprint(spots);
        if max_cuts == 0 || !fine {
            self.nodes[node as usize] = Node::Leaf(self.cells.len() as u32);
            self.cells.push(Cell {
                normal,
                pieces: vec![piece],
                ..Cell::default()
            });
            return 0;
        }
        let first = self.nodes.len() as u32;
        self.nodes[node as usize] = Node::Cut(first);
        self.nodes.extend([Node::Leaf(0); 4]);
        spots.sort_by_key(|(position, _)| child(*position).0);
        let mut depth = 0;
        let mut rest = spots;
        for (quarter, part) in quarters(&piece).into_iter().enumerate() {
            let count = rest.partition_point(|(position, _)| child(*position).0 <= quarter);
            let (own, others) = rest.split_at_mut(count);
            for (position, _) in own.iter_mut() {
                *position = child(*position).1;
            }
            let below = self.cut(
                first + quarter as u32,
                part,
                normal,
                own,
                longest * 0.5,
                max_cuts - 1,
            );
            depth = depth.max(below + 1);
            rest = others;
        }
        depth
    }

    /// The cell of a hit; `None` on triangles that no pixel sees.
    pub fn locate(&self, hit: &Hit) -> Option<u32> {
        let mut node = self.roots.get(&hit.triangle)?.node;
        let mut position = [hit.b1, hit.b2];
        loop {
            match self.nodes[node as usize] {
                Node::Leaf(cell) => return Some(cell),
                Node::Cut(first) => {
                    let (quarter, within) = child(position);
                    node = first + quarter as u32;
                    position = within;
                }
            }
        }
    }

    /// The cell of a pixel's hit; `None` on the other side than most pixels see.
    pub fn facing(&self, hit: &PixelHit) -> Option<u32> {
        let facing = self.front(hit.hit.triangle)? == hit.front;
        facing.then(|| self.locate(&hit.hit)).flatten()
    }

    /// Whether pixels see the front of a triangle; `None` if no pixel sees it.
    pub fn front(&self, triangle: u32) -> Option<bool> {
        self.roots.get(&triangle).map(|root| root.front)
    }

    /// Depth of subdivision of a triangle; `None` if no pixel sees it.
    pub fn depth(&self, triangle: u32) -> Option<u8> {
        self.roots.get(&triangle).map(|root| root.depth)
    }

    /// Number of cells.
    pub fn count(&self) -> usize {
        self.cells.len()
    }
}

impl Cell {
    /// Sets centre, normal and size from the pieces.
    fn describe(&mut self, scene: &Scene) {
        let mut area = 0.0;
        for piece in &self.pieces {
            let [a, b, c] = piece.corners(scene);
            let part = (b - a).cross(c - a).length() * 0.5;
            self.center += (a + b + c) / 3.0 * part;
            area += part;
        }
        let [a, b, c] = self.pieces[0].corners(scene);
        self.center = if area > 0.0 {
            self.center / area
        } else {
            (a + b + c) / 3.0
        };
        self.normal = self.normal.normalize_or_zero();
        self.size = area.sqrt();
    }
}

impl Piece {
    /// Its corners in world space.
    pub fn corners(&self, scene: &Scene) -> [Vec3; 3] {
        let [a, b, c] = scene.corners(self.triangle);
        (self.corners).map(|[b1, b2]| a * (1.0 - b1 - b2) + b * b1 + c * b2)
    }

    /// Converts barycentric coordinates of the piece to those (b1, b2) of the triangle.
    pub fn within(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        let [a, b, c] = self.corners;
        std::array::from_fn(|i| a[i] * (1.0 - u - v) + b[i] * u + c[i] * v)
    }
}

/// The quarter of a triangle that a point lies in (0, 1, 2 at the corners, 3 in the middle), and its barycentric position within.
fn child([b1, b2]: [f32; 2]) -> (usize, [f32; 2]) {
    if b1 >= 0.5 {
        (1, [2.0 * b1 - 1.0, 2.0 * b2])
    } else if b2 >= 0.5 {
        (2, [2.0 * b1, 2.0 * b2 - 1.0])
    } else if b1 + b2 < 0.5 {
        (0, [2.0 * b1, 2.0 * b2])
    } else {
        (3, [1.0 - 2.0 * b1, 1.0 - 2.0 * b2])
    }
}

/// The quarters of a piece, in the order of [`child`].
fn quarters(piece: &Piece) -> [Piece; 4] {
    let [a, b, c] = piece.corners;
    let middle = |p: [f32; 2], q: [f32; 2]| [(p[0] + q[0]) * 0.5, (p[1] + q[1]) * 0.5];
    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]].map(|corners| Piece {
        triangle: piece.triangle,
        corners,
    })
}

fn median_footprint(spots: &mut [Spot]) -> f32 {
    let middle = spots.len() / 2;
    if spots.is_empty() {
        return f32::INFINITY;
    }
    spots
        .select_nth_unstable_by(middle, |a, b| a.1.total_cmp(&b.1))
        .1
        .1
}
