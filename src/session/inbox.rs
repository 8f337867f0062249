//! The way in: a bounded queue of commands that the sender never waits for.

use crate::session::command::{Command, Placement, ViewRequest};
use crate::session::edits::Edits;
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, TryRecvError, TrySendError, bounded};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Commands that may wait at a time. Views, insertions and edits do not count: of each only the newest waits.
pub const CAPACITY: usize = 256;

/// What travels through the queue.
enum Message {
    Command(Command),
    /// A view, an insertion or an edit lies in [`Latest`].
    Look,
}

/// Requests of which only the newest counts.
#[derive(Default)]
struct Latest {
    view: Option<ViewRequest>,
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
    /// Taken from the queue to be looked at, not yet handed out.
    ahead: VecDeque<Mail>,
}

/// What waits in the inbox.
pub enum Mail {
    /// A command.
    Command(Command),
    /// Nothing now.
    Nothing,
    /// Nothing ever again: the sender is gone.
    Closed,
}

/// Both ends of a new queue.
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
    /// Puts a command into the queue without ever waiting; false if the queue is full or the worker has ended.
    pub fn send(&self, command: Command) -> bool {
        let message = {
            let mut latest = self.latest.lock().unwrap_or_else(PoisonError::into_inner);
            match command {
                Command::View(request) => {
                    latest.view = Some(request);
                    Message::Look
                }
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
            // A full queue is emptied soon, and what lies in `latest` is found then.
            Err(TrySendError::Full(Message::Look)) => true,
            Err(_) => false,
        }
    }
}

impl Inbox {
    /// The next command, if one waits.
    pub fn poll(&mut self) -> Mail {
        self.ahead.pop_front().unwrap_or_else(|| self.receive())
    }

    /// Everything that waits, without handing it out; [`Inbox::poll`] does that.
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

    /// The next command; sleeps until there is one, or so long.
    pub fn wait(&mut self, most: Option<Duration>) -> Mail {
        let end = most.map(|most| Instant::now() + most);
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

    /// Forgets edits and insertions that wait: they are of a capture that is no longer open.
    pub fn forget_changes(&mut self) {
        let mut latest = self.latest.lock().unwrap_or_else(PoisonError::into_inner);
        (latest.edit, latest.insert) = (None, None);
        let is_change =
            |mail: &Mail| matches!(mail, Mail::Command(Command::Edit(_) | Command::Insert(_)));
        self.ahead.retain(|mail| !is_change(mail));
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.ahead.is_empty() && self.queue.is_empty()
    }

    fn newest(&self) -> Option<Command> {
        let mut latest = self.latest.lock().unwrap_or_else(PoisonError::into_inner);
        let next = latest.edit.take().map(Command::Edit);
        let next = next.or_else(|| latest.view.take().map(Command::View));
        next.or_else(|| latest.insert.take().map(Command::Insert))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::command::ViewCamera;

    fn view(frame: usize) -> Command {
        Command::View(ViewRequest {
            camera: ViewCamera::Frame(frame),
            long_side: 64,
            composite: 0,
            render: true,
            layers: false,
        })
    }

    #[test]
    fn a_flood_of_views_leaves_room_for_commands_and_only_the_newest_arrives() {
        let (outbox, mut inbox) = queue();
        for frame in 0..10 * CAPACITY {
            assert!(outbox.send(view(frame)));
        }
        let mut seen = Vec::new();
        while let Mail::Command(Command::View(request)) = inbox.poll() {
            seen.push(request.camera);
        }
        let last = 10 * CAPACITY - 1;
        assert!(matches!(seen[..], [ViewCamera::Frame(frame)] if frame == last));
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
