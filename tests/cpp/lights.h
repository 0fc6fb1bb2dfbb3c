// Lights that several tests shine, and the irradiance that they give to one point.
#pragma once

#include "frazil/lighting/irradiance.h"

namespace frazil::test {

inline constexpr double kPiD = 3.14159265358979323846;

inline Light make_light(LightShape shape, const M44f& matrix = M44f()) {
    Light light;
    light.path = "/light";
    light.shape = std::move(shape);
    light.light_to_world = matrix;
    return light;
}

inline M44f translated(const V3f& t) {
    M44f m;
    m.setTranslation(t);
    return m;
}

inline PointSet one_point(const V3f& position, const V3f& normal) {
    PointSet points;
    points.positions = {position};
    points.normals = {normal};
    return points;
}

inline Rgb full(float) {
    return Rgb(1.0f);
}

// A square of half side s in the plane z = height, facing +z.
inline Mesh square(float s, float height) {
    Mesh mesh;
    mesh.positions = {{-s, -s, height}, {s, -s, height}, {s, s, height}, {-s, s, height}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    return mesh;
}

// E at the point (x, 0, 0) facing +z.
inline Rgb irradiance_at(const std::vector<Light>& lights, float x = 0.0f, const RayScene& scene = RayScene({}, {}),
                         IrradianceOptions options = {}) {
    if (options.samples == 64) options.samples = 4096;
    return bake_irradiance(one_point(V3f(x, 0.0f, 0.0f), V3f(0, 0, 1)), scene, LightSampler(lights), full, options)
        .values[0];
}

// Configuration factor from a differential patch to a parallel rectangle with one corner above it.
inline double corner_factor(double a, double b, double c) {
    const double x = a / c, y = b / c;
    return (x / std::sqrt(1 + x * x) * std::atan(y / std::sqrt(1 + x * x)) +
            y / std::sqrt(1 + y * y) * std::atan(x / std::sqrt(1 + y * y))) /
           (2 * kPiD);
}

}  // namespace frazil::test
