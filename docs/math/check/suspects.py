"""Checks docs/math/suspects.md: the noise that fits best (1), the derivative by the focal length (3), what a plane determines (4). Needs NumPy, SymPy."""

import numpy as np
import sympy as sp

# (1): the minimum over s² ≥ 1 of χ²/s² + ν ln s².
chi2, nu, v = sp.symbols("chi2 nu v", positive=True)
deviance = chi2 / v + nu * sp.log(v)
(best,) = sp.solve(sp.diff(deviance, v), v)
assert sp.simplify(best - chi2 / nu) == 0
assert sp.simplify(deviance.subs(v, best) - nu * (1 + sp.log(chi2 / nu))) == 0
assert sp.simplify(deviance.subs(v, 1) - chi2) == 0
assert sp.simplify(sp.diff(deviance, v, 2).subs(v, best)) == nu**3 / chi2**2

# (3): both focal lengths grow by one factor.
fu, fv, a, b, cu, cv, g = sp.symbols("f_u f_v a b c_u c_v g", positive=True)
pixel = sp.Matrix([fu * a + cu, fv * b + cv])
grown = pixel.subs({fu: fu * sp.exp(g), fv: fv * sp.exp(g)}, simultaneous=True)
assert sp.simplify(grown.diff(g).subs(g, 0) - (fu * pixel.diff(fu) + fv * pixel.diff(fv))) == sp.zeros(2, 1)

# (4): pose and principal point move the image of a plane in all eight directions; with log f too, in no other one.
random = np.random.default_rng(7)
points = np.c_[random.uniform(-1, 1, (40, 2)), np.zeros(40)]


def rotation(w):
    angle = np.linalg.norm(w)
    if angle == 0:
        return np.eye(3)
    k = np.cross(np.eye(3), w / angle)
    return np.eye(3) - np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def image(theta):
    x = points @ (rotation(theta[:3]) @ rotation(np.array([0.4, -0.5, 0.2]))).T + [0.1, -0.2, 3.0] + theta[3:6]
    f = 900 * np.exp(theta[8])
    return np.r_[f * x[:, 0] / x[:, 2] + theta[6], f * x[:, 1] / x[:, 2] + theta[7]]


steps = np.array([1e-5] * 6 + [1e-2] * 2 + [1e-5])
jacobian = np.array([(image(np.eye(9)[i] * h) - image(-np.eye(9)[i] * h)) / (2 * h) for i, h in enumerate(steps)]).T
jacobian /= np.linalg.norm(jacobian, axis=0)
assert np.linalg.matrix_rank(jacobian[:, :8], tol=1e-6) == 8
assert np.linalg.matrix_rank(jacobian, tol=1e-6) == 8

print("suspects: ok")
