"""Checks docs/math/p3p.md: eqs. (2), (4)-(13) symbolically, and the polishing step of polynomial.rs. Needs SymPy."""

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

# Section 4: with N = D = 0 the foot of C is on the circle through the camera, A and B for every phi, and stays on its ray.
on = sp.solve([N, D], [s, x], dict=True)[0]
foot = [mu_c[0].subs(on), mu_c[1].subs(on)]
assert sp.simplify(foot[0] * c2 - foot[1] * c1) == 0
circle = foot[0] ** 2 + foot[1] ** 2 - lam * foot[0] - (lam * sp.cos(phi) + 1) / sp.sin(phi) * foot[1]
assert sp.simplify(circle.subs(phi, 2 * sp.atan(sp.Symbol("half", positive=True)))) == 0
assert sp.simplify(K.subs(on)) == 0

# (13): the part of C' along its ray's foot.
along = (c1 * (g - x) + c2 * s) * sp.sin(phi) + (c1 * (s - 1) + c2 * x) * sp.cos(phi)
assert sp.expand(along - c1 * mu_c[0] - c2 * mu_c[1]) == 0

# (5)-(8) as the code has them, scaled by sigma: x = sigma x1, c2 = c2h/sigma, c3 = c3h/sigma, g = kappa/sigma.
sigma, kappa, c2h, c3h = sp.symbols("sigma kappa c2h c3h", positive=True)
w = 1 / sigma**2
scaled = {c2: c2h / sigma, c3: c3h / sigma, g: kappa / sigma, x: x / sigma}
Nh = c2h * (1 - s) + c1 * x
Dh = c2h * kappa - c1 * s * sigma**2 - c2h * x
Kh = sigma**2 * s * (1 - s) + kappa * x - x**2
assert sp.expand(N.subs(scaled, simultaneous=True) * sigma - Nh) == 0
assert sp.expand(D.subs(scaled, simultaneous=True) * sigma**2 - Dh) == 0
assert sp.expand(K.subs(scaled, simultaneous=True) * sigma**2 - Kh) == 0
reach2 = sigma**2 * h**2
unscaled = (x**2 - h**2) * (N**2 + D**2) + c3**2 * K**2
quartic = (x**2 - reach2) * (Nh**2 + w * Dh**2) + w * c3h**2 * Kh**2
assert sp.simplify(unscaled.subs(scaled, simultaneous=True) * sigma**4 - quartic) == 0

# Monic for |c| = 1, coefficients as in the code.
n0, d0, k0, cc = c2h * (1 - s), c2h * kappa - c1 * s * sigma**2, s * (1 - s) * sigma**2, w * c3h**2
c22 = w * c2h**2
r2, r1, r0 = c1**2 + c22, c1 * c2h - c22 * kappa, n0**2 + w * d0**2
code = [
    r2 + cc,
    2 * (r1 - cc * kappa),
    r0 - reach2 * r2 + cc * (kappa**2 - 2 * k0),
    2 * (cc * kappa * k0 - reach2 * r1),
    cc * k0**2 - reach2 * r0,
]
assert all(sp.simplify(a - b) == 0 for a, b in zip(sp.Poly(quartic, x).all_coeffs(), code))

# The Newton slope of the defect u^2 + v^2 - 1 of (7).
rho2 = Nh**2 + w * Dh**2
vv = Kh**2 * cc / rho2
slope = 2 * (x + vv * ((kappa - 2 * x) / Kh - (Nh * c1 - w * Dh * c2h) / rho2)) / reach2
assert sp.simplify(sp.diff((x**2 + vv) / reach2, x) - slope) == 0

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

# (10)-(12): the factors multiply to the quartic when tau solves the resolvent.
b, c, d, e4, tau, alpha = sp.symbols("b c d e tau alpha")
H, I = c - b**2, e4 - 4 * b * d + 3 * c**2
J = e4 * H + c * (2 * b * d - c**2) - d**2
G = d - 3 * b * c + 2 * b**3
depressed = sp.expand((x - b) ** 4 + 4 * b * (x - b) ** 3 + 6 * c * (x - b) ** 2 + 4 * d * (x - b) + e4)
product = sp.expand((x**2 + alpha * x + tau + H - 2 * G / alpha) * (x**2 - alpha * x + tau + H + 2 * G / alpha))
difference = sp.expand((product - depressed).subs(alpha**2, 2 * (tau - 2 * H)))
assert all(sp.simplify(sp.expand(difference.coeff(x, n)).subs(alpha, sp.sqrt(2 * (tau - 2 * H)))) == 0 for n in (1, 2, 3))
constant = difference.coeff(x, 0).subs(alpha, sp.sqrt(2 * (tau - 2 * H)))
assert sp.simplify(constant * (tau - 2 * H) - (tau**3 - I * tau + 2 * J)) == 0
assert sp.expand((tau + H) ** 2 - (I - 3 * H**2) - ((tau + H) ** 2 - depressed.coeff(x, 0))) == 0

print("p3p.md: all equations hold")
