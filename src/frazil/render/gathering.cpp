#include "frazil/render/gathering.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "frazil/base/random.h"

namespace frazil {
namespace {

// A gather serves places of a pixel that lie in one cell of so many spacings of the points, or mean free paths if these are
// shorter: exitance is linear over it within one or two thousandths.
constexpr float kCell = 0.5f;

constexpr std::uint32_t kNoRow = ~std::uint32_t(0);

// What the requests of one body are answered with, and which row each takes.
struct Answers {
    Gathered gathered, at_surface;  // the latter where the body has a surface_tree
    std::vector<Rgb> thin;          // thickness_gains; empty where the body has none
    std::vector<std::uint32_t> row_of;
};

std::vector<V3f> moved(std::vector<V3f> positions, const M44f& matrix) {
    for (V3f& position : positions) position = position * matrix;
    return positions;
}

// Each place that requests without a row ask for once, as deep as these tell and on the surface.
struct Places {
    std::vector<V3f> below, surface;
};

Places shared_places(std::span<const GatherRequest> requests, float cell, std::vector<std::uint32_t>& row_of) {
    struct Key {
        std::uint64_t hash;
        std::uint32_t request;
    };
    std::vector<Key> keys;
    for (std::uint32_t i = 0; i < requests.size(); ++i) {
        if (row_of[i] != kNoRow) continue;
        const V3f at = requests[i].position / cell;
        const auto bits = [](float x) { return static_cast<std::uint32_t>(static_cast<std::int64_t>(std::floor(x))); };
        keys.push_back({std::uint64_t(requests[i].pixel) << 32 | hash(bits(at.x), bits(at.y), bits(at.z)), i});
    }
    std::sort(keys.begin(), keys.end(),
              [](const Key& a, const Key& b) { return a.hash != b.hash ? a.hash < b.hash : a.request < b.request; });
    Places places;
    for (std::size_t begin = 0, end = 0; begin < keys.size(); begin = end) {
        V3d sum(0.0), inwards(0.0);
        for (end = begin; end < keys.size() && keys[end].hash == keys[begin].hash; ++end) {
            const GatherRequest& request = requests[keys[end].request];
            sum += V3d(request.position);
            inwards -= V3d(request.normal) * double(request.depth);
            row_of[keys[end].request] = static_cast<std::uint32_t>(places.below.size());
        }
        places.below.emplace_back((sum + inwards) / double(end - begin));
        places.surface.emplace_back(sum / double(end - begin));
    }
    return places;
}

template <class Value>
void append(std::vector<Value>& values, const std::vector<Value>& more) {
    values.insert(values.end(), more.begin(), more.end());
}

// Gather where the camera sees the body itself; blend the gathers at its points, where there are any, for the rest, and those
// of a lattice inside.
// `places` are those that are gathered here: the first rows.
Answers answers_for(const Body& body, std::span<const GatherRequest> requests, const GatherOptions& options,
                    std::vector<V3f>& places) {
    Answers answers;
    answers.row_of.assign(requests.size(), kNoRow);
    Gathered blended;
    std::vector<Rgb> blended_thin;
    std::vector<std::uint32_t> is_blended;
    for (std::uint32_t i = 0; i < requests.size() && body.at_points; ++i) {
        const GatherRequest& request = requests[i];
        if (request.is_primary) continue;
        const V3f position = request.position * body.to_points;
        V3f normal;
        body.to_points.multDirMatrix(request.normal, normal);
        if (!body.at_points->append(position, normal, blended, blended_thin)) {
            body.inside->append(position, blended, blended_thin);
        }
        answers.row_of[i] = static_cast<std::uint32_t>(blended.coverage.size() - 1);
        is_blended.push_back(i);
    }
    const float mean_free_path = 1.0f / max_component(body.medium.sigma_s_prime + body.medium.sigma_a);
    Places shared = shared_places(requests, kCell * std::min(body.spacing, mean_free_path), answers.row_of);
    places = std::move(shared.below);
    const std::vector<V3f> at_tree = moved(places, body.to_points);
    answers.gathered = body.tree->gather(at_tree.data(), at_tree.size(), options);
    if (body.surface_tree) {
        const std::vector<V3f> there = moved(std::move(shared.surface), body.to_points);
        answers.at_surface = body.surface_tree->gather(there.data(), there.size(), options);
    }
    answers.thin = thickness_gains(body.thickness.get(), at_tree.data(), at_tree.size(), options);
    append(answers.gathered.exitance, blended.exitance);
    append(answers.gathered.coverage, blended.coverage);
    append(answers.gathered.layers, blended.layers);
    append(answers.thin, blended_thin);
    for (const std::uint32_t i : is_blended) answers.row_of[i] += static_cast<std::uint32_t>(places.size());
    return answers;
}

// Light of the core at a row of answers, as a compensation has it: sums that it divides by their coverage stand inwards, others
// on the surface.
class Exitance {
  public:
    Exitance(const Body& body, const Answers& answers, std::size_t row)
        : body_(body), answers_(answers), row_(row), thin_(answers.thin.empty() ? nullptr : &answers.thin[row]) {}

    // W on the surface, if it is known there.
    const Rgb& coverage() const {
        return (answers_.at_surface.coverage.empty() ? answers_.gathered : answers_.at_surface).coverage[row_];
    }
    Rgb operator()(const Compensation& compensation, std::size_t group) const {
        return of(compensation, [&](const Gathered& sums) { return exitance(sums, group); });
    }
    // The part of a ramp's knot.
    Rgb knot(const Compensation& compensation, std::size_t knot, std::size_t group) const {
        return of(compensation, [&](const Gathered& sums) {
            return sums.knots > 0 ? sums.layers[(row_ * sums.knots + knot) * sums.groups + group]
                                  : exitance(sums, group);
        });
    }
    // What the sums below the surface are scaled by, all groups together.
    Rgb gain_below(const Compensation& compensation) const {
        if (answers_.at_surface.coverage.empty()) return gain(compensation, answers_.gathered);
        Rgb whole(0.0f), sums(0.0f), scale(0.0f);
        for (std::size_t group = 0; group < answers_.gathered.groups; ++group) {
            whole += (*this)(compensation, group);
            sums += exitance(answers_.gathered, group);
        }
        for (int c = 0; c < 3; ++c) scale[c] = sums[c] != 0.0f ? whole[c] / sums[c] : 0.0f;
        return scale;
    }

  private:
    template <class Value>
    Rgb of(const Compensation& compensation, const Value& value) const {
        const Rgb below = value(answers_.gathered);
        if (answers_.at_surface.coverage.empty()) return below * gain(compensation, answers_.gathered);
        const Rgb surface = value(answers_.at_surface);
        if (!keeps_energy(compensation.mode)) return surface * gain(compensation, answers_.at_surface);
        Compensation full = compensation;
        full.strength = 1.0f;
        return surface + (below * gain(full, answers_.gathered) - surface) * compensation.strength;
    }
    Rgb exitance(const Gathered& sums, std::size_t group) const { return sums.exitance[row_ * sums.groups + group]; }
    Rgb gain(const Compensation& compensation, const Gathered& sums) const {
        return body_.gain(compensation, sums.coverage[row_],
                          compensation.mode == CompensationMode::depth ? thin_ : nullptr);
    }

    const Body& body_;
    const Answers& answers_;
    std::size_t row_;
    const Rgb* thin_;
};

}  // namespace

struct Gathering::Answer {
    const Answers& answers;
    Exitance exitance;
};

void Gathering::answer(const GatherOptions& options, Tile& tile) const {
    // One gather per body: requests grouped by object, in their own order.
    std::stable_sort(tile.requests.begin(), tile.requests.end(),
                     [](const GatherRequest& a, const GatherRequest& b) { return a.object < b.object; });
    for (std::size_t begin = 0; begin < tile.requests.size();) {
        const Body& body = *bodies_[tile.requests[begin].object];
        std::size_t end = begin;
        while (end < tile.requests.size() && tile.requests[end].object == tile.requests[begin].object) ++end;
        GatherOptions with_layers = options;
        with_layers.ramp_layers = !layout_.knots.empty() && !body.material->ramp.is_empty();
        std::vector<V3f> places;
        const Answers answers =
            answers_for(body, std::span(tile.requests).subspan(begin, end - begin), with_layers, places);
        const Gathered& gathered = answers.gathered;
        tile.gathers += places.size();
        Gathered by_overlay;
        if (body.overlay_tree) {
            const std::vector<V3f> at_tree = moved(places, body.to_points);
            by_overlay = body.overlay_tree->gather(at_tree.data(), at_tree.size(), options);
        }

        for (std::size_t i = begin; i < end; ++i) {
            const GatherRequest& request = tile.requests[i];
            const std::size_t row = answers.row_of[i - begin];
            const Answer answer{answers, Exitance(body, answers, row)};
            tile.subset = request.subset;
            const Rgb& coverage = answer.exitance.coverage();
            const Compensation& compensation = body.material->compensation;
            const Rgb gain = answer.exitance.gain_below(compensation);
            const Rgb fill = fill_amount(compensation, coverage, body.total_reflectance) * request.entering;
            for (std::size_t group = 0; group < gathered.groups; ++group) {
                Rgb exitance = answer.exitance(compensation, group);
                if (group == request.entering_group) exitance += fill;
                tile.add(request.pixel, Component::translucency, group, exitance * request.translucency);
                tile.add(request.pixel, Component::diffuse, group, exitance * request.diffuse);
                tile.add(request.pixel, Component::specular, group, exitance * request.specular);
                tile.add(request.pixel, Component::refraction, group, exitance * request.refraction);
                for (const auto& [lpe, state, weight] : request.lpes) {
                    if (!layout_.lpes[lpe].ends_in_group(state, group)) continue;
                    tile.add_lpe(request.pixel, lpe, exitance * weight);
                }
            }
            if (request.is_primary) {
                const Rgb& total = body.total_reflectance;
                Rgb lacking(0.0f);
                for (int c = 0; c < 3; ++c) lacking[c] = total[c] > 0.0f ? 1.0f - coverage[c] / total[c] : 0.0f;
                tile.add_coverage(request.pixel, coverage * request.samples, lacking * request.samples);
            }
            add_overlays(request, &gathered.exitance[row * gathered.groups], gathered.groups, gain, fill, tile);
            if (request.is_primary && body.overlay_tree) {
                add_taken(request, &by_overlay.exitance[row * by_overlay.groups], gathered.groups, gain, tile);
            }
            if (layout_.ice_plane_count() == 0) continue;
            const Rgb elsewhere = request.diffuse + request.specular + request.refraction;
            if (request.is_primary) add_planes(request, request.translucency, 0, answer, tile);
            if (elsewhere != Rgb(0.0f)) {
                add_planes(request, elsewhere, layout_.seen_plane_count(), answer, tile);
                for (std::size_t group = 0; group < gathered.groups; ++group) {
                    const Rgb exitance = answer.exitance(compensation, group);
                    tile.add_to_plane(request.pixel, layout_.ice_plane_count() - 1, group, exitance * elsewhere);
                }
                tile.add_to_plane(request.pixel, layout_.ice_plane_count() - 1, request.entering_group,
                                  fill * elsewhere);
            }
        }
        begin = end;
    }
    tile.requests.clear();
}

// What a change of each overlay's opacity adds to light that came by way of it.
void Gathering::add_overlays(const GatherRequest& request, const Rgb* exitance, std::size_t groups, const Rgb& gain,
                             const Rgb& fill, Tile& tile) const {
    for (const GatherRequest::Overlay& overlay : request.overlays) {
        for (std::size_t group = 0; group < groups; ++group) {
            Rgb light = exitance[group] * gain;
            if (group == request.entering_group) light += fill;
            const auto add = [&](FilmLayout::OverlayPlane plane, const Rgb& change) {
                tile.add_to_plane(request.pixel, overlay.plane + plane, group, change);
            };
            add(FilmLayout::kDiffuse, light * request.diffuse * overlay.diffuse);
            add(FilmLayout::kTranslucency, light * overlay.core * request.translucency);
            add(FilmLayout::kRefraction, light * request.refraction * overlay.seen_through);
        }
    }
}

// What it takes from the light that enters the points around here, be the overlay here or on another member of the
// translucency set. `taken` is (layers, groups).
void Gathering::add_taken(const GatherRequest& request, const Rgb* taken, std::size_t groups, const Rgb& gain,
                          Tile& tile) const {
    const std::vector<std::uint32_t>& layers = bodies_[request.object]->overlay_layers;
    for (std::size_t k = 0; k < layers.size(); ++k) {
        const std::size_t plane = layout_.overlay_plane(layers[k]);
        Rgb here(0.0f);  // the overlay's own change of what comes from the core
        for (const GatherRequest::Overlay& overlay : request.overlays) {
            if (overlay.plane == plane) here = overlay.core;
        }
        for (std::size_t group = 0; group < groups; ++group) {
            const Rgb less = taken[k * groups + group] * gain * request.translucency;
            tile.add_to_plane(request.pixel, plane + FilmLayout::kTranslucency, group, less);
            tile.add_to_plane(request.pixel, plane + FilmLayout::kSquared, group, less * here);
        }
    }
}

// Light of the core once more, apart by ramp knot and as every compensation mode that was asked for would have it: `weight`
// is radiance per exitance, `base` the first plane.
void Gathering::add_planes(const GatherRequest& request, const Rgb& weight, std::size_t base, const Answer& answer,
                           Tile& tile) const {
    const Gathered& gathered = answer.answers.gathered;
    const Body& body = *bodies_[request.object];
    const Compensation& rendered = body.material->compensation;
    const Rgb& coverage = answer.exitance.coverage();
    const auto fill_of = [&](const Compensation& compensation) {
        return fill_amount(compensation, coverage, body.total_reflectance) * request.entering * weight;
    };
    if (!layout_.knots.empty()) {
        const std::size_t first = base + layout_.first_knot[scene_.objects[request.object].material];
        for (std::size_t k = 0; k < std::max<std::size_t>(gathered.knots, 1); ++k) {
            for (std::size_t g = 0; g < gathered.groups; ++g) {
                tile.add_to_plane(request.pixel, first + k, g, answer.exitance.knot(rendered, k, g) * weight);
            }
        }
        if (layout_.fill_plane != FilmLayout::kNone) {
            tile.add_to_plane(request.pixel, base + layout_.fill_plane, request.entering_group, fill_of(rendered));
        }
    }
    for (std::size_t m = 0; m < layout_.modes.size(); ++m) {
        Compensation full = rendered;
        full.mode = layout_.modes[m];
        full.strength = 1.0f;
        const std::size_t plane = base + layout_.knots.size() + m;
        for (std::size_t g = 0; g < gathered.groups; ++g) {
            tile.add_to_plane(request.pixel, plane, g, answer.exitance(full, g) * weight);
        }
        tile.add_to_plane(request.pixel, plane, request.entering_group, fill_of(full));
    }
}

}  // namespace frazil
