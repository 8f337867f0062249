//! Textures and light from outside, beside `estimate.json`, in the safetensors format.

use crate::error::{Error, Result};
use crate::inverse::estimate::{Estimate, Outside, TexelEstimate};
use crate::scene::texels::TexelLayout;
use crate::transport::material::TexelColors;
use crate::transport::sun::Sun;
use crate::transport::surroundings::Surroundings;
use glam::Vec3;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use std::path::Path;
use std::sync::Arc;

/// The content of the maps file.
#[derive(Debug, Clone, Default)]
pub struct Maps {
    /// Albedo of each texel.
    pub texels: Option<Arc<TexelEstimate>>,
    /// Light from outside the mesh.
    pub outside: Option<Outside>,
}

/// The bytes of the maps file; `None` if the estimate has no maps.
///
/// Tensors: `texel_levels` (u8, one a triangle: subdivision level, see [`TexelLayout`]), `texel_albedo` and
/// `texel_albedo_stderr` (f32, texels × 3, linear RGB), `texel_seen` (u32), `textured` (u8, one an object),
/// `outside` (f32, rows × columns × 3, radiance).
///
/// # Errors
/// The maps do not fit their layout.
pub fn encode(estimate: &Estimate) -> Result<Option<Vec<u8>>> {
    let mut tensors: Vec<(&str, Dtype, Vec<usize>, Vec<u8>)> = Vec::new();
    if let Some(texels) = &estimate.texels {
        let layout = &texels.colors.layout;
        let count = layout.len();
        tensors.push((
            "texel_levels",
            Dtype::U8,
            vec![layout.levels.len()],
            layout.levels.clone(),
        ));
        let rgb = vec![count, 3];
        tensors.push((
            "texel_albedo",
            Dtype::F32,
            rgb.clone(),
            color_bytes(&texels.colors.colors),
        ));
        tensors.push((
            "texel_albedo_stderr",
            Dtype::F32,
            rgb,
            color_bytes(&texels.stderr),
        ));
        let seen = texels.seen.iter().flat_map(|n| n.to_le_bytes()).collect();
        tensors.push(("texel_seen", Dtype::U32, vec![count], seen));
        let textured: Vec<u8> = texels.textured.iter().map(|&t| u8::from(t)).collect();
        tensors.push(("textured", Dtype::U8, vec![textured.len()], textured));
    }
    if let Some(outside) = &estimate.outside {
        let shape = vec![outside.height as usize, outside.width as usize, 3];
        tensors.push(("outside", Dtype::F32, shape, color_bytes(&outside.pixels)));
        if let Some(above) = &outside.above {
            let shape = vec![outside.height as usize, outside.width as usize, 3];
            tensors.push(("outside_above", Dtype::F32, shape, color_bytes(above)));
        }
        if let Some(sun) = outside.sun {
            let bytes = color_bytes(&[sun.direction, sun.irradiance]);
            tensors.push(("outside_sun", Dtype::F32, vec![2, 3], bytes));
        }
        if let Some(openings) = &outside.openings {
            let shape = vec![outside.height as usize, outside.width as usize];
            let bytes = openings.iter().map(|&open| u8::from(open)).collect();
            tensors.push(("outside_openings", Dtype::U8, shape, bytes));
        }
        if let Surroundings::Box { min, max } = outside.surroundings {
            tensors.push((
                "outside_box",
                Dtype::F32,
                vec![2, 3],
                color_bytes(&[min, max]),
            ));
        }
    }
    if tensors.is_empty() {
        return Ok(None);
    }
    let misfit = |error: safetensors::SafeTensorError| {
        Error::new(
            "estimate",
            format!("its maps cannot be written: {error}"),
            "",
        )
    };
    let views = tensors
        .iter()
        .map(|(name, dtype, shape, bytes)| {
            Ok((*name, TensorView::new(*dtype, shape.clone(), bytes)?))
        })
        .collect::<std::result::Result<Vec<_>, _>>()
        .map_err(misfit)?;
    safetensors::serialize(views, None)
        .map(Some)
        .map_err(misfit)
}

/// Whether a sun has a unit direction and gives light.
fn is_sun(direction: Vec3, irradiance: Vec3) -> bool {
    direction.is_normalized() && irradiance.is_finite() && irradiance.cmpge(Vec3::ZERO).all()
}

/// Reads a maps file.
///
/// # Errors
/// The bytes are no maps file, or its tensors do not fit together.
pub fn decode(path: &Path, bytes: &[u8]) -> Result<Maps> {
    let file = SafeTensors::deserialize(bytes)
        .map_err(|error| Error::file(path, error, "solve or save again"))?;
    let read = Tensors { path, file };
    let texels = match read.optional("texel_levels", Dtype::U8)? {
        Some(levels) => Some(Arc::new(read.texels(levels.data())?)),
        None => None,
    };
    let outside = match read.optional("outside", Dtype::F32)? {
        Some(map) => match *map.shape() {
            [height, width, 3] if height > 0 && width > 0 => Some(Outside {
                width: width as u32,
                height: height as u32,
                pixels: colors(map.data()),
                above: match read.optional("outside_above", Dtype::F32)? {
                    None => None,
                    Some(above) if above.shape() == map.shape() => Some(colors(above.data())),
                    Some(_) => return Err(read.misfit("outside_above")),
                },
                sun: match read.optional("outside_sun", Dtype::F32)? {
                    None => None,
                    Some(sun) => match *colors(sun.data()) {
                        [direction, irradiance] if is_sun(direction, irradiance) => Some(Sun {
                            direction,
                            irradiance,
                        }),
                        _ => return Err(read.misfit("outside_sun")),
                    },
                },
                openings: match read.optional("outside_openings", Dtype::U8)? {
                    None => None,
                    Some(open) if *open.shape() == [height, width] => {
                        Some(open.data().iter().map(|&open| open != 0).collect())
                    }
                    Some(_) => return Err(read.misfit("outside_openings")),
                },
                surroundings: match read.optional("outside_box", Dtype::F32)? {
                    None => Surroundings::Far,
                    Some(corners) => match *colors(corners.data()) {
                        [min, max] if min.cmplt(max).all() && (max - min).is_finite() => {
                            Surroundings::Box { min, max }
                        }
                        _ => return Err(read.misfit("outside_box")),
                    },
                },
            }),
            _ => return Err(read.misfit("outside")),
        },
        None => None,
    };
    Ok(Maps { texels, outside })
}

struct Tensors<'a> {
    path: &'a Path,
    file: SafeTensors<'a>,
}

impl<'a> Tensors<'a> {
    fn optional(&self, name: &str, dtype: Dtype) -> Result<Option<TensorView<'a>>> {
        match self.file.tensor(name) {
            Ok(tensor) if tensor.dtype() == dtype => Ok(Some(tensor)),
            Ok(_) => Err(self.misfit(name)),
            Err(_) => Ok(None),
        }
    }

    fn required(&self, name: &str, dtype: Dtype, bytes: usize) -> Result<&'a [u8]> {
        match self.optional(name, dtype)? {
            Some(tensor) if tensor.data().len() == bytes => Ok(tensor.data()),
            _ => Err(self.misfit(name)),
        }
    }

    fn texels(&self, levels: &[u8]) -> Result<TexelEstimate> {
        // Higher levels would overflow the number of texels.
        let total: u64 = levels
            .iter()
            .map(|&level| 1u64.checked_shl(2 * u32::from(level)).unwrap_or(u64::MAX))
            .fold(0, u64::saturating_add);
        if total > u64::from(u32::MAX) {
            return Err(self.misfit("texel_levels"));
        }
        let count = total as usize;
        let albedo = self.required("texel_albedo", Dtype::F32, count * 12)?;
        let stderr = self.required("texel_albedo_stderr", Dtype::F32, count * 12)?;
        let seen = self.required("texel_seen", Dtype::U32, count * 4)?;
        let textured = self
            .optional("textured", Dtype::U8)?
            .ok_or_else(|| self.misfit("textured"))?;
        Ok(TexelEstimate {
            colors: Arc::new(TexelColors {
                layout: TexelLayout::new(levels.to_vec()),
                colors: colors(albedo),
            }),
            stderr: colors(stderr),
            seen: words(seen).map(u32::from_le_bytes).collect(),
            textured: textured.data().iter().map(|&t| t != 0).collect(),
        })
    }

    fn misfit(&self, name: &str) -> Error {
        Error::new(
            format!("{}: {name}", self.path.display()),
            "missing or of another shape than the rest",
            "solve or save again",
        )
    }
}

fn color_bytes(colors: &[Vec3]) -> Vec<u8> {
    colors
        .iter()
        .flat_map(|c| c.to_array())
        .flat_map(f32::to_le_bytes)
        .collect()
}

fn words(bytes: &[u8]) -> impl Iterator<Item = [u8; 4]> + '_ {
    bytes.as_chunks::<4>().0.iter().copied()
}

fn colors(bytes: &[u8]) -> Vec<Vec3> {
    bytes
        .as_chunks::<12>()
        .0
        .iter()
        .map(|c| {
            let mut channels = words(c).map(f32::from_le_bytes);
            let mut next = || channels.next().unwrap_or(0.0);
            Vec3::new(next(), next(), next())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate() -> Estimate {
        let layout = TexelLayout::new(vec![0, 1, 2]);
        let ramp = |scale: f32| {
            (0..layout.len())
                .map(|i| Vec3::new(i as f32, 0.5, -1.0) * scale)
                .collect::<Vec<_>>()
        };
        Estimate {
            texels: Some(Arc::new(TexelEstimate {
                stderr: ramp(0.01),
                seen: (0..layout.len() as u32).collect(),
                textured: vec![true, false],
                colors: Arc::new(TexelColors {
                    colors: ramp(0.1),
                    layout,
                }),
            })),
            outside: Some(Outside {
                width: 2,
                height: 1,
                pixels: vec![Vec3::ONE, Vec3::new(1e-20, 1e20, 3.0)],
                above: Some(vec![Vec3::splat(2.0), Vec3::new(5.0, 1e-30, 0.0)]),
                surroundings: Surroundings::Box {
                    min: Vec3::new(-1.0, -2.0, -3.0),
                    max: Vec3::new(1.0, 2.0, 3.5),
                },
                sun: Some(Sun {
                    direction: Vec3::new(0.6, 0.0, -0.8),
                    irradiance: Vec3::new(7.0, 6.0, 5.5),
                }),
                openings: Some(vec![true, false]),
            }),
            ..Default::default()
        }
    }

    #[test]
    fn a_sun_without_a_direction_or_with_light_below_zero_is_refused() {
        let [far, dark] = [Vec3::new(3.0, 0.0, 0.0), Vec3::NEG_ONE];
        for (direction, irradiance) in [(far, Vec3::ONE), (Vec3::NAN, Vec3::ONE), (Vec3::Y, dark)] {
            let mut estimate = estimate();
            let sun = Sun {
                direction,
                irradiance,
            };
            estimate.outside.as_mut().expect("outside").sun = Some(sun);
            let bytes = encode(&estimate).expect("encodes").expect("has maps");
            let error = decode(Path::new("maps"), &bytes)
                .map(drop)
                .expect_err("no sun");
            assert!(error.to_string().contains("outside_sun"), "{error}");
        }
    }

    #[test]
    fn maps_round_trip_to_the_bit() {
        let estimate = estimate();
        let bytes = encode(&estimate).expect("fits").expect("has maps");
        let maps = decode(Path::new("maps"), &bytes).expect("reads");
        let (a, b) = (
            estimate.texels.expect("texels"),
            maps.texels.expect("texels"),
        );
        assert_eq!(a.colors.layout, b.colors.layout);
        assert_eq!(a.colors.colors, b.colors.colors);
        assert_eq!(
            (&a.stderr, &a.seen, &a.textured),
            (&b.stderr, &b.seen, &b.textured)
        );
        assert_eq!(estimate.outside, maps.outside);
        assert_eq!(encode(&Estimate::default()), Ok(None));
    }

    #[test]
    fn any_cut_and_any_changed_header_byte_is_an_error_or_reads_without_panic() {
        let bytes = encode(&estimate()).expect("fits").expect("has maps");
        for end in 0..bytes.len() {
            assert!(decode(Path::new("maps"), &bytes[..end]).is_err(), "{end}");
        }
        for i in 0..bytes.len().min(600) {
            let mut broken = bytes.clone();
            broken[i] ^= 0x11;
            let _ = decode(Path::new("maps"), &broken);
        }
    }
}
