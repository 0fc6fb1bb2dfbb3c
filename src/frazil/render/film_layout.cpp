#include "frazil/render/film_layout.h"

#include <algorithm>
#include <cctype>

#include "frazil/base/error.h"
#include "frazil/lighting/irradiance.h"
#include "frazil/render/cryptomatte.h"

namespace frazil {
namespace {

struct ModeName {
    CompensationMode mode;
    const char* aov;
};
constexpr ModeName kModes[] = {
    {CompensationMode::off, "compensation_off"},           {CompensationMode::ratio, "compensation_ratio"},
    {CompensationMode::conserve, "compensation_conserve"}, {CompensationMode::depth, "compensation_depth"},
    {CompensationMode::fill, "compensation_fill"},         {CompensationMode::linear, "compensation_linear"}};

// Names of planes of ice that is seen by way of another lobe begin like this.
constexpr const char* kIndirect = "indirect_";

// Does the object emit light that belongs to no light?
bool emits(const Scene& scene, std::size_t object) {
    for (const Light& light : scene.lights) {
        const auto* mesh = std::get_if<MeshLight>(&light.shape);
        if (mesh && mesh->object == object) return false;
    }
    const auto* standard = std::get_if<StandardMaterial>(&scene.materials[scene.objects[object].material].model);
    return standard && (standard->emissive_color.lookup.texture || standard->emissive_color.value != Rgb(0.0f));
}

// Which share of the profile's energy lies under the hat of knot k, per channel.
Rgb share_of_knot(const Ramp& ramp, std::size_t k, const Profile& profile) {
    // energy_scale of a ramp that is 1 everywhere and 2 at the knot is 1 / (1 + share).
    Ramp raised{ramp.distances, std::vector<Rgb>(ramp.distances.size(), Rgb(1.0f)), true};
    raised.colors[k] = Rgb(2.0f);
    const Rgb scale = energy_scale(raised, profile);
    return {1.0f / scale.x - 1.0f, 1.0f / scale.y - 1.0f, 1.0f / scale.z - 1.0f};
}

void add_knots(const Scene& scene, const std::vector<std::unique_ptr<Body>>& bodies, FilmLayout& layout) {
    layout.first_knot.assign(scene.materials.size(), FilmLayout::kNone);
    bool fills = false;
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
        const Object& object = scene.objects[i];
        const auto* ice = std::get_if<IceMaterial>(&scene.materials[object.material].model);
        if (!ice || layout.first_knot[object.material] != FilmLayout::kNone) continue;
        const std::string& path = scene.materials[object.material].path;
        layout.first_knot[object.material] = layout.knots.size();
        fills = fills || ice->compensation.mode == CompensationMode::fill;
        if (ice->ramp.is_empty()) {
            layout.knots.push_back({path, 0.0f, Rgb(1.0f), Rgb(1.0f), false, true});
            continue;
        }
        for (std::size_t k = 0; k < ice->ramp.distances.size(); ++k) {
            layout.knots.push_back({path, ice->ramp.distances[k], ice->ramp.colors[k],
                                    share_of_knot(ice->ramp, k, bodies[i]->profile), ice->ramp.preserve_energy, false});
        }
    }
    if (!fills) return;
    layout.fill_plane = layout.knots.size();
    layout.knots.push_back({"", 0.0f, Rgb(1.0f), Rgb(1.0f), false, true});
}

void add_overlays(const Scene& scene, FilmLayout& layout) {
    layout.overlay_of.resize(scene.materials.size());
    for (const Object& object : scene.objects) {
        const Material& material = scene.materials[object.material];
        const auto* ice = std::get_if<IceMaterial>(&material.model);
        std::vector<std::uint32_t>& own = layout.overlay_of[object.material];
        if (!ice || !own.empty()) continue;
        for (std::size_t k = 0; k < ice->overlays.size(); ++k) {
            const Overlay& overlay = ice->overlays[k];
            std::string name = overlay.name.empty() ? str(k + 1) : overlay.name;
            for (char& c : name) {
                if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
            }
            // Two of one name in a material are told apart.
            for (std::size_t j = 0; j < k; ++j) {
                if (layout.overlay_names[own[j]] == name) name += str("_", k + 1);
            }
            const auto found = std::find(layout.overlay_names.begin(), layout.overlay_names.end(), name);
            own.push_back(static_cast<std::uint32_t>(found - layout.overlay_names.begin()));
            if (found == layout.overlay_names.end()) layout.overlay_names.push_back(name);
            layout.overlays.push_back(
                {name, material.path, overlay.opacity, ice->age, overlay.age_begin, overlay.age_end});
        }
    }
}

// Would the layers of a group of this name be taken for those of a ramp's knots?
bool is_taken(const std::string& group) {
    if (find_aov("translucency_" + group)) return true;
    const std::string_view ramp = "ramp";
    return group.compare(0, ramp.size(), ramp) == 0 && group.size() > ramp.size() &&
           std::isdigit(static_cast<unsigned char>(group[ramp.size()]));
}

void add_lpes(const Scene& scene, std::span<const NamedLpe> lpes, FilmLayout& layout) {
    if (lpes.empty()) return;
    LpeAlphabet alphabet;
    alphabet.groups = layout.groups;
    for (const Object& object : scene.objects) alphabet.objects.push_back(object.path);
    for (const Light& light : scene.lights) {
        alphabet.lights.push_back({light.group, light.path, std::holds_alternative<DomeLight>(light.shape)});
    }
    for (const auto& [name, expression] : lpes) {
        const bool is_plain = !name.empty() && std::all_of(name.begin(), name.end(),
                                                           [](unsigned char c) { return std::isalnum(c) || c == '_'; });
        if (!is_plain) throw ValueError(str("lpe: name must be of letters, digits and _, got '", name, "'."));
        if (name.rfind(kIndirect, 0) == 0) {
            throw ValueError(str("lpe ", name, ": name must not begin with ", kIndirect, ". Choose another."));
        }
        for (const Aov& aov : aov_table()) {
            if (name == aov.name || name.rfind(str(aov.name, "_"), 0) == 0) {
                throw ValueError(str("lpe ", name, ": name must not be, or begin like, that of the AOV ", aov.name,
                                     ". Choose another."));
            }
        }
        if (std::find(layout.lpe_names.begin(), layout.lpe_names.end(), name) != layout.lpe_names.end()) {
            throw ValueError(str("lpe ", name, ": names must differ from each other, got this one twice."));
        }
        layout.lpes.emplace_back("lpe " + name, expression, alphabet);
        layout.lpe_names.push_back(name);
    }
}

void add_mattes(const Scene& scene, std::span<const NamedMatte> mattes, FilmLayout& layout) {
    if (mattes.empty()) return;
    layout.mattes_of_object.resize(scene.objects.size());
    for (const auto& [name, objects] : mattes) {
        const bool is_plain = !name.empty() && std::all_of(name.begin(), name.end(),
                                                           [](unsigned char c) { return std::isalnum(c) || c == '_'; });
        if (!is_plain) throw ValueError(str("matte: name must be of letters, digits and _, got '", name, "'."));
        if (std::find(layout.mattes.begin(), layout.mattes.end(), name) != layout.mattes.end()) {
            throw ValueError(str("matte ", name, ": names must differ from each other, got this one twice."));
        }
        for (const std::uint32_t object : objects) {
            if (object >= scene.objects.size()) {
                throw ValueError(str("matte ", name, ": objects must be in 0..", scene.objects.size(),
                                     " (exclusive), got ", object, "."));
            }
            auto& of_object = layout.mattes_of_object[object];
            const auto number = static_cast<std::uint32_t>(layout.mattes.size());
            if (of_object.empty() || of_object.back() != number) of_object.push_back(number);
        }
        layout.mattes.push_back(name);
    }
}

void add_ids(const Scene& scene, FilmLayout& layout) {
    std::vector<std::uint32_t> placed(scene.meshes.size(), 0);
    for (const Object& object : scene.objects) {
        layout.material_id.push_back(1.0f + static_cast<float>(object.material));
        layout.instance_id.push_back(static_cast<float>(++placed[object.mesh]));
    }
    layout.point_spacing.assign(scene.objects.size(), 0.0f);
    const auto add = [&](const std::string& kind, const auto& name_of) {
        for (const bool seen_through : {false, true}) {
            const std::string name = (seen_through ? "crypto_refracted_" : "crypto_") + kind;
            if (!layout.has(name)) continue;
            FilmLayout::Ids ids{name, seen_through, {}};
            for (const Object& object : scene.objects) ids.of_object.push_back(cryptomatte_id(name_of(object)));
            layout.ids.push_back(std::move(ids));
        }
    };
    add("object", [](const Object& object) -> const std::string& { return object.path; });
    add("material", [&](const Object& object) -> const std::string& { return scene.materials[object.material].path; });
    add("asset",
        [](const Object& object) -> const std::string& { return object.asset.empty() ? object.path : object.asset; });
}

}  // namespace

bool FilmLayout::has(std::string_view aov) const {
    return std::find(aovs.begin(), aovs.end(), aov) != aovs.end();
}

bool FilmLayout::needs_surface() const {
    return has("compensation_factor") ||
           std::any_of(modes.begin(), modes.end(), [](CompensationMode mode) { return !keeps_energy(mode); });
}

bool FilmLayout::has_mode(CompensationMode mode) const {
    return std::find(modes.begin(), modes.end(), mode) != modes.end();
}

std::string FilmLayout::plane_name(std::size_t plane) const {
    if (plane >= ice_plane_count()) {
        const std::size_t own = plane - ice_plane_count(), count = kOverlayPlanes.size();
        return str("overlay_", overlay_names[own / count], "_", kOverlayPlanes[own % count]);
    }
    const bool is_indirect = plane >= seen_plane_count();
    if (is_indirect) plane -= seen_plane_count();
    if (plane == seen_plane_count()) return str(kIndirect, "translucency");
    const std::string prefix = is_indirect ? kIndirect : "";
    if (plane < knots.size()) return str(prefix, "translucency_ramp", plane);
    for (const ModeName& named : kModes) {
        if (named.mode == modes[plane - knots.size()]) return prefix + named.aov;
    }
    return {};
}

std::string FilmLayout::group_name(const std::string& layer, std::size_t group) const {
    return str(layer, "_", groups[group].empty() ? "default" : groups[group]);
}

FilmLayout make_layout(const Scene& scene, const std::vector<std::unique_ptr<Body>>& bodies,
                       std::span<const std::string> extra_aovs, std::span<const NamedLpe> lpes,
                       std::span<const NamedMatte> mattes) {
    check_aovs(extra_aovs);
    FilmLayout layout;
    for (const Aov& aov : aov_table()) {
        const bool is_asked = std::find(extra_aovs.begin(), extra_aovs.end(), aov.name) != extra_aovs.end();
        if (aov.is_default || is_asked) layout.aovs.emplace_back(aov.name);
    }

    layout.groups = light_groups(scene.lights);
    for (const std::string& group : layout.groups) {
        if (is_taken(group)) {
            throw ValueError(str("render: a light group must not be named '", group, "': layer translucency_", group,
                                 " would be another one. Rename the group."));
        }
    }
    // What surfaces emit must not change with the lights of a group.
    const auto unnamed = std::find(layout.groups.begin(), layout.groups.end(), "");
    layout.emission_group = static_cast<std::size_t>(unnamed - layout.groups.begin());
    if (unnamed == layout.groups.end()) {
        bool is_needed = false;
        for (std::size_t i = 0; i < scene.objects.size() && !is_needed; ++i) is_needed = emits(scene, i);
        layout.emission_group = is_needed ? layout.groups.size() : 0;
        if (is_needed) layout.groups.emplace_back();
    }

    std::vector<char> is_known(scene.materials.size(), 0);
    for (const Object& object : scene.objects) {
        const Material& material = scene.materials[object.material];
        const auto* ice = std::get_if<IceMaterial>(&material.model);
        if (ice && !is_known[object.material]) layout.compensations.push_back({material.path, ice->compensation});
        is_known[object.material] = 1;
    }
    add_ids(scene, layout);
    add_lpes(scene, lpes, layout);
    add_mattes(scene, mattes, layout);
    if (layout.has("overlay")) add_overlays(scene, layout);
    if (layout.has("translucency_ramp")) add_knots(scene, bodies, layout);
    for (const ModeName& named : kModes) {
        if (layout.has(named.aov)) layout.modes.push_back(named.mode);
    }
    return layout;
}

}  // namespace frazil
