"""Proves the equations of track.md: propagation against brute force, the update against dense Gaussians, the volume of the rotations.

Run: python3 docs/math/check/track.py
"""

import random

import mpmath as mp
from se3 import adjoint, exp, small_log

mp.mp.dps = 50
random.seed(11)


def vector(scale):
    return mp.matrix([scale * mp.mpf(random.uniform(-1, 1)) for _ in range(6)])


# (2): exact in ξ for any v; in δv up to vΔ/2, shown by halving.
tiny, x = mp.mpf(10) ** -22, exp(vector(1))
xi = vector(tiny)
v, delta = vector(1), mp.mpf("0.03")
predicted = exp(v * delta) * x
error = small_log(exp(v * delta) * exp(xi) * x * predicted**-1)
assert mp.norm(error - adjoint(exp(v * delta)) * xi) < mp.mpf(10) ** -42
print("ok  (2) an error of the pose is carried by Ad")
dv = vector(tiny)


def neglected(step):
    error = small_log(exp((v + dv) * step) * exp(v * step) ** -1)
    return mp.norm(error - step * dv) / mp.norm(step * dv)


assert neglected(delta) < mp.norm(v) * delta
assert abs(neglected(delta) / neglected(delta / 2) - 2) < mp.mpf("0.05")
print("ok  (2) an error of the twist, the neglected part being of first order in the step")

# (3): noise of a velocity that walks, against its integrals.
q, t = mp.mpf("0.7"), mp.mpf("1.3")
assert abs(mp.quad(lambda s: q * (t - s) ** 2, [0, t]) - q * t**3 / 3) < mp.mpf(10) ** -40
assert abs(mp.quad(lambda s: q * (t - s), [0, t]) - q * t**2 / 2) < mp.mpf(10) ** -40
print("ok  (3) noise of a walking velocity")


def spd(n):
    a = mp.matrix(n, n)
    for i in range(n):
        for j in range(n):
            a[i, j] = mp.mpf(random.uniform(-1, 1))
    return a * a.T + mp.eye(n)


# (4): the conditional Gaussian.
p, r = spd(12), spd(6)
h = mp.zeros(6, 12)
for i in range(6):
    h[i, i] = 1
updated = p - p * h.T * (h * p * h.T + r) ** -1 * h * p
by_information = (p**-1 + h.T * r**-1 * h) ** -1
assert mp.norm(updated - by_information) < mp.mpf(10) ** -40
print("ok  (4) the update is the conditional Gaussian")

# (7): in polar coordinates the shell at |ω| has the area 4π|ω|².
volume = mp.quad(lambda a: 4 * mp.pi * a**2 * (2 * mp.sin(a / 2) / a) ** 2, [0, mp.pi])
assert abs(volume - 8 * mp.pi**2) < mp.mpf(10) ** -40
print("ok  (7) volume of the rotations")
