#include "frazil/lighting/light.h"

#include "frazil/base/error.h"

namespace frazil {
namespace {

constexpr double kPiD = 3.14159265358979323846;

// Beyond these lengths in the world single precision loses areas and cubes of distances.
constexpr double kLeastLength = 1e-9, kMostLength = 1e9, kFarthest = 1e12;  // metres

// `axes` are rows of the light's transform that the size goes along.
void check_size(const Light& light, const char* field, float value, std::initializer_list<int> axes) {
    if (!(std::isfinite(value) && value > 0.0f)) {
        throw ValueError(str(light.path, ": ", field, " must be > 0 and finite, got ", value,
                             ". A light without a surface gives no light; enlarge it or remove it."));
    }
    for (const int axis : axes) {
        const float* row = light.light_to_world[axis];
        const double length = double(value) * V3d(row[0], row[1], row[2]).length();
        if (length >= kLeastLength && length <= kMostLength) continue;
        throw ValueError(str(light.path, ": ", field, " must be in [", kLeastLength, ", ", kMostLength,
                             "] metres in the world, got ", length, "."));
    }
}

// Whether two axes are equal and at right angles, to the precision of floats.
bool is_round(const V3d& a, const V3d& b) {
    const double length2 = a.dot(a);
    return std::abs(b.dot(b) - length2) < 1e-6 * length2 && std::abs(a.dot(b)) < 1e-6 * length2;
}

// Area of the unit sphere times `radius` moved by the matrix: an ellipsoid. The integral over the unit sphere of
// |det A| |A^-T n|, by the midpoint rule: exact for a sphere, spectral in azimuth.
double ellipsoid_area(double radius, const M44f& m) {
    const V3d x(m[0][0], m[0][1], m[0][2]), y(m[1][0], m[1][1], m[1][2]), z(m[2][0], m[2][1], m[2][2]);
    if (is_round(x, y) && is_round(y, z) && is_round(z, x)) return 4.0 * kPiD * radius * radius * x.dot(x);
    const V3d yz = y.cross(z), zx = z.cross(x), xy = x.cross(y);
    constexpr int kPolar = 128, kAzimuths = 128;
    double sum = 0.0;
    for (int i = 0; i < kPolar; ++i) {
        const double c = (2.0 * i + 1.0) / kPolar - 1.0, s = std::sqrt(1.0 - c * c);
        for (int j = 0; j < kAzimuths; ++j) {
            const double phi = 2.0 * kPiD * (j + 0.5) / kAzimuths;
            sum += (yz * (s * std::cos(phi)) + zx * (s * std::sin(phi)) + xy * c).length();
        }
    }
    return 4.0 * kPiD * radius * radius * sum / (kPolar * kAzimuths);
}

// The cylinder's mantle: length times the circumference of its (elliptic) section, along a possibly skewed axis.
double cylinder_area(const CylinderLight& cylinder, const M44f& m) {
    const V3d axis = V3d(m[0][0], m[0][1], m[0][2]) * double(cylinder.length);
    const V3d y = V3d(m[1][0], m[1][1], m[1][2]), z = V3d(m[2][0], m[2][1], m[2][2]);
    if (is_round(y, z) && std::abs(axis.dot(y)) + std::abs(axis.dot(z)) < 1e-6 * axis.length() * y.length()) {
        return 2.0 * kPiD * double(cylinder.radius) * axis.length() * y.length();
    }
    constexpr int kAzimuths = 4096;
    double sum = 0.0;
    for (int j = 0; j < kAzimuths; ++j) {
        const double phi = 2.0 * kPiD * (j + 0.5) / kAzimuths;
        sum += axis.cross(z * std::cos(phi) - y * std::sin(phi)).length();
    }
    return 2.0 * kPiD * double(cylinder.radius) * sum / kAzimuths;
}

double cross_area(const M44f& m) {
    return V3d(m[0][0], m[0][1], m[0][2]).cross(V3d(m[1][0], m[1][1], m[1][2])).length();
}

struct SizeFactor {
    const M44f& m;
    double operator()(const DomeLight&) const { return 1.0; }
    double operator()(const DistantLight& distant) const {
        const double half = 0.5 * double(distant.angle) * kPiD / 180.0;
        if (half == 0.0) return 1.0;
        const double sine2 = std::sin(half) * std::sin(half);
        return kPiD * (half <= 0.5 * kPiD ? sine2 : 2.0 - sine2);
    }
    double operator()(const RectLight& rect) const { return double(rect.width) * double(rect.height) * cross_area(m); }
    double operator()(const DiskLight& disk) const { return kPiD * disk.radius * disk.radius * cross_area(m); }
    double operator()(const SphereLight& sphere) const { return ellipsoid_area(sphere.radius, m); }
    double operator()(const CylinderLight& cylinder) const { return cylinder_area(cylinder, m); }
    double operator()(const MeshLight& mesh) const { return surface_area(transformed(*mesh.mesh, m)); }
};

void check_transform(const Light& light, const char* field, const M44f& m) {
    for (int i = 0; i < 4; ++i) {
        for (int j = 0; j < 4; ++j) {
            if (std::isfinite(m[i][j])) continue;
            throw ValueError(str(light.path, ": ", field, " must be finite, got ", m[i][j], "."));
        }
    }
    const V3d x(m[0][0], m[0][1], m[0][2]), y(m[1][0], m[1][1], m[1][2]), z(m[2][0], m[2][1], m[2][2]);
    const double volume = std::abs(x.cross(y).dot(z));
    if (volume > 1e-12 * x.length() * y.length() * z.length()) return;
    throw ValueError(
        str(light.path, ": ", field, " must be invertible, got determinant ", volume, ". Remove the zero scale."));
}

struct CheckShape {
    const Light& light;
    void operator()(const DomeLight& dome) const {
        for (const M44f& portal : dome.portals) check_transform(light, "portals", portal);
    }
    void operator()(const DistantLight& distant) const {
        if (distant.angle >= 0.0f && distant.angle <= 360.0f) return;
        throw ValueError(str(light.path, ": angle must be in [0, 360] degrees, got ", distant.angle, "."));
    }
    void operator()(const RectLight& rect) const {
        check_size(light, "width", rect.width, {0});
        check_size(light, "height", rect.height, {1});
    }
    void operator()(const DiskLight& disk) const { check_size(light, "radius", disk.radius, {0, 1}); }
    void operator()(const SphereLight& sphere) const { check_size(light, "radius", sphere.radius, {0, 1, 2}); }
    void operator()(const CylinderLight& cylinder) const {
        check_size(light, "length", cylinder.length, {0});
        check_size(light, "radius", cylinder.radius, {1, 2});
    }
    void operator()(const MeshLight& mesh) const {
        if (!mesh.mesh) throw ValueError(str(light.path, ": mesh must be given. Use the mesh that shines."));
        check_mesh(*mesh.mesh, light.path);
        if (!mesh.triangle_factors) return;
        if (mesh.triangle_factors->size() != mesh.mesh->triangle_count()) {
            throw ValueError(str(light.path, ": triangle_factors must be one per triangle (",
                                 mesh.mesh->triangle_count(), "), got ", mesh.triangle_factors->size(), "."));
        }
        for (const Rgb& factor : *mesh.triangle_factors) {
            if (is_finite(factor)) continue;
            throw ValueError(str(light.path, ": triangle_factors must be finite, got (", factor.x, ", ", factor.y, ", ",
                                 factor.z, ")."));
        }
    }
};

void require(const Light& light, bool holds, const char* rule, float value) {
    if (!holds) throw ValueError(str(light.path, ": ", rule, ", got ", value, "."));
}

void check_shaping(const Light& light) {
    const Shaping& s = light.shaping;
    require(light, s.cone_angle >= 0.0f && s.cone_angle <= 180.0f, "shaping:cone:angle must be in [0, 180] degrees",
            s.cone_angle);
    require(light, s.cone_softness >= 0.0f && std::isfinite(s.cone_softness),
            "shaping:cone:softness must be >= 0 and finite", s.cone_softness);
    require(light, s.focus >= 0.0f && std::isfinite(s.focus), "shaping:focus must be >= 0 and finite", s.focus);
    require(light, is_finite(s.focus_tint), "shaping:focusTint must be finite", s.focus_tint.x);
    require(light, std::isfinite(s.ies_angle_scale), "shaping:ies:angleScale must be finite", s.ies_angle_scale);
}

void check_shadow(const Light& light) {
    const ShadowRules& s = light.shadow;
    require(light, is_finite(s.color), "shadow:color must be finite", s.color.x);
    require(light, !std::isnan(s.distance), "shadow:distance must be a number", s.distance);
    require(light, !std::isnan(s.falloff), "shadow:falloff must be a number", s.falloff);
    require(light, s.falloff_gamma > 0.0f && std::isfinite(s.falloff_gamma),
            "shadow:falloffGamma must be > 0 and finite", s.falloff_gamma);
}

}  // namespace

void check_light(const Light& light) {
    if (!is_finite(light.radiance)) {
        throw ValueError(str(light.path, ": radiance must be finite, got (", light.radiance.x, ", ", light.radiance.y,
                             ", ", light.radiance.z, "). Check intensity, exposure, color and colorTemperature."));
    }
    for (const float multiplier : light.multipliers) {
        if (!std::isfinite(multiplier)) {
            throw ValueError(str(light.path, ": multipliers must be finite, got ", multiplier, "."));
        }
    }
    check_transform(light, "transform", light.light_to_world);
    check_shaping(light);
    check_shadow(light);
    std::visit(CheckShape{light}, light.shape);
    if (std::holds_alternative<DomeLight>(light.shape) || std::holds_alternative<DistantLight>(light.shape)) return;
    const double away = V3d(light.light_to_world.translation()).length();
    if (!(away <= kFarthest)) {
        throw ValueError(
            str(light.path, ": must be within ", kFarthest, " metres of the origin, got ", away, ". Move it nearer."));
    }
}

double size_factor(const Light& light) {
    return std::visit(SizeFactor{light.light_to_world}, light.shape);
}

Rgb emitted_radiance(const Light& light) {
    if (!light.normalize) return light.radiance;
    return light.radiance * static_cast<float>(1.0 / size_factor(light));
}

}  // namespace frazil
