"""Each row of docs/from-apriltag.md: the AprilTag library beside ours on one image, files of PhotonVision and WPILib, frames of ROS."""

import json

import numpy as np
import pytest
from dt_apriltags import Detector

import resight
from conftest import ROOT, TAG_LENS, TAG_SIZE_M, Rows, program

ROWS = Rows("from-apriltag.md")


@pytest.fixture
def theirs(tags):
    """What AprilTag finds and where it puts the tags; its principal point counts from the corner of the image."""
    lens = [TAG_LENS["fx_px"], TAG_LENS["fy_px"], TAG_LENS["cx_px"] + 0.5, TAG_LENS["cy_px"] + 0.5]
    return {tag.tag_id: tag for tag in Detector(families="tag36h11", quad_decimate=1.0).detect(tags, True, lens, TAG_SIZE_M)}


@pytest.fixture
def lens():
    return resight.Camera("pinhole", **TAG_LENS)


@ROWS.run("`apriltag_detector_detect`", "`det->p", "`detectedCorners`")
def test_corners_are_theirs_in_another_order_and_half_a_pixel_off(tags, theirs):
    found = {}
    for entry in resight.detect(tags, family="tag36h11").to_dict()["detections"]:
        found.setdefault(entry["id"], {})[entry["corner"]] = entry["u_px"], entry["v_px"]
        assert 0 < entry["sigma_px"] < 1
    assert len(theirs) == len(found) == 12
    errors = np.concatenate([[found[tag][k] for k in range(4)] - (theirs[tag].corners[::-1] - 0.5) for tag in theirs])
    assert np.abs(np.median(errors, axis=0)).max() < 0.1 and np.abs(errors).max() < 1.0


@ROWS.run("`estimate_tag_pose` with", "the same from your own", "`estimate_tag_pose_orthogonal", "`cx`, `cy`")
def test_poses_are_theirs(tags, theirs, lens):
    """From their corners and their lens, one tag's pose is theirs: the same frame."""
    for tag in theirs.values():
        target = resight.Target("tag", family="tag36h11", id=tag.tag_id, size_m=TAG_SIZE_M)
        of_corners = resight.solve(target.points_m, tag.corners[::-1] - 0.5, lens, sigma_px=0.3)
        of_image = resight.locate_image(tags, lens, target)
        for answer in (of_corners, of_image):
            assert answer.status in ("ok", "ambiguous"), answer
            poses = [pose for pose in (answer.cam_from_target, answer.other_cam_from_target) if pose is not None]
            assert len(poses) == (2 if answer.status == "ambiguous" else 1)
            turns = [np.degrees(np.arccos(np.clip((np.trace(p.rotation.T @ tag.pose_R) - 1) / 2, -1, 1))) for p in poses]
            assert min(turns) < 3 and min(np.linalg.norm(p.translation_m - tag.pose_t.ravel()) for p in poses) < 0.01


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
def test_a_field_locates_the_robot(file, lens):
    """Tags of the layout seen by a camera on a robot that stands where we say: the chain of the page leads back to it."""
    field = resight.read_target(f"testdata/formats/{file}")
    assert any("tag36h11" in warning for warning in field.warnings)
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
def test_two_poses_of_one_tag_are_both_given(lens):
    tag = resight.Target("tag", family="tag36h11", id=1, size_m=0.1651)
    cam_from_tag = resight.Pose.from_vectors([0.25, 0.1, 0], [0.1, 0, 6.0], b="cam", a="target")
    answer = resight.solve(tag.points_m, lens.project(cam_from_tag @ tag.points_m), lens, sigma_px=0.5)
    assert answer.status == "ambiguous" and answer.other_cam_from_target is not None
    near = resight.Pose.from_vectors([0.25, 0.1, 0], [0.1, 0, 0.6], b="cam", a="target")
    assert resight.solve(tag.points_m, lens.project(near @ tag.points_m), lens, sigma_px=0.2).status == "ok"


@ROWS.run("`apriltag_msgs/")
def test_detections_of_a_recording_are_watched():
    recording = "testdata/mcap/detections_lz4.mcap"
    lines = program("watch", "--camera", f"gate={recording}#/gate/camera_info/rectified", "--target", "testdata/mcap/tag.toml",
                    "--source", f"gate={recording}#/detections", "--once", "--frames")
    frames = [event for event in map(json.loads, lines) if event["event"] == "frame"]
    truth = json.loads((ROOT / "testdata/mcap/truth.json").read_text())["gate"]
    assert len(frames) == 24 and all(np.allclose(frame["cam_from_target"]["matrix"], truth, atol=1e-6) for frame in frames)


def test_each_row_is_run():
    ROWS.check()
