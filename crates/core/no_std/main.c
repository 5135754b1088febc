/* Calls the library from C: four points in, the pose printed, row by row and to the last digit. */
#include <stdbool.h>
#include <stdio.h>

bool resight_locate_four(const double points[4][5], const double pinhole[4], double pose[12]);

/* Named by the tables of Rust's core library; never called, a panic here ends in the library's own handler. */
void rust_eh_personality(void) {}

int main(void) {
    const double points[4][5] = {
        {0.0, 0.0, 0.0, 535.25, 402.5},
        {0.1, 0.0, 0.0, 660.75, 411.0},
        {0.15, 0.0, 0.0, 719.5, 415.25},
        {0.0, 0.15, 0.0, 529.0, 590.5},
    };
    const double pinhole[4] = {1000.0, 1000.0, 639.5, 479.5};
    double pose[12];
    if (!resight_locate_four(points, pinhole, pose)) {
        return 1;
    }
    for (int i = 0; i < 12; i++) {
        printf("%.17g\n", pose[i]);
    }
    return 0;
}
