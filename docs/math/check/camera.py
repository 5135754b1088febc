"""Proves the Jacobians of docs/math/camera.md and prints golden projections at 50 digits.

pip install sympy mpmath
python camera.py prove     each derivative the code computes minus SymPy's own: 0, symbolically or at 50 digits in random points
python camera.py table > ../../../crates/core/tests/camera_tables/mpmath.txt
The table's projections follow the papers' formulas, written independently of the Rust code.
Columns: model | parameters in Resight's order | x y z | u v.
"""

import random
import sys

import sympy as sp
from mpmath import mp, mpf

mp.dps = 50

# ---------------------------------------------------------------- golden table, from the papers


def radtan(x, y, k1, k2, p1, p2):
    r2 = x * x + y * y
    g = 1 + k1 * r2 + k2 * r2 * r2
    return x * g + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * g + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y


def omni(v, x, y, z):
    """Mei and Rives: to the unit sphere, shift by xi, to the plane, distort."""
    fx, fy, cx, cy, xi, *d = v
    n = mp.sqrt(x * x + y * y + z * z)
    xs, ys, zs = x / n, y / n, z / n + xi
    mx, my = radtan(xs / zs, ys / zs, *d)
    return fx * mx + cx, fy * my + cy


def eucm(v, x, y, z):
    fx, fy, cx, cy, alpha, beta = v
    rho = mp.sqrt(beta * (x * x + y * y) + z * z)
    return fx * x / (alpha * rho + (1 - alpha) * z) + cx, fy * y / (alpha * rho + (1 - alpha) * z) + cy


def double_sphere(v, x, y, z):
    fx, fy, cx, cy, xi, alpha = v
    d1 = mp.sqrt(x * x + y * y + z * z)
    d2 = mp.sqrt(x * x + y * y + (xi * d1 + z) ** 2)
    w = alpha * d2 + (1 - alpha) * (xi * d1 + z)
    return fx * x / w + cx, fy * y / w + cy


def fov(v, x, y, z):
    fx, fy, cx, cy, w = v
    ru = mp.sqrt(x * x + y * y) / z
    s = 2 * mp.tan(w / 2) / w if ru == 0 else mp.atan(2 * ru * mp.tan(w / 2)) / (w * ru)
    return fx * s * x / z + cx, fy * s * y / z + cy


def kannala_brandt(v, x, y, z):
    fx, fy, cx, cy, k1, k2, k3, k4 = v
    t = mp.atan2(mp.sqrt(x * x + y * y), z)
    delta = t + k1 * t**3 + k2 * t**5 + k3 * t**7 + k4 * t**9
    phi = mp.atan2(y, x)
    return fx * delta * mp.cos(phi) + cx, fy * delta * mp.sin(phi) + cy


def corrected(v, x, y):
    """Eq. (1) of the seed paper: measured to ideal."""
    f, xp, yp, k1, k2, k3, p1, p2, a1, a2 = v
    dx, dy = x - xp, y - yp
    r2 = dx * dx + dy * dy
    g = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    return (dx * g + p1 * (r2 + 2 * dx * dx) + 2 * p2 * dx * dy,
            dy * g + p2 * (r2 + 2 * dy * dy) + a1 * dx + a2 * dy)


def photogrammetric(v, x, y, z):
    f = v[0]
    ideal = (-f * x / z, -f * y / z)
    start = (ideal[0] + v[1], ideal[1] + v[2])
    solution = mp.findroot(lambda a, b: [c - i for c, i in zip(corrected(v, a, b), ideal)], start)
    return solution[0], solution[1]


CASES = [
    (omni, ["820 822.5 376 240.5 0.8 -0.1 0.02 0.001 -0.0005", "820 822.5 376 240.5 1.67 -0.31 0.12 0.002 0.001",
            "900.25 899.5 640 480 1 0 0 0 0"], 1.7),
    (eucm, ["460.76484651566468 459.4051018049483 365.8937161309615 249.33499869752445 0.5903365915227143 1.127468196965374",
            "300 301 320 240 0.5 0.9", "500 500 640 480 0.3 1.4"], 1.6),
    (double_sphere, ["349.7560023050409 348.7245432900404 365.8955309711265 249.3241468124423 -0.2409573942178872 0.5666996899163044",
                     "157.25 157.5 255.5 256 -0.2 0.62", "300 300 320 240 0.99 0.5"], 1.9),
    (fov, ["400 401.5 320 240 0.933", "369.25 369.5 639.5 359.5 1.9", "500 500 320 240 0.001"], 1.4),
    (kannala_brandt, ["190.978 190.973 254.932 256.897 0.0034823894 0.000715034845 -0.00205323614 0.000202936736"], 2.2),
    (photogrammetric, ["3.54144878 0 0 0 0 0 0 0 0 0",
                       "28.4 0.02 -0.11 8e-5 -1.4e-7 2e-11 2e-6 -5e-6 1e-4 -3e-4",
                       "3.5 0.1 0.2 -0.009 0.0002 0.000001 0.001 -0.002 0.02 -0.03",
                       "2800 1990 1510 2.2e-8 -3e-15 0 3e-7 1e-7 1e-4 2e-4"], 0.7),
]


def table():
    print("# 50-digit projections: model | parameters | x y z | u v; made by docs/math/check/camera.py")
    for model, parameters, angle_max in CASES:
        for text in parameters:
            # Start from the doubles the Rust side reads, so that the table is exact for them.
            values = [mpf(float(v)) for v in text.split()]
            for i in range(9):
                for azimuth in ("0.3", "2.1", "-1.2"):
                    angle, a = mpf(angle_max) * i / 8, mpf(azimuth)
                    depth = mpf([1, 3, 0.25][i % 3])
                    ray = (mp.sin(angle) * mp.cos(a), mp.sin(angle) * mp.sin(a), mp.cos(angle))
                    point = [float(depth * c) for c in ray]
                    pixel = model(values, *map(mpf, point))
                    numbers = (" ".join(map(repr, map(float, values))), " ".join(map(repr, point)),
                               " ".join(mp.nstr(p, 25) for p in pixel))
                    print(model.__name__, *numbers, sep=" | ")


# ---------------------------------------------------------------- proofs

X, Y, Z = sp.symbols("X Y Z", real=True)
x, y = sp.symbols("x y", real=True)


def vanishes(name, expressions):
    """Symbolically where SymPy manages at once, else at 50 digits in 20 random rational points."""
    rng = random.Random(1)
    expressions = list(expressions)
    symbolic = sum(sp.count_ops(e) < 120 and sp.simplify(e) == 0 for e in expressions)
    worst = sp.Float(0, 50)
    for _ in range(20):
        for e in expressions:
            at = {s: sp.Rational(rng.randint(5, 60), 100) for s in e.free_symbols}
            worst = max(worst, abs(sp.N(e.subs(at), 50)))
    assert worst < sp.Float("1e-40", 50), (name, worst)
    print(f"{name}: {len(expressions)} derivatives agree, {symbolic} of them symbolically; worst at 50 digits {sp.N(worst, 3)}")


def prove_plane():
    k1, k2, k3, k4, k5, k6, p1, p2, s1, s2, s3, s4 = sp.symbols("k1:7 p1:3 s1:5")
    r2 = x**2 + y**2
    n, d = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3, 1 + k4 * r2 + k5 * r2**2 + k6 * r2**3
    g = n / d
    u = x * g + 2 * p1 * x * y + p2 * (r2 + 2 * x**2) + s1 * r2 + s2 * r2**2
    v = y * g + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y + s3 * r2 + s4 * r2**2
    dn, dd = k1 + 2 * k2 * r2 + 3 * k3 * r2**2, k4 + 2 * k5 * r2 + 3 * k6 * r2**2
    dg = (dn - g * dd) / d
    px, py, mixed = 2 * s1 + 4 * s2 * r2, 2 * s3 + 4 * s4 * r2, 2 * (p1 * x + p2 * y)
    coded = [g + 2 * x * x * dg + 2 * p1 * y + 6 * p2 * x + px * x, 2 * x * y * dg + mixed + px * y,
             2 * x * y * dg + mixed + py * x, g + 2 * y * y * dg + 6 * p1 * y + 2 * p2 * x + py * y]
    true = [sp.diff(u, x), sp.diff(u, y), sp.diff(v, x), sp.diff(v, y)]
    vanishes("plane distortion by the point", [a - b for a, b in zip(coded, true)])
    by = {k1: r2 / d, k2: r2**2 / d, k3: r2**3 / d, k4: -g * r2 / d, k5: -g * r2**2 / d, k6: -g * r2**3 / d}
    vanishes("radial coefficients", [sp.diff(u, k) - x * e for k, e in by.items()] + [sp.diff(v, k) - y * e for k, e in by.items()])
    # Eq. (6): lowest eigenvalue of the tangential part over a circle is −6 |p| r.
    q = sp.Matrix([[2 * p1 * y + 6 * p2 * x, mixed], [mixed, 6 * p1 * y + 2 * p2 * x]])
    w = sp.Matrix([p2, p1])
    m = sp.Matrix([x, y])
    same = 2 * (w * m.T + m * w.T) + 2 * (w.T * m)[0] * sp.eye(2)
    vanishes("tangential derivative is 2(w mᵀ + m wᵀ + (w·m) I)", list(q - same))


def prove_tilt():
    a, b = sp.symbols("a b", real=True)
    rx = sp.Matrix([[1, 0, 0], [0, sp.cos(a), sp.sin(a)], [0, -sp.sin(a), sp.cos(a)]])
    ry = sp.Matrix([[sp.cos(b), 0, -sp.sin(b)], [0, 1, 0], [sp.sin(b), 0, sp.cos(b)]])

    def projection(r, last):
        return sp.Matrix([[r[2, 2], 0, -r[0, 2]], [0, r[2, 2], -r[1, 2]], [0, 0, last]])

    r = ry * rx
    point = sp.Matrix([x, y, 1])
    h = projection(r, 1) * r * point
    image = sp.Matrix([h[0] / h[2], h[1] / h[2]])
    proofs = []
    for angle in (a, b):
        slope = r.diff(angle)
        dh = projection(slope, 0) * r * point + projection(r, 1) * slope * point
        coded = sp.Matrix([dh[0] - h[0] / h[2] * dh[2], dh[1] - h[1] / h[2] * dh[2]]) / h[2]
        proofs += list(image.diff(angle) - coded)
    H = projection(r, 1) * r
    for i, c in enumerate((x, y)):
        proofs += [image[j].diff(c) - (H[j, i] - image[j] * H[2, i]) / h[2] for j in range(2)]
    inverse = r.T * sp.Matrix([[1 / r[2, 2], 0, r[0, 2] / r[2, 2]], [0, 1 / r[2, 2], r[1, 2] / r[2, 2]], [0, 0, 1]])
    vanishes("tilt by angle, by point, and its inverse", proofs + list(inverse * H - sp.eye(3)))


def polar_proof(name, delta, along_over):
    """u = δ n with n = (X, Y)/r; ∂δ/∂r = along Z, ∂δ/∂Z = −along r."""
    r = sp.sqrt(X**2 + Y**2)
    nx, ny = X / r, Y / r
    along, across = along_over, delta / r
    excess = along * Z - across
    coded = [across + excess * nx**2, excess * nx * ny, -along * X, excess * nx * ny, across + excess * ny**2, -along * Y]
    true = [sp.diff(delta * n, c) for n in (nx, ny) for c in (X, Y, Z)]
    vanishes(name, [a - b for a, b in zip(coded, true)])


def prove_angles():
    k1, k2, k3, k4, w = sp.symbols("k1:5 w", positive=True)
    r = sp.sqrt(X**2 + Y**2)
    theta, t = sp.atan2(r, Z), sp.symbols("t")
    delta = t + k1 * t**3 + k2 * t**5 + k3 * t**7 + k4 * t**9
    polar_proof("kannala_brandt", delta.subs(t, theta), delta.diff(t).subs(t, theta) / (r**2 + Z**2))
    c = 2 * sp.tan(w / 2)
    psi = sp.atan2(c * r, Z) / w
    polar_proof("fov", psi, c / w / (c**2 * r**2 + Z**2))
    vanishes("fov by w", [psi.diff(w) - (r * Z * (1 + c**2 / 4) / (c**2 * r**2 + Z**2) - psi) / w])
    series = sp.series(sp.atan(2 * x * sp.tan(w / 2)) / w, w, 0, 4).removeO()
    vanishes("fov series", [sp.expand(series - (x + w**2 * x * (sp.Rational(1, 12) - x**2 / 3)))])


def sphere_proof(name, rho, slope, by_parameter):
    m = [X / rho, Y / rho]
    coded = [(sp.Integer(i == j) - m[i] * slope[j]) / rho for i in range(2) for j in range(3)]
    true = [sp.diff(m[i], c) for i in range(2) for c in (X, Y, Z)]
    parameters = [sp.diff(m[i], p) + m[i] * e / rho for p, e in by_parameter.items() for i in range(2)]
    vanishes(name, [a - b for a, b in zip(coded, true)] + parameters)


def prove_spheres():
    xi, alpha, beta = sp.symbols("xi alpha beta", positive=True)
    d = sp.sqrt(X**2 + Y**2 + Z**2)
    sphere_proof("omni", Z + xi * d, [xi * X / d, xi * Y / d, 1 + xi * Z / d], {xi: d})
    e = sp.sqrt(beta * (X**2 + Y**2) + Z**2)
    sphere_proof("eucm", alpha * e + (1 - alpha) * Z,
                 [alpha * beta * X / e, alpha * beta * Y / e, alpha * Z / e + 1 - alpha],
                 {alpha: e - Z, beta: alpha * (X**2 + Y**2) / (2 * e)})
    zeta = Z + xi * d
    big = sp.sqrt(X**2 + Y**2 + zeta**2)
    by_zeta = alpha / big * zeta + 1 - alpha
    across = alpha / big + by_zeta * xi / d
    sphere_proof("double_sphere", alpha * big + (1 - alpha) * zeta, [across * X, across * Y, by_zeta * (1 + xi * Z / d)],
                 {xi: by_zeta * d, alpha: big - zeta})
    # Eq. (9): no cancellation behind the camera.
    a, b = sp.symbols("a b")
    vanishes("depth sum", [a * e + b * Z - (a * beta * (X**2 + Y**2) / (e - Z) + (b - a) * Z)])


def prove_photogrammetric():
    f, k1, k2, k3, p1, p2, a1, a2 = sp.symbols("f k1:4 p1:3 a1:3")
    ideal = sp.Matrix(corrected([f, 0, 0, k1, k2, k3, p1, p2, a1, a2], x, y))
    r2 = x**2 + y**2
    g = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    dg = 2 * (k1 + 2 * k2 * r2 + 3 * k3 * r2**2)
    coded = [g + x * x * dg + 6 * p1 * x + 2 * p2 * y, x * y * dg + 2 * p1 * y + 2 * p2 * x,
             x * y * dg + 2 * p2 * x + a1, g + y * y * dg + 6 * p2 * y + a2]
    vanishes("photogrammetric correction by the point", [a - b for a, b in zip(coded, ideal.jacobian([x, y]))])
    # Eq. (18): squared Frobenius norm of the decentring part's symmetric derivative as a quadratic form.
    s = sp.Matrix([[6 * p1 * x + 2 * p2 * y, p1 * y + 2 * p2 * x], [p1 * y + 2 * p2 * x, 6 * p2 * y]])
    form = (36 * p1**2 + 8 * p2**2) * x**2 + (2 * p1**2 + 40 * p2**2) * y**2 + 2 * 16 * p1 * p2 * x * y
    vanishes("decentring bound", [sum(v**2 for v in s) - form])


if __name__ == "__main__":
    if sys.argv[1:] == ["table"]:
        table()
    else:
        for proof in (prove_plane, prove_tilt, prove_angles, prove_spheres, prove_photogrammetric):
            proof()
