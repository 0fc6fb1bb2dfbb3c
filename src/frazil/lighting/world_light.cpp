#include "frazil/lighting/world_light.h"

#include <algorithm>

#include "frazil/base/trigonometry.h"
#include "frazil/lighting/spherical_rectangle.h"

namespace frazil {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
// Shadow rays end this fraction before the light.
constexpr float kShadowEnd = 0.9999f;

V3f row(const M44f& m, int i) {
    return {m[i][0], m[i][1], m[i][2]};
}

M44f from_rows(const V3f& x, const V3f& y, const V3f& z) {
    return {x.x, x.y, x.z, 0.0f, y.x, y.y, y.z, 0.0f, z.x, z.y, z.z, 0.0f, 0.0f, 0.0f, 0.0f, 1.0f};
}

float determinant(const V3f& x, const V3f& y, const V3f& z) {
    return x.cross(y).dot(z);
}

float cube(float x) {
    return x * x * x;
}

// A direction of the cone with 1 - cos = cap about `axis`, uniform in solid angle.
V3f sample_cone(const V3f& axis, float cap, const V2f& u) {
    const float one_minus_cos = cap * u.x;
    const float sine = std::sqrt(std::max(0.0f, one_minus_cos * (2.0f - one_minus_cos)));
    const V2f circle = cos_sin_turns(u.y) * sine;
    const auto [s, t] = tangent_frame(axis);
    return s * circle.x + t * circle.y + axis * (1.0f - one_minus_cos);
}

V3f uniform_sphere(const V2f& u) {
    const float z = 1.0f - 2.0f * u.x, s = std::sqrt(std::max(0.0f, 1.0f - z * z)), phi = 2.0f * kPi * u.y;
    return {s * std::cos(phi), z, s * std::sin(phi)};
}

// The nearest root of |o + t d|² = 1 seen from outside, and the same for a cylinder by dropping a coordinate; false
// where it lies behind or the origin is inside. Stable for far origins: b² - ac through the foot of the perpendicular.
bool enter_unit_ball(const V3f& o, const V3f& d, float& t) {
    const float a = d.dot(d), b = -o.dot(d), c = o.dot(o) - 1.0f;
    if (c <= 0.0f || b <= 0.0f) return false;
    const V3f foot = o + d * (b / a);
    const float discriminant = a * (1.0f - foot.dot(foot));
    if (discriminant < 0.0f) return false;
    t = c / (b + std::sqrt(discriminant));
    return true;
}

}  // namespace

// Turns each kind of light into its form in world space, and says how far it extends.
class WorldLight::Builder {
  public:
    Builder(const Light& light, Extent& extent) : light_(light), m_(light.light_to_world), extent_(extent) {}

    using Shape = decltype(WorldLight::shape_);

    Shape operator()(const DomeLight& dome) const {
        // Rotation alone: orthonormal axes, mirrored where the transform mirrors.
        const V3f y = row(m_, 1).normalized();
        const V3f z = (row(m_, 2) - y * y.dot(row(m_, 2))).normalized();
        V3f x = y.cross(z);
        if (x.dot(row(m_, 0)) < 0.0f) x = -x;
        return Dome{dome.image, x, y, z};
    }
    Shape operator()(const DistantLight& distant) const {
        const double sine = std::sin(0.25 * double(distant.angle) * 3.14159265358979323846 / 180.0);
        return Distant{row(m_, 2).normalized(), static_cast<float>(2.0 * sine * sine),
                       static_cast<float>(size_factor(light_))};
    }
    Shape operator()(const RectLight& rect) const {
        const V3f x = row(m_, 0).normalized(), y = row(m_, 1).normalized(), normal = shining_side();
        const float width = rect.width * row(m_, 0).length(), height = rect.height * row(m_, 1).length();
        set_extent(0.5f * std::sqrt(width * width + height * height) * (1.0f + std::abs(x.dot(y))), 1.0f, normal);
        return Rect{m_.translation(),
                    normal,
                    x,
                    y,
                    width,
                    height,
                    from_rows(x, y, normal).inverse(),
                    std::abs(determinant(x, y, normal))};
    }
    Shape operator()(const DiskLight& disk) const {
        const V3f x = row(m_, 0) * disk.radius, y = row(m_, 1) * disk.radius, normal = shining_side();
        set_extent(x.length() + y.length(), 1.0f, normal);
        return Disk{
            m_.translation(), normal, x, y, static_cast<float>(size_factor(light_)), from_rows(x, y, normal).inverse()};
    }
    Shape operator()(const SphereLight& sphere) const {
        const V3f x = row(m_, 0) * sphere.radius, y = row(m_, 1) * sphere.radius, z = row(m_, 2) * sphere.radius;
        set_extent(std::max(x.length(), std::max(y.length(), z.length())) * 1.7321f, 0.25f, V3f(0.0f));
        return make_map<Sphere>(x, y, z);
    }
    Shape operator()(const CylinderLight& cylinder) const {
        const V3f axis = row(m_, 0) * cylinder.length;
        const V3f y = row(m_, 1) * cylinder.radius, z = row(m_, 2) * cylinder.radius;
        set_extent(0.5f * axis.length() + y.length() + z.length(), 1.0f / kPi, V3f(0.0f));
        return make_map<Cylinder>(axis, y, z);
    }

  private:
    template <class Shape>
    Shape make_map(const V3f& x, const V3f& y, const V3f& z) const {
        const M44f to_world = from_rows(x, y, z);
        const double det = std::abs(V3d(x).cross(V3d(y)).dot(V3d(z)));
        return {m_.translation(), to_world, to_world.inverse(), static_cast<float>(std::cbrt(det))};
    }
    // Unit normal of the xy plane on the side of the light's own -z.
    V3f shining_side() const {
        const V3f normal = row(m_, 0).cross(row(m_, 1)).normalized();
        return normal.dot(row(m_, 2)) > 0.0f ? -normal : normal;
    }
    void set_extent(float radius, float share_of_area, const V3f& normal) const {
        extent_ = {m_.translation(), radius, static_cast<float>(size_factor(light_)) * share_of_area, normal};
    }

    const Light& light_;
    const M44f& m_;
    Extent& extent_;
};

WorldLight::WorldLight(const Light& light) {
    check_light(light);
    radiance_ = emitted_radiance(light);
    const auto absolute = [](const Rgb& c) { return luminance({std::abs(c.x), std::abs(c.y), std::abs(c.z)}); };
    brightness_ = absolute(radiance_);
    shape_ = std::visit(Builder(light, extent_), light.shape);
    if (const Dome* dome = std::get_if<Dome>(&shape_); dome && dome->image) {
        brightness_ = absolute(radiance_ * dome->image->average());
        // An image whose pixels cancel must still be found.
        brightness_ = std::max(brightness_, 1e-3f * absolute(radiance_));
    }
}

void WorldLight::sample(const V3f& position, std::span<const V2f> u, std::span<LightSample> out) const {
    std::fill(out.begin(), out.end(), LightSample());
    std::visit([&](const auto& shape) { sample_from(shape, position, u, out); }, shape_);
}

bool WorldLight::intersect(const V3f& origin, const V3f& direction, float t_max, LightHit& hit) const {
    return std::visit([&](const auto& shape) { return hit_by(shape, origin, direction, hit); }, shape_) &&
           (hit.distance < t_max || (hit.distance == kInfinity && t_max == kInfinity));
}

bool WorldLight::is_uniform_dome() const {
    const Dome* dome = std::get_if<Dome>(&shape_);
    return dome && !dome->image;
}

Rgb WorldLight::dome_radiance(const V3f& direction) const {
    const Dome& dome = std::get<Dome>(shape_);
    if (!dome.image) return radiance_;
    return radiance_ * dome.image->eval({direction.dot(dome.x), direction.dot(dome.y), direction.dot(dome.z)});
}

Rgb WorldLight::dome_radiance(const V3f& direction, float& pdf) const {
    const Dome& dome = std::get<Dome>(shape_);
    pdf = 0.25f * kInvPi;
    if (!dome.image) return radiance_;
    return radiance_ * dome.image->eval({direction.dot(dome.x), direction.dot(dome.y), direction.dot(dome.z)}, pdf);
}

float WorldLight::importance(const V3f& position) const {
    if (is_dome()) return kPi * brightness_;
    if (const Distant* distant = std::get_if<Distant>(&shape_)) return distant->size * brightness_;
    const V3f to_light = extent_.center - position;
    const float distance = to_light.length(), radius = extent_.radius;
    float facing = 1.0f;
    if (extent_.normal != V3f(0.0f)) {
        // The cosine at the light, as large as it can be for any of its points.
        const float height = -to_light.dot(extent_.normal);
        if (height <= 0.0f) return 0.0f;
        facing = std::min(1.0f, (height + radius) / std::max(distance, 1e-30f));
    }
    const float d = std::max(distance, radius);
    return brightness_ * (extent_.projected_area / d) * (facing / d);
}

// ---- dome ----

void WorldLight::sample_from(const Dome& dome, const V3f&, std::span<const V2f> u, std::span<LightSample> out) const {
    for (std::size_t i = 0; i < u.size(); ++i) {
        LightSample& sample = out[i];
        if (!dome.image) {
            sample.direction = uniform_sphere(u[i]);
            sample.radiance = radiance_;
            sample.pdf = 0.25f * kInvPi;
            continue;
        }
        const V3f local = dome.image->sample(u[i], sample.pdf, sample.radiance);
        sample.direction = dome.x * local.x + dome.y * local.y + dome.z * local.z;
        sample.radiance *= radiance_;
    }
}

bool WorldLight::hit_by(const Dome&, const V3f&, const V3f& direction, LightHit& hit) const {
    hit.radiance = dome_radiance(direction, hit.pdf);
    hit.distance = kInfinity;
    return true;
}

// ---- distant ----

void WorldLight::sample_from(const Distant& distant, const V3f&, std::span<const V2f> u,
                             std::span<LightSample> out) const {
    for (std::size_t i = 0; i < u.size(); ++i) {
        LightSample& sample = out[i];
        sample.radiance = radiance_;
        sample.is_delta = distant.cap == 0.0f;
        sample.direction = sample.is_delta ? distant.axis : sample_cone(distant.axis, distant.cap, u[i]);
        sample.pdf = sample.is_delta ? 1.0f : 0.5f * kInvPi / distant.cap;
    }
}

bool WorldLight::hit_by(const Distant& distant, const V3f&, const V3f& direction, LightHit& hit) const {
    // 1 - cos from the chord, which keeps small angles.
    if (!(0.5f * (direction - distant.axis).length2() < distant.cap)) return false;
    hit = {radiance_, 0.5f * kInvPi / distant.cap, kInfinity, hit.light};
    return true;
}

// ---- rect ----

namespace {

// The rect as seen from a point, in its own frame. `at` is the point there.
SphericalRectangle seen_from(const V3f& at, float width, float height) {
    const double w = 0.5 * double(width), h = 0.5 * double(height);
    return {-w - double(at.x), w - double(at.x), -h - double(at.y), h - double(at.y), double(at.z)};
}

}  // namespace

void WorldLight::sample_from(const Rect& rect, const V3f& position, std::span<const V2f> u,
                             std::span<LightSample> out) const {
    V3f at;
    rect.world_to_local.multDirMatrix(position - rect.center, at);
    if (!(at.z > 0.0f)) return;
    const SphericalRectangle view = seen_from(at, rect.width, rect.height);
    for (std::size_t i = 0; i < u.size(); ++i) {
        LightSample& sample = out[i];
        const V3d local = view.sample(u[i]);
        const float local_length = static_cast<float>(local.length());
        const V3f to_light = rect.x * float(local.x) + rect.y * float(local.y) + rect.normal * float(local.z);
        const float distance = to_light.length();
        sample.direction = to_light / distance;
        sample.distance = distance * kShadowEnd;
        sample.radiance = radiance_;
        sample.pdf = static_cast<float>(view.pdf(local)) * cube(distance / local_length) / rect.shear;
    }
}

bool WorldLight::hit_by(const Rect& rect, const V3f& origin, const V3f& direction, LightHit& hit) const {
    V3f at, along;
    rect.world_to_local.multDirMatrix(origin - rect.center, at);
    rect.world_to_local.multDirMatrix(direction, along);
    if (!(at.z > 0.0f && along.z < 0.0f)) return false;
    const float t = -at.z / along.z, x = at.x + t * along.x, y = at.y + t * along.y;
    if (!(std::abs(x) <= 0.5f * rect.width && std::abs(y) <= 0.5f * rect.height)) return false;
    const SphericalRectangle view = seen_from(at, rect.width, rect.height);
    const V3d local = V3d(along) * double(t);
    const float density = static_cast<float>(view.pdf(local)) * cube(1.0f / along.length()) / rect.shear;
    hit = {radiance_, density, t, hit.light};
    return true;
}

// ---- disk ----

void WorldLight::sample_from(const Disk& disk, const V3f& position, std::span<const V2f> u,
                             std::span<LightSample> out) const {
    const V3f to_center = disk.center - position;
    const float height = -to_center.dot(disk.normal);
    if (!(height > 0.0f)) return;
    for (std::size_t i = 0; i < u.size(); ++i) {
        LightSample& sample = out[i];
        const V2f circle = cos_sin_turns(u[i].y) * std::sqrt(u[i].x);
        const V3f to_light = to_center + disk.x * circle.x + disk.y * circle.y;
        const float distance = to_light.length();
        sample.direction = to_light / distance;
        sample.distance = distance * kShadowEnd;
        sample.radiance = radiance_;
        sample.pdf = cube(distance) / (height * disk.area);
    }
}

bool WorldLight::hit_by(const Disk& disk, const V3f& origin, const V3f& direction, LightHit& hit) const {
    const float height = (origin - disk.center).dot(disk.normal), down = -direction.dot(disk.normal);
    if (!(height > 0.0f && down > 0.0f)) return false;
    const float t = height / down;
    V3f local;
    disk.world_to_local.multDirMatrix(origin + direction * t - disk.center, local);
    if (!(local.x * local.x + local.y * local.y <= 1.0f)) return false;
    hit = {radiance_, t * t / (down * disk.area), t, hit.light};
    return true;
}

// ---- sphere ----

namespace {

// The unit sphere seen from `at` outside it: 1 - cos of its half angle, without cancellation far away.
float cap_of_unit_sphere(const V3f& at) {
    const float sine2 = std::min(1.0f, 1.0f / at.length2());
    return sine2 / (1.0f + std::sqrt(1.0f - sine2));
}

}  // namespace

void WorldLight::sample_from(const Sphere& sphere, const V3f& position, std::span<const V2f> u,
                             std::span<LightSample> out) const {
    V3f at;
    sphere.world_to_local.multDirMatrix(position - sphere.center, at);
    const float distance2 = at.length2();
    if (!(distance2 > 1.0f)) return;
    const float cap = cap_of_unit_sphere(at), center_distance = std::sqrt(distance2);
    const V3f axis = -at / center_distance;
    for (std::size_t i = 0; i < u.size(); ++i) {
        LightSample& sample = out[i];
        const V3f local = sample_cone(axis, cap, u[i]);
        const float along = center_distance * local.dot(axis);
        const V3f foot = at + local * along;
        // The near side, at c/(b + sqrt) as c = distance² - 1 does not cancel far away.
        const float t = (distance2 - 1.0f) / (along + std::sqrt(std::max(0.0f, 1.0f - foot.length2())));
        V3f direction;
        sphere.local_to_world.multDirMatrix(local, direction);
        const float stretch = direction.length();
        sample.direction = direction / stretch;
        sample.distance = t * stretch * kShadowEnd;
        sample.radiance = radiance_;
        sample.pdf = 0.5f * kInvPi / cap * cube(stretch / sphere.scale);
    }
}

bool WorldLight::hit_by(const Sphere& sphere, const V3f& origin, const V3f& direction, LightHit& hit) const {
    V3f at, along;
    sphere.world_to_local.multDirMatrix(origin - sphere.center, at);
    sphere.world_to_local.multDirMatrix(direction, along);
    float t;
    if (!enter_unit_ball(at, along, t)) return false;
    const float stretch = 1.0f / along.length();
    hit = {radiance_, 0.5f * kInvPi / cap_of_unit_sphere(at) * cube(stretch / sphere.scale), t, hit.light};
    return true;
}

// ---- cylinder ----

namespace {

// Half the angle under which a point at `distance` > 1 from its axis sees a unit cylinder.
float half_width(float distance) {
    return std::asin(1.0f / distance);
}

}  // namespace

void WorldLight::sample_from(const Cylinder& cylinder, const V3f& position, std::span<const V2f> u,
                             std::span<LightSample> out) const {
    V3f at;
    cylinder.world_to_local.multDirMatrix(position - cylinder.center, at);
    const float axis_distance = std::sqrt(at.y * at.y + at.z * at.z);
    if (!(axis_distance > 1.0f)) return;
    const float half = half_width(axis_distance);
    const V2f inward(-at.y / axis_distance, -at.z / axis_distance);
    for (std::size_t i = 0; i < u.size(); ++i) {
        LightSample& sample = out[i];
        // Across: an angle seen from the point, and the near side of the circle there. Along: uniform in length.
        const float psi = (2.0f * u[i].x - 1.0f) * half, c = std::cos(psi), s = std::sin(psi);
        const float offset = axis_distance * s;
        const float across = (axis_distance * axis_distance - 1.0f) /
                             (axis_distance * c + std::sqrt(std::max(0.0f, 1.0f - offset * offset)));
        const V3f local(u[i].y - 0.5f - at.x, across * (c * inward.x - s * inward.y),
                        across * (s * inward.x + c * inward.y));
        V3f to_light;
        cylinder.local_to_world.multDirMatrix(local, to_light);
        const float distance = to_light.length();
        sample.direction = to_light / distance;
        sample.distance = distance * kShadowEnd;
        sample.radiance = radiance_;
        // In the local frame dw = across²/r³ dx dpsi; the map to the world turns r³ into distance³/|det|.
        sample.pdf = cube(distance / cylinder.scale) / (across * across * 2.0f * half);
    }
}

bool WorldLight::hit_by(const Cylinder& cylinder, const V3f& origin, const V3f& direction, LightHit& hit) const {
    V3f at, along;
    cylinder.world_to_local.multDirMatrix(origin - cylinder.center, at);
    cylinder.world_to_local.multDirMatrix(direction, along);
    float t;
    if (!enter_unit_ball(V3f(0.0f, at.y, at.z), V3f(0.0f, along.y, along.z), t)) return false;
    if (!(std::abs(at.x + t * along.x) <= 0.5f)) return false;
    const float across2 = t * t * (along.y * along.y + along.z * along.z);
    const float half = half_width(std::sqrt(at.y * at.y + at.z * at.z));
    hit = {radiance_, cube(t / cylinder.scale) / (across2 * 2.0f * half), t, hit.light};
    return true;
}

}  // namespace frazil
