"""Lens models that OpenCV has not, by their published definitions; a point in the camera frame to a point at z = 1."""

import numpy as np


def fov(w, x):
    """Devernay and Faugeras: r_d = atan(2 r tan(w/2)) / w."""
    a, b = x[0] / x[2], x[1] / x[2]
    r = np.hypot(a, b)
    scale = np.arctan(2 * r * np.tan(w / 2)) / (w * r)
    return scale * a, scale * b


def eucm(alpha, beta, x):
    """Khomutenko: (X, Y) / (alpha sqrt(beta (X^2 + Y^2) + Z^2) + (1 - alpha) Z)."""
    d = alpha * np.sqrt(beta * (x[0] ** 2 + x[1] ** 2) + x[2] ** 2) + (1 - alpha) * x[2]
    return x[0] / d, x[1] / d
