"""Four measured points and their pixels to a pose; many views at once."""

import numpy as np

import resight

camera = resight.Camera("pinhole", width_px=1280, height_px=960, fx_px=1000, fy_px=1000, cx_px=639.5, cy_px=479.5)
points_m = np.array([[0, 0, 0], [0.1, 0, 0], [0.15, 0, 0], [0, 0.15, 0]])
pixels = np.array([[656.17, 504.50], [725.50, 505.24], [758.18, 505.59], [635.41, 618.92]])
answer = resight.solve(points_m, pixels, camera, sigma_px=0.3)
print(answer)
views = pixels + np.random.default_rng(1).normal(0, 0.3, (1000, 4, 2))
poses = resight.solve_many(points_m, views, camera, sigma_px=0.3)
print(poses, "spread", poses.cam_from_target[:, :3, 3].std(axis=0), "m")
