"""PyYAML reads our Kalibr, EuRoC, ROS and transform files as ROS and Kalibr themselves do; their numbers give our pixels.

PyYAML speaks YAML 1.1, where `1e-5` is text: every number must come out as one. Directions as in each program's sources:
Kalibr's T_cn_cnm1 maps the previous camera's points into this one, EuRoC's T_BS the sensor's into the body, a ROS transform
the child's into the parent.
"""

import tomllib

import numpy as np
import yaml
from pyquaternion import Quaternion

from _lenses import eucm, fov
from _rigs import GOLDEN as RIGS
from _rigs import folder, judge, opencv_pixel

GOLDEN = RIGS.parent
EXAMPLES = GOLDEN.parent


def numbers(value):
    """Every leaf of lists; PyYAML (YAML 1.1) leaves text where it does not see a number."""
    return [x for item in value for x in numbers(item)] if isinstance(value, list) else [value]


def check_yaml(name, keys):
    """Each key is a path of names; all values below it must be the example's numbers."""
    example = {"ros.yaml": "ros_plumb_bob.yaml"}.get(name, name)
    ours, theirs = (yaml.safe_load((folder / file).read_text()) for folder, file in ((GOLDEN, name), (EXAMPLES, example)))
    for path in keys:
        a, b = ours, theirs
        for part in path.split("."):
            a, b = a[part], b[part]
        a, b = numbers(a), numbers(b)
        assert all(isinstance(x, (int, float)) for x in a), f"{name}: {path} has text among its numbers: {a}"
        assert np.allclose(a, b, rtol=0, atol=1e-15), f"{name}: {path}: {a} is not {b}"
    print(f"PyYAML {yaml.__version__} reads {name}")


def example(name):
    """Cameras of our own TOML: {name: table}."""
    return {c["name"]: c for c in tomllib.loads((EXAMPLES / name).read_text())["camera"]}


def stated_pose(table):
    """cam_from_world of a camera of our own TOML, whichever way it is stated."""
    p = table["placement"]
    pose = np.eye(4)
    pose[:3, :3] = Quaternion(p["rotation_wxyz"]).rotation_matrix
    pose[:3, 3] = p["translation_m"]
    return pose if p["b"] == table["name"] else np.linalg.inv(pose)


def pixel_of(model, distortion, intrinsics, coefficients, pose, x):
    """Kalibr's and EuRoC's words on OpenCV's own models, and on those that OpenCV has not."""
    *first, fx, fy, cx, cy = intrinsics
    k = [fx, 0, cx, 0, fy, cy, 0, 0, 1]
    x_in_cam = (pose @ [*x, 1.0])[:3]
    if (model, distortion) in (("pinhole", "fov"), ("eucm", "none")):
        a, b = fov(*coefficients, x_in_cam) if distortion == "fov" else eucm(*first, x_in_cam)
        return fx * a + cx, fy * b + cy
    assert model == "pinhole", model
    fisheye = distortion == "equidistant"
    return opencv_pixel(k, coefficients or [0.0] * 4, pose[:3, :3], pose[:3, 3], x, fisheye)


def check_kalibr():
    chain = yaml.safe_load((folder() / "kalibr" / "camchain.yaml").read_text())
    names = list(example("placed_wide.toml"))
    poses = [stated_pose(example("placed_wide.toml")[names[0]])]
    for i in range(1, len(names)):
        poses.append(np.array(chain[f"cam{i}"]["T_cn_cnm1"]) @ poses[-1])

    def pixel(camera, x):
        i = names.index(camera)
        c = chain[f"cam{i}"]
        return pixel_of(c["camera_model"], c["distortion_model"], c["intrinsics"], c["distortion_coeffs"], poses[i], x)

    judge(f"Kalibr's camchain by PyYAML {yaml.__version__}", "placed_wide", pixel)
    imu = yaml.safe_load((folder() / "kalibr_imu" / "camchain.yaml").read_text())
    theirs = yaml.safe_load((EXAMPLES / "kalibr_imucam.yaml").read_text())
    for camera, key in (("cam0", "T_cam_imu"), ("cam1", "T_cam_imu"), ("cam1", "T_cn_cnm1"), ("cam0", "timeshift_cam_imu")):
        assert np.allclose(imu[camera][key], theirs[camera][key], rtol=0, atol=1e-15), (camera, key)


def check_euroc():
    files = {c: yaml.safe_load((folder() / "euroc" / c / "sensor.yaml").read_text()) for c in example("placed_wide.toml")}

    def pixel(camera, x):
        c = files[camera]
        body_from_cam = np.array(c["T_BS"]["data"], float).reshape(c["T_BS"]["rows"], c["T_BS"]["cols"])
        cam_from_body = np.linalg.inv(body_from_cam)
        words = (c["camera_model"], c["distortion_model"], c["intrinsics"], c["distortion_coefficients"])
        return pixel_of(*words, cam_from_body, x)

    judge(f"EuRoC's sensor.yaml by PyYAML {yaml.__version__}", "placed_wide", pixel)


def check_transforms():
    """As tf2 applies a TransformStamped: x_parent = R x_child + t."""
    stamped = yaml.safe_load((folder() / "tf_yaml" / "static_transforms.yaml").read_text())["transforms"]
    cameras = example("placed_rig.toml")
    poses = {}
    for t in stamped:
        assert t["header"]["frame_id"] == "world"
        q, v = t["transform"]["rotation"], t["transform"]["translation"]
        parent_from_child = Quaternion(q["w"], q["x"], q["y"], q["z"]).transformation_matrix
        parent_from_child[:3, 3] = [v["x"], v["y"], v["z"]]
        poses[t["child_frame_id"].removesuffix("_optical_frame")] = np.linalg.inv(parent_from_child)

    def pixel(camera, x):
        c, pose = cameras[camera], poses[camera]
        k = [c["fx_px"], 0, c["cx_px"], 0, c["fy_px"], c["cy_px"], 0, 0, 1]
        return opencv_pixel(k, c.get("distortion", [0.0] * 4), pose[:3, :3], pose[:3, 3], x)

    judge(f"TransformStamped by PyYAML {yaml.__version__} and pyquaternion", "placed_rig", pixel)


check_yaml("ros.yaml", ["camera_matrix.data", "distortion_coefficients.data", "image_width", "image_height"])
models = [f"cam{i}.{key}" for i in range(6) for key in ("intrinsics", "distortion_coeffs", "resolution")]
check_yaml("kalibr_camchain.yaml", ["cam1.T_cn_cnm1", *models])
check_yaml("kalibr_imucam.yaml", ["cam0.T_cam_imu", "cam1.T_cn_cnm1"])
check_kalibr()
check_euroc()
check_transforms()
