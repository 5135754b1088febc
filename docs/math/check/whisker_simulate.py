"""Checks docs/math/whisker_simulate.md: the shape from the contact back to the hub and its derivatives, at 40 digits.

Independent of the formulas: the differential equation (1) solved by Taylor series, derivatives by differences at 40 digits.
Prints the golden values that the Rust tests hold. Exits nonzero where an equation fails.
"""

import sys

import mpmath as mp

mp.mp.dps = 40
FAILED = []


def expect(name, difference, bound=mp.mpf(10) ** -28):
    ok = abs(difference) < bound
    print(f"{'ok  ' if ok else 'FAIL'} {name}: {mp.nstr(abs(difference), 3)}")
    if not ok:
        FAILED.append(name)


def integrated(stiffness, curvature, force, s, phi, end=0):
    """x, y, theta at arc length `end` from equation (1), started at the contact: origin, tangent along x."""
    fx, fy = force * mp.sin(phi), force * mp.cos(phi)

    def slope(back, z):
        x, y, theta = z
        at = s - back
        return [-mp.cos(theta), -mp.sin(theta), -(curvature(at) + (y * fx - x * fy) / stiffness(at))]

    return mp.odefun(slope, 0, [mp.mpf(0)] * 3)(s - end)


def closed(ei, force, s, phi):
    """Equations (5) and (6)."""
    lam = mp.sqrt(force / ei)
    u = lam * s
    k2 = (1 + mp.sin(phi)) / 2
    k, kc = mp.sqrt(k2), mp.sqrt(1 - k2)
    sn, cn, dn = (mp.ellipfun(name, u, m=k2) for name in ("sn", "cn", "dn"))
    am = mp.asin(sn) if u < mp.ellipk(k2) else mp.pi - mp.asin(sn)
    epsilon = mp.ellipe(am, k2)
    s0, c0 = cn / dn, kc * sn / dn
    w = epsilon - k2 * sn * s0
    a, b = (2 * w - u) / lam, 2 * k * c0 / lam
    x = a * mp.sin(phi) - b * mp.cos(phi)
    y = a * mp.cos(phi) + b * mp.sin(phi)
    return [x, y, 2 * (mp.asin(k * s0) - mp.asin(k))]


def closed_derivatives(ei, force, s, phi):
    """Equations (7) and (8): columns by force, arc length, friction angle."""
    lam = mp.sqrt(force / ei)
    u = lam * s
    k2 = (1 + mp.sin(phi)) / 2
    k, kc = mp.sqrt(k2), mp.sqrt(1 - k2)
    sn, cn, d = (mp.ellipfun(name, u, m=k2) for name in ("sn", "cn", "dn"))
    am = mp.asin(sn) if u < mp.ellipk(k2) else mp.pi - mp.asin(sn)
    e = mp.ellipe(am, k2)
    s0, c0 = cn / d, kc * sn / d
    x, y, angle = closed(ei, force, s, phi)
    by_s = [-mp.cos(angle), -mp.sin(angle), -2 * k * c0 * lam]
    by_force = [(by_s[0] * s - x) / (2 * force), (by_s[1] * s - y) / (2 * force), by_s[2] * s / (2 * force)]
    am_k = -d * ((e - kc**2 * u) / (k * kc**2) - k * sn * cn / (kc**2 * d))
    s0_k = (k * cn * sn**2 - kc**2 * sn * am_k) / d**3
    c0_k = (kc * cn * am_k + kc * k * sn**3) / d**3 - k / kc * sn / d
    w_k = d * am_k + (e - u) / k - 2 * k * sn * s0 - k2 * (cn * am_k * s0 + sn * s0_k)
    w = e - k2 * sn * s0
    a, b = (2 * w - u) / lam, 2 * k * c0 / lam
    k_phi = kc / 2
    a_phi, b_phi = 2 * w_k / lam * k_phi, 2 * (c0 + k * c0_k) / lam * k_phi
    along, across = a_phi + b, a - b_phi
    by_phi = [
        along * mp.sin(phi) + across * mp.cos(phi),
        along * mp.cos(phi) - across * mp.sin(phi),
        2 * (s0 + k * s0_k) / mp.sqrt(1 - k2 * s0**2) * k_phi - 1,
    ]
    return [by_force, by_s, by_phi]


def check_closed_form():
    ei = mp.mpf("0.0098")
    for force, s, phi in [("0.05", "0.1", "0"), ("0.3", "0.24", "0.3"), ("0.6", "0.2", "-0.6"), ("1.1", "0.12", "0.9")]:
        force, s, phi = mp.mpf(force), mp.mpf(s), mp.mpf(phi)
        truth = integrated(lambda _: ei, lambda _: 0, force, s, phi)
        form = closed(ei, force, s, phi)
        for name, a, b in zip("xyt", form, truth):
            expect(f"(6) {name} at F={mp.nstr(force, 3)}", a - b)
        columns = closed_derivatives(ei, force, s, phi)
        for column, place in zip(columns, range(3)):
            for row in range(3):

                def value(v, row=row, place=place):
                    at = [force, s, phi]
                    at[place] = v
                    return closed(ei, *at)[row]

                slope = mp.diff(value, [force, s, phi][place])
                expect(f"(7)(8) row {row} column {place}", column[row] - slope, mp.mpf(10) ** -18)


def check_amplitude():
    """(5): the descending Landen transformation."""
    for u, k2 in [("0.3", "0.5"), ("1.7", "0.65"), ("3.1", "0.9")]:
        u, k2 = mp.mpf(u), mp.mpf(k2)
        a, b, power, rounds, sum_c2 = mp.mpf(1), mp.sqrt(1 - k2), mp.mpf(1) / 2, [], k2 / 2
        while True:
            c = (a - b) / 2
            a, b = (a + b) / 2, mp.sqrt(a * b)
            power *= 2
            sum_c2 += power * c * c
            rounds.append((a, c))
            if c < mp.mpf(10) ** -22 * a:
                break
        angle, sum_sin = 2 * power * a * u, mp.mpf(0)
        for a, c in reversed(rounds):
            sum_sin += c * mp.sin(angle)
            angle = (angle + mp.asin(c / a * mp.sin(angle))) / 2
        expect("(5) sn", mp.sin(angle) - mp.ellipfun("sn", u, m=k2))
        expect("(5) E", u * (1 - sum_c2) + sum_sin - mp.ellipe(angle, k2))


def golden_cone():
    """A cone, for the integration's golden values."""
    base, tau, length = mp.mpf("0.0204"), mp.mpf("0.667"), mp.mpf("0.25")
    hub = integrated(
        lambda s: base * (1 - tau * s / length) ** 4,
        lambda _: 0,
        mp.mpf("0.3"),
        mp.mpf("0.23"),
        mp.mpf("0.2"),
    )
    print("golden cone:", [mp.nstr(v, 20) for v in hub])


def check_runge_kutta():
    """(10): every condition that a tableau of order six must meet, in exact fractions."""
    rows = [
        [],
        ["1/3"],
        ["0", "2/3"],
        ["1/12", "1/3", "-1/12"],
        ["-1/16", "9/8", "-3/16", "-3/8"],
        ["0", "9/8", "-3/8", "-3/4", "1/2"],
        ["9/44", "-9/11", "63/44", "18/11", "0", "-16/11"],
    ]
    weights = ["11/120", "0", "27/40", "27/40", "-4/15", "-4/15", "11/120"]
    from fractions import Fraction as Q

    a = [[Q(v) for v in row] for row in rows]
    b = [Q(v) for v in weights]
    c = [sum(row, Q(0)) for row in a]
    full = [row + [Q(0)] * (7 - len(row)) for row in a]
    apply = lambda v: [sum(full[i][j] * v[j] for j in range(7)) for i in range(7)]
    dot = lambda u, v: sum(x * y for x, y in zip(u, v))
    mul = lambda u, v: [x * y for x, y in zip(u, v)]
    for order in range(1, 7):
        expect(f"(10) quadrature of order {order}", float(dot(b, [x ** (order - 1) for x in c]) - Q(1, order)), 1e-30)
    one = [Q(1)] * 7
    tall = c
    for order in range(3, 7):
        tall = apply(tall)
        factorial = 1
        for i in range(2, order + 1):
            factorial *= i
        expect(f"(10) tall tree of order {order}", float(dot(b, tall) - Q(1, factorial)), 1e-30)
    ac, ac2, ac3, ac4 = (apply([x**p for x in c]) for p in (1, 2, 3, 4))
    trees = [
        ("b.c.Ac", dot(b, mul(c, ac)), Q(1, 8)),
        ("b.Ac2", dot(b, ac2), Q(1, 12)),
        ("b.c2.Ac", dot(b, mul(mul(c, c), ac)), Q(1, 10)),
        ("b.Ac.Ac", dot(b, mul(ac, ac)), Q(1, 20)),
        ("b.c.Ac2", dot(b, mul(c, ac2)), Q(1, 15)),
        ("b.Ac3", dot(b, ac3), Q(1, 20)),
        ("b.c3.Ac", dot(b, mul(mul(mul(c, c), c), ac)), Q(1, 12)),
        ("b.c2.Ac2", dot(b, mul(mul(c, c), ac2)), Q(1, 18)),
        ("b.c.Ac3", dot(b, mul(c, ac3)), Q(1, 24)),
        ("b.Ac4", dot(b, ac4), Q(1, 30)),
        ("b.Ac.Ac2", dot(b, mul(ac, ac2)), Q(1, 36)),
        ("b.c.Ac.Ac", dot(b, mul(c, mul(ac, ac))), Q(1, 24)),
        ("b.c.AAc2", dot(b, mul(c, apply(ac2))), Q(1, 72)),
        ("b.A(c.Ac)", dot(b, apply(mul(c, ac))), Q(1, 40)),
        ("b.A(c2.Ac)", dot(b, apply(mul(mul(c, c), ac))), Q(1, 60)),
    ]
    assert dot(b, one) == 1
    for name, found, needed in trees:
        expect(f"(10) tree {name}", float(found - needed), 1e-30)


check_amplitude()
check_closed_form()
check_runge_kutta()
golden_cone()
if FAILED:
    sys.exit(f"{len(FAILED)} equations fail: {FAILED}")
print("all equations hold")
