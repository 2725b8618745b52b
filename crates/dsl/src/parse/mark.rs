//! Strings, comments and numbers in raw text, as bytes: shared by the pairing of braces and by the scanner, so that
//! both agree on what is quoted.

use super::spelling::ascii;

/// A string that begins at some place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Quoted {
    /// First byte behind the opening quote.
    pub from: usize,
    /// The closing quote, or where the text of a string without one ends.
    pub to: usize,
    /// One past the string.
    pub end: usize,
    /// Whether it has a closing quote.
    pub closed: bool,
    /// Whether its quotes are `"`.
    pub straight: bool,
}

/// The string that begins at `at`, if one does. One that is open ends with its line, before braces that end the line
/// and before a comment.
pub(crate) fn quoted(bytes: &[u8], at: usize) -> Option<Quoted> {
    let from = at + quote_len(bytes, at)?;
    let straight = bytes[at] == b'"';
    let mut pos = from;
    while let Some(&byte) = bytes.get(pos) {
        match byte {
            b'\n' => break,
            b'\\' if bytes.get(pos + 1).is_some_and(|next| *next != b'\n') => pos += 2,
            b'"' => return Some(Quoted { from, to: pos, end: pos + 1, closed: true, straight }),
            _ if !straight && quote_len(bytes, pos).is_some() => {
                let end = pos + quote_len(bytes, pos).unwrap_or(1);
                return Some(Quoted { from, to: pos, end, closed: true, straight });
            }
            _ => pos += 1,
        }
    }
    let line = &bytes[from..pos.min(bytes.len())];
    let comment = line.windows(2).position(|pair| matches!(pair, b" #" | b"\t#"));
    let line = line[..comment.unwrap_or(line.len())].trim_ascii_end();
    let bare = line.len() - line.iter().rev().take_while(|byte| matches!(byte, b'{' | b'}' | b' ' | b'\t')).count();
    let to = from + line[..bare].trim_ascii_end().len();
    Some(Quoted { from, to, end: to, closed: false, straight })
}

/// Length of the double quote at `at`, straight or curly.
fn quote_len(bytes: &[u8], at: usize) -> Option<usize> {
    match bytes.get(at..)? {
        [b'"', ..] => Some(1),
        [0xE2, 0x80, 0x9C..=0x9F, ..] => Some(3),
        [0xC2, 0xAB | 0xBB, ..] => Some(2),
        _ => None,
    }
}

/// Whether a comment begins at `at`: `#`, or one of another language (`//`, `/*`), which is a fault.
pub(super) fn comment(bytes: &[u8], at: usize) -> bool {
    bytes.get(at) == Some(&b'#') || foreign_comment(bytes, at)
}

/// Whether a comment of another language begins at `at`.
pub(super) fn foreign_comment(bytes: &[u8], at: usize) -> bool {
    matches!(bytes.get(at..), Some([b'/', b'/' | b'*', ..]))
        && (at == 0 || matches!(bytes[at - 1], b' ' | b'\t' | b'\r' | b'\n' | b',' | b'{' | b'}'))
}

/// The line break that ends the line of `at`, or the end of the text.
pub(crate) fn line_end(bytes: &[u8], at: usize) -> usize {
    bytes[at..].iter().position(|byte| *byte == b'\n').map_or(bytes.len(), |i| at + i)
}

/// End of the number that begins at `at`: sign, digits, point between digits, exponent.
pub(crate) fn number_end(bytes: &[u8], at: usize) -> Option<usize> {
    let digits = |from: usize| from + bytes[from..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let sign = |at: usize| at + usize::from(matches!(bytes.get(at), Some(b'+' | b'-')));
    let whole = sign(at);
    let mut end = digits(whole);
    if end == whole {
        return None;
    }
    if bytes.get(end) == Some(&b'.') && digits(end + 1) > end + 1 {
        end = digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let exponent = sign(end + 1);
        if digits(exponent.min(bytes.len())) > exponent {
            end = digits(exponent);
        }
    }
    Some(end)
}

/// The number that begins at `at`, and its end: the same number as [`str::parse`] reads there, infinite beyond an `f64`.
///
/// Up to 2⁵³ and 10²², whole part and power of ten are exact, so that their quotient is the nearest number [Clinger1990].
pub(super) fn number_at(text: &str, at: usize) -> Option<(f64, usize)> {
    const POWERS: [f64; 23] = [
        1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19,
        1e20, 1e21, 1e22,
    ];
    let bytes = text.as_bytes();
    let from = at + usize::from(matches!(bytes.get(at), Some(b'+' | b'-')));
    let (mut pos, mut whole) = (from, 0u64);
    while let Some(digit) = bytes.get(pos).map(|byte| byte.wrapping_sub(b'0')).filter(|digit| *digit < 10) {
        whole = whole.wrapping_mul(10).wrapping_add(u64::from(digit));
        pos += 1;
    }
    let mut digits = pos - from;
    if digits == 0 {
        return None;
    }
    let mut power = 0;
    if bytes.get(pos) == Some(&b'.') && bytes.get(pos + 1).is_some_and(u8::is_ascii_digit) {
        let point = pos + 1;
        pos = point;
        while let Some(digit) = bytes.get(pos).map(|byte| byte.wrapping_sub(b'0')).filter(|digit| *digit < 10) {
            whole = whole.wrapping_mul(10).wrapping_add(u64::from(digit));
            pos += 1;
        }
        power = pos - point;
        digits += power;
    }
    if digits <= 19 && whole <= 1 << 53 && power < POWERS.len() && !matches!(bytes.get(pos), Some(b'e' | b'E')) {
        let value = whole as f64 / POWERS[power];
        return Some((if bytes[at] == b'-' { -value } else { value }, pos));
    }
    let end = number_end(bytes, at)?;
    Some((text[at..end].parse().ok()?, end))
}

/// Whether a value begins at `at`, with which a line continues the statement above.
pub(crate) fn value_at(text: &str, at: usize) -> bool {
    match text.as_bytes().get(at..) {
        Some([b'(' | b'[' | b'"' | b'0'..=b'9', ..]) => true,
        Some([b'+' | b'-', b'0'..=b'9', ..] | [b'.', b'0'..=b'9', ..] | [b'+' | b'-', b'.', b'0'..=b'9', ..]) => true,
        Some([byte, ..]) if *byte >= 0x80 => {
            let mut rest = text[at..].chars();
            match rest.next().and_then(ascii) {
                Some("\"") => true,
                Some("-") => rest.next().is_some_and(|next| next.is_ascii_digit()),
                _ => false,
            }
        }
        _ => false,
    }
}

/// The first byte from `pos` on that is no blank and in no comment.
pub(crate) fn significant(bytes: &[u8], mut pos: usize) -> usize {
    while let Some(&byte) = bytes.get(pos) {
        match byte {
            b' ' | b'\t' | b'\r' | b'\n' => pos += 1,
            b'#' => pos = line_end(bytes, pos),
            _ => break,
        }
    }
    pos
}

/// The number that `text` is, if it is one; infinite where it is beyond an `f64`.
pub(super) fn number(text: &str) -> Option<f64> {
    (number_end(text.as_bytes(), 0) == Some(text.len())).then(|| text.parse().ok()).flatten()
}
