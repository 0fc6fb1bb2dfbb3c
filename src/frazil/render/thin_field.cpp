#include "frazil/render/thin_field.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "frazil/base/morton_order.h"
#include "frazil/points/point_blend.h"

namespace frazil {
namespace {

// Thickness varies slowly inside: its gathers may be this much coarser.
constexpr float kCoarser = 4.0f;
// How far the mean reaches, at least; kOfDecay of the length over which light is absorbed, 1/sigma_tr [Jensen2001], as that is
// how far thickness is felt.
constexpr float kSpacings = 3.0f, kOfDecay = 0.7f;
// By exp(-kFade r²), r in reaches, points near to the place count for more.
constexpr float kFade = 2.0f;
// Of the reach squared: what the places of points are spread by, at least, before a slope is told from them.
constexpr float kLeastSpread = 0.004f;
// Points nearer to each other than this part of the reach tell no more of it together than some of them.
constexpr float kFewestApart = 0.2f;
constexpr float kFacesAlike = 0.9f;  // cosine

// Of the channel that absorbs most.
float decay_length(const Medium& medium) {
    float most = 0.0f;
    for (int c = 0; c < 3; ++c) {
        most = std::max(most, 3.0f * medium.sigma_a[c] * (medium.sigma_a[c] + medium.sigma_s_prime[c]));
    }
    return most > 0.0f ? 1.0f / std::sqrt(most) : 0.0f;
}

// Of a cell that is partly outside the rest tells of another part of the body than the cell: little of its area counts.
float trusted(float known) {
    const float square = known * known, fourth = square * square;
    return fourth * fourth;
}

// Where their cells are, with as much area as is trusted.
PointSet known_points(PointSet points, const Cells* cells, const Thinness& known) {
    if (cells) points.positions = cells->centroids;
    for (std::size_t k = 0; k < points.size(); ++k) points.areas[k] *= trusted(known.known[k]);
    return points;
}

struct FewPoints {
    PointSet points;
    std::vector<Rgb> exponents;
};

// Of points that follow one another along a curve one stands for those that face as it does, with their mean.
FewPoints few_points(const PointSet& points, const std::vector<Rgb>& exponents, float apart) {
    struct Alike {
        std::uint32_t first;
        Rgb exponents[2] = {Rgb(0.0f), Rgb(0.0f)};
        V3f place{0.0f}, normal{0.0f};
        float area = 0.0f;
    };
    const double closer = double(apart) / points.spacing;
    const std::size_t run = std::max<std::size_t>(1, static_cast<std::size_t>(closer * closer));
    const std::vector<std::uint32_t> order = morton_order(points.positions);
    FewPoints few;
    std::vector<Alike> sets;
    for (std::size_t begin = 0; begin < order.size(); begin += run) {
        sets.clear();
        for (const std::uint32_t k : std::span(order).subspan(begin, std::min(run, order.size() - begin))) {
            const float area = points.areas[k];
            if (!(area > 0.0f)) continue;
            auto of = std::find_if(sets.begin(), sets.end(), [&](const Alike& set) {
                return points.normals[k].dot(points.normals[set.first]) > kFacesAlike;
            });
            if (of == sets.end()) of = sets.insert(sets.end(), Alike{.first = k});
            of->exponents[0] += exponents[2 * k] * area;
            of->exponents[1] += exponents[2 * k + 1] * area;
            of->place += (points.positions[k] - points.positions[of->first]) * area;
            of->normal += points.normals[k] * area;
            of->area += area;
        }
        for (const Alike& set : sets) {
            few.points.positions.push_back(points.positions[set.first] + set.place / set.area);
            few.points.normals.push_back(set.normal.normalized());
            few.points.areas.push_back(set.area);
            few.exponents.insert(few.exponents.end(), {set.exponents[0] / set.area, set.exponents[1] / set.area});
        }
    }
    few.points.spacing = std::max(points.spacing, static_cast<decltype(points.spacing)>(apart));
    return few;
}

}  // namespace

ThinField::ThinField(const PointSet& points, const Cells* cells, const Thinness& known,
                     std::shared_ptr<const PointTree> tree, std::shared_ptr<const ThinMedium> medium)
    : tree_(std::move(tree)), medium_(std::move(medium)) {
    const PointSet here = known_points(points, cells, known);
    is_empty_ = std::all_of(here.areas.begin(), here.areas.end(), [](float area) { return area == 0.0f; });
    if (is_empty_ || !PointBlend::suits(points)) return;
    reach_ = std::max(kSpacings * static_cast<float>(points.spacing), kOfDecay * decay_length(medium_->medium));
    const FewPoints few = few_points(here, known.exponent, kFewestApart * reach_);
    lookup_.emplace(few.points, reach_);
    for (const std::uint32_t i : lookup_->order()) {
        exponents_.insert(exponents_.end(), {few.exponents[2 * i], few.exponents[2 * i + 1]});
        areas_.push_back(few.points.areas[i]);
    }
}

// What makes the mean of where points tell of the place itself, so that the mean is exact for what grows evenly
// (local linear regression): weights are multiplied by 1 - lean · (beside - centre), where that is above zero.
struct ThinField::Lean {
    V3f centre = V3f(0.0f), lean = V3f(0.0f);

    explicit Lean(const std::vector<Near>& points, float least_spread) {
        double sum = 0.0;
        V3d at(0.0);
        for (const Near& point : points) {
            sum += point.weight;
            at += V3d(point.beside) * double(point.weight);
        }
        at /= sum;
        Imath::M33d spread;
        spread *= double(least_spread);
        for (const Near& point : points) {
            const V3d away = V3d(point.beside) - at;
            for (int row = 0; row < 3; ++row) {
                for (int column = 0; column < 3; ++column) {
                    spread[row][column] += away[row] * away[column] * double(point.weight) / sum;
                }
            }
        }
        centre = V3f(at);
        lean = V3f(at * spread.inverse());
    }

    float weight(const Near& point) const {
        return point.weight * std::max(0.0f, 1.0f - lean.dot(point.beside - centre));
    }
};

// False where no point is near. `near_points` is used meanwhile.
bool ThinField::near(const V3f& place, const V3f& normal, const Rgb& depth, std::vector<Near>& near_points,
                     Rgb* exponents) const {
    const float sigma_t = mean_sigma_t(medium_->medium), mean = mean_component(depth), own = mean / sigma_t;
    const V3f above = place + normal * own;
    const float scale = 1.0f / (reach_ * reach_);
    near_points.clear();
    lookup_->visit(above, [&](std::uint32_t, std::uint32_t point, const V3f& p, const V3f& n) {
        const V3f way = p - place;
        const float q = 1.0f - (p - above).length2() * scale, under = way.dot(n);
        if (!(q > 0.0f && under > 0.0f)) return;
        const float weight = areas_[point] * q * q * std::exp(-kFade * scale * (way.length2() - own * own));
        if (weight > 0.0f) near_points.push_back({point, weight, under, way - n * under});
    });
    if (near_points.empty()) return false;
    const Lean lean(near_points, kLeastSpread * reach_ * reach_);
    float sum = 0.0f, below = 0.0f;  // below the planes of the points, metres
    Rgb at_surface(0.0f), slope(0.0f);
    Rgb grown(0.0f);  // from the points' planes down to the place: slope times metres
    for (const Near& point : near_points) {
        const float weight = lean.weight(point);
        sum += weight;
        below += point.under * weight;
        at_surface += exponents_[2 * point.index] * weight;
        slope += exponents_[2 * point.index + 1] * weight;
        grown += exponents_[2 * point.index + 1] * (point.under * weight);
    }
    if (!(sum > 0.0f)) return false;
    const float nearer = mean > 0.0f ? below / (own * sum) : 1.0f;  // than the plane where it is seen
    for (int c = 0; c < 3; ++c) {
        const EvenLight& light = medium_->even_light[std::size_t(c)];
        const float under = depth[c] * nearer;
        const float bent = light.half_space(under).value - light.half_space(depth[c]).value;
        exponents[1][c] = slope[c] / sum;
        const float growth = own > 0.0f ? grown[c] * depth[c] / own : 0.0f;
        exponents[0][c] = (at_surface[c] + growth) / sum - exponents[1][c] * depth[c] + bent;
    }
    return true;
}

std::vector<Rgb> ThinField::at(const AbsorbingPlaces& places, const std::vector<V3f>& below,
                               const GatherOptions& options) const {
    if (!lookup_) return inside(below, options);
    std::vector<Rgb> result(2 * below.size(), Rgb(0.0f));
    std::vector<std::size_t> missed;
    std::vector<V3f> missed_places;
    std::vector<Near> near_points;
    for (std::size_t i = 0; i < below.size(); ++i) {
        if (places.normals[i] != V3f(0.0f) &&
            near(places.positions[i], places.normals[i], places.depths[i], near_points, &result[2 * i])) {
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
    if (places.empty() || is_empty_) return std::vector<Rgb>(2 * places.size(), Rgb(0.0f));
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
