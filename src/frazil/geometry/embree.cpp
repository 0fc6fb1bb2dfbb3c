#include "frazil/geometry/embree.h"

#include <cstring>
#include <new>

#include "frazil/base/error.h"

namespace frazil {

RTCDevice embree_device() {
    static const RTCDevice shared = rtcNewDevice(nullptr);
    if (!shared) throw std::runtime_error("Embree: no device could be made on this processor.");
    return shared;
}

void throw_if_embree_failed(const char* step) {
    const RTCError code = rtcGetDeviceError(embree_device());
    if (code == RTC_ERROR_NONE) return;
    if (code == RTC_ERROR_OUT_OF_MEMORY) throw std::bad_alloc();
    throw std::runtime_error(str("Embree: ", step, " failed with error ", int(code), "."));
}

RTCGeometry make_triangles(const Mesh& mesh, const M44f& local_to_world) {
    RTCGeometry geometry = rtcNewGeometry(embree_device(), RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                                 sizeof(V3f), mesh.positions.size()));
    auto* indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, sizeof(V3i),
                                            mesh.triangles.size());
    throw_if_embree_failed("allocating a mesh");
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
        const V3f p = mesh.positions[i] * local_to_world;
        vertices[3 * i] = p.x, vertices[3 * i + 1] = p.y, vertices[3 * i + 2] = p.z;
    }
    std::memcpy(indices, mesh.triangles.data(), mesh.triangles.size() * sizeof(V3i));
    rtcCommitGeometry(geometry);
    return geometry;
}

RTCScene make_scene() {
    RTCScene scene = rtcNewScene(embree_device());
#if FRAZIL_EMBREE_MAJOR >= 4
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
#else
    // Embree 3 must know that a query may bring a filter.
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION);
#endif
    return scene;
}

}  // namespace frazil
