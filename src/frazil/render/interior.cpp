#include "frazil/render/interior.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <optional>
#include <unordered_map>

#include "frazil/base/error.h"
#include "frazil/base/random.h"

namespace frazil {
namespace {

// A mesh whose holes would span more than this part of its surface is open.
constexpr double kLargestHole = 0.02;
constexpr int kMostCrossings = 32;
constexpr float kNothing = 1e-4f;
// Light along a shadow ray of which less is left goes on by chance: what dims it further, overlays first of all, is dear.
constexpr float kFaint = 0.1f;
constexpr float kFarAway = 1e18f;  // metres; finite, so that 0 times it is 0

struct Enclosure {
    double volume = 0.0;  // signed by the winding
    double rim = 0.0;     // length of edges that are not walked both ways
    double turned = 0.0;  // of those that two triangles share which wind different ways
    double area = 0.0;
};

// Vertices that lie at the same place are one.
std::vector<std::uint32_t> welded(const std::vector<V3f>& positions) {
    struct Key {
        std::array<std::uint32_t, 3> bits;
        bool operator==(const Key& other) const { return bits == other.bits; }
    };
    struct KeyHash {
        std::size_t operator()(const Key& key) const { return hash(key.bits[0], key.bits[1], key.bits[2]); }
    };
    std::unordered_map<Key, std::uint32_t, KeyHash> known;
    known.reserve(positions.size());
    std::vector<std::uint32_t> result(positions.size());
    for (std::size_t i = 0; i < positions.size(); ++i) {
        const V3f p = positions[i] + V3f(0.0f);  // -0 becomes 0
        Key key;
        std::memcpy(key.bits.data(), &p.x, sizeof(key.bits));
        result[i] = known.try_emplace(key, std::uint32_t(i)).first->second;
    }
    return result;
}

Enclosure enclosure(const Mesh& mesh) {
    Enclosure result;
    const std::vector<std::uint32_t> vertex = welded(mesh.positions);
    std::vector<std::pair<std::uint64_t, int>> edges;  // (low, high) and the way it is walked
    edges.reserve(3 * mesh.triangles.size());
    const Box3f box = bounds(mesh);
    const V3d center(box.center());
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        const V3i& t = mesh.triangles[i];
        const V3d cross = triangle_cross(mesh, i);
        result.area += 0.5 * cross.length();
        result.volume += cross.dot(V3d(mesh.positions[std::size_t(t.x)]) - center) / 6.0;
        for (int k = 0; k < 3; ++k) {
            const std::uint64_t a = vertex[std::size_t(t[k])], b = vertex[std::size_t(t[(k + 1) % 3])];
            if (a != b) edges.emplace_back(std::min(a, b) << 32 | std::max(a, b), a < b ? 1 : -1);
        }
    }
    std::sort(edges.begin(), edges.end());
    for (std::size_t i = 0; i < edges.size();) {
        int balance = 0, count = 0;
        const std::uint64_t edge = edges[i].first;
        for (; i < edges.size() && edges[i].first == edge; ++i, ++count) balance += edges[i].second;
        const V3f along = mesh.positions[std::size_t(edge >> 32)] - mesh.positions[std::size_t(edge & 0xffffffffU)];
        result.rim += std::abs(balance) * double(along.length());
        if (count == 2 && balance != 0) result.turned += std::abs(balance) * double(along.length());
    }
    return result;
}

bool is_closed(const Enclosure& shape) {
    return shape.rim * shape.rim <= kLargestHole * 4.0 * double(kPi) * shape.area && shape.volume != 0.0;
}

}  // namespace

bool is_closed(const Mesh& mesh) {
    return is_closed(enclosure(mesh));
}

float outward_side(const Mesh& mesh) {
    const Enclosure shape = enclosure(mesh);
    if (!is_closed(shape)) return 0.0f;
    return shape.volume > 0.0 ? 1.0f : -1.0f;
}

bool InsideOf::leave(int object) {
    for (int i = size_ - 1; i >= 0; --i) {
        if (objects_[std::size_t(i)] != object) continue;
        for (int k = i; k + 1 < size_; ++k) objects_[std::size_t(k)] = objects_[std::size_t(k + 1)];
        --size_;
        return true;
    }
    return false;
}

Interiors::Interiors(const Scene& scene, const RayScene& ray_scene, const SurfaceResolver& resolver,
                     const std::vector<std::unique_ptr<Body>>& bodies)
    : scene_(scene),
      ray_scene_(ray_scene),
      resolver_(resolver),
      bodies_(bodies),
      outward_(bodies.size(), 0.0f),
      transmission_(bodies.size()),
      densities_(bodies.size()) {
    std::map<std::uint32_t, Enclosure> of_mesh;
    std::map<float, std::shared_ptr<const TransmissionAlbedo>> of_eta;
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (!bodies[i]) continue;
        const IceMaterial& ice = *bodies[i]->material;
        if (ice.refraction == 0.0f && ice.volume == 0.0f) continue;
        const std::uint32_t mesh = scene.objects[i].mesh;
        if (scene.meshes[mesh].triangles.empty()) continue;
        auto [found, is_new] = of_mesh.try_emplace(mesh);
        if (is_new) found->second = enclosure(scene.meshes[mesh]);
        const Enclosure& shape = found->second;
        if (!is_closed(shape)) {
            const std::string& path = scene.objects[i].path;
            const std::string without = " units. It is rendered without refraction and volume; ";
            if (shape.turned > 0.5 * shape.rim) {
                warnings_.push_back(
                    str(path,
                        ": the faces of ice must all wind outwards, got faces that wind both ways "
                        "along ",
                        0.5 * shape.turned, without,
                        "make its normals consistent. The core's light is missing where they point in."));
            } else {
                warnings_.push_back(str(path, ": the mesh must be closed to be seen into, got open edges of ",
                                        shape.rim, without, "close its holes, or set the material's refraction to 0."));
            }
            continue;
        }
        outward_[i] = shape.volume > 0.0 ? 1.0f : -1.0f;
        auto& transmission = of_eta[ice.medium.eta];
        if (!transmission) transmission = std::make_shared<TransmissionAlbedo>(ice.medium.eta);
        transmission_[i] = transmission;
        if (!ice.density.is_even()) {
            densities_[i] = std::make_unique<DensityField>(ice.density, scene.objects[i].local_to_world.inverse(),
                                                           resolver.world_to_rest(std::uint32_t(i)));
        }
        is_empty_ = false;
    }
}

Interiors::Depth Interiors::depth(int body, const Ray& ray, float length) const {
    length = std::min(length, kFarAway);
    const DensityField* field = density(body);
    if (!field) return {length, length};
    const float depth = field->depth(ray.origin, ray.direction, length);
    const float part = bodies_[std::size_t(body)]->material->density.absorption;
    return {depth, (1.0f - part) * length + part * depth};
}

float Interiors::scattering_depth(int body) const {
    constexpr float kDepth = 8.0f;  // in free paths of the clearest channel
    const Rgb& sigma = bodies_[std::size_t(body)]->material->medium.sigma_s_prime;
    return kDepth / std::max(std::min(sigma.x, std::min(sigma.y, sigma.z)), 1e-6f);
}

int Interiors::filling(const InsideOf& inside) const {
    int best = InsideOf::kNone, priority = 0;
    for (int i = 0; i < inside.size(); ++i) {
        const int candidate = bodies_[std::size_t(inside[i])]->material->priority;
        if (best == InsideOf::kNone || candidate > priority) best = inside[i], priority = candidate;
    }
    return best;
}

Crossing Interiors::cross(const Hit& hit, const V3f& direction, const InsideOf& inside) const {
    Crossing crossing{inside, filling(inside), InsideOf::kNone};
    const int object = static_cast<int>(hit.placement);
    if (direction.dot(hit.geometric_normal) * outward_[hit.placement] < 0.0f) {
        crossing.beyond.enter(object);
    } else {
        crossing.beyond.leave(object);
    }
    crossing.to = filling(crossing.beyond);
    return crossing;
}

InsideOf Interiors::inside_at(const V3f& position) const {
    InsideOf inside;
    if (is_empty_) return inside;
    // Along a crooked direction, so that no edge of a box or grid lies on the way. What is left without having been
    // entered is what the place is inside of; the list is kept in the order from outside in.
    Ray ray{position, V3f(0.3713906f, 0.7427814f, 0.5570860f).normalized()};
    InsideOf entered;
    std::vector<int> left;
    for (int crossings = 0; crossings < 256; ++crossings) {
        Hit hit;
        if (!ray_scene_.intersect(ray, hit)) break;
        if (is_open_to_rays(hit.placement)) {
            const int object = static_cast<int>(hit.placement);
            if (ray.direction.dot(hit.geometric_normal) * outward_[hit.placement] < 0.0f) {
                entered.enter(object);
            } else if (!entered.leave(object)) {
                left.push_back(object);
            }
        }
        const V3f place = ray.origin + ray.direction * hit.t;
        const V3f onward =
            ray.direction.dot(hit.geometric_normal) > 0.0f ? hit.geometric_normal : -hit.geometric_normal;
        ray.origin = offset_origin(place, onward);
    }
    for (auto object = left.rbegin(); object != left.rend(); ++object) inside.enter(*object);
    return inside;
}

Rgb Interiors::visibility(const Ray& ray, InsideOf inside, std::uint64_t& rays, bool absorbs, bool* is_straight,
                          float footprint) const {
    if (is_empty_ && inside.is_empty()) {
        ++rays;
        return Rgb(ray_scene_.is_occluded(ray) ? 0.0f : 1.0f);
    }
    Rgb result(1.0f);
    std::uint32_t coin =
        hash(std::bit_cast<std::uint32_t>(ray.direction.x), std::bit_cast<std::uint32_t>(ray.direction.y),
             std::bit_cast<std::uint32_t>(ray.origin.x));
    Ray rest = ray;
    bool is_within = filling(inside) != InsideOf::kNone;  // the ice that the ray begins in
    // What a boundary lets through, its overlays first of all, is asked once it is known that the ice behind it does not
    // swallow the light.
    struct Boundary {
        Hit hit;
        bool is_entered;
    };
    std::optional<Boundary> entered;
    const auto pass = [&](const Boundary& boundary) {
        const Surface surface = resolver_.resolve_passage(boundary.hit, ray.direction, footprint);
        const Body& ice = *bodies_[boundary.hit.placement];
        const float cosine = std::abs(surface.normal.dot(ray.direction));
        result *= ice.transmittance(cosine, surface.covering.roughness) * (1.0f - surface.covering.covered);
        result *= ice.material->refraction_tint;
        if (boundary.is_entered) {
            result *= ice.material->refraction;
        } else if (is_within) {
            // Light from a solid angle outside fills a smaller one inside: dw_in / dw_out by Snell's law at a plane.
            // Light that goes in and out again on a straight line keeps its beam: widening it without bending it
            // would make energy, most where it leaves at a grazing angle.
            const float eta2 = ice.material->medium.eta * ice.material->medium.eta;
            const float cosine_inside = std::sqrt(std::max(0.0f, 1.0f - (1.0f - cosine * cosine) / eta2));
            result *= cosine / std::max(eta2 * cosine_inside, 1e-4f);
            is_within = false;
        }
    };
    for (int crossings = 0; crossings < kMostCrossings; ++crossings) {
        const int body = filling(inside);
        // From so far inside ice nothing would go on: by the coin that is tossed next.
        Ray within = rest;
        if (body != InsideOf::kNone && !density(body)) {
            const Medium& medium = bodies_[std::size_t(body)]->material->medium;
            const Rgb sigma = medium.sigma_s_prime + (absorbs ? medium.sigma_a : Rgb(0.0f));
            const float least = std::min(sigma.x, std::min(sigma.y, sigma.z));
            const float wanted = std::max(kNothing, kFaint * to_unit_float(hash(coin)));
            if (least > 0.0f) {
                within.t_max = std::min(rest.t_max, std::log(max_component(result) / wanted) / least);
                if (!(within.t_max > 0.0f)) return Rgb(0.0f);
            }
        }
        Hit hit;
        ++rays;
        const bool is_hit = ray_scene_.intersect(within, hit);
        if (!is_hit && within.t_max < rest.t_max) return Rgb(0.0f);
        if (body != InsideOf::kNone) {
            const Medium& medium = bodies_[std::size_t(body)]->material->medium;
            const Depth through = depth(body, rest, is_hit ? hit.t : rest.t_max);
            const Rgb absorbed = absorbs ? medium.sigma_a * through.absorption : Rgb(0.0f);
            result *= exp(-(medium.sigma_s_prime * through.scattering + absorbed));
        }
        if (max_component(result) < kNothing || (is_hit && !is_open_to_rays(hit.placement))) return Rgb(0.0f);
        if (const float chance = max_component(result) / kFaint; chance < 1.0f) {
            coin = hash(coin);
            if (!(to_unit_float(coin) < chance)) return Rgb(0.0f);
            result /= chance;
        }
        if (entered) {
            pass(*entered);
            entered.reset();
        }
        if (!is_hit) return result;

        const Crossing crossing = cross(hit, rest.direction, inside);
        if (crossing.is_boundary() && (crossing.from == InsideOf::kNone) != (crossing.to == InsideOf::kNone)) {
            if (is_straight && !is_index_matched(bodies_[hit.placement]->material->medium.eta)) *is_straight = false;
            if (crossing.to != InsideOf::kNone) {
                entered = {hit, true};
            } else {
                pass({hit, false});
            }
        }
        inside = crossing.beyond;
        const float side = hit.geometric_normal.dot(rest.direction) > 0.0f ? 1.0f : -1.0f;
        rest.origin = offset_origin(resolver_.position(hit), hit.geometric_normal * side);
        rest.t_max -= hit.t;
        if (!(rest.t_max > 0.0f)) {
            if (entered) pass(*entered);
            return result;
        }
    }
    return Rgb(0.0f);
}

}  // namespace frazil
