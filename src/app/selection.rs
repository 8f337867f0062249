//! The selected objects of the scene.

use std::collections::BTreeSet;

/// The selected object, and those selected besides it.
#[derive(Debug, Clone, Default)]
pub struct Selection {
    /// The selected object; the active one where several are.
    pub object: Option<u32>,
    also: BTreeSet<u32>,
}

impl Selection {
    /// Selects an object alone; where `more`, adds it to those selected, or takes it out.
    pub fn select(&mut self, object: Option<u32>, more: bool) {
        match (object, self.object) {
            (Some(object), Some(active)) if more && object != active => {
                if !self.also.remove(&object) {
                    self.also.insert(object);
                }
            }
            _ if more && object.is_none() => {}
            _ => {
                self.also.clear();
                self.object = object;
            }
        }
    }

    /// All selected objects, the active one first.
    pub fn all(&self) -> Vec<u32> {
        let also = self.also.iter().copied();
        let also = also.filter(|&object| Some(object) != self.object);
        self.object.into_iter().chain(also).collect()
    }

    pub fn contains(&self, object: u32) -> bool {
        self.object == Some(object) || self.also.contains(&object)
    }
}
