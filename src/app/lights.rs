//! The light of each lamp: a switch, a strength and a colour, kept as edits of the lamps' emission.

use crate::app::document::Document;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::session::edits::ObjectEdit;
use crate::session::snapshot::LightSource;
use crate::transport::layers::Split;
use glam::Vec3;

/// Triangles of an object whose mean position says where it is, at most.
const SAMPLED: usize = 64;

/// The gain of a lamp's objects; of the light from outside where there are no objects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gain {
    /// Whether it is lit.
    pub on: bool,
    /// Factor on its light.
    pub strength: f32,
    /// Factors on its red, green and blue, in [0, 1]; white leaves its colour as it is.
    pub color: Vec3,
}

impl Gain {
    /// What an edit makes of a lamp that was found to emit `found`.
    fn of(edit: &ObjectEdit, found: Vec3) -> Self {
        let emission = edit.emission.unwrap_or(found);
        let lit = found.cmpgt(Vec3::ZERO);
        let factor = Vec3::select(lit, emission / found, Vec3::ZERO);
        Self::by(!edit.off, factor, lit)
    }

    /// The gain of a factor on emission; channels that emit nothing take no colour from it.
    fn by(on: bool, factor: Vec3, lit: glam::BVec3) -> Self {
        let strength = factor.max_element().max(0.0);
        let color = match strength > 0.0 {
            true => Vec3::select(lit, factor / strength, Vec3::ONE),
            false => Vec3::ONE,
        };
        Self {
            on,
            strength,
            color,
        }
    }

    fn factor(&self) -> Vec3 {
        self.color * self.strength
    }
}

impl Document {
    /// The lamps that were found, and which objects each stands for.
    pub fn lamps(&self) -> Vec<(LightSource, Vec<usize>)> {
        let found = &self.snapshot.estimate;
        let Some(capture) = self.capture() else {
            return Vec::new();
        };
        let emission = |object: usize| found.objects.get(object).map_or(Vec3::ZERO, |o| o.emission);
        let split = Split::of(&capture.scene, emission, found.outside.is_some());
        let objects = |source| {
            let all = 0..found.objects.len();
            all.filter(|&object| split.source_of(object as u32) == Some(source))
                .collect()
        };
        (split.sources().iter())
            .map(|&source| (source, objects(source)))
            .collect()
    }

    /// The gain of a lamp's objects; of the light from outside where there are no objects.
    pub fn gain(&self, objects: &[usize]) -> Gain {
        let found = |object: usize| self.snapshot.estimate.objects.get(object);
        let first = objects.first().and_then(|&o| Some((o, found(o)?)));
        match first {
            Some((object, found)) => Gain::of(&self.edits.object(object), found.emission),
            None => {
                let factor = self.edits.outside();
                Gain::by(factor != Vec3::ZERO, factor, glam::BVec3::TRUE)
            }
        }
    }

    /// Sets the gain of a lamp's objects; of the light from outside where there are no objects.
    pub fn set_gain(&mut self, objects: &[usize], gain: Gain) {
        let factor = gain.factor();
        if objects.is_empty() {
            let lit = match (gain.on, factor == Vec3::ZERO) {
                (false, _) => Vec3::ZERO,
                // Switched on again.
                (true, true) => Vec3::ONE,
                (true, false) => factor,
            };
            self.edits.set_outside(lit);
        }
        for &object in objects {
            let Some(found) = self.snapshot.estimate.objects.get(object) else {
                continue;
            };
            let mut edit = self.edits.object(object);
            edit.off = !gain.on;
            edit.emission = (factor != Vec3::ONE).then(|| found.emission * factor);
            self.edits.set(object, edit);
        }
    }

    /// Whether any light is another than was found.
    pub fn lights_are_changed(&self) -> bool {
        let changed = |edit: ObjectEdit| edit.off || edit.emission.is_some();
        let mut objects = 0..self.snapshot.estimate.objects.len();
        self.edits.outside() != Vec3::ONE || objects.any(|o| changed(self.edits.object(o)))
    }

    /// Resets all lamps and the light from outside to the estimate.
    pub fn reset_lights(&mut self) {
        for object in 0..self.snapshot.estimate.objects.len() {
            let mut edit = self.edits.object(object);
            (edit.off, edit.emission, edit.emission_known) = (false, None, false);
            self.edits.set(object, edit);
        }
        self.edits.set_outside(Vec3::ONE);
    }
}

/// Where an object is, as the camera sees it.
pub fn place(scene: &Scene, object: u32, camera: &Camera) -> Option<String> {
    let triangles = &scene.objects.get(object as usize)?.triangles;
    let stride = triangles.len().div_ceil(SAMPLED).max(1);
    let sampled = triangles.iter().step_by(stride);
    let corners = 3.0 * sampled.len() as f32;
    let sums = sampled.map(|&triangle| scene.corners(triangle).iter().sum::<Vec3>());
    let middle = sums.sum::<Vec3>() / corners;
    let k = &camera.intrinsics;
    let part = |at: f32, whole: u32, words: [&'static str; 3]| {
        words[((at / whole as f32 * 3.0) as usize).min(2)]
    };
    Some(match camera.project(middle) {
        Some(at) => {
            let height = part(at.y, k.height, ["high", "", "low"]);
            let side = part(at.x, k.width, ["left", "middle", "right"]);
            format!("{height} {side}").trim().to_owned()
        }
        None if (middle - camera.center).dot(scene.up) > 0.0 => "above, out of view".to_owned(),
        None => "below, out of view".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gain_is_what_an_edit_says_of_the_light_that_was_found() {
        let found = Vec3::new(4.0, 2.0, 0.0);
        let edit = ObjectEdit {
            emission: Some(Vec3::new(2.0, 0.5, 0.0)),
            off: true,
            ..ObjectEdit::default()
        };
        let gain = Gain::of(&edit, found);
        assert!(!gain.on);
        assert_eq!((gain.strength, gain.color), (0.5, Vec3::new(1.0, 0.5, 1.0)));
        assert_eq!(found * gain.factor(), Vec3::new(2.0, 0.5, 0.0));
        let none = Gain::of(&ObjectEdit::default(), found);
        assert_eq!((none.on, none.strength, none.color), (true, 1.0, Vec3::ONE));
    }
}
