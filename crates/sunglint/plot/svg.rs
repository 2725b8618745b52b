//! A picture as SVG.

use std::fmt::Write;

use super::colour::Colour;
use super::picture::{Anchor, Mark, Picture, Pixels, Point, Rect, Stroke};
use super::{raster, typeface};

pub(super) fn write(picture: &Picture) -> String {
    let (width, height) = picture.size();
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"{}\" role=\"img\">\n<title>{}</title>\n<rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n",
        typeface::FAMILIES,
        escaped(&plain(&picture.title)),
    );
    let mut within: Option<Rect> = None;
    let mut clips: Vec<Rect> = Vec::new();
    for (mark, clip) in &picture.marks {
        if *clip != within {
            if within.is_some() {
                out.push_str("</g>\n");
            }
            if let Some(rect) = clip {
                let known = clips.iter().position(|known| known == rect);
                let id = known.unwrap_or_else(|| {
                    clips.push(*rect);
                    let _ = writeln!(out, "<clipPath id=\"c{}\"><rect {}/></clipPath>", clips.len() - 1, frame(rect));
                    clips.len() - 1
                });
                let _ = writeln!(out, "<g clip-path=\"url(#c{id})\">");
            }
            within = *clip;
        }
        draw(&mut out, mark);
    }
    if within.is_some() {
        out.push_str("</g>\n");
    }
    out.push_str("</svg>\n");
    out
}

fn draw(out: &mut String, mark: &Mark) {
    let _ = match mark {
        Mark::Line { points, stroke } => writeln!(
            out,
            "<polyline points=\"{}\" fill=\"none\" {} stroke-linejoin=\"round\"/>",
            list(points),
            pen(stroke)
        ),
        Mark::Area { points, colour, opacity } => {
            writeln!(out, "<polygon points=\"{}\" fill=\"{}\"{}/>", list(points), hex(*colour), seen(*opacity))
        }
        Mark::Disk { centre, radius, colour, opacity } => writeln!(
            out,
            "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{}\"{}/>",
            number(centre.0),
            number(centre.1),
            number(*radius),
            hex(*colour),
            seen(*opacity)
        ),
        Mark::Text { at, text, size, anchor, turned, colour } => {
            let anchor = match anchor {
                Anchor::Start => "",
                Anchor::Middle => " text-anchor=\"middle\"",
                Anchor::End => " text-anchor=\"end\"",
            };
            let (x, y) = (number(at.0), number(at.1));
            let turn = if *turned { format!(" transform=\"rotate(-90 {x} {y})\"") } else { String::new() };
            let fill =
                if *colour == super::colour::BLACK { String::new() } else { format!(" fill=\"{}\"", hex(*colour)) };
            writeln!(
                out,
                "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\"{anchor}{turn}{fill}>{}</text>",
                number(*size),
                spans(text, *size)
            )
        }
        Mark::Image { place, pixels } => image(out, place, pixels),
    };
}

fn image(out: &mut String, place: &Rect, pixels: &Pixels) -> std::fmt::Result {
    // Writing into memory does not fail.
    let png = raster::encode(pixels, None).unwrap_or_default();
    let style = if pixels.sharp { " style=\"image-rendering:pixelated\"" } else { "" };
    writeln!(
        out,
        "<image {} preserveAspectRatio=\"none\"{style} href=\"data:image/png;base64,{}\"/>",
        frame(place),
        base64(&png)
    )
}

fn frame(rect: &Rect) -> String {
    let [x, y, w, h] = [rect.left, rect.top, rect.width(), rect.height()].map(number);
    format!("x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\"")
}

fn pen(stroke: &Stroke) -> String {
    let dashes = match stroke.dashes {
        [] => String::new(),
        dashes => format!(" stroke-dasharray=\"{}\"", dashes.iter().map(|d| number(*d)).collect::<Vec<_>>().join(" ")),
    };
    format!("stroke=\"{}\" stroke-width=\"{}\"{dashes}", hex(stroke.colour), number(stroke.width))
}

fn seen(opacity: f64) -> String {
    if opacity < 1.0 { format!(" fill-opacity=\"{}\"", number(opacity)) } else { String::new() }
}

fn hex(colour: Colour) -> String {
    format!("#{:02x}{:02x}{:02x}", colour[0], colour[1], colour[2])
}

/// A coordinate to a hundredth.
fn number(x: f64) -> String {
    let text = format!("{x:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

fn list(points: &[Point]) -> String {
    points.iter().map(|(x, y)| format!("{},{}", number(*x), number(*y))).collect::<Vec<_>>().join(" ")
}

/// Text with its subscripts as spans that go down and up again.
fn spans(text: &str, size: f64) -> String {
    let mut out = String::new();
    let mut below = 0.0;
    for run in typeface::runs(text) {
        let shift = run.drop - below;
        if run.size == 1.0 && shift == 0.0 {
            out.push_str(&escaped(run.text));
        } else {
            let _ = write!(
                out,
                "<tspan dy=\"{}\" font-size=\"{}\">{}</tspan>",
                number(shift * size),
                number(run.size * size),
                escaped(run.text)
            );
        }
        below = run.drop;
    }
    out
}

/// Text without its markup.
fn plain(text: &str) -> String {
    typeface::runs(text).iter().map(|run| run.text).collect()
}

/// For XML; what no XML may hold is left out.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\u{0}'..='\u{8}' | '\u{b}' | '\u{c}' | '\u{e}'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => {}
            c => out.push(c),
        }
    }
    out
}

/// [RFC 4648], section 4.
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let bits = (0..3).fold(0u32, |bits, i| bits << 8 | u32::from(three.get(i).copied().unwrap_or(0)));
        for i in 0..4 {
            let letter = LETTERS[(bits >> (18 - 6 * i) & 63) as usize] as char;
            out.push(if i <= three.len() { letter } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The test vectors of RFC 4648, section 10.
    #[test]
    fn base64_is_that_of_the_rfc() {
        for (plain, coded) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }

    #[test]
    fn marked_up_text_stays_text() {
        assert_eq!(
            spans("R_{d} < 1", 10.0),
            "R<tspan dy=\"2\" font-size=\"7.2\">d</tspan><tspan dy=\"-2\" font-size=\"10\"> &lt; 1</tspan>"
        );
        assert_eq!(number(-0.001), "0");
    }
}
