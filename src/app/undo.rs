//! Undo and redo of a value that is edited in place: a step is recorded at the end of each drag.

/// The history of a value.
#[derive(Debug, Clone, Default)]
pub struct History<T> {
    current: T,
    past: Vec<T>,
    future: Vec<T>,
}

/// Steps that are kept.
const DEPTH: usize = 200;

impl<T: Clone + PartialEq> History<T> {
    pub fn starting_at(value: T) -> Self {
        Self {
            current: value,
            past: Vec::new(),
            future: Vec::new(),
        }
    }

    /// Records `value` as one step if it differs from the last. To be called whenever no drag is under way, so that
    /// a drag is one step however many frames it lasts.
    pub fn record(&mut self, value: &T) {
        if *value == self.current {
            return;
        }
        self.past
            .push(std::mem::replace(&mut self.current, value.clone()));
        if self.past.len() > DEPTH {
            self.past.remove(0);
        }
        self.future.clear();
    }

    pub fn can_undo(&self) -> bool {
        !self.past.is_empty()
    }

    pub fn can_redo(&self) -> bool {
        !self.future.is_empty()
    }

    /// Takes the last step back, or makes the last step that was taken back again: the value after it, where there is such a step.
    pub fn step(&mut self, value: &T, back: bool) -> Option<T> {
        self.record(value);
        let (from, to) = match back {
            true => (&mut self.past, &mut self.future),
            false => (&mut self.future, &mut self.past),
        };
        let next = from.pop()?;
        to.push(std::mem::replace(&mut self.current, next.clone()));
        Some(next)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_go_back_and_forth_and_a_new_one_ends_the_future() {
        let mut history = History::<i32>::default();
        for step in [1, 2, 3, 3] {
            history.record(&step);
        }
        assert_eq!(history.step(&3, true), Some(2));
        assert_eq!(history.step(&2, true), Some(1));
        assert_eq!(history.step(&1, false), Some(2));
        // What was not recorded yet is taken back first.
        assert_eq!(history.step(&9, false), None);
        for before in [2, 1, 0] {
            assert_eq!(history.step(&history.current.clone(), true), Some(before));
        }
        assert!(!history.can_undo() && history.can_redo());
        assert_eq!(history.step(&0, true), None);
        assert_eq!(history.step(&5, true), Some(0));
        assert_eq!(history.step(&0, false), Some(5));
    }
}
