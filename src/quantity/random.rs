//! The random numbers of `noise(seed, rms, dt)` and of netlists: the same on every machine, each by its index alone.
//!
//! The k-th number is rms·√(−2·ln u)·cos(2π·v): normal, of mean 0 and root mean square rms (G. E. P. Box, M. E. Muller,
//! Ann. Math. Stat. 29:610, 1958). u and v are the (2k)-th and (2k+1)-th outputs of SplitMix64 from the state that its
//! mixing function makes of the seed (G. L. Steele, D. Lea, C. H. Flood, OOPSLA 2014), as fractions of 2⁵³: u in (0, 1],
//! v in [0, 1). Logarithm and cosine come from `libm`, never from the platform.

use std::f64::consts::TAU;

/// The k-th normal number of a seed, of mean 0 and root mean square 1. In noise it holds for k·dt ≤ t < (k + 1)·dt.
pub fn normal(seed: u64, k: u64) -> f64 {
    let u = fraction(seed, 2 * k) + 1.0 / SCALE;
    let v = fraction(seed, 2 * k + 1);
    (-2.0 * libm::log(u)).sqrt() * libm::cos(TAU * v)
}

/// The k-th number of a seed in [0, 1), all equally likely.
pub fn fraction(seed: u64, k: u64) -> f64 {
    let state = mix(seed.wrapping_add(GAMMA)).wrapping_add(k.wrapping_add(1).wrapping_mul(GAMMA));
    (mix(state) >> 11) as f64 / SCALE
}

/// The seed of what belongs to a seed and to a text: other texts have others.
pub fn below(seed: u64, text: &str) -> u64 {
    text.bytes().fold(mix(seed.wrapping_add(GAMMA)), |state, byte| {
        mix((state ^ u64::from(byte)).wrapping_add(GAMMA))
    })
}

/// Fractions are multiples of its inverse.
const SCALE: f64 = (1u64 << 53) as f64;

/// The odd step of the state: 2⁶⁴ over the golden ratio.
const GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;

/// The output function of SplitMix64 (variant 13 of D. Stafford).
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mixing_function_is_that_of_splitmix() {
        // The first outputs of SplitMix64 from the state 1234567, as its authors' and others' programs give them.
        let mut state = 1234567u64;
        let expected = [6457827717110365317, 3203168211198807973, 9817491932198370423u64];
        for value in expected {
            state = state.wrapping_add(GAMMA);
            assert_eq!(mix(state), value);
        }
    }

    #[test]
    fn the_numbers_are_normal_and_independent_of_their_neighbours() {
        const N: u64 = 200_000;
        let x: Vec<f64> = (0..N).map(|k| normal(7, k)).collect();
        let mean = |f: &dyn Fn(f64) -> f64| x.iter().map(|x| f(*x)).sum::<f64>() / N as f64;
        // Four standard errors of each moment.
        let room = 4.0 / (N as f64).sqrt();
        assert!(mean(&|x| x).abs() < room);
        assert!((mean(&|x| x * x) - 1.0).abs() < room * 2f64.sqrt());
        assert!((mean(&|x| x.powi(4)) - 3.0).abs() < room * 96f64.sqrt());
        assert!((mean(&|x| f64::from(x.abs() < 1.0)) - 0.682_689_492).abs() < room * 0.47);
        let lagged = x.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / N as f64;
        assert!(lagged.abs() < room);
        let other: f64 = (0..N).map(|k| normal(8, k) * x[k as usize]).sum::<f64>() / N as f64;
        assert!(other.abs() < room);
    }
}
