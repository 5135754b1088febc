"""The example for LeRobot: datasets of both formats, drawn here, in which one of two cameras rotates by 1° from the fourth episode on."""

import importlib.util
import json
import re
import shlex
import shutil
import subprocess
import sys

import cv2
import numpy as np
import pyarrow
import pyarrow.parquet
import pytest

import resight
from conftest import ROOT

SPEC = importlib.util.spec_from_file_location("lerobot_cameras", ROOT / "crates/python/examples/lerobot_cameras.py")
lerobot_cameras = importlib.util.module_from_spec(SPEC)
sys.modules[SPEC.name] = lerobot_cameras
SPEC.loader.exec_module(lerobot_cameras)

FRONT, SIDE, WRIST = (f"observation.images.{name}" for name in ("front", "side", "wrist"))
WIDTH, HEIGHT, FOCAL_PX, FPS = 320, 240, 300.0, 5
N_EPISODES, LENGTH, FIRST_MOVED, SIZE_M = 5, 20, 3, 0.2
LENS = np.array([[FOCAL_PX, 0, WIDTH / 2 - 0.5], [0, FOCAL_PX, HEIGHT / 2 - 0.5], [0, 0, 1]])


def pan(degrees):
    """new_from_old of a camera that rotates to the right."""
    return cv2.Rodrigues(np.array([0, -np.radians(degrees), 0]))[0]


FRONT_TILT, SIDE_TILT = (0.5, 0.3, 0.1), (-0.4, 0.4, 0.0)


def tag_image(degrees, tilt, shift_m=0.0):
    """A tag of tag36h11 on a grey wall, shifted along its own x axis, drawn at three times the size."""
    cell = 40
    marker = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11), 7, 8 * cell)
    sheet = cv2.copyMakeBorder(marker, *[cell] * 4, cv2.BORDER_CONSTANT, value=255)
    pixel_m, large = SIZE_M / (8 * cell), np.full((3 * HEIGHT, 3 * WIDTH), 150, np.uint8)
    metres = np.array([[pixel_m, 0, (0.5 - 5 * cell) * pixel_m], [0, pixel_m, (0.5 - 5 * cell) * pixel_m], [0, 0, 1]])
    rotation = cv2.Rodrigues(np.array(tilt))[0]
    cam_from_tag = np.column_stack([rotation[:, :2], [0.03, 0.02, 0.7] + shift_m * rotation[:, 0]])
    onto = np.array([[3, 0, 1], [0, 3, 1], [0, 0, 1]]) @ LENS @ pan(degrees) @ cam_from_tag @ metres
    cv2.warpPerspective(sheet, onto, large.shape[::-1], dst=large, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_TRANSPARENT)
    return cv2.GaussianBlur(cv2.resize(large, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA), (0, 0), 0.7)


def scene_image(degrees):
    """A photograph of a room as the camera sees it after a rotation about its centre."""
    room = cv2.resize(cv2.imread(str(ROOT / "examples/photo/left01.jpg"), cv2.IMREAD_GRAYSCALE), (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return cv2.warpPerspective(room, LENS @ pan(degrees) @ np.linalg.inv(LENS), (WIDTH, HEIGHT), borderMode=cv2.BORDER_REFLECT)


def drawn(kind):
    """Each camera to the images of each episode, with noise of their own."""
    rng = np.random.default_rng(4)
    of = {FRONT: {0: scene_image(0), 1: scene_image(1)}, SIDE: {0: scene_image(0)}}
    if kind == "tag":
        of = {FRONT: {0: tag_image(0, FRONT_TILT), 1: tag_image(1, FRONT_TILT)}, SIDE: {0: tag_image(0, SIDE_TILT)}}

    def episode(key, i):
        return noisy(of[key][int(key == FRONT and FIRST_MOVED <= i)], rng)

    return {key: [episode(key, i) for i in range(N_EPISODES)] for key in of}


def noisy(still, rng):
    """The frames of an episode."""
    return [np.clip(still + rng.normal(0, 1.5, still.shape), 0, 255).astype(np.uint8) for _ in range(LENGTH)]


@pytest.fixture(scope="module")
def images():
    return {kind: drawn(kind) for kind in ("tag", "scene")}


def write_video(path, frames):
    path.parent.mkdir(parents=True, exist_ok=True)
    command = ["ffmpeg", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "gray", "-s", f"{WIDTH}x{HEIGHT}", "-r", str(FPS), "-i", "-",
               "-c:v", "libx264", "-crf", "15", "-g", "2", "-pix_fmt", "yuv420p", str(path)]
    subprocess.run(command, input=b"".join(frame.tobytes() for frame in frames), check=True)


def write_table(path, images, episodes):
    """Rows of the frames of some episodes, with their images where these are no videos."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [(episode, frame) for episode in episodes for frame in range(LENGTH)]
    table = {"episode_index": [episode for episode, _ in rows], "frame_index": [frame for _, frame in rows]}
    for key, of in images.items():
        table[key] = [{"bytes": cv2.imencode(".png", of[episode][frame])[1].tobytes(), "path": None} for episode, frame in rows]
    pyarrow.parquet.write_table(pyarrow.table(table), path)


def write_dataset(root, images, version, dtype):
    """What `LeRobotDataset` of this version writes, as far as it concerns cameras; v3.0 joins episodes 0 to 1 and 2 to 4 in a file."""
    feature = {"dtype": dtype, "shape": [HEIGHT, WIDTH, 3], "names": ["height", "width", "channels"]}
    info = {"codebase_version": version, "fps": FPS, "total_episodes": N_EPISODES, "chunks_size": 1000,
            "features": {"action": {"dtype": "float32", "shape": [6], "names": None}, **dict.fromkeys(images, feature)}}
    stored = images if dtype == "image" else {}
    if version == "v2.1":
        info["data_path"] = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
        info["video_path"] = "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4"
        for i in range(N_EPISODES):
            write_table(root / f"data/chunk-000/episode_{i:06}.parquet", stored, [i])
            for key in images if dtype == "video" else ():
                write_video(root / f"videos/chunk-000/{key}/episode_{i:06}.mp4", images[key][i])
        (root / "meta").mkdir()
        lines = [json.dumps({"episode_index": i, "tasks": ["pick"], "length": LENGTH}) + "\n" for i in range(N_EPISODES)]
        (root / "meta/episodes.jsonl").write_text("".join(lines))
    else:
        info["data_path"] = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
        info["video_path"] = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
        rows = []
        for file, episodes in enumerate(([0, 1], [2, 3, 4])):
            write_table(root / f"data/chunk-000/file-{file:03}.parquet", stored, episodes)
            rows += [{"episode_index": i, "length": LENGTH, "data/chunk_index": 0, "data/file_index": file, "stats/action/min": [0.0]} for i in episodes]
            for key in images if dtype == "video" else ():
                write_video(root / f"videos/{key}/chunk-000/file-{file:03}.mp4", [frame for i in episodes for frame in images[key][i]])
                for place, row in enumerate(rows[-len(episodes):]):
                    begin_s = place * LENGTH / FPS
                    row |= {f"videos/{key}/chunk_index": 0, f"videos/{key}/file_index": file,
                            f"videos/{key}/from_timestamp": begin_s, f"videos/{key}/to_timestamp": begin_s + LENGTH / FPS}
        (root / "meta/episodes/chunk-000").mkdir(parents=True)
        pyarrow.parquet.write_table(pyarrow.Table.from_pylist(rows), root / "meta/episodes/chunk-000/file-000.parquet")
    (root / "meta/info.json").write_text(json.dumps(info))
    return root


@pytest.fixture(scope="module")
def tools(tmp_path_factory):
    """Files of the intrinsics and of the tag."""
    folder = tmp_path_factory.mktemp("tools")
    lens = resight.Camera("pinhole", width_px=WIDTH, height_px=HEIGHT, fx_px=FOCAL_PX, fy_px=FOCAL_PX, cx_px=LENS[0, 2], cy_px=LENS[1, 2])
    (folder / "lens.toml").write_text(lens.to_toml())
    (folder / "tag.toml").write_text(resight.Target("tag", family="tag36h11", id=7, size_m=SIZE_M).to_toml())
    return folder


@pytest.fixture(scope="module")
def stored(tmp_path_factory, images, tools):
    """A dataset of v3.0 with images in its tables, and the references of its first episodes."""
    root = write_dataset(tmp_path_factory.mktemp("stored"), images["tag"], "v3.0", "image")
    assert lerobot_cameras.main(pinning(root, root / "pins", tools)) == 0
    return root


def pinning(root, folder, tools, *, names=("front", "side"), target=True):
    cameras = [word for name in names for word in ("--camera", f"{name}={tools / 'lens.toml'}")]
    return [str(root), "--pin", str(folder), *cameras, *(["--target", str(tools / "tag.toml")] if target else []), "--frames", "20"]


def run(capsys, *arguments):
    """Exit status, lines and errors of the example."""
    capsys.readouterr()
    status = lerobot_cameras.main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    return status, out.splitlines(), err


def found(capsys, root, folder):
    status, lines, _ = run(capsys, root, "--reference", folder, "--frames", "10", "--json")
    return status, {(item["episode"], item.get("camera")): item for item in map(json.loads, lines)}


@pytest.mark.parametrize(("kind", "dtype", "version"), [("tag", "image", "v2.1"), ("tag", "image", "v3.0"), ("tag", "video", "v2.1"), ("tag", "video", "v3.0"),
                                                       ("scene", "image", "v2.1"), ("scene", "video", "v3.0")])
def test_the_camera_that_rotated_is_named_from_its_episode_on(kind, dtype, version, images, tools, tmp_path, capsys):
    if dtype == "video" and shutil.which("ffmpeg") is None:
        pytest.skip("no ffmpeg")
    root = write_dataset(tmp_path / "dataset", images[kind], version, dtype)
    pins = tmp_path / "pins"
    assert lerobot_cameras.main(pinning(root, pins, tools, target=kind == "tag")) == 0
    status, findings = found(capsys, root, pins)
    assert status == 1 and len(findings) == 2 * N_EPISODES
    for (episode, key), finding in findings.items():
        is_moved = key == FRONT and FIRST_MOVED <= episode
        assert finding["verdict"] == ("moved" if is_moved else "ok"), finding
        if is_moved:
            assert "rotated right 1.0" in finding["message"] or "rotated right 0.9" in finding["message"], finding
            assert "±" in finding["message"] and "to put it back: left " in finding["message"], finding
            assert abs(np.degrees(finding["event"]["axis"]["rotation_rad"]) - 1) < 0.05, finding


def test_what_is_printed(stored, capsys):
    status, lines, err = run(capsys, stored, "--reference", stored / "pins", "--episodes", "2-3", "--frames", "10")
    assert status == 1 and err == "" and len(lines) == 6
    assert lines[0].split()[:4] == ["episode", "2", "front", "ok"] and "from the reference" in lines[0]
    assert lines[2].split()[:4] == ["episode", "3", "front", "moved"]
    assert lines[4] == "front: ok in 1 of 2 episodes, moved in 1, first in episode 3" and lines[5] == "side: ok in 2 of 2 episodes"
    status, lines, _ = run(capsys, stored, "--reference", stored / "pins", "--episodes", "0-1", "--frames", "10")
    assert status == 0 and all(" ok " in line for line in lines[:4])


def block(language, n=0):
    """The n-th block of a language on the page."""
    page = (ROOT / "docs/lerobot.md").read_text()
    return re.findall(rf"```{language}\n(.*?)```", page, flags=re.DOTALL)[n]


def test_the_page_shows_what_its_commands_print(stored, tools, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "so101_pick").symlink_to(stored)
    for name, file in (("front.yml", "lens.toml"), ("side.yml", "lens.toml"), ("tag.toml", "tag.toml")):
        shutil.copy(tools / file, name)
    pinned, checked = (shlex.split(line)[2:] for line in block("bash").splitlines())
    assert run(capsys, *pinned) == (0, ["pinned front, side in pins"], "")
    status, lines, _ = run(capsys, *checked)
    shown, words = block("text").splitlines(), [re.sub(r"[\d.]+", "#", line) for line in lines]
    assert status == 1 and all(re.sub(r"[\d.]+", "#", line) in words for line in shown), lines


def test_the_way_back_takes_three_lines(stored, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(stored)
    dataset, program = lerobot_cameras.open_dataset(stored), block("py")
    assert len(program.splitlines()) == 3
    for episode, words in ((1, "steady"), (4, "to put it back: left")):
        dataset.write_frames(dataset.episodes[episode], FRONT, 10, tmp_path / str(episode))
        exec(compile(program, "docs/lerobot.md", "exec"), {"resight": resight, "images": sorted((tmp_path / str(episode)).iterdir())})  # noqa: S102, our own page.
        assert words in capsys.readouterr().out


def test_the_references_are_a_session_of_watch(stored, tmp_path):
    dataset, sources = lerobot_cameras.open_dataset(stored), []
    for name in ("front", "side"):
        dataset.write_frames(dataset.episodes[4], dataset.key(name), 10, tmp_path / name)
        sources += ["--source", f"{name}={tmp_path / name}/*.png"]
    command = [sys.executable, "-m", "resight", "watch", lerobot_cameras.SESSION, *sources, "--period-s", "0.4", "--once"]
    ended = subprocess.run(command, cwd=stored / "pins", capture_output=True, text=True, check=False)
    assert ended.returncode == 3 and "to put it back: left" in ended.stdout and "side: steady" in ended.stdout, ended


def test_a_camera_that_sees_no_target_is_not_seen(stored, images, tmp_path, capsys):
    wall = noisy(np.full((HEIGHT, WIDTH), 150, np.uint8), np.random.default_rng(6))
    hidden = {FRONT: [wall] * N_EPISODES, SIDE: images["tag"][SIDE]}
    root = write_dataset(tmp_path / "hidden", hidden, "v2.1", "image")
    status, lines, _ = run(capsys, root, "--reference", stored / "pins", "--episodes", "0", "--frames", "10")
    assert status == 1 and "not seen" in lines[0] and "no tag target" in lines[0] and " ok " in lines[1], lines


def test_a_target_that_moved_is_named_in_place_of_the_cameras(stored, tmp_path, capsys):
    rng = np.random.default_rng(8)
    moved = {key: [noisy(tag_image(0, tilt, shift_m=0.02), rng)] * N_EPISODES for key, tilt in ((FRONT, FRONT_TILT), (SIDE, SIDE_TILT))}
    root = write_dataset(tmp_path / "moved", moved, "v2.1", "image")
    status, lines, _ = run(capsys, root, "--reference", stored / "pins", "--episodes", "0", "--frames", "10")
    assert status == 1 and lines[0].split()[:5] == ["episode", "0", "target", "tag", "moved"] and " ok " in lines[1] and " ok " in lines[2], lines


def test_motions_that_several_causes_explain_are_undecided(stored, images, tmp_path, capsys):
    """Both cameras see what the front one saw: either of them and the tag, or both of them, have moved."""
    alike = dict.fromkeys((FRONT, SIDE), images["tag"][FRONT])
    root = write_dataset(tmp_path / "alike", alike, "v2.1", "image")
    status, lines, _ = run(capsys, root, "--reference", stored / "pins", "--episodes", "4", "--frames", "10")
    assert status == 1 and all("undecided" in line and "one of " in line and "target tag" in line for line in lines[:2]), lines


def test_a_camera_that_moves_is_not_pinned(images, tools, tmp_path, capsys):
    root = write_dataset(tmp_path / "dataset", images["tag"], "v2.1", "image")
    status, _, err = run(capsys, *pinning(root, tmp_path / "pins", tools), "--episodes", "2-3")
    assert status == 2 and "nothing is pinned" in err and "front" in err and not (tmp_path / "pins").exists()


def test_wrong_requests_say_what_to_do(stored, tools, tmp_path, capsys):
    pin = pinning(stored, tmp_path / "pins", tools)
    other = tmp_path / "other.toml"
    other.write_text(resight.Camera("pinhole", width_px=640, height_px=480, fx_px=600, fy_px=600, cx_px=319.5, cy_px=239.5).to_toml())
    for arguments, words in [
        ([stored], "--pin DIR and --reference DIR"),
        ([stored, "--pin", tmp_path / "pins"], "--camera NAME=FILE"),
        (pinning(stored, tmp_path / "pins", tools, names=["top"]), "no camera is called top; its cameras: front, side"),
        ([*pin, "--camera", "side"], "NAME=VALUE"),
        ([*pin, "--camera", f"side={other}"], "calibrate it at the size"),
        ([*pin, "--episodes", "0"], "40 are needed"),
        ([*pin, "--episodes", "0-9"], "no episode 5, 6, 7, 8, 9; it has 5"),
        ([*pin, "--episodes", "first"], "0-4,7"),
        ([*pin, "--frames", "2"], "5 or more"),
        (pinning(stored, stored / "pins", tools), "remove the folder"),
        ([stored, "--reference", tmp_path], "is missing: --pin writes it"),
        ([stored, "--reference", stored / "pins", "--episodes", "7"], "no episode 7"),
        ([tmp_path, "--reference", stored / "pins"], "meta/info.json is missing"),
    ]:
        status, lines, err = run(capsys, *arguments)
        assert status == 2 and words in err and not lines, (words, err)


def test_damaged_datasets_say_which_file(stored, images, tmp_path, capsys):
    def copy(name):
        return shutil.copytree(stored, tmp_path / name, ignore=shutil.ignore_patterns("pins", "now"))

    def refused(root, words):
        status, _, err = run(capsys, root, "--reference", stored / "pins", "--frames", "10")
        assert status == 2 and words in err, err

    info = json.loads((stored / "meta/info.json").read_text())
    root = copy("older")
    (root / "meta/info.json").write_text(json.dumps(info | {"codebase_version": "v1.6"}))
    refused(root, "v1.6; v2.x and v3.0 are read")
    root = copy("broken")
    (root / "meta/info.json").write_text("{")
    refused(root, "no JSON")
    root = copy("blind")
    (root / "meta/info.json").write_text(json.dumps(info | {"features": {"action": info["features"]["action"]}}))
    refused(root, "no camera is called front; its cameras: none")
    root = copy("without_videos")
    (root / "meta/info.json").write_text(json.dumps(info | {"features": {key: of | {"dtype": "video"} for key, of in info["features"].items()}}))
    refused(root, f"does not state in which file episode 0 of {FRONT} is")
    root = copy("no_rate")
    (root / "meta/info.json").write_text(json.dumps({key: value for key, value in info.items() if key != "fps"}))
    refused(root, "meta/ states no fps")
    root = copy("cut")
    path = root / "data/chunk-000/file-000.parquet"
    path.write_bytes(path.read_bytes()[:1000])
    refused(root, f"{path}: no Parquet file")
    path.write_text("version https://git-lfs.github.com/spec/v1\n")
    refused(root, "git lfs pull")
    path.unlink()
    refused(root, f"{path} is missing")
    root = copy("no_episodes")
    shutil.rmtree(root / "meta/episodes")
    refused(root, "file-000.parquet is missing")


def test_videos_that_are_missing_or_no_videos(stored, images, tmp_path, capsys):
    if shutil.which("ffmpeg") is None:
        pytest.skip("no ffmpeg")
    root = write_dataset(tmp_path / "dataset", images["tag"], "v2.1", "video")
    path = root / f"videos/chunk-000/{FRONT}/episode_000001.mp4"
    path.write_bytes(b"no video")
    status, lines, err = run(capsys, root, "--reference", stored / "pins", "--frames", "10")
    assert status == 2 and f"{path}: episode 1 cannot be decoded" in err and len(lines) == 2
    path.unlink()
    status, _, err = run(capsys, root, "--reference", stored / "pins", "--episodes", "1")
    assert status == 2 and f"{path} is missing" in err


def test_cameras_without_a_reference_are_named(stored, images, tmp_path, capsys):
    root = write_dataset(tmp_path / "dataset", images["tag"] | {WRIST: images["scene"][SIDE]}, "v2.1", "image")
    status, lines, err = run(capsys, root, "--reference", stored / "pins", "--episodes", "0", "--frames", "10")
    assert status == 0 and len(lines) == 4 and err == "wrist: not checked, it has no reference\n"
