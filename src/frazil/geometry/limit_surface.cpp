#include "frazil/geometry/limit_surface.h"

#include <bit>
#include <cstring>
#include <limits>
#include <unordered_map>

#include "frazil/base/random.h"

namespace frazil {
namespace {

constexpr float kInfiniteSharpness = 10.0f;  // USD's

// Face-varying values as a topology of their own: equal values at one vertex are one, so that a seam is where they
// differ.
struct Seams {
    std::vector<V2f> values;
    std::vector<std::int32_t> indices;  // per corner
};

Seams find_seams(const ControlMesh& cage) {
    struct Key {
        std::int32_t vertex;
        V2f value;
        bool operator==(const Key&) const = default;
    };
    struct Hash {
        std::size_t operator()(const Key& key) const {
            return hash(std::uint32_t(key.vertex), std::bit_cast<std::uint32_t>(key.value.x + 0.0f),
                        std::bit_cast<std::uint32_t>(key.value.y + 0.0f));
        }
    };
    Seams seams;
    std::unordered_map<Key, std::int32_t, Hash> known;
    known.reserve(cage.positions.size());
    for (std::size_t corner = 0; corner < cage.face_vertex_indices.size(); ++corner) {
        const Key key{cage.face_vertex_indices[corner], cage.uvs.values[corner]};
        const auto [at, is_new] = known.try_emplace(key, std::int32_t(seams.values.size()));
        if (is_new) seams.values.push_back(key.value);
        seams.indices.push_back(at->second);
    }
    return seams;
}

template <class T>
void set_buffer(RTCGeometry geometry, RTCBufferType type, unsigned slot, RTCFormat format,
                const std::vector<T>& values) {
    if (values.empty()) return;
    void* memory = rtcSetNewGeometryBuffer(geometry, type, slot, format, sizeof(T), values.size());
    throw_if_embree_failed("allocating a subdivision surface");
    std::memcpy(memory, values.data(), values.size() * sizeof(T));
}

// Embree loads four floats at once, also behind the last value: rows of four, zeros behind.
template <class T>
void set_float_buffer(RTCGeometry geometry, RTCBufferType type, RTCFormat format, const std::vector<T>& values) {
    constexpr std::size_t kStride = 4 * sizeof(float);
    auto* memory = static_cast<std::byte*>(rtcSetNewGeometryBuffer(geometry, type, 0, format, kStride, values.size()));
    throw_if_embree_failed("allocating a subdivision surface");
    std::memset(memory, 0, values.size() * kStride);
    for (std::size_t i = 0; i < values.size(); ++i) std::memcpy(memory + i * kStride, &values[i], sizeof(T));
}

float sharpness(float value) {
    return value >= kInfiniteSharpness ? std::numeric_limits<float>::infinity() : value;
}

void set_creases(RTCGeometry geometry, const ControlMesh& cage) {
    struct Edge {
        std::int32_t a, b;
    };
    std::vector<Edge> edges;
    std::vector<float> edge_weights;
    // A chain of n vertices has n - 1 edges; sharpness is given per chain or per edge.
    std::size_t edge_count = 0;
    for (const std::int32_t length : cage.crease_lengths) edge_count += std::max(0, length - 1);
    const bool is_per_edge =
        cage.crease_sharpnesses.size() == edge_count && cage.crease_sharpnesses.size() != cage.crease_lengths.size();
    std::size_t at = 0;
    for (std::size_t chain = 0; chain < cage.crease_lengths.size(); ++chain) {
        for (int i = 0; i + 1 < cage.crease_lengths[chain]; ++i) {
            const float weight = cage.crease_sharpnesses[is_per_edge ? edges.size() : chain];
            edges.push_back({cage.crease_indices[at + i], cage.crease_indices[at + i + 1]});
            edge_weights.push_back(sharpness(weight));
        }
        at += cage.crease_lengths[chain];
    }
    set_buffer(geometry, RTC_BUFFER_TYPE_EDGE_CREASE_INDEX, 0, RTC_FORMAT_UINT2, edges);
    set_buffer(geometry, RTC_BUFFER_TYPE_EDGE_CREASE_WEIGHT, 0, RTC_FORMAT_FLOAT, edge_weights);
    std::vector<float> corner_weights;
    for (const float value : cage.corner_sharpnesses) corner_weights.push_back(sharpness(value));
    set_buffer(geometry, RTC_BUFFER_TYPE_VERTEX_CREASE_INDEX, 0, RTC_FORMAT_UINT, cage.corner_indices);
    set_buffer(geometry, RTC_BUFFER_TYPE_VERTEX_CREASE_WEIGHT, 0, RTC_FORMAT_FLOAT, corner_weights);
}

void set_uvs(RTCGeometry geometry, const ControlMesh& cage) {
    if (cage.uvs.is_empty()) return;
    rtcSetGeometryVertexAttributeCount(geometry, 1);
    if (cage.uvs.interpolation == Interpolation::vertex) {
        set_float_buffer(geometry, RTC_BUFFER_TYPE_VERTEX_ATTRIBUTE, RTC_FORMAT_FLOAT2, cage.uvs.values);
    } else if (cage.uvs.interpolation == Interpolation::corner) {
        const Seams seams = find_seams(cage);
        rtcSetGeometryTopologyCount(geometry, 2);
        set_buffer(geometry, RTC_BUFFER_TYPE_INDEX, 1, RTC_FORMAT_UINT, seams.indices);
        set_float_buffer(geometry, RTC_BUFFER_TYPE_VERTEX_ATTRIBUTE, RTC_FORMAT_FLOAT2, seams.values);
        rtcSetGeometrySubdivisionMode(geometry, 1, RTC_SUBDIVISION_MODE_PIN_BOUNDARY);
        rtcSetGeometryVertexAttributeTopology(geometry, 0, 1);
    }
}

}  // namespace

LimitSurface::LimitSurface(const ControlMesh& cage, bool with_uvs)
    : geometry_(rtcNewGeometry(embree_device(), RTC_GEOMETRY_TYPE_SUBDIVISION)) {
    set_buffer(geometry_, RTC_BUFFER_TYPE_FACE, 0, RTC_FORMAT_UINT, cage.face_vertex_counts);
    set_buffer(geometry_, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, cage.face_vertex_indices);
    set_float_buffer(geometry_, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, cage.positions);
    set_creases(geometry_, cage);
    rtcSetGeometrySubdivisionMode(
        geometry_, 0,
        cage.is_boundary_smooth ? RTC_SUBDIVISION_MODE_SMOOTH_BOUNDARY : RTC_SUBDIVISION_MODE_PIN_CORNERS);
    if (with_uvs) set_uvs(geometry_, cage);
    rtcCommitGeometry(geometry_);
    throw_if_embree_failed("building a subdivision surface");
}

LimitSurface::~LimitSurface() {
    rtcReleaseGeometry(geometry_);
}

void LimitSurface::eval(std::uint32_t face, const V2f& at, V3f& position, V3f& normal) const {
    float p[4], du[4], dv[4];
    rtcInterpolate1(geometry_, face, at.x, at.y, RTC_BUFFER_TYPE_VERTEX, 0, p, du, dv, 3);
    position = V3f(p[0], p[1], p[2]);
    normal = V3f(du[0], du[1], du[2]).normalized().cross(V3f(dv[0], dv[1], dv[2]).normalized());
    if (!is_finite(normal) || normal.length() < 1e-3f) {
        normal = V3f(0.0f);
    } else {
        normal.normalize();
    }
}

V2f LimitSurface::eval_uv(std::uint32_t face, const V2f& at) const {
    float st[4];
    rtcInterpolate0(geometry_, face, at.x, at.y, RTC_BUFFER_TYPE_VERTEX_ATTRIBUTE, 0, st, 2);
    return {st[0], st[1]};
}

}  // namespace frazil
