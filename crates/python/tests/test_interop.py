"""Poses and answers in other libraries' hands."""

import sys
import types

import matplotlib
import numpy as np
import pandas
import polars
import pyarrow
import pytest
from scipy.spatial.transform import Rotation

import resight
from resight import interop, plot

matplotlib.use("Agg")


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
    turn = interop.to_scipy(truth)
    assert isinstance(turn, Rotation) and np.allclose(turn.as_rotvec(), truth.rotation_vector, atol=1e-12)
    assert np.allclose(interop.from_scipy(turn, truth.translation_m).matrix, truth.matrix, atol=1e-12)
    assert np.allclose(interop.from_pycolmap(interop.to_pycolmap(truth)).matrix, truth.matrix, atol=1e-12)


def test_tables_of_answers(camera, points_m, pixels):
    answers = [resight.solve(points_m, pixels, camera, view="a"), resight.solve(points_m[:2], pixels[:2], camera, view="b")]
    table = resight.table(answers)
    assert len(table) == 2 and table.column_names[:4] == ["view", "status", "message", "n_points"]
    poses = resight.table(resight.solve_many(points_m, np.repeat(pixels[None], 3, axis=0), camera))
    assert len(poses) == 3
    with pytest.raises(resight.Error):
        resight.table([1, 2])
    arrow = pyarrow.table(table)
    assert arrow["view"].to_pylist() == ["a", "b"] and arrow["rms_px"].to_pylist()[1] is None
    assert np.array_equal(arrow["covariance"][0].as_py(), answers[0].covariance.ravel())
    assert np.array_equal(arrow["translation_m"][0].as_py(), answers[0].cam_from_target.translation_m)
    for frame in (polars.DataFrame(table), pandas.DataFrame.from_arrow(table)):
        assert list(frame["status"]) == [a.status for a in answers] and np.array_equal(frame["covariance"][0], answers[0].covariance.ravel())


def detections():
    """A table of detections in every shape it may come in; `None` and NaN are what is missing."""
    frame = pandas.read_csv("testdata/rig/detections.csv")
    yield {name: frame[name].to_numpy() for name in frame}
    yield {name: frame[name].tolist() for name in frame} | {"target": [None] * len(frame)}
    yield frame
    yield frame.convert_dtypes()
    yield polars.from_pandas(frame)
    yield pyarrow.table(frame)
    yield CapsuleOnly(pyarrow.table(frame))


class CapsuleOnly:
    """What knows nothing but the Arrow PyCapsule interface."""

    def __init__(self, table):
        self.__arrow_c_stream__ = table.__arrow_c_stream__


def test_tables_of_detections_are_the_csv_file():
    cameras = "testdata/rig/cameras.toml"
    expected = resight.rig_from_detections(cameras, "testdata/rig/detections.csv")
    assert expected.status == "ok"
    for table in detections():
        assert resight.rig_from_detections(cameras, table) == expected, type(table)
    columns = next(detections())
    apart = columns | {"t_s": np.where(columns["camera"] == "right", 100.0, 0.0) + 10 * columns["view"]}
    assert resight.rig_from_detections(cameras, apart, sync_tolerance_s=0.1).status != "ok"
    for wrong, words in [
        ({"camera": ["left"]}, "column view is missing"),
        (columns | {"colour": [1]}, "colour is not known"),
        (columns | {"u_px": columns["u_px"][:5]}, "u_px"),
        (columns | {"view": columns["view"][:5]}, "columns of"),
        (columns | {"v_px": ["a"] * len(columns["u_px"])}, "numbers are needed"),
        (columns | {"camera": np.where(columns["view"] == 1, None, columns["camera"])}, "camera of row 0 is missing"),
        (columns | {"camera": np.zeros((2, 2))}, "a column (n,) is needed"),
        (3, "a table with columns"),
    ]:
        with pytest.raises(resight.Error) as refused:
            resight.rig_from_detections(cameras, wrong)
        assert words in str(refused.value), str(refused.value)


@pytest.fixture
def rerun(monkeypatch):
    """The SDK where it is installed (170 MB), else what hears the calls in its place."""
    try:
        import rerun as sdk

        sdk.init("resight_tests")
        sdk.memory_recording()
    except ImportError:
        sdk = types.SimpleNamespace(Clear=dict, Transform3D=dict, Pinhole=dict)
        monkeypatch.setitem(sys.modules, "rerun", sdk)
    heard = []
    monkeypatch.setattr(sdk, "log", lambda entity, what: heard.append((entity, what)), raising=False)
    return sdk, heard


def test_rerun_hears_where_the_camera_is(rerun, camera, points_m, pixels):
    sdk, heard = rerun
    answer = resight.solve(points_m, pixels, camera)
    interop.log_to_rerun("gate", answer, camera)
    place, turn = answer.target_from_cam.translation_m, answer.target_from_cam.rotation
    if isinstance(heard[0][1], dict):
        (entity, at), (below, lens) = heard
        assert np.array_equal(at["translation"], place) and np.array_equal(at["mat3x3"], turn)
        assert np.array_equal(lens["image_from_camera"], camera.matrix) and lens["resolution"] == (1280, 960)
    assert [entity for entity, _ in heard] == ["gate", "gate/image"]
    interop.log_to_rerun("gate", resight.solve(points_m[:2], pixels[:2], camera))
    assert isinstance(heard[-1][1], sdk.Clear)


def test_progress_is_a_bar_of_tqdm(capsys, monkeypatch):
    camera, target = resight.read_camera("examples/photo/left.yml"), resight.read_target("examples/photo/board.toml")
    resight.locate_images(["examples/photo/left01.jpg"] * 3, camera, target, progress=True)
    assert "3/3" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    with pytest.raises(resight.Error, match="pip install tqdm"):
        resight.locate_images(["examples/photo/left01.jpg"], camera, target, progress=True)


def test_pictures_of_residuals_and_drift(truth, camera, points_m, pixels):
    answer = resight.solve(points_m, pixels + 0.2, camera, sigma_px=0.3)
    assert "rms" in plot.residuals(points_m, pixels + 0.2, answer, camera).get_title()
    lost = resight.solve(points_m[:2], pixels[:2], camera)
    assert lost.status in plot.residuals(points_m, pixels, lost, camera).get_title()
    moved = resight.Pose.from_vectors([0, 0.01, 0], [0, 0, 0], b="cam", a="cam") @ truth
    covariances = np.repeat(np.eye(6)[None] * 1e-6, 2, axis=0)
    axes = plot.drift_history([0.0, 1.0], [truth.matrix, moved.matrix], covariances, truth)
    drawn = [line.get_ydata() for line in axes[0].get_lines()]
    assert np.allclose([y[0] for y in drawn], 0, atol=1e-9) and abs(abs(drawn[1][1]) - np.degrees(0.01)) < 1e-6


def test_pictures_of_an_answer_and_a_rig(camera, points_m, pixels):
    """Points are drawn where the answer puts them, cameras where the rig has them, ellipses as large as their covariance."""
    target = resight.Target("line_plus_one", line_m=[0.0, 0.1, 0.15], off_m=[0.0, 0.15])
    answer = resight.solve(points_m, pixels, camera)
    drawn = plot.overlay(np.zeros((960, 1280), np.uint8), answer, camera, target).get_lines()[0]
    assert np.allclose(np.stack(drawn.get_data(), axis=1), pixels, atol=1e-6)
    lost = resight.solve(points_m[:2], pixels[:2], camera)
    assert lost.message in plot.overlay(np.zeros((960, 1280), np.uint8), lost, camera, target).get_title()
    (ellipse,) = plot.covariance_ellipse((1, 2), [[4.0, 0], [0, 9.0]], n_sigma=2).patches
    assert sorted([ellipse.width, ellipse.height]) == pytest.approx([8, 12]) and ellipse.center == (1, 2)
    rig = resight.rig_from_detections("testdata/rig/cameras.toml", "testdata/rig/detections.csv")
    axes = plot.rig_3d(rig)
    assert {text.get_text() for text in axes.texts} == {"left", "right"}
    starts = {tuple(np.round([line[0] for line in lines.get_data_3d()], 9)) for lines in axes.get_lines()}
    assert starts == {tuple(np.round(rig.cameras[name]["rig_from_cam"]["translation_m"], 9)) for name in ("left", "right")}
