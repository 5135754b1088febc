"""Checks docs/math/gp3p.md: eqs. (1)-(10) symbolically where short, otherwise at random points to 40 digits. Needs SymPy and mpmath."""

import random

import mpmath as mp
import sympy as sp

mp.mp.dps = 40
random.seed(1)

s, h, g, phi, theta, delta, r = sp.symbols("s h g phi theta delta r", real=True)
gamma = sp.symbols("gamma", positive=True)
w1, w2, w3, o1, o2, o3 = sp.symbols("w1 w2 w3 o1 o2 o3", real=True)
u, v = sp.cos(theta), sp.sin(theta)
on_circle = {r**2: 1 - delta**2}

# (2), (3): n2 = e' x n1, and (e', m', e' x m') is a rotation when r^2 + delta^2 = 1.
e = sp.Matrix([r * sp.cos(phi), r * sp.sin(phi), delta])
n1 = sp.Matrix([-sp.sin(phi), sp.cos(phi), 0])
n2 = sp.Matrix([-delta * sp.cos(phi), -delta * sp.sin(phi), r])
assert sp.simplify(e.cross(n1) - n2) == sp.zeros(3, 1)
m = u * n1 + v * n2
gram = sp.simplify(sp.Matrix([e.dot(e), e.dot(m), m.dot(m)]))
assert sp.simplify(gram.subs(delta, sp.sqrt(1 - r**2)) - sp.Matrix([1, 0, 1])) == sp.zeros(3, 1)

# (1): A' on the ray of A beyond its foot, B' on that of B: B' - A' = e'.
lam, mu = r * (sp.cot(gamma) * sp.sin(phi) - sp.cos(phi)), r * sp.sin(phi) / sp.sin(gamma)
b = sp.Matrix([sp.cos(gamma), sp.sin(gamma), 0])
a_place = lam * sp.Matrix([1, 0, 0])
b_place = delta * sp.Matrix([0, 0, 1]) + mu * b
assert sp.simplify(b_place - a_place - e) == sp.zeros(3, 1)
wp, wq, wn = sp.symbols("wp wq wn", real=True)
foot_b = -wq / sp.sin(gamma)
foot_a = wp + foot_b * sp.cos(gamma)
assert sp.simplify(sp.Matrix([wp, wq, wn]) + foot_b * b - foot_a * sp.Matrix([1, 0, 0]) - sp.Matrix([0, 0, wn])) == sp.zeros(3, 1)
assert sp.simplify(lam - r * sp.sin(phi - gamma) / sp.sin(gamma)) == 0

# (4), (5).
w, o = sp.Matrix([w1, w2, w3]), sp.Matrix([o1, o2, o3])
left = w.dot(r * (g * sp.sin(phi) - sp.cos(phi)) * sp.Matrix([1, 0, 0]) + s * e + h * m - o)
k0, k1, k2 = s * delta * w3 - w.dot(o), r * (s - 1) * w1, r * (g * w1 + s * w2)
big_k = k0 + k1 * sp.cos(phi) + k2 * sp.sin(phi)
big_u = w2 * sp.cos(phi) - w1 * sp.sin(phi)
big_v = r * w3 - delta * (w1 * sp.cos(phi) + w2 * sp.sin(phi))
assert sp.simplify(sp.expand(left - big_k - h * (big_u * u + big_v * v))) == 0
assert sp.simplify(sp.diff(h * (big_u * u + big_v * v), theta) - h * (big_v * u - big_u * v)) == 0

# (6): Cramer's rule.
K1, K2, U1, U2, V1, V2, x, y = sp.symbols("K1 K2 U1 U2 V1 V2 x y")
solution = sp.solve([K1 + U1 * x + V1 * y, K2 + U2 * x + V2 * y], [x, y])
D = U1 * V2 - U2 * V1
assert sp.simplify(solution[x] - (K2 * V1 - K1 * V2) / D) == 0
assert sp.simplify(solution[y] - (K1 * U2 - K2 * U1) / D) == 0

# (9): the parametrisation of an arc.
t, p0, psi = sp.symbols("t p0 psi", real=True)
one = (1 - t) ** 2 + 2 * sp.cos(psi) * t * (1 - t) + t**2
for trig in (sp.cos, sp.sin):
    numerator = trig(p0 - psi) * (1 - t) ** 2 + 2 * trig(p0) * t * (1 - t) + trig(p0 + psi) * t**2
    for place in (sp.Rational(1, 7), sp.Rational(1, 2), sp.Rational(9, 10)):
        angle = p0 + 2 * sp.atan((2 * place - 1) * sp.tan(psi / 2))
        values = {p0: 0.37, psi: 1.9}
        assert abs(sp.N((numerator / one).subs(t, place).subs(values) - trig(angle).subs(values), 30)) < 1e-14

# All together: for random rays, points and pose the octic of (8) in Bernstein form vanishes at the true phi, and (10) is the pose.


def vec(scale=1):
    return mp.matrix([mp.mpf(random.gauss(0, 1)) * scale for _ in range(3)])


def dot(x, y):
    return sum(x[i] * y[i] for i in range(3))


def cross(x, y):
    return mp.matrix([x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]])


def unit(x):
    return x / mp.sqrt(dot(x, x))


def columns(*vectors):
    return mp.matrix([[v[i] for v in vectors] for i in range(3)])


for _ in range(20):
    x = unit(vec())
    y = unit(cross(x, vec()))
    rotation, translation = columns(x, y, cross(x, y)), vec(2)
    places, origins = [vec(), vec(), vec()], [vec(), vec(), vec()]
    seen = [rotation * place + translation for place in places]
    a, b, c = [unit(seen[i] - origins[i]) for i in range(3)]
    base = mp.sqrt(dot(places[1] - places[0], places[1] - places[0]))
    et = (places[1] - places[0]) / base
    normal = cross(et, places[2] - places[0])
    mt = cross(unit(normal), et)
    st, ht = dot(et, places[2] - places[0]) / base, mp.sqrt(dot(normal, normal)) / base
    n = unit(cross(a, b))
    frame = columns(a, cross(n, a), n)
    cos_g, sin_g = dot(a, b), mp.sqrt(dot(cross(a, b), cross(a, b)))
    wb, wc = frame.T * (origins[1] - origins[0]) / base, frame.T * (origins[2] - origins[0]) / base
    fb = -wb[1] / sin_g
    fa = wb[0] + fb * cos_g
    d, rr = wb[2], mp.sqrt(1 - wb[2] ** 2)
    et_rig = frame.T * rotation * et
    ph = mp.atan2(et_rig[1], et_rig[0])
    assert abs(et_rig[2] - d) < 1e-35
    oc, cf = wc - mp.matrix([fa, 0, 0]), frame.T * c
    waves = []
    for ww in (cross(cf, mp.matrix([0, 0, 1])), cross(cf, cross(cf, mp.matrix([0, 0, 1])))):
        kk = [st * d * ww[2] - dot(ww, oc), rr * (st - 1) * ww[0], rr * (cos_g / sin_g * ww[0] + st * ww[1])]
        waves.append((kk, [0, ww[1], -ww[0]], [rr * ww[2], -d * ww[0], -d * ww[1]]))
    # An arc that holds phi, 60 degrees to each side of a point 20 degrees away.
    half, middle = mp.pi / 3, ph + mp.pi / 9
    ends = (middle - half, middle + half)

    def quadratic(wave):
        value = lambda angle, first: first * wave[0] + wave[1] * mp.cos(angle) + wave[2] * mp.sin(angle)
        return [value(ends[0], 1), 2 * value(middle, mp.cos(half)), value(ends[1], 1)]

    def times(p, q):
        product = [mp.mpf(0)] * (len(p) + len(q) - 1)
        for i, pi in enumerate(p):
            for j, qj in enumerate(q):
                product[i + j] += pi * qj
        return product

    minus = lambda p, q: [i - j for i, j in zip(p, q)]
    (q1, q2) = [[quadratic(wave) for wave in three] for three in waves]
    nu = minus(times(q2[0], q1[2]), times(q1[0], q2[2]))
    nv = minus(times(q1[0], q2[1]), times(q2[0], q1[1]))
    dd = minus(times(q1[1], q2[2]), times(q2[1], q1[2]))
    octic = [i + j - ht**2 * k for i, j, k in zip(times(nu, nu), times(nv, nv), times(dd, dd))]
    place = (mp.tan((ph - middle) / 2) / mp.tan(half / 2) + 1) / 2
    value = sum(ck * place**k * (1 - place) ** (8 - k) for k, ck in enumerate(octic))
    assert abs(value) < 1e-30 * max(abs(ck) for ck in octic)
    # (10)
    ev = mp.matrix([rr * mp.cos(ph), rr * mp.sin(ph), d])
    first = mp.matrix([-mp.sin(ph), mp.cos(ph), 0])
    mv = frame.T * rotation * mt
    assert abs(dot(mv, first) ** 2 + dot(mv, cross(ev, first)) ** 2 - 1) < 1e-35
    turn = frame * columns(ev, mv, cross(ev, mv)) * columns(et, mt, cross(et, mt)).T
    depth = base * (fa + rr * mp.sin(ph - mp.atan2(sin_g, cos_g)) / sin_g)
    shift = origins[0] + depth * a - turn * places[0]
    assert mp.norm(turn - rotation) < 1e-33 and mp.norm(shift - translation) < 1e-33

print("gp3p.md: all equations hold")
