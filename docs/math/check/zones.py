"""Proves the equations of zones.md: the homography, the derivative (3), the convexity of (6), the prior (8).

Run: python3 docs/math/check/zones.py
"""

import random

import mpmath as mp

mp.mp.dps = 50
random.seed(5)


def vector(n, scale=1.0):
    return mp.matrix([mp.mpf(random.uniform(-scale, scale)) for _ in range(n)])


def hat(w):
    return mp.matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def exp(w):
    total, term = mp.eye(3), mp.eye(3)
    for k in range(1, 80):
        term = term * hat(w) / k
        total += term
    return total


def project(x):
    """A pinhole with one coefficient of distortion."""
    u, v = x[0] / x[2], x[1] / x[2]
    factor = 1 - mp.mpf("0.2") * (u * u + v * v)
    return mp.matrix([700 * u * factor + 640, 710 * v * factor + 480])


for _ in range(20):
    R, t, b = exp(vector(3, 0.3)), vector(3, 0.1), vector(3, 0.4) + mp.matrix([0, 0, 1])
    b = b / mp.norm(b)
    # (2) without distortion is the homography K Rᵀ K⁻¹.
    K = mp.matrix([[700, 0, 640], [0, 710, 480], [0, 0, 1]])
    old = K * b / b[2]
    new = K * R.T * K**-1 * old
    x = R.T * b
    assert mp.norm(new / new[2] - K * x / x[2]) < mp.mpf(10) ** -40
    # (1): the pixel of b/s at the present camera.
    s = mp.mpf(random.uniform(0.01, 0.5))
    assert mp.norm(project(R.T * (b / s - t)) - project(R.T * (b - s * t))) < mp.mpf(10) ** -40
    # (3): the derivative of the direction by a small left motion.
    direction, h = vector(6), mp.mpf(10) ** -20
    w, nu = direction[0:3], direction[3:6]

    def moved(step):
        Rs = exp(w * step) * R
        ts = exp(w * step) * t + nu * step
        return Rs.T * (b - s * ts)

    numeric = (moved(h) - moved(-h)) / (2 * h)
    expected = R.T * (hat(b) * w - s * nu)
    assert mp.norm(numeric - expected) < mp.mpf(10) ** -15, mp.norm(numeric - expected)

# (7): √λ_max(A Σ Aᵀ) is convex in s for A(s) = A0 + s A1.
for _ in range(20):
    A0, A1 = (mp.matrix(2, 6) for _ in range(2))
    L = mp.matrix(6, 6)
    for i in range(2):
        for j in range(6):
            A0[i, j], A1[i, j] = random.uniform(-1, 1), random.uniform(-1, 1)
    for i in range(6):
        for j in range(6):
            L[i, j] = random.uniform(-1, 1)

    def width(s):
        A = (A0 + A1 * s) * L
        return mp.sqrt(max(mp.eigsy(A * A.T, eigvals_only=True)))

    for _ in range(20):
        p, q, part = mp.mpf(random.uniform(0, 2)), mp.mpf(random.uniform(0, 2)), mp.mpf(random.random())
        assert width(part * p + (1 - part) * q) <= part * width(p) + (1 - part) * width(q) + mp.mpf(10) ** -30
# (8): the mean and covariance of a Gaussian after a second measurement 0 ± σ of its last three numbers, in information form.
for _ in range(10):
    L = mp.matrix(6, 6)
    for i in range(6):
        for j in range(6):
            L[i, j] = random.uniform(-1, 1)
    S, sigma = L * L.T + mp.eye(6) * mp.mpf("0.01"), mp.mpf(random.uniform(0.1, 2))
    t = vector(3)
    spread = S[3:6, 3:6] + mp.eye(3) * sigma**2
    G = S[0:6, 3:6] * spread**-1
    after = S - G * S[0:6, 3:6].T
    second = mp.zeros(6)
    for i in range(3, 6):
        second[i, i] = 1 / sigma**2
    information = S**-1 + second
    assert mp.norm(after - information**-1) < mp.mpf(10) ** -35
    # The measured deviation is zero in the chart around M; the shift there is t, so that ν = −t is what the second measurement says.
    right = mp.zeros(6, 1)
    for i in range(3):
        right[3 + i] = -t[i] / sigma**2
    assert mp.norm(-G * t - information**-1 * right) < mp.mpf(10) ** -35
print("zones.md: the homography, the derivative, the convexity and the prior hold")
