//! Which objects give light: every object is a reflector unless the photographs contradict that plainly.

use serde::{Deserialize, Serialize};

/// What an object is taken for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Role {
    /// Its light is what it reflects.
    Reflector,
    /// It gives light; its albedo is hidden by that and held at zero, so that its emission is its exitant radiance.
    Emitter,
    /// No photograph sees it. Its light is an unknown, found by what it does to others.
    Unseen,
    /// No photograph sees it, and nothing speaks for light from it.
    Dark,
    /// It both gives light and reflects.
    Glowing,
}

impl Role {
    /// Whether its albedo is fitted.
    pub fn reflects(self) -> bool {
        matches!(self, Self::Reflector | Self::Glowing)
    }

    /// Whether its emission is fitted.
    pub fn emits(self) -> bool {
        matches!(self, Self::Emitter | Self::Unseen | Self::Glowing)
    }
}

/// Where each of the parameters of so many surfaces stands among the free ones; `usize::MAX` for those that are held.
pub fn places(free: &[usize], surfaces: usize) -> Vec<usize> {
    let mut places = vec![usize::MAX; 2 * surfaces];
    for (row, &parameter) in free.iter().enumerate() {
        places[parameter] = row;
    }
    places
}

/// The parameters that are fitted under some roles: indices into albedos, of the surfaces of which `has_albedo` says so, then into
/// emissions.
pub fn free(roles: &[Role], has_albedo: impl Fn(usize) -> bool) -> Vec<usize> {
    let albedo = (0..roles.len()).filter(|&k| has_albedo(k));
    let emission = (0..roles.len())
        .filter(|&k| roles[k].emits())
        .map(|k| roles.len() + k);
    albedo.chain(emission).collect()
}
