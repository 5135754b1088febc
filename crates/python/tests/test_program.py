"""Same input, same answer: every job of the package gives the bytes that the program of the wheel prints with --json."""

import glob
import json
import subprocess
import sys
import tomllib

import numpy as np
import pandas
import pytest

import resight
from conftest import ROOT, program

LEFT = sorted(glob.glob("examples/photo/left0*.jpg", root_dir=ROOT))
BOARD = "examples/photo/board.toml"


def without(lines, *keys):
    """The objects without keys that say who asked."""
    return [{k: v for k, v in json.loads(line).items() if k not in keys} for line in lines]


def test_locate():
    camera, target = resight.read_camera("examples/photo/left.yml"), resight.read_target(BOARD)
    answers = resight.locate_images(LEFT, camera, target)
    assert [a.to_json() for a in answers] == program("locate", *LEFT, "--camera", "examples/photo/left.yml", "--target", BOARD)
    one = resight.locate_image(LEFT[0], camera, target)
    assert one.to_json() == answers[0].to_json() and one.status == "ok"


def test_locate_without_a_camera_file():
    camera = resight.Camera.nominal(image_size_px=(640, 480), hfov_deg=60)
    answers = resight.locate_images(LEFT[:3], camera, resight.read_target(BOARD))
    assert [a.to_json() for a in answers] == program("locate", *LEFT[:3], "--hfov-deg", 60, "--target", BOARD)
    answers = resight.locate_images(LEFT[:3], None, resight.read_target(BOARD))
    assert [a.to_json() for a in answers] == program("locate", *LEFT[:3], "--estimate-focal", "--target", BOARD)


def test_detect():
    found = [resight.detect(image, BOARD).to_json() for image in LEFT[:3]]
    assert found == program("detect", *LEFT[:3], "--target", BOARD)


def test_every_tag():
    found = resight.detect("testdata/demo/left.png", family="any", view="testdata/demo/left.png").to_json()
    assert [found] == program("detect", "testdata/demo/left.png", "--family", "any")


def test_solve():
    camera = resight.read_camera("examples/marks/camera.toml")
    table = "testdata/python/points.csv"
    answers = resight.solve_table(table, camera, sigma_px=0.3)
    lines = program("solve", table, "--camera", "examples/marks/camera.toml", "--sigma-px", 0.3)
    assert [a.to_json() for a in answers] == lines and len(lines) == 2


def poses_of(rig):
    """cam_from_rig by name, as the program explains the file."""
    table = tomllib.loads((ROOT / rig).read_text())
    poses = {}
    for camera in table["camera"]:
        given = camera["placement"]
        w, x, y, z = given["rotation_wxyz"]
        turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                         [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                         [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = turn, given["translation_m"]
        poses[camera["name"]] = resight.Pose.from_matrix(matrix, b=camera["name"], a="rig")
    return poses


def rig_arguments():
    cameras = ["--camera", "left=examples/photo/left.yml", "right=examples/photo/right.yml"]
    images = ["--images", "left=examples/photo/left*.jpg", "right=examples/photo/right*.jpg"]
    return [*cameras, "--target", BOARD, *images]


def test_rig(tmp_path):
    cameras = {"left": "examples/photo/left.yml", "right": "examples/photo/right.yml"}
    images = {"left": "examples/photo/left*.jpg", "right": "examples/photo/right*.jpg"}
    answer = resight.rig_from_images(cameras, BOARD, images)
    assert without([answer.to_json()], "command") == without(program("rig", *rig_arguments()), "command")
    answer.save(tmp_path / "python.toml")
    program("rig", *rig_arguments(), "-o", tmp_path / "program.toml")
    written = (tmp_path / "program.toml").read_text().splitlines()
    assert (tmp_path / "python.toml").read_text().splitlines()[1:] == written[1:]
    assert resight.compare(tmp_path / "python.toml", tmp_path / "program.toml")[0].verdict == "unmoved"


def test_rig_of_detections():
    files = "testdata/rig/cameras.toml", "testdata/rig/detections.csv"
    for joint in (False, True):
        answer = resight.rig_from_detections(*files, joint_covariance=joint)
        lines = program("rig", "--camera", files[0], "--detections", files[1], *(["--joint-covariance"] if joint else []))
        assert without([answer.to_json()], "command") == without(lines, "command")


def test_pose_graph(tmp_path):
    """Three cameras, each pair stated: the loop does not close quite, so that something is adjusted."""
    rows = ["a,b,qw,qx,qy,qz,x_m,y_m,z_m,sigma_deg,sigma_mm"]
    rows += [f"{pair},1,0,0,0,{place},0.05,2" for pair, place in (("one,two", "-0.1,0,0"), ("two,three", "-0.1,0,0.001"), ("one,three", "-0.201,0,0"))]
    (tmp_path / "pairs.csv").write_text("\n".join(rows) + "\n")
    for chain in (False, True):
        answer = resight.pose_graph(tmp_path / "pairs.csv", reference="two", chain=chain)
        answer.save(tmp_path / "python.toml")
        flags = ["--chain"] if chain else []
        lines = program("pose-graph", tmp_path / "pairs.csv", "--reference", "two", "-o", tmp_path / "program.toml", *flags)
        assert [answer.to_json()] == lines and answer.status == "ok"
        assert (tmp_path / "python.toml").read_bytes() == (tmp_path / "program.toml").read_bytes()
    with pytest.raises(resight.Error, match="needed together"):
        resight.pose_graph(tmp_path / "pairs.csv", pair_sigma_m=0.001)


def test_intrinsics(tmp_path):
    answer = resight.intrinsics(BOARD, "examples/photo/left0*.jpg")
    lines = program("intrinsics", *LEFT, "--target", BOARD, "-o", tmp_path / "left.toml")
    assert [answer.to_json()] == lines
    answer.save(tmp_path / "python.toml")
    assert (tmp_path / "python.toml").read_bytes() == (tmp_path / "left.toml").read_bytes()
    check = resight.check_intrinsics("examples/photo/left.yml", BOARD, "examples/photo/left0*.jpg")
    assert [check.to_json()] == program("intrinsics", *LEFT, "--target", BOARD, "--check", "examples/photo/left.yml")


def test_hand_eye(tmp_path):
    files = "examples/robot/motions.csv", "examples/robot/camera.toml", "examples/robot/corners.csv"
    answer = resight.hand_eye(files[0], cameras={"cam": files[1]}, detections=files[2])
    lines = program("hand-eye", "--motions", files[0], "--camera", f"cam={files[1]}", "--detections", files[2])
    assert without([answer.to_json()], "command") == without(lines, "command") and answer.status == "ok"
    answer.save(tmp_path / "mounting.json")
    with pytest.raises(resight.Error, match="one of poses"):
        resight.hand_eye(files[0])


def test_rig_pose(tmp_path):
    """Points of the world that both cameras of a rig see, drawn from a pose of the rig."""
    rig = "examples/photo/rig_before.toml"
    cameras = resight.Camera.read_all(rig)
    poses = poses_of(rig)
    world = np.random.default_rng(2).uniform([-0.3, -0.2, 1.0], [0.3, 0.2, 1.6], (12, 3))
    rows = ["camera,id,x_m,y_m,z_m,u_px,v_px"]
    for name, camera in cameras.items():
        seen = camera.project(poses[name] @ world)
        rows += [f"{name},{i},{x},{y},{z},{u:.3f},{v:.3f}" for i, ((x, y, z), (u, v)) in enumerate(zip(world, seen))]
    (tmp_path / "points.csv").write_text("\n".join(rows) + "\n")
    answers = resight.rig_pose(tmp_path / "points.csv", rig, sigma_px=0.3)
    assert [a.to_json() for a in answers] == program("rig-pose", tmp_path / "points.csv", "--rig", rig, "--sigma-px", 0.3)
    assert answers[0].status == "ok"


def test_advise():
    camera, points = "examples/marks/camera.toml", "examples/marks/marks.csv"
    region = ["--region-m", "-5,8,5,25"]
    answers = resight.advise_points(camera, points, region_m=(-5, 8, 5, 25))
    assert [a.to_json() for a in answers] == program("advise", "--camera", camera, "--points", points, *region)
    answers = resight.advise_target("examples/photo/left.yml", BOARD, (0.5, 2), tilt_deg=(10, 60))
    lines = program("advise", "--camera", "examples/photo/left.yml", "--target", BOARD, "--distance-m", "0.5..2", "--tilt-deg", "10..60")
    assert [a.to_json() for a in answers] == lines
    rig = "examples/photo/rig_before.toml"
    answers = resight.advise_boards(rig, BOARD, (0.5, 2))
    assert [a.to_json() for a in answers] == program("advise", "--camera", rig, "--target", BOARD, "--distance-m", "0.5..2")
    with pytest.raises(resight.Error, match="distance_m"):
        resight.advise_boards(rig, BOARD, (2, 0.5))


def test_hand_eye_of_poses(tmp_path):
    """Poses of the views of the example, solved here, as the program reads them."""
    motions, camera, corners = "examples/robot/motions.csv", "examples/robot/camera.toml", "examples/robot/corners.csv"
    views = resight.solve_table(corners, resight.read_camera(camera))
    (tmp_path / "poses.jsonl").write_text("".join(view.to_json() + "\n" for view in views))
    answer = resight.hand_eye(motions, poses=tmp_path / "poses.jsonl")
    lines = program("hand-eye", "--motions", motions, "--poses", tmp_path / "poses.jsonl")
    assert without([answer.to_json()], "command") == without(lines, "command") and answer.status == "ok"


def test_intrinsics_of_detections():
    files, size = "examples/robot/corners.csv", (1280, 960)
    answer = resight.intrinsics((), detections=files, image_size_px=size)
    assert [answer.to_json()] == program("intrinsics", "--detections", files, "--image-size-px", "1280x960")


def test_history(tmp_path):
    """A session's memory: summary and exports are the program's."""
    kept = tmp_path / "gate.history"
    program("watch", "--camera", "gate=examples/gate/gate.toml", "--target", "examples/gate/tag.toml", "--source", "examples/gate/day.jsonl",
            "--once", "--history", kept)
    assert [resight.history(kept).to_json()] == program("history", kept)
    for name, events in (("frames.csv", False), ("events.csv", True)):
        resight.export_history(kept, tmp_path / f"python_{name}", events=events)
        program("history", kept, "--export", tmp_path / name, *(["--events"] if events else []))
        assert (tmp_path / f"python_{name}").read_bytes() == (tmp_path / name).read_bytes() != b""
    resight.export_history(kept, tmp_path / "frames.parquet")
    assert len(pandas.read_parquet(tmp_path / "frames.parquet")) == len((tmp_path / "frames.csv").read_text().splitlines()) - 1


def test_convert_and_print(tmp_path):
    """The answers name the files, so both write to the same place in turn."""
    written = tmp_path / "camchain.yaml"
    answer = resight.convert("testdata/formats/own_rig.toml", "kalibr", written)
    first = written.read_bytes()
    assert [answer.to_json()] == program("convert", "testdata/formats/own_rig.toml", "--to", "kalibr", "-o", written)
    assert written.read_bytes() == first
    answer = resight.print_target("examples/photo/board.toml", tmp_path / "board.pdf", paper="A3")
    first = (tmp_path / "board.pdf").read_bytes()
    assert [answer.to_json()] == program("print", "--target", "examples/photo/board.toml", "--paper", "A3", "-o", tmp_path / "board.pdf")
    assert (tmp_path / "board.pdf").read_bytes() == first


def test_compare():
    files = "examples/photo/rig_before.toml", "examples/photo/rig_before.toml"
    assert [a.to_json() for a in resight.compare(*files)] == program("compare", *files)


@pytest.mark.parametrize("scene", sorted(glob.glob("testdata/measure/*.toml", root_dir=ROOT))[:6])
def test_measure(scene):
    try:
        lines = [a.to_json() for a in resight.measure(scene)]
    except resight.Error as reason:
        ended = subprocess.run([sys.executable, "-m", "resight", "measure", scene, "--json"], capture_output=True, text=True)
        assert ended.returncode == 2 and str(reason).splitlines()[0][:60] in ended.stderr
    else:
        assert lines == program("measure", scene)


@pytest.mark.parametrize("file", ["examples/photo/left.yml", BOARD, "testdata/formats/kalibr_camchain.yaml"])
def test_explain(file):
    assert [resight.explain(file).to_json()] == program("explain", file)


def test_the_program_takes_wrong_usage_as_the_binary_does():
    run = lambda *words: subprocess.run([sys.executable, "-m", "resight", *words], capture_output=True, text=True)  # noqa: E731
    assert run("locate").returncode == 2 and "Usage: resight locate" in run("locate").stderr
    assert run("--version").stdout.strip() == f"resight {resight.__version__}"
    assert run("solve", "missing.csv", "--hfov-deg", "60").returncode == 2
