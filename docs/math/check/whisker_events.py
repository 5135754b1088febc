"""Checks docs/math/whisker_events.md: eqs. (2), (4)-(6), (10), (12), (15), (17)-(19). Needs SymPy and mpmath."""

import mpmath as mp
import sympy as sp

mp.mp.dps = 40


def check(name, error, bound=1e-20):
    print(f"{name}: {mp.nstr(abs(mp.mpf(error)), 3)}")
    assert abs(error) < bound, name


def tail(dof, statistic):
    return mp.gammainc(mp.mpf(dof) / 2, mp.mpf(statistic) / 2) / mp.gamma(mp.mpf(dof) / 2)


# Eq. (2), (7) of the friction page: the gates are the quantiles they are said to be.
check("eq. (2), once", tail(3, "30.665") / mp.mpf("1e-6") - 1, 1e-3)
check("eq. (2), twice", tail(3, "12.838") / mp.mpf("5e-3") - 1, 1e-3)
check("one in 10 000", tail(1, "15.137") / mp.mpf("1e-4") - 1, 1e-3)
# Eq. (4): the object's normal from the force, both sides. F = cos(phi) n + sin(phi) t, n = sigma (-sin, cos).
theta, phi = sp.symbols("theta phi", real=True)
for side in (1, -1):
    t = sp.Matrix([sp.cos(theta), sp.sin(theta)])
    n = side * sp.Matrix([-sp.sin(theta), sp.cos(theta)])
    f = sp.cos(phi) * n + sp.sin(phi) * t
    turn = sp.Matrix([[sp.cos(side * phi), -sp.sin(side * phi)], [sp.sin(side * phi), sp.cos(side * phi)]])
    check(f"eq. (4), side {side}", 0 if sp.simplify(turn * f - n) == sp.zeros(2, 1) else 1)

# Eq. (5): the derivative of x by the normal is rho t, and x starts at p.
a, alpha, r0, r1 = sp.symbols("a alpha r0 r1", real=True)
normal = lambda angle: sp.Matrix([sp.cos(angle), sp.sin(angle)])
across = lambda angle: sp.Matrix([-sp.sin(angle), sp.cos(angle)])
x = r0 * (normal(alpha + a) - normal(alpha)) + r1 * (a * normal(alpha + a) + across(alpha + a) - across(alpha))
check("eq. (5)", 0 if sp.simplify(sp.diff(x, a) - (r0 + r1 * a) * across(alpha + a)) == sp.zeros(2, 1) else 1)
check("eq. (5), start", 0 if sp.simplify(x.subs(a, 0)) == sp.zeros(2, 1) else 1)

# Eq. (6): the latent normal of least squares for a residual linear in it.
c = mp.matrix([[4, 1, mp.mpf("0.3")], [1, 3, mp.mpf("-0.2")], [mp.mpf("0.3"), mp.mpf("-0.2"), 2]])
by = mp.matrix([mp.mpf("0.7"), mp.mpf("-1.1")])  # rho t
seen = mp.matrix([mp.mpf("0.5"), mp.mpf("0.9"), mp.mpf("0.4")])  # x - x(0), alpha - 0
row = mp.matrix([[1, 0, -by[0]], [0, 1, -by[1]]])
residual, spread = row * seen, row * c * row.T
gain = (c * row.T * spread**-1)[2, :]
latent = seen[2] - (gain * residual)[0]


def cost(angle):
    off = mp.matrix([seen[0] - by[0] * angle, seen[1] - by[1] * angle, seen[2] - angle])
    return (off.T * c**-1 * off)[0]


check("eq. (6), stationary", mp.diff(cost, latent))
check("eq. (6), chi2", cost(latent) - (residual.T * spread**-1 * residual)[0])

# Eqs. (9), (10): the normal's derivative by the load.
fx, fy = sp.symbols("fx fy", real=True)
angle = sp.atan2(fy, fx)
check("eq. (10)", 0 if sp.simplify(sp.diff(angle, fx) + fy / (fx**2 + fy**2)) == 0 else 1)
check("eq. (10)", 0 if sp.simplify(sp.diff(angle, fy) - fx / (fx**2 + fy**2)) == 0 else 1)

# Eq. (12): det^2 is linear near a fold; a fold of two equations, z^2 + small terms of higher order.
off = mp.mpf("0.7")


def determinant(travel):
    z = mp.findroot(lambda z: off - travel - z**2 + mp.mpf("0.1") * z**3, mp.sqrt(off - travel))
    return -2 * z + mp.mpf("0.3") * z**2


t0, t1 = off - mp.mpf("2e-6"), off - mp.mpf("1e-6")
d0, d1 = determinant(t0) ** 2, determinant(t1) ** 2
check("eq. (12)", t1 + (t1 - t0) * d1 / (d0 - d1) - off, 1e-9)

# Eq. (15): H along the rod, EI kappa' = M', M' = fx sin - fy cos, and across a normal force.
s, ei, force_n = sp.symbols("s ei N", real=True)
th, m = sp.Function("th")(s), sp.Function("m")(s)
h = m**2 / (2 * ei) + fx * sp.cos(th) + fy * sp.sin(th)
slope = sp.diff(h, s).subs({sp.diff(m, s): fx * sp.sin(th) - fy * sp.cos(th), sp.diff(th, s): m / ei})
check("eq. (15), dH/ds", 0 if sp.simplify(slope) == 0 else 1)
t = sp.Matrix([sp.cos(theta), sp.sin(theta)])
n = sp.Matrix([-sp.sin(theta), sp.cos(theta)])
check("eq. (15), jump", 0 if sp.simplify((force_n * n).dot(t)) == 0 else 1)

# Eqs. (17), (18): the score with the friction angle projected out is the joint least-squares answer and its covariance.
r = mp.matrix([mp.mpf(k * k % 11 - 5) / 3 for k in range(8)])
d = mp.matrix([mp.mpf(k % 3 + 1) / 2 for k in range(8)])
f = mp.matrix([mp.mpf(k * 5 % 7 - 2) for k in range(8)])
design = mp.matrix(8, 2)
design[:, 0], design[:, 1] = d, f
joint = (design.T * design) ** -1
answer = joint * design.T * r
out = lambda v: v - d * (d.T * v)[0] / (d.T * d)[0]
size = (out(f).T * out(r))[0] / (out(f).T * out(f))[0]
check("eq. (18), size", size - answer[1])
check("eq. (18), sigma", 1 / (out(f).T * out(f))[0] - joint[1, 1])

# Eq. (19): covariance of a normal prior updated by rows of unit variance.
prior = mp.diag([mp.mpf("0.2"), mp.mpf("0.5")])
kalman = prior - prior * design.T * (design * prior * design.T + mp.eye(8)) ** -1 * design * prior
check("eq. (19)", mp.norm((design.T * design + prior**-1) ** -1 - kalman))
