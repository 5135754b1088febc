"""Each row of docs/from-kalibr.md, on files that Kalibr writes and on images of its grid."""

import numpy as np
import pytest
import yaml

import resight
from conftest import ROOT, Rows

ROWS = Rows("from-kalibr.md")
FORMATS = ROOT / "testdata/formats"
CHAIN = yaml.safe_load((FORMATS / "kalibr_camchain.yaml").read_text())


@ROWS.run("`kalibr_create_target_pdf")
def test_a_grid_is_printed(tmp_path):
    keys = {"kind": "aprilgrid", "rows": 6, "columns": 6, "tag_size_m": 0.088, "tag_spacing_ratio": 0.3}
    printed = resight.print_target(keys, tmp_path / "grid.pdf", paper="A0")
    assert printed["n_pages"] == 1 and (tmp_path / "grid.pdf").read_bytes().startswith(b"%PDF")
    assert resight.read_target(tmp_path / "grid.toml").points_m.shape == (144, 3)


@ROWS.run("`aprilgrid.yaml`")
def test_target_files_keep_kalibrs_numbers():
    given = yaml.safe_load((FORMATS / "kalibr_aprilgrid.yaml").read_text())
    grid = resight.read_target(FORMATS / "kalibr_aprilgrid.yaml")
    points = grid.points_m.reshape(given["tagRows"], given["tagCols"], 4, 3)
    pitch_m = given["tagSize"] * (1 + given["tagSpacing"])
    assert np.allclose(points[0, 1, 0] - points[0, 0, 0], [pitch_m, 0, 0]) and np.allclose(points[1, 0, 0] - points[0, 0, 0], [0, pitch_m, 0])
    board = resight.read_target(FORMATS / "kalibr_checkerboard.yaml")
    assert board.kind == "chessboard" and board.points_m.shape == (54, 3)


@ROWS.run("`camchain.yaml`", "`pinhole-radtan`")
def test_every_lens_of_a_camchain():
    cameras = resight.Camera.read_all(FORMATS / "kalibr_camchain.yaml")
    models = ["brown_conrady", "kannala_brandt", "omni", "eucm", "double_sphere", "fov"]
    assert [camera.model for camera in cameras.values()] == models
    for name, camera in cameras.items():
        given, found = CHAIN[name], list(camera.parameters.values())
        assert sorted(found) == pytest.approx(sorted(given["intrinsics"] + given["distortion_coeffs"])), name
        assert camera.image_size_px == tuple(given["resolution"])
    assert resight.read_camera(FORMATS / "kalibr_camchain.yaml#cam1").parameters == cameras["cam1"].parameters


@pytest.fixture
def rig():
    return resight.rig_from_detections("testdata/rig/cameras.toml", "testdata/rig/detections.csv")


@ROWS.run("writing one", "`T_cn_cnm1`", "`baseline T_1_0", "`reprojection error")
def test_a_rig_becomes_a_camchain(rig, tmp_path):
    rig.save(tmp_path / "rig.toml")
    written = resight.convert(tmp_path / "rig.toml", "kalibr", tmp_path / "camchain.yaml")
    assert written["checked"] and written["lost"]
    chain = yaml.safe_load((tmp_path / "camchain.yaml").read_text())
    left, right = rig.cameras.left, rig.cameras.right
    stated = right.cam_from_rig.matrix @ np.linalg.inv(left.cam_from_rig.matrix)
    assert np.allclose(chain["cam1"]["T_cn_cnm1"], stated, atol=1e-12)
    pair = rig.pairs[0]
    assert {pair.a, pair.b} == {"left", "right"} and np.array(pair.covariance).shape == (6, 6)
    assert 0 < rig.rms_px < 0.2 and 0 < left.rms_px < 0.2
    with pytest.raises(resight.Error, match="radtan has k1, k2, p1, p2 only"):
        resight.convert("examples/photo/left.yml", "kalibr", tmp_path / "x.yaml")


@ROWS.run("`results-cam.txt`")
def test_a_report_keeps_its_standard_deviations():
    camera = resight.read_camera(FORMATS / "kalibr_results_cam.txt#cam0")
    sigmas = dict(zip(camera.parameters, np.sqrt(np.diag(camera.intrinsics_covariance))))
    assert sigmas["fx_px"] == pytest.approx(0.15120844) and camera.image_size_px is None


@ROWS.run("`kalibr_calibrate_cameras", "`kalibr_camera_validator`", "`--bag")
def test_lens_and_rig_from_folders_of_images():
    board, left = "examples/photo/board.toml", "examples/photo/left0*.jpg"
    lens = resight.intrinsics(board, left, model="brown_conrady")
    assert lens.cameras[0].model == "brown_conrady"
    assert resight.check_intrinsics("examples/photo/left.yml", board, left).cameras[0].status
    cameras = {"left": "examples/photo/left.yml", "right": "examples/photo/right.yml"}
    images = {"left": left, "right": "examples/photo/right0*.jpg"}
    assert resight.rig_from_images(cameras, board, images).status == "ok"


@ROWS.run("`--approx-sync")
def test_frames_are_joined_by_time(tmp_path):
    """Frame 1 of the right camera is given another name: by time it is the same view."""
    board, cameras = "examples/photo/board.toml", {"left": "examples/photo/left.yml", "right": "examples/photo/right.yml"}
    numbers = ["01", "03", "04", "05", "06", "07", "08"]
    images = {name: [f"examples/photo/{name}{i}.jpg" for i in numbers] for name in cameras}
    rows = ["camera,frame,t_s"] + [f"{name},{i:06},{10 * i + (0.004 if name == 'right' else 0)}" for name in cameras for i in range(len(numbers))]
    times = tmp_path / "times.csv"
    times.write_text("\n".join(rows) + "\n")
    images = {name: {f"{i:06}": path for i, path in enumerate(paths)} for name, paths in images.items()}
    joined = resight.rig_from_images(cameras, board, images, timestamps=times, sync_tolerance_s=0.02)
    assert joined.status == "ok" and joined.pairs[0].n_shared_views == len(numbers)
    apart = resight.rig_from_images(cameras, board, images, timestamps=times, sync_tolerance_s=0.001)
    assert apart.status != "ok"
    with pytest.raises(resight.Error, match="time stamps"):
        resight.rig_from_images(cameras, board, images, sync_tolerance_s=0.02)


@ROWS.run("`report-cam.pdf`")
def test_the_report_is_a_page(tmp_path):
    from conftest import program

    program("rig", "--camera", "testdata/rig/cameras.toml", "--detections", "testdata/rig/detections.csv", "--report", tmp_path / "rig.html")
    assert "<svg" in (tmp_path / "rig.html").read_text()


@ROWS.run("`kalibr_calibrate_imu_camera`")
def test_the_pose_at_the_imu_is_kept(tmp_path):
    source = FORMATS / "kalibr_imucam.yaml"
    assert resight.convert(source, "kalibr", tmp_path / "imucam.yaml", reference="imu")["checked"]
    given, written = (yaml.safe_load(path.read_text()) for path in (source, tmp_path / "imucam.yaml"))
    for camera in ("cam0", "cam1"):
        assert np.allclose(written[camera]["T_cam_imu"], given[camera]["T_cam_imu"], atol=1e-12)
    assert written["cam0"]["timeshift_cam_imu"] == given["cam0"]["timeshift_cam_imu"]


def test_grids_with_borders_of_two_cells_are_found():
    camera, grid = resight.read_camera("testdata/demo/left.toml"), resight.read_target("testdata/demo/grid.toml")
    answer = resight.locate_image("testdata/demo/left.png", camera, grid)
    assert answer.status == "ok" and 40 < answer.n_points


def test_each_row_is_run():
    ROWS.check()
