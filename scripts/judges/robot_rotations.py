"""scipy and transforms3d turn the numbers of every convention of robot poses into our rotation matrices.

`rotations/rotations.csv` holds three (or four) numbers in each convention, and the pose that our reader makes of them beside
the position 100, -200, 300. The makers' conventions are restated as sequences: capitals are intrinsic for scipy.
"""

import csv

import numpy as np
from scipy.spatial.transform import Rotation

from _rigs import folder, skip

try:
    from transforms3d import axangles, euler, quaternions
except ImportError as reason:
    skip(f"robot_rotations.py: {reason}")

# word: (sequence of scipy, sequence of transforms3d, degrees, metres of a unit of length)
EULER = {
    "rpy-rad": ("xyz", "sxyz", False, 1),
    "rpy-deg": ("xyz", "sxyz", True, 1),
    "fanuc": ("xyz", "sxyz", True, 1e-3),
    "mitsubishi": ("xyz", "sxyz", True, 1e-3),
    "yaskawa": ("xyz", "sxyz", True, 1e-3),
    "kuka": ("ZYX", "rzyx", True, 1e-3),
    "abb-zyx": ("ZYX", "rzyx", True, 1e-3),
    "zyx-rad": ("ZYX", "rzyx", False, 1),
    "staubli": ("XYZ", "rxyz", True, 1e-3),
    "xyz-rad": ("XYZ", "rxyz", False, 1),
    "kawasaki": ("ZYZ", "rzyz", True, 1e-3),
    "zyz-rad": ("ZYZ", "rzyz", False, 1),
}
VECTOR = {"ur": (False, 1), "rotvec-rad": (False, 1), "rotvec-deg": (True, 1)}
QUATERNION = {"quaternion-wxyz": (0, 1), "abb": (0, 1e-3), "quaternion-xyzw": (3, 1)}


def both(word, numbers):
    """The rotation matrix of either program, and metres of a unit of length."""
    if word in EULER:
        scipy_sequence, sequence, degrees, unit = EULER[word]
        radians = np.radians(numbers) if degrees else numbers
        return Rotation.from_euler(scipy_sequence, numbers, degrees).as_matrix(), euler.euler2mat(*radians, sequence), unit
    if word in VECTOR:
        degrees, unit = VECTOR[word]
        vector = np.radians(numbers) if degrees else np.array(numbers)
        angle = np.linalg.norm(vector)
        return Rotation.from_rotvec(vector).as_matrix(), axangles.axangle2mat(vector / angle, angle, True), unit
    scalar, unit = QUATERNION[word]
    w = numbers[scalar]
    xyz = numbers[:scalar] + numbers[scalar + 1 :]
    return Rotation.from_quat([*xyz, w]).as_matrix(), quaternions.quat2mat([w, *xyz]), unit


words, worst = set(), 0.0
for row in csv.DictReader((folder() / "rotations" / "rotations.csv").open()):
    numbers = [float(row[f"n{i}"]) for i in range(1, 5) if row[f"n{i}"]]
    ours = np.array([float(row[f"r{i}{j}"]) for i in "123" for j in "123"]).reshape(3, 3)
    *theirs, unit = both(row["word"], numbers)
    for program, matrix in zip(("scipy", "transforms3d"), theirs):
        off = np.abs(matrix - ours).max()
        assert off < 1e-12, f"FAILED: {program}: {row['word']} {numbers}: {off}"
        worst = max(worst, off)
    assert np.allclose([float(row[k]) for k in ("tx_m", "ty_m", "tz_m")], np.array([100, -200, 300]) * unit), row["word"]
    words.add(row["word"])
assert words == {*EULER, *VECTOR, *QUATERNION}, words
print(f"scipy and transforms3d: {len(words)} conventions within {worst:.1e} of our rotations")
