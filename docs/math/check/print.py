"""Checks docs/math/print.md with SymPy. Exits nonzero when an equation does not hold."""

import sympy as sp


def zero(expression, name):
    assert sp.simplify(expression) == 0, name
    print(f"ok  {name}")


# (1a): the polygon that a chord through the left and the upper side cuts off a pixel is its triangle.
p, q = sp.symbols("p q", positive=True)
polygon = [(-sp.Rational(1, 2), q - sp.Rational(1, 2)), (-sp.Rational(1, 2), -sp.Rational(1, 2)), (p - sp.Rational(1, 2), -sp.Rational(1, 2))]
area = sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(polygon, polygon[1:] + polygon[:1])) / 2
zero(area - p * q / 2, "(1a) area beyond a chord")
# (1b): distances of 34 places from an edge with the normal (1, 4).
assert {(k + 4 * 21 * k) % 34 for k in range(34)} == {0, 17}
print("ok  (1b) two distances")

# (2), (3): the linear model's unknowns give the derivative of (1) and the shift.
a, g, u, v, du, dv, u0, v0 = sp.symbols("a g u v du dv u0 v0")
print_ = sp.Function("T")
model = a + g * print_(u - u0 - du, v - v0 - dv)
at = {du: 0, dv: 0}
slope_u = sp.diff(print_(u - u0, v - v0), u)
slope_v = sp.diff(print_(u - u0, v - v0), v)
zero(sp.diff(model, du).subs(at).doit() + g * slope_u, "(2) derivative along u")
zero(sp.diff(model, dv).subs(at).doit() + g * slope_v, "(2) derivative along v")
x1, x2 = g, g * du
zero(x2 / x1 - du, "(3) shift from the unknowns")

# (4): to first order the variance of x2 / x1 about a shift of zero is that of x2 over x1 squared.
ratio = sp.symbols("x2") / sp.symbols("x1")
zero(sp.diff(ratio, sp.symbols("x1")).subs(sp.symbols("x2"), 0), "(4) the contrast's error does not enter")
zero(sp.diff(ratio, sp.symbols("x2")) - 1 / sp.symbols("x1"), "(4) the shift's variance is divided by g squared")

# (5): residual of a and g alone.
n = 5
values = sp.symbols(f"t0:{n}")
image = sp.symbols(f"i0:{n}")
design = sp.Matrix([[1, t] for t in values])
y = sp.Matrix(image)
solution = (design.T * design).inv() * design.T * y
residual = ((y - design * solution).T * (y - design * solution))[0]
mean_t, mean_i = sum(values) / n, sum(image) / n
tt = sum(t * t for t in values) - n * mean_t**2
ti = sum(t * i for t, i in zip(values, image)) - n * mean_t * mean_i
total = sum(i * i for i in image) - n * mean_i**2
numbers = dict(zip(values + image, (1, 4, -2, 7, 3, 2, -5, 6, 1, 8)))
zero((residual - (total - ti**2 / tt)).subs(numbers), "(5) what a and g leave")

# (6): the mask of the noise.
line = sp.Matrix([1, -2, 1])
mask = line * line.T
zero(sum(x * x for x in mask) - 36, "(6) sum of squares")
b, c, d = sp.symbols("b c d")
plane = sum(mask[i, j] * (a + b * j + c * i + d * i * j) for i in range(3) for j in range(3))
zero(plane, "(6) a twisted plane is not seen")

# (7): what one and two passes of 1 2 1 leave of the standard deviation, both axes together.
once = [sp.Rational(k, 4) for k in (1, 2, 1)]
twice = [sum(once[i] * once[k - i] for i in range(3) if 0 <= k - i < 3) for k in range(5)]
zero(sum(k * k for k in once) - sp.Rational(6, 16), "(7) one pass")
zero(sum(k * k for k in twice) - sp.Rational(70, 256), "(7) two passes")

# (9): an inner node and the edge of the board explain a third of each other.
inner, edge = sp.Matrix([-1, 1, 1, -1]), sp.Matrix([-1, 1, 1, 1])
assert sum(inner) == 0
spread = edge.dot(edge) - sum(edge) ** 2 / sp.Integer(4)
zero(inner.dot(edge) ** 2 / (inner.dot(inner) * spread) - sp.Rational(1, 3), "(9) a third")

# (10): windows of a board that hold a part of it, counted, and those whose first square is black.
for rows, columns, height, width in [(6, 9, 4, 5), (5, 8, 5, 3), (7, 7, 2, 6)]:
    windows = [(r, c) for r in range(rows - height + 1) for c in range(columns - width + 1)]
    black = [w for w in windows if sum(w) % 2 == 0]
    n = (columns - width + 1) * (rows - height + 1)
    assert len(windows) == n and 2 * len(black) in (n, n + 1)
    print(f"ok  (10) {rows} x {columns}, part {height} x {width}: {n} windows, {len(black)} of the right colour")
