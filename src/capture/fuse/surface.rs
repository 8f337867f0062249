//! Extracts the zero surface of the distance field block by block, with the crate fast-surface-nets.

use crate::capture::fuse::integrate::{Block, Field, SIDE, Voxel};
use crate::capture::mesh::Mesh;
use fast_surface_nets::ndshape::{ConstShape, ConstShape3u32};
use fast_surface_nets::{SurfaceNetsBuffer, surface_nets};
use glam::{DVec3, IVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// A block padded by one voxel on each side.
type Samples = ConstShape3u32<10, 10, 10>;
/// Blocks extracted in parallel before their surfaces are merged.
const BATCH: usize = 1024;

#[derive(Default)]
struct Piece {
    /// The grid cell of each vertex, which has no other vertex; its position and its colour.
    vertices: Vec<(IVec3, DVec3, Vec3)>,
    triangles: Vec<[u32; 3]>,
}

/// Extracts the mesh from cells whose eight voxels are all measured; fronts face positive distance.
pub fn extract(field: &Field) -> Mesh {
    let mut order: Vec<&Block> = field.blocks.iter().collect();
    order.sort_unstable_by_key(|block| block.at.to_array());
    let mut mesh = Mesh {
        objects: vec!["mesh".into()],
        ..Mesh::default()
    };
    // Neighbouring blocks share the vertex of a cell.
    let mut vertices: HashMap<IVec3, u32> = HashMap::new();
    for blocks in order.chunks(BATCH) {
        let pieces: Vec<Piece> = blocks.par_iter().map(|b| piece(field, b)).collect();
        for piece in pieces {
            let mut index = Vec::with_capacity(piece.vertices.len());
            for (cell, position, color) in piece.vertices {
                let next = mesh.positions.len() as u32;
                let vertex = *vertices.entry(cell).or_insert(next);
                if vertex == next {
                    mesh.positions.push(position);
                    mesh.vertex_colors.push(color);
                }
                index.push(vertex);
            }
            for triangle in piece.triangles {
                mesh.triangles.push(triangle.map(|i| index[i as usize]));
                mesh.object_of.push(0);
            }
        }
    }
    mesh
}

/// The surface of a block and of the cells on its lower border.
fn piece(field: &Field, block: &Block) -> Piece {
    // The block's voxels, padded by one layer of its neighbours'.
    let low = block.at * SIDE - IVec3::ONE;
    let neighbours: [Option<&Block>; 27] = std::array::from_fn(|i| {
        let i = i as i32;
        let offset = IVec3::new(i % 3, i / 3 % 3, i / 9) - IVec3::ONE;
        let place = field.places.get(&(block.at + offset))?;
        field.blocks.get(*place)
    });
    let sample = |p: [u32; 3]| -> Option<&Voxel> {
        let inside = IVec3::from_array(p.map(|c| c as i32)) - IVec3::ONE;
        let which = inside.div_euclid(IVec3::splat(SIDE)) + IVec3::ONE;
        let neighbour = neighbours[(which.x + 3 * (which.y + 3 * which.z)) as usize]?;
        let voxel = &neighbour.voxels[Block::index(inside.rem_euclid(IVec3::splat(SIDE)))];
        (voxel.weight > 0.0).then_some(voxel)
    };
    let voxels: Vec<Option<&Voxel>> = (0..Samples::SIZE)
        .map(|i| sample(Samples::delinearize(i)))
        .collect();
    let distances: Vec<f32> = voxels
        .iter()
        .map(|voxel| voxel.map_or(1.0, |voxel| voxel.distance))
        .collect();
    let mut net = SurfaceNetsBuffer::default();
    surface_nets(&distances, &Samples {}, [0; 3], [9; 3], &mut net);

    // Drop cells with an unmeasured corner.
    let mut piece = Piece::default();
    let mut kept = vec![None; net.positions.len()];
    for (vertex, &cell) in net.surface_points.iter().enumerate() {
        let corners: Option<Vec<&Voxel>> = (0..8)
            .map(|i| {
                let corner = [
                    cell[0] + (i & 1),
                    cell[1] + (i >> 1 & 1),
                    cell[2] + (i >> 2),
                ];
                voxels[Samples::linearize(corner) as usize]
            })
            .collect();
        let Some(corners) = corners else { continue };
        kept[vertex] = Some(piece.vertices.len() as u32);
        let local = Vec3::from_array(net.positions[vertex]).as_dvec3();
        let position = (low.as_dvec3() + local) * field.edge;
        let cell = low + IVec3::from_array(cell.map(|c| c as i32));
        (piece.vertices).push((cell, position, mean_color(&corners)));
    }
    for triangle in net.indices.as_chunks::<3>().0 {
        let corners = triangle.map(|i| kept[i as usize]);
        if let [Some(a), Some(b), Some(c)] = corners {
            piece.triangles.push([a, b, c]);
        }
    }
    piece
}

/// The mean colour of a cell's corners, weighted towards those near the surface; grey where no photograph sees any.
fn mean_color(corners: &[&Voxel]) -> Vec3 {
    let mut sum = Vec3::ZERO;
    let mut weights = 0.0;
    for voxel in corners.iter().filter(|voxel| voxel.color_weight > 0.0) {
        let weight = 1.01 - voxel.distance.abs();
        sum += voxel.color * weight;
        weights += weight;
    }
    if weights > 0.0 {
        sum / weights
    } else {
        Vec3::splat(0.5)
    }
}
