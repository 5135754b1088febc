import os
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Array: TypeAlias = NDArray[np.float64]
_Image: TypeAlias = str | os.PathLike[str] | bytes | NDArray[np.uint8]
_Progress: TypeAlias = Callable[[int, int], object] | bool | None

__all__ = [
    "Camera",
    "Cameras",
    "FleetState",
    "Pose",
    "PoseAnswer",
    "Monitor",
    "Poses",
    "Table",
    "Target",
    "__version__",
    "advise_boards",
    "advise_points",
    "advise_target",
    "batch",
    "check_intrinsics",
    "compare",
    "detect",
    "explain",
    "fleet_report",
    "fleet_span_s",
    "hand_eye",
    "hand_eye_of_poses",
    "intrinsics",
    "locate_image",
    "locate_images",
    "locate_views",
    "main",
    "map_tags",
    "measure",
    "panic_on_purpose",
    "pose_graph",
    "rig_from_detections",
    "rig_from_images",
    "rig_pose",
    "schema",
    "solve",
    "solve_lines",
    "solve_many",
    "solve_table",
    "solve_views",
    "table",
    "write_atomically",
]

__version__: str
"""The version of the package, which is that of the program and the Rust library."""

@final
class Camera:
    """A lens with its image size, and how well its intrinsics are known.

    `Camera("brown_conrady", width_px=640, height_px=480, fx_px=535.4, fy_px=535.9, cx_px=341.8, cy_px=234.2,
    distortion=[-0.2, 0.1, 0, 0])` takes the keys of camera.toml. Pixels count from the centre of the first one. Raises `Error` for a key that
    the model does not have, and for numbers that no camera has.
    """

    def __new__(cls, model: str, **keys: Any) -> Camera: ...
    @staticmethod
    def from_matrix(
        matrix: ArrayLike,
        distortion: ArrayLike | None = None,
        *,
        image_size_px: tuple[int, int] | None = None,
        fisheye: bool = False,
    ) -> Camera:
        """From OpenCV's `cameraMatrix` (3, 3) and `distCoeffs` (0, 4, 5, 8, 12 or 14; of `cv2.fisheye` 4). Raises `Error` for skew."""

    @staticmethod
    def parse(text: str) -> Camera:
        """From the text of a camera file in any supported format that holds one camera."""

    @staticmethod
    def read(file: str | os.PathLike[str]) -> Camera:
        """From a file in any supported format; `FILE#NAME` picks one of several cameras."""

    @staticmethod
    def read_all(file: str | os.PathLike[str]) -> dict[str, Camera]:
        """All cameras of a file, by name."""

    @staticmethod
    def nominal(
        *,
        image_size_px: tuple[int, int],
        hfov_deg: float | None = None,
        focal_mm: float | None = None,
        sensor_width_mm: float | None = None,
    ) -> Camera:
        """A camera that nobody calibrated, with the covariance that such figures have: every answer is widened by it and says so."""

    @property
    def name(self) -> str:
        """As its file calls it."""

    @property
    def model(self) -> str:
        """`pinhole`, `brown_conrady`, `kannala_brandt`, …"""

    @property
    def image_size_px(self) -> tuple[int, int] | None:
        """Width and height; None where the file states none."""

    @property
    def remark(self) -> str | None:
        """That it is not calibrated, say."""

    @property
    def parameters(self) -> dict[str, float]:
        """Intrinsic parameters by name, with the unit in the name; the order is that of `intrinsics_covariance`."""

    @property
    def distortion(self) -> _Array | None:
        """OpenCV's `distCoeffs` (n,): the coefficients alone, in its order, none of a pinhole; None for a lens model that has no such list."""

    @property
    def matrix(self) -> _Array | None:
        """OpenCV's camera matrix (3, 3), px; None for the photogrammetric model."""

    @property
    def intrinsics_covariance(self) -> _Array | None:
        """Covariance of `parameters`, (n, n); None where they are taken as exact."""

    def project(self, points_in_cam_m: ArrayLike) -> _Array:
        """Pixels (n, 2) of points (n, 3) in the camera frame, metres. Raises `Error` (`outside_field`) for a point that has none."""

    def sees(self, points_in_cam_m: ArrayLike) -> list[bool]:
        """Which of the points (n, 3) in the camera frame, metres, have a pixel by the lens model, whatever the size of the image."""

    def bearings(self, pixels: ArrayLike) -> _Array:
        """Unit vectors (n, 3) in the camera frame towards what is seen at pixels (n, 2). Raises `Error` (`outside_field`)."""

    def undistort(self, image: NDArray[np.uint8], matrix: Sequence[Sequence[float]] | None = None) -> NDArray[np.uint8]:
        """An image (height, width) or (height, width, channels) of uint8 as a pinhole takes it, of the same size; 0 where the lens sees nothing.

        `matrix` (3, 3): the pinhole's, by default this camera's own. Pixels are interpolated bilinearly.
        """

    def to_toml(self) -> str:
        """The camera as a camera.toml."""

@final
class Target:
    """What is looked for in images: points whose places are known.

    `Target("tag", family="tag36h11", id=7, size_m=0.1)` takes the keys of target.toml, lengths in metres. Raises `Error` for a key that the
    kind does not have, and for sizes that no target has.
    """

    def __new__(cls, kind: str, **keys: Any) -> Target: ...
    @staticmethod
    def parse(text: str) -> Target:
        """From the text of a target file: own TOML, Kalibr YAML or WPILib JSON."""

    @staticmethod
    def read(file: str | os.PathLike[str]) -> Target:
        """From a target file: own TOML, Kalibr YAML or WPILib JSON."""

    @property
    def kind(self) -> str:
        """`tag`, `aprilgrid`, `chessboard`, `charuco`, `circle_grid`, `tag_map`, `line_plus_one` or `points`."""

    @property
    def warnings(self) -> list[str]:
        """What is unusual about it, in sentences; every answer repeats them."""

    @property
    def features(self) -> list[tuple[int, int]]:
        """Id and corner of each point, in the order of `points_m`."""

    @property
    def points_m(self) -> _Array:
        """Places of its points in the target frame, (n, 3), metres."""

    def to_toml(self) -> str:
        """The target as a target.toml."""

@final
class Pose:
    """A rigid transform between two named frames: x_in_b = b_from_a @ x_in_a."""

    @staticmethod
    def from_matrix(matrix: ArrayLike, *, b: str = "b", a: str = "a") -> Pose:
        """From a homogeneous matrix (4, 4). Raises `Error` for one that is no rigid transform (to 1e-6)."""

    @staticmethod
    def from_vectors(rotation_vector: ArrayLike, translation_m: ArrayLike, *, b: str = "b", a: str = "a") -> Pose:
        """From OpenCV's `rvec` (axis times angle, radians) and `tvec` (metres), (3,) each."""

    @property
    def b(self) -> str:
        """The frame that it leads to."""

    @property
    def a(self) -> str:
        """The frame that it starts from."""

    @property
    def matrix(self) -> _Array:
        """Homogeneous matrix (4, 4)."""

    @property
    def rotation(self) -> _Array:
        """Rotation matrix (3, 3)."""

    @property
    def translation_m(self) -> _Array:
        """Translation (3,), metres: the origin of frame a seen in frame b."""

    @property
    def rotation_wxyz(self) -> list[float]:
        """Unit quaternion w, x, y, z with w ≥ 0."""

    @property
    def rotation_vector(self) -> _Array:
        """OpenCV's `rvec`: axis times angle, radians, (3,)."""

    def inverse(self) -> Pose:
        """The inverse pose, a_from_b."""

    def __iter__(self) -> Iterator[_Array]:
        """`R, t = pose`: the rotation matrix (3, 3) and the translation (3,), metres."""

    def __eq__(self, value: object, /) -> bool: ...
    def __hash__(self) -> int: ...

    def __matmul__(self, value: Any, /) -> Any:
        """`c_from_b @ b_from_a` is the pose c_from_a; `b_from_a @ points` (n, 3) are the points in b. Raises `Error` where frames differ."""

    def __rmatmul__(self, value: Any, /) -> Any: ...

@final
class PoseAnswer:
    """The answer about one view: status and sentence, and the pose where there is one."""

    @property
    def status(self) -> str:
        """`ok`, `ambiguous`, `inconsistent`, `implausible`, `degenerate`, `not_found` or `error`; only `ok` may be used unseen."""

    @property
    def message(self) -> str:
        """Why, with the numbers seen and needed."""

    @property
    def view(self) -> str:
        """Name of the image or view."""

    @property
    def remarks(self) -> list[str]:
        """What is unusual about the input."""

    @property
    def method(self) -> str | None:
        """The solver that answered."""

    @property
    def n_points(self) -> int:
        """How many points were used."""

    @property
    def cam_from_target(self) -> Pose | None:
        """The most probable pose; None where there is none."""

    @property
    def target_from_cam(self) -> Pose | None:
        """Its inverse: the camera's place in the target frame."""

    @property
    def covariance(self) -> _Array | None:
        """Covariance (6, 6) of the small left motion `[rotation_rad; translation_m]` of `cam_from_target`, camera frame."""

    @property
    def sigma_rad(self) -> _Array | None:
        """Standard deviations of the camera's rotation about its axes, (3,), radians."""

    @property
    def sigma_m(self) -> _Array | None:
        """Standard deviations of the camera's place along its axes, (3,), metres."""

    @property
    def sigma_translation_m(self) -> _Array | None:
        """Standard deviations of `cam_from_target.translation_m` itself, (3,), metres: a rotation of the camera changes it too."""

    @property
    def budget(self) -> list[dict[str, Any]] | None:
        """The parts of `covariance` by the sources of the errors, objects with `part`, `sigma_rad`, `sigma_m`, `share` of the position's variance and `covariance`; None where there are none."""

    @property
    def probability(self) -> float | None:
        """Of this pose among all that were found."""

    @property
    def rms_px(self) -> float | None:
        """Root mean square reprojection error over points."""

    @property
    def chi2(self) -> float | None:
        """Sum of squared residuals over their variances."""

    @property
    def degrees_of_freedom(self) -> int | None:
        """Of `chi2`: two for each point, less six."""

    @property
    def other_cam_from_target(self) -> Pose | None:
        """The other pose that fits as well, where the answer is ambiguous."""

    @property
    def minima(self) -> _Array:
        """Every minimum as a homogeneous matrix, (k, 4, 4), the answer first."""

    @staticmethod
    def from_json(line: str) -> PoseAnswer:
        """From the line that the program prints with `--json`, or that `to_json` gave. Raises `Error` for any other text."""

    def to_dict(self) -> dict[str, Any]:
        """The JSON object of the program's `--json` as plain Python values."""

    def to_json(self) -> str:
        """The line that the program prints with `--json`."""

    def __eq__(self, value: object, /) -> bool: ...
    def __hash__(self) -> int: ...

@final
class Monitor:
    @staticmethod
    def learned(
        times_s: ArrayLike, cam_from_target: ArrayLike, covariance: ArrayLike, alarms: dict[str, float], names: tuple[str, str]
    ) -> Monitor: ...
    @staticmethod
    def read(file: str, t_s: float, alarms: dict[str, float], names: tuple[str, str]) -> Monitor: ...
    def push(self, t_s: float, pose: Any, covariance: ArrayLike | None) -> str: ...
    def state(self, t_s: float) -> str: ...
    def accept(self) -> None: ...
    def detectable(self, within_s: float) -> tuple[list[float], list[float]] | None: ...
    @property
    def reference(self) -> Pose: ...
    @property
    def covariance(self) -> _Array: ...
    def to_toml(self) -> str: ...

@final
class Table:
    """Answers as columns, by the Arrow PyCapsule interface."""

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object: ...
    @property
    def column_names(self) -> list[str]:
        """Names of its columns, in their order."""

    def column(self, name: str) -> Any:
        """A column: an array of doubles with NaN where there is no number, or a list of text with None where there is none."""

    def __len__(self) -> int: ...

@final
class Poses:
    """Poses of many views, cam_from_target, as arrays. Rows of views without a pose are zero, and their status says why."""

    def __len__(self) -> int: ...
    @property
    def cam_from_target(self) -> _Array:
        """Homogeneous matrices, (n, 4, 4)."""

    @property
    def covariance(self) -> _Array:
        """Covariances of `[rotation_rad; translation_m]`, camera frame, (n, 6, 6)."""

    @property
    def probability(self) -> _Array:
        """Of each pose among all that were found, (n,)."""

    @property
    def chi2(self) -> _Array:
        """Sums of squared residuals over their variances, (n,)."""

    @property
    def rms_px(self) -> _Array:
        """Root mean square reprojection errors, (n,)."""

    @property
    def status(self) -> list[str]:
        """Of each view, as of `PoseAnswer`."""

    @property
    def is_ok(self) -> NDArray[np.bool_]:
        """Which views are `ok`, (n,)."""

    def error(self, view: int) -> str | None:
        """Why a view has no pose; None where it has one."""

def solve(
    points_m: ArrayLike,
    pixels: ArrayLike,
    camera: Camera,
    *,
    sigma_px: ArrayLike | None = None,
    sigma_m: ArrayLike | None = None,
    method: str = "auto",
    gravity: tuple[Sequence[float], Sequence[float], float] | None = None,
    robust_threshold_px: float | None = None,
    names: Sequence[str] | None = None,
    view: str = "",
) -> PoseAnswer:
    """The pose of a camera from points (n, 3) in the target frame, metres, and their pixels (n, 2).

    `sigma_px` (0.5 where not given) and `sigma_m` (0: exact): standard deviations, one for all or (n,). `gravity`: down in the target frame,
    down in the camera frame, and the standard deviation of the angle between them, degrees. `robust_threshold_px`: how far off a point may be
    to agree, where some are wrong. `names`: what points are called in messages. Points whose pixel is NaN or masked were not seen and are left
    out, which a remark says. Points that determine no pose are no exception: the answer's status and message say so. Raises `Error` for arrays
    of another shape or kind and for pixels outside the lens's field.
    """

def solve_many(
    points_m: ArrayLike,
    pixels: ArrayLike,
    camera: Camera,
    *,
    offsets: Sequence[int] | None = None,
    sigma_px: float = 0.5,
    progress: _Progress = None,
) -> Poses:
    """Poses of many views by one camera, three and four points on the vector kernel.

    `pixels` (n, k, 2), `points_m` (k, 3) for all views or (n, k, 3). With `offsets` (n + 1 of them) `points_m` (m, 3) and `pixels` (m, 2) are
    the views one after another. Points whose pixel is NaN or masked were not seen. Where the points are hardly in metres the status is
    `implausible`. C-contiguous float64 arrays are read where they are; the answers take 0.5 kB a view, so tens of millions are given in parts.
    Raises `Error` for a camera whose intrinsics are uncertain: the kernel takes them as exact.
    """

def solve_table(
    file: str | os.PathLike[str],
    camera: Camera | None,
    *,
    sigma_px: float | None = None,
    method: str = "auto",
    robust_threshold_px: float | None = None,
    image_size_px: tuple[int, int] | None = None,
    progress: _Progress = None,
) -> list[PoseAnswer]:
    """The poses of a CSV file of points as `resight solve` reads it, one a view.

    Without a camera the focal length is estimated with each pose, for which the size of the image is needed.
    """

def solve_lines(
    file: str, camera: Camera | None, sigma_px: float | None, image_size_px: tuple[int, int] | None
) -> list[str]: ...
def table(answers: Sequence[PoseAnswer] | Poses) -> Table:
    """Answers as a table, one row each: for `pandas.DataFrame.from_arrow`, `polars.DataFrame`, `pyarrow.table`.

    Columns: view, status, message, n_points; null where there is no pose: rotation_wxyz and translation_m of cam_from_target, covariance (36
    numbers, row by row), probability, rms_px, chi2.
    """

def locate_image(
    image: _Image,
    camera: Camera | None,
    target: Target,
    *,
    method: str = "auto",
    corner_half_px: int | None = None,
    view: str = "image",
) -> PoseAnswer:
    """The pose of a camera from an image of a target.

    `image`: a path, the bytes of a PNG or JPEG, or an array (height, width) or (height, width, channels) of uint8, called `view` in the answer;
    colours may be in the order of OpenCV or of anybody else. Without a camera its focal length is estimated with the pose.
    """

def locate_images(
    images: Sequence[_Image],
    camera: Camera | None,
    target: Target,
    *,
    method: str = "auto",
    corner_half_px: int | None = None,
    progress: _Progress = None,
) -> list[PoseAnswer]:
    """The same for many images on all cores, answers in their order. `progress(done, total)` is called after each; Ctrl-C ends the work."""

def detect(
    image: _Image,
    target: Target | None = None,
    *,
    family: str | None = None,
    corner_half_px: int | None = None,
    view: str = "image",
) -> str: ...

_Named: TypeAlias = list[tuple[str | None, Any]]
_Taken: TypeAlias = list[tuple[str, str | None, str | None, Any]]
_Detected: TypeAlias = list[str] | dict[str, Any]

def rig_from_images(
    cameras: _Named,
    targets: _Named,
    images: _Taken,
    solving: dict[str, Any],
    timestamps: str | None,
    corner_half_px: int | None,
    progress: Any,
) -> list[str]: ...
def rig_from_detections(
    cameras: _Named, targets: _Named, detections: _Detected, sigma_px: float | None, solving: dict[str, Any]
) -> list[str]: ...
def map_tags(
    camera: Camera,
    images: _Taken,
    detections: str | None,
    known: Target | None,
    mapping: dict[str, Any],
    progress: Any,
) -> list[str]: ...
def pose_graph(
    file: str,
    cameras: _Named,
    reference: str | None,
    is_chain: bool,
    sigmas: tuple[float, float] | None,
    joint_covariance: bool,
) -> list[str]: ...
def intrinsics(
    targets: _Named,
    images: _Taken,
    detections: _Detected | None,
    image_size_px: tuple[int, int] | None,
    sigma_px: float | None,
    model: str,
    progress: Any,
) -> list[str]: ...
def check_intrinsics(
    cameras: _Named,
    targets: _Named,
    images: _Taken,
    detections: _Detected | None,
    image_size_px: tuple[int, int] | None,
    sigma_px: float | None,
    progress: Any,
) -> list[str]: ...
def hand_eye_of_poses(
    motions: str | tuple[list[int], list[float]] | tuple[str] | list[tuple[str, list[float]]],
    poses: str | list[tuple[str, PoseAnswer]] | list[tuple[str, list[float], list[float]]] | None,
    robot: dict[str, Any],
) -> list[str]: ...
def hand_eye(
    motions: str | tuple[list[int], list[float]] | tuple[str] | list[tuple[str, list[float]]],
    cameras: _Named,
    targets: _Named,
    images: _Taken,
    detections: _Detected | None,
    sigma_px: float | None,
    solving: dict[str, Any],
    robot: dict[str, Any],
    progress: Any,
) -> list[str]: ...
def rig_pose(points: str, rig: str, sigma_px: float, robust_threshold_px: float | None) -> list[str]: ...
def advise_points(
    camera: Camera,
    file: str,
    sigma_px: float,
    pose: str | None,
    candidates: str | None,
    ground_z_m: float,
    region_m: tuple[float, float, float, float] | None,
    length_m: tuple[float, float, float, float] | None,
) -> list[str]: ...
def advise_target(
    camera: Camera,
    given: Target,
    distance_m: tuple[float, float],
    tilt_deg: tuple[float, float],
    direction_deg: tuple[float, float],
    sigma_px: float,
) -> list[str]: ...
def advise_boards(
    rig: str,
    given: Target,
    distance_m: tuple[float, float],
    views: str | None,
    reference: str | None,
    n_boards: int,
    sigma_px: float,
) -> list[str]: ...
def compare(before: str, after: str, alpha: float, sigmas: tuple[float, float] | None) -> list[str]: ...
def measure(scene: str) -> list[str]: ...
def explain(file: str) -> list[str]: ...
def panic_on_purpose(on_own_thread: bool) -> None: ...
def schema() -> str: ...
def write_atomically(path: str | os.PathLike[str], text: str) -> None: ...
def main(arguments: list[str]) -> int: ...

@final
class Cameras:
    """The cameras of a fleet by name: lenses, the points that each sees, sites. They can be pickled, as for the workers of a cluster."""

    @staticmethod
    def read(file: str | os.PathLike[str], target: Target | None = None) -> Cameras:
        """From a CSV table, a camera file that names several, or a folder of camera files. `target`: the points of cameras that state none."""

    @staticmethod
    def parse(text: str) -> Cameras:
        """From what `to_text` gave."""

    def to_text(self) -> str:
        """Every lens, point and site, to the last bit, for other machines."""

    @property
    def names(self) -> list[str]:
        """Names in column `camera`."""

    @property
    def warnings(self) -> list[str]:
        """What is unusual but not wrong, in sentences."""

    def __len__(self) -> int: ...

@final
class FleetState:
    def __new__(cls, period_s: float = 900.0) -> FleetState: ...
    @staticmethod
    def from_bytes(state: bytes) -> FleetState: ...
    @property
    def period_s(self) -> float: ...
    @property
    def counts(self) -> list[int]: ...
    @property
    def spans_s(self) -> list[tuple[str, tuple[float, float] | None]]: ...
    def add_columns(self, columns: Sequence[tuple[str, Any]]) -> None: ...
    def expect(self, names: Sequence[str]) -> None: ...
    def merge(self, other: FleetState) -> None: ...
    def split(self) -> list[tuple[str, bytes]]: ...
    def to_bytes(self) -> bytes: ...
    def assessed(
        self,
        cameras: Cameras | None,
        span_s: tuple[float, float] | None,
        is_part: bool,
        output: str | os.PathLike[str] | None,
        diurnal_deg: float,
        diurnal_mm: float,
    ) -> list[str]: ...
    def __len__(self) -> int: ...

def solve_views(columns: Sequence[tuple[str, Any]], cameras: Cameras, sigma_px: float) -> Table: ...
def locate_views(columns: Sequence[tuple[str, Any]], images: Sequence[Any], cameras: Cameras, target: Target) -> Table: ...
def fleet_span_s(spans_s: Sequence[tuple[float, float]]) -> tuple[float, float] | None: ...
def batch(
    inputs: Sequence[str],
    cameras: str | os.PathLike[str],
    target: str | os.PathLike[str] | None,
    output: str | os.PathLike[str],
    drift: str | os.PathLike[str] | None,
    sigma_px: float,
    period_s: float,
    threads: int,
    progress: Any,
) -> tuple[str, list[str]]: ...
def fleet_report(
    inputs: Sequence[str],
    cameras: str | os.PathLike[str] | None,
    output: str | os.PathLike[str] | None,
    since: str | os.PathLike[str] | None,
    state: str | os.PathLike[str] | None,
    period_s: float,
    diurnal_deg: float,
    diurnal_mm: float,
) -> list[str]: ...
