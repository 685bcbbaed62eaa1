//! Several numbers at once, one in each lane of a processor's registers.
//!
//! What is computed of a pack is, lane by lane and bit by bit, what would be computed of each number by itself.

use std::ops::{Add, Mul, Sub};

/// How many.
pub const LANES: usize = 4;

/// One number in each lane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(32))]
pub struct Pack(pub [f64; LANES]);

/// A real number, or one in each lane.
pub trait Number: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// 0.
    const ZERO: Self;
    /// The same number in all lanes.
    fn splat(value: f64) -> Self;
    /// A function of each lane.
    fn map(self, f: impl Fn(f64) -> f64) -> Self;
    /// A function of each lane of two.
    fn with(self, b: Self, f: impl Fn(f64, f64) -> f64) -> Self;
    /// A function of each lane of three.
    fn with_two(self, b: Self, c: Self, f: impl Fn(f64, f64, f64) -> f64) -> Self;
    /// Whether something holds in every lane.
    fn every(self, f: impl Fn(f64) -> bool) -> bool;
}

impl Number for f64 {
    const ZERO: f64 = 0.0;

    #[inline(always)]
    fn splat(value: f64) -> f64 {
        value
    }

    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> f64 {
        f(self)
    }

    #[inline(always)]
    fn with(self, b: f64, f: impl Fn(f64, f64) -> f64) -> f64 {
        f(self, b)
    }

    #[inline(always)]
    fn with_two(self, b: f64, c: f64, f: impl Fn(f64, f64, f64) -> f64) -> f64 {
        f(self, b, c)
    }

    #[inline(always)]
    fn every(self, f: impl Fn(f64) -> bool) -> bool {
        f(self)
    }
}

impl Number for Pack {
    const ZERO: Pack = Pack([0.0; LANES]);

    #[inline(always)]
    fn splat(value: f64) -> Pack {
        Pack([value; LANES])
    }

    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Pack {
        Pack(std::array::from_fn(|lane| f(self.0[lane])))
    }

    #[inline(always)]
    fn with(self, b: Pack, f: impl Fn(f64, f64) -> f64) -> Pack {
        Pack(std::array::from_fn(|lane| f(self.0[lane], b.0[lane])))
    }

    #[inline(always)]
    fn with_two(self, b: Pack, c: Pack, f: impl Fn(f64, f64, f64) -> f64) -> Pack {
        Pack(std::array::from_fn(|lane| f(self.0[lane], b.0[lane], c.0[lane])))
    }

    #[inline(always)]
    fn every(self, f: impl Fn(f64) -> bool) -> bool {
        self.0.into_iter().all(f)
    }
}

impl Add for Pack {
    type Output = Pack;

    #[inline(always)]
    fn add(self, b: Pack) -> Pack {
        self.with(b, |a, b| a + b)
    }
}

impl Sub for Pack {
    type Output = Pack;

    #[inline(always)]
    fn sub(self, b: Pack) -> Pack {
        self.with(b, |a, b| a - b)
    }
}

impl Mul for Pack {
    type Output = Pack;

    #[inline(always)]
    fn mul(self, b: Pack) -> Pack {
        self.with(b, |a, b| a * b)
    }
}

/// Puts numbers into one lane.
pub fn put_lane(to: &mut [Pack], lane: usize, from: &[f64]) {
    to.iter_mut().zip(from).for_each(|(to, from)| to.0[lane] = *from);
}

/// Takes the numbers of one lane.
pub fn take_lane(from: &[Pack], lane: usize, to: &mut [f64]) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to = from.0[lane]);
}
