"""Proves the equations of monitor.md: the recursions against dense Gaussians, the martingale, the edge equation.

Run: python3 docs/math/check/monitor.py
"""

import random

import mpmath as mp
from se3 import adjoint, exp, small_log

mp.mp.dps = 50
random.seed(3)
TINY = mp.mpf(10) ** -38
DAY = mp.mpf(86400)


def close(name, a, b):
    error = abs(a - b) / max(1, abs(a))
    assert error < TINY, (name, a, b)
    print(f"ok  {name}")


s, sigma_b, tau_b, sigma_w, tau_w = (mp.mpf(v) for v in ("0.3", "0.8", "120", "0.5", "864000"))
times = [mp.mpf(t) for t in (0, 40, 95, 170, 400, 460, 1000, 5000)]
noise = [mp.mpf(random.uniform(0.5, 2)) for _ in times]
n = len(times)


def transition(elapsed):
    b, w, turn = mp.exp(-elapsed / tau_b), mp.exp(-elapsed / tau_w), 2 * mp.pi * elapsed / DAY
    f = mp.matrix([[1, 0, 0, 0], [0, b, 0, 0], [0, 0, w * mp.cos(turn), -w * mp.sin(turn)], [0, 0, w * mp.sin(turn), w * mp.cos(turn)]])
    q = mp.diag([0, sigma_b**2 * (1 - b * b), sigma_w**2 * (1 - w * w), sigma_w**2 * (1 - w * w)])
    return f, q


# Dense covariance of all readings under (2).
dense = mp.matrix(n, n)
for i in range(n):
    for j in range(n):
        lag = abs(times[i] - times[j])
        dense[i, j] = s**2 + sigma_b**2 * mp.exp(-lag / tau_b)
        dense[i, j] += sigma_w**2 * mp.exp(-lag / tau_w) * mp.cos(2 * mp.pi * lag / DAY)
    dense[i, i] += noise[i]
y = mp.matrix([mp.mpf(random.uniform(-3, 3)) for _ in range(n)])
inverse = dense**-1
h = mp.matrix([1, 1, 1, 0])


def run(onset, slow):
    """(4)-(7): log-likelihood of the readings, c and d of a change at `onset`."""
    x, p, g = mp.matrix(4, 1), mp.diag([s**2, sigma_b**2, sigma_w**2, sigma_w**2]), mp.matrix(4, 1)
    likelihood, c, d = mp.mpf(0), mp.mpf(0), mp.mpf(0)
    for t in range(n):
        if 0 < t:
            elapsed = times[t] - times[t - 1]
            f, q = transition(elapsed)
            x, p, g = f * x, f * p * f.T + q, f * g
            if slow and onset < t:
                g[0] += elapsed / DAY
        if t == onset and not slow:
            g[0] += 1
        innovation = y[t] - (h.T * x)[0]
        variance = (h.T * p * h)[0] + noise[t]
        gain = p * h / variance
        seen = (h.T * g)[0]
        likelihood -= (innovation**2 / variance + mp.log(2 * mp.pi * variance)) / 2
        c, d = c + seen * innovation / variance, d + seen**2 / variance
        x, p, g = x + gain * innovation, p - gain * variance * gain.T, g - gain * seen
    return likelihood, c, d


likelihood, _, _ = run(0, False)
close("(4) likelihood by innovations", likelihood, -((y.T * inverse * y)[0] + mp.log(mp.det(dense)) + n * mp.log(2 * mp.pi)) / 2)

gamma = mp.mpf(4)
for slow in (False, True):
    for onset in (0, 3, 6):
        _, c, d = run(onset, slow)
        change = mp.matrix([(times[t] - times[onset]) / DAY if slow else 1 if onset <= t else 0 for t in range(n)])
        if slow:
            change = mp.matrix([max(mp.mpf(0), v) for v in change])
        close(f"(7) c, onset {onset}, slow {slow}", c, (change.T * inverse * y)[0])
        close(f"(7) d, onset {onset}, slow {slow}", d, (change.T * inverse * change)[0])
        changed = dense + gamma * change * change.T
        ratio = mp.exp(((y.T * inverse * y)[0] - (y.T * changed**-1 * y)[0]) / 2) * mp.sqrt(mp.det(dense) / mp.det(changed))
        close(f"(8) ratio, onset {onset}, slow {slow}", ratio, (1 + gamma * d) ** mp.mpf(-0.5) * mp.exp(gamma * c * c / (1 + gamma * d) / 2))

# (9), (10): c ~ N(0, d) while nothing moves, so the mean of the ratio is one.
d = mp.mpf("1.7")
mean = mp.quad(
    lambda c: mp.exp(gamma * c * c / (1 + gamma * d) / 2 - c * c / (2 * d)) / mp.sqrt(2 * mp.pi * d * (1 + gamma * d)),
    [-mp.inf, -10, 0, 10, mp.inf],
)
close("(10) the ratio's mean is one", mean, mp.mpf(1))

# (12): the sum stays.
weights, ratios = [mp.mpf("0.3"), mp.mpf("0.7")], [mp.mpf("2.5"), mp.mpf("0.4")]
joined = weights[0] + weights[1] * ratios[1] / ratios[0]
close("(12) joining keeps R", joined * ratios[0], weights[0] * ratios[0] + weights[1] * ratios[1])


def vector(scale):
    return mp.matrix([scale * mp.mpf(random.uniform(-1, 1)) for _ in range(6)])


pose, epsilon = exp(vector(1)), mp.mpf(10) ** -20
alpha, beta = vector(epsilon), vector(epsilon)
now = exp(-alpha) * pose * exp(beta)
seen = small_log(pose * now**-1)
expected = alpha - adjoint(pose) * beta
assert mp.norm(seen - expected) < mp.mpf(10) ** -38, mp.norm(seen - expected)
print("ok  (13) an edge and its nodes, to first order")

# (13) as a whole: exact for motions of any size.
alpha, beta = vector(mp.mpf("0.4")), vector(mp.mpf("0.4"))
now = exp(-alpha) * pose * exp(beta)
whole = pose * exp(-beta) * pose**-1 * exp(alpha)
assert mp.norm(pose * now**-1 - whole) < TINY
print("ok  (13) as a whole")

# (17): the conditional Gaussian, by information.
a = mp.matrix(6, 6)
for i in range(6):
    for j in range(6):
        a[i, j] = mp.mpf(random.uniform(-1, 1))
spread = a * a.T + mp.eye(6)
m = vector(1)
information = spread**-1
# Maximise -(x - m)' I (x - m)/2 over the turn with the shift held at zero.
rr, rt = information[0:3, 0:3], information[0:3, 3:6]
turn = m[0:3] + rr**-1 * rt * m[3:6]
gain = spread[0:3, 3:6] * spread[3:6, 3:6] ** -1
assert mp.norm(turn - (m[0:3] - gain * m[3:6])) < TINY
assert mp.norm(rr**-1 - (spread[0:3, 0:3] - gain * spread[3:6, 0:3])) < TINY
print("ok  (17) the turn, were the shift zero")
