"""What was not seen: NaN and masked arrays, in each call that takes arrays."""

import numpy as np
import pytest

import resight
from conftest import POINTS_M

SQUARE = np.array([[0, 0, 0], [0.1, 0, 0], [0.15, 0, 0], [0, 0.15, 0], [0.1, 0.1, 0.02], [0.05, 0.12, 0.01]])


@pytest.fixture
def seen(camera, truth):
    return camera.project(truth @ SQUARE)


def hidden(pixels, *rows):
    """Returns the pixels twice, some rows of which were not seen: as NaN, and masked with a wrong number behind the mask."""
    nan, wrong, mask = pixels.copy(), pixels.copy(), np.zeros(pixels.shape, bool)
    nan[list(rows)], wrong[list(rows)], mask[list(rows)] = np.nan, wrong[list(rows)] + 80, True
    return nan, np.ma.masked_array(wrong, mask)


def test_a_point_that_was_not_seen_is_left_out(camera, seen):
    without = resight.solve(np.delete(SQUARE, 3, 0), np.delete(seen, 3, 0), camera, sigma_px=0.3)
    for given in hidden(seen, 3):
        answer = resight.solve(SQUARE, given, camera, sigma_px=0.3)
        assert answer.status == "ok" and answer.n_points == 5
        assert np.array_equal(answer.cam_from_target.matrix, without.cam_from_target.matrix)
        assert any("1 of 6 points was not seen" in remark for remark in answer.remarks)
    whole = np.ma.masked_array(seen, np.zeros(seen.shape, bool))
    assert resight.solve(SQUARE, whole, camera).to_json() == resight.solve(SQUARE, seen, camera).to_json()


def test_rows_of_inliers_and_of_the_worst_point_are_those_given(camera, seen):
    wrong = seen.copy()
    wrong[5] += [70, -40]
    for given in hidden(wrong, 1):
        assert resight.solve(SQUARE, given, camera).to_dict()["worst_point"]["index"] == 5
    many = np.vstack([SQUARE, SQUARE + [0.3, 0.1, 0.03]])
    pixels = camera.project(resight.Pose.from_vectors([0.3, -0.5, 0.1], [0.02, 0.03, 1.2]) @ many)
    pixels[5] += [70, -40]
    for given in hidden(pixels, 1, 7):
        answer = resight.solve(many, given, camera, robust_threshold_px=4.0).to_dict()
        assert answer["inliers"] == [0, 2, 3, 4, 6, 8, 9, 10, 11]


def test_half_a_pixel_and_a_place_that_is_missing_are_named(camera, seen):
    half = seen.copy()
    half[2, 0] = np.nan
    with pytest.raises(resight.Error, match=r"point 2: its pixel \(NaN, .*half missing"):
        resight.solve(SQUARE, half, camera)
    places = SQUARE.copy()
    places[4] = np.nan
    assert resight.solve(places, seen, camera).status == "error"
    neither = seen.copy()
    neither[4] = np.nan
    assert resight.solve(places, neither, camera).status == "ok"
    nothing = resight.solve(SQUARE, seen * np.nan, camera)
    assert nothing.status == "degenerate" and "6 of 6 points were not seen" in nothing.remarks[0]


@pytest.mark.parametrize("k", [4, 6])
def test_many_views_miss_points_each_its_own(camera, truth, k):
    points = POINTS_M if k == 4 else SQUARE
    views = np.repeat(camera.project(truth @ points)[None], 50, axis=0) + np.random.default_rng(k).normal(0, 0.1, (50, k, 2))
    gaps = views.copy()
    gaps[7, 2], gaps[9] = np.nan, np.nan
    whole, poses = resight.solve_many(points, views, camera), resight.solve_many(points, gaps, camera)
    rows = resight.solve_many(np.tile(points, (50, 1)), gaps.reshape(-1, 2), camera, offsets=range(0, 50 * k + 1, k))
    kept = np.delete(np.arange(50), [7, 9])
    assert np.array_equal(poses.cam_from_target[kept], whole.cam_from_target[kept]) and poses.status[9] == "degenerate"
    alone = resight.solve(np.delete(points, 2, 0), np.delete(views[7], 2, 0), camera)
    assert poses.status[7] == rows.status[7] == alone.status
    assert any(np.allclose(poses.cam_from_target[7], minimum, atol=1e-6) for minimum in alone.minima)
    assert resight.table(poses).column("n_points").tolist() == [k - 1 if i == 7 else 0 if i == 9 else k for i in range(50)]


def test_masked_numbers_are_read_nowhere(camera, seen):
    masked = np.ma.masked_array(np.eye(4), np.eye(4) == 1)
    for call in (
        lambda: resight.Pose.from_matrix(masked),
        lambda: resight.Camera.from_matrix(masked[:3, :3]),
        lambda: resight.cv.Rodrigues(masked[:3, :3]),
        lambda: camera.project(np.ma.masked_array(SQUARE + [0, 0, 1], SQUARE == 0.1)),
        lambda: resight.locate_image(np.ma.masked_array(np.zeros((48, 64), np.uint8), np.ones((48, 64), bool)), camera,
                                     resight.read_target("examples/photo/board.toml")),
        lambda: resight.solve(SQUARE, np.ma.masked_array(["a"] * 6), camera),
    ):
        with pytest.raises(resight.Error):
            call()
    noise = np.ma.masked_array(np.full(6, 0.3), [0, 0, 0, 0, 0, 1])
    assert resight.solve(SQUARE, seen, camera, sigma_px=noise).status == "error"


def test_masked_and_missing_cells_of_tables():
    cells = dict(view=["a"] * 6, id=list("012345"), x_m=SQUARE[:, 0], y_m=SQUARE[:, 1], z_m=SQUARE[:, 2])
    camera = resight.Camera("pinhole", width_px=640, height_px=480, fx_px=500, fy_px=500, cx_px=319.5, cy_px=239.5)
    seen = camera.project(SQUARE + [0, 0, 1])
    sigma = np.ma.masked_array(np.full(6, 1e-6), np.ones(6, bool))
    table = dict(cells, camera=["left"] * 6, u_px=seen[:, 0], v_px=seen[:, 1], sigma_px=sigma)
    stated = resight.rig_from_detections({"left": camera}, dict(table, sigma_px=np.full(6, 0.5)))
    assert resight.rig_from_detections({"left": camera}, table).to_dict().get("chi2") == stated.to_dict().get("chi2")
