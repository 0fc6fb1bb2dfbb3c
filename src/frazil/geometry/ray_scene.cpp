#include "frazil/geometry/ray_scene.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "frazil/base/error.h"
#include "frazil/geometry/embree.h"

namespace frazil {
namespace {

void set_ray(const Ray& ray, RTCRay& out) {
    out.org_x = ray.origin.x, out.org_y = ray.origin.y, out.org_z = ray.origin.z;
    out.dir_x = ray.direction.x, out.dir_y = ray.direction.y, out.dir_z = ray.direction.z;
    out.tnear = ray.t_min;
    out.tfar = ray.t_max;
    out.time = 0.0f;
    out.mask = ~0U;
    out.id = 0;
    out.flags = 0;
}

constexpr std::size_t kPacket = 8;

// The cell of a ray's direction on an octahedron's square [Cigolle2014], cells in Morton order.
constexpr int kCellBits = 5;
std::uint32_t direction_cell(const V3f& d) {
    const float scale = 1.0f / (std::abs(d.x) + std::abs(d.y) + std::abs(d.z));
    float u = d.x * scale, v = d.y * scale;
    if (d.z < 0.0f) {
        const float folded = (1.0f - std::abs(v)) * std::copysign(1.0f, u);
        v = (1.0f - std::abs(u)) * std::copysign(1.0f, v);
        u = folded;
    }
    const auto cell = [](float x) {
        constexpr float kCells = 1 << kCellBits;
        const float scaled = (x + 1.0f) * (0.5f * kCells);
        return scaled > 0.0f ? std::min(std::uint32_t(scaled), (1U << kCellBits) - 1) : 0U;
    };
    const std::uint32_t x = cell(u), y = cell(v);
    std::uint32_t code = 0;
    for (int bit = 0; bit < kCellBits; ++bit) {
        code |= ((x >> bit) & 1U) << (2 * bit) | ((y >> bit) & 1U) << (2 * bit + 1);
    }
    return code;
}

// use(indices, count) for packets of rays, those that look alike together: packets go through the scene as one as long as
// their rays do. Rays of one cell of directions stay in the order given.
template <class Use>
void for_each_packet(std::span<const Ray> rays, const Use& use) {
    thread_local std::vector<std::uint32_t> cells, order;
    if (rays.size() <= kPacket) {  // one packet, whatever their order
        constexpr std::array<std::uint32_t, kPacket> kAsGiven{0, 1, 2, 3, 4, 5, 6, 7};
        if (!rays.empty()) use(kAsGiven.data(), rays.size());
        return;
    }
    std::array<std::uint32_t, (std::size_t(1) << (2 * kCellBits)) + 1> first{};
    cells.resize(rays.size()), order.resize(rays.size());
    for (std::size_t i = 0; i < rays.size(); ++i) {
        cells[i] = direction_cell(rays[i].direction);
        ++first[cells[i] + 1];
    }
    for (std::size_t cell = 0; cell + 1 < first.size(); ++cell) first[cell + 1] += first[cell];
    for (std::size_t i = 0; i < rays.size(); ++i) order[first[cells[i]]++] = std::uint32_t(i);
    for (std::size_t begin = 0; begin < order.size(); begin += kPacket) {
        use(&order[begin], std::min(kPacket, order.size() - begin));
    }
}

// A packet of rays by their indices; the rest of its lanes is off.
void fill_packet(std::span<const Ray> rays, const std::uint32_t* index, std::size_t count, int* valid,
                 RTCRay8& packet) {
    for (std::size_t i = 0; i < kPacket; ++i) {
        valid[i] = i < count ? -1 : 0;
        const Ray& ray = rays[index[i < count ? i : 0]];
        packet.org_x[i] = ray.origin.x, packet.org_y[i] = ray.origin.y, packet.org_z[i] = ray.origin.z;
        packet.dir_x[i] = ray.direction.x, packet.dir_y[i] = ray.direction.y, packet.dir_z[i] = ray.direction.z;
        packet.tnear[i] = ray.t_min, packet.tfar[i] = ray.t_max;
        packet.time[i] = 0.0f, packet.mask[i] = ~0U, packet.id[i] = 0, packet.flags[i] = 0;
    }
}

}  // namespace

struct RayScene::Impl {
    RTCScene top = make_scene();
    std::vector<RTCScene> prototypes;
    std::vector<std::uint32_t> placement_of_geometry;
    std::vector<M44f> world_to_local;       // by placement; for the normals of instances
    std::vector<std::uint8_t> is_mirrored;  // by placement; baked vertices then wind the other way
    std::vector<Passage> passages;          // by placement; empty = none

    Impl() = default;
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;
    ~Impl() {
        rtcReleaseScene(top);
        for (RTCScene scene : prototypes) {
            if (scene) rtcReleaseScene(scene);
        }
    }

    void attach(RTCGeometry geometry, std::uint32_t placement) {
        const unsigned id = rtcAttachGeometry(top, geometry);
        rtcReleaseGeometry(geometry);
        if (placement_of_geometry.size() <= id) placement_of_geometry.resize(id + 1);
        placement_of_geometry[id] = placement;
    }

    std::uint32_t placement_of(unsigned geometry, unsigned instance) const {
        return placement_of_geometry[instance != RTC_INVALID_GEOMETRY_ID ? instance : geometry];
    }

    Hit to_hit(const RTCRayHit& query) const {
        const bool is_instance = query.hit.instID[0] != RTC_INVALID_GEOMETRY_ID;
        Hit hit;
        hit.t = query.ray.tfar;
        hit.placement = placement_of(query.hit.geomID, query.hit.instID[0]);
        hit.triangle = query.hit.primID;
        hit.uv = {query.hit.u, query.hit.v};
        const V3f normal(query.hit.Ng_x, query.hit.Ng_y, query.hit.Ng_z);
        if (is_instance) {
            hit.geometric_normal = transform_normal(normal, world_to_local[hit.placement]);
        } else {
            hit.geometric_normal = normal.normalized() * (is_mirrored[hit.placement] ? -1.0f : 1.0f);
        }
        return hit;
    }
};

namespace {

// An Embree query that sees some of the placements.
struct FilteredContext {
#if FRAZIL_EMBREE_MAJOR >= 4
    RTCRayQueryContext embree;  // first: Embree hands its address back
#else
    RTCIntersectContext embree;
#endif
    const std::vector<std::uint32_t>* placement_of_geometry;
    PlacementMask mask;

    FilteredContext(const std::vector<std::uint32_t>& placements, PlacementMask wanted)
        : placement_of_geometry(&placements), mask(wanted) {
#if FRAZIL_EMBREE_MAJOR >= 4
        rtcInitRayQueryContext(&embree);
#else
        rtcInitIntersectContext(&embree);
        embree.filter = &reject_unmasked;
#endif
    }

    static void reject_unmasked(const RTCFilterFunctionNArguments* arguments) {
        const auto* self = reinterpret_cast<const FilteredContext*>(arguments->context);
        for (unsigned i = 0; i < arguments->N; ++i) {
            if (arguments->valid[i] != -1) continue;
            const unsigned instance = RTCHitN_instID(arguments->hit, arguments->N, i, 0);
            const unsigned geometry = RTCHitN_geomID(arguments->hit, arguments->N, i);
            const std::uint32_t placement =
                (*self->placement_of_geometry)[instance != RTC_INVALID_GEOMETRY_ID ? instance : geometry];
            if (placement >= self->mask->size() || !(*self->mask)[placement]) arguments->valid[i] = 0;
        }
    }
};

}  // namespace

RayScene::RayScene(const std::vector<Mesh>& meshes, const std::vector<Placement>& placements)
    : impl_(std::make_unique<Impl>()) {
    std::vector<std::uint32_t> uses(meshes.size(), 0);
    for (const Placement& placement : placements) ++uses[placement.mesh];

    // One committed scene per mesh that is placed more than once.
    impl_->prototypes.resize(meshes.size(), nullptr);
    for (std::size_t i = 0; i < meshes.size(); ++i) {
        if (uses[i] < 2 || meshes[i].triangles.empty()) continue;
        impl_->prototypes[i] = make_scene();
        RTCGeometry geometry = make_triangles(meshes[i], M44f());
        rtcAttachGeometry(impl_->prototypes[i], geometry);
        rtcReleaseGeometry(geometry);
        rtcCommitScene(impl_->prototypes[i]);
    }

    impl_->world_to_local.reserve(placements.size());
    for (std::uint32_t i = 0; i < placements.size(); ++i) {
        const Placement& placement = placements[i];
        impl_->world_to_local.push_back(placement.local_to_world.inverse());
        impl_->is_mirrored.push_back(placement.local_to_world.determinant() < 0.0f);
        const Mesh& mesh = meshes[placement.mesh];
        if (mesh.triangles.empty()) continue;
        RTCScene prototype = impl_->prototypes[placement.mesh];
        if (!prototype) {
            impl_->attach(make_triangles(mesh, placement.local_to_world), i);
            continue;
        }
        RTCGeometry instance = rtcNewGeometry(embree_device(), RTC_GEOMETRY_TYPE_INSTANCE);
        rtcSetGeometryInstancedScene(instance, prototype);
        // Row vectors: the matrix in memory is column-major for Embree.
        rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, &placement.local_to_world[0][0]);
        rtcCommitGeometry(instance);
        impl_->attach(instance, i);
    }
    rtcCommitScene(impl_->top);
    throw_if_embree_failed("building the ray scene");
}

RayScene::~RayScene() = default;
RayScene::RayScene(RayScene&&) noexcept = default;
RayScene& RayScene::operator=(RayScene&&) noexcept = default;

bool RayScene::intersect(const Ray& ray, Hit& hit) const {
    RTCRayHit query;
    set_ray(ray, query.ray);
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
#if FRAZIL_EMBREE_MAJOR >= 4
    rtcIntersect1(impl_->top, &query);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(impl_->top, &context, &query);
#endif
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;

    hit = impl_->to_hit(query);
    return true;
}

bool RayScene::intersect(const Ray& ray, Hit& hit, PlacementMask mask) const {
    if (!mask) return intersect(ray, hit);
    RTCRayHit query;
    set_ray(ray, query.ray);
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    FilteredContext context(impl_->placement_of_geometry, mask);
#if FRAZIL_EMBREE_MAJOR >= 4
    RTCIntersectArguments arguments;
    rtcInitIntersectArguments(&arguments);
    arguments.context = &context.embree;
    arguments.filter = &FilteredContext::reject_unmasked;
    arguments.flags = RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER;
    rtcIntersect1(impl_->top, &query, &arguments);
#else
    rtcIntersect1(impl_->top, &context.embree, &query);
#endif
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
    hit = impl_->to_hit(query);
    return true;
}

bool RayScene::is_occluded(const Ray& ray, PlacementMask mask) const {
    if (!mask) return is_occluded(ray);
    RTCRay query;
    set_ray(ray, query);
    FilteredContext context(impl_->placement_of_geometry, mask);
#if FRAZIL_EMBREE_MAJOR >= 4
    RTCOccludedArguments arguments;
    rtcInitOccludedArguments(&arguments);
    arguments.context = &context.embree;
    arguments.filter = &FilteredContext::reject_unmasked;
    arguments.flags = RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER;
    rtcOccluded1(impl_->top, &query, &arguments);
#else
    rtcOccluded1(impl_->top, &context.embree, &query);
#endif
    return query.tfar < 0.0f;
}

void RayScene::set_passages(std::vector<Passage> passages) {
    impl_->passages = std::move(passages);
}

const std::vector<Passage>& RayScene::passages() const {
    return impl_->passages;
}

bool RayScene::is_occluded(const Ray& ray) const {
    RTCRay query;
    set_ray(ray, query);
#if FRAZIL_EMBREE_MAJOR >= 4
    rtcOccluded1(impl_->top, &query);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(impl_->top, &context, &query);
#endif
    return query.tfar < 0.0f;
}

void RayScene::are_occluded(std::span<const Ray> rays, std::span<std::uint8_t> out) const {
#if FRAZIL_EMBREE_MAJOR >= 4
    RTCOccludedArguments arguments;
    rtcInitOccludedArguments(&arguments);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
#endif
    for_each_packet(rays, [&](const std::uint32_t* index, std::size_t count) {
        alignas(32) int valid[kPacket];
        alignas(32) RTCRay8 packet;
        fill_packet(rays, index, count, valid, packet);
#if FRAZIL_EMBREE_MAJOR >= 4
        rtcOccluded8(valid, impl_->top, &packet, &arguments);
#else
        rtcOccluded8(valid, impl_->top, &context, &packet);
#endif
        for (std::size_t i = 0; i < count; ++i) out[index[i]] = packet.tfar[i] < 0.0f;
    });
}

void RayScene::intersect(std::span<const Ray> rays, std::span<Hit> hits, PlacementMask mask, bool are_alike) const {
    FilteredContext context(impl_->placement_of_geometry, mask);
#if FRAZIL_EMBREE_MAJOR >= 4
    RTCIntersectArguments arguments;
    rtcInitIntersectArguments(&arguments);
    int flags = are_alike ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
    if (mask) {
        arguments.context = &context.embree;
        arguments.filter = &FilteredContext::reject_unmasked;
        flags |= RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER;
    }
    arguments.flags = static_cast<RTCRayQueryFlags>(flags);
#else
    if (!mask) context.embree.filter = nullptr;
    if (are_alike) context.embree.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
#endif
    for_each_packet(rays, [&](const std::uint32_t* index, std::size_t count) {
        alignas(32) int valid[kPacket];
        alignas(32) RTCRayHit8 packet;
        fill_packet(rays, index, count, valid, packet.ray);
        for (std::size_t i = 0; i < kPacket; ++i) {
            packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
            packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
        }
#if FRAZIL_EMBREE_MAJOR >= 4
        rtcIntersect8(valid, impl_->top, &packet, &arguments);
#else
        rtcIntersect8(valid, impl_->top, &context.embree, &packet);
#endif
        for (std::size_t i = 0; i < count; ++i) {
            if (packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) {
                hits[index[i]] = Hit();
                hits[index[i]].t = std::numeric_limits<float>::infinity();
                continue;
            }
            RTCRayHit one;
            one.ray.tfar = packet.ray.tfar[i];
            one.hit.Ng_x = packet.hit.Ng_x[i], one.hit.Ng_y = packet.hit.Ng_y[i], one.hit.Ng_z = packet.hit.Ng_z[i];
            one.hit.u = packet.hit.u[i], one.hit.v = packet.hit.v[i];
            one.hit.primID = packet.hit.primID[i], one.hit.geomID = packet.hit.geomID[i];
            one.hit.instID[0] = packet.hit.instID[0][i];
            hits[index[i]] = impl_->to_hit(one);
        }
    });
}

V3f offset_origin(const V3f& position, const V3f& normal) {
    // Integer steps in units of the last place far from the origin, a small constant near it.
    constexpr float kNearOrigin = 1.0f / 32.0f;
    constexpr float kFloatScale = 1.0f / 65536.0f;
    constexpr float kIntScale = 256.0f;
    V3f result;
    for (int axis = 0; axis < 3; ++axis) {
        const float p = position[axis];
        if (std::abs(p) < kNearOrigin) {
            result[axis] = p + kFloatScale * normal[axis];
            continue;
        }
        const int step = static_cast<int>(kIntScale * normal[axis]);
        result[axis] = std::bit_cast<float>(std::bit_cast<std::int32_t>(p) + (p < 0.0f ? -step : step));
    }
    return result;
}

}  // namespace frazil
