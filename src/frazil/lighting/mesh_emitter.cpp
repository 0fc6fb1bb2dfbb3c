#include "frazil/lighting/mesh_emitter.h"

#include "frazil/base/error.h"

namespace frazil {

MeshEmitter::MeshEmitter(const Light& light) {
    const MeshLight& shape = std::get<MeshLight>(light.shape);
    factors_ = shape.triangle_factors;
    is_two_sided_ = shape.is_two_sided;
    const Mesh world = transformed(*shape.mesh, light.light_to_world);
    std::vector<double> weights(world.triangle_count());
    triangles_.resize(world.triangle_count());
    double total = 0.0;
    for (std::size_t i = 0; i < triangles_.size(); ++i) {
        const V3i& corners = world.triangles[i];
        const V3f &a = world.positions[std::size_t(corners.x)], &b = world.positions[std::size_t(corners.y)],
                  &c = world.positions[std::size_t(corners.z)];
        const V3d cross = triangle_cross(world, i);
        const double length = cross.length();
        triangles_[i] = {a, b - a, c - a, length > 0.0 ? V3f(cross / length) : V3f(0.0f), 0.0f};
        area_ += 0.5 * length;
        const Rgb factor = factors_ ? (*factors_)[i] : Rgb(1.0f);
        weights[i] = 0.5 * length * double(luminance({std::abs(factor.x), std::abs(factor.y), std::abs(factor.z)}));
        total += weights[i];
        for (const V3f& p : {a, b, c}) box_.extendBy(p);
    }
    if (!(area_ > 0.0)) {
        throw ValueError(str(light.path, ": area must be > 0, got ", area_,
                             ". A light without a surface gives no light; enlarge it or remove it."));
    }
    brightness_ = static_cast<float>(total / area_);
    // Triangles by weight; by area where all factors are black.
    double sum = 0.0;
    cdf_.push_back(0.0f);
    for (std::size_t i = 0; i < triangles_.size(); ++i) {
        const double area = 0.5 * triangle_cross(world, i).length();
        const double share = total > 0.0 ? weights[i] / total : area / area_;
        sum += share;
        cdf_.push_back(static_cast<float>(sum));
        triangles_[i].density = area > 0.0 ? static_cast<float>(share / area) : 0.0f;
    }
    cdf_.back() = 1.0f;
}

MeshEmitter::Sample MeshEmitter::sample(const V3f& position, const V2f& u) const {
    auto index = std::size_t(std::upper_bound(cdf_.begin() + 1, cdf_.end() - 1, u.x) - cdf_.begin()) - 1;
    while (index > 0 && cdf_[index + 1] == cdf_[index]) --index;
    const Triangle& triangle = triangles_[index];
    // What is left of u.x, and u.y, evenly over the triangle.
    const float rest = std::clamp((u.x - cdf_[index]) / (cdf_[index + 1] - cdf_[index]), 0.0f, 1.0f);
    const float root = std::sqrt(rest);
    const V3f place = triangle.corner + triangle.edge1 * (root * (1.0f - u.y)) + triangle.edge2 * (root * u.y);
    const V3f to_light = place - position;
    const float distance = to_light.length();
    if (!(distance > 0.0f)) return {to_light};
    Sample sample = at(std::uint32_t(index), to_light / distance, distance);
    sample.to_light = to_light;
    return sample;
}

MeshEmitter::Sample MeshEmitter::at(std::uint32_t index, const V3f& direction, float t) const {
    Sample sample;
    sample.to_light = direction * t;
    const Triangle& triangle = triangles_[index];
    const float facing = -triangle.normal.dot(direction), cosine = is_two_sided_ ? std::abs(facing) : facing;
    if (!(cosine > 0.0f)) return sample;
    sample.factor = factors_ ? (*factors_)[index] : Rgb(1.0f);
    sample.pdf = triangle.density * t * t / cosine;
    return sample;
}

}  // namespace frazil
