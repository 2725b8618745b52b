//! The embedded typeface: widths, kerning and outlines. `font/README.md` says what it is.

use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, OutlineCurve, Point};

static FACE: LazyLock<FontRef<'static>> = LazyLock::new(|| {
    FontRef::try_from_slice(include_bytes!("font/DejaVuSans-subset.ttf")).expect("the embedded font is whole")
});

/// The families that an SVG reader may take, the embedded one first.
pub(super) const FAMILIES: &str = "DejaVu Sans, Verdana, Arial, sans-serif";

/// A run of text of one size and height.
pub(super) struct Run<'t> {
    pub text: &'t str,
    /// Size and drop below the line, in sizes of the whole text.
    pub size: f64,
    pub drop: f64,
}

/// Splits text at its subscripts, `R_{d}`.
pub(super) fn runs(text: &str) -> Vec<Run<'_>> {
    let mut runs = Vec::new();
    let mut rest = text;
    while let Some((before, inside, after)) = rest
        .split_once("_{")
        .and_then(|(before, tail)| tail.split_once('}').map(|(inside, after)| (before, inside, after)))
    {
        runs.push(Run { text: before, size: 1.0, drop: 0.0 });
        runs.push(Run { text: inside, size: 0.72, drop: 0.2 });
        rest = after;
    }
    runs.push(Run { text: rest, size: 1.0, drop: 0.0 });
    runs.retain(|run| !run.text.is_empty());
    runs
}

/// Width of a text at a size, in the units of the size.
pub(super) fn width(text: &str, size: f64) -> f64 {
    runs(text).iter().map(|run| run_width(run.text) * run.size * size).sum()
}

fn run_width(text: &str) -> f64 {
    let mut width = 0.0;
    letters(text, |_, at, advance| width = at + advance);
    width
}

/// Calls `visit` with each glyph, its place and its advance, in sizes.
fn letters(text: &str, mut visit: impl FnMut(ab_glyph::GlyphId, f64, f64)) {
    let scale = 1.0 / f64::from(FACE.units_per_em().unwrap_or(2048.0));
    let mut at = 0.0;
    let mut last = None;
    for letter in text.chars() {
        let glyph = FACE.glyph_id(letter);
        if let Some(last) = last {
            at += f64::from(FACE.kern_unscaled(last, glyph)) * scale;
        }
        let advance = f64::from(FACE.h_advance_unscaled(glyph)) * scale;
        visit(glyph, at, advance);
        at += advance;
        last = Some(glyph);
    }
}

/// Hands every curve of a text that begins at (0, 0) to `visit`, x right and y down, at a size.
pub(super) fn outline(text: &str, size: f64, mut visit: impl FnMut(OutlineCurve)) {
    let em = f64::from(FACE.units_per_em().unwrap_or(2048.0));
    let mut start = 0.0;
    for run in runs(text) {
        let size = size * run.size;
        let drop = size / run.size * run.drop;
        letters(run.text, |glyph, at, _| {
            let Some(outline) = FACE.outline(glyph) else { return };
            let place = |p: Point| Point {
                x: (start + size * (at + f64::from(p.x) / em)) as f32,
                y: (drop - size * f64::from(p.y) / em) as f32,
            };
            for curve in outline.curves {
                visit(match curve {
                    OutlineCurve::Line(a, b) => OutlineCurve::Line(place(a), place(b)),
                    OutlineCurve::Quad(a, b, c) => OutlineCurve::Quad(place(a), place(b), place(c)),
                    OutlineCurve::Cubic(a, b, c, d) => OutlineCurve::Cubic(place(a), place(b), place(c), place(d)),
                });
            }
        });
        start += size * run_width(run.text);
    }
}

/// Breaks text at blanks into lines no wider than `most`, where a word allows it.
pub(super) fn lines(text: &str, size: f64, most: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if width(line, size) + width(word, size) + 0.3 * size <= most => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_string()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Letters of units, angles and transmittances: none may be drawn as the empty box.
    #[test]
    fn every_letter_of_a_radiance_has_a_glyph() {
        for letter in "W m⁻² sr⁻¹ µm⁻¹ λ θ φ ρ τ₁ τ₂ Ωₛ 0.55 µm ° · × ± − ⟨⟩ABCabc10³⁴⁵⁶⁷⁸⁹⁰"
            .chars()
            .filter(|c| !"⟨⟩".contains(*c))
        {
            assert_ne!(FACE.glyph_id(letter).0, 0, "{letter}");
        }
    }

    #[test]
    fn a_subscript_is_narrower_than_its_letter() {
        assert!(width("R_{d}", 10.0) < width("Rd", 10.0));
        assert_eq!(width("no_markup", 10.0), run_width("no_markup") * 10.0);
        assert_eq!(runs("a_{b").len(), 1);
    }
}
