//! The worker's inbox: a bounded queue of commands whose sender never blocks.

use crate::session::command::Command;
use std::collections::VecDeque;
use std::mem::discriminant;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Capacity of the queue. Insertions and edits always find room: only the newest of each is kept.
pub const CAPACITY: usize = 256;

pub struct Outbox(Arc<Queue>);

pub struct Inbox(Arc<Queue>);

#[derive(Default)]
struct Queue {
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

#[derive(Default)]
struct Waiting {
    commands: VecDeque<Command>,
    /// Whether one of the ends is gone.
    closed: bool,
}

/// An entry of the inbox.
pub enum Mail {
    Command(Command),
    /// Nothing is waiting.
    Nothing,
    /// The sender is gone.
    Closed,
}

/// Creates a queue and returns both ends.
pub fn queue() -> (Outbox, Inbox) {
    let queue = Arc::new(Queue::default());
    (Outbox(queue.clone()), Inbox(queue))
}

fn is_change(command: &Command) -> bool {
    matches!(command, Command::Edit(_) | Command::Insert(_))
}

impl Queue {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_one();
    }
}

impl Waiting {
    fn take(&mut self) -> Mail {
        match self.commands.pop_front() {
            Some(command) => Mail::Command(command),
            None if self.closed => Mail::Closed,
            None => Mail::Nothing,
        }
    }
}

impl Outbox {
    /// Sends a command without blocking. False if the queue is full or the worker has ended.
    pub fn send(&self, command: Command) -> bool {
        let mut waiting = self.0.lock();
        if waiting.closed {
            return false;
        }
        let is_older = |other: &&mut Command| {
            is_change(&command) && discriminant(*other) == discriminant(&command)
        };
        let full = waiting.commands.len() >= CAPACITY && !is_change(&command);
        if let Some(older) = waiting.commands.iter_mut().find(is_older) {
            *older = command;
        } else if full {
            return false;
        } else {
            waiting.commands.push_back(command);
        }
        self.0.changed.notify_one();
        true
    }
}

impl Inbox {
    pub fn poll(&self) -> Mail {
        self.0.lock().take()
    }

    /// The number of entries that are waiting, and whether one of the commands `is` what is looked for.
    pub fn look_ahead(&self, is: impl Fn(&Command) -> bool) -> (usize, bool) {
        let waiting = self.0.lock();
        let entries = waiting.commands.len() + usize::from(waiting.closed);
        (entries, waiting.commands.iter().any(is))
    }

    /// Waits for the next command, at most for `limit`.
    pub fn wait(&self, limit: Option<Duration>) -> Mail {
        let waits = |waiting: &mut Waiting| waiting.commands.is_empty() && !waiting.closed;
        let limit = limit.unwrap_or(Duration::MAX);
        let (mut waiting, _) = (self.0.changed)
            .wait_timeout_while(self.0.lock(), limit, waits)
            .unwrap_or_else(PoisonError::into_inner);
        waiting.take()
    }

    /// Drops waiting edits and insertions; they belong to a capture that is no longer open.
    pub fn forget_changes(&self) {
        self.0.lock().commands.retain(|command| !is_change(command));
    }

    /// Whether no command is waiting.
    pub fn is_empty(&self) -> bool {
        self.0.lock().commands.is_empty()
    }
}

impl Drop for Outbox {
    fn drop(&mut self) {
        self.0.close();
    }
}

impl Drop for Inbox {
    fn drop(&mut self) {
        self.0.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::edits::Edits;

    #[test]
    fn a_flood_of_edits_leaves_room_for_commands_and_only_the_newest_arrives() {
        let (outbox, inbox) = queue();
        let mut last = Edits::default();
        for object in 0..10 * CAPACITY {
            last = Edits::default();
            let mut off = last.object(object);
            off.off = true;
            last.set(object, off);
            assert!(outbox.send(Command::Insert(Vec::new())));
            assert!(outbox.send(Command::Edit(last.clone())));
        }
        let mut seen = Vec::new();
        while let Mail::Command(command) = inbox.poll() {
            seen.push(command);
        }
        let [Command::Insert(_), Command::Edit(edits)] = &seen[..] else {
            panic!("{seen:?}");
        };
        assert_eq!(*edits, last);
    }

    #[test]
    fn looking_ahead_hands_nothing_out_and_the_order_stays() {
        let (outbox, inbox) = queue();
        assert!(outbox.send(Command::Pause));
        assert!(outbox.send(Command::Step));
        let is_step = |command: &Command| matches!(command, Command::Step);
        assert_eq!(inbox.look_ahead(is_step), (2, true));
        assert!(matches!(inbox.poll(), Mail::Command(Command::Pause)));
        assert!(matches!(inbox.poll(), Mail::Command(Command::Step)));
        assert!(inbox.is_empty());
        drop(outbox);
        assert_eq!(inbox.look_ahead(is_step), (1, false));
        assert!(matches!(inbox.poll(), Mail::Closed));
        assert!(matches!(inbox.wait(None), Mail::Closed));
    }

    #[test]
    fn a_full_queue_refuses_commands_without_waiting_and_so_does_one_that_nobody_reads() {
        let (outbox, inbox) = queue();
        for _ in 0..CAPACITY {
            assert!(outbox.send(Command::Step));
        }
        assert!(!outbox.send(Command::Pause));
        assert!(outbox.send(Command::Edit(Edits::default())));
        for _ in 0..CAPACITY {
            assert!(matches!(inbox.poll(), Mail::Command(Command::Step)));
        }
        assert!(matches!(inbox.poll(), Mail::Command(Command::Edit(_))));
        assert!(matches!(inbox.wait(Some(Duration::ZERO)), Mail::Nothing));
        drop(inbox);
        assert!(!outbox.send(Command::Pause));
    }
}
