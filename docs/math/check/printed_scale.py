"""Checks docs/math/printed_scale.md: derivatives (3), the pose's answer (4), both axes alike (5), (6), the tilt (7), rigs (8); NEES by Monte Carlo. Needs NumPy, SymPy."""

import numpy as np
import sympy as sp

# (8): every length of a rig longer by one part: each point in each camera is too, and so is each composed pose; no image changes.
from_cam, to_cam = sp.Matrix(3, 3, sp.symbols("a:9")), sp.Matrix(sp.symbols("b:3"))
far, grown = sp.Matrix(sp.symbols("q:3")), sp.Symbol("s", positive=True)
near = from_cam * far + to_cam
assert sp.simplify(from_cam * (grown * far) + grown * to_cam - grown * near) == sp.zeros(3, 1)
assert all(sp.simplify(grown * near[i] / (grown * near[2]) - near[i] / near[2]) == 0 for i in range(2))

# (3): the derivative of the image by the scale along an axis.
x, y, ex, ey = sp.symbols("x y e_x e_y", real=True)
R = sp.Matrix(3, 3, sp.symbols("r:9"))
t = sp.Matrix(sp.symbols("t:3"))
p = R * sp.Matrix([x * (1 + ex), y * (1 + ey), 0]) + t
image = sp.Matrix([p[0] / p[2], p[1] / p[2]])
X = sp.symbols("X:3")
J_pi = sp.Matrix([X[0] / X[2], X[1] / X[2]]).jacobian(X)
at = dict(zip(X, p.subs({ex: 0, ey: 0})))
for axis, (e, coordinate) in enumerate([(ex, x), (ey, y)]):
    column = J_pi.subs(at) * R[:, axis] * coordinate
    assert sp.simplify(image.diff(e).subs({ex: 0, ey: 0}) - column) == sp.zeros(2, 1)

# (5): both axes alike have the image of another distance, to every order, for any rotation.
e = sp.symbols("e", positive=True)
alike = (R * sp.Matrix([x, y, 0]) * (1 + e) + t) / (1 + e)
assert sp.simplify(alike - (R * sp.Matrix([x, y, 0]) + t / (1 + e))) == sp.zeros(3, 1)
assert sp.series(1 / (1 + e), e, 0, 2).removeO() == 1 - e

# (6): the sum and difference of independent errors.
A = sp.Matrix([[sp.Rational(1, 2), sp.Rational(1, 2)], [sp.Rational(1, 2), -sp.Rational(1, 2)]])
s = sp.symbols("s", positive=True)
assert A * (s**2 * sp.eye(2)) * A.T == sp.eye(2) * s**2 / 2

# (7): y is shortened by the tilt; the ratio of the two axes is cos(phi) (1 - eta)/(1 + eta).
phi, eta, dphi = sp.symbols("phi eta dphi")
seen = sp.cos(phi) * (1 - eta) / (1 + eta)
first = sp.solve(sp.cos(phi) - sp.sin(phi) * dphi - sp.series(seen, eta, 0, 2).removeO(), dphi)[0]
assert sp.simplify(first - 2 * eta / sp.tan(phi)) == 0  # found minus true

# (4): a pose by Gauss and Newton from views of prints drawn at random; NEES and chi2 with and without the share.
rng = np.random.default_rng(3)
F, SIGMA, SCALE = 800.0, 0.1, 0.0015
board = np.array([[0.06 * i, 0.06 * j, 0.0] for j in range(6) for i in range(9)])


def skew(w):
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def turn(w):
    a = np.linalg.norm(w)
    k = skew(w / a) if a else np.zeros((3, 3))
    return np.eye(3) + np.sin(a) * k + (1 - np.cos(a)) * k @ k


def project(p):
    return F * p[:, :2] / p[:, 2:]


def derivatives(p):
    J = np.zeros((len(p), 2, 3))
    J[:, 0, 0] = J[:, 1, 1] = F / p[:, 2]
    J[:, :, 2] = -F * p[:, :2] / p[:, 2:] ** 2
    return J


def solve(R, t, points, pixels):
    for _ in range(15):
        p = points @ R.T + t
        D = derivatives(p)
        J = np.concatenate([np.stack([D[i] @ np.hstack([-skew(p[i]), np.eye(3)]) for i in range(len(p))])]).reshape(-1, 6)
        r = (pixels - project(p)).ravel()
        step = np.linalg.solve(J.T @ J, J.T @ r)
        T = turn(step[:3])
        R, t = T @ R, T @ t + step[3:]
        if np.linalg.norm(step) < 1e-12:
            break
    K = np.stack([np.einsum("nij,j,n->ni", D, R[:, a], points[:, a]).ravel() for a in (0, 1)], axis=1)
    return R, t, J / SIGMA, K / SIGMA, r / SIGMA


nees, plain, chi2, chi2_c = [], [], [], []
for _ in range(500):
    w = rng.normal(size=3)
    R = turn(w / np.linalg.norm(w) * rng.uniform(0.2, 1.0))
    t = np.array([0, 0, rng.uniform(1, 3)]) - R @ np.array([0.24, 0.15, 0])
    printed = board * (1 + SCALE * np.append(rng.normal(size=2), 0))
    pixels = project(printed @ R.T + t) + SIGMA * rng.normal(size=(54, 2))
    Rf, tf, J, K, r = solve(R, t, board, pixels)
    S, C = np.linalg.inv(J.T @ J), SCALE**2 * np.eye(2)
    G, M, h = J.T @ K, K.T @ K - (J.T @ K).T @ S @ (J.T @ K), K.T @ r
    wide = S + S @ G @ C @ G.T @ S
    D = Rf @ R.T
    angle = np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]]) / 2
    error = np.concatenate([angle, tf - D @ t])
    nees.append(error @ np.linalg.solve(wide, error))
    plain.append(error @ np.linalg.solve(S, error))
    chi2.append(r @ r / 102)
    chi2_c.append((r @ r - h @ C @ np.linalg.solve(np.eye(2) + M @ C, h)) / 102)
print(f"NEES of 6: {np.mean(nees):.2f} with the scale's share, {np.mean(plain):.0f} without; "
      f"chi2 per degree of freedom {np.mean(chi2_c):.3f}, without {np.mean(chi2):.2f}")
assert 5.2 < np.mean(nees) < 6.8 and 30 < np.mean(plain)
assert 0.95 < np.mean(chi2_c) < 1.05 and 1.03 < np.mean(chi2)
