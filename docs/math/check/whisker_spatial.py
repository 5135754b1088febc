"""Checks docs/math/whisker_spatial.md: (1), (2), (4), (5), (8) with SymPy and mpmath."""

import random

import mpmath as mp
import sympy as sp

# (1): torsion is constant, and a state in the plane of clamp axis and force stays in it.
ei = sp.symbols("EI", positive=True)
t, f, m = (sp.Matrix(sp.symbols(f"{name}1:4")) for name in "tfm")
t_slope, m_slope = m.cross(t) / ei, -t.cross(f)
assert sp.expand((m_slope.dot(t) + m.dot(t_slope)).subs(ei, 1)) == 0
t_plane, f_plane, m_plane = sp.Matrix([t[0], t[1], 0]), sp.Matrix([f[0], f[1], 0]), sp.Matrix([0, 0, m[2]])
assert (m_plane.cross(t_plane))[2] == 0
assert sp.Matrix(-t_plane.cross(f_plane))[:2] == [0, 0]

# (2): the load of the plane turned by psi about x; the moment r x f of a contact in the plane.
fx, f_in, x, y, psi = sp.symbols("fx f x y psi", real=True)
turn = sp.Matrix([[1, 0, 0], [0, sp.cos(psi), -sp.sin(psi)], [0, sp.sin(psi), sp.cos(psi)]])
force, arm = sp.Matrix([fx, f_in, 0]), sp.Matrix([x, y, 0])
moment = (turn * arm).cross(turn * force)
m_in = x * f_in - y * fx
h = sp.Matrix([fx, f_in * sp.cos(psi), f_in * sp.sin(psi), 0, -m_in * sp.sin(psi), m_in * sp.cos(psi)])
assert sp.simplify((turn * force).col_join(moment) - h) == sp.zeros(6, 1)
# (4)
mm = sp.symbols("m", real=True)
h = sp.Matrix([fx, f_in * sp.cos(psi), f_in * sp.sin(psi), 0, -mm * sp.sin(psi), mm * sp.cos(psi)])
want = sp.Matrix([0, -f_in * sp.sin(psi), f_in * sp.cos(psi), 0, -mm * sp.cos(psi), -mm * sp.sin(psi)])
assert sp.simplify(h.diff(psi) - want) == sp.zeros(6, 1)
# (8)
contact = sp.Matrix([sp.Function("X")(fx, f_in, mm), *(sp.Function("Y")(fx, f_in, mm) * v for v in (sp.cos(psi), sp.sin(psi)))])
jacobian = contact.jacobian([fx, f_in, mm, psi])
y_of = sp.Function("Y")(fx, f_in, mm)
assert sp.simplify(jacobian[1, 0] - y_of.diff(fx) * sp.cos(psi)) == 0 and jacobian[0, 3] == 0
assert sp.simplify(jacobian[1, 3] + y_of * sp.sin(psi)) == 0 and sp.simplify(jacobian[2, 3] - y_of * sp.cos(psi)) == 0

# (5): the least chi^2 over all psi on a fine grid and by golden section, with f and m eliminated.
mp.mp.dps = 30
random.seed(4)
for _ in range(20):
    fy, fz, mx, my, mz = (mp.mpf(random.gauss(0, 1)) for _ in range(5))
    vf, vm = mp.mpf("0.7"), mp.mpf("0.2")

    def chi2(angle):
        across = -fy * mp.sin(angle) + fz * mp.cos(angle)
        moment = -(mz * mp.sin(angle) + my * mp.cos(angle))
        return across**2 / vf + moment**2 / vm + mx**2 / vm

    a, b = mp.matrix([fy, fz]), mp.matrix([mz, -my])
    s = a * a.T / vf + b * b.T / vm
    values, vectors = mp.eigsy(s)
    angle = mp.atan2(vectors[1, 1], vectors[0, 1])
    least = values[0] + mx**2 / vm
    assert abs(chi2(angle) - least) < mp.mpf("1e-24")
    assert all(chi2(mp.pi * k / 180) > least - mp.mpf("1e-24") for k in range(180))
print("whisker_spatial.md: every equation holds")
