#include "frazil/geometry/self_intersections.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <type_traits>
#include <utility>

#include "frazil/base/parallel.h"
#include "frazil/geometry/embree.h"

namespace frazil {
namespace {

constexpr double kTolerance = 1e-3;  // of an edge's length

using Marks = std::vector<std::atomic<std::uint8_t>>;

bool shares_vertex(const V3i& triangle, int a, int b) {
    const auto is_end = [&](int vertex) { return vertex == a || vertex == b; };
    return is_end(triangle.x) || is_end(triangle.y) || is_end(triangle.z);
}

// An Embree query along an edge that marks all that it goes through.
struct EdgeQuery {
#if FRAZIL_EMBREE_MAJOR >= 4
    RTCRayQueryContext embree;  // first: Embree hands its address back
#else
    RTCIntersectContext embree;
#endif
    const Mesh* mesh;
    Marks* marks;
    std::uint32_t owner;  // a triangle of the edge
    int from, to;         // its vertices

    EdgeQuery(const Mesh& of, Marks& into, std::uint32_t triangle, int a, int b)
        : mesh(&of), marks(&into), owner(triangle), from(a), to(b) {
#if FRAZIL_EMBREE_MAJOR >= 4
        rtcInitRayQueryContext(&embree);
#else
        rtcInitIntersectContext(&embree);
        embree.filter = &mark;
#endif
    }

    bool crosses(std::uint32_t triangle) const {
        const V3i& t = mesh->triangles[triangle];
        if (shares_vertex(t, from, to)) return false;
        const V3d a(mesh->positions[from]), b(mesh->positions[to]), origin(mesh->positions[t.x]);
        const V3d normal = triangle_cross(*mesh, triangle).normalized();
        const double before = (a - origin).dot(normal), after = (b - origin).dot(normal);
        return before * after < 0.0 && std::min(std::abs(before), std::abs(after)) > kTolerance * (b - a).length();
    }

    // Every hit is refused, so that the ray goes on to the next.
    static void mark(const RTCFilterFunctionNArguments* arguments) {
        const auto* self = reinterpret_cast<const EdgeQuery*>(arguments->context);
        if (arguments->valid[0] != -1) return;
        arguments->valid[0] = 0;
        const std::uint32_t triangle = RTCHitN_primID(arguments->hit, 1, 0);
        if (!self->crosses(triangle)) return;
        (*self->marks)[triangle].store(1, std::memory_order_relaxed);
        (*self->marks)[self->owner].store(1, std::memory_order_relaxed);
    }

    void run(RTCScene scene) {
        const V3f a = mesh->positions[from], along = mesh->positions[to] - a;
        RTCRay ray{};
        ray.org_x = a.x, ray.org_y = a.y, ray.org_z = a.z;
        ray.dir_x = along.x, ray.dir_y = along.y, ray.dir_z = along.z;
        ray.tfar = 1.0f;
        ray.mask = ~0U;
#if FRAZIL_EMBREE_MAJOR >= 4
        RTCOccludedArguments arguments;
        rtcInitOccludedArguments(&arguments);
        arguments.context = &embree;
        arguments.filter = &mark;
        arguments.flags = RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER;
        rtcOccluded1(scene, &ray, &arguments);
#else
        rtcOccluded1(scene, &embree, &ray);
#endif
    }
};

struct ReleaseScene {
    void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};

}  // namespace

std::vector<std::int32_t> self_intersections(const Mesh& mesh) {
    if (mesh.triangles.empty()) return {};
    const std::unique_ptr<std::remove_pointer_t<RTCScene>, ReleaseScene> scene(make_scene());
    RTCGeometry geometry = make_triangles(mesh, M44f());
    rtcAttachGeometry(scene.get(), geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene.get());
    throw_if_embree_failed("building a mesh");

    Marks marks(mesh.triangles.size());
    parallel_for(mesh.triangles.size(), 1024, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const V3i& t = mesh.triangles[i];
            for (const auto& [a, b] : {std::pair(t.x, t.y), std::pair(t.y, t.z), std::pair(t.z, t.x)}) {
                EdgeQuery(mesh, marks, static_cast<std::uint32_t>(i), a, b).run(scene.get());
            }
        }
    });
    std::vector<std::int32_t> found;
    for (std::size_t i = 0; i < marks.size(); ++i) {
        if (marks[i].load(std::memory_order_relaxed)) found.push_back(static_cast<std::int32_t>(i));
    }
    return found;
}

}  // namespace frazil
