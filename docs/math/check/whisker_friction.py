"""Checks docs/math/whisker_friction.md: eqs. (1), (3), (5), (6), (8), (9), (14), (15), (18), (19), to 40 digits on the straight uniform whisker. Needs SymPy and mpmath."""

import itertools

import mpmath as mp
import sympy as sp

mp.mp.dps = 40
EI, L = mp.mpf("9.817477e-3"), mp.mpf("0.25")
SIGMA = mp.diag([mp.mpf("3.25e-3") ** 2, mp.mpf("3.25e-3") ** 2, mp.mpf("1.63e-5") ** 2])


def check(name, error, bound=mp.mpf("1e-20")):
    print(f"{name}: {mp.nstr(abs(error), 3)}")
    assert abs(error) < bound, name


def dot(a, b):
    return (a.T * b)[0]


# Eq. (1): for the straight uniform whisker F sin phi = mz^2/2EI + fx; its gradient by the product rule is that of the polynomial.
fx, fy, mz, ei, phi_f = sp.symbols("fx fy mz ei phi_f", real=True)
force = sp.sqrt(fx**2 + fy**2)
phi = sp.asin((mz**2 / (2 * ei) + fx) / force)
direct = [sp.diff(mz**2 / (2 * ei) + fx - force * sp.sin(phi_f), v) for v in (fx, fy, mz)]
rule = [sp.diff(force, v) * (sp.sin(phi) - sp.sin(phi_f)) + force * sp.cos(phi) * sp.diff(phi, v) for v in (fx, fy, mz)]
at = {fx: sp.Rational(-1, 5), fy: sp.Rational(2, 5), mz: sp.Rational(6, 100), ei: sp.Rational(98, 10000), phi_f: sp.Rational(1, 10)}
check("eq. (1), gradient", max(abs(sp.N((a - b).subs(at), 40)) for a, b in zip(direct, rule)), 1e-30)


def constraint(load, angle):
    f = mp.sqrt(load[0] ** 2 + load[1] ** 2)
    g = load[2] ** 2 / (2 * EI) + load[0] - f * mp.sin(angle)
    return g, mp.matrix([1 - load[0] / f * mp.sin(angle), -load[1] / f * mp.sin(angle), load[2] / EI])


def project(measured, angle, variance=mp.mpf(0), rounds=200):
    load = measured.copy()
    for _ in range(rounds):
        g, by = constraint(load, angle)
        s = dot(by, SIGMA * by) + variance
        innovation = g + dot(by, measured - load)
        load = measured - SIGMA * by * innovation / s
    return load, innovation, s, by


measured = mp.matrix([mp.mpf("-0.212"), mp.mpf("0.403"), mp.mpf("0.0621")])
load, innovation, s, by = project(measured, mp.mpf("0.02"))
check("eq. (5), the constraint", constraint(load, mp.mpf("0.02"))[0])
# Stationary: the change of the load is Sigma g times a multiplier.
change = measured - load
pull = SIGMA**-1 * change
check("eq. (5), stationary", max(abs(pull[i] * by[0] - pull[0] * by[i]) / abs(pull[0]) for i in range(3)))
check("eq. (6), chi2", innovation**2 / s - dot(change, SIGMA**-1 * change))
soft, soft_innovation, soft_s, _ = project(measured, mp.mpf("0.02"), mp.mpf("1e-5"))
g_soft = constraint(soft, mp.mpf("0.02"))[0]
off = measured - soft
check("eq. (3), soft chi2", soft_innovation**2 / soft_s - dot(off, SIGMA**-1 * off) - g_soft**2 / mp.mpf("1e-5"))

# Eq. (6): covariance of the linear estimator (I - K g^T) l_hat, for any g.
gain = SIGMA * by / s
estimator = mp.eye(3) - gain * by.T
check("eq. (6), covariance", mp.norm(estimator * SIGMA * estimator.T - (SIGMA - SIGMA * by * by.T * SIGMA / s)))

# Eq. (8): the mean square of t^2/2 over a standard normal t.
check("eq. (8)", mp.quad(lambda t: (t**2 / 2) ** 2 * mp.npdf(t), [-mp.inf, 0, mp.inf]) - mp.mpf(3) / 4)

# Eqs. (9), (11): a density across a plane, uniform along it, is the one-dimensional normal density of the distance in phi = G/(F cos phi_f).
normal = mp.matrix([mp.mpf("0.6"), mp.mpf("0.8")])
spread = mp.matrix([[mp.mpf("0.04"), mp.mpf("0.01")], [mp.mpf("0.01"), mp.mpf("0.09")]])
point = mp.matrix([mp.mpf("0.1"), mp.mpf("-0.2")])
inverse, tangent = spread**-1, mp.matrix([-normal[1], normal[0]])


def density(t):
    x = point - tangent * t
    return mp.exp(-dot(x, inverse * x) / 2) / (2 * mp.pi * mp.sqrt(mp.det(spread)))


across = dot(normal, spread * normal)
expected = mp.exp(-dot(normal, point) ** 2 / across / 2) / mp.sqrt(2 * mp.pi * across)
check("eq. (9)", mp.quad(density, mp.linspace(-8, 8, 17)) - expected)

# Eq. (14) against the sum over all paths.
mp_random = [mp.mpf(k % 7 + 1) / 8 for k in range(40)]
evidence = [[mp_random[3 * i + k] for k in range(3)] for i in range(4)]
step = [[mp.mpf("0.89"), mp.mpf("0.01"), mp.mpf("0.1")], [mp.mpf("0.05"), mp.mpf("0.9"), mp.mpf("0.05")], [mp.mpf("0.02"), mp.mpf("0.08"), mp.mpf("0.9")]]
first = [mp.mpf("0.5"), mp.mpf("0.3"), mp.mpf("0.2")]
forward = [[first[k] * evidence[0][k] for k in range(3)]]
for i in range(1, 4):
    forward.append([evidence[i][k] * sum(forward[-1][j] * step[j][k] for j in range(3)) for k in range(3)])
later = [[mp.mpf(1)] * 3]
for i in range(2, -1, -1):
    later.insert(0, [sum(step[j][k] * evidence[i + 1][k] * later[0][k] for k in range(3)) for j in range(3)])
for i, k in itertools.product(range(4), range(3)):
    paths = sum(
        first[p[0]] * mp.fprod(evidence[j][p[j]] for j in range(4)) * mp.fprod(step[p[j - 1]][p[j]] for j in range(1, 4))
        for p in itertools.product(range(3), repeat=4)
        if p[i] == k
    )
    check(f"eq. (14), {i} {k}", forward[i][k] * later[i][k] - paths)

# Eq. (15): the derivative of the minimum of (3) by the friction angle is -2 r F cos(phi_f)/S.
angle, h = mp.mpf("0.02"), mp.mpf("1e-10")


def least(a):
    _, r, s, _ = project(measured, a)
    return r**2 / s


slope = (least(angle + h) - least(angle - h)) / (2 * h)
f = mp.sqrt(load[0] ** 2 + load[1] ** 2)
check("eq. (15), slope", slope + 2 * innovation * f * mp.cos(angle) / s, mp.mpf("1e-14"))

# Eqs. (18), (19): mean and variance of a mixture of two normals, by integration.
p, a, b, sa, sb = mp.mpf("0.3"), mp.mpf(1), mp.mpf(-2), mp.mpf("0.5"), mp.mpf("0.8")
mixture = lambda x: p * mp.npdf(x, a, sa) + (1 - p) * mp.npdf(x, b, sb)
mean = mp.quad(lambda x: x * mixture(x), mp.linspace(-14, 12, 27))
check("eq. (18)", mean - (p * a + (1 - p) * b))
variance = mp.quad(lambda x: (x - mean) ** 2 * mixture(x), mp.linspace(-14, 12, 27))
check("eq. (19)", variance - p * (sa**2 + (a - mean) ** 2) - (1 - p) * (sb**2 + (b - mean) ** 2))
