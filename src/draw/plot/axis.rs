//! Axes: their limits, where ticks stand, and what is written at them.

/// How values become lengths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// In proportion.
    #[default]
    Linear,
    /// By their logarithm; what is not positive has no place.
    Logarithmic,
}

/// An axis.
#[derive(Clone, Debug, Default)]
pub struct Axis {
    /// What it counts, with its unit.
    pub label: String,
    /// How.
    pub scale: Scale,
    /// Its ends, where they are asked for.
    pub limits: Option<(f64, f64)>,
    /// The distance of its ticks, where one is asked for.
    pub step: Option<f64>,
}

/// An axis with ends and ticks.
#[derive(Clone, Debug)]
pub struct Ruler {
    /// Its ends, low and high; of the logarithm where it is logarithmic.
    pub ends: (f64, f64),
    /// Ticks: how far along (0 to 1), and what is written there.
    pub ticks: Vec<(f64, String)>,
    scale: Scale,
}

impl Ruler {
    /// How far along the axis a value stands; NaN where it has no place.
    pub fn place(&self, value: f64) -> f64 {
        let value = match self.scale {
            Scale::Linear => value,
            Scale::Logarithmic if value > 0.0 => libm::log10(value),
            Scale::Logarithmic => f64::NAN,
        };
        (value - self.ends.0) / (self.ends.1 - self.ends.0)
    }

    /// An axis for values; `room` is the number of ticks that have room, `tight` that it ends at the values.
    pub fn new(axis: &Axis, values: impl Iterator<Item = f64>, room: usize, tight: bool) -> Ruler {
        let scale = axis.scale;
        let usable = values.filter(|v| v.is_finite() && (scale == Scale::Linear || *v > 0.0));
        let extent =
            usable.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let (mut low, mut high) = axis.limits.unwrap_or(extent);
        if low > high {
            (low, high) = if scale == Scale::Linear { (0.0, 1.0) } else { (1.0, 10.0) };
        }
        if scale == Scale::Logarithmic {
            let (mut low, mut high) = (libm::log10(low), libm::log10(high));
            if high - low < 1e-9 {
                (low, high) = (low - 0.5, high + 0.5);
            }
            return Ruler { ends: (low, high), ticks: decades(low, high, room), scale };
        }
        // A line that does not change is drawn in the middle; rounding is no change.
        let size = low.abs().max(high.abs());
        if high - low <= 1e-12 * size || high == low {
            let half = if size == 0.0 { 1.0 } else { 0.1 * size };
            (low, high) = (low - half, high + half);
        }
        let step = axis.step.filter(|step| *step > 0.0 && (high - low) / step < 100.0);
        let step = step.unwrap_or_else(|| nice((high - low) / room.max(1) as f64));
        if !tight && axis.limits.is_none() {
            // To whole ticks, unless that would leave much empty.
            let (l, h) = ((low / step).floor() * step, (high / step).ceil() * step);
            let pad = 0.04 * (high - low);
            low = if low - l < 0.6 * step || axis.step.is_some() { l } else { low - pad };
            high = if h - high < 0.6 * step || axis.step.is_some() { h } else { high + pad };
        }
        let ticks = ticks(low, high, step);
        let along = |value: f64| (value - low) / (high - low);
        let ticks = ticks.into_iter().map(|(value, text)| (along(value), text)).collect();
        Ruler { ends: (low, high), ticks, scale }
    }
}

/// 1, 2 or 5 times a power of ten, at least as much as is asked for.
pub(super) fn nice(least: f64) -> f64 {
    let power = libm::pow(10.0, libm::log10(least).floor());
    let part = least / power;
    let factor = [1.0, 2.0, 5.0, 10.0].into_iter().find(|f| part <= *f * (1.0 + 1e-9));
    factor.unwrap_or(10.0) * power
}

/// Multiples of a step between two values, and as text with as many digits as the step needs.
pub fn ticks(low: f64, high: f64, step: f64) -> Vec<(f64, String)> {
    let first = (low / step - 1e-6).ceil() as i64;
    let last = (high / step + 1e-6).floor() as i64;
    let size = low.abs().max(high.abs());
    // Digits after the point that tell a step from its multiples.
    let mut digits = 0;
    while digits < 15 {
        let scaled = step * libm::pow(10.0, f64::from(digits));
        if (scaled - scaled.round()).abs() < 1e-6 * scaled.max(1e-300) && scaled.round() > 0.0 {
            break;
        }
        digits += 1;
    }
    let one = |k: i64| {
        let value = k as f64 * step;
        let text = if k == 0 {
            "0".to_string()
        } else if size >= 1e6 || digits > 5 {
            exponent(value)
        } else {
            format!("{value:.*}", digits as usize)
        };
        (value, text.replace('-', "−"))
    };
    (first..=last.min(first + 200)).map(one).collect()
}

/// `2.5e6` with as few digits as say the number to six.
fn exponent(value: f64) -> String {
    let text = format!("{value:.5e}");
    let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
    let digits = digits.trim_end_matches('0').trim_end_matches('.');
    format!("{digits}e{power}")
}

/// Powers of ten, or every second, third …; within one decade 1, 2 and 5.
fn decades(low: f64, high: f64, room: usize) -> Vec<(f64, String)> {
    let mut found = vec![];
    let along = |log: f64| (log - low) / (high - low);
    let name = |power: i64, digit: u32| match power {
        -3..=4 if power >= 0 => format!("{}", f64::from(digit) * libm::pow(10.0, power as f64)),
        -3..=4 => {
            format!("{:.*}", -power as usize, f64::from(digit) * libm::pow(10.0, power as f64))
        }
        _ => format!("{digit}e{power}").replace('-', "−"),
    };
    let each = (((high - low) / room.max(1) as f64).ceil() as i64).max(1);
    let digits: &[u32] = if high - low < 1.7 { &[1, 2, 5] } else { &[1] };
    let from = low.floor() as i64;
    for power in from..=high.ceil() as i64 {
        if power.rem_euclid(each) != 0 {
            continue;
        }
        for digit in digits {
            let log = power as f64 + libm::log10(f64::from(*digit));
            if log >= low - 1e-9 && log <= high + 1e-9 {
                found.push((along(log), name(power, *digit)));
            }
        }
    }
    found
}
