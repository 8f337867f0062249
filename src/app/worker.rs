//! The window's end of a session: a way to ask, the newest answer, and what the worker was told last.

use crate::app::document::Document;
use crate::capture::regroup::Regroup;
use crate::session::command::{Command, Placement, Regrouping, ViewRequest};
use crate::session::edits::Edits;
use crate::session::snapshot::Snapshot;
use std::collections::VecDeque;
use std::sync::Arc;

/// What the window needs of a session. Neither method ever waits.
pub trait Connection {
    /// Hands a command to the worker; false where its queue is full, to be tried again.
    fn send(&self, command: Command) -> bool;

    /// The newest snapshot.
    fn latest(&self) -> Arc<Snapshot>;
}

impl Connection for crate::session::Session {
    fn send(&self, command: Command) -> bool {
        Self::send(self, command)
    }

    fn latest(&self) -> Arc<Snapshot> {
        Self::latest(self)
    }
}

/// What the worker was told last.
#[derive(Debug)]
pub struct Sent {
    /// The view; `None` asks again.
    pub view: Option<ViewRequest>,
    /// The inserted objects.
    pub insertions: Vec<Placement>,
    /// Whether they take blur and grain.
    pub finish: bool,
    /// The edits.
    pub edits: Edits,
    /// The regroupings.
    pub regroups: Vec<Regroup>,
}

/// The worker as the window sees it.
pub struct Worker {
    connection: Box<dyn Connection>,
    pending: VecDeque<Command>,
    /// What it was told last.
    pub sent: Sent,
}

impl Worker {
    /// The worker behind a connection.
    pub fn new(connection: Box<dyn Connection>) -> Self {
        Self {
            connection,
            pending: VecDeque::new(),
            sent: Sent {
                view: None,
                insertions: Vec::new(),
                finish: true,
                edits: Edits::default(),
                regroups: Vec::new(),
            },
        }
    }

    /// The newest snapshot.
    pub fn latest(&self) -> Arc<Snapshot> {
        self.connection.latest()
    }

    /// Asks something; kept and tried again while the queue is full.
    pub fn send(&mut self, command: Command) {
        self.pending.push_back(command);
        self.flush();
    }

    /// Sends what waits; whether all is sent.
    pub fn flush(&mut self) -> bool {
        while let Some(command) = self.pending.front() {
            if !self.connection.send(command.clone()) {
                return false;
            }
            self.pending.pop_front();
        }
        true
    }

    /// Notes that the worker opened a capture and knows all that the document says now.
    pub fn has(&mut self, document: &Document) {
        self.sent.view = None;
        self.sent.insertions = document.insertions.objects.clone();
        self.sent.edits = document.edits.clone();
        self.sent.regroups = document.regroups.clone();
    }

    /// Asks for a view where it differs from the last.
    pub fn send_view(&mut self, request: &ViewRequest) {
        let connection = &self.connection;
        told(&mut self.sent.view, &Some(request.clone()), || {
            connection.send(Command::View(request.clone()))
        });
    }

    /// Sends the inserted objects where they differ.
    pub fn send_insertions(&mut self, document: &Document) {
        let (connection, sent) = (&self.connection, &mut self.sent);
        let (objects, finish) = (&document.insertions.objects, document.insertions.finish);
        told(&mut sent.finish, &finish, || {
            connection.send(Command::Match(finish))
        });
        told(&mut sent.insertions, objects, || {
            connection.send(Command::Insert(objects.clone()))
        });
    }

    /// Sends the regroupings where they differ, with the edits that belong to the objects after them.
    pub fn send_regroups(&mut self, document: &Document) {
        let changed = document.regroups != self.sent.regroups;
        let Some(capture) = document.capture().filter(|_| changed) else {
            return;
        };
        let wanted = Regrouping {
            hash: capture.hash.clone(),
            changes: document.regroups.clone(),
            edits: document.edits.clone(),
        };
        if self.connection.send(Command::Regroup(Box::new(wanted))) {
            self.sent.regroups.clone_from(&document.regroups);
            self.sent.edits = document.edits.clone();
        }
    }

    /// Sends the edits where they differ.
    pub fn send_edits(&mut self, document: &Document) {
        let connection = &self.connection;
        told(&mut self.sent.edits, &document.edits, || {
            connection.send(Command::Edit(document.edits.clone()))
        });
    }
}

/// Tells the worker a value where it differs from the last; it is kept as told unless the queue was full.
fn told<T: Clone + PartialEq>(last: &mut T, value: &T, tell: impl FnOnce() -> bool) {
    if last != value && tell() {
        last.clone_from(value);
    }
}
