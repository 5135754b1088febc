"""Checks docs/math/whisker_contact.md, eqs. (1)-(44), at random loads to 25 digits or more. Needs mpmath and whisker_contact_table.py."""

import random

import mpmath as mp

import whisker_contact_table as table

mp.mp.dps = 50
EPS = mp.mpf("1e-25")
dice = random.Random(7)


def near(a, b, tolerance=EPS, scale=1):
    assert abs(a - b) < tolerance * max(scale, abs(a), abs(b)), (mp.nstr(a, 20), mp.nstr(b, 20))


def rand(low, high):
    return mp.mpf(dice.uniform(low, high))


def slopes(f, at, h=mp.mpf("1e-10")):
    """Columns of derivatives by central differences, eighth order."""
    weights = [(1, mp.mpf(4) / 5), (2, -mp.mpf(1) / 5), (3, mp.mpf(4) / 105), (4, -mp.mpf(1) / 280)]
    columns = []
    for i in range(len(at)):
        total = None
        for n, w in weights:
            ahead, behind = list(at), list(at)
            ahead[i] += n * h
            behind[i] -= n * h
            part = [w * (p - q) / h for p, q in zip(f(ahead), f(behind))]
            total = part if total is None else [t + p for t, p in zip(total, part)]
        columns.append(total)
    return columns


# (1), (2) by Taylor series; the first zero of M by Newton; (3) along the way.
def integrate(ei, kappa, fx, fy, m0, order=40):
    """(x, y, theta, s) at the first zero of the moment, by series of steps."""
    x, y, th, s = mp.mpf(0), mp.mpf(0), mp.mpf(0), mp.mpf(0)
    lam = mp.sqrt(mp.hypot(fx, fy) / ei)
    step = mp.mpf("0.1") / (lam + abs(kappa) + abs(m0) / ei)
    constant = m0**2 / (2 * ei) + m0 * kappa + fx
    moment = m0
    for _ in range(4000):
        a, b, c, d = [th], [mp.cos(th)], [mp.sin(th)], [moment]  # theta, cos, sin, M
        for n in range(order):
            a.append(((kappa if n == 0 else 0) + d[n] / ei) / (n + 1))
            d.append((fx * c[n] - fy * b[n]) / (n + 1))
            b.append(-mp.fsum((j + 1) * a[j + 1] * c[n - j] for j in range(n + 1)) / (n + 1))
            c.append(mp.fsum((j + 1) * a[j + 1] * b[n - j] for j in range(n + 1)) / (n + 1))

        def value(series, h):
            return mp.polyval(series[::-1], h)

        def integral(series, h):
            return mp.polyval([v / (i + 1) for i, v in enumerate(series)][::-1] + [0], h)

        h = step
        if s > 0 and moment * value(d, step) <= 0 or s == 0 and value(d, step) * m0 <= 0:
            h = step / 2
            for _ in range(60):
                change = value(d, h) / mp.polyval([i * v for i, v in enumerate(d)][1:][::-1], h)
                h -= change
                if abs(change) < mp.mpf("1e-46") * step:
                    break
            assert 0 <= h <= step
        end = moment if h == 0 else value(d, h)
        tangent = fx * mp.cos(value(a, h)) + fy * mp.sin(value(a, h))
        near(end**2 / (2 * ei) + end * kappa + tangent, constant)  # (3)
        x, y, th, s, moment = x + integral(b, h), y + integral(c, h), value(a, h), s + h, end
        if h != step:
            return x, y, th, s
    raise AssertionError("no zero found")


def phase(load):
    """g, h, c, z, m, k2, kc2, lam, beta0, F of a mirrored load, eqs. (5)-(7)."""
    ei, kappa, fx, fy, m0 = load
    f = mp.hypot(fx, fy)
    lam, beta = mp.sqrt(f / ei), mp.atan2(fy, -fx)
    g, h, z, m = mp.sin(beta / 2), mp.cos(beta / 2), kappa / (2 * lam), m0 / (2 * ei * lam)
    c = z + m
    near(h * h - c * c, 1 - c * c - g * g)
    return g, h, c, z, m, c * c + g * g, h * h - c * c, lam, beta, f


def rf(x, y, z):
    return mp.elliprf(x, y, z)


def rd(x, y, z):
    return mp.elliprd(x, y, z)


def curved(load):
    """u, P, g_c, h_c by eqs. (8), (25)-(30); all u by (28), (29), (16), (17)."""
    g, h, c, z, m, k2, kc2, lam, beta, f = phase(load)
    lift = m * (c + z)
    g2, h2 = g * g + lift, h * h - lift
    if g2 < 0 or h2 < 0 or not (kc2 > 0 or c < 0 or z > 0):
        return None
    sign = -1 if kc2 < 0 and c < 0 and g < 0 else 1  # (30)
    gc, hc = sign * mp.sqrt(g2), sign * mp.sqrt(h2)
    n = z * z + gc * gc * h * h
    near(n, k2 - g * g * gc * gc)
    sn = (gc * c * h - g * z * hc) / n  # (25)
    if abs(gc * c * h + g * z * hc) > mp.mpf("1e-3") * abs(gc * c * h):
        near(sn, m * (c + z) / (gc * c * h + g * z * hc))
    cn, dn = (z * c + g * gc * h * hc) / n, (k2 * h * hc + g * gc * z * c) / n  # (26)
    near(sn * sn + cn * cn, 1)
    near(dn * dn + k2 * sn * sn, 1)
    u, d = argument(sn, cn, dn, k2, kc2)
    return u, k2 * d + g * gc * sn, gc, hc  # (27)


def argument(sn, cn, dn, k2, kc2):
    """(u, D(u))"""
    if cn < 0:
        s2 = (1 - cn) / (1 + dn)
        c2, d2 = kc2 * sn**2 / ((dn - cn) * (1 + dn)), kc2 * (1 - cn) / (dn - cn)
    elif dn < 0:
        s2 = (1 - dn) / (k2 * (1 + cn))
        c2 = -kc2 * (1 - dn) / (k2 * (cn - dn))
        d2 = -kc2 * sn**2 / ((cn - dn) * (1 + cn))
    else:
        s2, c2, d2 = sn**2 / ((1 + cn) * (1 + dn)), (cn + dn) / (1 + dn), (cn + dn) / (1 + cn)
    near(s2, (1 - cn) / (1 + dn))  # (28) and (29) alike
    near(c2, (cn + dn) / (1 + dn))
    near(d2, (cn + dn) / (1 + cn))
    s, c, d = mp.sqrt(s2), mp.sqrt(c2) * (-1 if sn < 0 else 1), mp.sqrt(d2)
    if c < 0:
        x, y, z = (c + d) * (c + 1), (d + c) * (d + 1), (1 + c) * (1 + d)  # (17)
        u, big_d = 2 * s * rf(x, y, z), s**3 / 3 * (2 * rd(x, y, z) + 3 / ((1 + c) * (1 + d)))  # (16)
    else:
        u, big_d = s * rf(c * c, d * d, 1), s**3 / 3 * rd(c * c, d * d, 1)  # (15)
    return 2 * u, 2 * big_d + sn * s2  # (28)


def place(load, u, p, gc, hc):
    """x, y, theta, s, phi of a mirrored load, eqs. (9)-(11), (31)."""
    g, h, c, z, m, k2, kc2, lam, beta, f = phase(load)
    a, b = (u - 2 * p) / lam, load[4] / f
    theta = 2 * mp.atan2(gc * h - g * hc, h * hc + g * gc)
    phi = mp.asin(gc**2 - hc**2)
    near(gc**2 - hc**2, 2 * m * (c + z) - mp.cos(beta))
    near(gc * h - g * hc, m * (c + z) / (gc * h + g * hc)) if gc * g > 0 else None
    return (
        a * mp.cos(beta) + b * mp.sin(beta),
        b * mp.cos(beta) - a * mp.sin(beta),
        theta,
        u / lam,
        phi,
    )


def loads(count, curvature):
    found = []
    while len(found) < count:
        force, angle = 10 ** rand(-1, 1), rand(-3.1, 3.1)
        moment = rand(0, 1) * 2 * mp.sqrt(force)
        load = [rand(0.5, 2), curvature * rand(-1, 1), force * mp.cos(angle), force * mp.sin(angle), moment]
        # Not within rounding of a kind's end, where differences of derivatives say nothing.
        answer = curved(load)
        if answer and abs(answer[2] * answer[3]) > mp.mpf("0.05") and abs(1 - phase(load)[5]) > mp.mpf("0.02"):
            found.append(load)
    return found


# (4), (8)-(11), (25)-(31) against Legendre's integrals (43), (44), and both against the series of (1), (2).
kinds = {"swings": 0, "over": 0, "beyond 2K": 0, "negative dn": 0, "c < 0": 0}
for curvature, count in [(0, 15), (1, 60), (6, 60), (20, 40)]:
    for load in loads(count, curvature):
        ei, kappa, fx, fy, m0 = load
        u, p, gc, hc = curved(load)
        ours = place(load, u, p, gc, hc)
        theirs = table.straight(ei, fx, fy, m0) if curvature == 0 else table.curved(ei, kappa, fx, fy, m0)
        for a, b in zip(ours, theirs):
            near(a, b)
        near(mp.sin(ours[4]), (m0**2 / (2 * ei) + m0 * kappa + fx) / mp.hypot(fx, fy))  # (4)
        g, h, c, z, m, k2, kc2, lam, beta, f = phase(load)
        kinds["swings" if kc2 > 0 else "over"] += 1
        kinds["beyond 2K"] += kc2 > 0 and gc * c * h < g * z * hc
        kinds["negative dn"] += k2 * h * hc + g * gc * z * c < 0
        kinds["c < 0"] += c < 0
        if dice.random() < 0.12:
            for a, b in zip(integrate(ei, kappa, fx, fy, m0), ours):
                near(a, b, mp.mpf("1e-35"))
assert min(kinds.values()) > 0, kinds

# (12)-(14), (20): straight rods.
for load in loads(5, 0):
    g, h, c, z, m, k2, kc2, lam, beta, f = phase(load)
    k, kc = mp.sqrt(k2), mp.sqrt(kc2)
    u, p, gc, hc = curved(load)
    near(gc, k)
    near(hc, kc)
    near(mp.ellipfun("sn", u, m=k2), c / (k * h))
    near(mp.ellipfun("cn", u, m=k2), kc * g / (k * h))
    near(mp.ellipfun("dn", u, m=k2), kc / h)
    big_g = mp.quad(lambda v: (mp.ellipfun("sn", v, m=k2) / mp.ellipfun("dn", v, m=k2)) ** 2, [0, u / 2, u])
    near(u - kc2 * big_g, p / k2)  # (13)
    near(mp.quad(lambda v: (mp.ellipfun("cn", v, m=k2) / mp.ellipfun("dn", v, m=k2)) ** 2, [0, u / 2, u]), p / k2)
    near(k * h - kc * g, c * c / (k * h + kc * g))  # (14)
    near(kc * (g + k), kc * c * c / (k - g))  # (20)
    near(kc * g + k * h, c * c / (k * h - kc * g))
    # (15), (16) with signed roots: the scaled arguments of the code.
    x, y, z3 = kc * g, k * kc, k * h
    a1, a2, a3 = (x + y) * (x + z3), (x + y) * (y + z3), (x + z3) * (y + z3)
    near(2 * c * rf(a1, a2, a3), u)
    near(c**3 * (mp.mpf(2) / 3 * rd(a1, a3, a2) + 1 / (y * a2)), big_g)

# (15), (16): the symmetric integrals themselves.
x, y, z = rand(0.1, 1), rand(0.1, 2), rand(0.1, 3)
lam = mp.sqrt(x * y) + mp.sqrt(y * z) + mp.sqrt(z * x)
near(rf(x, y, z), 2 * rf(x + lam, y + lam, z + lam))
near(rd(x, y, z), 2 * rd(x + lam, y + lam, z + lam) + 3 / (mp.sqrt(z) * (z + lam)))
near(x + lam, (mp.sqrt(x) + mp.sqrt(y)) * (mp.sqrt(x) + mp.sqrt(z)))

# (18), (19): the series, of eighth order: halving the deviations divides what is left by 256.
left_f, left_d = [], []
for size in [mp.mpf("1e-2"), mp.mpf("5e-3")]:
    x, y, z = 1 + size, 1 - size / 3, 1 + size / 7
    mean = (x + y + z) / 3
    dx, dy = 1 - x / mean, 1 - y / mean
    dz = -dx - dy
    e2, e3 = dx * dy - dz * dz, dx * dy * dz
    f = 1 - e2 / 10 + e3 / 14 + e2**2 / 24 - 3 * e2 * e3 / 44 - 5 * e2**3 / 208 + 3 * e3**2 / 104 + e2**2 * e3 / 16
    left_f.append(abs(f / mp.sqrt(mean) - rf(x, y, z)))
    mean = (x + y + 3 * z) / 5
    dx, dy = 1 - x / mean, 1 - y / mean
    dz = -(dx + dy) / 3
    e2, e3 = dx * dy - 6 * dz**2, (3 * dx * dy - 8 * dz**2) * dz
    e4, e5 = 3 * (dx * dy - dz**2) * dz**2, dx * dy * dz**3
    d = (
        1 - 3 * e2 / 14 + e3 / 6 + 9 * e2**2 / 88 - 3 * e4 / 22 - 9 * e2 * e3 / 52 + 3 * e5 / 26 - e2**3 / 16
        + 3 * e3**2 / 40 + 3 * e2 * e4 / 20 + 45 * e2**2 * e3 / 272 - 9 * (e3 * e4 + e2 * e5) / 68
    )
    left_d.append(abs(d / mean ** mp.mpf("1.5") - rd(x, y, z)))
for left in (left_f, left_d):
    assert left[0] < mp.mpf("1e-15") and 200 < left[0] / left[1] < 320, left

# (21)-(23) for straight, (33)-(35) for all: derivatives of (u, w, beta_c) by (c, beta0, rho).
def state_values(v, z0):
    """u, w, beta_c of the state (c, beta0) with z = z0 exp(rho), c scaled by exp(rho) too; EI = F = 1."""
    c, beta, rho = v
    c, z = c * mp.e**rho, z0 * mp.e**rho
    load = [mp.mpf(1), 2 * z, -mp.cos(beta), mp.sin(beta), 2 * (c - z)]
    u, p, gc, hc = curved(load)
    return u, u - p, 2 * mp.atan2(gc, hc)


for curvature in (0, 1, 6):
    for load in loads(5, curvature):
        g, h, c, z, m, k2, kc2, lam, beta, f = phase(load)
        u, p, gc, hc = curved([mp.mpf(1), 2 * z, -mp.cos(beta), mp.sin(beta), 2 * m])
        near(u, curved(load)[0])
        numeric = slopes(lambda v: state_values(v, z), [c, beta, mp.mpf(0)])
        q, e = 1 / (k2 * kc2), 1 / (gc * hc)
        uk = (u * k2 - p) * q + z * (kc2 - gc * gc) * e * q
        wk = z * hc / (gc * k2) - p / k2
        analytic = [
            [c * uk + g * h * q, c * wk + g * h / k2, 2 * c * e],
            [
                g * h * uk / 2 - c * (kc2 - g * g) * q / 2,
                g * h * wk / 2 - c * h * h / k2 / 2,
                g * h * e,
            ],
            [
                c * c * (u * k2 - p) * q + c * g * h * q - z * e * (g * g * kc2 + c * c * gc * gc) * q,
                -c * c * p / k2 + c * g * h / k2 - z * hc * g * g / (gc * k2),
                2 * m * (c + z) * e,
            ],
        ]
        for a, b in zip(sum(numeric, []), sum(analytic, [])):
            near(a, b, mp.mpf("1e-24"))
        if curvature == 0:
            qq = p / k2
            big_g = (u - qq) / kc2
            near(analytic[0][0], g * h * q + c * big_g)  # (21)
            near(analytic[1][0], g * h * big_g / 2 - c * (kc2 - g * g) * q / 2)
            near(analytic[0][1], g * h / k2 - c * qq)  # (22)
            near(analytic[1][1], -g * h * qq / 2 - c * h * h / k2 / 2)
            near(analytic[0][2], 2 * c / mp.sqrt(k2 * kc2))  # (23)

        # (24): by the load, and (36)-(38) by the rod.
        def contact(v):
            return place(v, *curved(v))

        ei, kappa, fx, fy, m0 = load
        u, p, gc, hc = curved(load)
        x, y, theta, s, phi = contact(load)
        a, b, big_a = u - 2 * p, m0 / f, (u - 2 * p) / lam
        by = slopes(contact, load)
        for i, (dfx, dfy, dm) in enumerate([(1, 0, 0), (0, 1, 0), (0, 0, 1)]):
            df, dbeta = (fx * dfx + fy * dfy) / f, (fy * dfx - fx * dfy) / f**2
            rho, dc = -df / (2 * f), dm / (2 * ei * lam)
            du, dw, dbc = [analytic[0][j] * dc + analytic[1][j] * dbeta + analytic[2][j] * rho for j in range(3)]
            ds, da, db = (du + u * rho) / lam, (2 * dw - du + a * rho) / lam, (dm - b * df) / f
            dx = mp.cos(beta) * da + mp.sin(beta) * db + y * dbeta
            dy = mp.cos(beta) * db - mp.sin(beta) * da - x * dbeta
            for value, expected in zip(by[2 + i], (dx, dy, dbc - dbeta, ds, dbc * mp.sign(gc * hc))):
                near(value, expected, mp.mpf("1e-23"))
        jacobian = by[2:]
        for i in range(5):
            total = fx * jacobian[0][i] + fy * jacobian[1][i] + m0 * jacobian[2][i]
            near(by[0][i] * ei, -total, mp.mpf("1e-23"))  # (36)
        across = -fx * mp.sin(theta) + fy * mp.cos(theta)
        along = (mp.cos(theta), mp.sin(theta), kappa, 1, kappa * mp.sign(across))
        for i in range(5):
            near(by[1][i], ei * (jacobian[2][i] - along[i] / across), mp.mpf("1e-23"))  # (38)

        def turned(alpha):
            c1, s1 = mp.cos(alpha), mp.sin(alpha)
            v = contact([ei, kappa, c1 * fx + s1 * fy, c1 * fy - s1 * fx, m0])
            return c1 * v[0] - s1 * v[1], s1 * v[0] + c1 * v[1], v[2] + alpha, v[3], v[4]

        for value, i in zip(slopes(lambda v: turned(v[0]), [mp.mpf(0)])[0], range(5)):
            carried = (-y, x, 1, 0, 0)[i]
            near(value, carried + jacobian[0][i] * fy - jacobian[1][i] * fx, mp.mpf("1e-23"))  # (37)

# (32): from zero to zero, beside the series integrated on from just behind the first.
for load in loads(4, 1) + loads(4, 6):
    ei, kappa, fx, fy, m0 = load
    g, h, c, z, m, k2, kc2, lam, beta, f = phase(load)
    u, p, gc, hc = curved(load)
    back = kc2 > 0 or ((gc * hc > 0) == (c < 0))
    g1, h1 = (-gc, hc) if back else (gc, -hc)
    n = z * z + g1 * g1 * hc * hc
    sn = (g1 * z * hc - gc * z * h1) / n
    u1, d1 = argument(sn, (z * z + g1 * gc * hc * h1) / n, (k2 * hc * h1 + g1 * gc * z * z) / n, k2, kc2)
    # The rest of the rod, clamped a little behind the first zero, is a rod of its own with a moment of the other sign.
    small = mp.mpf("1e-3") * u1 / lam
    angle = beta + place(load, u, p, gc, hc)[2]
    mp.mp.dps = 30
    b1, m1 = mp.odefun(lambda _, v: [kappa + v[1] / ei, -f * mp.sin(v[0])], 0, [angle, mp.mpf(0)])(small)
    mp.mp.dps = 50
    rest = integrate(ei, kappa, -f * mp.cos(b1), f * mp.sin(b1), m1)
    near(rest[3] + small, u1 / lam, mp.mpf("1e-24"))

# (39): second order of a quadratic map of normal noise is exact: mean and covariance by moments.
H = [[[rand(-1, 1) for _ in range(3)] for _ in range(3)] for _ in range(2)]
H = [[[h[i][j] + h[j][i] for j in range(3)] for i in range(3)] for h in H]
J = [[rand(-1, 1) for _ in range(3)] for _ in range(2)]
nodes, weights = [-mp.sqrt(3), mp.mpf(0), mp.sqrt(3)], [mp.mpf(1) / 6, mp.mpf(2) / 3, mp.mpf(1) / 6]
second = [[mp.mpf(0)] * 2 for _ in range(2)]
for i in range(3):
    for j in range(3):
        for k in range(3):
            v, w = [nodes[i], nodes[j], nodes[k]], weights[i] * weights[j] * weights[k]
            e = [
                sum(J[r][a] * v[a] for a in range(3)) - sum(H[r][a][b] * v[a] * v[b] for a in range(3) for b in range(3)) / 2
                for r in range(2)
            ]
            for r in range(2):
                for q in range(2):
                    second[r][q] += w * e[r] * e[q]
bias = [sum(H[r][i][i] for i in range(3)) / 2 for r in range(2)]
for r in range(2):
    for q in range(2):
        straight = sum(J[r][i] * J[q][i] for i in range(3))
        bent = sum(H[r][i][j] * H[q][i][j] for i in range(3) for j in range(3)) / 2
        near(second[r][q], straight + bent + bias[r] * bias[q])

# (40): by [x, y, angle] of the hub; (41): the gradient of the pull.
point, hub = [rand(-1, 1), rand(-1, 1)], [rand(-1, 1), rand(-1, 1), rand(-3, 3)]


def world(v):
    c1, s1 = mp.cos(v[2]), mp.sin(v[2])
    return v[0] + c1 * point[0] - s1 * point[1], v[1] + s1 * point[0] + c1 * point[1]


arm = [w - v for w, v in zip(world(hub), hub)]
by = slopes(world, hub)
for a, b in zip(sum(by, []), (1, 0, 0, 1, -arm[1], arm[0])):
    near(a, b)
ei, kappa, load = rand(1, 2), rand(-1, 1), [rand(-1, 1), rand(-1, 1), rand(-1, 1)]


def pull(v):
    return [(v[2] ** 2 / (2 * ei) + v[2] * kappa + v[0]) / mp.hypot(v[0], v[1])]


f, p = mp.hypot(load[0], load[1]), pull(load)[0]
for a, b in zip(
    [column[0] for column in slopes(pull, load)],
    [(1 - p * load[0] / f) / f, -p * load[1] / f / f, (load[2] / ei + kappa) / f],
):
    near(a, b)

print("whisker_contact.md: all equations hold;", kinds)
