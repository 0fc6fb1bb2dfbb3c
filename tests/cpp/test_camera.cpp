#include <doctest/doctest.h>

#include "frazil/base/error.h"
#include "frazil/render/camera.h"

using namespace frazil;

namespace {

Camera square_camera() {
    Camera camera;
    camera.path = "/cam";
    camera.focal_length = 50.0f;
    camera.horizontal_aperture = camera.vertical_aperture = 50.0f;
    return camera;
}

}  // namespace

TEST_CASE("the corner ray of a camera follows aperture over focal length") {
    const Ray ray = camera_ray(square_camera(), 1.0f, 0.0f, 1.0f);
    CHECK(ray.direction.x / -ray.direction.z == doctest::Approx(0.5));
    CHECK(ray.direction.y / -ray.direction.z == doctest::Approx(0.5));
    CHECK(ray.direction.length() == doctest::Approx(1.0));
}

TEST_CASE("a wide image grows the horizontal aperture and keeps the vertical one") {
    const Ray ray = camera_ray(square_camera(), 1.0f, 0.0f, 2.0f);
    CHECK(ray.direction.x / -ray.direction.z == doctest::Approx(1.0));
    CHECK(ray.direction.y / -ray.direction.z == doctest::Approx(0.5));
}

TEST_CASE("aperture offsets shift the view, and clipping is along the viewing axis") {
    Camera camera = square_camera();
    camera.horizontal_offset = 25.0f;
    camera.clipping = V2f(2.0f, 10.0f);
    const Ray ray = camera_ray(camera, 0.5f, 0.5f, 1.0f);
    CHECK(ray.direction.x / -ray.direction.z == doctest::Approx(0.5));
    CHECK(ray.t_min * -ray.direction.z == doctest::Approx(2.0));
    CHECK(ray.t_max * -ray.direction.z == doctest::Approx(10.0));
}

TEST_CASE("an orthographic camera has parallel rays, spread by its aperture") {
    Camera camera = square_camera();
    camera.is_orthographic = true;
    camera.aperture_scale = 0.1f;
    const Ray left = camera_ray(camera, 0.0f, 0.5f, 1.0f), right = camera_ray(camera, 1.0f, 0.5f, 1.0f);
    CHECK(left.direction == right.direction);
    CHECK(right.origin.x - left.origin.x == doctest::Approx(5.0));
}

TEST_CASE("cameras out of range are refused by name") {
    Camera camera = square_camera();
    camera.focal_length = 0.0f;
    CHECK_THROWS_WITH_AS(check_camera(camera), doctest::Contains("/cam: focalLength must be > 0"), ValueError);
    camera = square_camera();
    camera.camera_to_world[0][0] = 0.0f;
    CHECK_THROWS_AS(check_camera(camera), ValueError);
}
