"""Checks docs/math/known_rotation.md: the rows and their derivatives symbolically. Needs SymPy."""

import sympy as sp

fx, fy, lam = sp.symbols("fx fy lam", positive=True)
b = sp.Matrix(sp.symbols("b1:4", real=True))
x = sp.Matrix(sp.symbols("x1:4", real=True))
project = lambda y: sp.Matrix([fx * y[0] / y[2], fy * y[1] / y[2]])
Pi = project(x).jacobian(x)
at = lambda y: Pi.subs(dict(zip(x, y)), simultaneous=True)

# (1): homogeneous of degree -1, blind along the ray. Any central lens is a function of x/|x|, for which the same holds by Euler.
assert sp.simplify(at(b * lam) * b) == sp.zeros(2, 1)
assert sp.simplify(at(b * lam) - at(b) / lam) == sp.zeros(2, 3)

# (2): to first order in a displacement e across the ray the pixel moves by Pi e.
e = sp.Matrix(sp.symbols("e1:4", real=True))
s = sp.symbols("s")
moved = project(b * lam + e * s)
assert sp.simplify(sp.diff(moved, s).subs(s, 0) - at(b * lam) * e) == sp.zeros(2, 1)

# A first-order motion of the pose (R, t): x -> x + w x x + nu, and R D -> R D + w x R D.
w, nu, t, RX, RD, RP, Rn = (sp.Matrix(sp.symbols(f"{n}1:4", real=True)) for n in ("w", "nu", "t", "X", "D", "P", "n"))
turned = lambda v: v + s * w.cross(v)
place = lambda: t + s * (w.cross(t) + nu)
first = lambda y: sp.expand(sp.diff(sp.expand(y), s).subs(s, 0))

# (3): b.(w x lam b) = 0: a distance along the ray is not changed by a turn.
assert sp.expand(b.dot(w.cross(b * lam))) == 0

# (4): the height row -(R n).t with R n turned as well changes by -(R n).nu only.
assert sp.expand(first(-turned(Rn).dot(place())) + Rn.dot(nu)) == 0

# (5): the plane of the line through the end, and its two linear forms.
m = RD.cross(RP + t)
assert sp.expand(e.dot(m) - e.cross(RD).dot(RP + t)) == 0
moved_row = e.dot(turned(RD).cross(turned(RP) + place()))
assert sp.expand(first(moved_row) - (w.dot(m.cross(e)) + e.cross(RD).dot(nu))) == 0

# (6): a row of a point; M (w x x + nu) = M nu - M [x] w.
M = sp.Matrix(3, 3, sp.symbols("m1:10"))
hat = sp.Matrix([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])
assert sp.expand(M * (w.cross(x) + nu) - (M * nu - M * hat * w)) == sp.zeros(3, 1)

# Section 3: the update of a place is Kalman's, in one dimension across and in general by the matrix inversion lemma.
S = sp.Matrix(2, 2, [sp.Symbol("s11"), sp.Symbol("s12"), sp.Symbol("s12"), sp.Symbol("s22")])
j, q = sp.Matrix(sp.symbols("j1:3")), sp.Symbol("q")
gain = S * j / (q + (j.T * S * j)[0])
assert sp.simplify((S.inv() + j * j.T / q).inv() - (S - gain * j.T * S)) == sp.zeros(2, 2)

print("known_rotation.md: all equations hold")
