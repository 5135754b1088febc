"""The error budget of an answer: its parts add up to the covariance."""

import numpy as np
import pytest

import resight

SQUARE = np.array([[0, 0, 0], [0.3, 0, 0], [0.3, 0.3, 0.05], [0, 0.3, 0], [0.1, 0.2, 0.12], [0.25, 0.1, 0.2]])


def seen(camera):
    """The points 1.2 m away, tilted, with a tenth of a pixel of noise."""
    turn = np.array([[0.9, -0.1, 0.42], [0.15, 0.98, -0.1], [-0.41, 0.15, 0.9]])
    u, _, v = np.linalg.svd(turn)
    at = SQUARE @ (u @ v).T + [-0.1, -0.1, 1.2]
    return (at @ camera.matrix.T / at[:, 2:])[:, :2] + np.random.default_rng(3).normal(0, 0.1, (len(at), 2))


def test_parts_add_up_to_the_covariance():
    camera = resight.Camera("pinhole", width_px=640, height_px=480, fx_px=800, fy_px=800, cx_px=319.5, cy_px=239.5)
    answer = resight.solve(SQUARE, seen(camera), camera, sigma_px=0.1)
    whole = sum(np.array(part["covariance"]) for part in answer.budget)
    assert whole == pytest.approx(answer.covariance, rel=1e-9, abs=1e-9 * abs(answer.covariance).max())
    assert sum(part["share"] for part in answer.budget) == pytest.approx(1)
    assert answer.budget[0]["part"] == "pixels"
    assert answer.budget == answer.to_dict()["budget"] == resight.PoseAnswer.from_json(answer.to_json()).budget
