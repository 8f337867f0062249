//! Textures and light from outside, beside `estimate.json`, in the safetensors format.

use crate::error::{Error, Result};
use crate::inverse::estimate::{Estimate, Outside, TexelEstimate};
use crate::scene::texels::TexelLayout;
use crate::transport::material::TexelColors;
use crate::transport::sun::Sun;
use crate::transport::surroundings::Surroundings;
use glam::Vec3;
use safetensors::tensor::Dtype::{self, F32, U8, U32};
use safetensors::tensor::{SafeTensors, TensorView};
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
    let mut add = |name, dtype, shape: &[usize], bytes| {
        tensors.push((name, dtype, shape.to_vec(), bytes));
    };
    if let Some(texels) = &estimate.texels {
        let (levels, textured) = (&texels.colors.layout.levels, &texels.textured);
        let count = texels.colors.layout.len();
        let rgb = [count, 3];
        let seen = texels.seen.iter().flat_map(|n| n.to_le_bytes()).collect();
        let (albedo, stderr) = (&texels.colors.colors, &texels.stderr);
        add("texel_levels", U8, &[levels.len()], levels.clone());
        add("texel_albedo", F32, &rgb, color_bytes(albedo));
        add("texel_albedo_stderr", F32, &rgb, color_bytes(stderr));
        add("texel_seen", U32, &[count], seen);
        add("textured", U8, &[textured.len()], flag_bytes(textured));
    }
    if let Some(outside) = &estimate.outside {
        let [height, width] = [outside.height, outside.width].map(|side| side as usize);
        let rgb = [height, width, 3];
        add("outside", F32, &rgb, color_bytes(&outside.pixels));
        if let Some(above) = &outside.above {
            add("outside_above", F32, &rgb, color_bytes(above));
        }
        if let Some(sun) = outside.sun {
            let bytes = color_bytes(&[sun.direction, sun.irradiance]);
            add("outside_sun", F32, &[2, 3], bytes);
        }
        if let Some(openings) = &outside.openings {
            add("outside_openings", U8, &rgb[..2], flag_bytes(openings));
        }
        if let Surroundings::Box { min, max } = outside.surroundings {
            add("outside_box", F32, &[2, 3], color_bytes(&[min, max]));
        }
    }
    if tensors.is_empty() {
        return Ok(None);
    }
    let views = tensors.iter().map(|(name, dtype, shape, bytes)| {
        Ok((*name, TensorView::new(*dtype, shape.clone(), bytes)?))
    });
    let views: std::result::Result<Vec<_>, safetensors::SafeTensorError> = views.collect();
    let bytes = views.and_then(|views| safetensors::serialize(views, None));
    bytes.map(Some).map_err(|error| {
        let problem = format!("its maps cannot be written: {error}");
        Error::new("estimate", problem, "")
    })
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
    let levels = read.optional("texel_levels", U8)?;
    let texels = levels
        .map(|levels| read.texels(levels.data()))
        .transpose()?;
    let outside = read.optional("outside", F32)?;
    Ok(Maps {
        texels: texels.map(Arc::new),
        outside: outside.map(|map| read.outside(&map)).transpose()?,
    })
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
        let fitting =
            |tensor: &TensorView<'a>| (tensor.data().len() == bytes).then(|| tensor.data());
        (self.part(name, dtype, fitting)?).ok_or_else(|| self.misfit(name))
    }

    /// What `read` makes of a tensor, which fits unless that is `None`; `None` without the tensor.
    fn part<T>(
        &self,
        name: &str,
        dtype: Dtype,
        read: impl FnOnce(&TensorView<'a>) -> Option<T>,
    ) -> Result<Option<T>> {
        let part = self.optional(name, dtype)?;
        part.map(|tensor| read(&tensor).ok_or_else(|| self.misfit(name)))
            .transpose()
    }

    fn outside(&self, map: &TensorView<'a>) -> Result<Outside> {
        let (height, width) = match *map.shape() {
            [height, width, 3] if height > 0 && width > 0 => (height, width),
            _ => return Err(self.misfit("outside")),
        };
        let above = self.part("outside_above", F32, |above| {
            (above.shape() == map.shape()).then(|| colors(above.data()))
        })?;
        let sun = self.part("outside_sun", F32, |sun| match *colors(sun.data()) {
            [direction, irradiance] if is_sun(direction, irradiance) => Some(Sun {
                direction,
                irradiance,
            }),
            _ => None,
        })?;
        let openings = self.part("outside_openings", U8, |open| {
            (*open.shape() == [height, width]).then(|| flags(open.data()))
        })?;
        let surroundings = self.part("outside_box", F32, |corners| {
            match *colors(corners.data()) {
                [min, max] if min.cmplt(max).all() && (max - min).is_finite() => {
                    Some(Surroundings::Box { min, max })
                }
                _ => None,
            }
        })?;
        Ok(Outside {
            width: width as u32,
            height: height as u32,
            pixels: colors(map.data()),
            above,
            sun,
            openings,
            surroundings: surroundings.unwrap_or(Surroundings::Far),
        })
    }

    fn texels(&self, levels: &[u8]) -> Result<TexelEstimate> {
        // Higher levels would overflow the number of texels.
        let of = |&level: &u8| 1u64.checked_shl(2 * u32::from(level)).unwrap_or(u64::MAX);
        let total = levels.iter().map(of).fold(0, u64::saturating_add);
        if total > u64::from(u32::MAX) {
            return Err(self.misfit("texel_levels"));
        }
        let count = total as usize;
        let albedo = self.required("texel_albedo", F32, count * 12)?;
        let stderr = self.required("texel_albedo_stderr", F32, count * 12)?;
        let seen = self.required("texel_seen", U32, count * 4)?;
        let textured = self.optional("textured", U8)?;
        let textured = textured.ok_or_else(|| self.misfit("textured"))?;
        Ok(TexelEstimate {
            colors: Arc::new(TexelColors {
                layout: TexelLayout::new(levels.to_vec()),
                colors: colors(albedo),
            }),
            stderr: colors(stderr),
            seen: words(seen).map(u32::from_le_bytes).collect(),
            textured: flags(textured.data()),
        })
    }

    fn misfit(&self, name: &str) -> Error {
        let problem = "missing or of another shape than the rest";
        let remedy = "solve or save again";
        Error::new(format!("{}: {name}", self.path.display()), problem, remedy)
    }
}

fn color_bytes(colors: &[Vec3]) -> Vec<u8> {
    let numbers = colors.iter().flat_map(|c| c.to_array());
    numbers.flat_map(f32::to_le_bytes).collect()
}

fn flag_bytes(flags: &[bool]) -> Vec<u8> {
    flags.iter().map(|&flag| u8::from(flag)).collect()
}

fn flags(bytes: &[u8]) -> Vec<bool> {
    bytes.iter().map(|&byte| byte != 0).collect()
}

fn words(bytes: &[u8]) -> impl Iterator<Item = [u8; 4]> + '_ {
    bytes.as_chunks::<4>().0.iter().copied()
}

fn colors(bytes: &[u8]) -> Vec<Vec3> {
    let numbers: Vec<f32> = words(bytes).map(f32::from_le_bytes).collect();
    let colors = numbers.as_chunks::<3>().0.iter();
    colors.copied().map(Vec3::from_array).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate() -> Estimate {
        let layout = TexelLayout::new(vec![0, 1, 2]);
        let ramp = |scale: f32| -> Vec<Vec3> {
            let texels = 0..layout.len();
            texels
                .map(|i| Vec3::new(i as f32, 0.5, -1.0) * scale)
                .collect()
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
            let sun = estimate.outside.as_mut().and_then(|o| o.sun.as_mut());
            let sun = sun.expect("a sun");
            (sun.direction, sun.irradiance) = (direction, irradiance);
            let bytes = encode(&estimate).expect("encodes").expect("has maps");
            let maps = decode(Path::new("maps"), &bytes);
            let error = maps.map(drop).expect_err("no sun");
            assert!(error.to_string().contains("outside_sun"), "{error}");
        }
    }

    #[test]
    fn maps_round_trip_to_the_bit() {
        let estimate = estimate();
        let bytes = encode(&estimate).expect("fits").expect("has maps");
        let maps = decode(Path::new("maps"), &bytes).expect("reads");
        let [a, b] = [estimate.texels, maps.texels].map(|texels| texels.expect("texels"));
        assert_eq!(a.colors.layout, b.colors.layout);
        assert_eq!(a.colors.colors, b.colors.colors);
        assert_eq!((&a.stderr, &a.seen), (&b.stderr, &b.seen));
        assert_eq!(a.textured, b.textured);
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
