#include "frazil/lighting/world_light.h"

#include <algorithm>

namespace frazil {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
// What is left of a dome for the choice at a surface, whose own lobes find the rest of it.
constexpr float kDomeShare = 0.5f;
constexpr float kLeastOfDome = 0.05f;  // of a dome's mean, what the choice takes its light at the least for

V3f row(const M44f& m, int i) {
    return {m[i][0], m[i][1], m[i][2]};
}

M44f from_rows(const V3f& x, const V3f& y, const V3f& z) {
    return {x.x, x.y, x.z, 0.0f, y.x, y.y, y.z, 0.0f, z.x, z.y, z.z, 0.0f, 0.0f, 0.0f, 0.0f, 1.0f};
}

float determinant(const V3f& x, const V3f& y, const V3f& z) {
    return x.cross(y).dot(z);
}

}  // namespace

// Turns each kind of light into its form in world space, and says how far it extends.
class WorldLight::Builder {
  public:
    Builder(const Light& light, Extent& extent, LightBounds& bounds)
        : light_(light), m_(light.light_to_world), extent_(extent), bounds_(bounds) {}

    using Shape = decltype(WorldLight::shape_);

    Shape operator()(const DomeLight& dome) const {
        // Rotation alone: orthonormal axes, mirrored where the transform mirrors.
        const V3f y = row(m_, 1).normalized();
        const V3f z = (row(m_, 2) - y * y.dot(row(m_, 2))).normalized();
        V3f x = y.cross(z);
        if (x.dot(row(m_, 0)) < 0.0f) x = -x;
        std::vector<Rect> portals;
        for (const M44f& portal : dome.portals) portals.push_back(make_rect(portal, 1.0f, 1.0f, nullptr));
        return Dome{dome.image, x, y, z, std::move(portals)};
    }
    Shape operator()(const DistantLight& distant) const {
        const double sine = std::sin(0.25 * double(distant.angle) * 3.14159265358979323846 / 180.0);
        return Distant{row(m_, 2).normalized(), static_cast<float>(2.0 * sine * sine),
                       static_cast<float>(size_factor(light_))};
    }
    Shape operator()(const RectLight& light) const {
        Rect rect = make_rect(m_, light.width, light.height, light.image);
        set_extent(0.5f * std::sqrt(rect.width * rect.width + rect.height * rect.height) *
                       (1.0f + std::abs(rect.x.dot(rect.y))),
                   1.0f, rect.normal);
        const V3f half_x = rect.x * (0.5f * rect.width), half_y = rect.y * (0.5f * rect.height);
        set_box({half_x + half_y, half_x - half_y}, false);
        return rect;
    }
    Shape operator()(const DiskLight& disk) const {
        const V3f x = row(m_, 0) * disk.radius, y = row(m_, 1) * disk.radius, normal = shining_side(m_);
        set_extent(x.length() + y.length(), 1.0f, normal);
        set_box({x, y}, true);
        return Disk{
            m_.translation(), normal, x, y, static_cast<float>(size_factor(light_)), from_rows(x, y, normal).inverse()};
    }
    Shape operator()(const SphereLight& sphere) const {
        const V3f x = row(m_, 0) * sphere.radius, y = row(m_, 1) * sphere.radius, z = row(m_, 2) * sphere.radius;
        set_extent(std::max(x.length(), std::max(y.length(), z.length())) * 1.7321f, 0.25f, V3f(0.0f));
        set_box({x, y, z}, true);
        return make_map<Sphere>(x, y, z);
    }
    Shape operator()(const CylinderLight& cylinder) const {
        const V3f axis = row(m_, 0) * cylinder.length;
        const V3f y = row(m_, 1) * cylinder.radius, z = row(m_, 2) * cylinder.radius;
        set_extent(0.5f * axis.length() + y.length() + z.length(), 1.0f / kPi, V3f(0.0f));
        set_box({y, z}, true);
        const V3f half(0.5f * std::abs(axis.x), 0.5f * std::abs(axis.y), 0.5f * std::abs(axis.z));
        bounds_.box = Box3f(bounds_.box.min - half, bounds_.box.max + half);
        return make_map<Cylinder>(axis, y, z);
    }
    Shape operator()(const MeshLight&) const {
        MeshEmitter mesh(light_);
        const V3f center = (mesh.box().min + mesh.box().max) * 0.5f;
        const float seen = static_cast<float>(mesh.area()) * (mesh.is_two_sided() ? 0.5f : 0.25f);
        extent_ = {center, (mesh.box().max - center).length(), seen, V3f(0.0f)};
        bounds_.box = mesh.box();
        return mesh;
    }

  private:
    template <class Shape>
    Shape make_map(const V3f& x, const V3f& y, const V3f& z) const {
        const M44f to_world = from_rows(x, y, z);
        const double det = std::abs(V3d(x).cross(V3d(y)).dot(V3d(z)));
        return {m_.translation(), to_world, to_world.inverse(), static_cast<float>(std::cbrt(det))};
    }
    // Unit normal of the xy plane on the side of the frame's own -z.
    static V3f shining_side(const M44f& m) {
        const V3f normal = row(m, 0).cross(row(m, 1)).normalized();
        return normal.dot(row(m, 2)) > 0.0f ? -normal : normal;
    }
    static Rect make_rect(const M44f& m, float width, float height, std::shared_ptr<const LightImage> image) {
        const V3f x = row(m, 0).normalized(), y = row(m, 1).normalized(), normal = shining_side(m);
        return {m.translation(),
                normal,
                x,
                y,
                width * row(m, 0).length(),
                height * row(m, 1).length(),
                from_rows(x, y, normal).inverse(),
                std::abs(determinant(x, y, normal)),
                std::move(image)};
    }
    void set_extent(float radius, float share_of_area, const V3f& normal) const {
        extent_ = {m_.translation(), radius, static_cast<float>(size_factor(light_)) * share_of_area, normal};
    }

    // The box about the centre that holds all sums of ± the vectors, or (is_round) the ellipsoid that they span; and the
    // cone of normals that the extent tells.
    void set_box(std::initializer_list<V3f> vectors, bool is_round) const {
        V3f reach(0.0f);
        for (int axis = 0; axis < 3; ++axis) {
            for (const V3f& v : vectors) {
                reach[axis] = is_round ? reach[axis] + v[axis] * v[axis] : std::max(reach[axis], std::abs(v[axis]));
            }
            if (is_round) reach[axis] = std::sqrt(reach[axis]);
        }
        bounds_.box = Box3f(extent_.center - reach, extent_.center + reach);
        if (extent_.normal == V3f(0.0f)) return;
        bounds_.axis = extent_.normal;
        bounds_.cos_spread = 1.0f;
        bounds_.cos_emission = 0.0f;
    }

    const Light& light_;
    const M44f& m_;
    Extent& extent_;
    LightBounds& bounds_;
};

WorldLight::WorldLight(const Light& light) {
    check_light(light);
    radiance_ = emitted_radiance(light);
    const auto absolute = [](const Rgb& c) { return luminance({std::abs(c.x), std::abs(c.y), std::abs(c.z)}); };
    brightness_ = absolute(radiance_);
    shape_ = std::visit(Builder(light, extent_, bounds_), light.shape);
    shaping_ = light.shaping;
    is_shaped_ = is_finite() && !shaping_.is_neutral();
    const M44f& m = light.light_to_world;
    frame_[2] = row(m, 2).normalized();
    frame_[0] = (row(m, 0) - frame_[2] * frame_[2].dot(row(m, 0))).normalized();
    frame_[1] = frame_[2].cross(frame_[0]);
    if (frame_[1].dot(row(m, 1)) < 0.0f) frame_[1] = -frame_[1];
    const V3f axis = -frame_[2];
    if (const Rect* rect = std::get_if<Rect>(&shape_); rect && rect->image) {
        brightness_ *= std::max(rect->image->brightness(), 1e-3f);
    }
    if (const MeshEmitter* mesh = std::get_if<MeshEmitter>(&shape_)) brightness_ *= mesh->brightness();
    bounds_.power = brightness_ * extent_.projected_area;
    if (shaping_.ies && !shaping_.ies_normalize) bounds_.power *= shaping_.ies->mean();
    bounds_.center = (bounds_.box.min + bounds_.box.max) * 0.5f;
    if (is_shaped_ && shaping_.has_cone() && shaping_.cone_angle < 90.0f) {
        // No light leaves farther from the axis than the cone's angle, whatever the normal.
        const float angle = shaping_.cone_angle * (kPi / 180.0f) + 0.01f;
        bounds_.axis = axis;
        bounds_.cos_spread = std::cos(angle);
        bounds_.cos_emission = 1.0f - 1e-4f;
        bounds_.beamed = bounds_.power;
        bounds_.beam = axis * bounds_.power;
        bounds_.beam_angle = bounds_.power * angle;
    } else if (extent_.normal != V3f(0.0f)) {
        bounds_.flow = extent_.normal * bounds_.power;
    } else {
        bounds_.even = bounds_.power;
    }
    if (const Dome* dome = std::get_if<Dome>(&shape_); dome && dome->image) {
        // A black image is found too, as a hit on it says so.
        brightness_ *= std::max(dome->image->brightness(), 1e-3f);
    }
}

void WorldLight::sample(const V3f& position, std::span<const V2f> u, std::span<LightSample> out) const {
    std::fill(out.begin(), out.end(), LightSample());
    std::visit([&](const auto& shape) { sample_from(shape, position, u, out); }, shape_);
    if (!is_shaped_) return;
    for (LightSample& sample : out) {
        if (sample.pdf > 0.0f) sample.radiance *= shaped(sample.direction);
    }
}

bool WorldLight::intersect(const V3f& origin, const V3f& direction, float t_max, LightHit& hit) const {
    if (!std::visit([&](const auto& shape) { return hit_by(shape, origin, direction, hit); }, shape_)) return false;
    if (is_shaped_) hit.radiance *= shaped(direction);
    return hit.distance < t_max || (hit.distance == kInfinity && t_max == kInfinity);
}

bool WorldLight::hit_triangle(std::uint32_t triangle, const V3f& direction, float t, LightHit& hit) const {
    const MeshEmitter::Sample found = std::get<MeshEmitter>(shape_).at(triangle, direction, t);
    if (!(found.pdf > 0.0f)) return false;
    hit = {radiance_ * found.factor, found.pdf, t, hit.light};
    if (is_shaped_) hit.radiance *= shaped(direction);
    return true;
}

bool WorldLight::is_uniform_dome() const {
    const Dome* dome = std::get_if<Dome>(&shape_);
    return dome && !dome->image;
}

bool WorldLight::has_portal_before(const V3f& position) const {
    const Dome* dome = std::get_if<Dome>(&shape_);
    return dome && !dome->portals.empty() && !portals_before(*dome, position).empty();
}

Rgb WorldLight::dome_radiance(const V3f& direction) const {
    const Dome& dome = std::get<Dome>(shape_);
    if (!dome.image) return radiance_;
    return radiance_ * dome.image->eval({direction.dot(dome.x), direction.dot(dome.y), direction.dot(dome.z)});
}

void WorldLight::dome_radiances(std::span<const V3f> directions, std::span<float> pdfs,
                                std::span<Rgb> radiances) const {
    const Dome& dome = std::get<Dome>(shape_);
    constexpr std::size_t kBatch = 64;
    V3f local[kBatch];
    for (std::size_t begin = 0; begin < directions.size(); begin += kBatch) {
        const std::size_t count = std::min(kBatch, directions.size() - begin);
        for (std::size_t i = 0; i < count; ++i) {
            const V3f& d = directions[begin + i];
            local[i] = {d.dot(dome.x), d.dot(dome.y), d.dot(dome.z)};
        }
        dome.image->eval_many({local, count}, pdfs.subspan(begin, count), radiances.subspan(begin, count));
        for (std::size_t i = begin; i < begin + count; ++i) radiances[i] *= radiance_;
    }
}

float WorldLight::importance(const V3f& position, const V3f& normal) const {
    const bool is_facing = normal != V3f(0.0f);
    if (const Dome* dome = std::get_if<Dome>(&shape_)) {
        if (!is_facing) return kPi * brightness_;
        if (!dome->image) return kDomeShare * kPi * brightness_;
        const V3f local(normal.dot(dome->x), normal.dot(dome->y), normal.dot(dome->z));
        return kDomeShare * brightness_ * std::max(kPi * kLeastOfDome, dome->image->irradiance(local));
    }
    if (const Distant* distant = std::get_if<Distant>(&shape_)) {
        // The cosine at the part of the cone that stands highest.
        const float cosine = is_facing ? cos_difference(normal.dot(distant->axis), 1.0f - distant->cap) : 1.0f;
        return distant->size * brightness_ * std::max(0.0f, cosine);
    }
    const float receiving = receiving_cosine(bounds_.box, position, normal);
    if (receiving == 0.0f) return 0.0f;
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
    if (is_shaped_ && distance > radius) {
        // As seen from the light's middle; what a part of the light may send beyond the cone from there is a bound's.
        if (frazil::importance(bounds_, position, V3f(0.0f)) == 0.0f) return 0.0f;
        // Where the middle sends nothing, the edge may: a little of what the light gives elsewhere.
        const float mean = shaping_.ies && !shaping_.ies_normalize ? shaping_.ies->mean() : 1.0f;
        facing *= std::max(luminance(shaped(to_light / distance)), 0.02f * mean);
    }
    return receiving * brightness_ * (extent_.projected_area / d) * (facing / d);
}

}  // namespace frazil
