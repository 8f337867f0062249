//! The role of each object: a reflector, unless the photographs clearly contradict that.

use serde::{Deserialize, Serialize};

/// The role of an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Role {
    /// It reflects light only.
    Reflector,
    /// It emits light. Its albedo cannot be separated from that and is held at zero: its emission is its exitant radiance.
    Emitter,
    /// No photograph sees it. Its emission is fitted through its effect on other objects.
    Unseen,
    /// No photograph sees it, and it emits nothing.
    Dark,
    /// It emits and reflects.
    Glowing,
    /// All photographs of it are saturated. It is held at the least emission that they show, since the light on other objects does
    /// not tell that it is brighter.
    Saturated,
}

impl Role {
    /// Whether its albedo is fitted.
    pub fn reflects(self) -> bool {
        matches!(self, Self::Reflector | Self::Glowing)
    }

    /// Whether its emission hides its albedo.
    pub fn is_lamp(self) -> bool {
        matches!(self, Self::Emitter | Self::Saturated)
    }

    /// Whether its emission is fitted.
    pub fn emits(self) -> bool {
        matches!(self, Self::Emitter | Self::Unseen | Self::Glowing)
    }
}

/// The row of each parameter among the free ones; `usize::MAX` for fixed parameters.
pub fn places(free: &[usize], surfaces: usize) -> Vec<usize> {
    let mut places = vec![usize::MAX; 2 * surfaces];
    for (row, &parameter) in free.iter().enumerate() {
        places[parameter] = row;
    }
    places
}

/// The free parameters: the albedos of surfaces with `has_albedo`, then the emissions of surfaces whose role emits. They are
/// indices into albedos, then emissions.
pub fn free(roles: &[Role], has_albedo: impl Fn(usize) -> bool) -> Vec<usize> {
    let albedo = (0..roles.len()).filter(|&k| has_albedo(k));
    let emission = (0..roles.len())
        .filter(|&k| roles[k].emits())
        .map(|k| roles.len() + k);
    albedo.chain(emission).collect()
}
