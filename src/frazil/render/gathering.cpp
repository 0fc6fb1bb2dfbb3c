#include "frazil/render/gathering.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "frazil/render/place_cells.h"

namespace frazil {
namespace {

// A gather serves places of a pixel that lie in one cell of so many spacings of the points, or mean free paths if these are
// shorter: exitance is linear over it within one or two thousandths. Where points are dense cells stay as small: over a quarter
// of a mean free path the mean of places is inside thin tips, and half a percent off.
constexpr float kCell = 0.5f;

// The light that fills up is asked by chance where it brings less: of what a white diffuse surface in front of the camera gets.
constexpr float kFaintFill = 0.005f;

constexpr std::uint32_t kNoRow = ~std::uint32_t(0);

// Each place that requests without a row ask for once, as deep as these tell.
CorePlaces shared_places(std::span<GatherRequest* const> requests, float cell, std::vector<std::uint32_t>& row_of) {
    struct Key {
        std::uint64_t hash;
        std::uint32_t request;
    };
    std::vector<Key> keys;
    // Pixel by pixel: their requests lie side by side.
    for (std::uint32_t begin = 0, end = 0; begin < requests.size(); begin = end) {
        const std::uint32_t pixel = requests[begin]->pixel;
        Box3f box;
        for (end = begin; end < requests.size() && requests[end]->pixel == pixel; ++end) {
            if (row_of[end] == kNoRow) box.extendBy(requests[end]->position);
        }
        const PlaceCells cells(box, cell);
        for (std::uint32_t i = begin; i < end; ++i) {
            if (row_of[i] == kNoRow)
                keys.push_back({std::uint64_t(pixel) << 32 | cells.cell(requests[i]->position), i});
        }
    }
    std::sort(keys.begin(), keys.end(),
              [](const Key& a, const Key& b) { return a.hash != b.hash ? a.hash < b.hash : a.request < b.request; });
    CorePlaces places;
    for (std::size_t begin = 0, end = 0; begin < keys.size(); begin = end) {
        V3d sum(0.0), inwards(0.0), absorbing(0.0);
        V3f normal(0.0f);
        Rgb depth(0.0f);
        for (end = begin; end < keys.size() && keys[end].hash == keys[begin].hash; ++end) {
            const GatherRequest& request = *requests[keys[end].request];
            sum += V3d(request.position);
            inwards -= V3d(request.normal) * double(request.depth);
            absorbing += V3d(request.absorbing);
            normal += request.normal;
            depth += request.absorbed_at;
            row_of[keys[end].request] = static_cast<std::uint32_t>(places.below.size());
        }
        places.below.emplace_back((sum + inwards) / double(end - begin));
        places.on_surface.emplace_back(sum / double(end - begin));
        places.absorbing.positions.emplace_back(absorbing / double(end - begin));
        places.absorbing.normals.push_back(normal.normalized());
        places.absorbing.depths.push_back(depth / float(end - begin));
    }
    return places;
}

// What the sums of a place are scaled by, those below and those on the surface, to be exitance.
struct Scales {
    Rgb below = Rgb(0.0f), on_surface = Rgb(0.0f);
};

// Light of the core at a row of sums, as a compensation has it: sums that it divides by their coverage stand inwards, others
// on the surface.
class Exitance {
  public:
    // `plane` is what of even light a half space sends where it is seen, the rest is absorbed so many free paths deep.
    Exitance(const Body& body, const CoreSums& sums, std::size_t row, const Rgb& plane, const Rgb& absorbed_at)
        : body_(body),
          below_(sums.below(row)),
          on_surface_(sums.on_surface(row)),
          has_surface_(sums.columns().has_surface),
          overlays_(sums.overlays(row)) {
        if (const Rgb* exponent = sums.thin(row)) {
            thin_ = thin_gain(exponent[0] + exponent[1] * absorbed_at, plane);
            has_thin_ = true;
        }
    }

    std::size_t groups() const { return below_.groups; }
    std::size_t knots() const { return std::max<std::size_t>(below_.knots, 1); }
    // W on the surface, if it is known there.
    const Rgb& coverage() const { return on_surface_.coverage(); }

    Scales scales(const Compensation& compensation) const {
        if (!has_surface_) return {gain(compensation, below_), Rgb(0.0f)};
        if (!keeps_energy(compensation.mode)) return {Rgb(0.0f), gain(compensation, on_surface_)};
        Compensation full = compensation;
        full.strength = 1.0f;
        return {gain(full, below_) * compensation.strength, Rgb(1.0f - compensation.strength)};
    }
    Rgb operator()(const Scales& scales, std::size_t group) const {
        return below_.exitance(group) * scales.below + on_surface_.exitance(group) * scales.on_surface;
    }
    // The part of a ramp's knot.
    Rgb knot(const Scales& scales, std::size_t knot, std::size_t group) const {
        return below_.knot(knot, group) * scales.below + on_surface_.knot(knot, group) * scales.on_surface;
    }
    // As it is summed where light is scattered first.
    const Rgb& below(std::size_t group) const { return below_.exitance(group); }
    // What that is scaled by, all groups together.
    Rgb gain_below(const Scales& scales) const {
        if (scales.on_surface == Rgb(0.0f)) return scales.below;
        Rgb whole(0.0f), sums(0.0f), scale(0.0f);
        for (std::size_t group = 0; group < groups(); ++group) {
            whole += (*this)(scales, group);
            sums += below(group);
        }
        for (int c = 0; c < 3; ++c) scale[c] = sums[c] != 0.0f ? whole[c] / sums[c] : 0.0f;
        return scale;
    }
    // What overlays take of it, (layers, groups); null without.
    const Rgb* overlays() const { return overlays_; }

  private:
    Rgb gain(const Compensation& compensation, const TreeSums& sums) const {
        return body_.gain(compensation, sums.coverage(),
                          compensation.mode == CompensationMode::depth && has_thin_ ? &thin_ : nullptr);
    }

    const Body& body_;
    TreeSums below_, on_surface_;  // the latter is the former where there is none
    bool has_surface_;
    bool has_thin_ = false;
    Rgb thin_ = Rgb(1.0f);
    const Rgb* overlays_;
};

}  // namespace

// What the requests of one body are answered with, and which row each takes.
struct Gathering::Answers {
    CoreSums sums;
    std::vector<std::uint32_t> row_of;
    std::size_t gathers;  // the first rows; the others are blends
};

Gathering::Answers Gathering::answers_for(const Body& body, Requests requests, const GatherOptions& options) {
    std::vector<std::uint32_t> row_of(requests.size(), kNoRow), is_blended;
    SumColumns columns;
    if (body.at_points) {
        columns = body.at_points->columns();
        columns.overlays = body.trees.overlays ? body.overlay_layers.size() * columns.groups : 0;
    }
    CoreSums blended(columns);
    for (std::uint32_t i = 0; i < requests.size() && body.at_points; ++i) {
        const GatherRequest& request = *requests[i];
        if (request.is_primary) continue;
        const V3f position = request.position * body.to_points;
        V3f normal;
        body.to_points.multDirMatrix(request.normal, normal);
        if (!body.at_points->append(position, normal, blended)) body.inside->append(position, blended);
        row_of[i] = static_cast<std::uint32_t>(blended.size() - 1);
        is_blended.push_back(i);
    }
    CorePlaces places = shared_places(requests, kCell * std::min(body.spacing, body.mean_free_path()), row_of);
    for (std::vector<V3f>* kind : {&places.below, &places.on_surface, &places.absorbing.positions}) {
        for (V3f& position : *kind) position = position * body.to_points;
    }
    for (V3f& normal : places.absorbing.normals) body.to_points.multDirMatrix(V3f(normal), normal);
    CoreSums sums = gather_core(body.trees, places, options);
    sums.append(blended);
    for (const std::uint32_t i : is_blended) row_of[i] += static_cast<std::uint32_t>(places.below.size());
    return {std::move(sums), std::move(row_of), places.below.size()};
}

// Estimate the light that enters at the requests' places, where it fills up anything. What brings less than a white diffuse
// surface's part of it is asked by chance.
void Gathering::ask_entering_light(const Body& body, Requests requests, const Answers& answers,
                                   const Tile& tile) const {
    Compensation fill = body.material->compensation;
    if (fill.mode != CompensationMode::fill && !layout_.needs_fill()) return;
    // At full strength, so that a layer asks for the same as a render with this compensation.
    fill.mode = CompensationMode::fill, fill.strength = 1.0f;
    std::vector<const EnteringPlace*> places;
    std::vector<GatherRequest*> asking;
    std::vector<float> counts;
    for (std::size_t i = 0; i < requests.size(); ++i) {
        GatherRequest& request = *requests[i];
        if (request.entering_place == GatherRequest::kNowhere) continue;
        const EnteringPlace& place = tile.entering_places[request.entering_place];
        const Rgb& coverage = answers.sums.on_surface(answers.row_of[i]).coverage();
        const Rgb weight = request.translucency + request.diffuse + request.specular + request.refraction;
        const float brought =
            max_component(fill_amount(fill, coverage, body.total_reflectance) * weight) * (kPi / request.samples);
        if (!(place.u_ask * kFaintFill < brought)) continue;
        places.push_back(&place);
        asking.push_back(&request);
        counts.push_back(std::max(1.0f, kFaintFill / brought));
    }
    std::vector<Entering> entering(places.size());
    entering_light_->sample(places, entering);
    for (std::size_t k = 0; k < asking.size(); ++k) {
        asking[k]->entering = entering[k].irradiance * counts[k];
        asking[k]->entering_group = entering[k].group;
    }
}

struct Gathering::Answer {
    const Exitance& exitance;
    const Scales& rendered;
};

void Gathering::answer(const GatherOptions& options, Tile& tile) const {
    // One gather per body: requests grouped by object, in their own order.
    std::vector<GatherRequest*> requests;
    requests.reserve(tile.requests.size());
    for (GatherRequest& request : tile.requests) requests.push_back(&request);
    std::stable_sort(requests.begin(), requests.end(),
                     [](const GatherRequest* a, const GatherRequest* b) { return a->object < b->object; });
    for (std::size_t begin = 0; begin < requests.size();) {
        const Body& body = *bodies_[requests[begin]->object];
        std::size_t end = begin;
        while (end < requests.size() && requests[end]->object == requests[begin]->object) ++end;
        GatherOptions with_layers = options;
        with_layers.ramp_layers = !layout_.knots.empty() && !body.material->ramp.is_empty();
        const Requests of_body = Requests(requests).subspan(begin, end - begin);
        const Answers answers = answers_for(body, of_body, with_layers);
        tile.gathers += answers.gathers;
        if (entering_light_) ask_entering_light(body, of_body, answers, tile);

        for (std::size_t i = begin; i < end; ++i) {
            const GatherRequest& request = *requests[i];
            const Exitance exitance(body, answers.sums, answers.row_of[i - begin], request.plane, request.absorbed_at);
            const Scales scales = exitance.scales(body.material->compensation);
            tile.subset = request.subset;
            const Rgb& coverage = exitance.coverage();
            const Rgb fill =
                fill_amount(body.material->compensation, coverage, body.total_reflectance) * request.entering;
            for (std::size_t group = 0; group < exitance.groups(); ++group) {
                Rgb light = exitance(scales, group);
                if (group == request.entering_group) light += fill;
                const auto add = [&](Component component, const Rgb& weight) {
                    if (weight != Rgb(0.0f)) tile.add(request.pixel, component, group, light * weight);
                };
                add(Component::translucency, request.translucency);
                add(Component::diffuse, request.diffuse);
                add(Component::specular, request.specular);
                add(Component::refraction, request.refraction);
                for (const auto& [lpe, state, weight] : request.lpes) {
                    if (!layout_.lpes[lpe].ends_in_group(state, group)) continue;
                    tile.add_lpe(request.pixel, lpe, light * weight);
                }
            }
            if (request.is_primary) {
                const Rgb& total = body.total_reflectance;
                Rgb lacking(0.0f);
                for (int c = 0; c < 3; ++c) lacking[c] = total[c] > 0.0f ? 1.0f - coverage[c] / total[c] : 0.0f;
                tile.add_coverage(request.pixel, coverage * request.samples, lacking * request.samples);
            }
            const Answer answer{exitance, scales};
            add_overlays(request, answer, fill, tile);
            if (layout_.ice_plane_count() == 0) continue;
            const Rgb elsewhere = request.diffuse + request.specular + request.refraction;
            if (request.is_primary) add_planes(request, request.translucency, 0, answer, tile);
            if (elsewhere != Rgb(0.0f)) {
                add_planes(request, elsewhere, layout_.seen_plane_count(), answer, tile);
                for (std::size_t group = 0; group < exitance.groups(); ++group) {
                    tile.add_to_plane(request.pixel, layout_.ice_plane_count() - 1, group,
                                      exitance(scales, group) * elsewhere);
                }
                tile.add_to_plane(request.pixel, layout_.ice_plane_count() - 1, request.entering_group,
                                  fill * elsewhere);
            }
        }
        begin = end;
    }
    tile.requests.clear();
    tile.overlays.clear();
    tile.entering_places.clear();
}

// What a change of each overlay's opacity adds to light that came by way of it.
void Gathering::add_overlays(const GatherRequest& request, const Answer& answer, const Rgb& fill, Tile& tile) const {
    const Exitance& exitance = answer.exitance;
    const bool is_taken_from = request.is_primary && exitance.overlays();
    if (request.overlay_count == 0 && !is_taken_from) return;
    const Rgb gain = exitance.gain_below(answer.rendered);
    for (const GatherRequest::Overlay& overlay : tile.overlays_of(request)) {
        for (std::size_t group = 0; group < exitance.groups(); ++group) {
            Rgb light = exitance.below(group) * gain;
            if (group == request.entering_group) light += fill;
            const auto add = [&](FilmLayout::OverlayPlane plane, const Rgb& weight, const Rgb& change) {
                if (weight == Rgb(0.0f)) return;
                tile.add_to_plane(request.pixel, overlay.plane + plane, group, light * weight * change);
            };
            add(FilmLayout::kDiffuse, request.diffuse, overlay.diffuse);
            add(FilmLayout::kTranslucency, request.translucency, overlay.core);
            add(FilmLayout::kRefraction, request.refraction, overlay.seen_through);
        }
    }
    if (is_taken_from) add_taken(request, answer, gain, tile);
}

// What it takes from the light that enters the points around here, be the overlay here or on another member of the
// translucency set.
void Gathering::add_taken(const GatherRequest& request, const Answer& answer, const Rgb& gain, Tile& tile) const {
    const std::vector<std::uint32_t>& layers = bodies_[request.object]->overlay_layers;
    const std::size_t groups = answer.exitance.groups();
    for (std::size_t k = 0; k < layers.size(); ++k) {
        const std::size_t plane = layout_.overlay_plane(layers[k]);
        Rgb here(0.0f);  // the overlay's own change of what comes from the core
        for (const GatherRequest::Overlay& overlay : tile.overlays_of(request)) {
            if (overlay.plane == plane) here = overlay.core;
        }
        for (std::size_t group = 0; group < groups; ++group) {
            const Rgb less = answer.exitance.overlays()[k * groups + group] * gain * request.translucency;
            tile.add_to_plane(request.pixel, plane + FilmLayout::kTranslucency, group, less);
            tile.add_to_plane(request.pixel, plane + FilmLayout::kSquared, group, less * here);
        }
    }
}

// Light of the core once more, apart by ramp knot and as every compensation mode that was asked for would have it: `weight`
// is radiance per exitance, `base` the first plane.
void Gathering::add_planes(const GatherRequest& request, const Rgb& weight, std::size_t base, const Answer& answer,
                           Tile& tile) const {
    const Exitance& exitance = answer.exitance;
    const Body& body = *bodies_[request.object];
    const Compensation& rendered = body.material->compensation;
    const auto fill_of = [&](const Compensation& compensation) {
        return fill_amount(compensation, exitance.coverage(), body.total_reflectance) * request.entering * weight;
    };
    if (!layout_.knots.empty()) {
        const std::size_t first = base + layout_.first_knot[scene_.objects[request.object].material];
        for (std::size_t k = 0; k < exitance.knots(); ++k) {
            for (std::size_t g = 0; g < exitance.groups(); ++g) {
                tile.add_to_plane(request.pixel, first + k, g, exitance.knot(answer.rendered, k, g) * weight);
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
        const Scales scales = exitance.scales(full);
        const std::size_t plane = base + layout_.knots.size() + m;
        for (std::size_t g = 0; g < exitance.groups(); ++g) {
            tile.add_to_plane(request.pixel, plane, g, exitance(scales, g) * weight);
        }
        tile.add_to_plane(request.pixel, plane, request.entering_group, fill_of(full));
    }
}

}  // namespace frazil
