"""Each row of docs/from-opencv.md: the call of OpenCV beside ours, on the same numbers."""

import numpy as np
import pytest

from resight import cv

cv2 = pytest.importorskip("cv2")

K = np.array([[535.4, 0, 341.8], [0, 535.9, 234.2], [0, 0, 1]])
D = np.array([-0.28, 0.07, 0.001, -0.0005, 0.02])
BOARD = np.array([[x, y, 0] for y in range(6) for x in range(9)], dtype=float) * 0.025
RVEC, TVEC = np.array([[0.2], [-0.4], [0.1]]), np.array([[-0.1], [-0.05], [0.6]])


@pytest.fixture
def seen():
    return cv2.projectPoints(BOARD, RVEC, TVEC, K, D)[0]


def test_project_points(seen):
    ours, jacobian = cv.projectPoints(BOARD, RVEC, TVEC, K, D)
    assert ours.shape == seen.shape and np.allclose(ours, seen, atol=1e-9) and jacobian is None


def test_solve_pnp(seen):
    theirs, ours = cv2.solvePnP(BOARD, seen, K, D), cv.solvePnP(BOARD, seen, K, D)
    retval, rvec, tvec = ours
    assert retval and np.allclose(rvec, RVEC, atol=1e-7) and np.allclose(tvec, TVEC, atol=1e-7)
    assert rvec.shape == theirs[1].shape and tvec.shape == theirs[2].shape
    assert ours.status == "ok" and ours.covariance.shape == (6, 6)


def test_solve_pnp_on_three_points_of_a_line_and_one_off_it():
    """Where cv2's ITERATIVE and IPPE have no answer or a wrong one."""
    points = np.array([[0, 0, 0], [0.1, 0, 0], [0.15, 0, 0], [0, 0.15, 0]])
    seen = cv2.projectPoints(points, RVEC, TVEC, K, D)[0]
    ours = cv.solvePnP(points, seen, K, D, sigma_px=0.1)
    assert ours[0] and np.allclose(ours[2], TVEC, atol=1e-6)


def test_solve_pnp_generic():
    square = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) * 0.05
    seen = cv2.projectPoints(square, np.array([0.3, 0.1, 0.0]), np.array([0.0, 0.0, 3.0]), K, D)[0]
    n, rvecs, tvecs, errors = cv.solvePnPGeneric(square, seen, K, D, sigma_px=0.5)
    result = cv.solvePnPGeneric(square, seen, K, D, sigma_px=0.5)
    assert n == len(rvecs) == len(tvecs) == len(errors) == 2 and result.status == "ambiguous"
    theirs = cv2.solvePnPGeneric(square, seen, K, D, flags=cv2.SOLVEPNP_IPPE_SQUARE)
    for rvec in rvecs:
        assert min(np.abs(rvec - other).max() for other in theirs[1]) < 0.05


def test_solve_pnp_ransac(seen):
    wrong = seen.copy()
    wrong[::5] += np.array([60.0, -40.0])
    retval, rvec, tvec, inliers = cv.solvePnPRansac(BOARD, wrong, K, D, reprojectionError=4.0)
    theirs = cv2.solvePnPRansac(BOARD, wrong, K, D, reprojectionError=4.0)
    assert retval and np.allclose(tvec, TVEC, atol=1e-6)
    assert inliers.dtype == np.int32 and np.array_equal(inliers, theirs[3])


def test_stereo_extrinsics():
    rng = np.random.default_rng(1)
    turn, shift = cv2.Rodrigues(np.array([0.0, 0.1, 0.0]))[0], np.array([[-0.12], [0.0], [0.01]])
    objects, left, right = [], [], []
    for _ in range(6):
        rvec, tvec = rng.normal(0, 0.3, (3, 1)), TVEC + rng.normal(0, 0.05, (3, 1))
        rotation = cv2.Rodrigues(rvec)[0]
        objects.append(BOARD.astype(np.float32))
        left.append(cv2.projectPoints(BOARD, rvec, tvec, K, D)[0] + rng.normal(0, 0.1, (54, 1, 2)))
        second = cv2.Rodrigues(turn @ rotation)[0]
        right.append(cv2.projectPoints(BOARD, second, turn @ tvec + shift, K, D)[0] + rng.normal(0, 0.1, (54, 1, 2)))
    ours = cv.stereoExtrinsics(objects, left, right, K, D, K, D, sigma_px=0.1)
    error, rotation, translation = ours
    assert ours.status == "ok" and error < 0.2
    sigma = np.sqrt(np.diag(ours.covariance))
    assert np.all(np.abs(translation - shift).ravel() < 5 * sigma[3:]) and sigma[3:].max() < 1e-3
    assert np.allclose(rotation, turn, atol=5 * sigma[:3].max())


def test_what_is_no_answer_is_not_true():
    line = np.array([[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0], [0.3, 0, 0]])
    seen = cv2.projectPoints(line, RVEC, TVEC, K, D)[0]
    result = cv.solvePnP(line, seen, K, D)
    assert result[0] is False and result.status == "degenerate" and result[1] is None
    mixed = cv.solvePnP(BOARD, np.roll(cv2.projectPoints(BOARD, RVEC, TVEC, K, D)[0], 7, axis=0), K, D)
    assert mixed[0] is False and mixed.status == "inconsistent"
