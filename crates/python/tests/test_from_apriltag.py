"""Each row of docs/from-apriltag.md: the AprilTag library beside ours on one image, files of PhotonVision and WPILib, frames of ROS."""

import json

import cv2
import numpy as np
import pytest
from dt_apriltags import Detector

import resight
from conftest import ROOT, Rows

ROWS = Rows("from-apriltag.md")
IMAGE, SIZE_M = "testdata/demo/left.png", 0.045


@pytest.fixture
def theirs():
    """What AprilTag finds and where it puts the tags: its camera has no distortion, so only near the middle is it right."""
    gray = cv2.imread(IMAGE, cv2.IMREAD_GRAYSCALE)
    lens = [742.0, 744.0, 404.5 + 0.5, 297.0 + 0.5]  # From the corner of the image.
    return {tag.tag_id: tag for tag in Detector(families="tag36h11", quad_decimate=1.0).detect(gray, True, lens, SIZE_M)}


def ours():
    """Corners (4, 2) by id."""
    found = resight.detect(IMAGE, family="tag36h11").to_dict()["detections"]
    corners = {}
    for entry in found:
        corners.setdefault(int(entry["id"]), {})[entry["corner"]] = entry["u_px"], entry["v_px"]
    return {tag: np.array([corner[k] for k in range(4)]) for tag, corner in corners.items() if len(corner) == 4}


@ROWS.run("`apriltag_detector_detect`", "`det->p", "`detectedCorners`", "`cx`, `cy`")
def test_corners_are_theirs_in_another_order_and_half_a_pixel_off(theirs):
    found = ours()
    assert 8 <= len(set(found) & set(theirs))
    errors = np.concatenate([found[tag] - (theirs[tag].corners[::-1] - 0.5) for tag in set(found) & set(theirs)])
    assert np.abs(np.median(errors, axis=0)).max() < 0.1 and np.median(np.abs(errors)) < 0.3
    assert {"sigma_px"} <= set(resight.detect(IMAGE, family="any").to_dict()["detections"][0])


@ROWS.run("`estimate_tag_pose` with", "the same from your own", "`estimate_tag_pose_orthogonal")
def test_poses_are_theirs(theirs):
    """From their corners and their lens, one tag's pose is theirs: the same frame."""
    camera = resight.Camera("pinhole", width_px=800, height_px=600, fx_px=742, fy_px=744, cx_px=404.5, cy_px=297)
    statuses = set()
    for tag in theirs.values():
        target = resight.Target("tag", family="tag36h11", id=tag.tag_id, size_m=SIZE_M)
        answer = resight.solve(target.points_m, tag.corners[::-1] - 0.5, camera, sigma_px=0.3)
        statuses.add(answer.status)
        places = [pose for pose in (answer.cam_from_target, answer.other_cam_from_target) if pose is not None]
        turns = [np.degrees(np.arccos(np.clip((np.trace(p.rotation.T @ tag.pose_R) - 1) / 2, -1, 1))) for p in places]
        if answer.status != "inconsistent":
            assert min(turns) < 3 and min(np.linalg.norm(p.translation_m - tag.pose_t.ravel()) for p in places) < 0.01
        assert (answer.other_cam_from_target is not None) == (answer.status == "ambiguous")
    assert "ok" in statuses
    tag = resight.Target("tag", family="tag36h11", id=5, size_m=SIZE_M)
    lens = resight.read_camera("testdata/demo/left.toml")
    assert resight.locate_image(IMAGE, lens, tag).status in ("ok", "ambiguous")


@ROWS.run("transform camera → tag", "`tags.yaml`", "`tag_bundles`")
def test_a_tag_of_ros_is_turned_by_half_about_x():
    flip = resight.Pose.from_vectors([np.pi, 0, 0], [0, 0, 0], b="target", a="tag_of_ros")
    up, towards = flip.inverse() @ np.array([[0.0, -1, 0], [0, 0, -1]])  # Ours: −y is up, −z towards the viewer.
    assert np.allclose(up, [0, 1, 0], atol=1e-12) and np.allclose(towards, [0, 0, 1], atol=1e-12)
    turned = {"rotation_wxyz": [0.0, 1.0, 0.0, 0.0], "translation_m": [0.3, 0.0, 0.0]}
    bundle = resight.Target("tag_map", family="tag36h11", tag=[{"id": 4, "size_m": 0.16, "world_from_tag": turned}])
    assert np.allclose(bundle.points_m[0], [0.3 - 0.08, 0.08, 0])  # Top left of the tag in the bundle's frame, whose y is up.


@ROWS.run("`camera_info`")
def test_camera_info_is_read():
    assert resight.read_camera("testdata/formats/ros_plumb_bob.yaml").model == "brown_conrady"


@ROWS.run("the camera's calibration JSON")
@pytest.mark.parametrize("file", ["photonvision_new.json", "photonvision_old.json"])
def test_calibrations_of_photonvision(file):
    camera = resight.read_camera(f"testdata/formats/{file}")
    given = json.loads((ROOT / "testdata/formats" / file).read_text())
    assert np.allclose(camera.matrix, np.reshape(given["cameraIntrinsics"]["data"], (3, 3)))


@ROWS.run("`AprilTagFieldLayout`", "`PhotonPoseEstimator`", "`Transform3d robotToCamera`")
@pytest.mark.parametrize("file", ["wpilib_2024.json", "wpilib_2027.json"])
def test_a_field_locates_the_robot(file):
    """Tags of the layout seen by a camera on a robot that stands where we say: the chain of the page leads back to it."""
    field = resight.read_target(f"testdata/formats/{file}")
    assert any("tag36h11" in warning for warning in field.warnings)
    lens = resight.Camera("pinhole", width_px=1280, height_px=800, fx_px=900, fy_px=900, cx_px=639.5, cy_px=399.5)
    wpilib_from_optical = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]], dtype=float)
    robot_to_camera = np.eye(4)
    robot_to_camera[:3, 3] = 0.3, 0.0, 0.5
    robot_from_cam = robot_to_camera @ wpilib_from_optical
    points = field.points_m.reshape(-1, 4, 3)
    out_of_face = np.cross(points[0, 3] - points[0, 0], points[0, 1] - points[0, 0])
    out_of_face /= np.linalg.norm(out_of_face)
    middle = points[0].mean(axis=0)
    forward = -out_of_face * [1, 1, 0]
    forward /= np.linalg.norm(forward)
    field_from_robot = np.eye(4)
    field_from_robot[:3, :3] = np.stack([forward, [-forward[1], forward[0], 0], [0, 0, 1]], axis=1)
    field_from_robot[:3, 3] = middle - 2.0 * forward + [0, 0.1, -middle[2]]
    field_from_cam = resight.Pose.from_matrix(field_from_robot @ robot_from_cam, b="field", a="cam")
    seen = lens.project(field_from_cam.inverse() @ points[0])
    answer = resight.solve(points[0], seen, lens, sigma_px=0.1)
    found = answer.target_from_cam.matrix @ np.linalg.inv(robot_from_cam)
    assert np.allclose(found, field_from_robot, atol=1e-6)


@ROWS.run("`getBestCameraToTarget`", "`poseAmbiguity")
def test_two_poses_of_one_tag_are_both_given():
    lens = resight.Camera("pinhole", width_px=1280, height_px=800, fx_px=900, fy_px=900, cx_px=639.5, cy_px=399.5)
    tag = resight.Target("tag", family="tag36h11", id=1, size_m=0.1651)
    cam_from_tag = resight.Pose.from_vectors([0.25, 0.1, 0], [0.1, 0, 6.0], b="cam", a="target")
    answer = resight.solve(tag.points_m, lens.project(cam_from_tag @ tag.points_m), lens, sigma_px=0.5)
    assert answer.status == "ambiguous" and answer.other_cam_from_target is not None
    near = resight.Pose.from_vectors([0.25, 0.1, 0], [0.1, 0, 0.6], b="cam", a="target")
    assert resight.solve(tag.points_m, lens.project(near @ tag.points_m), lens, sigma_px=0.2).status == "ok"


@ROWS.run("`apriltag_msgs/")
def test_detections_of_a_stream_are_watched(tmp_path):
    """The example's stream of detections is what a session takes; arrays of ROS are read from recordings in the tests of `watch`."""
    from conftest import program

    lines = [json.loads(line) for line in program("watch", "--camera", "gate=examples/gate/gate.toml", "--target", "examples/gate/tag.toml",
                                                  "--source", "examples/gate/day.jsonl", "--once")]
    assert any(line["event"] == "moved" for line in lines)


def test_each_row_is_run():
    ROWS.check()
