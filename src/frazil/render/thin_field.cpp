#include "frazil/render/thin_field.h"

#include <algorithm>
#include <cmath>

#include "frazil/points/point_blend.h"

namespace frazil {
namespace {

// Thickness varies slowly inside: its gathers may be this much coarser.
constexpr float kCoarser = 4.0f;
// How far the mean reaches, at least.
constexpr float kSpacings = 1.5f, kFreePaths = 2.0f;

}  // namespace

ThinField::ThinField(const PointSet& points, const std::vector<Rgb>& exponents, std::shared_ptr<const PointTree> tree,
                     std::shared_ptr<const ThinMedium> medium)
    : tree_(std::move(tree)), medium_(std::move(medium)) {
    if (!PointBlend::suits(points)) return;
    reach_ = std::max(kSpacings * static_cast<float>(points.spacing), kFreePaths / medium_->sigma_t());
    lookup_.emplace(points, reach_);
    for (const std::uint32_t i : lookup_->order()) {
        exponents_.insert(exponents_.end(), {exponents[2 * i], exponents[2 * i + 1]});
    }
}

// False where no point is near.
bool ThinField::near(const V3f& place, const V3f& normal, const Rgb& depth, Rgb* exponents) const {
    const float sigma_t = medium_->sigma_t(), mean = mean_component(depth), own = mean / sigma_t;
    const V3f above = place + normal * own;
    const float scale = 1.0f / (reach_ * reach_);
    float sum = 0.0f, below = 0.0f;  // below the planes of the points, metres
    Rgb at_surface(0.0f), slope(0.0f);
    lookup_->visit(above, [&](std::uint32_t, std::uint32_t point, const V3f& p, const V3f& n) {
        const V3f way = p - place;
        const float q = 1.0f - (p - above).length2() * scale, under = way.dot(n);
        if (!(q > 0.0f && under > 0.0f)) return;
        const float weight = q * q * std::exp(-2.0f * scale * (way.length2() - own * own));
        sum += weight;
        below += under * weight;
        at_surface += exponents_[2 * point] * weight;
        slope += exponents_[2 * point + 1] * weight;
    });
    if (!(sum > 0.0f)) return false;
    const float nearer = mean > 0.0f ? below / (own * sum) : 1.0f;  // than the plane where it is seen
    for (int c = 0; c < 3; ++c) {
        const EvenLight& light = medium_->even_light[std::size_t(c)];
        const float under = depth[c] * nearer;
        const float bent = light.half_space(under).value - light.half_space(depth[c]).value;
        exponents[1][c] = slope[c] / sum;
        exponents[0][c] = at_surface[c] / sum + exponents[1][c] * (under - depth[c]) + bent;
    }
    return true;
}

std::vector<Rgb> ThinField::at(const AbsorbingPlaces& places, const std::vector<V3f>& below,
                               const GatherOptions& options) const {
    if (!lookup_) return inside(below, options);
    std::vector<Rgb> result(2 * below.size(), Rgb(0.0f));
    std::vector<std::size_t> missed;
    std::vector<V3f> missed_places;
    for (std::size_t i = 0; i < below.size(); ++i) {
        if (places.normals[i] != V3f(0.0f) &&
            near(places.positions[i], places.normals[i], places.depths[i], &result[2 * i])) {
            continue;
        }
        missed.push_back(i);
        missed_places.push_back(below[i]);
    }
    const std::vector<Rgb> sums = inside(missed_places, options);
    for (std::size_t k = 0; k < missed.size(); ++k) std::copy_n(&sums[2 * k], 2, &result[2 * missed[k]]);
    return result;
}

std::vector<Rgb> ThinField::inside(const std::vector<V3f>& places, const GatherOptions& options) const {
    if (places.empty()) return {};
    const Gathered sums =
        tree_->gather(places.data(), places.size(), {kCoarser * options.tolerance, Estimator::sum, false});
    std::vector<Rgb> result(2 * places.size(), Rgb(0.0f));
    for (std::size_t i = 0; i < result.size(); ++i) {
        for (int c = 0; c < 3; ++c) {
            const float coverage = sums.coverage[i / 2][c];
            if (coverage > 0.0f) result[i][c] = sums.exitance[i][c] / coverage;
        }
    }
    return result;
}

}  // namespace frazil
