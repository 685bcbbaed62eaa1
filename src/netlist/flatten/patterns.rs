//! Waveforms that repeat: points of a PWL, bits of a PAT.
//!
//! ```text
//! PWL … R=from TD=delay   past its last time T it goes on from `from`, again and again; everything comes `delay` later
//! PAT(high low delay rise fall sample bits) R=n
//! ```
//!
//! A bit lasts `sample`. The pattern stands still in the first bit until `delay`; from one bit to a different one the value
//! goes over in `rise` or `fall`, half of it before the end of the bit. After the last bit the pattern comes again n times,
//! for ever with n = −1, else the last bit stays. Units: s.
//!
//! Source: Xyce Reference Guide, version 7, independent voltage source (PWL, PAT).

use crate::circuit::Waveform;

/// What a PWL of these times and values is.
pub fn points(values: &[f64], repeat: Option<f64>, delay: f64) -> Result<Waveform, &'static str> {
    let mut points: Vec<(f64, f64)> =
        values.chunks_exact(2).map(|pair| (pair[0] + delay, pair[1])).collect();
    let Some(&(end, _)) = points.last() else { return Err("it has no points") };
    let Some(from) = repeat.filter(|from| *from >= 0.0) else { return Ok(Waveform::Pwl(points)) };
    let from = from + delay;
    if from >= end {
        return Err("it is repeated from its end on");
    }
    if points.windows(2).any(|pair| pair[1].0 < pair[0].0) {
        return Err("its times run backwards");
    }
    // What is repeated begins at a point.
    let at = Waveform::Pwl(points.clone()).value(from);
    let place = points.partition_point(|(time, _)| *time < from);
    if points.get(place).is_none_or(|(time, _)| *time != from) {
        points.insert(place, (from, at));
    }
    Ok(Waveform::Repeating { points, from, end })
}

/// What a PAT is.
pub fn pattern(values: &[f64], bits: &str, repeat: Option<f64>) -> Result<Waveform, &'static str> {
    let &[high, low, delay, rise, fall, sample] = values else {
        return Err("it takes six numbers and its bits");
    };
    if sample <= 0.0 || rise < 0.0 || fall < 0.0 {
        return Err("its sample must be above 0, its rise and fall not below");
    }
    if rise > sample || fall > sample {
        return Err("its rise and fall must not be longer than its sample");
    }
    let level = |bit: u8| if bit == b'1' { high } else { low };
    let bits = bits.as_bytes();
    let (Some(&first), Some(&last)) = (bits.first(), bits.last()) else {
        return Err("it has no bits");
    };
    let period = sample * bits.len() as f64;
    let forever = repeat == Some(-1.0);
    let times = if forever { 2 } else { repeat.unwrap_or(0.0).max(0.0).trunc() as usize + 1 };
    if times > MOST {
        return Err("it is repeated too often: write R=-1 for ever");
    }
    // Corners relative to the start of the first bit, one round after the other.
    let mut points = vec![(delay, level(first))];
    for round in 0..times {
        for (k, bit) in bits.iter().enumerate() {
            let start = delay + sample * (round * bits.len() + k) as f64;
            let before = match k {
                0 if round == 0 => continue,
                0 => last,
                k => bits[k - 1],
            };
            if before != *bit {
                let span = if *bit == b'1' { rise } else { fall };
                points.push((start - 0.5 * span, level(before)));
                points.push((start + 0.5 * span, level(*bit)));
            }
        }
    }
    if forever {
        // The second round holds for all that follow.
        let (from, end) = (delay + 0.5 * period, delay + 1.5 * period);
        let all = Waveform::Pwl(points.clone());
        let within = points.iter().filter(|(time, _)| *time < end).copied();
        let mut points: Vec<(f64, f64)> = within.collect();
        for time in [from, end] {
            let place = points.partition_point(|(own, _)| *own < time);
            if points.get(place).is_none_or(|(own, _)| *own != time) {
                points.insert(place, (time, all.value(time)));
            }
        }
        return Ok(Waveform::Repeating { points, from, end });
    }
    Ok(Waveform::Pwl(points))
}

/// Rounds of a pattern, at most.
const MOST: usize = 10_000;
