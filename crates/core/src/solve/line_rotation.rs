//! Rotation from three lines of known direction: own derivation, docs/math/lines.md section 4, whose equations are cited.
//!
//! The plane through the camera and a line holds the line: n·R d = 0, one equation each, whatever the line's place. Two of the three may be
//! parallel: the road's edges and a stop line.
//!
//!   nᵢ  normals of the planes (camera)   ·   dᵢ  directions of the lines (target)   ·   r = R d₁, at angle φ in the plane of line 1
//!   θ  turn about r   ·   (d₁, p, q), (r, n₁, r × n₁)  frames   ·   Aₖ + Bₖ cos θ + Cₖ sin θ = nₖ·R dₖ

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Unit, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Rotations target to camera, on the stack; no order promised.
pub type LineRotations = ArrayVec<Matrix3<f64>, 8>;

type Direction = Unit<Vector3<f64>>;

/// Sine between two directions below which they are parallel.
const PARALLEL: f64 = 1e-6;
/// Samples of the closing condition on the circle; it has at most eight zeros, and two closer than a sample merge into a dip.
const SAMPLES: usize = 64;
/// Secants at most; eight are usual.
const SECANTS: usize = 60;
/// Thirds taken off a dip to find its lowest place.
const NARROWINGS: usize = 24;
/// A dip of the closing condition, which is of order one, that is a double root within what a refinement bridges.
const DIP: f64 = 1e-3;
/// What a zero leaves of the closing condition; a jump leaves much more.
const CLOSED: f64 = 1e-9;
/// Two rotations closer than this (chordal) are one, found from two hinges.
const DUPLICATE: f64 = 1e-5;

/// Every rotation with nᵢ·R dᵢ = 0: up to eight (four for two parallel lines). Exact data give the true one, double roots to the root
/// of rounding. Empty when a direction is open: three parallel lines, or parallel lines in one plane with the camera.
pub fn line_rotation(normals: &[Direction; 3], directions_in_target: &[Direction; 3]) -> LineRotations {
    let parallel =
        |i: usize, j: usize| directions_in_target[i].cross(&directions_in_target[j]).norm() < PARALLEL;
    match [(0, 1, 2), (0, 2, 1), (1, 2, 0)].into_iter().find(|(i, j, _)| parallel(*i, *j)) {
        Some((i, j, k)) => with_parallels(normals, directions_in_target, [i, j, k]),
        None => hinged(normals, directions_in_target),
    }
}

/// Each line is the hinge once: a hinge is blind where it stands across the plane of the line that turns about it.
fn hinged(n: &[Direction; 3], d: &[Direction; 3]) -> LineRotations {
    let mut found = LineRotations::new();
    for [i, j, k] in [[0, 1, 2], [1, 2, 0], [2, 0, 1]] {
        for rotation in Hinge::new([n[i], n[j], n[k]], [d[i], d[j], d[k]]).rotations() {
            let is_duplicate = found.iter().any(|other| (other - rotation).norm() < DUPLICATE);
            if !is_duplicate && !found.is_full() {
                found.push(rotation);
            }
        }
    }
    found
}

/// Lines i and j are parallel and meet in v = nᵢ × nⱼ; line k closes, eq. (8).
fn with_parallels(n: &[Direction; 3], d: &[Direction; 3], [i, j, k]: [usize; 3]) -> LineRotations {
    let mut found = LineRotations::new();
    let (meet, across) = (n[i].cross(&n[j]), d[i].cross(&d[k]));
    if !(PARALLEL < meet.norm() && PARALLEL < across.norm()) {
        return found;
    }
    let (v, cosine) = (meet.normalize(), d[i].dot(&d[k]));
    let tilt = n[k].cross(&v);
    let p = tilt.norm();
    if !(PARALLEL < p) {
        return found;
    }
    let (g, f) = (tilt / p, tilt.cross(&n[k]) / p); // f: v made perpendicular to n; g = n × f
    for v in [v, -v] {
        let along = cosine * f.dot(&v) / (p * p);
        let Some(aside) = leg(along) else { continue };
        for r in [f * along + g * aside, f * along - g * aside] {
            found.push(laid(&d[i], &d[k], &v, &r));
        }
    }
    found
}

/// √(1 − x²); 0 where noise makes it a little negative, none where more is missing.
fn leg(x: f64) -> Option<f64> {
    let squared = (1.0 - x) * (1.0 + x);
    (-0.1 < squared).then(|| squared.max(0.0).sqrt())
}

/// The rotation that lays the first direction along `v`, and the second into the plane of `v` and `r` on the side of `r`.
fn laid(first: &Direction, second: &Direction, v: &Vector3<f64>, r: &Vector3<f64>) -> Matrix3<f64> {
    let frame = |x: &Vector3<f64>, y: &Vector3<f64>| {
        let z = x.cross(y).normalize();
        Matrix3::from_columns(&[*x, z.cross(x), z])
    };
    frame(v, r) * frame(first, second).transpose()
}

/// The family that puts line 1 into its plane: r turns by φ within it, the rest by θ about r.
struct Hinge {
    n: [Vector3<f64>; 3],
    /// Directions in the frame (d₁, p, q).
    d: [Vector3<f64>; 3],
    frame: Matrix3<f64>,
    /// Axes of the plane of line 1.
    e: Vector3<f64>,
    f: Vector3<f64>,
}

impl Hinge {
    fn new(normals: [Direction; 3], directions: [Direction; 3]) -> Self {
        let n = normals.map(|n| n.into_inner());
        let x = directions[0].into_inner();
        let z = x.cross(&directions[1]).normalize();
        let frame = Matrix3::from_columns(&[x, z.cross(&x), z]);
        let axis = Vector3::from_fn(|i, _| if i == n[0].iamin() { 1.0 } else { 0.0 });
        let e = n[0].cross(&axis).normalize();
        Hinge { n, d: directions.map(|d| frame.tr_mul(&d)), frame, e, f: n[0].cross(&e) }
    }

    /// r and r × n₁.
    fn axes(&self, phi: f64) -> (Vector3<f64>, Vector3<f64>) {
        let (sin, cos) = phi.sin_cos();
        let r = self.e * cos + self.f * sin;
        (r, r.cross(&self.n[0]))
    }

    /// A, B, C of line k, eq. (9).
    fn terms(&self, k: usize, r: &Vector3<f64>, s: &Vector3<f64>) -> [f64; 3] {
        let (n, d) = (&self.n[k], &self.d[k]);
        let (nn, ns) = (n.dot(&self.n[0]), n.dot(s));
        [d.x * n.dot(r), d.y * nn + d.z * ns, d.y * ns - d.z * nn]
    }

    /// Line 2 in its plane fixes θ up to a branch; what line 3 then lacks, eq. (10), with (cos θ, sin θ). `overshoot` is how far the
    /// branch is from its end, negative beyond it, where the two branches' meeting is returned.
    fn close(&self, phi: f64, branch: f64) -> Closing {
        let (r, s) = self.axes(phi);
        let ([a, b, c], [a3, b3, c3]) = (self.terms(1, &r, &s), self.terms(2, &r, &s));
        let squared = b * b + c * c;
        let overshoot = squared - a * a;
        let reach = if 0.0 < overshoot { branch * overshoot.sqrt() } else { 0.0 };
        let (x, y) = (-a * b - reach * c, -a * c + reach * b);
        let scale = 1.0 / (x * x + y * y).sqrt();
        let (cos, sin) = (x * scale, y * scale);
        Closing { overshoot, lack: a3 + b3 * cos + c3 * sin, cos, sin }
    }

    fn rotations(&self) -> LineRotations {
        let mut found = LineRotations::new();
        for branch in [1.0, -1.0] {
            let samples: [Closing; SAMPLES] = core::array::from_fn(|i| self.close(phi_of(i), branch));
            let lack = |phi: f64| self.close(phi, branch).lack;
            let mut take = |phi: f64| {
                if let Some(rotation) = self.rotation(phi, branch).filter(|_| !found.is_full()) {
                    found.push(rotation);
                }
            };
            for i in 0..SAMPLES {
                let run = self.nodes(i, branch, &samples);
                let next = phi_of(i + 1);
                for pair in run.windows(2).filter(|pair| pair[0].phi < next) {
                    zero(&pair[0], &pair[1], lack).into_iter().for_each(&mut take);
                }
                for three in run.windows(3).filter(|three| three[0].phi < next) {
                    dip(&three[0], &three[1], &three[2], lack).into_iter().for_each(&mut take);
                }
            }
        }
        found
    }

    /// Places from sample i to the second after it, as far as the branch reaches; towards its end they draw together with the
    /// square of their distance from it, as the branch turns back there.
    fn nodes(&self, i: usize, branch: f64, samples: &[Closing; SAMPLES]) -> ArrayVec<Node, 8> {
        let node = |phi: f64| Node { phi, lack: self.close(phi, branch).lack };
        let mut nodes = ArrayVec::new();
        for j in [i, i + 1] {
            let (low, high) = (&samples[j % SAMPLES], &samples[(j + 1) % SAMPLES]);
            let (starts, ends) = (0.0 <= low.overshoot, 0.0 <= high.overshoot);
            if starts {
                nodes.push(Node { phi: phi_of(j), lack: low.lack });
            }
            if starts != ends {
                let end = root((phi_of(j), low.overshoot), (phi_of(j + 1), high.overshoot), |phi| {
                    self.close(phi, branch).overshoot
                });
                let far = if starts { phi_of(j) } else { phi_of(j + 1) };
                let mut part = [0.25, 0.0625, 0.0].map(|x: f64| end + (far - end) * x);
                if !starts {
                    part.reverse();
                }
                nodes.extend(part.map(node));
            }
            if !ends {
                return nodes;
            }
        }
        nodes.push(Node { phi: phi_of(i + 2), lack: samples[(i + 2) % SAMPLES].lack });
        nodes
    }

    fn rotation(&self, phi: f64, branch: f64) -> Option<Matrix3<f64>> {
        let Closing { cos, sin, .. } = self.close(phi, branch);
        let (r, s) = self.axes(phi);
        let cam_axes = Matrix3::from_columns(&[r, self.n[0] * cos + s * sin, s * cos - self.n[0] * sin]);
        let rotation = cam_axes * self.frame.transpose();
        rotation.sum().is_finite().then_some(rotation)
    }
}

/// One branch at one φ.
struct Closing {
    overshoot: f64,
    lack: f64,
    cos: f64,
    sin: f64,
}

fn phi_of(i: usize) -> f64 {
    i as f64 * (core::f64::consts::TAU / SAMPLES as f64)
}

/// The closing condition at one place of a branch.
struct Node {
    phi: f64,
    lack: f64,
}

/// The zero between two places with values of different sign; a jump is none.
fn zero(low: &Node, high: &Node, lack: impl Fn(f64) -> f64) -> Option<f64> {
    if (low.lack < 0.0) == (high.lack < 0.0) {
        return None;
    }
    let phi = root((low.phi, low.lack), (high.phi, high.lack), &lack);
    (lack(phi).abs() < CLOSED).then_some(phi)
}

/// Zeros hidden between three places of one sign, the middle one nearest to zero: two, or a touch.
fn dip(before: &Node, here: &Node, after: &Node, lack: impl Fn(f64) -> f64) -> ArrayVec<f64, 2> {
    let mut found = ArrayVec::new();
    let sign = here.lack.signum();
    if !(here.lack * sign <= before.lack * sign && here.lack * sign < after.lack * sign) {
        return found;
    }
    let (mut low, mut high) = (before.phi, after.phi);
    for _ in 0..NARROWINGS {
        let (x, y) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if lack(x) * sign < lack(y) * sign { high = y } else { low = x }
    }
    let phi = 0.5 * (low + high);
    let least = Node { phi, lack: lack(phi) };
    if least.lack * sign < 0.0 {
        found.extend(zero(before, &least, &lack));
        found.extend(zero(&least, after, &lack));
    } else if least.lack * sign < DIP {
        found.push(phi);
    }
    found
}

/// The zero of a function between two places with values of different sign: secants, the value of an end that stays twice halved
/// (Illinois), which closes in from both sides.
fn root(
    (mut low, mut at_low): (f64, f64),
    (mut high, mut at_high): (f64, f64),
    value: impl Fn(f64) -> f64,
) -> f64 {
    let mut stayed = 0;
    for _ in 0..SECANTS {
        let x = high - at_high * (high - low) / (at_high - at_low);
        let at_x = value(x);
        let is_low = (at_x < 0.0) == (at_low < 0.0);
        if !(f64::EPSILON < at_x.abs()) || (high - low).abs() < f64::EPSILON {
            return x;
        }
        if is_low {
            (low, at_low) = (x, at_x);
            at_high *= if stayed == 1 { 0.5 } else { 1.0 };
        } else {
            (high, at_high) = (x, at_x);
            at_low *= if stayed == -1 { 0.5 } else { 1.0 };
        }
        stayed = if is_low { 1 } else { -1 };
    }
    0.5 * (low + high)
}
