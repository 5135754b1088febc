"""Arrays in, poses out: right answers, and named errors for what is none."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as arrays

import resight
from conftest import POINTS_M


def test_a_pose_and_its_uncertainty(camera, truth, points_m, pixels):
    answer = resight.solve(points_m, pixels, camera, sigma_px=0.3)
    assert answer.status == "ok" and answer.method == "line_plus_one"
    assert np.allclose(answer.cam_from_target.matrix, truth.matrix, atol=1e-9)
    assert np.allclose((answer.target_from_cam @ answer.cam_from_target).matrix, np.eye(4), atol=1e-12)
    assert answer.covariance.shape == (6, 6) and np.all(np.linalg.eigvalsh(answer.covariance) > 0)
    assert answer.to_dict()["covariance"] == answer.covariance.tolist()
    assert "cam_from_target" in repr(answer) and "±" in repr(answer)


def test_the_covariance_is_that_of_the_errors(camera, truth, points_m, pixels):
    """NEES over 400 noisy views: 6 is expected in the mean."""
    rng = np.random.default_rng(7)
    noisy = pixels + rng.normal(0, 0.05, (400, 4, 2))
    poses = resight.solve_many(points_m, noisy, camera, sigma_px=0.05)
    nees = []
    for found, covariance in zip(poses.cam_from_target, poses.covariance):
        error = found @ np.linalg.inv(truth.matrix)
        turn = resight.Pose.from_matrix(error).rotation_vector
        motion = np.concatenate([turn, error[:3, 3]])  # To first order in the rotation.
        nees.append(motion @ np.linalg.solve(covariance, motion))
    assert abs(np.mean(nees) - 6) < 0.8  # Four standard errors of 400 views: 4 sqrt(12 / 400) = 0.7.


@pytest.mark.parametrize("k", [3, 4, 6])
def test_many_views_are_each_alone(camera, k):
    rng = np.random.default_rng(k)
    points = rng.uniform(-0.2, 0.2, (k, 3))
    motions = [resight.Pose.from_vectors(rng.normal(0, 0.3, 3), [0.1, 0.1, 2] + rng.normal(0, 0.2, 3)) for _ in range(50)]
    pixels = np.stack([camera.project(m @ points) for m in motions]) + rng.normal(0, 0.2, (50, k, 2))
    together = resight.solve_many(points, pixels, camera)
    each = resight.solve_many(np.stack([points] * 50), pixels, camera)
    rows = resight.solve_many(np.tile(points, (50, 1)), pixels.reshape(-1, 2), camera, offsets=range(0, 50 * k + 1, k))
    for i in range(50):
        alone = resight.solve(points, pixels[i], camera)
        minima = [together.cam_from_target[i]] if 3 < k else list(alone.minima)
        assert any(np.allclose(m, together.cam_from_target[i], atol=1e-6) for m in minima)
        assert alone.status == together.status[i]
        assert np.allclose(alone.chi2, together.chi2[i], atol=1e-6)
        assert np.allclose(each.cam_from_target[i], together.cam_from_target[i], atol=1e-9)
        assert np.allclose(rows.cam_from_target[i] if 3 < k else 0, together.cam_from_target[i] if 3 < k else 0, atol=1e-6)


def test_layouts_of_memory_give_the_same_answer(camera, points_m, pixels):
    expected = resight.solve(points_m, pixels, camera).to_json()
    read_only = pixels.copy()
    read_only.flags.writeable = False
    for same in (np.asfortranarray(pixels), np.repeat(pixels, 2, axis=0)[::2], pixels.tolist(), read_only,
                 pixels.astype(">f8"), np.ascontiguousarray(pixels[::-1])[::-1]):
        assert resight.solve(points_m, same, camera).to_json() == expected
    rounded = np.round(pixels)
    assert resight.solve(points_m, rounded.astype(np.int32), camera).to_json() == resight.solve(points_m, rounded, camera).to_json()


@pytest.mark.parametrize(("wrong", "words"), [
    (lambda p: p.T, "(2, 4) is given, (n, 2) is needed; it looks transposed"),
    (lambda p: p[:3], "one pixel for each point"),
    (lambda p: p.astype(complex), "complex128"),
    (lambda p: p > 0, "bool"),
    (lambda p: "pixels", "no real numbers"),
    (lambda p: None, "no real numbers"),
    (lambda p: [[1, 2], [3]], "real numbers"),
    (lambda p: np.array(3.0), "shape ()"),
    (lambda p: p * np.inf, "outside the valid field"),
    (lambda p: np.where(p == p[0, 0], np.nan, p), "half missing"),
    (lambda p: p[None], "(1, 4, 2) is given"),
    (lambda p: {}, "no real numbers"),
])
def test_wrong_arrays_are_named(camera, points_m, pixels, wrong, words):
    with pytest.raises(resight.Error) as caught:
        resight.solve(points_m, wrong(pixels), camera)
    assert words in str(caught.value) and caught.value.kind in ("input", "outside_field")


def test_what_determines_no_pose_is_an_answer(camera, points_m, pixels):
    for points, seen in [(points_m[:2], pixels[:2]), (points_m[:0], pixels[:0]), (points_m[:3], pixels[:3]), (points_m * np.nan, pixels)]:
        answer = resight.solve(points, seen, camera)
        assert answer.status in ("degenerate", "error") and answer.cam_from_target is None and answer.message


def test_wrong_options_are_named(camera, points_m, pixels):
    for options in ({"method": "magic"}, {"sigma_px": [1, 2]}, {"names": ["a"]}, {"gravity": ([0, 0, 0], [0, 1, 0], 1.0)}):
        with pytest.raises(resight.Error):
            resight.solve(points_m, pixels, camera, **options)
    assert resight.solve(points_m, pixels, camera, sigma_px=-1).status == "error"
    with pytest.raises(resight.Error):
        resight.solve_many(points_m, pixels[None], resight.Camera.nominal(image_size_px=(1280, 960), hfov_deg=60))


def test_huge_arrays_without_points_are_refused_before_anything_is_allocated(camera, points_m):
    for pixels in (np.zeros((10**12, 0, 2)), np.zeros((0, 4, 2))[:, :0]):
        with pytest.raises(resight.Error, match="is needed"):
            resight.solve_many(points_m, pixels, camera)
    assert len(resight.solve_many(points_m, np.zeros((0, 4, 2)), camera)) == 0
    with pytest.raises(resight.Error, match="real numbers"):  # 64 TB, were it copied.
        resight.solve_many(points_m, np.broadcast_to(points_m[:, :2], (10**12, 4, 2)), camera)


ANYTHING = st.one_of(
    arrays.arrays(st.sampled_from([np.float64, np.float32, np.int64, np.uint8, np.bool_, np.complex64]),
                  arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=5)),
    st.none(), st.text(), st.lists(st.lists(st.floats(), max_size=3), max_size=5), st.integers(), st.floats(), st.binary(),
)
CAMERA = resight.Camera("pinhole", width_px=640, height_px=480, fx_px=500, fy_px=500, cx_px=319.5, cy_px=239.5)


@settings(max_examples=2000, deadline=None, derandomize=True)
@given(ANYTHING, ANYTHING)
def test_anything_is_an_answer_or_a_named_error(points, pixels):
    """2,000 drawn pairs, each in 56 calls: more than 100,000."""
    forms = [lambda x: x, lambda x: np.asarray(x, dtype=object), lambda x: [x], np.array, np.transpose,
             np.asfortranarray, lambda x: np.broadcast_to(np.asarray(x).real.astype(float).ravel()[:1], (4, 2))]
    for form in forms:
        try:
            seen = form(pixels)
        except Exception:  # noqa: BLE001, NumPy has no such form of it.
            seen = pixels
        for places in (points, POINTS_M, POINTS_M[:3], seen):
            for call in (resight.solve, resight.solve_many):
                try:
                    answer = call(places, seen, CAMERA)
                except resight.Error as reason:
                    assert reason.kind and str(reason)
                else:
                    _is_sound(answer)


def _is_sound(answer):
    if isinstance(answer, resight.Poses):
        assert np.all(np.isfinite(answer.cam_from_target)) and np.all(np.isfinite(answer.covariance))
        return
    assert answer.status in ("ok", "ambiguous", "inconsistent", "degenerate", "error")
    if answer.cam_from_target is not None:
        assert np.all(np.isfinite(answer.cam_from_target.matrix))


def test_a_million_calls_keep_no_memory(camera, points_m, pixels):
    def resident_kb():
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * 4

    def calls(n):
        for _ in range(n):
            resight.solve(points_m, pixels, camera, sigma_px=0.3).cam_from_target
            try:
                resight.solve(points_m, pixels.T, camera)
            except resight.Error:
                pass

    calls(20_000)
    before = resident_kb()
    calls(500_000)
    assert resident_kb() - before < 4000


def test_a_contiguous_array_is_not_copied(camera, points_m, pixels):
    import tracemalloc

    many = np.ascontiguousarray(np.broadcast_to(pixels, (20_000, 4, 2)))

    def allocated(array):
        tracemalloc.start()
        resight.solve_many(points_m, array, camera)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    assert allocated(many) < many.nbytes / 10 < many.nbytes < allocated(np.asfortranarray(many))


def test_frames_are_checked(truth):
    with pytest.raises(resight.Error, match="inner frames differ"):
        truth @ truth
    assert (truth @ truth.inverse()).b == "cam"
    with pytest.raises(resight.Error, match="no rigid transform"):
        resight.Pose.from_matrix(np.diag([2.0, 1, 1, 1]))
