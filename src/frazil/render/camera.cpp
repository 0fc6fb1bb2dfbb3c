#include "frazil/render/camera.h"

#include "frazil/base/error.h"

namespace frazil {

void check_camera(const Camera& camera) {
    const auto require = [&](bool holds, const char* rule, float value) {
        if (!holds) throw ValueError(str(camera.path, ": ", rule, ", got ", value, ". Mend the camera's attribute."));
    };
    require(camera.horizontal_aperture > 0.0f, "horizontalAperture must be > 0", camera.horizontal_aperture);
    require(camera.vertical_aperture > 0.0f, "verticalAperture must be > 0", camera.vertical_aperture);
    require(camera.is_orthographic || camera.focal_length > 0.0f, "focalLength must be > 0", camera.focal_length);
    require(camera.clipping.x >= 0.0f, "clippingRange must begin at >= 0", camera.clipping.x);
    require(camera.clipping.y > camera.clipping.x, "clippingRange must end behind its begin", camera.clipping.y);
    const float determinant = camera.camera_to_world.determinant();
    require(std::isfinite(determinant) && determinant != 0.0f, "the transform's determinant must be finite and not 0",
            determinant);
}

namespace {

// The aperture conformed to the image: the side that is too short grows.
V2f conformed_aperture(const Camera& camera, float aspect) {
    const float width = camera.horizontal_aperture, height = camera.vertical_aperture;
    if (width / height < aspect) return {height * aspect, height};
    return {width, width / aspect};
}

}  // namespace

bool image_position(const Camera& camera, const V3f& local, float aspect, V2f& image) {
    if (!(local.z < 0.0f)) return false;
    const V2f aperture = conformed_aperture(camera, aspect);
    const float scale = camera.is_orthographic ? 1.0f / camera.aperture_scale : camera.focal_length / -local.z;
    image.x = 0.5f + (local.x * scale - camera.horizontal_offset) / aperture.x;
    image.y = 0.5f - (local.y * scale - camera.vertical_offset) / aperture.y;
    return true;
}

Ray camera_ray(const Camera& camera, float x, float y, float aspect) {
    const V2f aperture = conformed_aperture(camera, aspect);
    const float film_x = (x - 0.5f) * aperture.x + camera.horizontal_offset;
    const float film_y = (0.5f - y) * aperture.y + camera.vertical_offset;

    V3f origin(0.0f), direction(0.0f, 0.0f, -1.0f);
    if (camera.is_orthographic) {
        origin = V3f(film_x, film_y, 0.0f) * camera.aperture_scale;
    } else {
        direction = V3f(film_x, film_y, -camera.focal_length).normalized();
    }
    // Clipping is along the viewing axis; the scale of the camera's own frame does not count.
    const float along_axis = -direction.z;
    Ray ray;
    camera.camera_to_world.multVecMatrix(origin, ray.origin);
    camera.camera_to_world.multDirMatrix(direction, ray.direction);
    ray.direction.normalize();
    ray.t_min = camera.clipping.x / along_axis;
    ray.t_max = camera.clipping.y / along_axis;
    return ray;
}

PixelCone pixel_cone(const Camera& camera, int width, int height) {
    const float aspect = static_cast<float>(width) / static_cast<float>(height);
    const Ray a = camera_ray(camera, 0.5f, 0.5f, aspect);
    const Ray b = camera_ray(camera, 0.5f + 1.0f / static_cast<float>(width), 0.5f, aspect);
    return {0.5f * (b.origin - a.origin).length(),
            0.5f * (b.direction.normalized() - a.direction.normalized()).length()};
}

}  // namespace frazil
