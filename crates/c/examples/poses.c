/* Four points to a pose, and a photograph to a pose. Run in the root of the repository. */
#include <math.h>
#include <resight.h>
#include <stdio.h>

/* The standard deviations of the camera's position along its own axes are in the covariance's last three rows. */
static void print_pose(const char *job, const resight_answer *answer) {
    for (size_t i = 0; i < resight_answer_n_poses(answer); i++) {
        resight_pose pose;
        resight_answer_pose(answer, i, &pose, NULL);
        printf("%s: cam_from_target, probability %.3f, rms %.3f px\n", job, pose.probability, pose.rms_px);
        for (size_t k = 0; k < 3; k++) {
            const double *row = &pose.matrix[4 * k];
            double sigma_m = sqrt(pose.covariance[7 * (k + 3)]);
            printf("  %+.5f %+.5f %+.5f  %+.5f m ± %.5f m\n", row[0], row[1], row[2], row[3], sigma_m);
        }
    }
}

static resight_status four_points(resight_message *message) {
    const double points_m[] = {0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.15, 0.0, 0.0, 0.0, 0.15, 0.0};
    const double pixels[] = {535.25, 402.5, 660.75, 411.0, 719.5, 415.25, 529.0, 590.5};
    const resight_points points = {.n = 4, .points_m = points_m, .pixels = pixels};
    const resight_intrinsics intrinsics = {
        .fx_px = 1000.0, .fy_px = 1000.0, .cx_px = 639.5, .cy_px = 479.5, .width_px = 1280, .height_px = 960};
    resight_camera *camera = NULL;
    resight_answer *answer = NULL;
    resight_status status = resight_camera_of_intrinsics(&intrinsics, &camera, message);
    if (status == RESIGHT_STATUS_OK) {
        status = resight_solve(camera, &points, &answer, message);
        print_pose("four points", answer);
    }
    resight_answer_free(answer);
    resight_camera_free(camera);
    return status;
}

static resight_status photograph(resight_message *message) {
    resight_camera *camera = NULL;
    resight_target *target = NULL;
    resight_image *image = NULL;
    resight_answer *answer = NULL;
    resight_status status = resight_camera_read("examples/photo/left.yml", &camera, message);
    if (status == RESIGHT_STATUS_OK) status = resight_target_read("examples/photo/board.toml", &target, message);
    if (status == RESIGHT_STATUS_OK) status = resight_image_read("examples/photo/left03.jpg", &image, message);
    if (status == RESIGHT_STATUS_OK) status = resight_locate(camera, target, image, &answer, message);
    print_pose("photograph", answer);
    resight_answer_free(answer);
    resight_image_free(image);
    resight_target_free(target);
    resight_camera_free(camera);
    return status;
}

int main(void) {
    resight_message message;
    printf("Resight %s\n", resight_version());
    resight_status points = four_points(&message);
    printf("status %d: %s\n", (int)points, message.text);
    resight_status photo = photograph(&message);
    printf("status %d: %s\n", (int)photo, message.text);
    return points == RESIGHT_STATUS_OK && photo == RESIGHT_STATUS_OK ? 0 : 1;
}
