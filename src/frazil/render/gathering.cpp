#include "frazil/render/gathering.h"

#include <algorithm>
#include <cmath>

#include "frazil/base/random.h"

namespace frazil {
namespace {

// A gather serves places of a pixel that lie in one cell of so many spacings of the points, or mean free paths if these are
// shorter: exitance is linear over it within one or two thousandths.
constexpr float kCell = 0.5f;

// Gathers of one body: each place once, and which of them each request takes.
struct Places {
    std::vector<V3f> positions;
    std::vector<std::uint32_t> of_request;
};

std::vector<V3f> moved(std::vector<V3f> positions, const M44f& matrix) {
    for (V3f& position : positions) position = position * matrix;
    return positions;
}

Places shared_places(const GatherRequest* requests, std::size_t count, float cell) {
    struct Key {
        std::uint64_t hash;
        std::uint32_t request;
    };
    std::vector<Key> keys(count);
    for (std::size_t i = 0; i < count; ++i) {
        const V3f at = requests[i].position / cell;
        const auto bits = [](float x) { return static_cast<std::uint32_t>(static_cast<std::int64_t>(std::floor(x))); };
        const std::uint32_t column = hash(bits(at.x), bits(at.y), bits(at.z));
        keys[i] = {std::uint64_t(requests[i].pixel) << 32 | column, static_cast<std::uint32_t>(i)};
    }
    std::sort(keys.begin(), keys.end(),
              [](const Key& a, const Key& b) { return a.hash != b.hash ? a.hash < b.hash : a.request < b.request; });
    Places places;
    places.of_request.resize(count);
    for (std::size_t begin = 0, end = 0; begin < count; begin = end) {
        V3d sum(0.0);
        for (end = begin; end < count && keys[end].hash == keys[begin].hash; ++end) {
            sum += V3d(requests[keys[end].request].position);
            places.of_request[keys[end].request] = static_cast<std::uint32_t>(places.positions.size());
        }
        places.positions.emplace_back(sum / double(end - begin));
    }
    return places;
}

}  // namespace

void Gathering::answer(const GatherOptions& options, Tile& tile) const {
    // One gather per body: requests grouped by object, in their own order.
    std::stable_sort(tile.requests.begin(), tile.requests.end(),
                     [](const GatherRequest& a, const GatherRequest& b) { return a.object < b.object; });
    for (std::size_t begin = 0; begin < tile.requests.size();) {
        const Body& body = *bodies_[tile.requests[begin].object];
        std::size_t end = begin;
        while (end < tile.requests.size() && tile.requests[end].object == tile.requests[begin].object) ++end;
        const Medium& medium = body.material->medium;
        const float mean_free_path = 1.0f / max_component(medium.sigma_s_prime + medium.sigma_a);
        const auto [places, place_of] =
            shared_places(&tile.requests[begin], end - begin, kCell * std::min(body.spacing, mean_free_path));
        tile.gathers += places.size();
        const std::vector<V3f> positions = moved(places, body.to_points);
        GatherOptions with_layers = options;
        with_layers.ramp_layers = !layout_.knots.empty() && !body.material->ramp.is_empty();
        const Gathered gathered = body.tree->gather(positions.data(), positions.size(), with_layers);
        Gathered by_overlay;
        if (body.overlay_tree) {
            const std::vector<V3f> own = moved(places, body.to_own_points);
            by_overlay = body.overlay_tree->gather(own.data(), own.size(), options);
        }
        const std::vector<Rgb> thin =
            thickness_gains(body.thickness.get(), positions.data(), positions.size(), with_layers);

        for (std::size_t i = begin; i < end; ++i) {
            const GatherRequest& request = tile.requests[i];
            const std::size_t row = place_of[i - begin];
            tile.subset = request.subset;
            const Rgb& coverage = gathered.coverage[row];
            const Compensation& compensation = body.material->compensation;
            const Rgb* thin_gain = thin.empty() ? nullptr : &thin[row];
            const Rgb gain =
                body.gain(compensation, coverage, compensation.mode == CompensationMode::depth ? thin_gain : nullptr);
            const Rgb fill = fill_amount(compensation, coverage, body.total_reflectance) * request.entering;
            for (std::size_t group = 0; group < gathered.groups; ++group) {
                Rgb exitance = gathered.exitance[row * gathered.groups + group] * gain;
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
                tile.add_coverage(request.pixel, coverage, lacking);
            }
            if (!request.overlays.empty()) {
                const Rgb* taken =
                    request.is_primary && body.overlay_tree ? &by_overlay.exitance[row * by_overlay.groups] : nullptr;
                add_overlays(request, &gathered.exitance[row * gathered.groups], taken, gathered.groups, gain, fill,
                             tile);
            }
            if (layout_.ice_plane_count() == 0) continue;
            const Rgb elsewhere = request.diffuse + request.specular + request.refraction;
            if (request.is_primary) add_planes(request, request.translucency, 0, gathered, row, thin_gain, tile);
            if (elsewhere != Rgb(0.0f)) {
                add_planes(request, elsewhere, layout_.seen_plane_count(), gathered, row, thin_gain, tile);
                for (std::size_t group = 0; group < gathered.groups; ++group) {
                    const Rgb exitance = gathered.exitance[row * gathered.groups + group] * gain;
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

// What a change of each overlay's opacity adds: to light that came by way of it, and to what enters the points around here.
// `taken` is (overlays, groups).
void Gathering::add_overlays(const GatherRequest& request, const Rgb* exitance, const Rgb* taken, std::size_t groups,
                             const Rgb& gain, const Rgb& fill, Tile& tile) const {
    for (const GatherRequest::Overlay& overlay : request.overlays) {
        for (std::size_t group = 0; group < groups; ++group) {
            Rgb light = exitance[group] * gain;
            if (group == request.entering_group) light += fill;
            const auto add = [&](FilmLayout::OverlayPlane plane, const Rgb& change) {
                tile.add_to_plane(request.pixel, overlay.plane + plane, group, change);
            };
            const Rgb less = taken ? taken[overlay.own * groups + group] * gain : Rgb(0.0f);
            add(FilmLayout::kDiffuse, light * request.diffuse * overlay.diffuse);
            add(FilmLayout::kTranslucency, (light * overlay.core + less) * request.translucency);
            add(FilmLayout::kRefraction, light * request.refraction * overlay.seen_through);
            add(FilmLayout::kSquared, less * overlay.core * request.translucency);
        }
    }
}

// Light of the core once more, apart by ramp knot and as every compensation mode that was asked for would have it: `weight`
// is radiance per exitance, `base` the first plane.
void Gathering::add_planes(const GatherRequest& request, const Rgb& weight, std::size_t base, const Gathered& gathered,
                           std::size_t row, const Rgb* thin_gain, Tile& tile) const {
    const Body& body = *bodies_[request.object];
    const Compensation& rendered = body.material->compensation;
    const Rgb& coverage = gathered.coverage[row];
    const auto fill_of = [&](const Compensation& compensation) {
        return fill_amount(compensation, coverage, body.total_reflectance) * request.entering * weight;
    };
    const auto thin_of = [&](const Compensation& compensation) {
        return compensation.mode == CompensationMode::depth ? thin_gain : nullptr;
    };
    if (!layout_.knots.empty()) {
        const Rgb scale = body.gain(rendered, coverage, thin_of(rendered)) * weight;
        const std::size_t first = base + layout_.first_knot[scene_.objects[request.object].material];
        for (std::size_t k = 0; k < std::max<std::size_t>(gathered.knots, 1); ++k) {
            const Rgb* light = gathered.knots > 0 ? &gathered.layers[(row * gathered.knots + k) * gathered.groups]
                                                  : &gathered.exitance[row * gathered.groups];
            for (std::size_t g = 0; g < gathered.groups; ++g) {
                tile.add_to_plane(request.pixel, first + k, g, light[g] * scale);
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
        const Rgb scale = body.gain(full, coverage, thin_of(full)) * weight;
        for (std::size_t g = 0; g < gathered.groups; ++g) {
            tile.add_to_plane(request.pixel, plane, g, gathered.exitance[row * gathered.groups + g] * scale);
        }
        tile.add_to_plane(request.pixel, plane, request.entering_group, fill_of(full));
    }
}

}  // namespace frazil
