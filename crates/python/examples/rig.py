"""Photographs of two cameras to their extrinsics, and what has moved since."""

import resight

cameras = {"left": "examples/photo/left.yml", "right": "examples/photo/right.yml"}
images = {"left": "examples/photo/left*.jpg", "right": "examples/photo/right*.jpg"}
rig = resight.rig_from_images(cameras, "examples/photo/board.toml", images)
right = rig.cameras.right
print(rig.status, "right camera at", right.rig_from_cam.translation_m.round(4), "m, ±", right.sigma_m.round(5), "m")
rig.save("rig.toml")
print(resight.compare("examples/photo/rig_before.toml", "rig.toml")[0].message)
