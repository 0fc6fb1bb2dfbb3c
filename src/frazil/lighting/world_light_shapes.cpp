// Sampling and hits of each kind of light: the other half of world_light.cpp.
#include <algorithm>

#include "frazil/base/trigonometry.h"
#include "frazil/lighting/spherical_rectangle.h"
#include "frazil/lighting/world_light.h"

namespace frazil {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
// Shadow rays end this fraction before the light.
constexpr float kShadowEnd = 0.9999f;

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

// ---- rect ----

namespace {

// The rect as seen from a point, in its own frame. `at` is the point there.
SphericalRectangle seen_from(const V3f& at, float width, float height) {
    const double w = 0.5 * double(width), h = 0.5 * double(height);
    return {-w - double(at.x), w - double(at.x), -h - double(at.y), h - double(at.y), double(at.z)};
}

}  // namespace

// A rect as a point on the side that it shines to sees it; its directions are uniform in the solid angle of its own frame.
struct WorldLight::RectView {
    const Rect* rect;
    V3f at;  // the point in that frame
    SphericalRectangle view;

    static bool is_before(const Rect& rect, const V3f& position, V3f& at) {
        rect.world_to_local.multDirMatrix(position - rect.center, at);
        return at.z > 0.0f;
    }
    // Only where is_before().
    RectView(const Rect& r, const V3f& at_) : rect(&r), at(at_), view(seen_from(at_, r.width, r.height)) {}

    V3f to_world(const V3d& local) const {
        return rect->x * float(local.x) + rect->y * float(local.y) + rect->normal * float(local.z);
    }
    // Density of the direction to a place of the rect, `local` from the point, `distance` from it in the world.
    float pdf(const V3d& local, float distance) const {
        return float(view.pdf(local)) * cube(distance / float(local.length())) / rect->shear;
    }
    // Where a ray of unit direction meets the rect: distance and place. False where it misses.
    bool meet(const V3f& direction, float& t, V3d& local) const {
        V3f along;
        rect->world_to_local.multDirMatrix(direction, along);
        if (!(along.z < 0.0f)) return false;
        t = -at.z / along.z;
        const float x = at.x + t * along.x, y = at.y + t * along.y;
        local = V3d(along) * double(t);
        return std::abs(x) <= 0.5f * rect->width && std::abs(y) <= 0.5f * rect->height;
    }
};

void WorldLight::sample_from(const Rect& rect, const V3f& position, std::span<const V2f> u,
                             std::span<LightSample> out) const {
    V3f at;
    if (!RectView::is_before(rect, position, at)) return;
    const RectView seen(rect, at);
    for (std::size_t i = 0; i < u.size(); ++i) {
        LightSample& sample = out[i];
        V3d local;
        if (rect.image && u[i].x < 0.5f) {
            float pdf;
            const V2f place = rect.image->sample({2.0f * u[i].x, u[i].y}, pdf);
            local = V3d((0.5f - place.x) * rect.width - at.x, (0.5f - place.y) * rect.height - at.y, -at.z);
        } else {
            local = seen.view.sample(rect.image ? V2f(2.0f * u[i].x - 1.0f, u[i].y) : u[i]);
        }
        const V3f to_light = seen.to_world(local);
        const float distance = to_light.length();
        sample.direction = to_light / distance;
        sample.distance = distance * kShadowEnd;
        sample.radiance = radiance_;
        sample.pdf = seen.pdf(local, distance);
        if (rect.image) {
            const V2f place = image_place(rect, local, at);
            sample.radiance *= rect.image->eval(place);
            sample.pdf = 0.5f * (sample.pdf + image_pdf(rect, place, to_light));
        }
    }
}

// Upright as seen from the side that shines, where +x lies to the left.
V2f WorldLight::image_place(const Rect& rect, const V3d& local_offset, const V3f& at) const {
    return {0.5f - (float(local_offset.x) + at.x) / rect.width, 0.5f - (float(local_offset.y) + at.y) / rect.height};
}

float WorldLight::image_pdf(const Rect& rect, const V2f& place, const V3f& to_light) const {
    const float distance2 = to_light.length2(), facing = -to_light.dot(rect.normal);
    return rect.image->pdf(place) * distance2 * std::sqrt(distance2) /
           (facing * (rect.width * rect.height * rect.x.cross(rect.y).length()));
}

bool WorldLight::hit_by(const Rect& rect, const V3f& origin, const V3f& direction, LightHit& hit) const {
    V3f at;
    if (!RectView::is_before(rect, origin, at)) return false;
    const RectView seen(rect, at);
    float t;
    V3d local;
    if (!seen.meet(direction, t, local)) return false;
    const float density = seen.pdf(local, t);
    hit = {radiance_, density, t, hit.light};
    if (rect.image) {
        const V2f place = image_place(rect, local, at);
        hit.radiance *= rect.image->eval(place);
        hit.pdf = 0.5f * (density + image_pdf(rect, place, direction * t));
    }
    return true;
}

// ---- dome ----

struct WorldLight::PortalView : RectView {
    PortalView(const Rect& rect, const V3f& at_)
        : RectView(rect, at_), share(std::max(float(view.solid_angle()), 1e-30f)) {}
    float share;  // of what goes to portals: by solid angle
};

namespace {

// Of a dome's samples where there are portals before the place. An image may hold a sun that only itself finds.
constexpr float kToPortals = 0.75f, kToPortalsOfImage = 0.5f;

}  // namespace

const std::vector<WorldLight::PortalView>& WorldLight::portals_before(const Dome& dome, const V3f& position) {
    thread_local std::vector<PortalView> views;
    views.clear();
    float total = 0.0f;
    for (const Rect& rect : dome.portals) {
        V3f at;
        if (!RectView::is_before(rect, position, at)) continue;
        views.emplace_back(rect, at);
        total += views.back().share;
    }
    for (PortalView& view : views) view.share /= total;
    return views;
}

float WorldLight::portal_pdf(const std::vector<PortalView>& portals, const V3f& direction) {
    float pdf = 0.0f;
    for (const PortalView& portal : portals) {
        float t;
        V3d local;
        if (portal.meet(direction, t, local)) pdf += portal.share * portal.pdf(local, t);
    }
    return pdf;
}

LightSample WorldLight::sample_whole(const Dome& dome, const V2f& u) const {
    LightSample sample;
    if (dome.image) {
        sample_dome(V3f(0.0f), {&u, 1}, {&sample, 1});
    } else {
        sample.direction = uniform_sphere(u);
        sample.radiance = radiance_;
        sample.pdf = 0.25f * kInvPi;
    }
    return sample;
}

Rgb WorldLight::eval_whole(const Dome& dome, const V3f& direction, float& pdf) const {
    Rgb radiance = radiance_;
    pdf = 0.25f * kInvPi;
    if (dome.image) dome_radiances({&direction, 1}, {&pdf, 1}, {&radiance, 1});
    return radiance;
}

void WorldLight::sample_from(const Dome& dome, const V3f& position, std::span<const V2f> u,
                             std::span<LightSample> out) const {
    if (!dome.portals.empty()) {
        if (const auto& portals = portals_before(dome, position); !portals.empty()) {
            sample_portals(dome, portals, u, out);
            return;
        }
    }
    if (dome.image) {
        sample_dome(V3f(0.0f), u, out);
    } else {
        for (std::size_t i = 0; i < u.size(); ++i) out[i] = sample_whole(dome, u[i]);
    }
}

void WorldLight::sample_portals(const Dome& dome, const std::vector<PortalView>& portals, std::span<const V2f> u,
                                std::span<LightSample> out) const {
    const float to_portals = dome.image ? kToPortalsOfImage : kToPortals;
    for (std::size_t i = 0; i < u.size(); ++i) {
        LightSample& sample = out[i];
        float left = u[i].x / to_portals;
        if (left >= 1.0f) {
            sample = sample_whole(dome, {(u[i].x - to_portals) / (1.0f - to_portals), u[i].y});
            sample.pdf = (1.0f - to_portals) * sample.pdf + to_portals * portal_pdf(portals, sample.direction);
            continue;
        }
        std::size_t chosen = 0;
        while (chosen + 1 < portals.size() && left >= portals[chosen].share) left -= portals[chosen++].share;
        const PortalView& portal = portals[chosen];
        const V3d local = portal.view.sample({std::clamp(left / portal.share, 0.0f, kBelowOne), u[i].y});
        const V3f to_portal = portal.to_world(local);
        sample.direction = to_portal.normalized();
        float whole;
        sample.radiance = eval_whole(dome, sample.direction, whole);
        // The chosen one is met for certain, whatever rounding says at its rim.
        float pdf = portal_pdf(portals, sample.direction);
        if (!(pdf > 0.0f)) pdf = portal.share * portal.pdf(local, to_portal.length());
        sample.pdf = (1.0f - to_portals) * whole + to_portals * pdf;
    }
}

void WorldLight::sample_dome(const V3f& normal, std::span<const V2f> u, std::span<LightSample> out) const {
    const Dome& dome = std::get<Dome>(shape_);
    const V3f local_normal(normal.dot(dome.x), normal.dot(dome.y), normal.dot(dome.z));
    constexpr std::size_t kBatch = 64;
    V3f local[kBatch];
    Rgb radiances[kBatch];
    float pdfs[kBatch];
    for (std::size_t begin = 0; begin < u.size(); begin += kBatch) {
        const std::size_t count = std::min(kBatch, u.size() - begin);
        dome.image->sample_many(local_normal, u.subspan(begin, count), {local, count}, {pdfs, count},
                                {radiances, count});
        for (std::size_t i = 0; i < count; ++i) {
            LightSample& sample = out[begin + i];
            sample = LightSample();
            if (pdfs[i] == 0.0f) continue;
            sample.direction = dome.x * local[i].x + dome.y * local[i].y + dome.z * local[i].z;
            sample.radiance = radiances[i] * radiance_;
            sample.pdf = pdfs[i];
        }
    }
}

bool WorldLight::hit_by(const Dome& dome, const V3f& origin, const V3f& direction, LightHit& hit) const {
    hit.radiance = eval_whole(dome, direction, hit.pdf);
    hit.distance = kInfinity;
    if (dome.portals.empty()) return true;
    if (const auto& portals = portals_before(dome, origin); !portals.empty()) {
        const float to_portals = dome.image ? kToPortalsOfImage : kToPortals;
        hit.pdf = (1.0f - to_portals) * hit.pdf + to_portals * portal_pdf(portals, direction);
    }
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

// ---- mesh ----

void WorldLight::sample_from(const MeshEmitter& mesh, const V3f& position, std::span<const V2f> u,
                             std::span<LightSample> out) const {
    for (std::size_t i = 0; i < u.size(); ++i) {
        LightSample& sample = out[i];
        const MeshEmitter::Sample found = mesh.sample(position, u[i]);
        if (!(found.pdf > 0.0f)) continue;
        const float distance = found.to_light.length();
        sample.direction = found.to_light / distance;
        sample.distance = distance * kShadowEnd;
        sample.radiance = radiance_ * found.factor;
        sample.pdf = found.pdf;
    }
}

}  // namespace frazil
