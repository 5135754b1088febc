//! Numbers, vectors and matrices of several problems side by side, one problem per lane: the formulas look the same as on the single path, and
//! every operation is one instruction of the widest vectors of the machine.
//!
//! Everything is inlined into the one function that is compiled for those vectors. Closures are not, so that there are none here or in the files
//! that use this one: a separate closure would be compiled for the least capable machine.

use core::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, Neg, Not, Sub, SubAssign};
use pulp::Simd;

/// Number of lanes of the widest machine; others use the first few of a column.
pub(super) const WIDTH: usize = 8;

/// One number of each problem, in memory.
pub(super) type Column = [f64; WIDTH];

/// One number of each problem.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lanes<S: Simd> {
    simd: S,
    v: S::f64s,
}

/// One truth value of each problem.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mask<S: Simd> {
    simd: S,
    m: S::m64s,
}

impl<S: Simd> Lanes<S> {
    #[inline(always)]
    pub fn splat(simd: S, x: f64) -> Self {
        Lanes { simd, v: simd.splat_f64s(x) }
    }

    #[inline(always)]
    pub fn load(simd: S, column: &Column) -> Self {
        let v = S::as_simd_f64s(column).0.first().copied().unwrap_or_else(|| simd.splat_f64s(0.0));
        Lanes { simd, v }
    }

    #[inline(always)]
    pub fn store(self, column: &mut Column) {
        if let Some(head) = S::as_mut_simd_f64s(column).0.first_mut() {
            *head = self.v;
        }
    }

    /// Returns the same number in every lane.
    #[inline(always)]
    pub fn like(self, x: f64) -> Self {
        Lanes::splat(self.simd, x)
    }

    /// self · a + b, in one instruction where the machine has it.
    #[inline(always)]
    pub fn times_plus(self, a: Self, b: Self) -> Self {
        Lanes { simd: self.simd, v: self.simd.mul_add_e_f64s(self.v, a.v, b.v) }
    }

    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Lanes { simd: self.simd, v: self.simd.sqrt_f64s(self.v) }
    }

    #[inline(always)]
    pub fn recip(self) -> Self {
        self.like(1.0) / self
    }

    #[inline(always)]
    pub fn max(self, x: f64) -> Self {
        Lanes { simd: self.simd, v: self.simd.max_f64s(self.v, self.simd.splat_f64s(x)) }
    }

    #[inline(always)]
    pub fn abs(self) -> Self {
        Lanes { simd: self.simd, v: self.simd.abs_f64s(self.v) }
    }

    #[inline(always)]
    pub fn less(self, other: Self) -> Mask<S> {
        Mask { simd: self.simd, m: self.simd.less_than_f64s(self.v, other.v) }
    }

    /// Returns self < x; false for NaN.
    #[inline(always)]
    pub fn below(self, x: f64) -> Mask<S> {
        self.less(self.like(x))
    }

    /// x < self.
    #[inline(always)]
    pub fn above(self, x: f64) -> Mask<S> {
        self.like(x).less(self)
    }

    #[inline(always)]
    pub fn equals(self, other: Self) -> Mask<S> {
        Mask { simd: self.simd, m: self.simd.equal_f64s(self.v, other.v) }
    }

    #[inline(always)]
    pub fn is_finite(self) -> Mask<S> {
        self.abs().below(f64::INFINITY)
    }
}

impl<S: Simd> Mask<S> {
    #[inline(always)]
    pub fn choose(self, yes: Lanes<S>, no: Lanes<S>) -> Lanes<S> {
        Lanes { simd: self.simd, v: self.simd.select_f64s(self.m, yes.v, no.v) }
    }

    #[inline(always)]
    pub fn any(self) -> bool {
        let mut column = [0.0; WIDTH];
        self.store(&mut column);
        column != [0.0; WIDTH]
    }

    /// Stores 1 where true, 0 elsewhere.
    #[inline(always)]
    pub fn store(self, column: &mut Column) {
        let (one, zero) = (Lanes::splat(self.simd, 1.0), Lanes::splat(self.simd, 0.0));
        self.choose(one, zero).store(column);
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $simd_method:ident) => {
        impl<S: Simd> $trait for Lanes<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Lanes { simd: self.simd, v: self.simd.$simd_method(self.v, other.v) }
            }
        }
        impl<S: Simd> $trait<f64> for Lanes<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                Lanes { simd: self.simd, v: self.simd.$simd_method(self.v, self.simd.splat_f64s(other)) }
            }
        }
    };
}
operator!(Add, add, add_f64s);
operator!(Sub, sub, sub_f64s);
operator!(Mul, mul, mul_f64s);
operator!(Div, div, div_f64s);

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Lanes { simd: self.simd, v: self.simd.neg_f64s(self.v) }
    }
}

impl<S: Simd> AddAssign for Lanes<S> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<S: Simd> BitAnd for Mask<S> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Mask { simd: self.simd, m: self.simd.and_m64s(self.m, other.m) }
    }
}

impl<S: Simd> BitOr for Mask<S> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Mask { simd: self.simd, m: self.simd.or_m64s(self.m, other.m) }
    }
}

impl<S: Simd> Not for Mask<S> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Mask { simd: self.simd, m: self.simd.not_m64s(self.m) }
    }
}

/// A vector of each problem.
#[derive(Debug, Clone, Copy)]
pub(super) struct Vector<S: Simd> {
    pub x: Lanes<S>,
    pub y: Lanes<S>,
    pub z: Lanes<S>,
}

impl<S: Simd> Vector<S> {
    #[inline(always)]
    pub fn new(x: Lanes<S>, y: Lanes<S>, z: Lanes<S>) -> Self {
        Vector { x, y, z }
    }

    #[inline(always)]
    pub fn dot(self, o: Self) -> Lanes<S> {
        self.x.times_plus(o.x, self.y.times_plus(o.y, self.z * o.z))
    }

    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        Vector::new(
            self.y.times_plus(o.z, -(self.z * o.y)),
            self.z.times_plus(o.x, -(self.x * o.z)),
            self.x.times_plus(o.y, -(self.y * o.x)),
        )
    }

    /// self · s + o.
    #[inline(always)]
    pub fn times_plus(self, s: Lanes<S>, o: Self) -> Self {
        Vector::new(self.x.times_plus(s, o.x), self.y.times_plus(s, o.y), self.z.times_plus(s, o.z))
    }

    #[inline(always)]
    pub fn norm_squared(self) -> Lanes<S> {
        self.dot(self)
    }

    #[inline(always)]
    pub fn unit(self) -> Self {
        self * self.norm_squared().sqrt().recip()
    }

    #[inline(always)]
    pub fn choose(mask: Mask<S>, yes: &Self, no: &Self) -> Self {
        Vector::new(mask.choose(yes.x, no.x), mask.choose(yes.y, no.y), mask.choose(yes.z, no.z))
    }
}

impl<S: Simd> Add for Vector<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Vector::new(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl<S: Simd> AddAssign for Vector<S> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl<S: Simd> Sub for Vector<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Vector::new(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

impl<S: Simd> SubAssign for Vector<S> {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

impl<S: Simd> Mul<Lanes<S>> for Vector<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: Lanes<S>) -> Self {
        Vector::new(self.x * s, self.y * s, self.z * s)
    }
}

/// A 3×3 matrix of each problem, by rows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Matrix<S: Simd> {
    pub rows: [Vector<S>; 3],
}

impl<S: Simd> Matrix<S> {
    #[inline(always)]
    pub fn from_columns(a: Vector<S>, b: Vector<S>, c: Vector<S>) -> Self {
        Matrix { rows: [Vector::new(a.x, b.x, c.x), Vector::new(a.y, b.y, c.y), Vector::new(a.z, b.z, c.z)] }
    }

    #[inline(always)]
    pub fn transpose(&self) -> Self {
        let [a, b, c] = self.rows;
        Matrix::from_columns(a, b, c)
    }

    #[inline(always)]
    pub fn apply(&self, v: Vector<S>) -> Vector<S> {
        let [a, b, c] = self.rows;
        Vector::new(a.dot(v), b.dot(v), c.dot(v))
    }

    #[inline(always)]
    pub fn apply_transposed(&self, v: Vector<S>) -> Vector<S> {
        let [a, b, c] = self.rows;
        a.times_plus(v.x, b.times_plus(v.y, c * v.z))
    }

    #[inline(always)]
    pub fn times(&self, o: &Self) -> Self {
        let [a, b, c] = self.rows;
        Matrix { rows: [o.apply_transposed(a), o.apply_transposed(b), o.apply_transposed(c)] }
    }

    #[inline(always)]
    pub fn choose(mask: Mask<S>, yes: &Self, no: &Self) -> Self {
        let ([a, b, c], [d, e, f]) = (&yes.rows, &no.rows);
        Matrix { rows: [Vector::choose(mask, a, d), Vector::choose(mask, b, e), Vector::choose(mask, c, f)] }
    }

    #[inline(always)]
    pub fn minus(&self, o: &Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.rows, o.rows);
        Matrix { rows: [a - x, b - y, c - z] }
    }

    /// [v]×.
    #[inline(always)]
    pub fn cross(v: Vector<S>) -> Self {
        let o = v.x.like(0.0);
        Matrix { rows: [Vector::new(o, -v.z, v.y), Vector::new(v.z, o, -v.x), Vector::new(-v.y, v.x, o)] }
    }

    /// Orthonormalises as `pose::orthonormalized`: Gram–Schmidt on the rows.
    #[inline(always)]
    pub fn orthonormalized(&self) -> Self {
        let x = self.rows[0].unit();
        let y = self.rows[1];
        let y = (y - x * x.dot(y)).unit();
        Matrix { rows: [x, y, x.cross(y)] }
    }
}

/// A symmetric 3×3 matrix of each problem: xx, xy, xz, yy, yz, zz.
#[derive(Debug, Clone, Copy)]
pub(super) struct Symmetric<S: Simd>(pub [Lanes<S>; 6]);

impl<S: Simd> Symmetric<S> {
    #[inline(always)]
    pub fn add_square(&mut self, v: Vector<S>) {
        let m = &mut self.0;
        m[0] = v.x.times_plus(v.x, m[0]);
        m[1] = v.x.times_plus(v.y, m[1]);
        m[2] = v.x.times_plus(v.z, m[2]);
        m[3] = v.y.times_plus(v.y, m[3]);
        m[4] = v.y.times_plus(v.z, m[4]);
        m[5] = v.z.times_plus(v.z, m[5]);
    }

    #[inline(always)]
    pub fn full(&self) -> Matrix<S> {
        let [a, b, c, d, e, f] = self.0;
        Matrix { rows: [Vector::new(a, b, c), Vector::new(b, d, e), Vector::new(c, e, f)] }
    }

    #[inline(always)]
    pub fn apply(&self, v: Vector<S>) -> Vector<S> {
        self.full().apply(v)
    }

    #[inline(always)]
    pub fn damped(&self, damping: Lanes<S>) -> Self {
        let [a, b, c, d, e, f] = self.0;
        let s = damping + 1.0;
        Symmetric([a * s, b, c, d * s, e, f * s])
    }

    /// Returns self − A Bᵀ, for a product known to be symmetric.
    #[inline(always)]
    pub fn minus_product(&self, a: &Matrix<S>, b: &Matrix<S>) -> Self {
        let (m, [a, b, c], [x, y, z]) = (self.0, a.rows, b.rows);
        Symmetric([
            m[0] - a.dot(x),
            m[1] - a.dot(y),
            m[2] - a.dot(z),
            m[3] - b.dot(y),
            m[4] - b.dot(z),
            m[5] - c.dot(z),
        ])
    }

    /// Its square.
    #[inline(always)]
    pub fn squared(&self) -> Self {
        let [x, y, z] = self.full().rows;
        Symmetric([x.dot(x), x.dot(y), x.dot(z), y.dot(y), y.dot(z), z.dot(z)])
    }

    /// Returns the inverse by cofactors, and where the matrix is positive definite and finite.
    #[inline(always)]
    pub fn inverse(&self) -> (Self, Mask<S>) {
        let [a, b, c, d, e, f] = self.0;
        let (ca, cb, cc, minor) = (
            d.times_plus(f, -(e * e)),
            c.times_plus(e, -(b * f)),
            b.times_plus(e, -(c * d)),
            a.times_plus(d, -(b * b)),
        );
        let det = a.times_plus(ca, b.times_plus(cb, c * cc));
        let positive = a.above(0.0) & minor.above(0.0) & det.above(0.0) & det.is_finite();
        let i = det.recip();
        let (cd, ce, cf) = (a.times_plus(f, -(c * c)), b.times_plus(c, -(a * e)), minor);
        (Symmetric([ca * i, cb * i, cc * i, cd * i, ce * i, cf * i]), positive)
    }

    /// Returns the inverse for xy = 0.
    #[inline(always)]
    pub fn inverse_without_xy(&self) -> (Self, Mask<S>) {
        let [a, _, c, d, e, f] = self.0;
        let (ca, cb, cc, minor) = (d.times_plus(f, -(e * e)), c * e, -(c * d), a * d);
        let det = a.times_plus(ca, c * cc);
        let positive = a.above(0.0) & minor.above(0.0) & det.above(0.0) & det.is_finite();
        let i = det.recip();
        let (cd, ce, cf) = (a.times_plus(f, -(c * c)), -(a * e), minor);
        (Symmetric([ca * i, cb * i, cc * i, cd * i, ce * i, cf * i]), positive)
    }

    #[inline(always)]
    pub fn choose(mask: Mask<S>, yes: &Self, no: &Self) -> Self {
        let mut chosen = *no;
        for i in 0..6 {
            chosen.0[i] = mask.choose(yes.0[i], no.0[i]);
        }
        chosen
    }
}
