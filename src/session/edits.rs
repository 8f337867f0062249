//! Edits of an estimate by hand: lamps off, walls recoloured, surfaces polished.

use crate::error::{Error, Result};
use crate::inverse::estimate::{Estimate, TexelEstimate};
use crate::inverse::known::{Known, Pinned};
use crate::scene::Scene;
use crate::session::save::named::Named;
use crate::transport::bsdf::MIN_ROUGHNESS;
use crate::transport::material::DIELECTRIC;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// GGX roughness α and specular reflectance of a new lobe, where an edit gives only one of them: a satin dielectric.
const SATIN: (f32, f32) = (0.3, DIELECTRIC);

/// Edits of one object. `None` keeps the estimate's value.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ObjectEdit {
    /// Diffuse reflectance, linear RGB in [0, 1]; replaces the estimate's colour or texture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub albedo: Option<Vec3>,
    /// Emitted radiance, W·sr⁻¹·m⁻².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub emission: Option<Vec3>,
    /// Whether the object emits nothing, whatever its emission.
    pub off: bool,
    /// GGX roughness α in (0, 1]; adds a lobe if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roughness: Option<f32>,
    /// Specular reflectance at normal incidence in [0, 1]; adds a lobe if there is none, and 0 removes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub specular: Option<f32>,
    /// Whether `albedo` is known and held fixed by a solve.
    #[serde(skip_serializing_if = "is_false")]
    pub albedo_known: bool,
    /// Whether `emission` is known and held fixed by a solve.
    #[serde(skip_serializing_if = "is_false")]
    pub emission_known: bool,
}

fn is_false(flag: &bool) -> bool {
    !flag
}

impl ObjectEdit {
    /// The edited emission of an object with the estimate `found`.
    pub fn emission(&self, found: Vec3) -> Vec3 {
        match self.emission {
            _ if self.off => Vec3::ZERO,
            Some(emission) => emission.max(Vec3::ZERO),
            None => found,
        }
    }

    /// The edited albedo of an object with the estimate `found`.
    pub fn albedo(&self, found: Vec3) -> Vec3 {
        let albedo = self.albedo.map(|a| a.clamp(Vec3::ZERO, Vec3::ONE));
        albedo.unwrap_or(found)
    }

    /// The edited GGX roughness α and specular reflectance of an object with the estimate `found`; `None` without a lobe.
    pub fn lobe(&self, found: Option<(f32, f32)>) -> Option<(f32, f32)> {
        if self.roughness.is_none() && self.specular.is_none() {
            return found;
        }
        let (roughness, specular) = found.unwrap_or(SATIN);
        let roughness = self.roughness.unwrap_or(roughness);
        let specular = self.specular.unwrap_or(specular).clamp(0.0, 1.0);
        (specular > 0.0).then_some((roughness.clamp(MIN_ROUGHNESS, 1.0), specular))
    }

    /// The known values of the object.
    pub fn known(&self) -> Pinned {
        Pinned {
            albedo: self.albedo.filter(|_| self.albedo_known),
            emission: (self.emission.filter(|_| self.emission_known))
                .map(|emission| if self.off { Vec3::ZERO } else { emission }),
        }
    }
}

/// All edits of an estimate.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Edits {
    objects: BTreeMap<usize, ObjectEdit>,
    outside: Option<Vec3>,
}

impl Edits {
    /// The edits of an object.
    pub fn object(&self, object: usize) -> ObjectEdit {
        self.objects.get(&object).copied().unwrap_or_default()
    }

    /// Replaces the edits of an object.
    pub fn set(&mut self, object: usize, edit: ObjectEdit) {
        if edit == ObjectEdit::default() {
            self.objects.remove(&object);
        } else {
            self.objects.insert(object, edit);
        }
    }

    /// The edits for other object indices: `places` maps old to new ones. Drops those of removed objects.
    pub fn moved(&self, places: &[Option<u32>]) -> Self {
        let moved = |(&object, edit): (&usize, &ObjectEdit)| {
            let place = (*places.get(object)?)?;
            Some((place as usize, *edit))
        };
        Self {
            objects: self.objects.iter().filter_map(moved).collect(),
            outside: self.outside,
        }
    }

    /// The known values of the scene, which a solve holds fixed.
    pub fn known(&self) -> Known {
        let mut known = Known::default();
        for (&object, edit) in &self.objects {
            known.set(object, edit.known());
        }
        known
    }

    /// RGB factors on the light from outside.
    pub fn outside(&self) -> Vec3 {
        self.outside.unwrap_or(Vec3::ONE)
    }

    /// Replaces the factors on the light from outside.
    pub fn set_outside(&mut self, factor: Vec3) {
        self.outside = (factor != Vec3::ONE).then_some(factor);
    }

    /// Whether there are no edits.
    pub fn is_empty(&self) -> bool {
        self.objects.is_empty() && self.outside.is_none()
    }

    /// Applies the edits to an estimate. Standard errors remain those of the estimate.
    pub fn apply(&self, estimate: &Estimate) -> Estimate {
        let mut edited = estimate.clone();
        for (&object, edit) in &self.objects {
            let Some(entry) = edited.objects.get_mut(object) else {
                continue;
            };
            entry.emission = edit.emission(entry.emission);
            (entry.roughness, entry.specular) = edit.lobe(entry.lobe()).unzip();
            if edit.albedo.is_some() {
                entry.albedo = edit.albedo(entry.albedo);
                remove_texture(&mut edited, object);
            }
        }
        if let (Some(factor), Some(outside)) = (self.outside, &mut edited.outside) {
            let factor = factor.max(Vec3::ZERO);
            let above = outside.above.iter_mut().flatten();
            let sun = outside.sun.iter_mut().map(|sun| &mut sun.irradiance);
            let all = outside.pixels.iter_mut().chain(above).chain(sun);
            all.for_each(|p| *p *= factor);
        }
        edited
    }

    /// The edits as they are stored in files, by object name; `None` without edits.
    pub fn record(&self, scene: &Scene) -> Option<EditsRecord> {
        let named = self.objects.iter().filter_map(|(&object, edit)| {
            let name = scene.objects.get(object)?.name.clone();
            Some((name, *edit))
        });
        (!self.is_empty()).then(|| EditsRecord {
            objects: Named(named.collect()),
            outside: self.outside,
        })
    }
}

/// Replaces an object's texture by its single colour.
fn remove_texture(estimate: &mut Estimate, object: usize) {
    let Some(texels) = &estimate.texels else {
        return;
    };
    let mut textured = texels.textured.clone();
    if let Some(flag) = textured.get_mut(object) {
        *flag = false;
    }
    estimate.texels = Some(Arc::new(TexelEstimate {
        textured,
        ..(**texels).clone()
    }));
}

/// Edits in `estimate.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EditsRecord {
    /// Edits of objects, by name.
    pub objects: Named<ObjectEdit>,
    /// RGB factors on the light from outside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outside: Option<Vec3>,
}

impl EditsRecord {
    /// The edits for a scene; `path` is the file that contains them.
    ///
    /// # Errors
    /// The scene has no object of a name.
    pub fn edits(&self, path: &Path, scene: &Scene) -> Result<Edits> {
        let objects = self.objects.0.iter().map(|(name, edit)| {
            let object = scene.objects.iter().position(|o| o.name == *name);
            let object = object.ok_or_else(|| {
                let place = format!("{}: edits.objects.{name}", path.display());
                let problem = "the capture has no object of this name";
                Error::new(place, problem, "name the capture it was made from")
            });
            Ok((object?, *edit))
        });
        Ok(Edits {
            objects: objects.collect::<Result<_>>()?,
            outside: self.outside,
        })
    }
}

/// Caches the edited estimate until the estimate or the edits change.
#[derive(Debug, Default)]
pub struct Edited(Option<(Arc<Estimate>, Edits, Arc<Estimate>)>);

impl Edited {
    /// The edited estimate; without edits, the estimate itself.
    pub fn of(&mut self, estimate: &Arc<Estimate>, edits: &Edits) -> Arc<Estimate> {
        if edits.is_empty() {
            self.0 = None;
            return estimate.clone();
        }
        if let Some((found, made_by, edited)) = &self.0
            && Arc::ptr_eq(found, estimate)
            && made_by == edits
        {
            return edited.clone();
        }
        let edited = Arc::new(edits.apply(estimate));
        self.0 = Some((estimate.clone(), edits.clone(), edited.clone()));
        edited
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::estimate::{ObjectEstimate, Outside};
    use crate::transport::sun::Sun;
    use crate::transport::surroundings::Surroundings;

    fn estimate() -> Arc<Estimate> {
        let object = |albedo: f32, emission: f32| ObjectEstimate {
            albedo: Vec3::splat(albedo),
            emission: Vec3::splat(emission),
            ..ObjectEstimate::default()
        };
        Arc::new(Estimate {
            objects: vec![object(0.5, 0.0), object(0.0, 9.0)],
            outside: Some(Outside {
                width: 1,
                height: 1,
                pixels: vec![Vec3::splat(2.0)],
                above: None,
                surroundings: Surroundings::Far,
                sun: Some(Sun {
                    direction: Vec3::Y,
                    irradiance: Vec3::splat(3.0),
                }),
                openings: None,
            }),
            ..Estimate::default()
        })
    }

    #[test]
    fn what_is_changed_is_applied_and_the_rest_stays() {
        let found = estimate();
        let mut edits = Edits::default();
        let mut edited = Edited::default();
        assert!(Arc::ptr_eq(&edited.of(&found, &edits), &found));

        let red = Vec3::new(0.9, 0.1, 0.1);
        let mut paint = edits.object(0);
        paint.albedo = Some(red);
        edits.set(0, paint);
        let mut dim = edits.object(1);
        dim.emission = Some(Vec3::splat(3.0));
        edits.set(1, dim);
        edits.set_outside(Vec3::new(0.0, 0.5, 1.0));
        let changed = edited.of(&found, &edits);
        let painted = &changed.objects[0];
        assert_eq!((painted.albedo, painted.emission), (red, Vec3::ZERO));
        assert_eq!(changed.objects[1].emission, Vec3::splat(3.0));
        let outside = changed.outside.as_ref().expect("outside");
        assert_eq!(outside.pixels, [Vec3::new(0.0, 1.0, 2.0)]);
        let sun = outside.sun.map(|sun| sun.irradiance);
        assert_eq!(sun, Some(Vec3::new(0.0, 1.5, 3.0)));
        assert!(Arc::ptr_eq(&edited.of(&found, &edits), &changed));

        // `off` takes precedence over any emission, which comes back without it.
        dim.off = true;
        edits.set(1, dim);
        assert_eq!(edited.of(&found, &edits).objects[1].emission, Vec3::ZERO);
        edits.set(0, ObjectEdit::default());
        edits.set(1, ObjectEdit::default());
        edits.set_outside(Vec3::ONE);
        assert!(edits.is_empty());
    }

    #[test]
    fn a_lobe_is_given_changed_and_taken_away() {
        let edit = |roughness, specular| ObjectEdit {
            roughness,
            specular,
            ..ObjectEdit::default()
        };
        let found = Some((0.2, 0.1));
        assert_eq!(edit(None, None).lobe(found), found);
        assert_eq!(edit(Some(0.5), None).lobe(found), Some((0.5, 0.1)));
        assert_eq!(edit(None, Some(0.7)).lobe(found), Some((0.2, 0.7)));
        assert_eq!(edit(Some(0.5), Some(0.0)).lobe(found), None);
        // Missing values are those of a satin dielectric; values out of range are clamped.
        assert_eq!(edit(Some(0.5), None).lobe(None), Some((0.5, 0.04)));
        assert_eq!(edit(None, Some(0.7)).lobe(None), Some((0.3, 0.7)));
        let odd = edit(Some(-4.0), Some(9.0)).lobe(None);
        assert_eq!(odd, Some((MIN_ROUGHNESS, 1.0)));

        let mut edits = Edits::default();
        edits.set(0, edit(Some(0.1), Some(0.5)));
        let polished = edits.apply(&estimate());
        let lobe = polished.materials()[0].lobe.expect("a lobe");
        assert_eq!((lobe.roughness, lobe.specular), (0.1, Vec3::splat(0.5)));
        assert!(polished.materials()[1].lobe.is_none());
        edits.set(0, edit(None, Some(0.0)));
        assert!(edits.apply(&polished).materials()[0].lobe.is_none());
    }

    #[test]
    fn values_that_no_surface_has_are_brought_into_range() {
        let mut edits = Edits::default();
        let mut odd = edits.object(0);
        odd.albedo = Some(Vec3::new(-1.0, 0.5, 7.0));
        odd.emission = Some(Vec3::new(-2.0, 0.0, 1.0));
        edits.set(0, odd);
        let object = &edits.apply(&estimate()).objects[0];
        assert_eq!(object.albedo, Vec3::new(0.0, 0.5, 1.0));
        assert_eq!(object.emission, Vec3::new(0.0, 0.0, 1.0));
    }
}
