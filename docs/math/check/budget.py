"""Checks docs/math/budget.md: the parts of a covariance. Needs mpmath."""

import random

from mpmath import cholesky, diag, eigsy, eye, inverse, matrix, mp, mpf, norm, sqrt

mp.dps = 50
random.seed(4)
TINY = mpf(10) ** -40


def rand(n, m):
    return matrix([[mpf(random.uniform(-1, 1)) for _ in range(m)] for _ in range(n)])


def covariance(n):
    root = rand(n, n)
    return root * root.T + eye(n) / 10


def is_semidefinite(m):
    return -TINY < min(eigsy((m + m.T) / 2, eigvals_only=True))


for _ in range(5):
    # (1), (2): independent sources, one of them of low rank.
    J, R = rand(14, 6), [covariance(14), covariance(14), (lambda c: c * c.T)(rand(14, 2))]
    W = inverse(R[0] + R[1] + R[2])
    S = inverse(J.T * W * J)
    G = S * J.T * W
    parts = [G * r * G.T for r in R]
    assert norm(parts[0] + parts[1] + parts[2] - S) < TINY and all(map(is_semidefinite, parts))

    # A parameter that is not adjusted: the sum of both is the covariance of G (e + K theta).
    K, C, V = rand(14, 3), covariance(3), R[0]
    S = inverse(J.T * inverse(V) * J)
    G = S * J.T * inverse(V)
    assert norm(G * (V + K * C * K.T) * G.T - (S + G * K * C * K.T * G.T)) < TINY

    # (3), (4): a group of points displaced together, points outside of it, and a prior.
    Jg, Jo = rand(8, 6), rand(8, 6)
    Cg, Pg, Co, Po = covariance(8), covariance(8), covariance(8), covariance(8)
    M, prior = covariance(6), (lambda c: c * c.T)(rand(6, 2))
    Wg, Wo = inverse(Cg + Pg), inverse(Co + Po)
    N = Jg.T * Wg * Jg
    F = inverse(eye(6) + N * M)
    whole = inverse(Cg + Pg + Jg * M * Jg.T)
    assert norm(Jg.T * whole - F * Jg.T * Wg) < TINY and norm(Jg.T * whole * Jg - F * N) < TINY
    assert norm(F * N * F.T + F * N * M * N * F.T - F * N) < TINY
    A = inverse(F * N + Jo.T * Wo * Jo + prior)
    pixels = F * Jg.T * Wg * Cg * Wg * Jg * F.T + Jo.T * Wo * Co * Wo * Jo
    points = F * Jg.T * Wg * Pg * Wg * Jg * F.T + Jo.T * Wo * Po * Wo * Jo
    target = points + F * N * M * N * F.T
    parts = [A * p * A for p in (pixels, target, prior)]
    assert norm(parts[0] + parts[1] + parts[2] - A) < TINY and all(map(is_semidefinite, parts))

    # Without the group's own weights: the gain of the pixels is A F J'C^-1, whatever the group does.
    assert norm(A * Jg.T * whole * Cg * whole * Jg * A - A * F * Jg.T * Wg * Cg * Wg * Jg * F.T * A) < TINY

    # (6): the excess over the least covariance.
    least, other = covariance(6), covariance(6)
    L = cholesky(least)
    w, U = eigsy(inverse(L) * other * inverse(L).T)
    beyond = diag([max(x - 1, mpf(0)) for x in w])
    excess = L * U * beyond * U.T * L.T
    widened = L * U * diag([max(x, mpf(1)) for x in w]) * U.T * L.T
    assert norm(least + excess - widened) < TINY and is_semidefinite(excess)

    # (7): the map between two covariances; it does not depend on which root L is, and is symmetric in the metric of S.
    S, T = covariance(6), covariance(6)
    L = cholesky(S)
    w, U = eigsy(inverse(L) * T * inverse(L).T)
    root = U * diag([sqrt(x) for x in w]) * U.T
    K = L * root * inverse(L)
    assert norm(K * S * K.T - T) < TINY and norm(K * S - (K * S).T) < TINY
    w, V = eigsy(S)
    other = V * diag([sqrt(x) for x in w]) * V.T
    w, U = eigsy(inverse(other) * T * inverse(other).T)
    assert norm(other * U * diag([sqrt(x) for x in w]) * U.T * inverse(other) - K) < TINY

    # (8): the shared block of the inverse between two pulls, bodies eliminated.
    Js, Jb, V = rand(16, 6), rand(16, 6), [covariance(16), covariance(16)]
    W = inverse(V[0] + V[1])
    H_ss, H_sb, H_bb = Js.T * W * Js, Js.T * W * Jb, Jb.T * W * Jb
    P, back = inverse(H_ss - H_sb * inverse(H_bb) * H_sb.T), H_sb * inverse(H_bb)
    total = matrix(6, 6)
    for v in V:
        pull_s, pull_b = Js.T * W, Jb.T * W
        M_ss, M_sb, M_bb = pull_s * v * pull_s.T, pull_s * v * pull_b.T, pull_b * v * pull_b.T
        part = P * (M_ss - back * M_sb.T - M_sb * back.T + back * M_bb * back.T) * P
        gain = P * (pull_s - back * pull_b)
        assert norm(part - gain * v * gain.T) < TINY
        total += part
    assert norm(total - P) < TINY

    # (9): a matrix scaled block by block by at least one stays above itself in each diagonal block, though not as a whole.
    a, b = mpf(random.uniform(1, 3)), mpf(random.uniform(1, 3))
    big = covariance(12)
    D = diag([sqrt(a)] * 6 + [sqrt(b)] * 6)
    beyond = D * big * D - big
    assert is_semidefinite(beyond[0:6, 0:6]) and is_semidefinite(beyond[6:12, 6:12])

    # (10), (11): pixels with a robot's motion eliminated are the same as poses of covariance N^-1.
    N, hand, D = covariance(6), covariance(6), rand(6, 12)
    W, F = inverse(inverse(N) + hand), inverse(eye(6) + N * hand)
    assert norm(W * inverse(N) * W - F * N * F.T) < TINY and norm(W * hand * W - F * N * hand * N * F.T) < TINY
    assert norm(W * inverse(N) * W + W * hand * W - W) < TINY

    # (18): leaving out a pair takes information away, and the mixture's second moment about the answer with all pairs is the sum.
    J = [rand(6, 12) for _ in range(5)]
    everything = inverse(sum((j.T * j for j in J[1:]), J[0].T * J[0]))
    for k in range(3):
        left = [j for i, j in enumerate(J) if i != k]
        without = inverse(sum((j.T * j for j in left[1:]), left[0].T * left[0]))
        assert is_semidefinite(without - everything)

    # (13): the contribution of the shape, from the joint inverse and from the blocks of the information.
    information = covariance(9)
    P = inverse(information)
    tt, ts, ss = P[0:6, 0:6], P[0:6, 6:9], P[6:9, 6:9]
    T = ts * inverse(ss) * ts.T
    A, B = information[0:6, 0:6], information[0:6, 6:9]
    assert norm(inverse(A) - (tt - T)) < TINY and norm(T - inverse(A) * B * ss * B.T * inverse(A)) < TINY
    K = (lambda c: c * c.T)(rand(6, 2)) / 100
    left = inverse(A + K)
    assert is_semidefinite(left - left * K * left) and norm(left * A * left - (left - left * K * left)) < TINY

    # (16): rows of single constraints add up, whatever their sources.
    J, g = rand(15, 6), rand(2, 6)
    C = inverse(J.T * J)
    parts = [J[r, 0:6] * C * g.T for r in range(15)]
    assert norm(sum((v.T * v for v in parts[1:]), parts[0].T * parts[0]) - g * C * g.T) < TINY

    # (17): the gains of one camera with its motion and its intrinsics eliminated.
    J, Kp = rand(12, 6), rand(12, 4)
    U = matrix(12, 10)
    U[0:12, 0:6], U[0:12, 6:10] = J, Kp
    D = matrix(10, 10)
    D[0:6, 0:6], D[6:10, 6:10] = covariance(6), covariance(4)
    own = covariance(12)
    W, R = inverse(own), own + U * D * U.T
    S = U.T * W * U
    E = D * inverse(eye(10) + S * D)
    gain = (J.T - J.T * W * U * E * U.T) * W
    assert norm(gain - J.T * inverse(R)) < TINY and norm(gain * U - J.T * W * U * (eye(10) - E * S)) < TINY
    parts = gain * own * gain.T + gain * U * D * U.T * gain.T
    assert norm(parts - J.T * inverse(R) * J) < TINY

print("budget.md: ok")
