// The curved half of subdivision.h: Catmull-Clark limit surfaces. Flat polygons are in triangulation.cpp.
#include "frazil/geometry/subdivision.h"

#include <bit>
#include <cstring>
#include <numeric>
#include <unordered_map>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/base/random.h"
#include "frazil/geometry/embree.h"

namespace frazil {
namespace {

constexpr std::size_t kMaxFaceSize = 15;        // Embree's
constexpr float kCreaseMargin = 0.02f;       // of a patch, for normals beside creases
constexpr float kSameSurface = 0.97f;        // cosine between normals of one vertex that are still one surface
constexpr float kInfiniteSharpness = 10.0f;  // USD's

// The cage without what Embree cannot take: faces of fewer than three corners, of more than 15, or that pass a vertex
// twice. `faces` tells where each kept face (or piece of one) came from.
struct CleanCage {
    ControlMesh cage;
    std::vector<std::int32_t> faces;
    std::vector<std::size_t> corners;  // the original corner of each kept corner
};

bool has_repeated_vertex(const std::vector<std::int32_t>& vertices, std::vector<std::int32_t>& scratch) {
    scratch = vertices;
    std::sort(scratch.begin(), scratch.end());
    return std::adjacent_find(scratch.begin(), scratch.end()) != scratch.end();
}

CleanCage clean(const ControlMesh& cage, const std::string& path) {
    CleanCage result;
    std::vector<std::size_t> first_piece(cage.face_vertex_counts.size());
    ControlMesh& out = result.cage;
    const auto add_face = [&](std::size_t face, const std::vector<std::size_t>& corners) {
        out.face_vertex_counts.push_back(std::int32_t(corners.size()));
        result.faces.push_back(std::int32_t(face));
        for (const std::size_t corner : corners) {
            out.face_vertex_indices.push_back(cage.face_vertex_indices[corner]);
            result.corners.push_back(corner);
        }
    };
    std::size_t first = 0;
    std::vector<std::size_t> corners;
    std::vector<std::int32_t> vertices, scratch;
    for (std::size_t face = 0; face < cage.face_vertex_counts.size(); ++face) {
        const int count = cage.face_vertex_counts[face];
        first_piece[face] = result.faces.size();
        // Edges without length go: a corner whose vertex is the next one's, too.
        corners.clear(), vertices.clear();
        for (int i = 0; i < count; ++i) {
            const std::int32_t vertex = cage.face_vertex_indices[first + i];
            if (vertex == cage.face_vertex_indices[first + (i + 1) % count]) continue;
            corners.push_back(first + i), vertices.push_back(vertex);
        }
        first += count;
        if (corners.size() < 3) continue;
        if (corners.size() <= kMaxFaceSize && !has_repeated_vertex(vertices, scratch)) {
            add_face(face, corners);
            continue;
        }
        ControlMesh polygon;
        polygon.face_vertex_counts = {std::int32_t(corners.size())};
        for (std::size_t i = 0; i < corners.size(); ++i) {
            polygon.positions.push_back(cage.positions[vertices[i]]);
            polygon.face_vertex_indices.push_back(std::int32_t(i));
        }
        for (const V3i& t : triangulate(polygon, path).mesh.triangles) {
            if (has_repeated_vertex({vertices[t.x], vertices[t.y], vertices[t.z]}, scratch)) continue;
            add_face(face, {corners[t.x], corners[t.y], corners[t.z]});
        }
    }
    out.positions = cage.positions;
    out.crease_indices = cage.crease_indices;
    out.crease_lengths = cage.crease_lengths;
    out.crease_sharpnesses = cage.crease_sharpnesses;
    out.corner_indices = cage.corner_indices;
    out.corner_sharpnesses = cage.corner_sharpnesses;
    out.is_boundary_smooth = cage.is_boundary_smooth;
    for (const std::int32_t hole : cage.hole_faces) {
        for (std::size_t i = first_piece[hole]; i < result.faces.size() && result.faces[i] == hole; ++i) {
            out.hole_faces.push_back(std::int32_t(i));
        }
    }
    const auto pull = [&](const auto& primvar, auto& pulled) {
        pulled.interpolation = primvar.interpolation;
        if (primvar.is_empty()) return;
        if (primvar.interpolation == Interpolation::corner) {
            for (const std::size_t corner : result.corners) pulled.values.push_back(primvar.values[corner]);
        } else if (primvar.interpolation == Interpolation::uniform) {
            for (const std::int32_t face : result.faces) pulled.values.push_back(primvar.values[face]);
        } else {
            pulled.values = primvar.values;
        }
    };
    pull(cage.uvs, out.uvs);
    pull(cage.colors, out.colors);
    return result;
}

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

// The cage as an Embree geometry in a committed scene, ready for rtcInterpolate.
class LimitSurface {
  public:
    explicit LimitSurface(const ControlMesh& cage) {
        geometry_ = rtcNewGeometry(embree_device(), RTC_GEOMETRY_TYPE_SUBDIVISION);
        set_buffer(RTC_BUFFER_TYPE_FACE, 0, RTC_FORMAT_UINT, cage.face_vertex_counts);
        set_buffer(RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, cage.face_vertex_indices);
        set_float_buffer(RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, cage.positions);
        // Holes are not told to Embree, which would make boundaries of their edges; they are just never evaluated.
        set_creases(cage);
        rtcSetGeometrySubdivisionMode(
            geometry_, 0,
            cage.is_boundary_smooth ? RTC_SUBDIVISION_MODE_SMOOTH_BOUNDARY : RTC_SUBDIVISION_MODE_PIN_CORNERS);
        set_uvs(cage);
        rtcCommitGeometry(geometry_);
        scene_ = rtcNewScene(embree_device());
        rtcAttachGeometry(scene_, geometry_);
        rtcCommitScene(scene_);
        throw_if_embree_failed("building a subdivision surface");
    }
    ~LimitSurface() {
        rtcReleaseScene(scene_);
        rtcReleaseGeometry(geometry_);
    }
    LimitSurface(const LimitSurface&) = delete;
    LimitSurface& operator=(const LimitSurface&) = delete;

    // Limit position and unit normal; a zero normal where the tangents vanish.
    void eval(std::uint32_t face, const V2f& at, V3f& position, V3f& normal) const {
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

    V2f eval_uv(std::uint32_t face, const V2f& at) const {
        float st[4];
        rtcInterpolate0(geometry_, face, at.x, at.y, RTC_BUFFER_TYPE_VERTEX_ATTRIBUTE, 0, st, 2);
        return {st[0], st[1]};
    }

  private:
    template <class T>
    void set_buffer(RTCBufferType type, unsigned slot, RTCFormat format, const std::vector<T>& values) {
        if (values.empty()) return;
        void* memory = rtcSetNewGeometryBuffer(geometry_, type, slot, format, sizeof(T), values.size());
        throw_if_embree_failed("allocating a subdivision surface");
        std::memcpy(memory, values.data(), values.size() * sizeof(T));
    }

    // Embree loads four floats at once, also behind the last value: rows of four, zeros behind.
    template <class T>
    void set_float_buffer(RTCBufferType type, RTCFormat format, const std::vector<T>& values) {
        constexpr std::size_t kStride = 4 * sizeof(float);
        auto* memory =
            static_cast<std::byte*>(rtcSetNewGeometryBuffer(geometry_, type, 0, format, kStride, values.size()));
        throw_if_embree_failed("allocating a subdivision surface");
        std::memset(memory, 0, values.size() * kStride);
        for (std::size_t i = 0; i < values.size(); ++i) std::memcpy(memory + i * kStride, &values[i], sizeof(T));
    }

    static float sharpness(float value) {
        return value >= kInfiniteSharpness ? std::numeric_limits<float>::infinity() : value;
    }

    void set_creases(const ControlMesh& cage) {
        struct Edge {
            std::int32_t a, b;
        };
        std::vector<Edge> edges;
        std::vector<float> edge_weights;
        // A chain of n vertices has n - 1 edges; sharpness is given per chain or per edge.
        std::size_t edge_count = 0;
        for (const std::int32_t length : cage.crease_lengths) edge_count += std::max(0, length - 1);
        const bool is_per_edge = cage.crease_sharpnesses.size() == edge_count &&
                                 cage.crease_sharpnesses.size() != cage.crease_lengths.size();
        std::size_t at = 0;
        for (std::size_t chain = 0; chain < cage.crease_lengths.size(); ++chain) {
            for (int i = 0; i + 1 < cage.crease_lengths[chain]; ++i) {
                const float weight = cage.crease_sharpnesses[is_per_edge ? edges.size() : chain];
                edges.push_back({cage.crease_indices[at + i], cage.crease_indices[at + i + 1]});
                edge_weights.push_back(sharpness(weight));
            }
            at += cage.crease_lengths[chain];
        }
        set_buffer(RTC_BUFFER_TYPE_EDGE_CREASE_INDEX, 0, RTC_FORMAT_UINT2, edges);
        set_buffer(RTC_BUFFER_TYPE_EDGE_CREASE_WEIGHT, 0, RTC_FORMAT_FLOAT, edge_weights);
        std::vector<float> corner_weights;
        for (const float value : cage.corner_sharpnesses) corner_weights.push_back(sharpness(value));
        set_buffer(RTC_BUFFER_TYPE_VERTEX_CREASE_INDEX, 0, RTC_FORMAT_UINT, cage.corner_indices);
        set_buffer(RTC_BUFFER_TYPE_VERTEX_CREASE_WEIGHT, 0, RTC_FORMAT_FLOAT, corner_weights);
    }

    void set_uvs(const ControlMesh& cage) {
        if (cage.uvs.is_empty()) return;
        rtcSetGeometryVertexAttributeCount(geometry_, 1);
        if (cage.uvs.interpolation == Interpolation::vertex) {
            set_float_buffer(RTC_BUFFER_TYPE_VERTEX_ATTRIBUTE, RTC_FORMAT_FLOAT2, cage.uvs.values);
        } else if (cage.uvs.interpolation == Interpolation::corner) {
            const Seams seams = find_seams(cage);
            rtcSetGeometryTopologyCount(geometry_, 2);
            set_buffer(RTC_BUFFER_TYPE_INDEX, 1, RTC_FORMAT_UINT, seams.indices);
            set_float_buffer(RTC_BUFFER_TYPE_VERTEX_ATTRIBUTE, RTC_FORMAT_FLOAT2, seams.values);
            rtcSetGeometrySubdivisionMode(geometry_, 1, RTC_SUBDIVISION_MODE_PIN_BOUNDARY);
            rtcSetGeometryVertexAttributeTopology(geometry_, 0, 1);
        }
    }

    RTCGeometry geometry_ = nullptr;
    RTCScene scene_ = nullptr;
};

// Undirected edges numbered in the order of their vertices; one number per face corner, for the edge that leaves it.
struct Edges {
    std::vector<std::int32_t> of_corner;
    std::vector<std::uint8_t> is_forward;  // the corner runs from the smaller vertex to the larger
    std::size_t count = 0;
};

Edges number_edges(const ControlMesh& cage, const std::vector<std::size_t>& first_corner) {
    struct HalfEdge {
        std::int32_t low, high;
        std::size_t corner;
    };
    std::vector<HalfEdge> half_edges;
    half_edges.reserve(cage.face_vertex_indices.size());
    Edges edges;
    edges.of_corner.resize(cage.face_vertex_indices.size());
    edges.is_forward.resize(cage.face_vertex_indices.size());
    for (std::size_t face = 0; face < cage.face_vertex_counts.size(); ++face) {
        const int count = cage.face_vertex_counts[face];
        for (int i = 0; i < count; ++i) {
            const std::size_t corner = first_corner[face] + i;
            const std::int32_t a = cage.face_vertex_indices[corner];
            const std::int32_t b = cage.face_vertex_indices[first_corner[face] + (i + 1) % count];
            half_edges.push_back({std::min(a, b), std::max(a, b), corner});
            edges.is_forward[corner] = a < b;
        }
    }
    std::sort(half_edges.begin(), half_edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
        return std::tie(a.low, a.high, a.corner) < std::tie(b.low, b.high, b.corner);
    });
    for (std::size_t i = 0; i < half_edges.size(); ++i) {
        const HalfEdge& edge = half_edges[i];
        if (i > 0 && (edge.low != half_edges[i - 1].low || edge.high != half_edges[i - 1].high)) ++edges.count;
        edges.of_corner[edge.corner] = std::int32_t(edges.count);
    }
    if (!half_edges.empty()) ++edges.count;
    return edges;
}

// One grid of samples: a quad face, or one of the n sub-quads of another. `steps` cells along each side.
struct Patch {
    std::int32_t face = 0;
    int sub = -1;  // -1 = the whole quad
    int steps = 1;
    std::size_t first_sample = 0;
    std::size_t first_interior = 0;  // vertex numbers inside the face

    int side() const { return steps + 1; }
    std::size_t sample(int i, int j) const { return first_sample + std::size_t(j) * side() + i; }

    // Embree's face coordinates: sub-quads lie in cells of a 4 x 4 board, shrunk to half so that they do not touch.
    V2f coordinates(int i, int j, float margin = 0.0f) const {
        const float u = std::clamp(float(i) / float(steps), margin, 1.0f - margin);
        const float v = std::clamp(float(j) / float(steps), margin, 1.0f - margin);
        if (sub < 0) return {u, v};
        return {2.0f * float(sub % 4) + 0.5f + u, 2.0f * float(sub / 4) + 0.5f + v};
    }
};

class Refinement {
  public:
    Refinement(const ControlMesh& cage, int level) : cage_(cage), level_(level) {
        first_corner_.resize(cage.face_vertex_counts.size() + 1, 0);
        std::inclusive_scan(cage.face_vertex_counts.begin(), cage.face_vertex_counts.end(), first_corner_.begin() + 1,
                            std::plus<>(), std::size_t(0));
        edges_ = number_edges(cage, first_corner_);
        make_patches();
    }

    Mesh run(std::vector<std::int32_t>& faces) {
        sample();
        Mesh mesh;
        mesh.positions.resize(vertex_count_);
        // Walk backwards, so that the first patch of those that share a vertex has the last word.
        for (std::size_t p = patches_.size(); p-- > 0;) {
            for_samples(patches_[p], [&](std::size_t sample, std::size_t vertex) {
                mesh.positions[vertex] = positions_[sample];
            });
        }
        std::vector<std::size_t> corner_samples;
        for (const Patch& patch : patches_) {
            for (int j = 0; j < patch.steps; ++j) {
                for (int i = 0; i < patch.steps; ++i) {
                    const std::size_t a = patch.sample(i, j), b = patch.sample(i + 1, j);
                    const std::size_t c = patch.sample(i + 1, j + 1), d = patch.sample(i, j + 1);
                    corner_samples.insert(corner_samples.end(), {a, b, c, a, c, d});
                    faces.insert(faces.end(), 2, patch.face);
                }
            }
        }
        for (std::size_t i = 0; i < corner_samples.size(); i += 3) {
            mesh.triangles.emplace_back(vertices_[corner_samples[i]], vertices_[corner_samples[i + 1]],
                                        vertices_[corner_samples[i + 2]]);
        }
        set_normals(mesh, corner_samples);
        set_primvars(mesh, corner_samples, faces);
        return mesh;
    }

  private:
    void make_patches() {
        std::vector<std::uint8_t> is_hole(cage_.face_vertex_counts.size(), 0);
        for (const std::int32_t face : cage_.hole_faces) is_hole[face] = 1;
        std::size_t sample_count = 0;
        vertex_count_ = cage_.positions.size() + edges_.count * std::size_t(level_ - 1);
        for (std::size_t face = 0; face < cage_.face_vertex_counts.size(); ++face) {
            if (is_hole[face]) continue;
            const int count = cage_.face_vertex_counts[face];
            const bool is_quad = count == 4;
            const int steps = is_quad ? level_ : level_ / 2;
            const std::size_t first_interior = vertex_count_;
            for (int sub = 0; sub < (is_quad ? 1 : count); ++sub) {
                patches_.push_back({std::int32_t(face), is_quad ? -1 : sub, steps, sample_count, first_interior});
                sample_count += std::size_t(steps + 1) * (steps + 1);
            }
            const std::size_t inner = std::size_t(steps - 1);
            vertex_count_ += is_quad ? inner * inner : 1 + count * inner + count * inner * inner;
        }
        vertices_.resize(sample_count);
        positions_.resize(sample_count);
        normals_.resize(sample_count);
        for (const Patch& patch : patches_) number_vertices(patch);
    }

    // The vertex `step` steps (of level_) along the edge that leaves a corner.
    std::int32_t edge_vertex(std::size_t face, int corner, int step) const {
        const int count = cage_.face_vertex_counts[face];
        const std::size_t at = first_corner_[face] + corner;
        if (step == 0) return cage_.face_vertex_indices[at];
        if (step == level_) return cage_.face_vertex_indices[first_corner_[face] + (corner + 1) % count];
        if (!edges_.is_forward[at]) step = level_ - step;
        return std::int32_t(cage_.positions.size() + std::size_t(edges_.of_corner[at]) * (level_ - 1) + step - 1);
    }

    void number_vertices(const Patch& patch) {
        const int s = patch.steps, count = cage_.face_vertex_counts[patch.face];
        const auto first = std::int32_t(patch.first_interior);
        const auto spoke = [&](int sub, int step) {  // from the middle of edge `sub` to the centre
            return step == s ? first : first + 1 + sub * (s - 1) + step - 1;
        };
        for (int j = 0; j <= s; ++j) {
            for (int i = 0; i <= s; ++i) {
                std::int32_t& vertex = vertices_[patch.sample(i, j)];
                if (patch.sub < 0) {
                    if (j == 0) vertex = edge_vertex(patch.face, 0, i);
                    else if (i == s) vertex = edge_vertex(patch.face, 1, j);
                    else if (j == s) vertex = edge_vertex(patch.face, 2, s - i);
                    else if (i == 0) vertex = edge_vertex(patch.face, 3, s - j);
                    else vertex = first + (j - 1) * (s - 1) + i - 1;
                    continue;
                }
                const int before = (patch.sub + count - 1) % count;
                if (j == 0) vertex = edge_vertex(patch.face, patch.sub, i);
                else if (i == 0) vertex = edge_vertex(patch.face, before, level_ - j);
                else if (i == s) vertex = spoke(patch.sub, j);
                else if (j == s) vertex = spoke(before, i);
                else vertex = first + 1 + count * (s - 1) + (patch.sub * (s - 1) + j - 1) * (s - 1) + i - 1;
            }
        }
    }

    void sample() {
        const LimitSurface surface(cage_);
        const bool has_smooth_uvs =
            !cage_.uvs.is_empty() &&
            (cage_.uvs.interpolation == Interpolation::vertex || cage_.uvs.interpolation == Interpolation::corner);
        if (has_smooth_uvs) uvs_.resize(positions_.size());
        parallel_for(patches_.size(), 64, [&](std::size_t begin, std::size_t end) {
            for (std::size_t p = begin; p < end; ++p) {
                const Patch& patch = patches_[p];
                for (int j = 0; j <= patch.steps; ++j) {
                    for (int i = 0; i <= patch.steps; ++i) {
                        const std::size_t at = patch.sample(i, j);
                        const V2f uv = patch.coordinates(i, j);
                        surface.eval(patch.face, uv, positions_[at], normals_[at]);
                        if (has_creases()) {
                            // On a sharp edge Embree's tangents are those of a tiny fillet: take them just inside.
                            V3f ignored;
                            surface.eval(patch.face, patch.coordinates(i, j, kCreaseMargin), ignored, normals_[at]);
                        }
                        if (has_smooth_uvs) uvs_[at] = surface.eval_uv(patch.face, uv);
                    }
                }
            }
        });
        throw_if_embree_failed("evaluating a subdivision surface");
    }

    template <class Body>
    void for_samples(const Patch& patch, const Body& body) const {
        const std::size_t end = patch.first_sample + std::size_t(patch.side()) * patch.side();
        for (std::size_t at = patch.first_sample; at < end; ++at) body(at, std::size_t(vertices_[at]));
    }

    // One normal per vertex, the mean of what the faces around it say; per corner where creases may break it.
    void set_normals(Mesh& mesh, const std::vector<std::size_t>& corner_samples) {
        // Where tangents vanish (on infinite creases), the triangles of the same patch tell.
        std::vector<V3f> flat(vertices_.size(), V3f(0.0f));
        for (std::size_t i = 0; i < corner_samples.size(); ++i) {
            flat[corner_samples[i]] += V3f(triangle_cross(mesh, i / 3));
        }
        for (std::size_t at = 0; at < vertices_.size(); ++at) {
            if (normals_[at] == V3f(0.0f)) normals_[at] = flat[at].normalized();
        }
        // A normal of length 0 (in the middle of a fold) is none: the first triangle's is taken.
        const auto fill = [&](V3f& normal, std::size_t triangle) {
            if (normal == V3f(0.0f)) normal = V3f(triangle_cross(mesh, triangle).normalized());
        };
        if (!has_creases()) {
            std::vector<V3f> sums(vertex_count_, V3f(0.0f));
            for (std::size_t at = 0; at < vertices_.size(); ++at) sums[vertices_[at]] += normals_[at];
            for (V3f& sum : sums) sum.normalize();
            for (std::size_t i = 0; i < corner_samples.size(); ++i) fill(sums[vertices_[corner_samples[i]]], i / 3);
            mesh.normals = {std::move(sums), Interpolation::vertex};
            return;
        }
        const std::vector<V3f> welded = welded_normals();
        mesh.normals.interpolation = Interpolation::corner;
        for (std::size_t i = 0; i < corner_samples.size(); ++i) {
            mesh.normals.values.push_back(welded[corner_samples[i]]);
            fill(mesh.normals.values.back(), i / 3);
        }
    }

    bool has_creases() const { return !cage_.crease_lengths.empty() || !cage_.corner_indices.empty(); }

    // The normal of every sample, averaged with those at the same vertex that belong to the same smooth surface.
    std::vector<V3f> welded_normals() const {
        std::vector<std::size_t> order(vertices_.size());
        std::iota(order.begin(), order.end(), std::size_t(0));
        std::stable_sort(order.begin(), order.end(),
                         [&](std::size_t a, std::size_t b) { return vertices_[a] < vertices_[b]; });
        std::vector<V3f> result(vertices_.size());
        for (std::size_t begin = 0, end = 0; begin < order.size(); begin = end) {
            while (end < order.size() && vertices_[order[end]] == vertices_[order[begin]]) ++end;
            for (std::size_t i = begin; i < end; ++i) {
                V3f sum(0.0f);
                for (std::size_t j = begin; j < end; ++j) {
                    if (normals_[order[i]].dot(normals_[order[j]]) > kSameSurface) sum += normals_[order[j]];
                }
                result[order[i]] = sum.normalized();
            }
        }
        return result;
    }

    void set_primvars(Mesh& mesh, const std::vector<std::size_t>& corner_samples,
                      const std::vector<std::int32_t>& faces) {
        if (!uvs_.empty()) {
            mesh.uvs.interpolation = Interpolation::corner;
            for (const std::size_t at : corner_samples) mesh.uvs.values.push_back(uvs_[at]);
        } else {
            spread(cage_.uvs, mesh.uvs, corner_samples, faces);
        }
        spread(cage_.colors, mesh.colors, corner_samples, faces);
    }

    // Bilinear over each patch; constant and uniform values as they are.
    template <class T>
    void spread(const Primvar<T>& from, Primvar<T>& to, const std::vector<std::size_t>& corner_samples,
                const std::vector<std::int32_t>& faces) const {
        to.interpolation = from.interpolation;
        if (from.is_empty()) return;
        if (from.interpolation == Interpolation::constant) {
            to.values = from.values;
            return;
        }
        if (from.interpolation == Interpolation::uniform) {
            for (const std::int32_t face : faces) to.values.push_back(from.values[face]);
            return;
        }
        std::vector<T> samples(vertices_.size());
        for (const Patch& patch : patches_) {
            const int count = cage_.face_vertex_counts[patch.face], s = patch.steps;
            const auto value = [&](int corner) {
                const std::size_t at = first_corner_[patch.face] + (corner + count) % count;
                return from.values[from.interpolation == Interpolation::corner ? at : cage_.face_vertex_indices[at]];
            };
            T corners[4] = {value(0), value(1), value(2), value(3)};
            if (patch.sub >= 0) {
                T centre = value(0);
                for (int i = 1; i < count; ++i) centre += value(i);
                corners[0] = value(patch.sub);
                corners[1] = (value(patch.sub) + value(patch.sub + 1)) * 0.5f;
                corners[2] = centre / float(count);
                corners[3] = (value(patch.sub) + value(patch.sub - 1)) * 0.5f;
            }
            for (int j = 0; j <= s; ++j) {
                for (int i = 0; i <= s; ++i) {
                    const float u = float(i) / float(s), v = float(j) / float(s);
                    samples[patch.sample(i, j)] = (corners[0] * (1 - u) + corners[1] * u) * (1 - v) +
                                                  (corners[3] * (1 - u) + corners[2] * u) * v;
                }
            }
        }
        to.interpolation = Interpolation::corner;
        for (const std::size_t at : corner_samples) to.values.push_back(samples[at]);
    }

    const ControlMesh& cage_;
    const int level_;
    std::vector<std::size_t> first_corner_;
    Edges edges_;
    std::vector<Patch> patches_;
    std::size_t vertex_count_ = 0;
    // By sample: one per grid point of every patch, so that faces can be evaluated apart.
    std::vector<std::int32_t> vertices_;
    std::vector<V3f> positions_, normals_;
    std::vector<V2f> uvs_;
};

// Vertices that no triangle uses (of holes, or loose in the cage) would make the bounds wrong.
Mesh without_loose_vertices(const Mesh& mesh) {
    std::vector<std::int32_t> all(mesh.triangles.size());
    std::iota(all.begin(), all.end(), 0);
    return submesh(mesh, all);
}

void check_creases(const ControlMesh& cage, const std::string& path) {
    std::size_t indices = 0, edges = 0;
    for (const std::int32_t length : cage.crease_lengths) {
        if (length < 2) throw ValueError(str(path, ": creaseLengths must be >= 2, got ", length, "."));
        indices += length, edges += length - 1;
    }
    if (indices != cage.crease_indices.size()) {
        throw ValueError(str(path, ": creaseIndices must have ", indices, " entries (the sum of creaseLengths), got ",
                             cage.crease_indices.size(), "."));
    }
    const std::size_t sharpnesses = cage.crease_sharpnesses.size();
    if (sharpnesses != cage.crease_lengths.size() && sharpnesses != edges) {
        throw ValueError(str(path, ": creaseSharpnesses must have ", cage.crease_lengths.size(),
                             " values (one per crease), got ", sharpnesses, "."));
    }
    for (const auto* values : {&cage.crease_sharpnesses, &cage.corner_sharpnesses}) {
        for (const float value : *values) {
            if (!(value >= 0.0f)) throw ValueError(str(path, ": sharpness must be >= 0, got ", value, "."));
        }
    }
    if (cage.corner_indices.size() != cage.corner_sharpnesses.size()) {
        throw ValueError(str(path, ": cornerSharpnesses must have ", cage.corner_indices.size(),
                             " values (one per corner), got ", cage.corner_sharpnesses.size(), "."));
    }
}

}  // namespace

RefinedMesh subdivide(const ControlMesh& cage, int level, const std::string& path) {
    if (level < 1) throw ValueError(str(path, ": the subdivision level must be >= 1, got ", level, "."));
    check_control_mesh(cage, path);
    check_creases(cage, path);
    const CleanCage cleaned = clean(cage, path);
    if (cleaned.faces.empty()) return {};

    // Other faces than quads are cut through the middle of their edges, so that the number of steps must be even.
    const auto& counts = cleaned.cage.face_vertex_counts;
    const bool is_all_quads = std::all_of(counts.begin(), counts.end(), [](std::int32_t n) { return n == 4; });
    if (!is_all_quads && level % 2 == 1) ++level;

    RefinedMesh result;
    Refinement refinement(cleaned.cage, level);
    result.mesh = without_loose_vertices(refinement.run(result.faces));
    for (std::int32_t& face : result.faces) face = cleaned.faces[face];
    return result;
}

}  // namespace frazil
