/* Prints every number of every job as its bits, and every JSON: exact ROOT POINTS PIXELS. */
#include <inttypes.h>
#include <resight.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static resight_message message;

static void need(int is_right, const char *what) {
    if (is_right) return;
    fprintf(stderr, "%s: %s\n", what, message.text);
    exit(1);
}

static void numbers(const char *name, const double *x, size_t n) {
    printf("%s", name);
    for (size_t i = 0; i < n; i++) {
        uint64_t bits;
        memcpy(&bits, &x[i], sizeof bits);
        printf(" %016" PRIx64, bits);
    }
    printf("\n");
}

static void print(const char *job, resight_status status, resight_answer *answer, size_t n_residuals) {
    need(answer != NULL, job);
    printf("%s %d %s\n%s\n", job, (int)status, message.text, resight_answer_json(answer));
    for (size_t i = 0; i < resight_answer_n_poses(answer); i++) {
        resight_pose pose;
        need(resight_answer_pose(answer, i, &pose, &message) == RESIGHT_STATUS_OK, "pose");
        numbers("rotation_wxyz", pose.rotation_wxyz, 4);
        numbers("translation_m", pose.translation_m, 3);
        numbers("matrix", pose.matrix, 16);
        numbers("covariance", pose.covariance, 36);
        const double fit[] = {pose.rms_px, pose.chi2};
        numbers("fit", fit, 2);
    }
    size_t n = resight_answer_n_detections(answer);
    resight_detection *found = calloc(n + 1, sizeof *found);
    need(resight_answer_detections(answer, n, found, &message) == RESIGHT_STATUS_OK, "detections");
    for (size_t i = 0; i < n; i++) {
        const double own[] = {found[i].u_px, found[i].v_px, found[i].sigma_px, found[i].lens_sigma_px};
        printf("%" PRIu32 ".%" PRIu32, found[i].id, found[i].corner);
        numbers("", own, 4);
    }
    double *residuals = calloc(2 * n_residuals + 1, sizeof *residuals);
    need(resight_answer_residuals(answer, n_residuals, residuals, &message) == RESIGHT_STATUS_OK, "residuals");
    numbers("residuals", residuals, 2 * n_residuals);
    free(residuals);
    free(found);
    resight_answer_free(answer);
}

static char *in(const char *root, const char *file) {
    static char path[4096];
    snprintf(path, sizeof path, "%s/%s", root, file);
    return path;
}

/* The numbers of a text file. */
static double *read_numbers(const char *path, size_t *n) {
    FILE *file = fopen(path, "r");
    need(file != NULL, path);
    double *x = NULL;
    for (*n = 0;; ++*n) {
        x = realloc(x, (*n + 1) * sizeof *x);
        if (fscanf(file, "%lf", &x[*n]) != 1) break;
    }
    fclose(file);
    return x;
}

/* Rows of x, y, z, u, v, sigma_px, sigma_m, camera. */
static resight_points points_of(const double *rows, size_t n, size_t *cameras) {
    double *points_m = calloc(3 * n, sizeof *points_m), *pixels = calloc(2 * n, sizeof *pixels);
    double *sigma_px = calloc(n, sizeof *sigma_px), *sigma_m = calloc(n, sizeof *sigma_m);
    for (size_t i = 0; i < n; i++) {
        memcpy(&points_m[3 * i], &rows[8 * i], 3 * sizeof *rows);
        memcpy(&pixels[2 * i], &rows[8 * i + 3], 2 * sizeof *rows);
        sigma_px[i] = rows[8 * i + 5];
        sigma_m[i] = rows[8 * i + 6];
        cameras[i] = (size_t)rows[8 * i + 7];
    }
    return (resight_points){n, points_m, pixels, sigma_px, sigma_m, 0.0, "view"};
}

static void free_points(resight_points *points) {
    free((void *)points->points_m);
    free((void *)points->pixels);
    free((void *)points->sigma_px);
    free((void *)points->sigma_m);
}

static void solve(const char *root, const char *table) {
    resight_camera *camera = NULL, *parsed = NULL, *of_numbers = NULL;
    need(resight_camera_read(in(root, "examples/photo/left.yml"), &camera, &message) == RESIGHT_STATUS_OK, "camera");
    const char *text = "model = 'pinhole'\nfx_px = 530.0\nfy_px = 531.0\ncx_px = 319.5\ncy_px = 239.5\n"
                       "width_px = 640\nheight_px = 480\nintrinsics_sigma = { fx_px = 2.0, fy_px = 2.0 }\n";
    need(resight_camera_parse(text, NULL, &parsed, &message) == RESIGHT_STATUS_OK, "parsed");
    const double distortion[] = {-0.28, 0.07, 1e-4, -2e-4};
    const resight_intrinsics intrinsics = {530.0, 531.0, 319.5, 239.5, distortion, 4, 0, 640, 480};
    need(resight_camera_of_intrinsics(&intrinsics, &of_numbers, &message) == RESIGHT_STATUS_OK, "numbers");
    size_t n;
    double *rows = read_numbers(table, &n);
    size_t *cameras = calloc(n, sizeof *cameras);
    resight_points points = points_of(rows, n / 8, cameras);
    resight_camera *all[] = {camera, parsed, of_numbers};
    for (size_t i = 0; i < 3; i++) {
        resight_answer *answer = NULL;
        resight_status status = resight_solve(all[i], &points, &answer, &message);
        print("solve", status, answer, resight_answer_n_poses(answer) != 0 ? points.n : 0);
        resight_camera_free(all[i]);
    }
    free_points(&points);
    free(cameras);
    free(rows);
}

/* From the file, and from memory with a gap after each row. */
static void images(const char *root, const char *pixels_file) {
    resight_camera *camera = NULL;
    resight_target *target = NULL;
    resight_image *image[2] = {NULL, NULL};
    need(resight_camera_read(in(root, "examples/photo/left.yml"), &camera, &message) == RESIGHT_STATUS_OK, "camera");
    need(resight_target_read(in(root, "examples/photo/board.toml"), &target, &message) == RESIGHT_STATUS_OK, "target");
    need(resight_image_read("examples/photo/left03.jpg", &image[0], &message) == RESIGHT_STATUS_OK, "image");
    const size_t width_px = 640, height_px = 480, stride = 656;
    uint8_t *data = malloc(stride * height_px);
    memset(data, 255, stride * height_px);
    FILE *file = fopen(pixels_file, "rb");
    need(file != NULL, pixels_file);
    for (size_t v = 0; v < height_px; v++) need(fread(&data[stride * v], 1, width_px, file) == width_px, "pixels");
    fclose(file);
    const resight_pixels pixels = {data, width_px, height_px, 1, stride, "memory"};
    need(resight_image_of_pixels(&pixels, &image[1], &message) == RESIGHT_STATUS_OK, "pixels");
    free(data);
    for (size_t i = 0; i < 2; i++) {
        resight_answer *answer = NULL;
        resight_status status = resight_locate(camera, target, image[i], &answer, &message);
        print("locate", status, answer, 0);
        status = resight_detect(target, image[i], &answer, &message);
        print("detect", status, answer, 0);
        resight_image_free(image[i]);
    }
    resight_target_free(target);
    resight_camera_free(camera);
}

static void rig_pose(const char *root, const char *table) {
    resight_rig *rig = NULL;
    need(resight_rig_read(in(root, "examples/rig/rig.toml"), &rig, &message) == RESIGHT_STATUS_OK, "rig");
    for (size_t i = 0; i < resight_rig_n_cameras(rig); i++) printf("camera %s\n", resight_rig_camera_name(rig, i));
    size_t n;
    double *rows = read_numbers(table, &n);
    size_t *cameras = calloc(n, sizeof *cameras);
    resight_points points = points_of(rows, n / 8, cameras);
    resight_answer *answer = NULL;
    resight_status status = resight_rig_pose(rig, &points, cameras, &answer, &message);
    print("rig_pose", status, answer, 0);
    free_points(&points);
    free(cameras);
    free(rows);
    resight_rig_free(rig);
}

int main(int argc, char **argv) {
    need(argc == 5, "usage: exact ROOT POINTS PIXELS RIG_POINTS, in ROOT");
    solve(argv[1], argv[2]);
    images(argv[1], argv[3]);
    rig_pose(argv[1], argv[4]);
    return 0;
}
