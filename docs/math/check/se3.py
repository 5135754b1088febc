"""Rigid motions at 50 digits: what the checks of track.md and monitor.md share."""

import mpmath as mp

mp.mp.dps = 50


def hat(w):
    return mp.matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def exp(xi):
    x = mp.zeros(4)
    x[0:3, 0:3] = hat(xi[0:3])
    for i in range(3):
        x[i, 3] = xi[3 + i]
    total, term = mp.eye(4), mp.eye(4)
    for k in range(1, 80):
        term = term * x / k
        total += term
    return total


def small_log(m):
    return mp.matrix([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 2 * m[0, 3], 2 * m[1, 3], 2 * m[2, 3]]) / 2


def adjoint(m):
    r, t = m[0:3, 0:3], m[0:3, 3]
    ad = mp.zeros(6)
    ad[0:3, 0:3] = r
    ad[3:6, 3:6] = r
    ad[3:6, 0:3] = hat(t) * r
    return ad
