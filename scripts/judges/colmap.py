"""pycolmap reads the COLMAP models: pixels through images and through rig and frame. COLMAP's pixel is ours + 0.5."""

import pycolmap

from _rigs import GOLDEN, folder, judge


def check(name, rig):
    model = pycolmap.Reconstruction(str(folder() / name))
    images = {image.name: image for image in model.images.values()}

    def pixel(camera_from_world, image, x):
        u, v = model.cameras[image.camera_id].img_from_cam(camera_from_world * x)
        return u - 0.5, v - 0.5

    def by_image(camera, x):
        return pixel(images[camera].cam_from_world(), images[camera], x)

    def by_rig(camera, x):
        image = images[camera]
        rig, frame = model.rigs[1], model.frames[1]
        sensor = pycolmap.sensor_t(pycolmap.SensorType.CAMERA, image.camera_id)
        if rig.is_ref_sensor(sensor):
            return pixel(frame.rig_from_world, image, x)
        return pixel(rig.sensor_from_rig(sensor) * frame.rig_from_world, image, x)

    judge(f"pycolmap {pycolmap.__version__}, {name}, images", rig, by_image)
    judge(f"pycolmap {pycolmap.__version__}, {name}, rig and frame", rig, by_rig)


def pose_of_line(line, first):
    """The text itself, so that what COLMAP derives anew cannot hide a wrong images.txt."""
    w, x, y, z, tx, ty, tz = (float(n) for n in line.split()[first : first + 7])
    return pycolmap.Rigid3d(pycolmap.Rotation3d([x, y, z, w]), [tx, ty, tz])


def check_images_text(name, rig):
    model = pycolmap.Reconstruction(str(folder() / name))
    lines = [line for line in (folder() / name / "images.txt").read_text().splitlines() if line and line[0] != "#"]
    images = {line.split()[9]: line for line in lines}

    def pixel(camera, x):
        camera_id = int(images[camera].split()[8])
        u, v = model.cameras[camera_id].img_from_cam(pose_of_line(images[camera], 1) * x)
        return u - 0.5, v - 0.5

    judge(f"pycolmap {pycolmap.__version__}, {name}, images.txt", rig, pixel)


for name, rig in (("colmap", "placed_rig"), ("colmap_wide", "placed_wide")):
    check(name, rig)
    check_images_text(name, rig)

# Every model that we read, straight from COLMAP's own table of parameters.
cameras = {}
for line in (GOLDEN.parent.parent / "colmap_models.txt").read_text().splitlines():
    if not line.startswith("#"):
        name, model, width, height, *parameters = line.split()
        cameras[name] = pycolmap.Camera(
            model=model, width=int(width), height=int(height), params=[float(p) for p in parameters]
        )


def model_pixel(camera, x):
    u, v = cameras[camera].img_from_cam(x)
    return u - 0.5, v - 0.5


judge(f"pycolmap {pycolmap.__version__}, 13 models", "colmap_models", model_pixel, file="colmap_models")
