"""WPILib (robotpy) loads our field layouts: tag poses and the field's size, and its own frame for a tag's corners.

The layouts were written from ones of known numbers: tag 1 at (15, 0.25, 1.36) unturned, tag 4 at (16.5, 5.5, 1.45)
turned by half a turn about z. WPILib 2026 reads the classic keys; the keys of 2027 are compared as JSON.
"""

import json

import numpy as np
from robotpy_apriltag import AprilTagFieldLayout

from _rigs import folder


def tags(path):
    layout = AprilTagFieldLayout(str(path))
    assert abs(layout.getFieldLength() - layout_json(path)["field"]["length"]) < 1e-9
    return layout, {tag.ID: layout.getTagPose(tag.ID) for tag in layout.getTags()}


def layout_json(path):
    return json.loads(path.read_text())


def close(a, b):
    assert np.allclose(a, b, rtol=0, atol=1e-12), (a, b)


layout, found = tags(folder() / "wpilib" / "field_layout.json")
assert sorted(found) == [1, 4] and layout.getFieldLength() == 16.541 and layout.getFieldWidth() == 8.211
close([found[1].x, found[1].y, found[1].z], [15.0, 0.25, 1.36])
close([found[4].x, found[4].y, found[4].z], [16.5, 5.5, 1.45])
close(found[1].rotation().toMatrix(), np.eye(3))
close(found[4].rotation().toMatrix(), np.diag([-1.0, -1.0, 1.0]))
print("robotpy's WPILib reads our field layout: 2 tags, field 16.541 by 8.211 m")

# Keys of our own (family, size) must not disturb it.
_, own = tags(folder() / "wpilib_own" / "field_layout.json")
assert sorted(own) == [1, 4]
print("robotpy's WPILib reads past our own keys")

new = layout_json(folder() / "wpilib_2027" / "field_layout.json")
old = layout_json(folder() / "wpilib" / "field_layout.json")
assert (new["field-tags"], new["field-dimensions"]) == (old["tags"], old["field"])
print("the keys of 2027 hold the same tags and field")
