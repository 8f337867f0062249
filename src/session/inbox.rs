//! The worker's inbox: a bounded queue of commands whose sender never blocks.

use crate::session::command::{Command, Placement};
use crate::session::edits::Edits;
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, TryRecvError, TrySendError, bounded};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Capacity of the queue. Insertions and edits do not count: only the newest of each is kept.
pub const CAPACITY: usize = 256;

/// An entry of the queue.
enum Message {
    Command(Command),
    /// There may be an insertion or an edit in [`Latest`].
    Look,
}

/// Commands of which only the newest counts.
#[derive(Default)]
struct Latest {
    insert: Option<Vec<Placement>>,
    edit: Option<Edits>,
}

/// The sending end.
pub struct Outbox {
    queue: Sender<Message>,
    latest: Arc<Mutex<Latest>>,
}

/// The worker's end.
pub struct Inbox {
    queue: Receiver<Message>,
    latest: Arc<Mutex<Latest>>,
    /// Entries received by [`Inbox::look_ahead`] that are not handed out yet.
    ahead: VecDeque<Mail>,
}

/// An entry of the inbox.
pub enum Mail {
    /// A command.
    Command(Command),
    /// Nothing is waiting.
    Nothing,
    /// The sender is gone.
    Closed,
}

/// Creates a queue and returns both ends.
pub fn queue() -> (Outbox, Inbox) {
    let (sender, receiver) = bounded(CAPACITY);
    let latest = Arc::new(Mutex::new(Latest::default()));
    (
        Outbox {
            queue: sender,
            latest: latest.clone(),
        },
        Inbox {
            queue: receiver,
            latest,
            ahead: VecDeque::new(),
        },
    )
}

impl Outbox {
    /// Sends a command without blocking. False if the queue is full or the worker has ended.
    pub fn send(&self, command: Command) -> bool {
        let message = {
            let mut latest = self.latest.lock().unwrap_or_else(PoisonError::into_inner);
            match command {
                Command::Insert(placements) => {
                    latest.insert = Some(placements);
                    Message::Look
                }
                Command::Edit(edits) => {
                    latest.edit = Some(edits);
                    Message::Look
                }
                other => Message::Command(other),
            }
        };
        match self.queue.try_send(message) {
            Ok(()) => true,
            // The worker will empty a full queue, and then finds the command in `latest`.
            Err(TrySendError::Full(Message::Look)) => true,
            Err(_) => false,
        }
    }
}

impl Inbox {
    /// The next command, if one is waiting.
    pub fn poll(&mut self) -> Mail {
        self.ahead.pop_front().unwrap_or_else(|| self.receive())
    }

    /// All entries that are waiting; [`Inbox::poll`] still hands them out.
    pub fn look_ahead(&mut self) -> &VecDeque<Mail> {
        loop {
            match self.receive() {
                Mail::Nothing => return &self.ahead,
                Mail::Closed => {
                    self.ahead.push_back(Mail::Closed);
                    return &self.ahead;
                }
                mail => self.ahead.push_back(mail),
            }
        }
    }

    fn receive(&self) -> Mail {
        loop {
            match self.queue.try_recv() {
                Ok(Message::Command(command)) => return Mail::Command(command),
                Ok(Message::Look) => {
                    if let Some(command) = self.newest() {
                        return Mail::Command(command);
                    }
                }
                Err(TryRecvError::Empty) => {
                    return self.newest().map_or(Mail::Nothing, Mail::Command);
                }
                Err(TryRecvError::Disconnected) => return Mail::Closed,
            }
        }
    }

    /// Waits for the next command, at most for `limit`.
    pub fn wait(&mut self, limit: Option<Duration>) -> Mail {
        let end = limit.map(|limit| Instant::now() + limit);
        loop {
            match self.poll() {
                Mail::Nothing => {}
                mail => return mail,
            }
            let message = match end {
                Some(end) => self.queue.recv_deadline(end),
                None => self.queue.recv().map_err(RecvTimeoutError::from),
            };
            match message {
                Ok(Message::Command(command)) => return Mail::Command(command),
                Ok(Message::Look) => {}
                Err(RecvTimeoutError::Timeout) => return Mail::Nothing,
                Err(RecvTimeoutError::Disconnected) => return Mail::Closed,
            }
        }
    }

    /// Drops waiting edits and insertions; they belong to a capture that is no longer open.
    pub fn forget_changes(&mut self) {
        let mut latest = self.latest.lock().unwrap_or_else(PoisonError::into_inner);
        (latest.edit, latest.insert) = (None, None);
        let is_change =
            |mail: &Mail| matches!(mail, Mail::Command(Command::Edit(_) | Command::Insert(_)));
        self.ahead.retain(|mail| !is_change(mail));
    }

    /// Whether nothing is waiting.
    pub fn is_empty(&self) -> bool {
        self.ahead.is_empty() && self.queue.is_empty()
    }

    fn newest(&self) -> Option<Command> {
        let mut latest = self.latest.lock().unwrap_or_else(PoisonError::into_inner);
        let next = latest.edit.take().map(Command::Edit);
        next.or_else(|| latest.insert.take().map(Command::Insert))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_of_edits_leaves_room_for_commands_and_only_the_newest_arrives() {
        let (outbox, mut inbox) = queue();
        for _ in 0..10 * CAPACITY {
            assert!(outbox.send(Command::Insert(Vec::new())));
        }
        let mut last = Edits::default();
        for object in 0..10 * CAPACITY {
            last = Edits::default();
            let mut off = last.object(object);
            off.off = true;
            last.set(object, off);
            assert!(outbox.send(Command::Edit(last.clone())));
        }
        let mut seen = Vec::new();
        while let Mail::Command(command) = inbox.poll() {
            seen.push(command);
        }
        let [Command::Edit(edits), Command::Insert(_)] = &seen[..] else {
            panic!("{seen:?}");
        };
        assert_eq!(*edits, last);
    }

    #[test]
    fn looking_ahead_hands_nothing_out_and_keeps_the_order() {
        let (outbox, mut inbox) = queue();
        assert!(outbox.send(Command::Pause));
        assert!(outbox.send(Command::Step));
        assert_eq!(inbox.look_ahead().len(), 2);
        assert!(outbox.send(Command::Run));
        assert!(!inbox.is_empty());
        assert!(matches!(inbox.poll(), Mail::Command(Command::Pause)));
        assert!(matches!(inbox.poll(), Mail::Command(Command::Step)));
        assert!(matches!(inbox.poll(), Mail::Command(Command::Run)));
        assert!(inbox.is_empty());
        drop(outbox);
        assert_eq!(inbox.look_ahead().len(), 1);
        assert!(matches!(inbox.poll(), Mail::Closed));
        assert!(matches!(inbox.wait(None), Mail::Closed));
    }

    #[test]
    fn a_full_queue_refuses_commands_without_waiting_and_a_closed_one_says_so() {
        let (outbox, mut inbox) = queue();
        for _ in 0..CAPACITY {
            assert!(outbox.send(Command::Step));
        }
        assert!(!outbox.send(Command::Pause));
        for _ in 0..CAPACITY {
            assert!(matches!(inbox.poll(), Mail::Command(Command::Step)));
        }
        assert!(matches!(inbox.poll(), Mail::Nothing));
        drop(outbox);
        assert!(matches!(inbox.wait(None), Mail::Closed));
    }
}
