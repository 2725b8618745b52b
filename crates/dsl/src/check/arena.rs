//! Statements that the checker makes or reads itself: those of a sweep's runs, and of databases. They live as long as the
//! tree does, so that a [`Line`](super::block::Line) can be a view into either.

use std::cell::{Cell, OnceCell};

use crate::ast::Statement;

/// A chain of statements, each written once.
#[derive(Default)]
pub(super) struct Arena {
    first: Link,
}

type Link = OnceCell<Box<Node>>;

struct Node {
    statement: Statement,
    next: Link,
}

/// The end of an arena, where statements are added.
pub(super) struct Tail<'a>(Cell<&'a Link>);

impl Arena {
    /// Where the first statement goes; one arena has one tail.
    pub(super) fn tail(&self) -> Tail<'_> {
        Tail(Cell::new(&self.first))
    }
}

impl<'a> Tail<'a> {
    /// Keeps a statement.
    pub(super) fn keep(&self, statement: Statement) -> &'a Statement {
        let node = self.0.get().get_or_init(|| Box::new(Node { statement, next: OnceCell::new() }));
        self.0.set(&node.next);
        &node.statement
    }
}

impl Drop for Arena {
    /// Link by link: a long chain would overflow the stack.
    fn drop(&mut self) {
        let mut next = self.first.take();
        while let Some(mut node) = next {
            next = node.next.take();
        }
    }
}
