"""Proves the equations of whisker_calibrate.md: symbolically where they are identities, at 40 digits where they are numbers."""

import random

import sympy as sp
from mpmath import mp, mpf, matrix, findroot, ellipf, ellipe, atan2, sqrt, asin, sin, cos, pi, diff

mp.dps = 40
random.seed(20260)
failed = []


def check(name, error, bound=mpf(10) ** -15):
    ok = abs(error) <= bound
    print(f"{'ok  ' if ok else 'FAIL'} {name}: {mp.nstr(mpf(error), 3)}")
    if not ok:
        failed.append(name)


def rand(rows, columns):
    return matrix(rows, columns) + matrix([[mpf(random.uniform(-1, 1)) for _ in range(columns)] for _ in range(rows)])


def positive(n):
    a = rand(n, n)
    return a * a.T + mp.eye(n) * mpf("0.3")


# (1), (2): derivatives by the parameters as calibrate/model.rs has them.
rx, ry, rm, zx, zy, zm, gf, gm, de, px, py = sp.symbols("rx ry rm zx zy zm gf gm delta px py", real=True)
d = sp.Matrix([rx - zx, ry - zy])
turn = sp.Matrix([[sp.cos(de), -sp.sin(de)], [sp.sin(de), sp.cos(de)]])
f = sp.exp(gf) * turn * d
moment = sp.exp(gm) * (rm - zm) + px * f[1] - py * f[0]
load = sp.Matrix([f[0], f[1], moment])
across = sp.Matrix([-f[1], f[0]])
expected = {
    gf: sp.Matrix([f[0], f[1], px * f[1] - py * f[0]]),
    gm: sp.Matrix([0, 0, sp.exp(gm) * (rm - zm)]),
    de: sp.Matrix([across[0], across[1], px * across[1] - py * across[0]]),
    px: sp.Matrix([0, 0, f[1]]),
    py: sp.Matrix([0, 0, -f[0]]),
}
for symbol, column in expected.items():
    check(f"(1)-(2) by {symbol}", 0 if sp.simplify(load.diff(symbol) - column) == sp.zeros(3, 1) else 1)
check("(1)-(2) by the zeros", 0 if sp.simplify(load.diff(zx) + load.diff(rx)) == sp.zeros(3, 1) else 1)


# (8): the closed form of the straight whisker under a common factor, and its derivative by ln EI.
def contact(ei, fx, fy, m0):
    force = sqrt(fx * fx + fy * fy)
    lam = sqrt(force / ei)
    beta = atan2(fy, -fx)
    c, g = m0 / (2 * sqrt(ei * force)), sin(beta / 2)
    k2 = c * c + g * g
    phi = atan2(g, c)
    u = ellipf(pi / 2, k2) - ellipf(phi, k2)
    w = ellipe(pi / 2, k2) - ellipe(phi, k2)
    a, b = (2 * w - u) / lam, m0 / force
    return [-a * fx / force + b * fy / force, -a * fy / force - b * fx / force, 2 * asin(sqrt(k2)) - beta, u / lam]


ei, loads = mpf("0.0098"), [mpf("-0.2"), mpf("0.35"), mpf("0.07")]
base, scaled = contact(ei, *loads), contact(ei * 3, *[3 * v for v in loads])
check("(8) a common factor", max(abs(a - b) for a, b in zip(base, scaled)))
for i in range(4):
    by_log = diff(lambda v: contact(ei * mp.exp(v), *loads)[i], 0)
    by_load = sum(
        loads[j] * diff(lambda x: contact(ei, *[x if k == j else loads[k] for k in range(3)])[i], loads[j]) for j in range(3)
    )
    check(f"(8) derivative {i}", by_log + by_load)
# (6): F sin φ = H of the straight uniform whisker.
theta = base[2]
along = (loads[0] * cos(theta) + loads[1] * sin(theta))
check("(6) F·t = M0²/2EI + fx", along - (loads[2] ** 2 / (2 * ei) + loads[0]))

# (9): an ellipse's support function: tangent point, radius of curvature.
nu, a, b = sp.symbols("nu a b", positive=True)
h = sp.sqrt(a**2 * sp.cos(nu) ** 2 + b**2 * sp.sin(nu) ** 2)
point = sp.Matrix([a**2 * sp.cos(nu), b**2 * sp.sin(nu)]) / h
n, t = sp.Matrix([sp.cos(nu), sp.sin(nu)]), sp.Matrix([-sp.sin(nu), sp.cos(nu)])
rho = (a * b) ** 2 / h**3
check("(9) h = n·p", 0 if sp.simplify(n.dot(point) - h) == 0 else 1)
check("(9) h' = t·p", 0 if sp.simplify(t.dot(point) - h.diff(nu)) == 0 else 1)
check("(9) h'' = rho - h", 0 if sp.simplify(h.diff(nu, 2) - rho + h) == 0 else 1)
x, y = sp.symbols("x y")
place = sp.Matrix([x, y])
check("(9) d(n·x - h)", 0 if sp.simplify((n.dot(place) - h).diff(nu) - (t.dot(place) - h.diff(nu))) == 0 else 1)
check("(9) d(t·x - h')", 0 if sp.simplify((t.dot(place) - h.diff(nu)).diff(nu) - (-n.dot(place) - h.diff(nu, 2))) == 0 else 1)

# (10): the largest n·x − h(n) is the signed distance: an ellipse, a point at a known distance along a normal, both sides.
A, B, angle = mpf("0.05"), mpf("0.02"), mpf("0.7")
H = lambda v: sqrt((A * cos(v)) ** 2 + (B * sin(v)) ** 2)
for distance in (mpf("0.01"), mpf("-0.002")):
    X = A * A * cos(angle) / H(angle) + distance * cos(angle)
    Y = B * B * sin(angle) / H(angle) + distance * sin(angle)
    gap = lambda v: cos(v) * X + sin(v) * Y - H(v)
    top = findroot(lambda v: diff(gap, v), angle + mpf("0.01"))
    highest = max(gap(2 * pi * i / 400) for i in range(400))
    check(f"(10) at {mp.nstr(distance, 2)} m", gap(top) - distance, mpf(10) ** -12)
    check("(10) no direction is farther", max(highest - distance, 0), mpf(10) ** -12)

# (11)–(13): a linear g: the corrections fulfil it, are the shortest, and cost wᵀS⁻¹w.
G, Sigma, g0 = rand(2, 6), positive(6), rand(2, 1)
S = G * Sigma * G.T
v = -(Sigma * G.T * (S**-1) * g0)
check("(12) fulfils g", mp.norm(g0 + G * v))
cost = (g0.T * S**-1 * g0)[0]
check("(13) cost", (v.T * Sigma**-1 * v)[0] - cost)
null = mp.eye(6) - Sigma * G.T * (S**-1) * G
other = v + null * rand(6, 1) * mpf("0.1")
check("(12) still fulfils g", mp.norm(g0 + G * other))
check("(12) is the shortest", 0 if (other.T * Sigma**-1 * other)[0] > cost else 1)


# (13): the gradient of the cost is 2 AᵀS⁻¹w, for a g that is not linear.
def profile(par):
    # g(b, θ) = b₁² + θ b₂ − 1 at b = (0.8, 0.5), Σ = diag(0.01, 0.02)
    sx, sy, vx, vy = mpf("0.01"), mpf("0.02"), mpf(0), mpf(0)
    for _ in range(200):
        bx, by = mpf("0.8") + vx, mpf("0.5") + vy
        gx, gy = 2 * bx, par
        w = bx * bx + par * by - 1 - gx * vx - gy * vy
        s = gx * gx * sx + gy * gy * sy
        vx, vy = -sx * gx * w / s, -sy * gy * w / s
    return w * w / s, 2 * (mpf("0.5") + vy) * w / s


value, gradient = profile(mpf("0.9"))
step = mpf(10) ** -12
numeric = (profile(mpf("0.9") + step)[0] - profile(mpf("0.9") - step)[0]) / (2 * step)
check("(13) gradient", gradient - numeric, mpf(10) ** -14)

# (15): unknowns of unit prior variance: tr(I − P) = tr(H (H + I)⁻¹), what the data determine.
Hd = positive(5)
P = (Hd + mp.eye(5)) ** -1
trace = lambda m: sum(m[i, i] for i in range(m.rows))
check("(15) trace", trace(mp.eye(5) - P) - trace(Hd * P))

# (17): a projected contact x − K g moves by B − K a, and no longer with the constraint's own noise.
J, q, N = rand(3, 3), rand(3, 1), positive(3)
K = J * N * q * ((q.T * N * q)[0] ** -1)
check("(17) no covariance with g is left", mp.norm((J - K * q.T) * N * q))

# (18), (19): one cause alone is weighted least squares on d, and what it explains is taken off T.
d, V, one = rand(4, 1), positive(4), rand(4, 1)
W = V**-1
info, score = (one.T * W * one)[0], (one.T * W * d)[0]
change = score / info
rest = d - one * change
check("(19) rest", (rest.T * W * rest)[0] - ((d.T * W * d)[0] - score**2 / info))
check("(19) is the least", (one.T * W * rest)[0])

# (20), (21): d of a window whose data have the change Δ: mean Uᵀ Δ, covariance Λ⁻¹ plus the reference's.
Hw, C = positive(4), positive(4)
values, U = mp.eigsy(Hw)
L = mp.diag(list(values))
check("(20) mean", mp.norm(L**-1 * U.T * Hw - U.T))
# b = H (Δ + e) + ε, Cov e = C, Cov ε = H
cov_b = Hw * C * Hw + Hw
check("(21) covariance", mp.norm(L**-1 * U.T * cov_b * U * L**-1 - (L**-1 + U.T * C * U)))

raise SystemExit(f"failed: {failed}" if failed else 0)
