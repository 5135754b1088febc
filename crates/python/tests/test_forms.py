"""The forms in which people hold images, detections and a robot's poses: each gives the same answer."""

import glob

import cv2
import numpy as np
import pytest

import resight
from conftest import ROOT

BOARD = "examples/photo/board.toml"
NAMES = ("left", "right")
CAMERAS = {name: f"examples/photo/{name}.yml" for name in NAMES}
PATTERNS = {name: f"examples/photo/{name}*.jpg" for name in NAMES}


def places(rig):
    return rig.status, np.round(rig.cameras.right.cam_from_rig.translation_m, 9).tolist()


def test_patterns_lists_of_paths_and_arrays_are_one_rig():
    expected = places(resight.rig_from_images(CAMERAS, BOARD, PATTERNS))
    paths = {name: sorted(glob.glob(pattern)) for name, pattern in PATTERNS.items()}
    backwards = {name: [ROOT / path for path in reversed(paths[name])] for name in NAMES}
    parts = {name: [f"examples/photo/{name}0[1-4].jpg", *[path for path in paths[name] if path[-5] not in "1234"]] for name in NAMES}
    for images in (paths, backwards, parts):
        assert places(resight.rig_from_images(CAMERAS, BOARD, images)) == expected
    bytes_ = {name: [open(path, "rb").read() for path in paths[name]] for name in NAMES}
    assert places(resight.rig_from_images(CAMERAS, BOARD, bytes_)) == expected
    arrays = {name: np.stack([cv2.imread(path, cv2.IMREAD_GRAYSCALE) for path in paths[name]]) for name in NAMES}
    colours = {name: [cv2.imread(path) for path in paths[name]] for name in NAMES}
    for images in (arrays, colours):
        status, place = places(resight.rig_from_images(CAMERAS, BOARD, images))
        assert status == expected[0] and np.allclose(place, expected[1], atol=2e-3)


def test_lists_that_share_no_view_say_so():
    lists = {"left": sorted(glob.glob("examples/photo/left0[1-4].jpg")), "right": sorted(glob.glob("examples/photo/right0[5-8].jpg"))}
    answer = resight.rig_from_images(CAMERAS, BOARD, lists)
    assert answer.status == "not_connected" and "matched by their names" in answer.message and "`left01`" in answer.message


def test_intrinsics_from_files_images_tables_and_arrays(tmp_path):
    target = resight.read_target(BOARD)
    paths = sorted(glob.glob("examples/photo/left0*.jpg"))
    expected = resight.intrinsics(target, "examples/photo/left0*.jpg")
    assert resight.intrinsics(target, paths).to_json() == expected.to_json()
    image = resight.intrinsics(target, cv2.imread(paths[0]))
    assert image.status == "degenerate" and len(image.cameras) == 1
    rows = [dict(view=path, id=str(d["id"]), corner=str(d["corner"]), u_px=d["u_px"], v_px=d["v_px"], sigma_px=d["sigma_px"])
            for path in paths for d in resight.detect(path, target).to_dict()["detections"]]
    table = {name: [row[name] for row in rows] for name in rows[0]}
    of_table = resight.intrinsics(target, detections=table, image_size_px=(640, 480))
    with open(tmp_path / "rows.csv", "w", encoding="utf-8") as file:
        print(",".join(table), file=file)
        for row in rows:
            print(",".join(repr(value) if isinstance(value, float) else value for value in row.values()), file=file)
    of_file = resight.intrinsics(target, detections=tmp_path / "rows.csv", image_size_px=(640, 480))
    assert of_table.to_json() == of_file.to_json() and of_table.cameras[0].intrinsics is not None
    assert abs(of_table.cameras[0].intrinsics.parameters[0].value - expected.cameras[0].intrinsics.parameters[0].value) < 1
    check = resight.check_intrinsics(CAMERAS["left"], target, detections=dict(table, camera=["left"] * len(rows)))
    assert check.cameras[0].status in ("ok", "inconsistent")
    with pytest.raises(resight.Error, match="image_size_px"):
        resight.intrinsics(target, detections=table)


def robot(n=15):
    rng = np.random.default_rng(3)
    pose = lambda turn, shift: resight.Pose.from_vectors(turn, shift)  # noqa: E731
    gripper_from_cam, base_from_target = pose([0.1, -0.2, 1.5], [0.04, -0.02, 0.07]), pose([3.0, 0.1, 0.2], [0.6, 0.1, 0.0])
    seen = [pose(rng.normal(0, 0.4, 3), rng.normal(0, 0.02, 3) + [0, 0, 0.6]).matrix for _ in range(n)]
    in_base = [base_from_target.matrix @ np.linalg.inv(gripper_from_cam.matrix @ m) for m in seen]
    grippers = [resight.Pose.from_matrix(m) for m in in_base]
    noisy = [m @ pose(rng.normal(0, 1e-3, 3), rng.normal(0, 1e-3, 3)).matrix for m in seen]
    return grippers, noisy, gripper_from_cam


def test_motions_in_every_form_are_one_hand_eye(tmp_path):
    grippers, seen, truth = robot()
    covariance = np.broadcast_to(np.diag([1e-6] * 3 + [1e-6] * 3), (15, 6, 6))
    expected = resight.hand_eye(np.stack([g.matrix for g in grippers]), poses=np.stack(seen), poses_covariance=covariance)
    found = np.linalg.inv(expected.cam_from_gripper.matrix)
    assert expected.status == "ok" and np.allclose(found[:3, 3], truth.translation_m, atol=5e-3)
    views = [f"view {i}" for i in range(15)]
    columns = {"view": views} | {f"q{k}": [g.rotation_wxyz[i] for g in grippers] for i, k in enumerate("wxyz")}
    columns |= {f"{k}_m": [g.translation_m[i] for g in grippers] for i, k in enumerate("xyz")}
    with open(tmp_path / "motions.csv", "w", encoding="utf-8") as file:
        print(",".join(columns), file=file)
        for row in zip(*columns.values()):
            print(",".join(value if isinstance(value, str) else repr(float(value)) for value in row), file=file)
    named = dict(zip(views, seen))
    for motions in (dict(zip(views, grippers)), columns, tmp_path / "motions.csv"):
        answer = resight.hand_eye(motions, poses=named, poses_covariance=covariance)
        assert answer.status == "ok" and np.allclose(answer.cam_from_gripper.matrix, expected.cam_from_gripper.matrix, atol=1e-9)
    as_lists = resight.hand_eye([g.matrix.tolist() for g in grippers], poses=[resight.Pose.from_matrix(m) for m in seen], poses_covariance=covariance)
    assert as_lists.to_json() == expected.to_json()
    positions, quaternions = np.stack([g.translation_m for g in grippers]), np.stack([g.rotation_wxyz for g in grippers])
    r = np.stack([g.matrix[:3, :3] for g in grippers])
    kuka = np.degrees([np.arctan2(r[:, 1, 0], r[:, 0, 0]), np.arcsin(-r[:, 2, 0]), np.arctan2(r[:, 2, 1], r[:, 2, 2])]).T
    for rows, stated in (
        (np.hstack([positions, quaternions]), dict(rotation="quaternion-wxyz")),
        (np.hstack([positions, np.roll(quaternions, -1, axis=1)]), dict(rotation="quaternion-xyzw")),
        (np.hstack([1e3 * positions, kuka]), dict(rotation="kuka")),
        (np.hstack([1e2 * positions, kuka]), dict(rotation="kuka", length="cm")),
        ({"view": [str(i) for i in range(15)]} | dict(zip("XYZABC", np.hstack([1e3 * positions, kuka]).T)), dict(rotation="kuka")),
    ):
        target = dict(zip(map(str, range(15)), seen)) if isinstance(rows, dict) else np.stack(seen)
        answer = resight.hand_eye(rows, poses=target, poses_covariance=covariance, **stated)
        assert answer.status == "ok" and np.allclose(answer.cam_from_gripper.matrix, expected.cam_from_gripper.matrix, atol=1e-9)
    wrong = resight.hand_eye(np.hstack([1e3 * positions, kuka]), poses=np.stack(seen), poses_covariance=covariance, rotation="staubli")
    assert wrong.status != "ok" and "kuka" in wrong.to_json()


def test_hand_eye_from_answers_and_points():
    grippers, seen, truth = robot()
    camera = resight.read_camera(CAMERAS["left"])
    board = resight.read_target(BOARD)
    centred = board.points_m - board.points_m.mean(axis=0)
    rng, answers, rows = np.random.default_rng(5), [], []
    for i, matrix in enumerate(seen):
        turned = resight.Pose.from_matrix(matrix)
        pixels = camera.project(turned @ centred) + rng.normal(0, 0.1, (len(centred), 2))
        answers.append(resight.solve(centred, pixels, camera, sigma_px=0.1, view=f"v{i}"))
        rows += [(f"{i}", f"{k}", *centred[k], *pixels[k], 0.1) for k in range(len(centred))]
    by_place = resight.hand_eye(grippers, poses=answers)
    by_name = resight.hand_eye({f"v{i}": g for i, g in enumerate(grippers)}, poses=answers)
    table = dict(zip(("view", "id", "x_m", "y_m", "z_m", "u_px", "v_px", "sigma_px"), map(list, zip(*rows))))
    of_points = resight.hand_eye(grippers, cameras={"left": camera}, detections=table)
    for answer in (by_place, by_name, of_points):
        assert answer.status == "ok", answer.message
        assert np.allclose(np.linalg.inv(answer.cam_from_gripper.matrix)[:3, 3], truth.translation_m, atol=5e-3)
    import pickle
    assert resight.hand_eye(grippers, poses=pickle.loads(pickle.dumps(answers))).status == "ok"


@pytest.mark.parametrize(("motions", "given", "words"), [
    (np.eye(4)[None], dict(poses=np.eye(4)[None]), "poses_covariance"),
    (np.eye(4)[None].repeat(2, 0), dict(poses=np.eye(4)[None], poses_covariance=np.eye(6)[None]), "2 motions and 1 poses"),
    ([np.diag([2.0, 1, 1, 1])], dict(poses=np.eye(4)[None], poses_covariance=np.eye(6)[None]), "no rigid transform"),
    ([np.eye(3)], dict(poses=np.eye(4)[None], poses_covariance=np.eye(6)[None]), "(4, 4) is needed"),
    ({"view": ["a"], "qw": [1.0]}, dict(poses={"a": np.eye(4)}, poses_covariance=np.eye(6)[None]), "no key `qw`"),
    ("motions.csv", dict(poses=[np.eye(4)], poses_covariance=np.eye(6)[None]), "names of views"),
    (np.eye(4)[None], {}, "one of poses"),
])
def test_wrong_motions_are_named(motions, given, words):
    with pytest.raises(resight.Error) as caught:
        resight.hand_eye(motions, **given)
    assert words in str(caught.value)
