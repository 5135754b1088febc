/* Resight for C and C++: poses of cameras from points and images, with their uncertainty. docs/c.md shows how it is used.
 * Generated from crates/c/src by cbindgen: change the comments there.
 *
 * Lengths are metres, angles radians, image coordinates pixels: (0, 0) is the centre of the top-left pixel. Matrices and arrays are row by row.
 * Texts are UTF-8 and end with a zero. Structures of arguments may be set to zero and then filled where a value is known.
 *
 * What a caller promises: a pointer is null or points to what its type and its comment say, for as long as the call lasts; a handle comes from this
 * library and is used no more after its _free. Null pointers, misaligned arrays, sizes beyond memory and numbers that are NaN are refused with a
 * status and a message. Each handle is freed by its own _free and nothing else is to be freed: arrays belong to the caller, texts to their handle.
 *
 * A call that makes a handle sets it to null where it fails. There is no global state: threads may call at the same time, and share handles, which do
 * not change; only _free needs the handle for itself. No panic leaves a call: a mistake of the library is RESIGHT_STATUS_INTERNAL. */


#ifndef RESIGHT_H
#define RESIGHT_H

#include <stddef.h>
#include <stdint.h>

/**
 * Size of `resight_message`, bytes.
 */
#define RESIGHT_MESSAGE_SIZE 1024

/**
 * How a call ended. Below 100 there is an answer, and its status is this one, as the program prints it; from 100 on there is none.
 * Use a pose unseen only where the status is RESIGHT_STATUS_OK.
 */
typedef enum resight_status {
  /**
   * One pose, and its residual agrees with the stated noise; for calls without an answer: done.
   */
  RESIGHT_STATUS_OK = 0,
  /**
   * Two poses fit; the answer holds both.
   */
  RESIGHT_STATUS_AMBIGUOUS = 1,
  /**
   * The points do not determine the pose: there is none.
   */
  RESIGHT_STATUS_DEGENERATE = 2,
  /**
   * There is a pose, but its residual is far above the stated noise.
   */
  RESIGHT_STATUS_INCONSISTENT = 3,
  /**
   * The target is not in the image: there is no pose.
   */
  RESIGHT_STATUS_NOT_FOUND = 4,
  /**
   * Several explanations fit.
   */
  RESIGHT_STATUS_UNDECIDED = 5,
  /**
   * No chain of observations joins all cameras.
   */
  RESIGHT_STATUS_NOT_CONNECTED = 6,
  /**
   * The numbers agree, but a stated size or unit hardly exists, such as squares of 25 m.
   */
  RESIGHT_STATUS_IMPLAUSIBLE = 7,
  /**
   * Anything else that kept the answer back.
   */
  RESIGHT_STATUS_ERROR = 8,
  /**
   * An argument that is none: null, misaligned, too large, not UTF-8, or numbers that cannot be.
   */
  RESIGHT_STATUS_INVALID_ARGUMENT = 100,
  /**
   * A file that cannot be read, or holds something else.
   */
  RESIGHT_STATUS_FILE = 101,
  /**
   * A target that cannot be detected in images.
   */
  RESIGHT_STATUS_TARGET = 102,
  /**
   * A request that contradicts itself.
   */
  RESIGHT_STATUS_REQUEST = 103,
  /**
   * A mistake of this library; please report it.
   */
  RESIGHT_STATUS_INTERNAL = 104,
} resight_status;

/**
 * Everything that a job answers. It does not change: threads may share it.
 */
typedef struct resight_answer resight_answer;

/**
 * A lens with its image size, and how well both are known. It does not change: threads may share it.
 */
typedef struct resight_camera resight_camera;

/**
 * Grey levels, and what the image is called in answers. It does not change: threads may share it.
 */
typedef struct resight_image resight_image;

/**
 * Several cameras with known poses in a common frame. It does not change: threads may share it.
 */
typedef struct resight_rig resight_rig;

/**
 * What is looked for in images: points whose positions are known. Threads may share it.
 *
 * The first image without the target is searched for what it shows instead, which its message states; later ones are not.
 */
typedef struct resight_target resight_target;

/**
 * The sentence that a call ends with: what was seen, what is needed, what to do. It is UTF-8 and ends with a zero, empty where nothing is to be
 * said; a longer one ends with "…" (the JSON of an answer holds it whole). Every call takes a null pointer in its place.
 */
typedef struct resight_message {
  /**
   * The sentence.
   */
  char text[RESIGHT_MESSAGE_SIZE];
} resight_message;

/**
 * OpenCV's camera matrix and distortion coefficients.
 */
typedef struct resight_intrinsics {
  /**
   * Focal length in columns, px.
   */
  double fx_px;
  /**
   * Focal length in rows, px.
   */
  double fy_px;
  /**
   * Column of the principal point; pixel (0, 0) is the centre of the top-left pixel.
   */
  double cx_px;
  /**
   * Row of the principal point.
   */
  double cy_px;
  /**
   * Distortion coefficients in OpenCV's order (k1, k2, p1, p2, k3, …); may be null where there are none.
   */
  const double *distortion;
  /**
   * Their number: 0, 4, 5, 8, 12 or 14; of a fisheye 4.
   */
  size_t n_distortion;
  /**
   * 0 for the usual model, anything else for OpenCV's fisheye model.
   */
  int is_fisheye;
  /**
   * Columns of the images, 0 with 0 rows where the size is unknown.
   */
  uint32_t width_px;
  /**
   * Rows of the images.
   */
  uint32_t height_px;
} resight_intrinsics;

/**
 * Pixels in memory, row by row from the top. They are copied.
 */
typedef struct resight_pixels {
  /**
   * The first row.
   */
  const uint8_t *data;
  /**
   * Columns.
   */
  size_t width_px;
  /**
   * Rows.
   */
  size_t height_px;
  /**
   * Values of each pixel: 1 (grey), 3 (RGB or BGR) or 4 (with transparency, which is ignored).
   */
  size_t n_channels;
  /**
   * From the beginning of a row to that of the next; 0 where rows follow each other without a gap.
   */
  size_t stride_bytes;
  /**
   * What the image is called in answers; null for "image".
   */
  const char *view;
} resight_pixels;

/**
 * A rigid transform between two frames with its uncertainty: x_in_b = b_from_a x_in_a. Of resight_solve and resight_locate it is
 * cam_from_target, of resight_rig_pose rig_from_target.
 *
 * Camera frame: x right, y down, z forward; the frame of a rig is its file's, that of the target is that of its points.
 */
typedef struct resight_pose {
  /**
   * Rotation as a unit quaternion w, x, y, z with w not negative.
   */
  double rotation_wxyz[4];
  /**
   * Translation, m: the origin of frame a seen in frame b.
   */
  double translation_m[3];
  /**
   * The homogeneous matrix (4, 4), row by row.
   */
  double matrix[16];
  /**
   * Covariance (6, 6), row by row, of a small motion `[rotation_rad; translation_m]` applied on the left, in frame b: rotations about
   * its x, y, z, rad, then translations along them, m. Units rad², rad m, m².
   */
  double covariance[36];
  /**
   * Root mean square distance of the observed points from the projected ones, px.
   */
  double rms_px;
  /**
   * Sum of squared residuals over their variances.
   */
  double chi2;
  /**
   * Probability that this pose, and no other one, is the right one; NaN of a rig.
   */
  double probability;
} resight_pose;

/**
 * A point found in an image.
 */
typedef struct resight_detection {
  /**
   * Id of the tag, or number of the corner or dot.
   */
  uint32_t id;
  /**
   * Corner of the tag: 0 top-left, 1 top-right, 2 bottom-right, 3 bottom-left; 0 of other points.
   */
  uint32_t corner;
  /**
   * Column; pixel (0, 0) is the centre of the top-left pixel.
   */
  double u_px;
  /**
   * Row.
   */
  double v_px;
  /**
   * Standard deviation of u and of v by the image.
   */
  double sigma_px;
  /**
   * What the lens may do besides, as a standard deviation of u and of v.
   */
  double lens_sigma_px;
} resight_detection;

/**
 * Points in the target frame and where they were seen, row by row.
 */
typedef struct resight_points {
  /**
   * Number of points: rows of each array.
   */
  size_t n;
  /**
   * Positions in the target frame (n, 3), m.
   */
  const double *points_m;
  /**
   * Where they were seen (n, 2), px; pixel (0, 0) is the centre of the top-left pixel. For resight_solve a row of two NaN is a point that was
   * not observed.
   */
  const double *pixels;
  /**
   * Standard deviation of each pixel's u and v (n), px; null: 0.5 px. All image coordinates of a photogrammetric camera are in the unit of its
   * f; null: f / 2000.
   */
  const double *sigma_px;
  /**
   * Standard deviation of each position's x, y and z (n), m; null: exact.
   */
  const double *sigma_m;
  /**
   * Where some points may be wrong, the largest distance of one that agrees with the pose, px; 0 where every point is trusted.
   */
  double robust_threshold_px;
  /**
   * What the points are called in the answer; null for no name.
   */
  const char *view;
} resight_points;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Returns the version of the library, such as "0.1.0". The text is part of the library.
 */
const char *resight_version(void);

/**
 * Reads the camera of a file in any format that the program reads; "FILE#NAME" picks one of several.
 *
 * Gives RESIGHT_STATUS_FILE where the file is missing or wrong: the message names line and key.
 */
enum resight_status resight_camera_read(const char *file,
                                        struct resight_camera **camera,
                                        struct resight_message *message);

/**
 * Reads a camera from the text of a file of any format that the program reads; `name` picks one of several, and is null otherwise.
 */
enum resight_status resight_camera_parse(const char *content,
                                         const char *name,
                                         struct resight_camera **camera,
                                         struct resight_message *message);

/**
 * Makes a camera of OpenCV's numbers, taken as exact. Other lens models and standard deviations: resight_camera_parse.
 *
 * Gives RESIGHT_STATUS_INVALID_ARGUMENT for numbers that no camera has.
 */
enum resight_status resight_camera_of_intrinsics(const struct resight_intrinsics *intrinsics,
                                                 struct resight_camera **camera,
                                                 struct resight_message *message);

/**
 * Frees a camera; null is allowed.
 */
void resight_camera_free(struct resight_camera *camera);

/**
 * Reads the target of a file: Resight's own TOML, Kalibr's YAML or WPILib's JSON.
 *
 * Gives RESIGHT_STATUS_FILE where the file is missing or wrong: the message names line and key.
 */
enum resight_status resight_target_read(const char *file,
                                        struct resight_target **target,
                                        struct resight_message *message);

/**
 * Reads a target from the text of a file of any format that resight_target_read takes.
 */
enum resight_status resight_target_parse(const char *content,
                                         struct resight_target **target,
                                         struct resight_message *message);

/**
 * Frees a target; null is allowed.
 */
void resight_target_free(struct resight_target *target);

/**
 * Reads a PNG or JPEG, by its content. Pixels are taken as they are stored, whatever EXIF says of their orientation.
 */
enum resight_status resight_image_read(const char *file, struct resight_image **image, struct resight_message *message);

/**
 * Copies an image from memory.
 */
enum resight_status resight_image_of_pixels(const struct resight_pixels *pixels,
                                            struct resight_image **image,
                                            struct resight_message *message);

/**
 * Frees an image; null is allowed.
 */
void resight_image_free(struct resight_image *image);

/**
 * Returns the JSON object that the program prints for the job with --json, which holds everything of the answer; null for null. The text
 * lives as long as the answer. Its keys: docs/files.md, and the schema that `resight schema` prints.
 */
const char *resight_answer_json(const struct resight_answer *answer);

/**
 * Returns the number of poses: 0 where there is none, 2 where another one fits about as well; 0 for null.
 */
size_t resight_answer_n_poses(const struct resight_answer *answer);

/**
 * Copies a pose: 0 is the answer, 1 the second pose.
 *
 * Gives RESIGHT_STATUS_INVALID_ARGUMENT where there is no such pose.
 */
enum resight_status resight_answer_pose(const struct resight_answer *answer,
                                        size_t index,
                                        struct resight_pose *pose,
                                        struct resight_message *message);

/**
 * Returns the number of points that resight_detect or resight_locate found in the image; 0 for null.
 */
size_t resight_answer_n_detections(const struct resight_answer *answer);

/**
 * Copies the points that were found into an array of `n`, which is their number: resight_answer_n_detections.
 */
enum resight_status resight_answer_detections(const struct resight_answer *answer,
                                              size_t n,
                                              struct resight_detection *detections,
                                              struct resight_message *message);

/**
 * Copies the residuals of resight_solve, observed less projected pixel, into an array (n, 2), px, n as the points were given. They are NaN for
 * points that were not observed. Other answers, and those without a pose, have none (n = 0).
 */
enum resight_status resight_answer_residuals(const struct resight_answer *answer,
                                             size_t n,
                                             double *residuals_px,
                                             struct resight_message *message);

/**
 * Frees an answer; null is allowed.
 */
void resight_answer_free(struct resight_answer *answer);

/**
 * Solves for the pose of a camera from known points: four are enough, three have several poses.
 *
 * Returns the status of the answer. Gives RESIGHT_STATUS_INVALID_ARGUMENT, and a null answer, where a pixel is outside the field of the lens or
 * half missing. `points` are only read.
 */
enum resight_status resight_solve(const struct resight_camera *camera,
                                  const struct resight_points *points,
                                  struct resight_answer **answer,
                                  struct resight_message *message);

/**
 * Finds the points of a target in an image.
 *
 * Returns the status of the answer. Gives RESIGHT_STATUS_TARGET, and a null answer, for a target that is not detected in images.
 */
enum resight_status resight_detect(const struct resight_target *target,
                                   const struct resight_image *image,
                                   struct resight_answer **answer,
                                   struct resight_message *message);

/**
 * Solves for the pose of a camera from an image of a target: the answer of `resight locate`. Where the image has another size than the
 * camera's, but its aspect ratio, the intrinsics are scaled.
 *
 * Returns the status of the answer. Gives RESIGHT_STATUS_TARGET, and a null answer, for a target that is not detected in images.
 */
enum resight_status resight_locate(const struct resight_camera *camera,
                                   const struct resight_target *target,
                                   const struct resight_image *image,
                                   struct resight_answer **answer,
                                   struct resight_message *message);

/**
 * Reads a rig: a file with several cameras and their poses, as `resight rig -o` writes it, or of another program.
 */
enum resight_status resight_rig_read(const char *file, struct resight_rig **rig, struct resight_message *message);

/**
 * Returns the number of cameras of a rig; 0 for null.
 */
size_t resight_rig_n_cameras(const struct resight_rig *rig);

/**
 * Returns the name of a camera, which lives as long as the rig; null where there is no such camera.
 */
const char *resight_rig_camera_name(const struct resight_rig *rig, size_t index);

/**
 * Solves for the pose of a rig from points that any of its cameras see: the answer of `resight rig-pose`. Three points over all cameras are enough.
 *
 * `cameras` (n) are the indices of the cameras that see the points. Messages name a point by its line: the row, counted from 1. Returns the status of
 * the answer; gives RESIGHT_STATUS_INVALID_ARGUMENT, and a null answer, for a camera that the rig does not have.
 */
enum resight_status resight_rig_pose(const struct resight_rig *rig,
                                     const struct resight_points *points,
                                     const size_t *cameras,
                                     struct resight_answer **answer,
                                     struct resight_message *message);

/**
 * Frees a rig; null is allowed.
 */
void resight_rig_free(struct resight_rig *rig);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* RESIGHT_H */
