"""Writes crates/whisker/tests/contact_tables/{straight,curved}.csv: contacts to 50 digits, by Legendre's integrals of mpmath.

The classical forms of docs/math/whisker_contact.md, eqs. (43), (44): no symmetric integral, no duplication, no addition theorem.
`whisker_contact.py` compares rows of it with a Taylor integration of the elastica. Needs mpmath.
"""

import random
import sys
from pathlib import Path

import mpmath as mp

mp.mp.dps = 60
OUT = Path(__file__).resolve().parents[3] / "crates/whisker/tests/contact_tables"


def straight(ei, fx, fy, m0):
    """(x, y, theta, s, friction angle) of the first zero of the moment, or None."""
    side = -1 if m0 < 0 else 1
    fy, m0 = side * fy, side * m0
    f = mp.sqrt(fx * fx + fy * fy)
    lam, beta = mp.sqrt(f / ei), mp.atan2(fy, -fx)
    c, g = m0 / (2 * mp.sqrt(ei * f)), mp.sin(beta / 2)
    k2 = c * c + g * g
    if k2 >= 1:
        return None
    phi = mp.atan2(g, c)
    u, w = mp.ellipk(k2) - mp.ellipf(phi, k2), mp.ellipe(k2) - mp.ellipe(phi, k2)
    along, across = (2 * w - u) / lam, m0 / f
    ex, ey = fx / f, fy / f
    x, y = -along * ex + across * ey, -along * ey - across * ex
    theta = 2 * mp.asin(mp.sqrt(k2)) - beta
    return x, side * y, side * theta, u / lam, mp.asin(2 * k2 - 1)


def curved(ei, kappa, fx, fy, m0):
    """The same for intrinsic curvature kappa; both kinds of pendulum, mirrored so that its speed at the clamp is positive."""
    side = -1 if kappa + m0 / ei < 0 else 1
    fy, m0, kappa = side * fy, side * m0, side * kappa
    f = mp.sqrt(fx * fx + fy * fy)
    lam, beta = mp.sqrt(f / ei), mp.atan2(fy, -fx)
    c, g, z = (kappa + m0 / ei) / (2 * lam), mp.sin(beta / 2), kappa / (2 * lam)
    k2 = c * c + g * g
    k = mp.sqrt(k2)
    if k2 < 1:
        phi = mp.atan2(g, c)
        if abs(z) > k:
            return None
        stop = mp.acos(z / k)
        ends = [s * stop + 2 * mp.pi * n for n in (-1, 0, 1) for s in (1, -1)]
        end = min(e for e in ends if e > phi)
        u, w = mp.ellipf(end, k2) - mp.ellipf(phi, k2), mp.ellipe(end, k2) - mp.ellipe(phi, k2)
        angle = 2 * mp.asin(k * mp.sin(end))
        along = (2 * w - u) / lam
        s = u / lam
    else:
        m = 1 / k2
        sin2 = k2 - z * z
        if z <= 0 or not 0 <= sin2 <= 1:
            return None
        v0, stop = beta / 2, mp.asin(mp.sqrt(sin2))
        ends = [s * stop + mp.pi * n for n in (-1, 0, 1, 2) for s in (1, -1)]
        end = min(e for e in ends if e > v0)
        u, w = mp.ellipf(end, m) - mp.ellipf(v0, m), mp.ellipe(end, m) - mp.ellipe(v0, m)
        s, along = u / (lam * k), (u - 2 * (u - w) / m) / (lam * k)
        angle = 2 * end
    across = m0 / f
    ex, ey = fx / f, fy / f
    x, y = -along * ex + across * ey, -along * ey - across * ex
    tangent = angle - beta
    friction = mp.asin(-mp.cos(angle))
    return x, side * y, side * tangent, s, friction


def draw(random, dimensionless):
    """A load in decimal digits that a double holds: dimensionless F L^2/EI over six decades, every direction, moments up to k = 1."""
    force = dimensionless * 10 ** random.uniform(-3.0, 1.5)
    angle = random.uniform(-3.14159, 3.14159)
    fx, fy = force * mp.cos(angle), force * mp.sin(angle)
    bound = 2 * abs(mp.sin(angle / 2)) * mp.sqrt(mp.mpf(force))
    moment = bound * random.uniform(-1, 1) * 10 ** random.choice([0.0, 0.0, -1.0, -3.0, -6.0])
    return [mp.mpf(float(v)) for v in (fx, fy, moment)]


EDGES = [
    # Compression exactly along the whisker, weak and strong moment; a pull nearly along it; k near 1; a moment almost none.
    (-1.0, 0.0, 0.5),
    (-1.0, 0.0, 1.9999999),
    (-1.0, 1e-9, 1e-9),
    (1.0, 1e-3, 5e-4),
    (1.0, 1e-6, 5e-7),
    (0.0, 1.0, 1.4142135),
    (0.0, 1.0, 1e-12),
    (0.0, -1.0, 1e-12),
    (-0.3, -1.0, 1e-5),
    (-0.5, 1.0, 1.0),
    (-1e-8, 1e-4, 3e-5),
    (-2.0, 0.5, -0.25),
]


def rows(random):
    loads = [[mp.mpf(v) for v in edge] for edge in EDGES]
    loads += [draw(random, 1) for _ in range(90)]
    return loads


def text(values):
    return ",".join(repr(float(v)) for v in values)


def digits(values):
    return ",".join(mp.nstr(v, 50, strip_zeros=False) for v in values)


def main():
    dice = random.Random(20040217)
    ei = mp.mpf(1)
    lines = ["ei,fx,fy,mz,x,y,theta,s,friction"]
    for load in rows(dice):
        found = straight(ei, *load)
        if found:
            lines.append(text([ei, *load]) + "," + digits(found))
    (OUT / "straight.csv").write_text("\n".join(lines) + "\n")
    bent = ["ei,kappa,fx,fy,mz,x,y,theta,s,friction"]
    kinds = [0, 0]
    for kappa in [1e-9, 0.03, -0.03, 0.4, -0.4, 2.0, -2.0, 8.0]:
        for load in rows(dice)[:: 2 if abs(kappa) < 1 else 1]:
            kappa_m = mp.mpf(kappa)
            found = curved(ei, kappa_m, *load)
            if found:
                q = kappa_m + load[2]
                f = mp.hypot(load[0], load[1])
                kinds[int(q * q / (4 * f) + (1 + load[0] / f) / 2 > 1)] += 1
                bent.append(text([ei, kappa_m, *load]) + "," + digits(found))
    (OUT / "curved.csv").write_text("\n".join(bent) + "\n")
    print(len(lines) - 1, "straight,", kinds[0], "swinging and", kinds[1], "turning over", file=sys.stderr)


if __name__ == "__main__":
    main()
