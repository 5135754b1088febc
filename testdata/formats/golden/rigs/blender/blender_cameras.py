# Makes calibrated cameras in Blender: Scripting, Open, Run Script (or `blender --python THIS_FILE`).
# Lengths in metres. A camera looks along its own -z, y is up. Each camera has a scene with its image size.
import bpy
from mathutils import Matrix

ROOT = "world"
UPRIGHT_FROM_ROOT = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
SENSOR_MM = 36.0
CAMERAS = [
    dict(
        name="left",
        root_from_cam=[[0.0, 1.0, 0.0, 1.2], [0.0, 0.0, 1.0, 0.3], [1.0, 0.0, 0.0, -0.1], [0.0, 0.0, 0.0, 1.0]],
        lens=30.116249999999997,
        shift=(-0.03484375000000002, -0.008273523511849243),
        size=(640, 480),
        aspect=(1.0009338812103101, 1.0),
        distortion=[-0.2, 0.1, 0.001, -0.0005, 0.02],
    ),
    dict(
        name="right",
        root_from_cam=[[0.03958416633346651, 0.9756097560975612, -0.21591363454618145, 1.0818272690923632], [-0.1759296281487404, 0.21951219512195116, 0.9596161535385848, 0.43076769292283085], [0.9836065573770494, 0.0, 0.18032786885245888, 0.389344262295082], [0.0, 0.0, 0.0, 1.0]],
        lens=31.60125,
        shift=(-0.01375, -0.011558385231316725),
        size=(800, 600),
        aspect=(1.0003559985760058, 1.0),
        distortion=[],
    ),
    dict(
        name="tele",
        root_from_cam=[[-0.28000000000000014, 0.0, -0.96, -2.0], [0.0, -1.0, 0.0, 0.5], [-0.96, -0.0, 0.28000000000000014, 1.0], [0.0, 0.0, 0.0, 1.0]],
        lens=80.01666666666667,
        shift=(0.008101851851851851, 0.011121535378806306),
        size=(1080, 1920),
        aspect=(1.0, 1.0009381840925675),
        distortion=[-0.1, 0.05, 0.0002, -0.0003, 0.01, 0.02, -0.01, 0.003],
    ),
]


def make(root, collection, c):
    data = bpy.data.cameras.new(c["name"])
    data.type = "PERSP"
    data.sensor_fit = "HORIZONTAL"
    data.sensor_width = SENSOR_MM
    data.lens = c["lens"]
    data.shift_x, data.shift_y = c["shift"]
    # Blender renders without distortion: undistort the images, or put these numbers into a compositor.
    data["brown_conrady"] = c["distortion"]
    if any(c["distortion"]):
        print(c["name"] + ": Blender does not apply the lens distortion; it is kept as a property of the camera")
    camera = bpy.data.objects.new(c["name"], data)
    camera.parent = root
    camera.matrix_parent_inverse = Matrix()
    camera.matrix_basis = Matrix(c["root_from_cam"])
    collection.objects.link(camera)
    return camera


def show(collection, camera, c):
    scene = bpy.data.scenes.new(c["name"])
    scene.collection.children.link(collection)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = c["size"]
    scene.render.resolution_percentage = 100
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = c["aspect"]


def main():
    collection = bpy.data.collections.new(ROOT)
    bpy.context.scene.collection.children.link(collection)
    root = bpy.data.objects.new(ROOT, None)
    root.matrix_basis = Matrix(UPRIGHT_FROM_ROOT)
    collection.objects.link(root)
    for c in CAMERAS:
        show(collection, make(root, collection, c), c)


main()
