"""Checks docs/math/whisker_integrate.md: (1)-(3), (8) symbolically; (4)-(7), (9)-(13) against 30-digit integration of the
hub-frame equations; prints the golden table of crates/whisker/tests/integrate.rs. Needs SymPy and mpmath."""

import mpmath as mp
import sympy as sp

mp.mp.dps = 30

# (1)-(3): the moment in force axes, its slope, and the constant of the motion where EI and kappa0 are constant.
s, m0, fx, fy, k0, ei, f, phi = sp.symbols("s M0 fx fy kappa0 EI F phi", positive=True)
x, y, theta = (sp.Function(name)(s) for name in ("x", "y", "theta"))
moment = m0 - (x * fy - y * fx)
flow = {x.diff(s): sp.cos(theta), y.diff(s): sp.sin(theta), theta.diff(s): k0 + moment / ei}
force = {fx: f * sp.cos(phi), fy: f * sp.sin(phi)}
alpha = theta - phi
q = x * sp.sin(phi) - y * sp.cos(phi)
p = x * sp.cos(phi) + y * sp.sin(phi)
assert sp.simplify((moment - (m0 - f * q)).subs(force)) == 0
assert sp.simplify((moment.diff(s).subs(flow) - f * sp.sin(alpha)).subs(force)) == 0
assert sp.simplify(p.diff(s).subs(flow) - sp.cos(alpha)) == 0
constant = moment**2 / (2 * ei) + moment * k0 + f * sp.cos(alpha)
assert sp.simplify(constant.diff(s).subs(flow).subs(force)) == 0
# (8): the same in the curvature, where the turning energy exceeds F: k = kappa0 + M/EI never vanishes.
k = k0 + moment / ei
assert sp.simplify(ei * k**2 / 2 - ei * k0**2 / 2 + f * sp.cos(alpha) - constant) == 0


# An independent solution: (x, y, theta) in hub axes, mpmath's own Taylor integrator, knots one by one, the zero by its root finder.
class Rod:
    """EI^(1/4) and kappa0 linear between knots."""

    def __init__(self, knots, ei, curvature):
        self.knots, self.curvature = [mp.mpf(k) for k in knots], [mp.mpf(c) for c in curvature]
        self.root = [mp.mpf(e) ** mp.mpf("0.25") for e in ei]

    def at(self, i, s):
        share = (s - self.knots[i]) / (self.knots[i + 1] - self.knots[i])
        linear = lambda v: v[i] + share * (v[i + 1] - v[i])
        return linear(self.root) ** 4, linear(self.curvature)

    def contact(self, load):
        fx, fy, mz = (mp.mpf(v) for v in load)
        state = [mp.mpf(0)] * 3
        moment = lambda v: mz - (v[0] * fy - v[1] * fx)
        for i in range(len(self.knots) - 1):

            def slope(s, v):
                ei, k0 = self.at(i, s)
                return [mp.cos(v[2]), mp.sin(v[2]), k0 + moment(v) / ei]

            solve = mp.odefun(slope, self.knots[i], state)
            samples = mp.linspace(self.knots[i], self.knots[i + 1], 6)
            values = [moment(solve(s)) for s in samples]
            for a, b, va, vb in zip(samples, samples[1:], values, values[1:]):
                if va * vb < 0:
                    s = mp.findroot(lambda s: moment(solve(s)), (a, b), solver="anderson", tol=mp.mpf(10) ** (-2 * mp.mp.dps + 6))
                    x, y, theta = solve(s)
                    t = fx * mp.cos(theta) + fy * mp.sin(theta)
                    return [x, y, theta, s, mp.asin(t / mp.hypot(fx, fy))]
            state = solve(self.knots[i + 1])
        raise ValueError("no zero")


def cone(ei, taper, k0="0"):
    length = mp.mpf("0.25")
    return Rod([0, length], [mp.mpf(ei), mp.mpf(ei) * (1 - mp.mpf(taper)) ** 4], [k0, k0])


CASES = [
    ("uniform", Rod([0, "0.25"], ["0.0098", "0.0098"], [0, 0]), ("-0.4", "0.47", "0.0885")),
    ("taper", cone("0.02", "0.625"), ("-0.2", "0.45", "0.08")),
    ("taper, right", cone("0.02", "0.625"), ("-0.9", "-0.35", "-0.1375")),
    ("taper, curved", cone("0.02", "0.5", "2.5"), ("-0.1", "0.3", "0.045")),
    (
        "profile",
        Rod(["0", "0.07", "0.1", "0.25"], ["0.02", "0.012", "0.015", "0.003"], ["0", "1.5", "-2", "4"]),
        ("-0.15", "0.4", "0.055"),
    ),
]

print("// name, [fx, fy, mz], [x, y, theta, s, friction angle]")
for name, rod, load in CASES:
    at = rod.contact(load)
    print(f'("{name}", [{", ".join(load)}], [{", ".join(mp.nstr(v, 20) for v in at)}]),')


# (4)-(7): the recurrences, coefficient by coefficient, against the derivatives that mpmath takes of its own solution.
def series(state, force, compliance, rho, curvature, slope, order):
    alpha, moment, p = [state[0]], [state[1]], [state[2]]
    sin, cos, bend = [mp.sin(state[0])], [mp.cos(state[0])], []
    quotients = [mp.mpf(0)] * 4
    for n in range(order):
        carried = moment[n]
        for i in range(4):
            quotients[i] = carried = carried + rho * quotients[i]
        bend.append(compliance * carried + (curvature if n == 0 else slope if n == 1 else 0))
        alpha.append(bend[n] / (n + 1))
        moment.append(force * sin[n] / (n + 1))
        p.append(cos[n] / (n + 1))
        s_next = sum(bend[n - j] * cos[j] for j in range(n + 1)) / (n + 1)
        c_next = -sum(bend[n - j] * sin[j] for j in range(n + 1)) / (n + 1)
        sin.append(s_next), cos.append(c_next)
    return alpha, moment, p


def reference(t, state, force, compliance, rho, curvature, slope):
    def flow(s, v):
        bend = curvature + slope * s + compliance * v[1] / (1 - rho * s) ** 4
        return [bend, force * mp.sin(v[0]), mp.cos(v[0])]

    return mp.odefun(flow, 0, state)(t)


own = [mp.mpf("1.9"), mp.mpf("0.8"), mp.mpf("0.1")], mp.mpf("0.7"), mp.mpf("1.3"), mp.mpf("0.6"), mp.mpf("0.2"), mp.mpf("-0.3")
t = mp.mpf("0.01")
for got, want in zip(series(*own, 20), reference(t, *own)):
    assert abs(mp.polyval(got[::-1], t) - want) < mp.mpf("1e-27"), name


# (9)-(13): derivatives of the contact by the load as the document assembles them, against differences of the contacts above.
def by_load(rod, load):
    fx, fy, mz = (mp.mpf(v) for v in load)
    force, phi = mp.hypot(fx, fy), mp.atan2(fy, fx)
    e, n = mp.matrix([mp.cos(phi), mp.sin(phi)]), mp.matrix([mp.sin(phi), -mp.cos(phi)])
    s_c = rod.contact(load)[3]
    state = [-phi, mz, mp.mpf(0)] + [mp.mpf(v) for v in (1, 0, 0, 0, 1, 0, 0, 0, 0)]
    for i in range(len(rod.knots) - 1):

        def flow(s, v):
            ei, k0 = rod.at(i, s)
            out = [k0 + v[1] / ei, force * mp.sin(v[0]), mp.cos(v[0])]
            for column in range(3):
                d = v[3 + 3 * column : 6 + 3 * column]
                own_force = mp.sin(v[0]) if column == 2 else 0
                out += [d[1] / ei, force * mp.cos(v[0]) * d[0] + own_force, -mp.sin(v[0]) * d[0]]
            return out

        end = min(rod.knots[i + 1], s_c)
        state = mp.odefun(flow, rod.knots[i], state)(end)
        if end == s_c:
            k0 = rod.at(i, s_c)[1]
            break
    sin, cos, p_c = mp.sin(state[0]), mp.cos(state[0]), state[2]
    own = mp.zeros(5, 3)
    for c in range(3):
        da, dm, dp = state[3 + 3 * c : 6 + 3 * c]
        ds = -dm / (force * sin)
        da, dp = da + k0 * ds, dp + cos * ds
        dq = [0, 1 / force, -mz / force**2][c]
        turned = 1 if c == 0 else 0
        dx = e * dp + n * dq + (n * p_c - e * (mz / force)) * turned
        column = [dx[0], dx[1], da - turned, ds, -da * mp.sign(sin)]
        for r in range(5):
            own[r, c] = column[r]
    chain = mp.matrix([[fy / force**2, -fx / force**2, 0], [0, 0, 1], [fx / force, fy / force, 0]])
    return own * chain


mp.mp.dps = 18  # The differences need no more: h^2 is 1e-10.
h = mp.mpf("1e-5")
for name, rod, load in CASES[4:]:
    rod.knots, rod.root, rod.curvature = ([+v for v in values] for values in (rod.knots, rod.root, rod.curvature))
    got = by_load(rod, load)
    for c in range(3):
        ends = []
        for sign in (1, -1):
            moved = [mp.mpf(v) for v in load]
            moved[c] += sign * h
            ends.append(rod.contact(moved))
        for r in range(5):
            want = (ends[0][r] - ends[1][r]) / (2 * h)
            assert abs(got[r, c] - want) < mp.mpf("1e-5") * (1 + abs(want)), (name, r, c, got[r, c], want)
print("whisker_integrate.md: every equation holds")
