//! The light mixer: strength and colour of every lamp, applied to layers of light already traced.

use crate::session::snapshot::{LightLayers, LightSource, Picture};
use glam::Vec3;
use std::collections::BTreeMap;
use std::sync::Arc;

/// What is made of one layer's light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gain {
    /// Whether it is lit.
    pub on: bool,
    /// Factor on its light.
    pub strength: f32,
    /// Factors on its red, green and blue, in [0, 1]; white leaves its colour as it is.
    pub color: Vec3,
}

impl Default for Gain {
    fn default() -> Self {
        Self {
            on: true,
            strength: 1.0,
            color: Vec3::ONE,
        }
    }
}

impl Gain {
    /// The factor on the layer's red, green and blue.
    pub fn factor(&self) -> Vec3 {
        if self.on {
            self.color * self.strength
        } else {
            Vec3::ZERO
        }
    }
}

/// The gains of all layers; those that are not named leave their layer as it is.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mix(BTreeMap<LightSource, Gain>);

impl Mix {
    /// What is made of a layer.
    pub fn gain(&self, source: LightSource) -> Gain {
        self.0.get(&source).copied().unwrap_or_default()
    }

    /// Replaces what is made of a layer.
    pub fn set(&mut self, source: LightSource, gain: Gain) {
        if gain == Gain::default() {
            self.0.remove(&source);
        } else {
            self.0.insert(source, gain);
        }
    }

    /// Whether all layers are left as they are.
    pub fn is_neutral(&self) -> bool {
        self.0.is_empty()
    }
}

/// The mix, and the picture that it makes of the newest layers.
#[derive(Debug, Default)]
pub struct Mixer {
    /// The gains.
    pub mix: Mix,
    mixed: Option<Mixed>,
}

#[derive(Debug)]
struct Mixed {
    layers: Arc<LightLayers>,
    mix: Mix,
    picture: Option<Arc<Picture>>,
}

impl Mixer {
    /// Mixes anew where the layers or the gains have changed.
    pub fn update(&mut self, layers: Option<&Arc<LightLayers>>) {
        let Some(layers) = layers else {
            self.mixed = None;
            return;
        };
        let current = self
            .mixed
            .as_ref()
            .is_some_and(|mixed| Arc::ptr_eq(&mixed.layers, layers) && mixed.mix == self.mix);
        if current {
            return;
        }
        let picture = layers.mix(|source| self.mix.gain(source).factor());
        self.mixed = Some(Mixed {
            layers: layers.clone(),
            mix: self.mix.clone(),
            picture: picture.map(Arc::new),
        });
    }

    /// The mixed picture, once there are layers.
    pub fn picture(&self) -> Option<Arc<Picture>> {
        self.mixed.as_ref()?.picture.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(value: Vec3) -> Arc<Picture> {
        Arc::new(Picture::from_fn(2, 1, |_, _| value))
    }

    #[test]
    fn a_mix_is_made_anew_only_when_layers_or_gains_change() {
        let layers = Arc::new(LightLayers {
            layers: vec![
                (LightSource::Lamp(3), flat(Vec3::new(1.0, 2.0, 4.0))),
                (LightSource::Outside, flat(Vec3::splat(0.5))),
            ],
            samples: 1,
        });
        let mut mixer = Mixer::default();
        mixer.update(Some(&layers));
        let first = mixer.picture().expect("a picture");
        assert_eq!(first.pixels, [Vec3::new(1.5, 2.5, 4.5); 2]);
        mixer.update(Some(&layers));
        assert!(Arc::ptr_eq(&first, &mixer.picture().expect("a picture")));

        let dim = Gain {
            strength: 0.5,
            color: Vec3::new(1.0, 0.5, 0.0),
            ..Gain::default()
        };
        mixer.mix.set(LightSource::Lamp(3), dim);
        mixer.update(Some(&layers));
        let second = mixer.picture().expect("a picture");
        assert_eq!(second.pixels, [Vec3::new(1.0, 1.0, 0.5); 2]);
        mixer
            .mix
            .set(LightSource::Lamp(3), Gain { on: false, ..dim });
        mixer.update(Some(&layers));
        assert_eq!(
            mixer.picture().expect("a picture").pixels,
            [Vec3::splat(0.5); 2]
        );
        mixer.mix.set(LightSource::Lamp(3), Gain::default());
        assert!(mixer.mix.is_neutral());
        mixer.update(None);
        assert!(mixer.picture().is_none());
    }
}
