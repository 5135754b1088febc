"""Each row of docs/from-opencv.md: the call of OpenCV beside ours, on the same numbers."""

import subprocess
import sys
import tomllib

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


@ROWS.run("the same from images")
def test_intrinsics(photographs, tmp_path):
    """Fewer images than a good calibration needs: the two agree within our ±."""
    corners = [corners_of(image) for image in photographs["left"].values()]
    _, theirs, *_ = cv2.calibrateCamera([BOARD.astype(np.float32)] * len(corners), corners, (640, 480), None, None)
    resight.intrinsics("examples/photo/board.toml", photographs["left"].values()).save(tmp_path / "camera.toml")
    camera = resight.read_camera(tmp_path / "camera.toml")
    sigma = np.sqrt(np.diag(camera.intrinsics_covariance))
    assert abs(camera.parameters["fx_px"] - theirs[0, 0]) < 5 * sigma[0] and sigma[0] < 10


@ROWS.run("`calibrateMultiview`")
def test_several_cameras(photographs):
    """The same rig of two cameras to two millimetres: what these views agree on, docs/rigs.md."""
    names, views = ("left", "right"), list(photographs["left"])
    lenses = [resight.read_camera(f"examples/photo/{name}.yml") for name in names]
    matrices, coefficients = [lens.matrix for lens in lenses], [np.array([[lens.parameters[k] for k in list(lens.parameters)[4:]]]) for lens in lenses]
    seen = [[corners_of(photographs[name][view]).reshape(-1, 1, 2).astype(np.float32) for view in views] for name in names]
    flags = cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_FIX_INTRINSIC
    *_, translations = cv2.calibrateMultiview(
        [BOARD.astype(np.float32)] * len(views), seen, [(640, 480)] * 2, np.ones((2, len(views)), np.uint8), np.zeros(2, np.uint8), matrices,
        coefficients, None, None, flagsForIntrinsics=np.full(2, flags, np.int32), flags=cv2.CALIB_USE_INTRINSIC_GUESS)
    rig = resight.rig_from_images(dict(zip(names, lenses)), "examples/photo/board.toml", photographs)
    place = rig.cameras.right.cam_from_rig.translation_m
    assert rig.status == "ok" and np.linalg.norm(np.ravel(translations[1]) - place) < 2e-3


@ROWS.run("`aruco.ArucoDetector.detectMarkers`")
def test_markers(tags):
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11))
    corners, ids, _ = detector.detectMarkers(tags)
    ours = resight.detect(tags, family="any").to_dict()["detections"]
    found = {(entry["id"], entry["corner"]): (entry["u_px"], entry["v_px"]) for entry in ours}
    assert 10 <= len(corners) and all(0 < entry["sigma_px"] for entry in ours)
    for tag, quad in zip(np.ravel(ids).tolist(), corners):
        distances = [np.linalg.norm(quad[0, (k + 2) % 4] - found[tag, k]) for k in range(4)]  # Half a turn, docs/from-apriltag.md.
        assert max(distances) < 2.5, (tag, distances)


@ROWS.run("`findCirclesGrid(image, (4, 11)")
def test_circle_grid(tmp_path):
    """The same centres in the same order; the circles' own centres, which perspective shifts from those of their images."""
    spacing = 0.02
    centres = np.array([[(2 * j + i % 2) * spacing, i * spacing] for i in range(11) for j in range(4)])
    to_image = np.array([[3500.0, 300, 250], [150, 3300, 200], [0.35, 0.5, 1]])

    def seen(points):
        image = np.c_[points, np.ones(len(points))] @ to_image.T
        return image[:, :2] / image[:, 2:]

    large = np.full((4 * 960, 4 * 1280), 235, np.uint8)
    angles = np.linspace(0, 2 * np.pi, 200)
    for centre in centres:
        outline = (seen(centre + 0.006 * np.c_[np.cos(angles), np.sin(angles)]) + 0.5) * 4 - 0.5
        cv2.fillPoly(large, [np.round(outline * 256).astype(np.int32)], 20, lineType=cv2.LINE_AA, shift=8)
    image = cv2.GaussianBlur(cv2.resize(large, (1280, 960), interpolation=cv2.INTER_AREA), (0, 0), 0.8)
    target = tmp_path / "grid.toml"
    target.write_text('kind = "circle_grid"\nrows = 11\ncolumns = 4\nspacing_m = 0.02\ndiameter_m = 0.012\nasymmetric = true\n')
    found, theirs = cv2.findCirclesGrid(image, (4, 11), flags=cv2.CALIB_CB_ASYMMETRIC_GRID)
    ours = resight.detect(image, target).to_dict()["detections"]
    assert found and [entry["id"] for entry in ours] == list(range(44))
    pixels = np.array([[entry["u_px"], entry["v_px"]] for entry in ours])
    assert np.abs(pixels - theirs.reshape(-1, 2)).max() < 1
    errors = [np.sqrt(np.mean((them - seen(centres)) ** 2)) for them in (pixels, theirs.reshape(-1, 2))]
    assert errors[0] < 0.05 and errors[0] < errors[1] and all(0 < entry["sigma_px"] < 0.2 for entry in ours), errors


@ROWS.run("`aruco.GridBoard(")
def test_grid_board(tmp_path):
    """The sheet that `print` writes has OpenCV's ids and distances; its origin is the centre of the first tag."""
    command = "-m resight print --kind tag --family DICT_4X4_50 --id 0-11 --columns 4 --size-m 0.04 --tag-spacing-ratio 0.25 -o"
    subprocess.run([sys.executable, *command.split(), tmp_path / "board.pdf"], check=True)
    tags = tomllib.loads((tmp_path / "board.toml").read_text())["tag"]
    board = cv2.aruco.GridBoard((4, 3), 0.04, 0.01, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    theirs = np.array(board.getObjPoints()).mean(axis=1)
    ours = np.array([tag["world_from_tag"]["translation_m"] for tag in tags])
    assert [tag["id"] for tag in tags] == np.ravel(board.getIds()).tolist()
    assert np.allclose(ours, theirs - theirs[0], atol=1e-6)


@ROWS.run("`calibrateCamera(")
def test_calibrate_camera(photographs):
    corners = [corners_of(image) for image in photographs["left"].values()]
    boards = [BOARD.astype(np.float32)] * len(corners)
    theirs = cv2.calibrateCamera(boards, corners, (640, 480), None, None)
    ours = cv.calibrateCamera(boards, corners, (640, 480), None, None)
    retval, matrix, distortion, rvecs, tvecs = ours
    parameters = {p["name"]: p for p in ours.answer.to_dict()["cameras"][0]["intrinsics"]["parameters"]}
    assert ours.status == "ok" and retval < 1 and distortion.shape[0] == 1 and 5 <= distortion.shape[1]
    assert abs(matrix[0, 0] - theirs[1][0, 0]) < 5 * parameters["fx_px"]["sigma"] and matrix[0, 0] == parameters["fx_px"]["value"]
    assert len(rvecs) == len(tvecs) == len(corners)
    for rvec, tvec, board, seen in zip(rvecs, tvecs, boards, corners):
        error = cv2.projectPoints(board, rvec, tvec, matrix, distortion)[0].reshape(-1, 2) - seen.reshape(-1, 2)
        assert np.sqrt(np.mean(error**2)) < 0.5
    for held in (cv2.CALIB_FIX_ASPECT_RATIO, cv2.CALIB_FIX_PRINCIPAL_POINT, cv2.CALIB_ZERO_TANGENT_DIST, cv2.CALIB_FIX_K3):
        with pytest.raises(resight.Error, match="leave them out"):
            cv.calibrateCamera(boards, corners, (640, 480), flags=held)
    for taken in (cv2.CALIB_USE_INTRINSIC_GUESS, cv2.CALIB_RATIONAL_MODEL, cv2.CALIB_THIN_PRISM_MODEL, cv2.CALIB_TILTED_MODEL):
        assert cv._CALIB_TAKEN & taken == taken
    nothing = cv.calibrateCamera(boards[:1], corners[:1], (640, 480))
    assert nothing[0] is None and nothing.status == "degenerate"
    with pytest.raises(resight.Error, match="one item for each view"):
        cv.calibrateCamera(boards, corners[1:], (640, 480))


def robot(n, rng, noise=0.0):
    """Poses of a gripper and of a target that a camera on it sees: R and t of each, and gripper_from_cam."""
    def pose(turn, shift):
        return resight.Pose.from_vectors(turn, shift).matrix

    gripper_from_cam, base_from_target = pose([0.1, -0.2, 1.5], [0.04, -0.02, 0.07]), pose([3.0, 0.1, 0.2], [0.6, 0.1, 0.0])
    grippers = [pose(rng.normal(0, 0.5, 3), [0.5, 0.0, 0.6] + rng.normal(0, 0.1, 3)) for _ in range(n)]
    noisy = [pose(rng.normal(0, noise, 3), rng.normal(0, noise, 3)) for _ in range(n)]
    targets = [e @ np.linalg.inv(g @ gripper_from_cam) @ base_from_target for g, e in zip(grippers, noisy)]
    return grippers, targets, gripper_from_cam


def parts(poses):
    return [p[:3, :3] for p in poses], [p[:3, 3:] for p in poses]


@ROWS.run("`calibrateHandEye(")
def test_calibrate_hand_eye():
    grippers, targets, truth = robot(15, np.random.default_rng(3), noise=1e-3)
    ours = cv.calibrateHandEye(*parts(grippers), *parts(targets))
    rotation, translation = ours
    if hasattr(cv2, "calibrateHandEye"):  # OpenCV 5.0 has it in C++ alone.
        theirs = cv2.calibrateHandEye(*parts(grippers), *parts(targets))
        assert np.linalg.norm(theirs[1] - translation) < 2e-2
    sigma = np.sqrt(np.diag(ours.covariance))
    assert ours.status == "ok" and translation.shape == (3, 1) and rotation.shape == (3, 3)
    assert np.all(np.abs(translation.ravel() - truth[:3, 3]) < 5 * sigma[3:].max()) and sigma[3:].max() < 5e-3
    assert np.linalg.norm(cv2.Rodrigues(rotation @ truth[:3, :3].T)[0]) < 5 * sigma[:3].max() * np.sqrt(3)
    vectors = [cv2.Rodrigues(r)[0] for r in parts(grippers)[0]]
    again = cv.calibrateHandEye(vectors, parts(grippers)[1], *parts(targets), method=cv2.CALIB_HAND_EYE_PARK)
    assert np.allclose(again[1], translation, atol=1e-9)
    still = cv.calibrateHandEye(*parts(grippers[:1] * 15), *parts(targets[:1] * 15))
    assert still[0] is None and still.status == "degenerate" and still.covariance is None
    with pytest.raises(resight.Error, match="15 R_gripper2base and 14"):
        cv.calibrateHandEye(parts(grippers)[0], parts(grippers)[1][1:], *parts(targets))


@ROWS.run("`Rodrigues(")
def test_rodrigues():
    for vector in (RVEC, RVEC.ravel(), np.zeros((3, 1)), np.array([0.0, np.pi, 0.0])):
        matrix, jacobian = cv.Rodrigues(vector)
        assert np.allclose(matrix, cv2.Rodrigues(vector)[0], atol=1e-12) and jacobian is None
        back = cv.Rodrigues(matrix)[0]
        assert back.shape == (3, 1) and np.allclose(cv2.Rodrigues(back)[0], matrix, atol=1e-12)
    for wrong in (np.diag([1.0, 1, -1]), np.eye(4), np.zeros((3, 3)), [1, 2]):
        with pytest.raises(resight.Error):
            cv.Rodrigues(wrong)


@ROWS.run("`undistort(")
def test_undistort(photographs):
    grey = photographs["left"]["01"]
    colour = cv2.imread("examples/photo/left01.jpg")
    wide = np.array([[400.0, 0, 320], [0, 400, 240], [0, 0, 1]])
    for image in (grey, colour, np.asfortranarray(grey)):
        for matrix in (None, wide):
            theirs = cv2.undistort(image, K, D, None, matrix)
            ours = cv.undistort(image, K, D, None, matrix)
            assert ours.shape == theirs.shape and ours.dtype == np.uint8
            # OpenCV interpolates to 1/32 px: a grey level or two at edges, and whole pixels at the border alone.
            assert np.mean(np.abs(ours.astype(int) - theirs.astype(int)) <= 3) > 0.995
    for wrong in (grey.astype(float), np.zeros((4, 4, 2), np.uint8), "left01.jpg", grey[:0]):
        with pytest.raises(resight.Error):
            cv.undistort(wrong, K, D)


def test_arguments_are_taken_in_the_order_of_opencv(seen):
    """With flags, start values and outputs, by place and by name, in each shape."""
    guess = RVEC.copy(), TVEC.copy()
    expected = cv.solvePnP(BOARD, seen, K, D)
    for points, pixels in ((BOARD[:, None], seen), (BOARD[None], seen.reshape(1, -1, 2)), (BOARD.astype(np.float32), seen.reshape(-1, 2))):
        for flags in (cv2.SOLVEPNP_ITERATIVE, cv2.SOLVEPNP_SQPNP, cv2.SOLVEPNP_EPNP):
            theirs = cv2.solvePnP(points, pixels, K, D, *guess, True, flags)
            ours = cv.solvePnP(points, pixels, K, D, *guess, True, flags)
            assert len(ours) == len(theirs) and np.allclose(ours[2], expected[2], atol=1e-6)
    assert cv.solvePnP(BOARD, seen, K, D, flags=cv2.SOLVEPNP_IPPE)[0]
    named = dict(useExtrinsicGuess=False, iterationsCount=50, reprojectionError=4.0, confidence=0.99, flags=cv2.SOLVEPNP_EPNP)
    assert len(cv.solvePnPRansac(BOARD, seen, K, D, **named)) == len(cv2.solvePnPRansac(BOARD, seen, K, D, **named)) == 4
    assert cv.solvePnPRansac(BOARD, seen, K, D, None, None, False, 50, 4.0)[3].shape == (54, 1)
    assert len(cv.solvePnPGeneric(BOARD, seen, K, D, flags=cv2.SOLVEPNP_SQPNP)) == 4
    assert resight.cv is cv


def test_results_are_pickled(seen):
    import copy
    import pickle

    result = cv.solvePnP(BOARD, seen, K, D)
    for again in (pickle.loads(pickle.dumps(result)), copy.deepcopy(result)):
        assert again.status == "ok" and np.array_equal(again[2], result[2]) and np.array_equal(again.covariance, result.covariance)
        assert again.answer == result.answer and again[0] is True


def test_unrelated_points_cost_no_more_than_related_ones():
    """A threshold far below the noise made every sample of three seem good to itself: 20 s, and Ctrl-C was not heard."""
    import time

    rng = np.random.default_rng(0)
    points, pixels = rng.normal(size=(100, 3)), rng.normal(size=(100, 2)) * 300 + 500
    for threshold in (1e-8, 1e-3, 1.0, 8.0, 30.0, 1e6):
        begun = time.process_time()
        result = cv.solvePnPRansac(points, pixels, K, None, reprojectionError=threshold)
        assert result[0] is False and time.process_time() - begun < 5, threshold


def test_each_row_is_run():
    ROWS.check()
