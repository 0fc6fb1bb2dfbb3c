#include "frazil/render/translucency_sets.h"

#include <map>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/render/interior.h"

namespace frazil {
namespace {

// Surfaces nearer to each other than so many spacings of the points, facing the same way, are one.
constexpr float kSkin = 0.1f;

bool can_share(const Body& a, const Body& b) {
    const IceMaterial &x = *a.material, &y = *b.material;
    return a.medium.sigma_s_prime == b.medium.sigma_s_prime && a.medium.sigma_a == b.medium.sigma_a &&
           a.medium.eta == b.medium.eta && x.profile == y.profile && a.traced_once == b.traced_once &&
           x.ramp.distances == y.ramp.distances && x.ramp.colors == y.ramp.colors &&
           x.ramp.preserve_energy == y.ramp.preserve_energy;
}

}  // namespace

TranslucencySets::TranslucencySets(const Scene& scene, const RayScene& ray_scene,
                                   const std::vector<std::unique_ptr<Body>>& bodies, const std::vector<LitPoints>& lit)
    : lit_(lit), leader_(scene.objects.size()) {
    std::map<std::string, std::size_t> known;  // which union
    std::map<std::uint32_t, float> outward;    // by mesh
    for (std::size_t i = 0; i < leader_.size(); ++i) {
        leader_[i] = i;
        const Object& object = scene.objects[i];
        if (object.translucency_set.empty() || !bodies[i] || lit[i].points.size() == 0) continue;
        const auto [side, is_new_mesh] = outward.try_emplace(object.mesh, 0.0f);
        if (is_new_mesh) side->second = outward_side(scene.meshes[object.mesh]);
        if (side->second == 0.0f) {
            warnings_.push_back(str(object.path, ": the mesh must be closed to share light with translucency set '",
                                    object.translucency_set,
                                    "', got open edges. It stands for itself; close its holes."));
            continue;
        }
        const auto [found, is_new] = known.try_emplace(object.translucency_set, unions_.size());
        if (is_new) unions_.push_back({i, {}, Shells(ray_scene, leader_.size()), {}, {}});
        Union& set = unions_[found->second];
        if (!can_share(*bodies[set.leader], *bodies[i])) {
            warnings_.push_back(str(object.path, ": the medium must be that of ", scene.objects[set.leader].path,
                                    " to share light with translucency set '", object.translucency_set,
                                    "', got another. It stands for itself; bind the same material."));
            continue;
        }
        leader_[i] = set.leader;
        set.members.push_back(i);
        const Mesh placed = transformed(scene.meshes[object.mesh], object.local_to_world);
        set.shells.add(i, side->second, bounds(placed));
    }
    std::erase_if(unions_, [](const Union& set) { return set.members.size() < 2; });
    for (Union& set : unions_) unite(set);
    for (std::size_t i = 0; i < leader_.size(); ++i) {
        if (bodies[i] && is_leader(i) && points(i).size() > 0) add_room(i, *bodies[i], ray_scene, shells(i), points(i));
    }
}

void TranslucencySets::unite(Union& set) const {
    PointSet points;
    Cells cells;
    bool has_cells = true;
    for (const std::size_t object : set.members) {
        const PointSet own = lit_[object].points.in_world();
        std::vector<char> is_inner(own.size(), 0);
        parallel_for(own.size(), 256, [&](std::size_t begin, std::size_t end) {
            for (std::size_t k = begin; k < end; ++k) {
                const V3f skin = own.normals[k] * (kSkin * static_cast<float>(own.spacing));
                is_inner[k] = set.shells.contains(own.positions[k] + skin, object) ||
                              set.shells.contains(own.positions[k] - skin, object, object);
            }
        });
        has_cells = has_cells && lit_[object].points.cloud().cells() != nullptr;
        const Cells own_cells = has_cells ? lit_[object].points.cells_in_world() : Cells{};
        points.spacing = std::max(points.spacing, own.spacing);
        for (std::size_t k = 0; k < own.size(); ++k) {
            if (is_inner[k]) continue;
            points.positions.push_back(own.positions[k]);
            points.normals.push_back(own.normals[k]);
            points.areas.push_back(own.areas[k]);
            set.sources.emplace_back(object, k);
            if (!has_cells) continue;
            cells.areas.push_back(own_cells.areas[k]);
            cells.centroids.push_back(own_cells.centroids[k]);
            cells.covariances.push_back(own_cells.covariances[k]);
            cells.normals.push_back(own_cells.normals[k]);
        }
    }
    set.points = PlacedPoints(std::move(points));
    if (has_cells) set.points.cloud().add_cells(false, [&](const PointSet&) { return std::move(cells); });
}

const TranslucencySets::Union* TranslucencySets::find(std::size_t leader) const {
    for (const Union& set : unions_) {
        if (set.leader == leader) return &set;
    }
    return nullptr;
}

const PlacedPoints& TranslucencySets::points(std::size_t leader) const {
    const Union* set = find(leader);
    return set ? set->points : lit_[leader].points;
}

const Shells* TranslucencySets::shells(std::size_t leader) const {
    const Union* set = find(leader);
    return set ? &set->shells : nullptr;
}

}  // namespace frazil
