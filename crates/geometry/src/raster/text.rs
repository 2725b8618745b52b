//! CSV and ESRI ASCII.

use super::{MOST_FAULTS, Raster, RasterError, RasterFault, RasterKind, RasterPlace, fits};
use glam::DVec2;
use sunglint_radiometry::{Dimension, unit};

pub(super) fn read(bytes: &[u8], kind: RasterKind) -> Result<Raster, RasterError> {
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let before = &bytes[..error.valid_up_to()];
        let line = before.iter().filter(|byte| **byte == b'\n').count() + 1;
        let column = before.iter().rev().take_while(|byte| **byte != b'\n').count() + 1;
        RasterFault::new("neither text nor a TIFF").at(line, column).help("a grid is CSV, ESRI ASCII or GeoTIFF")
    })?;
    let text = text.strip_prefix('\u{FEFF}').unwrap_or(text);
    let first = lines(text).next().ok_or_else(|| RasterFault::new("the file holds no rows"))?;
    let word = first.1.split_whitespace().next().unwrap_or_default();
    if HEADER.iter().any(|key| key.eq_ignore_ascii_case(word)) { esri(text, kind) } else { csv(text, first, kind) }
}

/// Lines that hold something, with their numbers from 1.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> + Clone {
    (text.lines().enumerate())
        .map(|(i, line)| (i + 1, line))
        .filter(|(_, line)| !line.trim_start().is_empty() && !line.trim_start().starts_with('#'))
}

/// Cells with their places, from 1.
fn cells(line: &str) -> impl Iterator<Item = (usize, &str)> {
    let commas = line.contains(',');
    let start = line.as_ptr() as usize;
    let place = move |cell: &str| 1 + line[..cell.as_ptr() as usize - start].chars().count();
    let by_comma = commas.then(|| line.split(',').map(str::trim));
    let by_blank = (!commas).then(|| line.split_whitespace());
    by_comma.into_iter().flatten().chain(by_blank.into_iter().flatten()).map(move |cell| (place(cell), cell))
}

/// A number, NaN where a cell says that there is none.
fn number(cell: &str, kind: RasterKind, hole: Option<f64>) -> Result<f64, String> {
    if cell.is_empty() || cell.eq_ignore_ascii_case("nan") {
        return Ok(f64::NAN);
    }
    let value: f64 = cell.parse().map_err(|_| format!("`{}` is no number", shown(cell)))?;
    if hole == Some(value) {
        return Ok(f64::NAN);
    }
    if !value.is_finite() {
        return Err(format!("`{cell}` is not a finite number"));
    }
    kind.refuse(value).map_or(Ok(value), Err)
}

fn shown(cell: &str) -> String {
    if cell.chars().count() > 24 { cell.chars().take(24).chain(['…']).collect() } else { cell.to_string() }
}

fn csv(text: &str, (line, first): (usize, &str), kind: RasterKind) -> Result<Raster, RasterError> {
    if !first.contains(',') && first.contains(';') {
        return Err(RasterFault::new("the columns are not parted by commas")
            .at(line, 1 + first.find(';').unwrap_or(0))
            .into());
    }
    let named = |cell: &str| !cell.is_empty() && cell.parse::<f64>().is_err();
    if cells(first).all(|(_, cell)| named(cell)) {
        return points(text, kind);
    }
    let (mut columns, mut values, mut rows) = (0, Vec::new(), 0);
    let mut faults: Vec<RasterFault> = Vec::new();
    for (line, row) in lines(text) {
        let before = values.len();
        for (column, cell) in cells(row) {
            match number(cell, kind, None) {
                Ok(value) => values.push(value),
                Err(message) => {
                    values.push(f64::NAN);
                    faults.push(RasterFault::new(message).at(line, column));
                }
            }
        }
        let found = values.len() - before;
        rows += 1;
        if rows == 1 {
            columns = found;
        } else if found != columns {
            let fault = RasterFault::new(format!("this row has {found} values, the first has {columns}"));
            faults.push(fault.at(line, row.chars().count()));
        }
        if faults.len() >= MOST_FAULTS {
            faults.truncate(MOST_FAULTS);
            return Err(RasterError::Malformed(faults));
        }
        fits(columns as u64, rows)?;
    }
    if !faults.is_empty() {
        return Err(RasterError::Malformed(faults));
    }
    Ok(Raster { columns, rows: rows as usize, values, place: None })
}

/// Columns x, y and the value.
fn points(text: &str, kind: RasterKind) -> Result<Raster, RasterError> {
    let (name, due) = match kind {
        RasterKind::Heights => ("z", "x_m, y_m and z_m"),
        RasterKind::Classes => ("class", "x_m, y_m and class"),
    };
    let mut rest = lines(text);
    let Some((line, header)) = rest.next() else { return Err(RasterFault::new("the file holds no rows").into()) };
    let header: Vec<&str> = cells(header).map(|(_, cell)| cell).collect();
    let find = |name: &str| {
        let scale = |cell: &str| match cell.strip_prefix(name)?.strip_prefix('_') {
            Some(end) => unit(end, Dimension::Length).map(|unit| unit.factor),
            None => (cell == "class").then_some(1.0),
        };
        let found: Vec<(usize, f64)> =
            header.iter().enumerate().filter_map(|(i, cell)| Some((i, scale(cell)?))).collect();
        match found[..] {
            [one] => Ok(one),
            _ => {
                let what = if found.is_empty() { "no" } else { "more than one" };
                let wanted = if name == "class" { "class".to_string() } else { format!("{name}_m") };
                let fault = RasterFault::new(format!("there is {what} column `{wanted}`")).at(line, 1);
                let there: Vec<String> = header.iter().take(20).map(|name| format!("`{}`", shown(name))).collect();
                let help = format!("a grid is rows of numbers, or columns {due}; this has {}", there.join(", "));
                Err(RasterError::from(RasterFault { columns: true, ..fault.help(help) }))
            }
        }
    };
    let places = [find("x")?, find("y")?, find(name)?];
    let mut points: Vec<[f64; 3]> = Vec::new();
    let mut where_read: Vec<u32> = Vec::new();
    let mut faults = Vec::new();
    let mut row: Vec<(usize, &str)> = Vec::with_capacity(header.len());
    for (line, text) in rest {
        row.clear();
        row.extend(cells(text));
        if row.len() != header.len() {
            let message = format!("this row has {} values for {} columns", row.len(), header.len());
            faults.push(RasterFault::new(message).at(line, text.chars().count()));
        } else {
            let mut point = [0.0; 3];
            for (i, (slot, &(at, scale))) in point.iter_mut().zip(&places).enumerate() {
                let (column, cell) = row[at];
                let value = match i {
                    2 => number(cell, kind, None).map(|value| value * scale),
                    _ => match cell.parse::<f64>() {
                        Ok(value) if value.is_finite() && value.abs() <= 1e9 => Ok(value * scale),
                        Ok(_) => Err(format!("`{}` is beyond ±1e9", shown(cell))),
                        Err(_) => Err(format!("`{}` is no number", shown(cell))),
                    },
                };
                match value {
                    Ok(value) => *slot = value,
                    Err(message) => faults.push(RasterFault::new(message).at(line, column)),
                }
            }
            points.push(point);
            where_read.push(line as u32);
        }
        if faults.len() >= MOST_FAULTS {
            faults.truncate(MOST_FAULTS);
            return Err(RasterError::Malformed(faults));
        }
        fits(points.len() as u64, 1)?;
    }
    if !faults.is_empty() {
        return Err(RasterError::Malformed(faults));
    }
    let axis = |a: usize| axis(points.iter().map(|point| point[a]).collect(), ["x", "y"][a]);
    let (x, y) = (axis(0)?, axis(1)?);
    fits(x.count as u64, y.count as u64)?;
    let mut values = vec![f64::NAN; x.count * y.count];
    let mut first = vec![0_u32; values.len()];
    for (point, &line) in points.iter().zip(&where_read) {
        let (column, row) = (x.index(point[0]), y.index(point[1]));
        let (Some(column), Some(row)) = (column, row) else {
            let message = format!("the point ({} {}) lies off the regular grid of the others", point[0], point[1]);
            faults.push(RasterFault::new(message).at(line as usize, 1));
            if faults.len() == MOST_FAULTS {
                break;
            }
            continue;
        };
        let at = (y.count - 1 - row) * x.count + column;
        if first[at] > 0 {
            let message = format!("this point stands twice, first in line {}", first[at]);
            faults.push(RasterFault::new(message).at(line as usize, 1));
            if faults.len() == MOST_FAULTS {
                break;
            }
        }
        (first[at], values[at]) = (line, point[2]);
    }
    if !faults.is_empty() {
        return Err(RasterError::Malformed(faults));
    }
    let place = RasterPlace { south_west: DVec2::new(x.low, y.low), spacing: DVec2::new(x.step, y.step) };
    Ok(Raster { columns: x.count, rows: y.count, values, place: Some(place) })
}

struct Axis {
    low: f64,
    step: f64,
    count: usize,
}

impl Axis {
    /// Which post a coordinate is, to a fiftieth of the step.
    fn index(&self, value: f64) -> Option<usize> {
        let at = (value - self.low) / self.step;
        let near = at.round();
        ((at - near).abs() <= 0.02 && near >= 0.0 && near < self.count as f64).then_some(near as usize)
    }
}

/// The regular steps that coordinates make: their smallest gap, of which all are multiples.
fn axis(mut values: Vec<f64>, name: &str) -> Result<Axis, RasterFault> {
    values.sort_by(f64::total_cmp);
    let (Some(&low), Some(&high)) = (values.first(), values.last()) else {
        return Err(RasterFault::new("the table has no rows"));
    };
    let noise = 1e-6 * (high - low);
    let gap = values.windows(2).map(|w| w[1] - w[0]).filter(|gap| *gap > noise).fold(f64::INFINITY, f64::min);
    if !gap.is_finite() {
        return Err(RasterFault::new(format!("all points have one {name}: a grid has two posts at least each way")));
    }
    let steps = ((high - low) / gap).round();
    Ok(Axis { low, step: (high - low) / steps, count: steps as usize + 1 })
}

const HEADER: [&str; 10] =
    ["ncols", "nrows", "xllcorner", "xllcenter", "yllcorner", "yllcenter", "cellsize", "dx", "dy", "nodata_value"];

fn esri(text: &str, kind: RasterKind) -> Result<Raster, RasterError> {
    let mut said: [Option<f64>; HEADER.len()] = [None; HEADER.len()];
    let mut said_in = [None; HEADER.len()];
    let mut faults = Vec::new();
    let mut body = lines(text).peekable();
    while let Some(&(line, row)) = body.peek() {
        let mut words = row.split_whitespace();
        let Some(word) = words.next() else { break };
        if word.parse::<f64>().is_ok() || word.starts_with('*') {
            break;
        }
        body.next();
        let Some(key) = HEADER.iter().position(|key| key.eq_ignore_ascii_case(word)) else {
            let fault = RasterFault::new(format!("`{}` is no line of the header", shown(word))).at(line, 1);
            return Err(fault.help(format!("known: {}", HEADER.join(", "))).into());
        };
        said_in[key] = Some(line);
        let column = 1 + row.find(word).unwrap_or(0) + word.len() + 1;
        match (words.next().map(str::parse::<f64>), words.next()) {
            (Some(Ok(value)), None) if value.is_finite() || (key == 9 && value.is_nan()) => {
                if said[key].replace(value).is_some() {
                    faults.push(RasterFault::new(format!("`{}` is said twice", HEADER[key])).at(line, 1));
                }
            }
            _ => faults.push(RasterFault::new(format!("`{}` takes one number", HEADER[key])).at(line, column)),
        }
    }
    let begins = body.peek().map_or(text.lines().count(), |(line, _)| *line);
    let [ncols, nrows, x_corner, x_centre, y_corner, y_centre, cell, dx, dy, hole] = said;
    // What is wrong in a line stands there, what is missing behind the header.
    let line_of = |name: &str| HEADER.iter().position(|key| *key == name).and_then(|key| said_in[key]);
    let mut refuse = |name: &str, message: String| {
        faults.push(RasterFault::new(message).at(line_of(name).unwrap_or(begins), 1));
    };
    for (name, value) in [("ncols", ncols), ("nrows", nrows)] {
        match value {
            Some(value) if value.fract() == 0.0 && (1.0..=1e15).contains(&value) => {}
            Some(value) => refuse(name, format!("`{name}` is a whole number from 1 up; {value} is not")),
            None if line_of(name).is_some() => {}
            None => refuse(name, format!("the header lacks `{name}`")),
        }
    }
    let (dx, dy) =
        (dx.map_or(("cellsize", cell), |dx| ("dx", Some(dx))), dy.map_or(("cellsize", cell), |dy| ("dy", Some(dy))));
    for (i, (name, step)) in [dx, dy].into_iter().enumerate().filter(|(i, _)| *i == 0 || dx.0 != dy.0) {
        match step {
            Some(step) if step > 0.0 && step <= 1e9 => {}
            Some(step) => refuse(name, format!("`{name}` is above 0; {step} is not")),
            None if line_of(name).is_some() => {}
            None => refuse(name, format!("the header lacks `cellsize`{}", if i == 0 { "" } else { " or `dy`" })),
        }
    }
    // A cell is named by its corner or by its middle, where the post stands.
    for (name, corner, centre) in [("xll", x_corner, x_centre), ("yll", y_corner, y_centre)] {
        match (corner, centre) {
            (Some(_), Some(_)) => {
                refuse(&format!("{name}center"), format!("both `{name}corner` and `{name}center` are said"));
            }
            (None, None) if ["corner", "center"].iter().any(|end| line_of(&format!("{name}{end}")).is_some()) => {}
            (None, None) => refuse("", format!("the header lacks `{name}corner` or `{name}center`")),
            _ => {}
        }
    }
    let low = |corner: Option<f64>, centre: Option<f64>, step: f64| centre.or(corner.map(|corner| corner + 0.5 * step));
    let (true, Some(columns), Some(rows), Some(dx), Some(dy)) = (faults.is_empty(), ncols, nrows, dx.1, dy.1) else {
        return Err(RasterError::Malformed(faults));
    };
    let (Some(x), Some(y)) = (low(x_corner, x_centre, dx), low(y_corner, y_centre, dy)) else {
        return Err(RasterError::Malformed(faults));
    };
    let (columns, rows) = (columns as u64, rows as u64);
    fits(columns, rows)?;

    // A row a line, or values that flow on over lines of any length.
    let row_lines = body.clone().count() as u64;
    let by_rows = row_lines == rows;
    let due = (columns * rows) as usize;
    let mut values = Vec::with_capacity(due.min(text.len() / 2 + 1));
    for (line, row) in body {
        let before = values.len();
        for (column, cell) in cells(row) {
            match number(cell, kind, hole) {
                Ok(value) => values.push(value),
                Err(message) => {
                    values.push(f64::NAN);
                    faults.push(RasterFault::new(message).at(line, column));
                }
            }
        }
        let found = (values.len() - before) as u64;
        if by_rows && found != columns {
            let fault = RasterFault::new(format!("this row has {found} values, `ncols` says {columns}"));
            faults.push(fault.at(line, row.chars().count()));
        }
        if faults.len() >= MOST_FAULTS || (values.len() > due && !by_rows) {
            break;
        }
    }
    if faults.is_empty() && values.len() != due {
        let what =
            if values.len() > due { "more values than".to_string() } else { format!("{} values, but", values.len()) };
        let line = text.lines().count();
        let message = format!("the file holds {what} {columns} x {rows} = {due}");
        faults.push(RasterFault::new(message).at(line, 1));
    }
    if !faults.is_empty() {
        faults.truncate(MOST_FAULTS);
        return Err(RasterError::Malformed(faults));
    }
    let place = RasterPlace { south_west: DVec2::new(x, y), spacing: DVec2::new(dx, dy) };
    Ok(Raster { columns: columns as usize, rows: rows as usize, values, place: Some(place) })
}
