// Four points to a pose, and a photograph to a pose. Run in the root of the repository.
#include <array>
#include <cstdio>
#include <memory>
#include <resight.h>
#include <stdexcept>

template <auto free_handle> struct Free {
    template <typename T> void operator()(T *handle) const { free_handle(handle); }
};
using Camera = std::unique_ptr<resight_camera, Free<resight_camera_free>>;
using Target = std::unique_ptr<resight_target, Free<resight_target_free>>;
using Image = std::unique_ptr<resight_image, Free<resight_image_free>>;
using Answer = std::unique_ptr<resight_answer, Free<resight_answer_free>>;

// Calls a function that makes a handle: where there is none, the message says why.
template <typename Handle, typename Function, typename... Arguments>
Handle made(Function function, Arguments... arguments) {
    typename Handle::pointer handle = nullptr;
    resight_message message;
    function(arguments..., &handle, &message);
    if (handle == nullptr) throw std::runtime_error(message.text);
    return Handle(handle);
}

static void print_pose(const char *job, const Answer &answer) {
    resight_pose pose;
    resight_message message;
    if (resight_answer_pose(answer.get(), 0, &pose, &message) != RESIGHT_STATUS_OK) throw std::runtime_error(message.text);
    const double *t = pose.translation_m;
    std::printf("%s: target at %+.5f %+.5f %+.5f m in the camera's frame\n", job, t[0], t[1], t[2]);
    std::printf("%.60s…\n", resight_answer_json(answer.get()));
}

int main() try {
    const std::array<double, 12> points_m{0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.15, 0.0, 0.0, 0.0, 0.15, 0.0};
    const std::array<double, 8> pixels{535.25, 402.5, 660.75, 411.0, 719.5, 415.25, 529.0, 590.5};
    resight_points points{};
    points.n = 4;
    points.points_m = points_m.data();
    points.pixels = pixels.data();
    const char *text = "model = 'pinhole'\nwidth_px = 1280\nheight_px = 960\n"
                       "fx_px = 1000.0\nfy_px = 1000.0\ncx_px = 639.5\ncy_px = 479.5\n";
    const auto pinhole = made<Camera>(resight_camera_parse, text, nullptr);
    print_pose("four points", made<Answer>(resight_solve, pinhole.get(), &points));

    const auto camera = made<Camera>(resight_camera_read, "examples/photo/left.yml");
    const auto target = made<Target>(resight_target_read, "examples/photo/board.toml");
    const auto image = made<Image>(resight_image_read, "examples/photo/left03.jpg");
    print_pose("photograph", made<Answer>(resight_locate, camera.get(), target.get(), image.get()));
    return 0;
} catch (const std::exception &reason) {
    std::fprintf(stderr, "%s\n", reason.what());
    return 1;
}
