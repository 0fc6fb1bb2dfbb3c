// Which layers a film gets: decided once per render, read by the paths that fill them and by the film that keeps them.
// Model: additive light per component and light group always; "planes" of the light of ice beside it, each per group too:
//   one per ramp knot and one per compensation mode that was asked for, of ice that is seen and of its light elsewhere.
// Valid: light groups have names that cannot be taken for another layer's: make_layout refuses the others.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "frazil/render/bodies.h"
#include "frazil/render/film.h"
#include "frazil/render/lpe.h"
#include "frazil/render/scene.h"

namespace frazil {

struct FilmLayout {
    std::vector<std::string> aovs;    // of the table, those that are made
    std::vector<std::string> groups;  // one at least
    std::size_t emission_group = 0;   // which takes light that surfaces emit

    std::vector<RenderedCompensation> compensations;  // one per material of ice that is in use

    // Cryptomattes: layers <aov>00, 01, 02.
    struct Ids {
        std::string aov;
        bool seen_through;             // ice, or directly
        std::vector<float> of_object;  // by object
    };
    std::vector<Ids> ids;

    // By object: 1 + its material, 1 + its number among those of its mesh, the spacing of its points (bodies fill it in).
    std::vector<float> material_id, instance_id, point_spacing;

    // Light path expressions, each a layer of that name.
    std::vector<std::string> lpe_names;
    std::vector<LpeAutomaton> lpes;

    // Mattes: names, and which of them each object belongs to.
    std::vector<std::string> mattes;
    std::vector<std::vector<std::uint32_t>> mattes_of_object;

    // Planes: knots first, then modes, of translucency; then all of them once more, of the light of ice that is seen by way of
    // another lobe (diffuse, specular, refraction); and that light as rendered.
    std::vector<RampKnot> knots;
    std::vector<std::size_t> first_knot;  // per material; none where the render has no knot layers
    std::size_t fill_plane = kNone;       // the knot plane of what `fill` adds
    std::vector<CompensationMode> modes;

    // Overlays of the ices in use, by layer: materials' overlays of one name share theirs. Each has the planes of
    // kOverlayPlanes, after the planes above: the change of components, and for translucency the square's, as an overlay both
    // tints the light that leaves and takes from what enters.
    std::vector<RenderedOverlay> overlays;
    std::vector<std::string> overlay_names;
    std::vector<std::vector<std::uint32_t>> overlay_of;  // by material and its overlay: of overlay_names
    enum OverlayPlane { kDiffuse, kTranslucency, kRefraction, kVolume, kSquared };
    static constexpr std::array kOverlayPlanes = {"diffuse", "translucency", "refraction", "volume", "squared"};
    std::size_t overlay_plane(std::size_t overlay) const { return ice_plane_count() + overlay * kOverlayPlanes.size(); }

    static constexpr std::size_t kNone = ~std::size_t(0);

    std::size_t seen_plane_count() const { return knots.size() + modes.size(); }
    std::size_t ice_plane_count() const { return seen_plane_count() == 0 ? 0 : 2 * seen_plane_count() + 1; }
    std::size_t plane_count() const { return overlay_plane(overlay_names.size()); }
    bool has(std::string_view aov) const;
    bool has_mode(CompensationMode mode) const;
    bool needs_fill() const { return has_mode(CompensationMode::fill); }    // light that enters at shading points
    bool needs_depth() const { return has_mode(CompensationMode::depth); }  // the thickness of bodies
    bool needs_surface() const;                                             // sums on the surface of bodies itself

    // Layer names: of a component or plane, and of one of its light groups.
    std::string plane_name(std::size_t plane) const;
    std::string group_name(const std::string& layer, std::size_t group) const;
};

// A name and an expression.
using NamedLpe = std::pair<std::string, std::string>;
// A name and the indices of objects.
using NamedMatte = std::pair<std::string, std::vector<std::uint32_t>>;

// ValueError for AOVs that are unknown or twice there, for light groups whose layers would be other layers, and for light
// path expressions that are wrong or named like another layer, for mattes that are twice there or of objects that are not.
FilmLayout make_layout(const Scene& scene, const std::vector<std::unique_ptr<Body>>& bodies,
                       std::span<const std::string> extra_aovs, std::span<const NamedLpe> lpes,
                       std::span<const NamedMatte> mattes = {});

}  // namespace frazil
