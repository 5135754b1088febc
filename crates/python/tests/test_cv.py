"""Each row of docs/from-opencv.md: the call of OpenCV beside ours, on the same numbers."""

import cv2
import numpy as np
import pytest

import resight
from conftest import Rows
from resight import cv

ROWS = Rows("from-opencv.md")

K = np.array([[535.4, 0, 341.8], [0, 535.9, 234.2], [0, 0, 1]])
D = np.array([-0.28, 0.07, 0.001, -0.0005, 0.02])
BOARD = np.array([[x, y, 0] for y in range(6) for x in range(9)], dtype=float) * 0.025
RVEC, TVEC = np.array([[0.2], [-0.4], [0.1]]), np.array([[-0.1], [-0.05], [0.6]])


@pytest.fixture
def seen():
    return cv2.projectPoints(BOARD, RVEC, TVEC, K, D)[0]


@ROWS.run("`projectPoints(")
def test_project_points(seen):
    ours, jacobian = cv.projectPoints(BOARD, RVEC, TVEC, K, D)
    assert ours.shape == seen.shape and np.allclose(ours, seen, atol=1e-9) and jacobian is None


@ROWS.run("`solvePnP(")
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


@ROWS.run("`solvePnPGeneric(")
def test_solve_pnp_generic():
    square = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) * 0.05
    seen = cv2.projectPoints(square, np.array([0.3, 0.1, 0.0]), np.array([0.0, 0.0, 3.0]), K, D)[0]
    n, rvecs, tvecs, errors = cv.solvePnPGeneric(square, seen, K, D, sigma_px=0.5)
    result = cv.solvePnPGeneric(square, seen, K, D, sigma_px=0.5)
    assert n == len(rvecs) == len(tvecs) == len(errors) == 2 and result.status == "ambiguous"
    theirs = cv2.solvePnPGeneric(square, seen, K, D, flags=cv2.SOLVEPNP_IPPE_SQUARE)
    for rvec in rvecs:
        assert min(np.abs(rvec - other).max() for other in theirs[1]) < 0.05


@ROWS.run("`solvePnPRansac(")
def test_solve_pnp_ransac(seen):
    wrong = seen.copy()
    wrong[::5] += np.array([60.0, -40.0])
    retval, rvec, tvec, inliers = cv.solvePnPRansac(BOARD, wrong, K, D, reprojectionError=4.0)
    theirs = cv2.solvePnPRansac(BOARD, wrong, K, D, reprojectionError=4.0)
    assert retval and np.allclose(tvec, TVEC, atol=1e-6)
    assert inliers.dtype == np.int32 and np.array_equal(inliers, theirs[3])


@ROWS.run("`stereoCalibrate(")
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


@pytest.fixture
def photographs():
    """Grey images of the left and the right camera, by view."""
    numbers = ("01", "03", "04", "05", "06", "07", "08")
    return {name: {i: cv2.imread(f"examples/photo/{name}{i}.jpg", cv2.IMREAD_GRAYSCALE) for i in numbers} for name in ("left", "right")}


def corners_of(image):
    found, corners = cv2.findChessboardCorners(image, (9, 6))
    assert found
    return cv2.cornerSubPix(image, corners, (5, 5), (-1, -1), (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, 1e-3))


@ROWS.run("`findChessboardCorners`", "`cv::FileStorage`")
def test_corners_and_camera_files(photographs):
    theirs = corners_of(photographs["left"]["01"]).reshape(-1, 2)
    ours = resight.detect("examples/photo/left01.jpg", "examples/photo/board.toml").to_dict()["detections"]
    errors = np.array([[entry["u_px"], entry["v_px"]] for entry in ours])[:, None] - theirs
    assert np.median(np.linalg.norm(errors, axis=2).min(axis=1)) < 0.1 and all(0 < entry["sigma_px"] < 1 for entry in ours)
    file = cv2.FileStorage("examples/photo/left.yml", cv2.FILE_STORAGE_READ)
    assert np.array_equal(resight.read_camera("examples/photo/left.yml").matrix, file.getNode("camera_matrix").mat())


@ROWS.run("`calibrateCamera`")
def test_intrinsics(photographs):
    """Fewer images than a good calibration needs: the two agree within our ±."""
    corners = [corners_of(image) for image in photographs["left"].values()]
    _, theirs, *_ = cv2.calibrateCamera([BOARD.astype(np.float32)] * len(corners), corners, (640, 480), None, None)
    ours = resight.intrinsics("examples/photo/board.toml", photographs["left"].values())
    camera = resight.Camera.parse(_saved(ours))
    sigma = np.sqrt(np.diag(camera.intrinsics_covariance))
    assert abs(camera.parameters["fx_px"] - theirs[0, 0]) < 5 * sigma[0] and sigma[0] < 10


def _saved(answer, tmp="/tmp"):
    import pathlib
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "camera.toml"
        answer.save(file)
        return file.read_text()


@ROWS.run("`calibrateMultiview`")
def test_several_cameras(photographs):
    """The same rig of two cameras, theirs within five of our standard deviations and a millimetre."""
    names, views = ("left", "right"), list(photographs["left"])
    lenses = [resight.read_camera(f"examples/photo/{name}.yml") for name in names]
    matrices, coefficients = [lens.matrix for lens in lenses], [np.array([[lens.parameters[k] for k in list(lens.parameters)[4:]]]) for lens in lenses]
    seen = [[corners_of(photographs[name][view]).reshape(-1, 1, 2).astype(np.float32) for view in views] for name in names]
    flags = cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_FIX_INTRINSIC
    found = cv2.calibrateMultiview([BOARD.astype(np.float32)] * len(views), seen, [(640, 480)] * 2, np.ones((2, len(views)), np.uint8),
                                   np.zeros(2, np.uint8), matrices, coefficients, flagsForIntrinsics=np.full(2, flags, np.int32))
    rig = resight.rig_from_images(dict(zip(names, lenses)), "examples/photo/board.toml", photographs)
    place = rig.cameras.right.cam_from_rig.translation_m
    assert rig.status == "ok" and np.linalg.norm(np.ravel(_translation(found)) - place) < 2e-3


def _translation(found):
    """Ts[1] of what `calibrateMultiview` returns, whose order differs between versions: the only list of two vectors of three."""
    lists = [item for item in found if isinstance(item, (list, tuple)) and len(item) == 2 and all(np.size(x) == 3 for x in item)]
    return lists[-1][1]


@ROWS.run("`aruco.ArucoDetector.detectMarkers`")
def test_markers():
    gray = cv2.imread("testdata/demo/left.png", cv2.IMREAD_GRAYSCALE)
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11))
    corners, ids, _ = detector.detectMarkers(gray)
    theirs = dict(zip(np.ravel(ids).tolist(), corners))
    ours = resight.detect(gray, family="any").to_dict()["detections"]
    found = {(entry["id"], entry["corner"]): (entry["u_px"], entry["v_px"]) for entry in ours}
    assert theirs
    for tag, quad in theirs.items():
        distances = [np.linalg.norm(quad[0, (k + 2) % 4] - found[tag, k]) for k in range(4)]  # Half a turn, docs/from-apriltag.md.
        assert max(distances) < 2.5, (tag, distances)


def test_each_row_is_run():
    ROWS.check()
