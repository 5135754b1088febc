"""Checks docs/math/p3p.md: eqs. (2), (4)-(9) symbolically, and the polishing step of polynomial.rs. Needs SymPy."""

import sympy as sp

s, h, g, x, y, phi, theta = sp.symbols("s h g x y phi theta", real=True)
c1, c2, c3 = sp.symbols("c1 c2 c3", real=True)
gamma = sp.symbols("gamma", positive=True)

# (2): A' = lambda p, B' = A' + e' on the ray (cos gamma, sin gamma).
lam = sp.cot(gamma) * sp.sin(phi) - sp.cos(phi)
b_in_plane = sp.Matrix([lam + sp.cos(phi), sp.sin(phi)])
assert sp.simplify(b_in_plane[0] * sp.sin(gamma) - b_in_plane[1] * sp.cos(gamma)) == 0

# (4): C' = A' + s e' + h m' in the frame (p, q, n).
lam = g * sp.sin(phi) - sp.cos(phi)
e = sp.Matrix([sp.cos(phi), sp.sin(phi), 0])
n1 = sp.Matrix([-sp.sin(phi), sp.cos(phi), 0])
n = sp.Matrix([0, 0, 1])
c_in_cam = sp.Matrix([lam, 0, 0]) + s * e + x * n1 + y * n
mu_c = sp.Matrix([(s - 1) * sp.cos(phi) + (g - x) * sp.sin(phi), s * sp.sin(phi) + x * sp.cos(phi), y])
assert sp.simplify(c_in_cam - mu_c) == sp.zeros(3, 1)

# (5), (6): with (cos phi, sin phi) = (D, N)/rho the first two components are proportional to (c1, c2), with factor K/rho.
N = c2 * (1 - s) + c1 * x
D = c2 * g - c1 * s - c2 * x
K = s * (1 - s) + g * x - x**2
first = (s - 1) * D + (g - x) * N
second = s * N + x * D
assert sp.expand(first * c2 - second * c1) == 0
assert sp.expand(second - K * c2) == 0 and sp.expand(first - K * c1) == 0

# (8): monic for |c| = 1, coefficients as in the code.
quartic = sp.Poly((x**2 - h**2) * (N**2 + D**2) + c3**2 * K**2, x)
n0, d0, s1, cc = c2 * (1 - s), c2 * g - c1 * s, s * (1 - s), c3**2
r2, r1, r0 = c1**2 + c2**2, c1 * n0 - c2 * d0, n0**2 + d0**2
code = [r2 + cc, 2 * (r1 - cc * g), r0 - h**2 * r2 + cc * (g**2 - 2 * s1), 2 * (cc * g * s1 - h**2 * r1), cc * s1**2 - h**2 * r0]
assert all(sp.expand(a - b) == 0 for a, b in zip(quartic.all_coeffs(), code))

# The Newton slope of the defect u^2 + v^2 - 1, v^2 = c3^2 K^2/(rho^2 h^2).
v2 = c3**2 * K**2 / ((N**2 + D**2) * h**2)
slope = 2 * (x / h / h + v2 * ((g - 2 * x) / K - (N * c1 - D * c2) / (N**2 + D**2)))
assert sp.simplify(sp.diff(x**2 / h**2 + v2, x) - slope) == 0

# (9): k' = e' x m' = u n - v n1, and the matrix is a rotation.
u, v = sp.cos(theta), sp.sin(theta)
m = u * n1 + v * n
k = u * n - v * n1
assert sp.simplify(e.cross(m) - k) == sp.zeros(3, 1)
r = sp.Matrix.hstack(e, m, k)
assert sp.simplify(r.T * r - sp.eye(3)) == sp.zeros(3, 3)

# Bairstow's step.
z, p, q, dp, dq, kk, l, rem1, rem0 = sp.symbols("z p q dp dq kk l rem1 rem0")
residue = sp.rem(sp.expand((kk * z + l) * (dp * z + dq)), z**2 + p * z + q, z) - (rem1 * z + rem0)
step = sp.solve(sp.Poly(residue, z).coeffs(), [dp, dq])
determinant = l * l - kk * (p * l - q * kk)
assert sp.simplify(step[dp] - (rem1 * l - rem0 * kk) / determinant) == 0
assert sp.simplify(step[dq] - (rem0 * (l - p * kk) + rem1 * q * kk) / determinant) == 0

# The resolvent in m = alpha^2 for z^4 + P z^2 + Q z + R = (z^2 + alpha z + beta)(z^2 - alpha z + delta).
P, Q, R, alpha = sp.symbols("P Q R alpha")
mean, half_gap = (P + alpha**2) / 2, Q / (2 * alpha)
product = sp.expand((z**2 + alpha * z + mean - half_gap) * (z**2 - alpha * z + mean + half_gap) - (z**4 + P * z**2 + Q * z + R))
resolvent = alpha**6 + 2 * P * alpha**4 + (P**2 - 4 * R) * alpha**2 - Q**2
assert sp.simplify(product - resolvent / (4 * alpha**2)) == 0

print("p3p.md: all equations hold")
