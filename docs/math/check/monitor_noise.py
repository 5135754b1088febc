"""Proves the equations of section 9 of monitor.md: scale-free filters against dense Gaussians, the constants, the bound of the ratio.

Run: python3 docs/math/check/monitor_noise.py
"""

import random

import mpmath as mp

mp.mp.dps = 40
random.seed(9)
TINY = mp.mpf(10) ** -28


def close(name, a, b, tiny=TINY):
    error = abs(a - b) / max(1, abs(a))
    assert error < tiny, (name, a, b)
    print(f"ok  {name}")


times = [mp.mpf(t) for t in (0, 1, 2, 4, 7, 30, 31)]
r = [mp.mpf(random.uniform(0.5, 2)) for _ in times]
y = mp.matrix([mp.mpf(random.gauss(0, 1)) for _ in times])
n, onset = len(times), 3


def walk(s2, v, tau, m0):
    """Filter (35) with everything in units of s²: innovations, S̃, and the signature of a step from `onset` on."""
    m, b, mm, mb, bb = mp.mpf(0), mp.mpf(0), m0 / s2, mp.mpf(0), v
    of_m, of_b, rows = mp.mpf(0), mp.mpf(0), []
    for i in range(n):
        if i:
            kept = mp.exp(-(times[i] - times[i - 1]) / tau)
            b, mb, of_b = kept * b, kept * mb, kept * of_b
            bb = v + kept**2 * (bb - v)
        if i == onset:
            of_m, of_b = mp.mpf(1), mp.mpf(0)
        variance = mm + 2 * mb + bb + r[i]
        gain_m, gain_b = (mm + mb) / variance, (mb + bb) / variance
        seen, nu = of_m + of_b, y[i] - m - b
        rows.append((nu, variance, gain_m, seen))
        m, b = m + gain_m * nu, b + gain_b * nu
        of_m, of_b = of_m - gain_m * seen, of_b - gain_b * seen
        mm, mb, bb = mm - gain_m * (mm + mb), mb - gain_m * (mb + bb), bb - gain_b * (mb + bb)
    return rows


def dense(s2, v, tau, m0):
    c = mp.matrix(n, n)
    for i in range(n):
        for j in range(n):
            c[i, j] = m0 + s2 * v * mp.exp(-abs(times[i] - times[j]) / tau) + (s2 * r[i] if i == j else 0)
    return c


s2, v, tau, m0 = mp.mpf("2.3"), mp.mpf("1.2"), mp.mpf(8), mp.mpf("0.4")
rows, c = walk(s2, v, tau, m0), dense(s2, v, tau, m0)
log = sum(-(nu**2 / (s2 * s) + mp.log(s2 * s)) / 2 for nu, s, _, _ in rows)
close("(36) likelihood", log, -((y.T * c**-1 * y)[0] + mp.log(mp.det(c))) / 2)
h = mp.matrix([1 if onset <= i else 0 for i in range(n)])
information = sum(seen**2 / (s2 * s) for _, s, _, seen in rows)
close("(44) information of a step", information, (h.T * c**-1 * h)[0])
score = sum(seen * nu / (s2 * s) for nu, s, _, seen in rows)
close("(7) score of a step", score, (h.T * c**-1 * y)[0])
other = walk(s2 * 5, v, tau, m0 * 5)
close("(36) gains do not depend on s²", sum(a[2] for a in rows), sum(a[2] for a in other))

# (37): E min(z², 11) of a normal z.
density = lambda z: mp.exp(-z * z / 2) / mp.sqrt(2 * mp.pi)
cut = mp.sqrt(11)
mean = 2 * mp.quad(lambda z: z * z * density(z), [0, cut]) + 22 * mp.quad(density, [cut, 20])
close("(37) mean of a square that is cut off", mean, mp.mpf("0.9983"), 1e-5)

# (41): Student's t of five degrees of freedom in six coordinates, covariance one, over the normal density without its (2π)^-3.
at_centre = mp.loggamma(mp.mpf(11) / 2) - mp.loggamma(mp.mpf(5) / 2) - 3 * mp.log(mp.mpf(5) / 2) - 3 * mp.log(mp.mpf(3) / 5)
close("(41) constant", at_centre, mp.mpf("2.4567358"), 1e-7)
sphere = mp.pi**3  # surface of the unit sphere in six dimensions
student = lambda q: mp.exp(at_centre - mp.mpf(11) / 2 * mp.log1p(q / 3)) / (2 * mp.pi) ** 3
close("(41) is a density", mp.quad(lambda x: sphere * x**5 * student(x * x), [0, 1, 4, 20, mp.inf]), mp.mpf(1), 1e-12)
second = mp.quad(lambda x: sphere * x**7 * student(x * x) / 6, [0, 1, 4, 20, 200, mp.inf])
close("(41) has the covariance one", second, mp.mpf(1), 1e-6)

# (40): the ratio against the largest of several models is below the ratio against any of them, whatever the readings.
models = [(mp.mpf(1), mp.mpf(0), mp.mpf(1)), (mp.mpf(1), mp.mpf("1.2"), mp.mpf(8)), (mp.mpf("0.5"), mp.mpf(5), mp.mpf(400))]


def log_likelihoods(of):
    return [-(nu**2 / (of[0] * s) + mp.log(of[0] * s)) / 2 for nu, s, _, _ in walk(*of, mp.mpf("0.1"))]


for _ in range(50):
    for i in range(n):
        y[i] = mp.mpf(random.gauss(0, 2))
    each = [log_likelihoods(of) for of in models]
    then, since = [sum(of[:onset]) for of in each], [sum(of[onset:]) for of in each]
    least = max(then) - mp.mpf("6.9")
    most = max(s - max(0, least - t) for s, t in zip(since, then))
    for t, s in zip(then, since):
        if least <= t:
            assert since[0] - max(since[0], most) <= since[0] - s
print("ok  (40) no model that is not excluded is favoured")

# (53): a parabola through three points is itself between them, and is ln 1000 below its summit at u.
below, best, above = mp.mpf(-31), mp.mpf(2), mp.mpf(-12)
a, b = (above + below) / 2 - best, (above - below) / 2
parabola = lambda u: u * (u - 1) / 2 * below + (1 - u * u) * best + u * (u + 1) / 2 * above
for u, value in ((-1, below), (0, best), (1, above)):
    close(f"(53) passes through {u}", parabola(mp.mpf(u)), value)
furthest = -b / (2 * a) + mp.sqrt(mp.log(1000) / -a)
close("(53) is not excluded so far", parabola(furthest), parabola(-b / (2 * a)) - mp.log(1000))
assert mp.mpf("0.5") < furthest < 1

# (34): weights that are times make R minus the time a martingale: with Λ of mean one, E R after k onsets is the sum of weights.
weights = [mp.mpf(w) for w in (1, 1, 5, 300, 1)]
gamma, c1 = mp.mpf(4), mp.mpf(1)
ratio = lambda z: mp.exp(gamma * z**2 / (2 * (1 + gamma))) / mp.sqrt(1 + gamma)
close("(8) mean of Λ", mp.quad(lambda z: ratio(z) * density(z), [-60, -5, 0, 5, 60]), c1, 1e-12)
close("(34) mean of R", sum(weights) * c1, mp.mpf(308))
print("all equations hold")
