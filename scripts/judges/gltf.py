"""pygltflib reads the glTF scenes: axes, camera nodes and frustums must give our pixels.

The node's matrix takes a point of the world into the camera (x right, y up, looking along -z); the frustum's corner
points, projected, are the corners of the image; a camera's yfov and aspect ratio are those of its pinhole.
"""

import base64
import math
import sys

import numpy as np
import pygltflib

from _rigs import folder, judge


def turn(q):
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def matrix(node):
    m = np.eye(4)
    m[:3, :3] = turn(node.rotation or [0, 0, 0, 1])
    m[:3, 3] = node.translation or [0, 0, 0]
    return m


def positions(scene, mesh):
    accessor = scene.accessors[scene.meshes[mesh].primitives[0].attributes.POSITION]
    view = scene.bufferViews[accessor.bufferView]
    data = base64.b64decode(scene.buffers[0].uri.split(",", 1)[1])
    assert len(data) == scene.buffers[0].byteLength
    found = np.frombuffer(data, "<f4", 3 * accessor.count, view.byteOffset).reshape(-1, 3)
    assert np.array_equal(found.min(0), np.float32(accessor.min)) and np.array_equal(found.max(0), np.float32(accessor.max))
    return found.astype(float)


def lines(scene, mesh):
    accessor = scene.accessors[scene.meshes[mesh].primitives[0].indices]
    data = base64.b64decode(scene.buffers[0].uri.split(",", 1)[1])
    return np.frombuffer(data, "<u2", accessor.count, scene.bufferViews[accessor.bufferView].byteOffset)


def load(name):
    scene = pygltflib.GLTF2().load(str(folder() / name / "rig.gltf"))
    root = scene.nodes[scene.scenes[scene.scene].nodes[0]]
    return scene, root, {scene.nodes[i].name: scene.nodes[i] for i in root.children}


scene, root, cameras = load("gltf")
# z up in the world is y up in glTF.
assert np.allclose(matrix(root)[:3, :3] @ [0, 0, 1], [0, 1, 0], atol=1e-15)


def pinhole(camera, x):
    """Only the right camera is a pinhole: extras hold what glTF's camera has no place for."""
    node = cameras[camera]
    e = node.extras
    p = np.linalg.inv(matrix(node)) @ [*x, 1.0]
    return e["fx_px"] * p[0] / -p[2] + e["cx_px"], e["fy_px"] * -p[1] / -p[2] + e["cy_px"]


judge("pygltflib, node matrix and extras", "placed_rig", pinhole, cameras=["right"])

node = cameras["right"]
view = scene.cameras[node.camera].perspective
assert math.isclose(view.yfov, 2 * math.atan(300 / 702.5), rel_tol=1e-12)
assert math.isclose(view.aspectRatio, (800 / 702.25) / (600 / 702.5), rel_tol=1e-12)
seen = [pinhole("right", (matrix(node) @ [*p, 1.0])[:3]) for p in positions(scene, node.mesh)[1:]]
assert lines(scene, node.mesh).max() == len(seen)
for corner, (u, v) in zip([seen[0], seen[8], seen[16], seen[24]], [(-0.5, -0.5), (799.5, -0.5), (799.5, 599.5), (-0.5, 599.5)]):
    if math.hypot(corner[0] - u, corner[1] - v) > 1e-3:  # single precision
        sys.exit(f"FAILED: glTF: the frustum's corner is at pixel {corner}, not ({u}, {v})")
print("pygltflib: frustum corners are the image's corners")

wide, _, fisheyes = load("gltf_wide")
assert fisheyes["front"].camera is None and fisheyes["plain"].camera is not None and len(wide.meshes) == 4
print("pygltflib: fisheyes have a frustum and no perspective camera")
