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
    /// A history that begins with a value.
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

    /// Whether there is a step to take back.
    pub fn can_undo(&self) -> bool {
        !self.past.is_empty()
    }

    /// Whether there is a step to make again.
    pub fn can_redo(&self) -> bool {
        !self.future.is_empty()
    }

    /// Takes the last step back; false where there is none.
    pub fn undo(&mut self, value: &mut T) -> bool {
        self.record(value);
        let (past, future) = (&mut self.past, &mut self.future);
        step(value, &mut self.current, past, future)
    }

    /// Makes the last step that was taken back again; false where there is none.
    pub fn redo(&mut self, value: &mut T) -> bool {
        self.record(value);
        let (past, future) = (&mut self.past, &mut self.future);
        step(value, &mut self.current, future, past)
    }
}

/// Goes to the newest value of `from`, leaving the current one in `to`.
fn step<T: Clone>(value: &mut T, current: &mut T, from: &mut Vec<T>, to: &mut Vec<T>) -> bool {
    let Some(next) = from.pop() else {
        return false;
    };
    to.push(std::mem::replace(current, next));
    value.clone_from(current);
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_go_back_and_forth_and_a_new_one_ends_the_future() {
        let mut history = History::<i32>::default();
        let mut value = 0;
        for step in 1..=3 {
            value = step;
            history.record(&value);
            history.record(&value);
        }
        assert!(history.undo(&mut value) && value == 2);
        assert!(history.undo(&mut value) && value == 1);
        assert!(history.redo(&mut value) && value == 2);
        value = 9;
        history.record(&value);
        assert!(!history.redo(&mut value) && value == 9);
        assert!(history.undo(&mut value) && value == 2);
        assert!(history.undo(&mut value) && history.undo(&mut value) && value == 0);
        assert!(!history.undo(&mut value) && !history.can_undo() && history.can_redo());
    }

    #[test]
    fn what_was_not_yet_recorded_is_undone_first() {
        let mut history = History::<i32>::default();
        let mut value = 5;
        assert!(history.undo(&mut value) && value == 0);
        assert!(history.redo(&mut value) && value == 5);
    }
}
