//! Braces and brackets are matched before anything else is read, so that no text can make the parser slow or deep, and
//! one that is missing costs one message.

use super::fault::Faults;
use super::mark::{comment, line_end, quoted};
use crate::Diagnostic;

/// Unmatched braces listed for one file.
const MOST: usize = 20;

/// What does not match. All lists ascend.
#[derive(Default)]
pub(super) struct Unmatched {
    /// `}` that close nothing, and the `}` before, if there is one.
    stray: Vec<(usize, Option<usize>)>,
    /// `{` never closed, and where the layout says that the block ends.
    open: Vec<(usize, Option<usize>)>,
    /// `[` never closed.
    lists: Vec<usize>,
    /// Places before which blocks end without `}`, and how many.
    implied: Vec<(usize, usize)>,
}

impl Unmatched {
    /// Whether the `}` at `at` closes nothing.
    pub(super) fn is_stray(&self, at: usize) -> bool {
        self.stray.binary_search_by_key(&at, |stray| stray.0).is_ok()
    }
    /// Whether the `[` at `at` is never closed.
    pub(super) fn is_open_list(&self, at: usize) -> bool {
        self.lists.binary_search(&at).is_ok()
    }
    /// Takes one block end that is implied before `at`.
    pub(super) fn take_implied(&mut self, at: usize) -> bool {
        let Ok(i) = self.implied.binary_search_by_key(&at, |implied| implied.0) else { return false };
        let left = &mut self.implied[i].1;
        let some = *left > 0;
        *left -= usize::from(some);
        some
    }
    fn len(&self) -> usize {
        self.stray.len() + self.open.len()
    }
}

/// Matches the braces of a text and reports those that do not match. Where some do not, the layout is asked which: a
/// statement that stands no further right than the line that opened the block has left that block.
pub(super) fn unmatched(text: &str, faults: &mut Faults) -> Unmatched {
    let bytes = text.as_bytes();
    let plain = walk(bytes, false);
    if plain.len() == 0 {
        return plain;
    }
    let by_layout = walk(bytes, true);
    let found = if by_layout.len() <= plain.len() { by_layout } else { plain };
    for &(at, hint) in found.open.iter().take(MOST) {
        let mut fault =
            Diagnostic::error("S01", faults.span(at, at + 1), "this block is never closed").label("`{` without `}`");
        if let Some(hint) = hint {
            fault = fault.note(faults.span(hint, hint + 1), "by its place, this line stands outside the block");
        }
        faults.push(fault.help(match hint {
            Some(hint) => format!("close the block with `}}` before line {}", line_number(bytes, hint)),
            None => "close the block with `}`".to_string(),
        }));
    }
    for &(at, before) in found.stray.iter().take(MOST) {
        let fault = Diagnostic::error("S01", faults.span(at, at + 1), "this `}` closes nothing").label("leave it out?");
        faults.push(match before {
            Some(before) => {
                let note = format!("the last block ends here, in line {}", line_number(bytes, before));
                fault.note(faults.span(before, before + 1), note)
            }
            None => fault.help("no block is open here"),
        });
    }
    found
}

fn line_number(bytes: &[u8], at: usize) -> usize {
    bytes[..at].iter().filter(|byte| **byte == b'\n').count() + 1
}

/// A `{` or `[` that waits for its partner.
struct Opener {
    at: usize,
    list: bool,
    line: usize,
    indent: usize,
    /// Indentation of the first line inside.
    inner: Option<usize>,
}

/// Bytes that mean nothing here, unless a line begins with them.
const PLAIN: [bool; 256] = {
    let mut plain = [true; 256];
    let mut i = 0;
    while i < SIGNS.len() {
        plain[SIGNS[i] as usize] = false;
        i += 1;
    }
    plain
};
/// Line breaks, braces, brackets, and what strings and comments begin with.
const SIGNS: &[u8] = b"\n{}[]#/\"\xC2\xE2";

fn walk(bytes: &[u8], by_layout: bool) -> Unmatched {
    let mut found = Unmatched::default();
    let mut stack: Vec<Opener> = Vec::new();
    let (mut line, mut indent, mut begins, mut word_line) = (0, 0, true, false);
    let mut closed = None;
    let mut pos = 0;
    while let Some(&byte) = bytes.get(pos) {
        match byte {
            b'\n' => (line, begins, pos) = (pos + 1, true, pos + 1),
            b' ' | b'\t' | b'\r' => pos += 1,
            _ if comment(bytes, pos) => pos = line_end(bytes, pos),
            _ => {
                let first = std::mem::take(&mut begins);
                if first {
                    (indent, word_line) = (pos - line, byte.is_ascii_alphabetic());
                    if by_layout {
                        leave_by_layout(&mut stack, &mut found, pos, line, indent, byte);
                    }
                    if let Some(top) = stack.last_mut().filter(|top| byte != b'}' && top.inner.is_none()) {
                        top.inner = Some(indent);
                    }
                }
                match byte {
                    b'{' => {
                        drop_lists(&mut stack, &mut found);
                        stack.push(Opener { at: pos, list: false, line, indent, inner: None });
                    }
                    b'}' => {
                        drop_lists(&mut stack, &mut found);
                        match stack.pop() {
                            Some(_) => closed = Some(pos),
                            None => found.stray.push((pos, closed)),
                        }
                    }
                    b'[' => {
                        if word_line && stack.last().is_some_and(|top| top.list && top.line != line) {
                            drop_lists(&mut stack, &mut found);
                        }
                        stack.push(Opener { at: pos, list: true, line, indent, inner: None });
                    }
                    b']' => {
                        stack.pop_if(|top| top.list);
                    }
                    _ => {}
                }
                pos = quoted(bytes, pos).map_or(pos + 1, |string| string.end.max(pos + 1));
                while bytes.get(pos).is_some_and(|byte| PLAIN[usize::from(*byte)]) {
                    pos += 1;
                }
            }
        }
    }
    drop_lists(&mut stack, &mut found);
    found.open.extend(stack.iter().filter(|top| !top.list).map(|top| (top.at, None)));
    found.open.sort_unstable();
    found.lists.extend(stack.iter().filter(|top| top.list).map(|top| top.at));
    found.lists.sort_unstable();
    found
}

/// The lists on top of the stack meet a brace or the end: they are never closed.
fn drop_lists(stack: &mut Vec<Opener>, found: &mut Unmatched) {
    while let Some(top) = stack.pop_if(|top| top.list) {
        found.lists.push(top.at);
    }
}

/// Ends the blocks that the line at `pos` has left by its indentation.
fn leave_by_layout(stack: &mut Vec<Opener>, found: &mut Unmatched, pos: usize, line: usize, indent: usize, byte: u8) {
    let mut ended = 0;
    while let Some(top) = stack.last().filter(|top| !top.list && top.line != line) {
        let left = match byte {
            b'}' => stack.len() > 1 && indent < top.indent,
            _ => {
                byte.is_ascii_alphabetic() && indent <= top.indent && top.inner.is_some_and(|inner| inner > top.indent)
            }
        };
        if !left {
            break;
        }
        found.open.push((top.at, Some(pos)));
        stack.pop();
        ended += 1;
    }
    if ended > 0 {
        found.implied.push((pos, ended));
    }
}
