"""Checks docs/math/tag_map.md: eqs. (2)-(10) at random points to 40 digits. Needs mpmath and SymPy."""

import random

import mpmath as mp
import sympy as sp

mp.mp.dps = 40
random.seed(5)

# (2), symbolically: the motion about the centre as one about the pivot.
phi, tau, x, c, ct = (sp.Matrix(sp.symbols(f"{n}1:4", real=True)) for n in ("p", "t", "x", "c", "k"))
left = phi.cross(x - ct) + tau
right = phi.cross(x - c) + (tau + (ct - c).cross(phi))
assert sp.simplify(left - right) == sp.zeros(3, 1)


def matrix(rows, cols):
    return mp.matrix(rows, cols).apply(lambda _: mp.mpf(random.gauss(0, 1)))


def hat(v):
    return mp.matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def blocks(a, b, c, d):
    m = mp.zeros(6)
    for i in range(3):
        for k in range(3):
            m[i, k], m[i, 3 + k], m[3 + i, k], m[3 + i, 3 + k] = a[i, k], b[i, k], c[i, k], d[i, k]
    return m


def near(a, b, tolerance=mp.mpf(10) ** -30):
    difference = a - b
    size = mp.norm(difference, mp.inf) if isinstance(difference, mp.matrix) else abs(difference)
    assert size < tolerance, mp.nstr(size, 5)


one, none = mp.eye(3), mp.zeros(3)
sigma_phi, sigma_tau = mp.mpf("0.014"), mp.mpf("0.01")


def shape(d):
    """(3), and its blocks as group.rs writes them."""
    p = blocks(one, none, hat(d), one)
    s = p * blocks(one * sigma_phi**2, none, none, one * sigma_tau**2) * p.T
    k = hat(d)
    turn = sigma_phi**2
    near(s, blocks(one * turn, k.T * turn, k * turn, one * sigma_tau**2 + k * k.T * turn))
    return s


tags = []
for _ in range(3):
    j, r, k = matrix(8, 6) * 100, matrix(8, 1), matrix(8, 4)
    s = shape(matrix(3, 1))
    n, g = j.T * j, j.T * r
    share = (mp.eye(6) + n * s) ** -1
    e = s * share
    whole = (mp.eye(8) + j * s * j.T) ** -1
    # (5), then (4) and (6) against the whole covariance.
    near(whole, mp.eye(8) - j * e * j.T)
    near(e, (s**-1 + n) ** -1)
    near((r.T * whole * r)[0], (r.T * r)[0] - (g.T * e * g)[0])
    near(j.T * whole * r, share * g)
    near(j.T * whole * j, share * n, mp.mpf(10) ** -26)
    near(j.T * whole * k, share * (j.T * k))
    near(k.T * whole * k, k.T * k - (j.T * k).T * e * (j.T * k))
    near(k.T * whole * r, k.T * r - (j.T * k).T * e * g)
    tags.append((j, r, whole))


def minimum(chosen):
    """Least chi-square of a linear problem, and where."""
    n = sum((j.T * w * j for j, _, w in chosen), mp.zeros(6))
    g = sum((j.T * w * r for j, r, w in chosen), mp.zeros(6, 1))
    at = n**-1 * g
    return sum(((r - j * at).T * w * (r - j * at))[0] for j, r, w in chosen), at, n


# (7): exact where the problem is linear.
total, at, n = minimum(tags)
for t, (j, r, w) in enumerate(tags):
    rest, _, _ = minimum(tags[:t] + tags[t + 1 :])
    left = r - j * at
    g, own = j.T * w * left, j.T * w * j
    # The derivative of the residual is -J, so the gradient's sign does not matter in the form.
    near(total - rest, (left.T * w * left)[0] + (g.T * (n - own) ** -1 * g)[0], mp.mpf(10) ** -25)

# (8) falls in s; (9) is the mean of d given delta = d + noise; (10) is the scale at which T reaches q.
half = matrix(6, 6)
noise, s0 = half * half.T, mp.diag([36, 36, 36, 1, 1, 1])
delta = matrix(6, 1) * 20
forms = [(delta.T * (s0 * mp.mpf(s) ** 2 + noise) ** -1 * delta)[0] for s in ("0.1", "1", "10", "100")]
assert all(b < a for a, b in zip(forms, forms[1:]))
prior = s0 * mp.mpf("0.3")
near(prior * (prior + noise) ** -1 * delta, (prior**-1 + noise**-1) ** -1 * (noise**-1 * delta), mp.mpf(10) ** -25)
q, t = mp.mpf(32), (delta.T * (noise + prior) ** -1 * delta)[0]
small = delta * mp.sqrt(q / t)
near((small.T * (noise + prior) ** -1 * small)[0], q)
print("tag_map.md: eqs. (2)-(10) hold")

# (11)-(13): two tags with a covariance together, a pose by weights that are not theirs; and what is left of each without the common motion.
a = matrix(12, 12)
sigma = a * a.T
columns = mp.zeros(12, 6)
for i in range(6):
    columns[i, i] = columns[6 + i, i] = 1
common = (columns.T * sigma ** -1 * columns) ** -1
rest = sigma - columns * common * columns.T
assert all(-mp.mpf(10) ** -25 < x for x in mp.eigsy(rest, eigvals_only=True))
n_1, n_2 = (lambda b: b * b.T)(matrix(6, 6)), (lambda b: b * b.T)(matrix(6, 6))
total = n_1 + n_2
d = mp.zeros(6, 12)
for t, own in enumerate((n_1, n_2)):
    one_tag = total ** -1 * own
    for i in range(6):
        for k in range(6):
            d[i, 6 * t + k] = one_tag[i, k]
# A common motion moves the pose as a whole, whatever the weights.
near(d * columns, mp.eye(6))
print("tag_map.md (11)-(13): ok")
