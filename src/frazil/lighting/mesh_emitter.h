// A mesh that shines, in world space: places on it by area and brightness.
// Model: triangles chosen by area times the absolute luminance of their factor, places on them even [PBRT4, Section 6.5].
// Units: metres; pdf per steradian.
// Valid: a mesh with area; triangles without any are never chosen.
// Not: textures within a triangle.
#pragma once

#include <span>

#include "frazil/lighting/light.h"

namespace frazil {

class MeshEmitter {
  public:
    // ValueError beginning with the light's path where the mesh has no area.
    explicit MeshEmitter(const Light& light);

    struct Sample {
        V3f to_light;  // from the receiver
        Rgb factor = Rgb(0.0f);
        float pdf = 0.0f;  // 0 = seen from its dark side
    };
    Sample sample(const V3f& position, const V2f& u) const;

    // The factor and the density of sample() for a ray that meets a triangle at distance t; pdf 0 on the dark side.
    Sample at(std::uint32_t triangle, const V3f& direction, float t) const;

    double area() const { return area_; }
    // Mean absolute luminance of the factors, by area.
    float brightness() const { return brightness_; }
    const Box3f& box() const { return box_; }
    bool is_two_sided() const { return is_two_sided_; }

  private:
    struct Triangle {
        V3f corner, edge1, edge2, normal;
        float density;  // of sample() per m²
    };
    std::vector<Triangle> triangles_;
    std::vector<float> cdf_;
    std::shared_ptr<const std::vector<Rgb>> factors_;
    double area_ = 0.0;
    float brightness_ = 0.0f;
    Box3f box_;
    bool is_two_sided_ = false;
};

}  // namespace frazil
