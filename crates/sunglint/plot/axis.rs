//! Axes: ranges, ticks and how numbers are written on them.

/// How values are laid along an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// Evenly.
    #[default]
    Linear,
    /// By their logarithm; values that are not above zero are left out.
    Log,
}

/// What an axis or a colour bar shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Axis {
    /// The quantity.
    pub label: String,
    /// Its unit; empty or `1` where it has none.
    pub unit: String,
    /// From where to where; round numbers about the data where unsaid.
    pub range: Option<(f64, f64)>,
    /// Linear or logarithmic.
    pub scale: Scale,
}

impl Axis {
    /// A linear axis about the data.
    pub fn new(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { label: label.into(), unit: unit.into(), ..Self::default() }
    }

    /// Over a given range.
    #[must_use]
    pub fn within(mut self, low: f64, high: f64) -> Self {
        self.range = Some((low, high));
        self
    }

    /// Logarithmic.
    #[must_use]
    pub fn log(mut self) -> Self {
        self.scale = Scale::Log;
        self
    }

    /// The label with its unit.
    pub(super) fn caption(&self) -> String {
        match self.unit.as_str() {
            "" | "1" => self.label.clone(),
            unit => format!("{} [{unit}]", self.label),
        }
    }

    /// The range and its ticks for data; about `wanted` ticks.
    pub(super) fn fit(&self, values: impl Iterator<Item = f64>, wanted: usize) -> Fitted {
        let log = self.scale == Scale::Log;
        let fits = |v: &f64| v.is_finite() && v.abs() < 1e300 && (!log || *v > 1e-300);
        let given = self.range.filter(|(a, b)| fits(a) && fits(b) && a != b);
        let (low, high) = match given {
            Some((a, b)) => (a.min(b), a.max(b)),
            None => values.filter(fits).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v))),
        };
        let (mut low, mut high) = match (low <= high, log) {
            (true, _) => (low, high),
            (false, true) => (0.1, 1.0),
            (false, false) => (0.0, 1.0),
        };
        if log {
            return logarithmic(low, high, given.is_some());
        }
        if high - low <= 1e-12 * low.abs().max(high.abs()) {
            let reach = if low == 0.0 { 1.0 } else { 0.1 * low.abs() };
            (low, high) = (low - reach, high + reach);
        }
        let step = match (high - low) / wanted as f64 {
            step if self.unit == "°" && (1.0..=90.0).contains(&step) => {
                DEGREES.into_iter().find(|d| step <= *d).unwrap_or(90.0)
            }
            step => round_step(step),
        };
        if given.is_none() {
            // A data range that begins near zero begins at zero.
            if low > 0.0 && low < 0.25 * high {
                low = 0.0;
            }
            let half = 0.5 * step;
            (low, high) = ((low / half + 1e-9).floor() * half, (high / half - 1e-9).ceil() * half);
        }
        let first = (low / step - 1e-6).ceil() as i64;
        let last = (high / step + 1e-6).floor() as i64;
        let largest = low.abs().max(high.abs());
        let power = if (1e-3..1e5).contains(&largest) { 0 } else { largest.log10().floor() as i32 };
        let unit = 10f64.powi(power);
        let decimals = (-(step / unit * 1.0001).log10().floor()).clamp(0.0, 12.0) as usize;
        let decimals = decimals
            + usize::from(((step / unit) * 10f64.powi(decimals as i32)).fract().abs() > 1e-6 && step < unit * 10.0);
        let ticks = (first..=last.min(first + 100))
            .map(|i| (i as f64 * step, minus(&format!("{:.decimals$}", i as f64 * step / unit))))
            .collect();
        Fitted { low, high, log: false, ticks, power }
    }
}

/// An axis with its numbers.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fitted {
    pub low: f64,
    pub high: f64,
    log: bool,
    /// Where, and what is written there (empty: a mark only).
    pub ticks: Vec<(f64, String)>,
    /// The written numbers are to be multiplied by this power of ten.
    pub power: i32,
}

impl Fitted {
    /// Place of a value, 0 at the low end and 1 at the high one.
    pub fn share(&self, value: f64) -> f64 {
        match self.log {
            true => (value.ln() - self.low.ln()) / (self.high.ln() - self.low.ln()),
            false => (value - self.low) / (self.high - self.low),
        }
    }

    /// `×10⁻⁴`, where the written numbers want it.
    pub fn factor(&self) -> Option<String> {
        (self.power != 0).then(|| format!("×10{}", superscript(self.power)))
    }
}

fn logarithmic(low: f64, high: f64, given: bool) -> Fitted {
    let (mut first, mut last) = ((low.log10() + 1e-9).floor() as i32, (high.log10() - 1e-9).ceil() as i32);
    last = last.max(first + 1);
    let (low, high) = if given { (low, high) } else { (10f64.powi(first), 10f64.powi(last)) };
    (first, last) = (first - 1, last + 1);
    let mut ticks = Vec::new();
    let stride = ((last - first) / 8).max(1);
    for power in first..=last {
        for lead in 1..10 {
            let value = f64::from(lead) * 10f64.powi(power);
            if value < low * (1.0 - 1e-9) || value > high * (1.0 + 1e-9) {
                continue;
            }
            let named = match last - first - 2 {
                0 | 1 => matches!(lead, 1 | 2 | 5),
                _ => lead == 1 && (power - first) % stride == 0,
            };
            let text = match (named, power) {
                (false, _) => String::new(),
                (true, -3..=4) => format!("{:.*}", (-power).max(0) as usize, value),
                (true, _) if lead == 1 => format!("10{}", superscript(power)),
                (true, _) => format!("{lead}×10{}", superscript(power)),
            };
            if lead == 1 || stride == 1 {
                ticks.push((value, text));
            }
        }
    }
    Fitted { low, high, log: true, ticks, power: 0 }
}

/// Steps of angles.
const DEGREES: [f64; 8] = [1.0, 2.0, 5.0, 15.0, 30.0, 45.0, 60.0, 90.0];

/// The next of 1, 2, 2.5, 5 times a power of ten.
fn round_step(step: f64) -> f64 {
    let power = 10f64.powf(step.log10().floor());
    let lead = step / power;
    let round = [1.0, 2.0, 2.5, 5.0].into_iter().find(|r| lead <= r * (1.0 + 1e-9)).unwrap_or(10.0);
    round * power
}

/// A number with a true minus, and no minus before zero.
fn minus(text: &str) -> String {
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| matches!(c, '0' | '.')) => rest.to_string(),
        Some(rest) => format!("−{rest}"),
        None => text.to_string(),
    }
}

fn superscript(power: i32) -> String {
    let digit = |c: char| match c {
        '-' => '⁻',
        c => "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(c as usize - '0' as usize).unwrap_or('⁰'),
    };
    power.to_string().chars().map(digit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(axis: &Axis, values: &[f64]) -> Vec<String> {
        let fitted = axis.fit(values.iter().copied(), 5);
        fitted.ticks.into_iter().map(|(_, text)| text).filter(|text| !text.is_empty()).collect()
    }

    #[test]
    fn ticks_are_round_numbers() {
        let axis = Axis::new("ρ", "");
        assert_eq!(written(&axis, &[0.05, 0.93]), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(written(&axis, &[-40.0, 41.0]), ["−40", "−20", "0", "20", "40"]);
        assert_eq!(written(&axis, &[0.0, 1240.0]), ["0", "250", "500", "750", "1000", "1250"]);
        assert_eq!(written(&Axis::new("λ", "µm").within(0.4, 1.0), &[]), ["0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(written(&axis, &[0.0, 1.1]), ["0.00", "0.25", "0.50", "0.75", "1.00"]);
    }

    #[test]
    fn angles_are_told_in_parts_of_the_right_one() {
        let fitted = Axis::new("θ", "°").within(0.0, 90.0).fit([].into_iter(), 9);
        assert_eq!(
            fitted.ticks.iter().map(|tick| tick.0).collect::<Vec<_>>(),
            [0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0]
        );
    }

    #[test]
    fn small_and_large_numbers_take_a_power_of_ten() {
        let fitted = Axis::new("f", "sr⁻¹").fit([0.0, 4.2e-6].into_iter(), 5);
        assert_eq!(fitted.factor().as_deref(), Some("×10⁻⁶"));
        assert_eq!(fitted.ticks.last().map(|(_, text)| text.as_str()), Some("4"));
        assert_eq!(written(&Axis::new("f", "").log(), &[2e-7, 3e3]).first().map(String::as_str), Some("10⁻⁷"));
    }

    /// Nothing, one value, not a number, the largest numbers: ticks are few and finite.
    #[test]
    fn any_data_give_an_axis() {
        for values in [
            vec![],
            vec![3.0],
            vec![0.0],
            vec![f64::NAN, f64::INFINITY],
            vec![-1e299, 1e299],
            vec![1e-320, 1.0],
            vec![1.0, 1.0 + 1e-15],
        ] {
            for axis in [
                Axis::new("", ""),
                Axis::new("", "").log(),
                Axis::new("", "").within(f64::NAN, 1.0),
                Axis::new("", "").within(5.0, 5.0),
            ] {
                let fitted = axis.fit(values.iter().copied(), 5);
                assert!(fitted.low < fitted.high && fitted.ticks.len() < 3000, "{values:?} {axis:?} {fitted:?}");
            }
        }
    }
}
