// Cameras as UsdGeomCamera defines them.
// Model: looks along -z of its frame, +y up; aperture, offsets and focal length in the same unit (tenths of a scene
// unit
//   in USD; only ratios count), clipping in metres.
// Units: metres.
// Valid: perspective and orthographic.
// Not: depth of field, motion.
#pragma once

#include <string>

#include "frazil/base/vec.h"
#include "frazil/geometry/ray_scene.h"

namespace frazil {

struct Camera {
    std::string path;
    M44f camera_to_world;
    bool is_orthographic = false;
    float focal_length = 50.0f;
    float horizontal_aperture = 20.955f, vertical_aperture = 15.2908f;
    float horizontal_offset = 0.0f, vertical_offset = 0.0f;
    // For an orthographic camera: metres per unit of aperture.
    float aperture_scale = 1.0f;
    V2f clipping = V2f(1e-4f, 1e12f);
};

// Refuse apertures, focal lengths and clipping out of range: ValueError beginning with the camera's path.
void check_camera(const Camera& camera);

// What a pixel sees: a cone of this radius at the camera, growing by `spread` per metre.
struct PixelCone {
    float radius = 0.0f, spread = 0.0f;
};
PixelCone pixel_cone(const Camera& camera, int width, int height);

// Where a place in the camera's frame is in the image, as camera_ray has it; false where it is not in front of the camera.
bool image_position(const Camera& camera, const V3f& local, float aspect, V2f& image);

// The ray through (x, y) in [0,1]² of the image, (0,0) its upper left corner; `aspect` = width / height of the image in
// square pixels. The aperture is conformed to the aspect by expanding it (USD's expandAperture).
Ray camera_ray(const Camera& camera, float x, float y, float aspect);

}  // namespace frazil
