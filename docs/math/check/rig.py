"""Checks docs/math/rig.md: eqs. (2)-(13), (33), (34), at random points to 40 digits. Needs mpmath."""

import random

import mpmath as mp

mp.mp.dps = 40
random.seed(5)
STEP = mp.mpf("1e-14")  # central differences err by its square


def matrix(rows, cols, scale=1):
    return mp.matrix(rows, cols).apply(lambda _: mp.mpf(random.gauss(0, scale)))


def hat(x):
    return mp.matrix([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])


def exp(xi):
    m = mp.zeros(4)
    k = hat(xi[:3])
    for i in range(3):
        for n in range(3):
            m[i, n] = k[i, n]
        m[i, 3] = xi[3 + i]
    return mp.expm(m, method="taylor")


def inverse(pose):
    r, t = pose[:3, :3].T, pose[:3, 3]
    out = mp.eye(4)
    out[:3, :3] = r
    out[:3, 3] = -r * t
    return out


def pose(scale="0.3"):
    return exp(matrix(6, 1) * mp.mpf(scale))


def apply(p, x):
    return p[:3, :3] * x + p[:3, 3]


def about(pivot, motion):
    """The motion x <- x + w x (x - pivot) + v, as a 4x4, exact to first order."""
    return exp(mp.matrix([*motion[:3], *(motion[3:] + hat(pivot) * motion[:3])]))


def carried(r, d):
    m = mp.zeros(6)
    m[:3, :3] = r
    m[3:, 3:] = r
    m[3:, :3] = -r * hat(d)
    return m


def project(x):
    return mp.matrix([x[0] / x[2], x[1] / x[2]])


def lens(x):
    return mp.matrix([[1 / x[2], 0, -x[0] / x[2] ** 2], [0, 1 / x[2], -x[1] / x[2] ** 2]])


def close(a, b, tolerance="1e-20"):
    assert mp.norm(a - b) < mp.mpf(tolerance) * (1 + mp.norm(b)), mp.norm(a - b)


# (1)-(7): the derivative of a pixel by the motions of camera, body and target, through the one motion of the sighting.
cam_from_rig, body_from_target = pose(), pose()
rig_from_body = pose()
rig_from_body[2, 3] += 6
point, pivot_t, q_body = matrix(3, 1, 0.3), matrix(3, 1, 0.3), matrix(3, 1, 0.3)
cam_from_target = cam_from_rig * rig_from_body * body_from_target
p_cam = apply(cam_from_target, pivot_t)
p_body = apply(body_from_target, pivot_t)
p_rig, q_rig = apply(rig_from_body, p_body), apply(rig_from_body, q_body)
x = apply(cam_from_target, point)
y = x - p_cam
pi = lens(x)
row = mp.zeros(2, 6)
for i in range(2):
    j = pi[i, :].T
    row[i, :3] = (hat(y) * j).T
    row[i, 3:] = j.T
r_c, r_b = cam_from_rig[:3, :3], rig_from_body[:3, :3]
m_c, m_b = carried(mp.eye(3), p_cam), carried(r_c, p_rig - q_rig)
m_t = carried(r_c * r_b, mp.zeros(3, 1))


def seen(c, b, t):
    chain = exp(c) * cam_from_rig * about(q_rig, b) * rig_from_body * about(p_body, t) * body_from_target
    return project(apply(chain, point))


none = mp.zeros(6, 1)
for which, m in enumerate([m_c, m_b, m_t]):
    for i in range(6):
        h = mp.zeros(6, 1)
        h[i] = STEP
        moved = [[h if k == which else none for k in range(3)], [-h if k == which else none for k in range(3)]]
        direct = (seen(*moved[0]) - seen(*moved[1])) / (2 * STEP)
        close(direct, (row * m)[:, i])

# The gauge: rig and bodies moved together change no pixel.
g = pose()
close(apply(cam_from_rig * inverse(g) * g * rig_from_body, point), apply(cam_from_rig * rig_from_body, point))

# (8): elimination gives the solution and the covariances of the whole system.
shared, k = 12, 18
jac, res = matrix(40, k), matrix(40, 1)
whole, gradient = jac.T * jac, jac.T * res
h_, c_, a_ = whole[:shared, :shared], whole[:shared, shared:], whole[shared:, shared:]
s = h_ - c_ * a_**-1 * c_.T
eta = s**-1 * (gradient[:shared] - c_ * a_**-1 * gradient[shared:])
xi = a_**-1 * (gradient[shared:] - c_.T * eta)
direct = whole**-1 * gradient
close(mp.matrix([*eta, *xi]), direct)
covariance = whole**-1
close(s**-1, covariance[:shared, :shared])
close(a_**-1 + a_**-1 * c_.T * s**-1 * c_ * a_**-1, covariance[shared:, shared:])


def adjoint(p):
    m = mp.zeros(6)
    r, t = p[:3, :3], p[:3, 3]
    m[:3, :3] = r
    m[3:, 3:] = r
    m[3:, :3] = hat(t) * r
    return m


# Relative pose of two cameras: Exp(xi_b) T_b (Exp(xi_a) T_a)^-1 = Exp(xi_b - Ad xi_a) T_b T_a^-1 to first order.
t_a, t_b = pose(), pose()
xi_a, xi_b = matrix(6, 1) * STEP, matrix(6, 1) * STEP
relative = t_b * inverse(t_a)
moved = exp(xi_b) * t_b * inverse(exp(xi_a) * t_a) * inverse(relative)
close(moved - mp.eye(4), exp(xi_b - adjoint(relative) * xi_a) - mp.eye(4), "1e-26")

# (9) with its covariance: the vote of one view.
b_from_t, a_from_t = pose(), pose()
vote = b_from_t * inverse(a_from_t)
moved = exp(xi_b) * b_from_t * inverse(exp(xi_a) * a_from_t)
close(moved, exp(xi_b - adjoint(vote) * xi_a) * vote, "1e-26")

# (10), (11): one more parameter at a minimum of the others, against the whole system with it.
extra = matrix(40, 1)
res -= jac * (whole**-1 * (jac.T * res))  # at the minimum over the places
common = jac.T * extra
left = (extra.T * extra)[0] - (common.T * whole**-1 * common)[0]
both = mp.zeros(40, k + 1)
both[:, :k] = jac
both[:, k] = extra
joint = (both.T * both) ** -1
assert abs((joint * both.T * res)[k] - (extra.T * res)[0] / left) < 1e-25
assert abs(joint[k, k] - 1 / left) < 1e-25

# The scale of one target alone is a gauge: the arm grown by lambda, all translations grown with it, leave the pixel where it is.
scale = mp.mpf("1.37")


def grown(p):
    out = p.copy()
    out[:3, 3] = p[:3, 3] * scale
    return out


close(project(apply(grown(cam_from_rig) * grown(rig_from_body), point * scale)), project(apply(cam_from_rig * rig_from_body, point)))

# (12): derivative of the distance of two centres by the left motions of both cameras.
centre = lambda p: inverse(p)[:3, 3]
apart = centre(t_a) - centre(t_b)
along = apart / mp.norm(apart)
for i in range(6):
    h = mp.zeros(6, 1)
    h[i] = STEP
    by_a = (mp.norm(centre(exp(h) * t_a) - centre(t_b)) - mp.norm(centre(exp(-h) * t_a) - centre(t_b))) / (2 * STEP)
    by_b = (mp.norm(centre(t_a) - centre(exp(h) * t_b)) - mp.norm(centre(t_a) - centre(exp(-h) * t_b))) / (2 * STEP)
    expected_a = 0 if i < 3 else (-(t_a[:3, :3] * along))[i - 3]
    expected_b = 0 if i < 3 else (t_b[:3, :3] * along)[i - 3]
    assert abs(by_a - expected_a) < 1e-20 and abs(by_b - expected_b) < 1e-20

# (13): mean of half the squared length of a standard normal pair within radius k, over the share within.
for k_ in (mp.mpf(3), mp.mpf("4.2919320525786945")):
    within = mp.quad(lambda r: r * mp.exp(-r * r / 2), [0, k_])
    half = mp.quad(lambda r: r**3 / 2 * mp.exp(-r * r / 2), [0, k_])
    formula = (1 - mp.exp(-k_ * k_ / 2) * (1 + k_ * k_ / 2)) / (1 - mp.exp(-k_ * k_ / 2))
    assert abs(half / within - formula) < 1e-25
gate = mp.sqrt(-2 * mp.log(mp.mpf("1e-4")))
assert abs(gate - mp.mpf("4.291932052578694")) < 1e-14
# (14)-(16): four more parameters at a minimum of the others, against the whole system with them.
more = matrix(jac.rows, 4)
several = mp.matrix(jac.rows, k + 4)
several[:, :k] = jac
several[:, k:] = more
system = (several.T * several) ** -1
own_more, common_more = more.T * more, jac.T * more
left_more = own_more - common_more.T * ((jac.T * jac) ** -1) * common_more
step = left_more**-1 * (more.T * res)
whole = system * (several.T * res)
close(step, whole[k:, 0])
close(left_more**-1, system[k:, k:])
explained = ((more.T * res).T * step)[0]
before, after = (res.T * res)[0], ((res - several * whole).T * (res - several * whole))[0]
assert abs(before - after - explained) < 1e-25

# (17), (18), (20): rows of three views; what the other unknowns follow with is held, as left⁻¹ holds it. And what they do without one view.
following = ((jac.T * jac) ** -1) * common_more
beyond = more - jac * following
third = jac.rows // 3
parts = [range(0, third), range(third, 2 * third), range(2 * third, jac.rows)]
pick = lambda a, kept: mp.matrix([[a[i, j] for j in range(a.cols)] for i in kept])
left_v, pull_v = [], []
for part in parts:
    j_v, p_v, r_v = pick(jac, part), pick(more, part), pick(res, part)
    mixed = following.T * (j_v.T * p_v)
    left_v.append(p_v.T * p_v - mixed - mixed.T + following.T * (j_v.T * j_v) * following)
    pull_v.append(p_v.T * r_v - following.T * (j_v.T * r_v))
close(left_v[0] + left_v[1] + left_v[2], left_more)
close(pull_v[0] + pull_v[1] + pull_v[2], more.T * res)
for v, part in enumerate(parts):
    kept = [i for i in range(jac.rows) if i not in part]
    p_kept, r_kept = pick(beyond, kept), pick(res, kept)
    without = ((p_kept.T * p_kept) ** -1) * (p_kept.T * r_kept)
    change = left_more**-1 * ((mp.eye(4) - left_v[v] * left_more**-1) ** -1) * (pull_v[v] - left_v[v] * step)
    close(step - without, change)
close(whole[:k, 0], -following * step)

# (27)-(30): with rows of what is known of the parameters, against the whole system that has these rows too.
nu, known, stated = mp.mpf("1.7"), matrix(5, 4), matrix(5, 1)
rows, right = mp.zeros(jac.rows + 5, k + 4), mp.zeros(jac.rows + 5, 1)
rows[: jac.rows, :], right[: jac.rows, :] = several, res
rows[jac.rows :, k:], right[jac.rows :, :] = mp.sqrt(nu) * known, mp.sqrt(nu) * stated
both = (rows.T * rows) ** -1
reduced = left_more + nu * (known.T * known)
close(reduced**-1 * (more.T * res + nu * (known.T * stated)), (both * (rows.T * right))[k:, 0])
sigma_z = nu * reduced**-1
close(sigma_z, nu * both[k:, k:])
close(nu * (jac.T * jac) ** -1 + following * sigma_z * following.T, nu * both[:k, :k])
close(-following * sigma_z, nu * both[:k, k:])
# (31): z has variance 1 before, and is estimated from pixels with the information G; a moved z then has the variance I - sigma_z.
sigma_z = (left_more + mp.eye(4)) ** -1
close(sigma_z * (left_more * left_more + left_more) * sigma_z, mp.eye(4) - sigma_z)


# (33): the polynomial meets all neighbours; (34): Q is the derivative of a pixel by the time of its exposure.
nodes = [mp.mpf(text) for text in ("-0.21", "-0.1", "0.12", "0.19")]
values = [matrix(6, 1, mp.mpf("0.1")) for _ in nodes]
powers = mp.matrix(4, 4)
for i, node in enumerate(nodes):
    for n in range(4):
        powers[i, n] = node ** (n + 1)
coefficients = powers**-1 * mp.matrix([list(value) for value in values])


def path(after):
    return mp.matrix([sum(coefficients[n, i] * after ** (n + 1) for n in range(4)) for i in range(6)])


for node, value in zip(nodes, values):
    close(path(node), value)
cam_from_target, x, start = pose(), matrix(3, 1, mp.mpf("0.1")), mp.mpf("1e-9")
cam_from_target[2, 3] += 2


def exposed(after):
    return project(apply(cam_from_target * exp(path(after)), x))


twist = mp.matrix([sum((n + 1) * coefficients[n, i] * start**n for n in range(4)) for i in range(6)])
moved = apply(exp(path(start)), x)
in_cam = apply(cam_from_target, moved)
projection = mp.matrix([[1 / in_cam[2], 0, -in_cam[0] / in_cam[2] ** 2], [0, 1 / in_cam[2], -in_cam[1] / in_cam[2] ** 2]])
by_time = projection * cam_from_target[:3, :3] * (hat(twist[:3]) * moved + twist[3:])
close((exposed(start + STEP) - exposed(start - STEP)) / (2 * STEP), by_time, "1e-8")  # exact at the view's time, to first order after it

print("rig.md: all equations hold")
