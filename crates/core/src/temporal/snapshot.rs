//! The state of a tracker or monitor as plain numbers, so that a program can put it into a file and go on later.
//!
//! A snapshot holds every number of the state, in the order of its fields; what is restored continues exactly as the original would have.
//! Its version changes with the fields: numbers of another version mean something else and are refused.

use crate::{Error, Pose};
use arrayvec::ArrayVec;
use nalgebra::{DMatrix, DVector, SMatrix};
use std::vec::Vec;

/// All numbers of a state; finite, in SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// Which fields the numbers are.
    pub version: u32,
    /// The fields in order; lists and what may be absent carry their count in front.
    pub numbers: Vec<f64>,
}

impl Snapshot {
    pub(crate) fn of(state: &impl Numbers, version: u32) -> Self {
        let mut numbers = Vec::new();
        state.put(&mut numbers);
        Snapshot { version, numbers }
    }

    /// # Errors
    /// `SnapshotVersion`, or `SnapshotNumbers` where they are too few, too many, or such as no state has.
    pub(crate) fn state<T: Numbers>(&self, version: u32) -> Result<T, Error> {
        if self.version != version {
            return Err(Error::SnapshotVersion { seen: self.version, needed: version });
        }
        let mut rest = Rest { numbers: &self.numbers };
        match T::take(&mut rest) {
            Some(state) if rest.numbers.is_empty() => Ok(state),
            _ => Err(Error::SnapshotNumbers { seen: self.numbers.len(), unread: rest.numbers.len() }),
        }
    }
}

/// Numbers not read yet.
pub(crate) struct Rest<'a> {
    numbers: &'a [f64],
}

/// What is made of numbers. `numbers!` implements it for a struct, naming each field once: one that is forgotten does not compile.
pub(crate) trait Numbers: Sized {
    fn put(&self, numbers: &mut Vec<f64>);

    /// None where the numbers end, are not finite, or are such as no state has.
    fn take(rest: &mut Rest) -> Option<Self>;
}

macro_rules! numbers {
    ($kind:ty { $($field:ident),+ $(,)? }) => {
        impl $crate::temporal::snapshot::Numbers for $kind {
            fn put(&self, numbers: &mut Vec<f64>) {
                $(self.$field.put(numbers);)+
            }

            fn take(rest: &mut $crate::temporal::snapshot::Rest) -> Option<Self> {
                Some(Self { $($field: $crate::temporal::snapshot::Numbers::take(rest)?),+ })
            }
        }
    };
}
pub(crate) use numbers;

impl Numbers for f64 {
    fn put(&self, numbers: &mut Vec<f64>) {
        numbers.push(*self);
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        let (first, others) = rest.numbers.split_first()?;
        rest.numbers = others;
        first.is_finite().then_some(*first)
    }
}

/// Counts up to 2⁵³ are exact.
const LARGEST_COUNT: f64 = 9_007_199_254_740_992.0;

impl Numbers for u64 {
    fn put(&self, numbers: &mut Vec<f64>) {
        numbers.push(*self as f64);
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        let count = f64::take(rest)?;
        (count.fract() == 0.0 && (0.0..=LARGEST_COUNT).contains(&count)).then_some(count as u64)
    }
}

impl Numbers for u32 {
    fn put(&self, numbers: &mut Vec<f64>) {
        u64::from(*self).put(numbers);
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        u32::try_from(u64::take(rest)?).ok()
    }
}

impl Numbers for usize {
    fn put(&self, numbers: &mut Vec<f64>) {
        (*self as u64).put(numbers);
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        usize::try_from(u64::take(rest)?).ok()
    }
}

impl Numbers for bool {
    fn put(&self, numbers: &mut Vec<f64>) {
        u32::from(*self).put(numbers);
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        match u32::take(rest)? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }
}

impl<T: Numbers> Numbers for Option<T> {
    fn put(&self, numbers: &mut Vec<f64>) {
        self.is_some().put(numbers);
        if let Some(value) = self {
            value.put(numbers);
        }
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        Some(if bool::take(rest)? { Some(T::take(rest)?) } else { None })
    }
}

/// What a struct would make too large for a stack.
impl<T: Numbers> Numbers for Box<T> {
    fn put(&self, numbers: &mut Vec<f64>) {
        (**self).put(numbers);
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        T::take(rest).map(Box::new)
    }
}

impl<T: Numbers, const N: usize> Numbers for [T; N] {
    fn put(&self, numbers: &mut Vec<f64>) {
        self.iter().for_each(|item| item.put(numbers));
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        let mut items = ArrayVec::new();
        for _ in 0..N {
            items.push(T::take(rest)?);
        }
        items.into_inner().ok()
    }
}

impl<T: Numbers, const N: usize> Numbers for ArrayVec<T, N> {
    fn put(&self, numbers: &mut Vec<f64>) {
        self.len().put(numbers);
        self.iter().for_each(|item| item.put(numbers));
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        let mut items = ArrayVec::new();
        for _ in 0..usize::take(rest)? {
            items.try_push(T::take(rest)?).ok()?;
        }
        Some(items)
    }
}

impl<const R: usize, const C: usize> Numbers for SMatrix<f64, R, C> {
    fn put(&self, numbers: &mut Vec<f64>) {
        numbers.extend(self.iter());
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        let mut matrix: Self = SMatrix::zeros();
        for entry in matrix.iter_mut() {
            *entry = f64::take(rest)?;
        }
        Some(matrix)
    }
}

impl<A: Numbers, B: Numbers> Numbers for (A, B) {
    fn put(&self, numbers: &mut Vec<f64>) {
        self.0.put(numbers);
        self.1.put(numbers);
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        Some((A::take(rest)?, B::take(rest)?))
    }
}

/// Every item takes a number at least, so a count that is not true ends with the numbers.
impl<T: Numbers> Numbers for Vec<T> {
    fn put(&self, numbers: &mut Vec<f64>) {
        self.len().put(numbers);
        self.iter().for_each(|item| item.put(numbers));
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        (0..usize::take(rest)?).map(|_| T::take(rest)).collect()
    }
}

impl Numbers for DMatrix<f64> {
    fn put(&self, numbers: &mut Vec<f64>) {
        self.nrows().put(numbers);
        self.ncols().put(numbers);
        numbers.extend(self.iter());
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        let (rows, columns) = (usize::take(rest)?, usize::take(rest)?);
        let (entries, others) = rest.numbers.split_at_checked(rows.checked_mul(columns)?)?;
        rest.numbers = others;
        entries
            .iter()
            .all(|entry| entry.is_finite())
            .then(|| DMatrix::from_column_slice(rows, columns, entries))
    }
}

impl Numbers for DVector<f64> {
    fn put(&self, numbers: &mut Vec<f64>) {
        self.len().put(numbers);
        numbers.extend(self.iter());
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        Vec::take(rest).map(DVector::from_vec)
    }
}

numbers!(Pose { rotation, translation });
