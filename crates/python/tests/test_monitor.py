"""The change detector on streams, sessions in a process of their own, and the jobs that write files."""

import copy
import json
import pickle
from pathlib import Path

import cv2
import numpy as np
import pytest

import resight
from conftest import ROOT, program

SIGMA_RAD, SIGMA_M = 1e-3, 2e-3


def stream(truth, n, rng, turn_rad=0.0):
    """Poses (n, 4, 4) that scatter as their covariance (n, 6, 6) says, about the truth after a rotation about the camera's y axis."""
    covariance = np.diag([SIGMA_RAD**2] * 3 + [SIGMA_M**2] * 3)
    moved = resight.Pose.from_vectors([0, turn_rad, 0], [0, 0, 0], b="cam", a="cam") @ truth
    poses = []
    for noise in rng.multivariate_normal(np.zeros(6), covariance, n):
        small = resight.Pose.from_vectors(noise[:3], noise[3:], b="cam", a="cam")
        poses.append((small @ moved).matrix)
    return np.array(poses), np.repeat(covariance[None], n, axis=0)


def test_a_rotation_is_found_and_quiet_is_steady(truth, tmp_path):
    rng = np.random.default_rng(7)
    poses, covariances = stream(truth, 200, rng)
    monitor = resight.Monitor.learn(np.arange(200.0), poses, covariances, camera="gate", target="door")
    promised = monitor.detectable()["rotation_rad"][1]
    assert 0 < promised < 10 * SIGMA_RAD
    quiet, covariances = stream(truth, 600, rng)
    states = [monitor.push(200.0 + i, pose, c)["state"] for i, (pose, c) in enumerate(zip(quiet, covariances))]
    assert "drifted" not in states and states[-1] == "steady"
    turned, covariances = stream(truth, 60, rng, turn_rad=2 * promised)
    events = [monitor.push(800.0 + i, pose, c) for i, (pose, c) in enumerate(zip(turned, covariances))]
    found = [event for event in events if event["state"] == "drifted"]
    assert found and (found[-1]["camera"], found[-1]["target"]) == ("gate", "door")
    assert monitor.state(2000.0)["state"] == "stale"
    monitor.save(tmp_path / "gate.ref.toml")
    again = resight.Monitor.read(tmp_path / "gate.ref.toml", t_s=0.0)
    assert np.allclose(again.reference.matrix, monitor.reference.matrix, atol=1e-14)
    monitor.accept()
    assert abs(np.linalg.norm((monitor.reference @ truth.inverse()).rotation_vector) - 2 * promised) < 0.2 * promised


def test_answers_are_pushed_as_they_are(truth, camera, points_m, pixels):
    rng = np.random.default_rng(3)
    answers = [resight.solve(points_m, pixels + rng.normal(0, 0.3, pixels.shape), camera, sigma_px=0.3) for _ in range(60)]
    poses = np.array([a.cam_from_target.matrix for a in answers[:50]])
    covariances = np.array([a.covariance for a in answers[:50]])
    monitor = resight.Monitor.learn(np.arange(50.0), poses, covariances)
    assert {monitor.push(50.0 + i, a)["state"] for i, a in enumerate(answers[50:])} <= {"steady", "checking"}
    lost = resight.solve(points_m[:2], pixels[:2], camera)
    assert lost.cam_from_target is None and monitor.push(500.0, lost)["state"] == "stale"


def test_what_a_monitor_refuses(truth, tmp_path):
    rng = np.random.default_rng(5)
    poses, covariances = stream(truth, 60, rng)
    times = np.arange(60.0)
    still, turned = stream(truth, 30, rng)[0], stream(truth, 30, rng, turn_rad=30 * SIGMA_RAD)[0]
    for arguments, kind, words in [
        ((times, np.concatenate([still, turned]), covariances), "moved_while_learning", "moved"),
        ((times[:10], poses[:10], covariances[:10]), "too_few_points", "20"),
        ((times[::-1], poses, covariances), "input", "never fall"),
        ((times, poses[:, :3], covariances), "input", "(60, 4, 4)"),
        ((times, 2 * poses, covariances), "input", "rigid"),
        ((times, poses, -covariances), "input", "covariance"),
    ]:
        with pytest.raises(resight.Error, match=None) as refused:
            resight.Monitor.learn(*arguments)
        assert refused.value.kind == kind and words in str(refused.value), str(refused.value)
    monitor = resight.Monitor.learn(times, poses, covariances)
    for arguments, words in [((70.0, truth), "covariance"), ((1.0, truth, covariances[0]), "never fall"), ((np.nan, truth, covariances[0]), "never fall")]:
        with pytest.raises(resight.Error) as refused:
            monitor.push(*arguments)
        assert words in str(refused.value)
    with pytest.raises(resight.Error) as refused:
        resight.Monitor.learn(times, poses, covariances, false_alarms_per_day=0.0)
    assert refused.value.kind == "invalid_setting"
    with pytest.raises(resight.Error) as refused:
        resight.Monitor.read("testdata/python/points.csv", t_s=0.0)
    assert refused.value.kind == "file"


def test_a_session_says_what_the_program_says(tmp_path):
    folder = tmp_path / "frames"
    folder.mkdir()
    still, rng = cv2.imread("testdata/demo/left.png", cv2.IMREAD_GRAYSCALE), np.random.default_rng(2)
    for i in range(40):
        noisy = np.clip(still + rng.normal(0, 2, still.shape), 0, 255).astype(np.uint8)
        cv2.imwrite(str(folder / f"{i:03}.png"), noisy)
    file = tmp_path / "session.toml"
    keys = {"camera": ROOT / "testdata/demo/left.toml", "target": ROOT / "testdata/demo/grid.toml", "source": f"{folder}/*.png"}
    file.write_text("".join(f'{key} = "{value}"\n' for key, value in keys.items()) + "period_s = 1\nlearn = 20\n")
    with resight.watch(file, once=True) as session:
        events = [json.loads(event.to_json()) for event in session]
    assert session.moved is False and events[-1]["state"] == "steady"
    assert events == [json.loads(line) for line in program("watch", file, "--once")]
    with pytest.raises(resight.Error, match="no-such"):
        list(resight.watch("no-such.toml"))
    with resight.watch(file, once=True) as session:
        next(iter(session))  # Left in the middle: nothing hangs.


def test_files_are_written_as_by_the_program(tmp_path):
    answer = resight.convert(["examples/photo/left.yml", "examples/photo/right.yml"], "opencv", tmp_path / "stereo/")
    assert answer.status == "ok" and answer["checked"] and all(Path(file).exists() for file in answer["files"])
    with pytest.raises(resight.Error, match="there is no format"):
        resight.convert("examples/photo/left.yml", "kalibrr", tmp_path / "x.yaml")
    printed = resight.print_target({"kind": "tag", "family": "tag36h11", "id": 7, "size_m": 0.1}, tmp_path / "tag.pdf")
    assert Path(tmp_path / "tag.pdf").read_bytes().startswith(b"%PDF") and printed["n_pages"] == 1
    assert resight.read_target(tmp_path / "tag.toml").kind == "tag"
    with pytest.raises(resight.Error, match="ending"):
        resight.print_target(tmp_path / "tag.toml", tmp_path / "tag.png")
    seen = resight.landmarks("examples/photo/left01.jpg", ["examples/photo/left01.jpg"], "examples/photo/left.yml")
    assert [a.to_json() for a in seen] == program("landmarks", "examples/photo/left01.jpg", "examples/photo/left01.jpg", "--camera", "examples/photo/left.yml")


def test_marked_lines_and_points_without_a_camera():
    lines = resight.solve_lines("examples/marked_lines/road.csv", image_size_px=(1280, 720))
    assert [a.to_json() for a in lines] == program("solve", "examples/marked_lines/road.csv", "--estimate-focal", "--image-size-px", "1280x720")
    with pytest.raises(resight.Error, match="image_size_px"):
        resight.solve_lines("examples/marked_lines/road.csv")
    points = resight.solve_table("testdata/python/points.csv", None, image_size_px=(1280, 960))
    assert [a.to_json() for a in points] == program("solve", "testdata/python/points.csv", "--estimate-focal", "--image-size-px", "1280x960")


def test_whisker(tmp_path):
    folder = "testdata/whisker"
    whisker, hub, truth, contacts = f"{folder}/whisker.json", tmp_path / "hub.csv", tmp_path / "truth.csv", tmp_path / "contacts.csv"
    resight.whisker.simulate(whisker, f"{folder}/square.json", f"{folder}/path.json", hub, truth=truth, noise_seed=7)
    answers = resight.whisker.solve(hub, whisker, output=contacts)
    assert [a.to_json() for a in answers] == program("whisker", "solve", "--whisker", whisker, hub)
    found = resight.whisker.identify(contacts)
    assert found.to_json() == program("whisker", "identify", contacts)[0]
    assert resight.whisker.check(contacts, truth).to_json() == program("whisker", "check", contacts, truth)[0]
    calibrated = resight.whisker.calibrate(hub, whisker, tmp_path / "calibrated.json")
    assert calibrated.to_json() == program("whisker", "calibrate", "--whisker", whisker, hub)[0]
    with pytest.raises(resight.Error):
        resight.whisker.solve(hub, "examples/photo/board.toml")


def test_poses_cameras_and_targets_are_pickled(truth, camera):
    board = resight.read_target("examples/photo/board.toml")
    lens = resight.read_camera("examples/photo/left.yml")
    for value in (truth, camera, board, lens):
        again = pickle.loads(pickle.dumps(value))
        assert repr(again) == repr(value) and repr(copy.deepcopy(value)) == repr(value)
    assert np.array_equal(pickle.loads(pickle.dumps(truth)).matrix, truth.matrix)
    assert pickle.loads(pickle.dumps(lens)).to_toml() == lens.to_toml()
    answer = resight.explain("examples/photo/left.yml")
    assert pickle.loads(pickle.dumps(answer)) == answer
    with pytest.raises(resight.Error, match="not pickled"):
        pickle.dumps(resight.Camera.nominal(image_size_px=(640, 480), hfov_deg=60))


def test_progress_is_heard_and_ends_a_job():
    cameras = {"left": "examples/photo/left.yml", "right": "examples/photo/right.yml"}
    images = {"left": "examples/photo/left*.jpg", "right": "examples/photo/right*.jpg"}
    heard = []
    resight.rig_from_images(cameras, "examples/photo/board.toml", images, progress=lambda done, total: heard.append((done, total)))
    total = heard[-1][1]
    assert heard == [(i + 1, total) for i in range(total)] and 2 < total

    def enough(done, _total):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        resight.intrinsics("examples/photo/board.toml", "examples/photo/left0*.jpg", progress=enough)
    resight.locate_images(["examples/photo/left01.jpg"], resight.read_camera(cameras["left"]),
                          resight.read_target("examples/photo/board.toml"), progress=False)
