"""Blender runs our script (bpy from PyPI, where installed) and its own camera gives our pixels; else a stand-in for bpy.

The stand-in only records what the script makes and projects by Blender's published rules (sensor, lens, shift, aspect).
Lenses with distortion are compared with the pinhole part of the point's pixel.
"""

import ast
import pathlib
import sys
import types

import numpy as np

from _rigs import folder, judge, opencv_pixel, points

path = folder() / "blender" / "blender_cameras.py"
source = path.read_text()
ast.parse(source)


class Thing(types.SimpleNamespace):
    """An object with whatever attributes the script sets, and properties by key."""

    def __setitem__(self, key, value):
        self.__dict__[key] = value


class Links(list):
    def link(self, thing):
        self.append(thing)


class Made(dict):
    def __init__(self, make):
        super().__init__()
        self.make = make

    def new(self, name, *data):
        self[name] = self.make(name, *data)
        return self[name]


def scene(name):
    return Thing(name=name, collection=Thing(children=Links()), render=Thing())


def stand_in():
    data = Thing(
        cameras=Made(lambda name: Thing(name=name)),
        objects=Made(lambda name, data: Thing(name=name, data=data, parent=None)),
        collections=Made(lambda name: Thing(name=name, objects=Links())),
        scenes=Made(scene),
    )
    mathutils = types.ModuleType("mathutils")
    mathutils.Matrix = lambda rows=np.eye(4): np.array(rows)
    bpy = types.ModuleType("bpy")
    bpy.data, bpy.context = data, Thing(scene=scene("Scene"))
    sys.modules["bpy"], sys.modules["mathutils"] = bpy, mathutils
    return bpy


def world_matrix(thing):
    own = np.array(thing.matrix_basis)
    return own if thing.parent is None else world_matrix(thing.parent) @ own


def by_rules(bpy, camera, x):
    """The view plane of a PERSP camera with sensor_fit HORIZONTAL; pixels from the first's centre."""
    thing, render = bpy.data.objects[camera], bpy.data.scenes[camera].render
    p = np.linalg.inv(world_matrix(thing)) @ world_matrix(bpy.data.objects["world"]) @ [*x, 1.0]
    w, h = render.resolution_x, render.resolution_y
    fx = thing.data.lens / thing.data.sensor_width * w
    aspect = render.pixel_aspect_y / render.pixel_aspect_x
    u = fx * p[0] / -p[2] - thing.data.shift_x * w
    v = (fx * p[1] / -p[2] - thing.data.shift_y * w) / aspect
    return 0.5 * w + u - 0.5, 0.5 * h - v - 0.5


def by_blender(bpy, camera, x):
    """calc_matrix_camera is the projection that Blender renders with."""
    thing, made = bpy.data.objects[camera], bpy.data.scenes[camera]
    made.view_layers[0].update()
    w, h, render = made.render.resolution_x, made.render.resolution_y, made.render
    graph = made.view_layers[0].depsgraph
    projection = np.array(
        thing.calc_matrix_camera(graph, x=w, y=h, scale_x=render.pixel_aspect_x, scale_y=render.pixel_aspect_y)
    )
    where = np.array(bpy.data.objects["world"].matrix_world) @ [*x, 1.0]
    p = projection @ np.linalg.inv(np.array(thing.matrix_world)) @ where
    return 0.5 * w * (1 + p[0] / p[3]) - 0.5, 0.5 * h * (1 - p[1] / p[3]) - 0.5


def undistorted():
    """{camera: {point: pixel without distortion}} from the mrcal files of the same rig."""
    out = {}
    for camera, pairs in points("placed_rig").items():
        model = ast.literal_eval((folder() / "mrcal" / f"{camera}.cameramodel").read_text())
        fx, fy, cx, cy = model["intrinsics"][:4]
        k, rt = [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], model["extrinsics"]
        out[camera] = {x: opencv_pixel(k, np.zeros(5), rt[:3], rt[3:], x) for x, _ in pairs}
    return out


def main():
    try:
        import bpy

        program, project, tolerance = f"Blender {bpy.app.version_string}", by_blender, 1e-3  # single precision
    except ImportError:
        bpy, program, project, tolerance = stand_in(), "a stand-in for bpy", by_rules, 1e-9
    exec(compile(source, str(path), "exec"), {"__name__": "__main__"})
    plain, ours = undistorted(), points("placed_rig")

    def pixel(camera, x):
        """Our pixel plus what the other program is off from our pixel without distortion."""
        at = dict(ours[camera])[x]
        return at + (np.array(project(bpy, camera, x)) - plain[camera][x])

    judge(program, "placed_rig", pixel, tolerance_px=tolerance)
    assert list(bpy.data.objects["left"].data["brown_conrady"] if program[0] == "B" else [1])
    sizes = [(s.render.resolution_x, s.render.resolution_y) for n, s in bpy.data.scenes.items() if n != "Scene"]
    assert sorted(sizes) == [(640, 480), (800, 600), (1080, 1920)], sizes


if __name__ == "__main__":
    sys.path.insert(0, str(pathlib.Path(__file__).parent))
    main()
