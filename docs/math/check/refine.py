"""Checks docs/math/refine.md: Jacobian, step, covariance, moments of the bent ridge, gate, limit. Needs SymPy."""

import itertools
import random

import sympy as sp
from mpmath import erfc, findroot, gammainc, inverse, matrix, mp, mpf, norm, sqrt

mp.dps = 50
random.seed(2)
TINY = mpf(10) ** -40


def skew(w):
    return sp.Matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


w, v, y, c, j, x = (sp.Matrix(sp.symbols(f"{n}1:4")) for n in "wvycjx")
h = sp.symbols("h")

# (3): a row j of the projection's derivative, the point moving by w x y + v.
moved = w.cross(y) + v
assert sp.expand(j.dot(moved) - (y.cross(j).dot(w) + j.dot(v))) == 0

# (7): the same motion about the camera centre.
assert sp.expand((w.cross(x - c) + v) - (w.cross(x) + (v + c.cross(w)))) == sp.zeros(3, 1)

# Cayley's turn is a rotation and equals the exponential to second order.
k = skew(w / 2)
cayley = sp.eye(3) + (k + k * k) * 2 / (1 + w.dot(w) / 4)
assert sp.simplify(cayley.T * cayley - sp.eye(3)) == sp.zeros(3, 3)
K = skew(w)
second = (cayley.subs({a: h * a for a in w}) - (sp.eye(3) + h * K + h**2 * K * K / 2)).diff(h, 2).subs(h, 0)
assert sp.simplify(second) == sp.zeros(3, 3)


def rand(n, m):
    return matrix([[mpf(random.uniform(-1, 1)) for _ in range(m)] for _ in range(n)])


def cross(a):
    return matrix([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


# (5), (7): elimination and transport, as the code writes them, against the plain 6x6 inverse.
for _ in range(10):
    J, g, pivot = rand(12, 6), rand(6, 1), [mpf(random.uniform(-5, 5)) for _ in range(3)]
    H = J.T * J
    rr, rt, tt = H[0:3, 0:3], H[0:3, 3:6], inverse(H[3:6, 3:6])
    gain = rt * tt
    ww = inverse(rr - gain * rt.T)
    turn = ww * (g[0:3, 0] - gain * g[3:6, 0])
    shift = tt * (g[3:6, 0] - rt.T * turn)
    step = inverse(H) * g
    assert norm(step[0:3, 0] - turn) + norm(step[3:6, 0] - shift) < TINY
    wv = -(ww * gain)
    vv = tt - gain.T * wv
    C = cross(pivot)
    across = wv + ww * C.T
    place = vv + C * wv + across.T * C.T
    T = mp.eye(6)
    T[3:6, 0:3] = C
    full = T * inverse(H) * T.T
    assert norm(full[0:3, 3:6] - across) + norm(full[3:6, 3:6] - place) + norm(full[0:3, 0:3] - ww) < TINY
    M = C - gain.T
    assert norm(ww * M.T - across) + norm(tt + M * ww * M.T - place) < TINY
    at_camera = inverse(T).T * g
    assert norm(at_camera[0:3, 0] - (g[0:3, 0] + C * g[3:6, 0])) + norm(at_camera[3:6, 0] - g[3:6, 0]) < TINY

# (8): the triangular root of the information.
p, q, r = sp.symbols("p q r", positive=True)
W = sp.Matrix([[sp.sqrt(p), q / sp.sqrt(p)], [0, sp.sqrt(r - q**2 / p)]])
assert sp.simplify(W.T * W - sp.Matrix([[p, q], [q, r]])) == sp.zeros(2, 2)

# (9): the minimum follows a change of the intrinsics as stated, on a linear model z = A xi + B theta, weight matrix D.
A, B, D, th = rand(9, 6), rand(9, 3), mp.diag([mpf(random.uniform(1, 2)) for _ in range(9)]), rand(3, 1)
residual = -(B * th)  # observed with theta = 0, predicted with theta
assert norm(inverse(A.T * D * A) * (A.T * D * residual) + inverse(A.T * D * A) * (A.T * D * B * th)) < TINY


# (13): second moments over s1, s2 normal.
def moment(n):
    return 0 if n % 2 else sp.factorial2(n - 1) if n else 1


s1, s2 = sp.symbols("s1 s2")
d1, d2, b1, b2, b12 = (sp.Matrix(sp.symbols(f"{n}_1:4")) for n in ("d1", "d2", "b1", "b2", "b12"))
ridge = s1 * d1 + s2 * d2 + s1**2 * b1 + s2**2 * b2 + s1 * s2 * b12


def expectation(term):
    return sum(f * moment(m) * moment(n) for (m, n), f in sp.Poly(term, s1, s2).terms())


second_moment = (ridge * ridge.T).applyfunc(lambda term: sp.expand(expectation(sp.expand(term))))
stated = d1 * d1.T + d2 * d2.T + 3 * b1 * b1.T + 3 * b2 * b2.T + b1 * b2.T + b2 * b1.T + b12 * b12.T
assert sp.expand(second_moment - stated) == sp.zeros(3, 3)
wrong = stated - 2 * (b1 * b2.T + b2 * b1.T)
assert sp.expand(second_moment - wrong) != sp.zeros(3, 3)

# (12): the three bends from probes at +-(P, 0), +-(0, P), +-(q, q), +-(q, -q), q = P/sqrt 2; odd terms drop out.
P = sp.symbols("P", positive=True)
e = sp.Matrix(sp.symbols("e1:4"))  # a cubic term, to be seen dropping out
bend = lambda a, b: (a**2 * b1 + b**2 * b2 + a * b * b12 + (a**3 - b**3) * e)
mean = lambda a, b: (bend(a, b) + bend(-a, -b)) / (2 * P**2)
q = P / sp.sqrt(2)
assert sp.expand(mean(P, 0) - b1) == sp.zeros(3, 1) and sp.expand(mean(0, P) - b2) == sp.zeros(3, 1)
assert sp.simplify(mean(q, q) - mean(q, -q) - b12) == sp.zeros(3, 1)

# The step with both turns held, and the fall of chi2 it brings: g^T step.
for _ in range(5):
    J, g = rand(12, 6), rand(6, 1)
    H = J.T * J
    cov = inverse(H)
    E = rand(6, 2)
    held = cov * g - cov * E * inverse(E.T * cov * E) * (E.T * cov * g)
    assert norm(E.T * held) < TINY
    fall = 2 * (g.T * held)[0] - (held.T * H * held)[0]
    assert abs(fall - (g.T * held)[0]) < TINY
# (11): with eigenvectors of the rotation block, Sigma minus d d^T has nothing left along the turn.
S = inverse(H)
values, vectors = mp.eigsy(S[0:3, 0:3])
axis = vectors[:, 2]
d = S[:, 0:3] * axis / sqrt((axis.T * S[0:3, 0:3] * axis)[0])
assert norm((S - d * d.T)[0:3, 0:3] * axis) < TINY

# (14a): two turns in a row are their sum and half their bracket, to second order: Exp(log) agrees up to h^3.
exp_2 = lambda u: sp.eye(3) + skew(u) + skew(u) ** 2 / 2
both = exp_2(h * w) * exp_2(h * v)
as_one = exp_2(h * w + h * v + h**2 / 2 * w.cross(v))
assert sp.expand((both - as_one).diff(h, 2).subs(h, 0)) == sp.zeros(3, 3)
assert sp.expand((both - exp_2(h * w + h * v)).diff(h, 2).subs(h, 0)) != sp.zeros(3, 3)

# (14b): with principal variances; what is left out is the square of the third over the others.
v1, v2, v3 = sp.symbols("v1:4", positive=True)
minors = v1 * v2 + v1 * v3 + v2 * v3
assert sp.simplify(minors**2 / (v1 * v2 * v3) - v1 * v2 / v3 * (1 + v3 / v1 + v3 / v2) ** 2) == 0

for _ in range(5):
    J, g, E, tau, xi = rand(12, 6), rand(6, 1), rand(6, 2), rand(2, 1), rand(6, 1)
    cov = inverse(J.T * J)
    # (14c): both turns change by tau, and the gradient along what leaves them is spent.
    held = inverse(E.T * cov * E)
    step = cov * E * held * tau + cov * g - cov * E * held * (E.T * cov * g)
    assert norm(E.T * step - tau) < TINY
    assert norm(inverse(cov) * step - g - E * (held * (tau - E.T * cov * g))) < TINY
    # (14d): widened by that much, xi is as far as allowed.
    squared = (xi.T * inverse(cov) * xi)[0]
    allowed = squared / 3
    widened = cov + xi * xi.T * (1 / allowed - 1 / squared)
    assert abs((xi.T * inverse(widened) * xi)[0] - allowed) < TINY * 10**5

# (14e): the error Exp carries the true pivot c - h*v to the answer's c and turns by h*w; its logarithm to second order.
K = skew(h * w)
shift = c - (sp.eye(3) + K + K**2 / 2) * (c - h * v)
logarithm = (sp.eye(3) - K / 2 + K**2 / 12) * shift
stated = h * v + c.cross(h * w) + h**2 * w.cross(v) / 2
for order in (1, 2):
    assert sp.expand((logarithm - stated).diff(h, order).subs(h, 0)) == sp.zeros(3, 1)

# (14f): the fourth moments of a normal vector, component by component, against the products of the blocks.
near = (lambda A: A * A.T)(rand(6, 6))
C = cross([mpf(random.uniform(-5, 5)) for _ in range(3)])
at_pivot = mp.eye(6)
at_pivot[3:6, 0:3] = -C
joint = at_pivot * near * at_pivot.T
turn, both = near[0:3, 0:3], near[0:3, 3:6] + near[0:3, 0:3] * C
shift = near[3:6, 3:6] + near[3:6, 0:3] * C - C * both
assert norm(both - joint[0:3, 3:6]) + norm(shift - joint[3:6, 3:6]) < TINY
trace = lambda A: A[0, 0] + A[1, 1] + A[2, 2]
mixed = lambda A, B: (trace(A) * trace(B) - trace(A * B)) * mp.eye(3) + (A * B + B * A - B * trace(A) - A * trace(B)).T
mean = matrix([both[1, 2] - both[2, 1], both[2, 0] - both[0, 2], both[0, 1] - both[1, 0]])
by_blocks = (mixed(turn, shift) - mixed(both, both.T) + mean * mean.T) / 4
by_components = matrix(3, 3)
for i, a, b, n, e, d in itertools.product(range(3), repeat=6):
    sign = sp.LeviCivita(i, a, b) * sp.LeviCivita(n, e, d)
    if sign:
        w_w, w_d, d_d = joint[a, e] * joint[3 + b, 3 + d], joint[a, 3 + b] * joint[e, 3 + d], joint[a, 3 + d] * joint[e, 3 + b]
        by_components[i, n] += int(sign) * (w_w + w_d + d_d) / 4
assert norm(by_blocks - by_components) < TINY

# (16): the chance that the wrong pose wins by more than the gate is largest at D = sqrt(gate), Phi(-sqrt(gate)).
D_, gate = sp.symbols("D g", positive=True)
critical = sp.solve(sp.diff((D_**2 + gate) / (2 * D_), D_), D_)
assert critical == [sp.sqrt(gate)] and sp.simplify(((D_**2 + gate) / (2 * D_)).subs(D_, sp.sqrt(gate)) - sp.sqrt(gate)) == 0
assert abs(erfc(3 / sqrt(mpf(2))) / 2 - mpf("0.00134989803163")) < mpf(10) ** -12

# (17): Wilson and Hilferty's limit against the exact quantile at 1 - 1e-4; and the normal quantile itself.
assert abs(erfc(mpf("3.719") / sqrt(mpf(2))) / 2 - mpf("1e-4")) < mpf("1e-7")
worst = 0
for dof in list(range(2, 41, 2)) + [60, 100, 122, 200]:
    n = mpf(dof)
    kk = 2 / (9 * n)
    limit = n * (1 - kk + mpf("3.719") * sqrt(kk)) ** 3
    exact = findroot(lambda z: gammainc(n / 2, z / 2, mp.inf, regularized=True) * 10**4 - 1, limit)
    worst = max(worst, abs(limit / exact - 1))
assert worst < mpf("0.05"), worst

print(f"refine.md: all equations hold; limit within {float(worst):.3f} of the exact quantile")

# (21): Huber's moments in two coordinates, in closed form and by integration; 95 % at k = 1.5.
from mpmath import exp, pi, quad  # noqa: E402


def huber(k):
    k = mpf(k)
    weight = lambda s: 1 if s <= k * k else k / sqrt(s)
    mean = lambda fn: quad(lambda s: fn(s) * exp(-s / 2) / 2, [0, k * k, 20, 100, 400])
    return mean(lambda s: weight(s) * s) / 2, mean(lambda s: weight(s) ** 2 * s) / 2


for k in ("1.345", "1.5", "2.5"):
    a, b = huber(k)
    k = mpf(k)
    tail = exp(-k * k / 2)
    assert abs(a - (1 - tail + k / 2 * sqrt(pi / 2) * erfc(k / sqrt(mpf(2))))) < mpf(10) ** -12
    assert abs(b - (1 - tail)) < mpf(10) ** -12
efficiency = lambda k: huber(k)[0] ** 2 / huber(k)[1]
assert abs(efficiency("1.5") - mpf("0.95")) < mpf("0.001") and abs(efficiency("1.345") - mpf("0.935")) < mpf("0.001")

# (19): each loss is concave in s with slope 1 at 0, so the weighted parabola lies above it.
s_, k_ = sp.symbols("s k", positive=True)
for rho in (2 * k_ * sp.sqrt(s_) - k_**2, k_**2 * sp.log(1 + s_ / k_**2)):
    assert sp.simplify(rho.diff(s_, 2)).subs({s_: 7, k_: 2}) < 0
assert sp.simplify((2 * k_ * sp.sqrt(s_) - k_**2).diff(s_).subs(s_, k_**2)) == 1

print("refine.md section 10: losses and their efficiencies hold")

# (8b): the derivative of log det C is tr C⁻¹C′, and what the weights' own change adds to χ² has that mean.
z, s1, s2, k = sp.symbols("z s1 s2 k", positive=True)
root = sp.Matrix([[s1 + k / z, k / z**2], [0, s2 + 2 * k / z]])
spread = root * root.T
inner = sp.simplify((spread.inv() * spread.diff(z)).trace())
assert sp.simplify(sp.log(spread.det()).diff(z) - inner) == 0
# E rᵀA r = tr A C for r of covariance C: with A = C⁻¹C′C⁻¹ the trace above.
assert sp.simplify((spread.inv() * spread.diff(z) * spread.inv() * spread).trace() - inner) == 0
print("ok  (8b) mean of the change of the weights")

# χ² by the weights of every pose falls to 0 as the camera runs into a point; with the log-determinant it does not.
import mpmath as _mp
_mp.mp.dps = 50
_f, _sm, _sp, _x, _u = _mp.mpf(800), _mp.mpf("0.005"), _mp.mpf("0.3"), _mp.mpf("0.3"), _mp.mpf(80)
def _cost(depth):
    by = _mp.matrix([[_f / depth, -_f * _x / depth**2]])
    variance = _sp**2 + _sm**2 * (by * by.T)[0]
    return (_u - _f * _x / depth) ** 2 / variance, _mp.log(variance / _sp**2)
_true, _near = _cost(_mp.mpf(3)), _cost(_mp.mpf("1e-6"))
assert _true[0] < 1e-30 and _near[0] < 1e-6 and 40 < _near[1] - _true[1], (_true, _near)
print("ok  (8a) no false minimum near the points")
