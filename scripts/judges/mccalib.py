"""OpenCV's FileStorage, which MC-Calib itself reads and writes with, reads calibrated_cameras_data.yml and projects."""

import cv2
import numpy as np

from _rigs import folder, judge, opencv_pixel

for folder_name, rig, names in (
    ("mccalib", "placed_rig", ["left", "right"]),
    ("mccalib_wide", "placed_wide", ["front", "plain"]),
):
    path = folder() / folder_name / "calibrated_cameras_data.yml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert storage.getNode("nb_camera").real() == len(names)

    def pixel(camera, x):
        node = storage.getNode(f"camera_{names.index(camera)}")
        assert node.getNode("img_width").real() in (512, 640, 800)
        cam_from_group = np.linalg.inv(node.getNode("camera_pose_matrix").mat())
        k, d = node.getNode("camera_matrix").mat(), node.getNode("distortion_vector").mat()
        fisheye = node.getNode("distortion_type").real() == 1
        return opencv_pixel(k, d, cam_from_group[:3, :3], cam_from_group[:3, 3], x, fisheye)

    judge(f"OpenCV {cv2.__version__} on MC-Calib's file, {folder_name}", rig, pixel, cameras=names)
