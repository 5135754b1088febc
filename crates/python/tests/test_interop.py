"""Poses and answers in other libraries' hands."""

import numpy as np
import pytest

import resight
from resight import interop, plot


def test_ros_messages_hold_the_covariance_of_the_camera(truth, camera, points_m, pixels):
    """Against Monte Carlo: the scatter of the camera's place and of its rotation about the target's axes."""
    rng = np.random.default_rng(11)
    sigma_px = 0.2
    views = pixels + rng.normal(0, sigma_px, (4000, *pixels.shape))
    poses = resight.solve_many(points_m, views, camera, sigma_px=sigma_px).cam_from_target
    exact = truth.inverse()
    errors = []
    for matrix in poses:
        found = np.linalg.inv(matrix)
        turn = resight.Pose.from_matrix(np.block([[found[:3, :3] @ exact.rotation.T, np.zeros((3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]]))
        errors.append(np.concatenate([found[:3, 3] - exact.translation_m, turn.rotation_vector]))
    seen = np.cov(np.array(errors).T)
    answer = resight.solve(points_m, pixels, camera, sigma_px=sigma_px)
    message = interop.to_ros(answer, frame_id="map", t_s=12.25)
    stated = np.array(message["pose"]["covariance"]).reshape(6, 6)
    ratio = np.linalg.eigvals(np.linalg.solve(stated, seen)).real
    assert np.all((0.85 < ratio) & (ratio < 1.15)), ratio
    assert message["header"] == {"stamp": {"sec": 12, "nanosec": 250_000_000}, "frame_id": "map"}
    assert np.allclose(interop.from_ros(message).matrix, answer.target_from_cam.matrix, atol=1e-12)
    with pytest.raises(resight.Error, match="no pose"):
        interop.to_ros(resight.solve(points_m[:2], pixels[:2], camera))
    message["pose"]["pose"]["orientation"]["w"] = 3.0
    with pytest.raises(resight.Error, match="rotation"):
        interop.from_ros(message)


def test_scipy_and_pycolmap_round_trips(truth):
    scipy = pytest.importorskip("scipy.spatial.transform")
    turn = interop.to_scipy(truth)
    assert isinstance(turn, scipy.Rotation) and np.allclose(turn.as_rotvec(), truth.rotation_vector, atol=1e-12)
    assert np.allclose(interop.from_scipy(turn, truth.translation_m).matrix, truth.matrix, atol=1e-12)
    pytest.importorskip("pycolmap")
    assert np.allclose(interop.from_pycolmap(interop.to_pycolmap(truth)).matrix, truth.matrix, atol=1e-12)


def test_tables_of_answers(camera, points_m, pixels):
    answers = [resight.solve(points_m, pixels, camera, view="a"), resight.solve(points_m[:2], pixels[:2], camera, view="b")]
    table = resight.table(answers)
    assert len(table) == 2 and table.column_names[:4] == ["view", "status", "message", "n_points"]
    poses = resight.table(resight.solve_many(points_m, np.repeat(pixels[None], 3, axis=0), camera))
    assert len(poses) == 3
    with pytest.raises(resight.Error):
        resight.table([1, 2])
    arrow = pytest.importorskip("pyarrow").table(table)
    assert arrow["view"].to_pylist() == ["a", "b"] and arrow["rms_px"].to_pylist()[1] is None
    assert np.array_equal(arrow["covariance"][0].as_py(), answers[0].covariance.ravel())
    assert np.array_equal(arrow["translation_m"][0].as_py(), answers[0].cam_from_target.translation_m)


def test_pictures_of_residuals_and_drift(truth, camera, points_m, pixels):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    answer = resight.solve(points_m, pixels + 0.2, camera, sigma_px=0.3)
    assert "rms" in plot.residuals(points_m, pixels + 0.2, answer, camera).get_title()
    lost = resight.solve(points_m[:2], pixels[:2], camera)
    assert lost.status in plot.residuals(points_m, pixels, lost, camera).get_title()
    moved = resight.Pose.from_vectors([0, 0.01, 0], [0, 0, 0], b="cam", a="cam") @ truth
    covariances = np.repeat(np.eye(6)[None] * 1e-6, 2, axis=0)
    axes = plot.drift_history([0.0, 1.0], [truth.matrix, moved.matrix], covariances, truth)
    drawn = [line.get_ydata() for line in axes[0].get_lines()]
    assert np.allclose([y[0] for y in drawn], 0, atol=1e-9) and abs(abs(drawn[1][1]) - np.degrees(0.01)) < 1e-6
