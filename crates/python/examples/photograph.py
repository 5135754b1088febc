"""A photograph to a pose with its uncertainty."""

import resight

camera = resight.read_camera("examples/photo/left.yml")
target = resight.read_target("examples/photo/board.toml")
answer = resight.locate_image("examples/photo/left01.jpg", camera, target)
if answer.target_from_cam is None or answer.sigma_m is None:
    raise SystemExit(answer.message)
print(answer.status, "camera at", answer.target_from_cam.translation_m.round(4), "m, ±", answer.sigma_m.round(5), "m")
