/* Calls everything with what is no argument, and prints how each call ends: "NAME STATUS MESSAGE". Run in the root of the repository. */
#include <math.h>
#include <resight.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static resight_message message;
static resight_camera *camera;
static resight_target *target;
static resight_image *image;
static resight_answer *answer;

static void ended(const char *name, resight_status status) {
    printf("%s %d %s\n", name, (int)status, message.text);
    resight_answer_free(answer);
    answer = NULL;
}

static const double points_m[] = {0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.15, 0.0, 0.0, 0.0, 0.15, 0.0};
static const double pixels[] = {535.25, 402.5, 660.75, 411.0, 719.5, 415.25, 529.0, 590.5};

static void solved(const char *name, resight_points points) {
    ended(name, resight_solve(camera, &points, &answer, &message));
}

static void points_that_are_none(void) {
    const resight_points good = {4, points_m, pixels, NULL, NULL, 0.0, NULL};
    resight_points bad = good;
    solved("good", good);
    bad.points_m = NULL;
    solved("null_points", bad);
    bad = good, bad.pixels = NULL;
    solved("null_pixels", bad);
    char shifted[sizeof pixels + 1];
    memcpy(shifted + 1, pixels, sizeof pixels);
    bad = good, bad.pixels = (const double *)(const void *)(shifted + 1);
    solved("misaligned", bad);
    bad = good, bad.n = SIZE_MAX;
    solved("huge", bad);
    bad = good, bad.n = SIZE_MAX / 24 + 1;
    solved("overflow", bad);
    bad = good, bad.n = 0, bad.points_m = NULL, bad.pixels = NULL;
    solved("none", bad);
    bad = good, bad.n = 2;
    solved("two", bad);
    bad = good, bad.view = "\xff\xfe";
    solved("view_not_utf8", bad);
    const double bad_sigma[][4] = {{0.5, NAN, 0.5, 0.5}, {0.5, 0.5, -1.0, 0.5}, {0.0, 0.5, 0.5, 0.5}, {0.5, 0.5, 0.5, INFINITY}};
    for (size_t i = 0; i < 4; i++) {
        bad = good, bad.sigma_px = bad_sigma[i];
        solved("sigma_px", bad);
        if (bad_sigma[i][0] == 0.0) continue; // An exact point.
        bad = good, bad.sigma_m = bad_sigma[i];
        solved("sigma_m", bad);
    }
    const double thresholds[] = {NAN, -1.0, INFINITY};
    for (size_t i = 0; i < 3; i++) {
        bad = good, bad.robust_threshold_px = thresholds[i];
        solved("robust", bad);
    }
    double copy[12];
    const double values[] = {NAN, INFINITY, 1e300, -1e300};
    for (size_t i = 0; i < 4; i++) {
        memcpy(copy, points_m, sizeof points_m);
        copy[4] = values[i];
        bad = good, bad.points_m = copy;
        solved("point", bad);
        memcpy(copy, pixels, sizeof pixels);
        copy[3] = values[i];
        bad = good, bad.pixels = copy;
        solved("pixel", bad);
    }
}

static void handles_that_are_none(void) {
    const resight_points points = {4, points_m, pixels, NULL, NULL, 0.0, NULL};
    ended("solve_no_camera", resight_solve(NULL, &points, &answer, &message));
    ended("solve_no_points", resight_solve(camera, NULL, &answer, &message));
    ended("solve_no_answer", resight_solve(camera, &points, NULL, &message));
    ended("solve_misaligned", resight_solve((resight_camera *)((char *)camera + 1), &points, &answer, &message));
    ended("detect_no_target", resight_detect(NULL, image, &answer, &message));
    ended("locate_no_image", resight_locate(camera, target, NULL, &answer, &message));
    ended("rig_no_rig", resight_rig_pose(NULL, &points, NULL, &answer, &message));
    memset(&message, 'x', sizeof message);
    if (resight_solve(NULL, &points, &answer, NULL) != RESIGHT_STATUS_INVALID_ARGUMENT) exit(1);
    if (message.text[0] != 'x') exit(1);
    if (resight_answer_json(NULL) || resight_answer_n_poses(NULL) || resight_answer_n_detections(NULL)) exit(1);
    if (resight_rig_n_cameras(NULL) || resight_rig_camera_name(NULL, 0)) exit(1);
    resight_pose pose;
    ended("pose_of_none", resight_answer_pose(NULL, 0, &pose, &message));
    if (resight_solve(camera, &points, &answer, &message) != RESIGHT_STATUS_OK) exit(1);
    resight_answer *kept = answer;
    answer = NULL;
    ended("pose_beyond", resight_answer_pose(kept, 1, &pose, &message));
    ended("pose_nowhere", resight_answer_pose(kept, 0, NULL, &message));
    double residuals[8];
    ended("residuals_few", resight_answer_residuals(kept, 3, residuals, &message));
    ended("residuals_nowhere", resight_answer_residuals(kept, 4, NULL, &message));
    ended("detections_many", resight_answer_detections(kept, 1, NULL, &message));
    resight_answer_free(kept);
    resight_answer_free(NULL);
    resight_camera_free(NULL);
    resight_target_free(NULL);
    resight_image_free(NULL);
    resight_rig_free(NULL);
}

static void cameras_that_are_none(void) {
    resight_camera *other = camera;
    ended("camera_file", resight_camera_read("no/such/file.yml", &other, &message));
    if (other != NULL) exit(1);
    ended("camera_null", resight_camera_read(NULL, &other, &message));
    ended("camera_nowhere", resight_camera_read("examples/photo/left.yml", NULL, &message));
    ended("camera_of_target", resight_camera_read("examples/photo/board.toml", &other, &message));
    ended("camera_text", resight_camera_parse("model = 'pinhole'\nfx_px = nan\n", NULL, &other, &message));
    ended("camera_name", resight_camera_parse("%YAML:1.0\n", "left", &other, &message));
    const double distortion[] = {NAN, 0.0, 0.0, 0.0};
    const resight_intrinsics good = {900.0, 900.0, 639.5, 479.5, NULL, 0, 0, 1280, 960};
    resight_intrinsics bad = good;
    bad.fx_px = NAN;
    ended("intrinsics_nan", resight_camera_of_intrinsics(&bad, &other, &message));
    bad = good, bad.height_px = 0;
    ended("intrinsics_size", resight_camera_of_intrinsics(&bad, &other, &message));
    bad = good, bad.distortion = distortion, bad.n_distortion = 4;
    ended("distortion_nan", resight_camera_of_intrinsics(&bad, &other, &message));
    bad.n_distortion = 3;
    ended("distortion_3", resight_camera_of_intrinsics(&bad, &other, &message));
    bad.distortion = NULL;
    ended("distortion_null", resight_camera_of_intrinsics(&bad, &other, &message));
    bad.n_distortion = SIZE_MAX, bad.distortion = distortion;
    ended("distortion_huge", resight_camera_of_intrinsics(&bad, &other, &message));
    if (other != NULL) exit(1);
}

static void images_that_are_none(void) {
    static uint8_t data[64 * 48];
    resight_image *other = NULL;
    const resight_pixels good = {data, 64, 48, 1, 0, NULL};
    resight_pixels bad = good;
    ended("image_file", resight_image_read("Cargo.toml", &other, &message));
    bad.data = NULL;
    ended("pixels_null", resight_image_of_pixels(&bad, &other, &message));
    bad = good, bad.width_px = 0;
    ended("pixels_no_column", resight_image_of_pixels(&bad, &other, &message));
    bad = good, bad.height_px = 0;
    ended("pixels_no_row", resight_image_of_pixels(&bad, &other, &message));
    bad = good, bad.n_channels = 2;
    ended("pixels_channels", resight_image_of_pixels(&bad, &other, &message));
    bad = good, bad.n_channels = 0;
    ended("pixels_no_channel", resight_image_of_pixels(&bad, &other, &message));
    bad = good, bad.stride_bytes = 63;
    ended("pixels_stride", resight_image_of_pixels(&bad, &other, &message));
    bad = good, bad.width_px = SIZE_MAX;
    ended("pixels_width", resight_image_of_pixels(&bad, &other, &message));
    bad = good, bad.height_px = SIZE_MAX / 2, bad.stride_bytes = 64;
    ended("pixels_height", resight_image_of_pixels(&bad, &other, &message));
    bad = good, bad.stride_bytes = SIZE_MAX;
    ended("pixels_stride_huge", resight_image_of_pixels(&bad, &other, &message));
    if (other != NULL) exit(1);
    if (resight_image_of_pixels(&good, &other, &message) != RESIGHT_STATUS_OK) exit(1);
    ended("locate_small", resight_locate(camera, target, other, &answer, &message));
    ended("detect_empty", resight_detect(target, other, &answer, &message));
    resight_image_free(other);
    resight_target *points = NULL;
    ended("target_file", resight_target_read("Cargo.toml", &points, &message));
    ended("target_text", resight_target_parse("kind = 'tag'\n", &points, &message));
    if (points != NULL) exit(1);
}

static void rigs_that_are_none(void) {
    resight_rig *rig = NULL;
    ended("rig_file", resight_rig_read("examples/photo/board.toml", &rig, &message));
    if (rig != NULL || resight_rig_read("examples/rig/rig.toml", &rig, &message) != RESIGHT_STATUS_OK) exit(1);
    resight_points points = {4, points_m, pixels, NULL, NULL, 0.0, NULL};
    const size_t cameras[] = {0, 1, 7, 0}, fine[] = {0, 0, 0, 0};
    ended("rig_camera", resight_rig_pose(rig, &points, cameras, &answer, &message));
    ended("rig_cameras", resight_rig_pose(rig, &points, NULL, &answer, &message));
    double unseen[8];
    memcpy(unseen, pixels, sizeof pixels);
    unseen[2] = NAN;
    points.pixels = unseen;
    ended("rig_nan", resight_rig_pose(rig, &points, fine, &answer, &message));
    if (resight_rig_camera_name(rig, resight_rig_n_cameras(rig)) != NULL) exit(1);
    resight_rig_free(rig);
}

int main(void) {
    if (resight_camera_read("examples/marks/camera.toml", &camera, &message) != RESIGHT_STATUS_OK) return 1;
    if (resight_target_read("examples/photo/board.toml", &target, &message) != RESIGHT_STATUS_OK) return 1;
    if (resight_image_read("examples/photo/left03.jpg", &image, &message) != RESIGHT_STATUS_OK) return 1;
    points_that_are_none();
    handles_that_are_none();
    cameras_that_are_none();
    images_that_are_none();
    rigs_that_are_none();
    resight_image_free(image);
    resight_target_free(target);
    resight_camera_free(camera);
    return 0;
}
