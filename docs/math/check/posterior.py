"""Proves the equations of posterior.md: Laplace's mass, determinant by blocks, the shear, Woodbury, and the change of pivot.

Run: python3 docs/math/check/posterior.py
"""

import random

import mpmath as mp
import sympy as sp

random.seed(4)


def rational(rows, columns):
    return sp.Matrix(rows, columns, lambda i, j: sp.Rational(random.randint(-9, 9), random.randint(2, 7)))


def positive(n):
    a = rational(n, n)
    return a * a.T + sp.eye(n)


def check(name, difference):
    difference = sp.simplify(difference)
    zero = difference == 0 or (hasattr(difference, "is_zero_matrix") and difference.is_zero_matrix)
    assert zero, (name, difference)
    print("ok ", name)


# (2) in one dimension, and by diagonalisation in any: the Gaussian integral.
x, v = sp.symbols("x v", positive=True)
check("(2) Gaussian mass", sp.integrate(sp.exp(-(x**2) / (2 * v)), (x, -sp.oo, sp.oo)) - sp.sqrt(2 * sp.pi * v))

# (3) against quadrature: a likelihood of two unequal, separate minima in one dimension.
mp.mp.dps = 20
chi2 = lambda t: -2 * mp.log(mp.exp(-((t + 6) ** 2) / 2) + mp.exp(-((t - 6) ** 2) / (2 * 4) - mp.mpf("0.7")))
left = mp.quad(lambda t: mp.exp(-chi2(t) / 2), [-20, -6, -1.5])
right = mp.quad(lambda t: mp.exp(-chi2(t) / 2), [-1.5, 6, 30])
said = 1 / (1 + mp.exp(-mp.mpf("0.7")) * 2)
assert abs(left / (left + right) - said) < 1e-4, (left / (left + right), said)
print("ok  (3) weights of separate minima:", mp.nstr(said, 8))

# (1): the density of the invariant measure of rotations in the rotation vector, |det J_l| for J_l the left Jacobian of SO(3).
t = sp.symbols("t", positive=True)
k = sp.Matrix([[0, 0, 0], [0, 0, -t], [0, t, 0]])
left_jacobian = sp.eye(3) + (1 - sp.cos(t)) / t**2 * k + (t - sp.sin(t)) / t**3 * k * k
check("(1) measure of rotations", left_jacobian.det() - 2 * (1 - sp.cos(t)) / t**2)

# (4)
s = positive(6)
ww, wv, vv = s[:3, :3], s[:3, 3:], s[3:, 3:]
check("(4) determinant by blocks", s.det() - ww.det() * (vv - wv.T * ww.inv() * wv).det())

# (6): the shear along two turns with bends across them.
y = sp.symbols("y1:7")
bend = sp.Matrix([0, 0, 2 * y[0] ** 2 + y[0] * y[1], y[1] ** 2, y[0] ** 2 - y[0] * y[1], 3 * y[0] * y[1]])
check("(6) a shear keeps volume", (sp.Matrix(y) + bend).jacobian(y).det() - 1)

# (7)-(10): eight residuals, six unknowns of the pose, three parameters, two of them tied (C singular).
n, m, p = 10, 6, 3
J, K = rational(n, m), rational(n, p)
root = sp.Matrix([[1, 0], [1, 0], [0, 2]])
C = root * root.T
sigma = (J.T * J).inv()
P = sp.eye(n) - J * sigma * J.T
r = P * rational(n, 1)
check("(7) the residual is free of the pose", J.T * r)
h, G = K.T * r, J.T * K
M = K.T * K - G.T * sigma * G
check("(9) M", M - K.T * P * K)
direct = r.T * (sp.eye(n) + P * K * C * K.T * P).inv() * r
woodbury = r.T * r - h.T * C * (sp.eye(p) + M * C).inv() * h
check("(10) Woodbury", direct - woodbury)

# (11): x + ω × x + ν_left = x + ω × (x − c) + ν for all x.
w, c, nu, point = (sp.Matrix(sp.symbols(f"{name}1:4")) for name in ("w", "c", "n", "x"))
about_centre = nu - c.cross(w)
check("(11) change of pivot", (w.cross(point) + nu) - (w.cross(point - c) + about_centre))

# (10a): poses and parameters integrated out, det(JᵀJ … KᵀK + C⁻¹) det C = det JᵀJ det(1 + M C).
jj, kk = rational(7, 3), rational(7, 2)
cc = positive(2)
whole = sp.BlockMatrix([[jj.T * jj, jj.T * kk], [kk.T * jj, kk.T * kk + cc.inv()]]).as_explicit()
mm = kk.T * kk - kk.T * jj * (jj.T * jj).inv() * jj.T * kk
check("(10a) determinant with parameters integrated out", whole.det() * cc.det() - (jj.T * jj).det() * (sp.eye(2) + mm * cc).det())
