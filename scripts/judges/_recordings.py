"""Recordings as other people's libraries write them: rendered tags with known poses in MCAP files.

    python scripts/judges/_recordings.py [FOLDER]      default: testdata/mcap

Written by `mcap-ros2-support` (zstd and lz4), `rosbags` (uncompressed, and either byte order of CDR) and `mcap` (ROS 1, JSON). A tag
36h11 with id 3, 0.16 m wide, is drawn ray by ray through the lens; truth.json holds where each camera stood. Pictures differ by a few
pixels in a corner, as no two pictures of a camera are alike.
"""

import base64
import functools
import json
import pathlib
import shutil
import sys
import tempfile

import cv2
import numpy as np
from mcap.writer import CompressionType
from mcap.writer import Writer as PlainWriter
from mcap_ros2.writer import Writer as Ros2Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

TAG_ID, TAG_SIZE_M = 3, 0.16
START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 200_000_000
N_FRAMES = 24
APRILTAG = {
    "apriltag_msgs/msg/Point": "float64 x\nfloat64 y\n",
    "apriltag_msgs/msg/AprilTagDetection": "string family\nint32 id\nint32 hamming\nfloat32 goodness\nfloat32 decision_margin\n"
    "Point centre\nPoint[4] corners\nfloat64[9] homography\n",
    "apriltag_msgs/msg/AprilTagDetectionArray": "std_msgs/Header header\nAprilTagDetection[] detections\n",
    "isaac_ros_apriltag_interfaces/msg/AprilTagDetection": "string family\nint32 id\nfloat64 size\ngeometry_msgs/Point center\n"
    "geometry_msgs/Point[4] corners\ngeometry_msgs/PoseWithCovarianceStamped pose\n",
    "isaac_ros_apriltag_interfaces/msg/AprilTagDetectionArray": "std_msgs/Header header\nAprilTagDetection[] detections\n",
}


class Camera:
    """A lens as camera_info states it, and where it stands."""

    def __init__(self, name, size, f, d, model, rvec, tvec):
        self.name, self.size, self.model = name, size, model
        self.k = np.array([[f, 0, size[0] / 2 - 3.5], [0, f + 1.0, size[1] / 2 + 2.0], [0, 0, 1]])
        self.d, self.rvec, self.tvec = np.array(d), np.array(rvec), np.array(tvec)

    def cam_from_target(self):
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = cv2.Rodrigues(self.rvec)[0], self.tvec
        return matrix

    def bearings(self, pixels):
        if self.model == "equidistant":
            return cv2.fisheye.undistortPoints(pixels[None], self.k, self.d)[0]
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-12)
        return cv2.undistortPoints(pixels[:, None], self.k, self.d, criteria=criteria)[:, 0]

    def draw(self, shade):
        """Grey picture; `shade` makes it this frame's own."""
        image = self.picture.copy()
        image[:2, :2] = shade
        return image

    @functools.cached_property
    def picture(self):
        width, height = self.size
        steps = (np.arange(4) + 0.5) / 4 - 0.5
        total = np.zeros(height * width)
        matrix = self.cam_from_target()
        rotation, origin = matrix[:3, :3], -matrix[:3, :3].T @ matrix[:3, 3]
        for dv in steps:
            for du in steps:
                u, v = np.meshgrid(np.arange(width) + du, np.arange(height) + dv)
                x = self.bearings(np.stack([u.ravel(), v.ravel()], 1))
                direction = np.column_stack([x, np.ones(len(x))]) @ rotation
                at = origin[:2] - direction[:, :2] * (origin[2] / direction[:, 2])[:, None]
                total += tag_shade(at)
        return np.rint(total.reshape(height, width) / 16).astype(np.uint8)

    def corners(self, rectified=False):
        """Top-left, top-right, bottom-right, bottom-left; pixel (0, 0) is a centre."""
        h = TAG_SIZE_M / 2
        points = np.array([[-h, -h, 0], [h, -h, 0], [h, h, 0], [-h, h, 0]])
        d = np.zeros(5) if rectified else self.d
        if self.model == "equidistant" and not rectified:
            return cv2.fisheye.projectPoints(points[None], self.rvec, self.tvec, self.k, d)[0][0]
        return cv2.projectPoints(points, self.rvec, self.tvec, self.k, d)[0][:, 0]


def tag_shade(at):
    """Brightness of the tag's plane: white paper, the tag with its black border of one cell, grey table."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    # OpenCV's dictionary has the tags of the family upside down; its marker image is eight cells wide.
    cells = np.pad(cv2.aruco.generateImageMarker(dictionary, TAG_ID, 8)[::-1, ::-1], 1, constant_values=255)
    cell = np.floor(at / (TAG_SIZE_M / 8) + 5).astype(int)
    inside = ((0 <= cell) & (cell < 10)).all(1)
    shade = np.full(len(at), 110.0)
    shade[inside] = np.where(cells[cell[inside, 1], cell[inside, 0]], 225.0, 30.0)
    return shade


GATE = Camera("gate", (320, 240), 260.0, [-0.21, 0.07, 0.001, -0.0007, 0.0], "plumb_bob", [0.35, -0.28, 0.08], [0.02, -0.01, 0.48])
YARD = Camera("yard", (320, 240), 180.0, [0.02, -0.004, 0.0006, -0.0001], "equidistant", [-0.3, 0.4, -0.15], [-0.04, 0.02, 0.36])
SHED = Camera("shed", (256, 192), 210.0, [0.05, -0.02, 0, 0, 0, 0.01, 0, 0], "rational_polynomial", [0.45, 0.2, 0.3], [0.01, 0.015, 0.42])


def typestore(kind=Stores.ROS2_HUMBLE):
    store = get_typestore(kind)
    if kind != Stores.ROS1_NOETIC:
        for name, text in APRILTAG.items():
            store.register(get_types_from_msg(text, name))
    return store


def header(store, time_ns, frame):
    time = store.types["builtin_interfaces/msg/Time"](int(time_ns // 10**9), int(time_ns % 10**9))
    kind = store.types["std_msgs/msg/Header"]
    return kind(stamp=time, frame_id=frame, **({"seq": 0} if "seq" in kind.__dataclass_fields__ else {}))


def camera_info(store, camera, time_ns):
    region = store.types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    p = np.hstack([camera.k, np.zeros((3, 1))])
    kind = store.types["sensor_msgs/msg/CameraInfo"]
    fields = {"d": camera.d, "k": camera.k.ravel(), "r": np.eye(3).ravel(), "p": p.ravel()}
    if "D" in kind.__dataclass_fields__:
        fields = {name.upper(): value for name, value in fields.items()}
    return kind(
        header=header(store, time_ns, f"{camera.name}_optical"), height=camera.size[1], width=camera.size[0],
        distortion_model=camera.model, binning_x=0, binning_y=0, roi=region, **fields,
    )


def image(store, camera, picture, encoding, time_ns, padding=0):
    rows = np.pad(picture.reshape(picture.shape[0], -1), ((0, 0), (0, padding)))
    return store.types["sensor_msgs/msg/Image"](
        header=header(store, time_ns, f"{camera.name}_optical"), height=camera.size[1], width=camera.size[0],
        encoding=encoding, is_bigendian=0, step=rows.shape[1], data=np.ascontiguousarray(rows).view(np.uint8).ravel(),
    )


def compressed(store, camera, picture, time_ns):
    data = cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1].ravel()
    return store.types["sensor_msgs/msg/CompressedImage"](header=header(store, time_ns, camera.name), format="mono8; png compressed ", data=data)


def apriltags(store, camera, time_ns):
    """As apriltag_ros publishes them from rectified pictures: bottom-left first, pixel centres at +0.5."""
    point = store.types["apriltag_msgs/msg/Point"]
    corners = [point(float(u) + 0.5, float(v) + 0.5) for u, v in camera.corners(rectified=True)[::-1]]
    tag = store.types["apriltag_msgs/msg/AprilTagDetection"](
        family="tag36h11", id=TAG_ID, hamming=0, goodness=0.0, decision_margin=80.0, centre=point(0.0, 0.0), corners=corners,
        homography=np.zeros(9),
    )
    array = store.types["apriltag_msgs/msg/AprilTagDetectionArray"]
    return array(header=header(store, time_ns, camera.name), detections=[tag])


def isaac_tags(store, camera, time_ns):
    """As Isaac ROS publishes them: top-left first."""
    t = store.types
    point = t["geometry_msgs/msg/Point"]
    pose = t["geometry_msgs/msg/Pose"](position=point(0.0, 0.0, 0.0), orientation=t["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0))
    stamped = t["geometry_msgs/msg/PoseWithCovarianceStamped"](
        header=header(store, time_ns, ""), pose=t["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36))
    )
    corners = [point(float(u) + 0.5, float(v) + 0.5, 0.0) for u, v in camera.corners(rectified=True)]
    tag = t["isaac_ros_apriltag_interfaces/msg/AprilTagDetection"](
        family="tag36h11", id=TAG_ID, size=TAG_SIZE_M, center=point(0.0, 0.0, 0.0), corners=corners, pose=stamped
    )
    array = t["isaac_ros_apriltag_interfaces/msg/AprilTagDetectionArray"]
    return array(header=header(store, time_ns, camera.name), detections=[tag])


def plain(message):
    """Dataclasses of rosbags as the dictionaries that mcap-ros2-support takes."""
    if isinstance(message, np.ndarray):
        return message.tobytes() if message.dtype == np.uint8 else message.tolist()
    if isinstance(message, list):
        return [plain(part) for part in message]
    if hasattr(message, "__dataclass_fields__"):
        return {name: plain(getattr(message, name)) for name in message.__dataclass_fields__ if name != "__msgtype__"}
    return message


def with_mcap_ros2(path, compression, messages):
    store, schemas = typestore(), {}
    with path.open("wb") as file, Ros2Writer(file, chunk_size=1 << 19, compression=compression) as writer:
        for topic, time_ns, message in messages(store):
            kind = message.__msgtype__
            if kind not in schemas:
                schemas[kind] = writer.register_msgdef(kind, store.generate_msgdef(kind, ros_version=2)[0])
            writer.write_message(topic, schemas[kind], plain(message), log_time=time_ns + 5_000_000)


def with_rosbags(path, messages):
    """A folder with metadata, of which the recording is taken."""
    store, connections = typestore(), {}
    with tempfile.TemporaryDirectory() as parent:
        folder = pathlib.Path(parent) / "bag"
        with RosbagsWriter(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            for topic, time_ns, message in messages(store):
                kind = message.__msgtype__
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=store)
                writer.write(connections[topic], time_ns + 5_000_000, store.serialize_cdr(message, kind))
        shutil.copy(next(folder.glob("*.mcap")), path)


def with_mcap(path, messages, profile, encoding, schema_encoding, serialize, define):
    """The container alone: bytes as they are given."""
    channels = {}
    with path.open("wb") as file:
        writer = PlainWriter(file, compression=CompressionType.ZSTD, chunk_size=1 << 16)
        writer.start(profile=profile, library="judges")
        for topic, time_ns, kind, message in messages:
            if topic not in channels:
                schema = writer.register_schema(kind, schema_encoding, define(kind))
                channels[topic] = writer.register_channel(topic, encoding, schema)
            writer.add_message(channels[topic], time_ns + 5_000_000, serialize(message, kind), time_ns)
        writer.finish()


def times(n=N_FRAMES):
    return [(i, START_NS + i * PERIOD_NS) for i in range(n)]


def two_cameras(store):
    for i, time_ns in times():
        yield "/gate/camera_info", time_ns, camera_info(store, GATE, time_ns)
        yield "/gate/image_raw", time_ns, image(store, GATE, GATE.draw(4 * i), "mono8", time_ns, padding=8)
        yield "/yard/camera_info", time_ns, camera_info(store, YARD, time_ns)
        yield "/yard/image_raw/compressed", time_ns, compressed(store, YARD, YARD.draw(4 * i), time_ns)


def detections(store):
    for _, time_ns in times():
        yield "/gate/camera_info", time_ns, camera_info(store, GATE, time_ns)
        yield "/detections", time_ns, apriltags(store, GATE, time_ns)
        yield "/tag_detections", time_ns, isaac_tags(store, GATE, time_ns)


def one_camera(store):
    for i, time_ns in times():
        yield "/shed/camera_info", time_ns, camera_info(store, SHED, time_ns)
        yield "/shed/image_raw/compressed", time_ns, compressed(store, SHED, SHED.draw(4 * i), time_ns)


def old_ros(path):
    store = typestore(Stores.ROS1_NOETIC)
    def messages():
        for i, time_ns in times(4):
            yield "/gate/camera_info", time_ns, "sensor_msgs/msg/CameraInfo", camera_info(store, GATE, time_ns)
            colour = cv2.cvtColor(GATE.draw(4 * i), cv2.COLOR_GRAY2RGB)
            yield "/gate/image_raw", time_ns, "sensor_msgs/msg/Image", image(store, GATE, colour, "rgb8", time_ns)
    with_mcap(path, ((t, n, k.replace("/msg/", "/"), m) for t, n, k, m in messages()), "ros1", "ros1", "ros1msg",
              lambda m, k: bytes(store.serialize_ros1(m, k.replace("/", "/msg/"))),
              lambda k: store.generate_msgdef(k.replace("/", "/msg/"), ros_version=1)[0].encode())


def big_end_first(path):
    store = typestore()
    def messages():
        for i, time_ns in times(4):
            yield "/yard/camera_info", time_ns, "sensor_msgs/msg/CameraInfo", camera_info(store, YARD, time_ns)
            sixteen = YARD.draw(4 * i).astype("<u2") * 16  # a sensor of twelve bits
            yield "/yard/image_raw", time_ns, "sensor_msgs/msg/Image", image(store, YARD, sixteen.view(np.uint8), "mono16", time_ns)
    with_mcap(path, messages(), "ros2", "cdr", "ros2msg",
              lambda m, k: bytes(store.serialize_cdr(m, k, little_endian=False)),
              lambda k: store.generate_msgdef(k, ros_version=2)[0].encode())


def as_json(path):
    def stamp(time_ns):
        return {"sec": int(time_ns // 10**9), "nsec": int(time_ns % 10**9)}
    def messages():
        for i, time_ns in times(4):
            matrix = {"K": GATE.k.ravel().tolist(), "R": np.eye(3).ravel().tolist(), "P": np.hstack([GATE.k, np.zeros((3, 1))]).ravel().tolist()}
            yield "/gate/calibration", time_ns, "foxglove.CameraCalibration", {
                "timestamp": stamp(time_ns), "frame_id": "gate", "width": 320, "height": 240, "distortion_model": "plumb_bob", "D": GATE.d.tolist(), **matrix}
            png = cv2.imencode(".png", GATE.draw(4 * i), [cv2.IMWRITE_PNG_COMPRESSION, 9])[1].tobytes()
            yield "/gate/image", time_ns, "foxglove.CompressedImage", {
                "timestamp": stamp(time_ns), "frame_id": "gate", "format": "png", "data": base64.b64encode(png).decode()}
    with_mcap(path, messages(), "", "json", "jsonschema", lambda m, _: json.dumps(m).encode(), lambda _: b'{"type":"object"}')


def write_all(folder):
    folder.mkdir(parents=True, exist_ok=True)
    with_mcap_ros2(folder / "two_cameras_zstd.mcap", CompressionType.ZSTD, two_cameras)
    with_mcap_ros2(folder / "detections_lz4.mcap", CompressionType.LZ4, detections)
    with_rosbags(folder / "rosbags_plain.mcap", one_camera)
    old_ros(folder / "ros1_zstd.mcap")
    big_end_first(folder / "big_endian.mcap")
    as_json(folder / "foxglove_json.mcap")
    truth = {camera.name: camera.cam_from_target().tolist() for camera in (GATE, YARD, SHED)}
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
    (folder / "tag.toml").write_text(f'kind = "tag"\nfamily = "tag36h11"\nid = {TAG_ID}\nsize_m = {TAG_SIZE_M}\n')


if __name__ == "__main__":
    default = pathlib.Path(__file__).resolve().parents[2] / "testdata" / "mcap"
    write_all(pathlib.Path(sys.argv[1]) if 1 < len(sys.argv) else default)
