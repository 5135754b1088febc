"""Checks the algebra of docs/math/dots.md with SymPy. Exits nonzero when an equation does not hold."""

import sympy as sp


def zero(expression, name):
    assert sp.simplify(expression) == 0, name
    print(f"ok  {name}")


# (6b): the integral of w (1 - w) across a Gaussian edge, by its derivative: w' (1 - 2w) is odd, so integrate by parts, -x w' (1 - 2w).
z = sp.symbols("z", real=True)
edge = sp.exp(-z**2 / 2) / sp.sqrt(2 * sp.pi)
zero(sp.integrate(z * edge * sp.erf(z / sp.sqrt(2)), (z, -sp.oo, sp.oo)) - 1 / sp.sqrt(sp.pi), "(6b)")

h = sp.Matrix(3, 3, sp.symbols("h11 h12 h13 h21 h22 h23 h31 h32 h33"))
r, k, t, x, y, rho = sp.symbols("r k t x y rho", positive=True)

# (8): the middle of the line, a part r of the way, is seen a part t of the way.
seen = r * k / (1 - r + r * k)
zero((1 - r) / r * seen / (1 - seen) - k, "(8) k from t")

# (10): derivative of the image and its determinant.
p = h * sp.Matrix([x, y, 1])
u, v, w = p[0] / p[2], p[1] / p[2], p[2]
jacobian = sp.Matrix([u, v]).jacobian([x, y])
stated = (h[:2, :2] - sp.Matrix([u, v]) * h[2, :2]) / w
for i in range(2):
    for j in range(2):
        zero(jacobian[i, j] - stated[i, j], f"(10) J[{i},{j}]")
zero(jacobian.det() - h.det() / w**3, "(10) det J = det H / w^3")

# (11): second moments of a uniform disc of radius rho are rho^2/4.
s, a = sp.symbols("s a", positive=True)
moment = sp.integrate(sp.integrate((s * sp.cos(a)) ** 2 * s, (s, 0, rho)), (a, 0, 2 * sp.pi)) / (sp.pi * rho**2)
zero(moment - rho**2 / 4, "(11) moment of a disc")

# (12), (13): pole of the vanishing line, centre of the ellipse, and their difference. Q^-1 = H C^-1 H^T needs no inverse.
conic_inverse = sp.diag(rho**2, rho**2, -1)
q_inverse = h * conic_inverse * h.T
adjugate_line = sp.Matrix([0, 0, 1])
# Q^-1 l with l = H^-T l_inf is H C^-1 l_inf: proportional to h3, the image of the centre.
pole = h * conic_inverse * adjugate_line
for i in range(3):
    zero(pole[i] + h[i, 2], f"(12) pole of the vanishing line, row {i}")
centre = q_inverse * adjugate_line
ellipse = sp.Matrix([centre[0] / centre[2], centre[1] / centre[2]])
image = sp.Matrix([h[0, 2] / h[2, 2], h[1, 2] / h[2, 2]])
at_origin = stated.subs({x: 0, y: 0})
columns = h[2, 2] * at_origin
denominator = h[2, 2] ** 2 - rho**2 * (h[2, 0] ** 2 + h[2, 1] ** 2)
difference = -(rho**2) * (h[2, 0] * columns[:, 0] + h[2, 1] * columns[:, 1]) / denominator
for i in range(2):
    zero(ellipse[i] - image[i] - difference[i], f"(13) shift of the centre, row {i}")

# (4): error of the centroid when the slope of b is off by beta: w is off by -(1 - w) beta u / C.
beta, contrast, cover = sp.symbols("beta C w")
grey_b, grey_f = sp.symbols("b f")
grey = grey_b + cover * (grey_f - grey_b)
shifted = (grey - (grey_b + beta)) / (grey_f - (grey_b + beta))
zero(sp.diff(shifted, beta).subs(beta, 0) + (1 - cover) / (grey_f - grey_b), "(4) dw/db = -(1-w)/C")
shifted = (grey - grey_b) / (grey_f + beta - grey_b)
zero(sp.diff(shifted, beta).subs(beta, 0) + cover / (grey_f - grey_b), "(4) dw/df = -w/C")
