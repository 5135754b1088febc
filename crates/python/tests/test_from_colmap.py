"""Each row of docs/from-colmap.md, pycolmap's call beside ours."""

import numpy as np
import pycolmap
import pytest

import resight
from conftest import Rows

ROWS = Rows("from-colmap.md")
SIZE, FOCAL_PX, CENTRE = (1280, 960), (1000.0, 1001.0), (640.0, 480.0)  # COLMAP's: from the corner of the image.
BROWN = [-0.2, 0.05, 0.001, -0.0005]


@pytest.fixture
def theirs():
    return pycolmap.Camera(model="OPENCV", width=SIZE[0], height=SIZE[1], params=[*FOCAL_PX, *CENTRE, *BROWN])


@pytest.fixture
def camera():
    return resight.Camera("brown_conrady", width_px=SIZE[0], height_px=SIZE[1], fx_px=FOCAL_PX[0], fy_px=FOCAL_PX[1],
                          cx_px=CENTRE[0] - 0.5, cy_px=CENTRE[1] - 0.5, distortion=BROWN)


@pytest.fixture
def scene(camera):
    points = np.random.default_rng(4).uniform(-0.4, 0.4, (40, 3))
    pose = resight.Pose.from_vectors([0.1, -0.2, 0.05], [0.05, 0.04, 2.0], b="cam", a="world")
    return points, pose, camera.project(pose @ points) + 0.5


@ROWS.run("`cameras.txt`", "`pycolmap.Camera(")
def test_cameras(camera, theirs):
    rays = np.array([[0.1, -0.2, 1.0], [-0.3, 0.1, 1.0]])
    pixels = np.array([theirs.img_from_cam(ray) for ray in rays]).reshape(-1, 2)
    assert np.allclose(camera.project(rays), pixels - 0.5, atol=1e-9)
    read = resight.Camera.read_all("testdata/formats/cameras.txt")
    assert read["3"].parameters == resight.read_camera("testdata/formats/cameras.txt#3").parameters


@ROWS.run("`images.txt`", "`pycolmap.Reconstruction(folder)`")
def test_a_rig_goes_there_and_back(tmp_path):
    rig = resight.rig_from_detections("testdata/rig/cameras.toml", "testdata/rig/detections.csv")
    rig.save(tmp_path / "rig.toml")
    resight.convert(tmp_path / "rig.toml", "colmap", f"{tmp_path}/model/")
    model = pycolmap.Reconstruction(tmp_path / "model")
    assert len(model.images) == 2 and len(model.rigs) == 1
    placed = {image.name: image.cam_from_world().matrix() for image in model.images.values()}
    between = [np.vstack([m, [0, 0, 0, 1]]) for _, m in sorted(placed.items())]
    expected = rig.cameras.right.cam_from_rig.matrix
    assert np.allclose(between[1] @ np.linalg.inv(between[0]), expected, atol=1e-9)
    back = resight.convert(tmp_path / "model", "resight", tmp_path / "back.toml")
    assert back["checked"] and len(resight.Camera.read_all(tmp_path / "back.toml")) == 2


@ROWS.run("`cameras.bin`")
def test_binary_models_are_refused_with_the_way_out(tmp_path):
    model = pycolmap.Reconstruction()
    (tmp_path / "bin").mkdir()
    model.write_binary(tmp_path / "bin")
    with pytest.raises(resight.Error, match="text"):
        resight.Camera.read_all(tmp_path / "bin" / "cameras.bin")


@ROWS.run("`pycolmap.estimate_and_refine_absolute_pose", "`[\"cam_from_world\"]`", "`[\"inlier_mask\"]`")
def test_absolute_poses(camera, theirs, scene):
    points, pose, points2d = scene
    wrong = points2d.copy()
    wrong[::8] += [80.0, -60.0]
    found = pycolmap.estimate_and_refine_absolute_pose(wrong, points, theirs)
    answer = resight.solve(points, wrong - 0.5, camera, robust_threshold_px=12)
    assert np.allclose(answer.cam_from_target.matrix[:3], found["cam_from_world"].matrix(), atol=1e-5)
    assert np.allclose(answer.cam_from_target.matrix, pose.matrix, atol=1e-6)
    x, y, z, w = found["cam_from_world"].rotation.quat
    assert np.allclose(answer.cam_from_target.rotation_wxyz, np.array([w, x, y, z]) * np.sign(w), atol=1e-5)
    assert answer.to_dict()["inliers"] == np.flatnonzero(found["inlier_mask"]).tolist() and answer.to_dict()["consensus"]
    assert resight.solve(points, wrong - 0.5, camera).status == "inconsistent"


@ROWS.run("`pycolmap.refine_absolute_pose", "`return_covariance=True`")
def test_refinement_needs_no_start_and_covariances_agree(camera, theirs, scene):
    points, pose, points2d = scene
    noisy = points2d + np.random.default_rng(5).normal(0, 0.5, points2d.shape)
    start = pycolmap.Rigid3d(pose.matrix[:3])
    options = pycolmap.AbsolutePoseRefinementOptions()
    options.loss_function_scale = 1e6  # Least squares.
    found = pycolmap.refine_absolute_pose(start, noisy, points, np.ones(len(points), bool), theirs, refinement_options=options)
    answer = resight.solve(points, noisy - 0.5, camera, sigma_px=0.5)
    assert np.allclose(answer.cam_from_target.matrix[:3], found["cam_from_world"].matrix(), atol=1e-5)
    assert answer.covariance.shape == (6, 6)


@ROWS.run("`pycolmap.estimate_generalized_absolute_pose")
def test_a_rig_among_known_points(tmp_path):
    answers = resight.rig_pose("examples/photo/corners.csv", "examples/photo/rig_before.toml")
    assert answers[0].status == "ok" and answers[0].rig_from_target.matrix.shape == (4, 4)


def test_each_row_is_run():
    ROWS.check()
