// The curved half of subdivision.h: Catmull-Clark limit surfaces. Flat polygons are in triangulation.cpp.
#include <numeric>
#include <tuple>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/geometry/clean_cage.h"
#include "frazil/geometry/limit_surface.h"

namespace frazil {
namespace {

constexpr float kCreaseMargin = 0.02f;  // of a patch, for normals beside creases
constexpr float kSameSurface = 0.97f;   // cosine between normals of one vertex that are still one surface

V2f corner_coordinates(int corner, int count) {
    if (count != 4) return LimitSurface::in_sub_quad(corner, 0.0f, 0.0f);
    return LimitSurface::in_quad(corner == 1 || corner == 2 ? 1.0f : 0.0f, corner >= 2 ? 1.0f : 0.0f);
}

// The cage with its vertices on the limit surface and limit normals: level 1.
ControlMesh pushed_to_limit(const ControlMesh& cage) {
    ControlMesh result = cage;
    const LimitSurface surface(cage, false);
    // The corners at every vertex, sorted by vertex.
    struct Corner {
        std::int32_t vertex, face, corner;
    };
    std::vector<Corner> corners;
    corners.reserve(cage.face_vertex_indices.size());
    for (std::size_t face = 0; face < cage.face_vertex_counts.size(); ++face) {
        for (std::int32_t i = 0; i < cage.face_vertex_counts[face]; ++i) {
            corners.push_back({cage.face_vertex_indices[corners.size()], std::int32_t(face), i});
        }
    }
    std::stable_sort(corners.begin(), corners.end(),
                     [](const Corner& a, const Corner& b) { return a.vertex < b.vertex; });
    std::vector<std::size_t> first(cage.positions.size() + 1, 0);
    for (const Corner& corner : corners) ++first[corner.vertex + 1];
    std::inclusive_scan(first.begin(), first.end(), first.begin());

    std::vector<V3f> normals(cage.positions.size(), V3f(0.0f));
    parallel_for(cage.positions.size(), 512, [&](std::size_t begin, std::size_t end) {
        for (std::size_t vertex = begin; vertex < end; ++vertex) {
            // All faces agree at a regular vertex; elsewhere the mean is what their approximations have in common.
            const std::size_t valence = first[vertex + 1] - first[vertex];
            const std::size_t stop = first[vertex] + (valence == 4 ? 1 : valence);
            for (std::size_t i = first[vertex]; i < stop; ++i) {
                const Corner& c = corners[i];
                V3f normal;
                surface.eval(std::uint32_t(c.face), corner_coordinates(c.corner, cage.face_vertex_counts[c.face]),
                             result.positions[vertex], normal);
                normals[vertex] += normal;
            }
        }
    });
    throw_if_embree_failed("evaluating a subdivision surface");
    const bool is_smooth = std::all_of(normals.begin(), normals.end(), [](const V3f& n) { return n.length() > 1e-3f; });
    const bool has_creases = !cage.crease_lengths.empty() || !cage.corner_indices.empty();
    // Creases, folds and loose vertices have no one normal: such a dense cage stays faceted.
    if (is_smooth && !has_creases) {
        for (V3f& normal : normals) normal.normalize();
        result.normals = {std::move(normals), Interpolation::vertex};
    } else {
        result.normals = {};
    }
    return result;
}

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

    // Embree's coordinates of a sample, at least `margin` inside the patch.
    V2f coordinates(int i, int j, float margin = 0.0f) const {
        const float u = std::clamp(float(i) / float(steps), margin, 1.0f - margin);
        const float v = std::clamp(float(j) / float(steps), margin, 1.0f - margin);
        return sub < 0 ? LimitSurface::in_quad(u, v) : LimitSurface::in_sub_quad(sub, u, v);
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
            for_samples(patches_[p],
                        [&](std::size_t sample, std::size_t vertex) { mesh.positions[vertex] = positions_[sample]; });
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
                    if (j == 0)
                        vertex = edge_vertex(patch.face, 0, i);
                    else if (i == s)
                        vertex = edge_vertex(patch.face, 1, j);
                    else if (j == s)
                        vertex = edge_vertex(patch.face, 2, s - i);
                    else if (i == 0)
                        vertex = edge_vertex(patch.face, 3, s - j);
                    else
                        vertex = first + (j - 1) * (s - 1) + i - 1;
                    continue;
                }
                const int before = (patch.sub + count - 1) % count;
                if (j == 0)
                    vertex = edge_vertex(patch.face, patch.sub, i);
                else if (i == 0)
                    vertex = edge_vertex(patch.face, before, level_ - j);
                else if (i == s)
                    vertex = spoke(patch.sub, j);
                else if (j == s)
                    vertex = spoke(before, i);
                else
                    vertex = first + 1 + count * (s - 1) + (patch.sub * (s - 1) + j - 1) * (s - 1) + i - 1;
            }
        }
    }

    void sample() {
        const bool has_smooth_uvs = !cage_.uvs.is_empty() && (cage_.uvs.interpolation == Interpolation::vertex ||
                                                              cage_.uvs.interpolation == Interpolation::corner);
        const LimitSurface surface(cage_, has_smooth_uvs);
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
                    samples[patch.sample(i, j)] =
                        (corners[0] * (1 - u) + corners[1] * u) * (1 - v) + (corners[3] * (1 - u) + corners[2] * u) * v;
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

}  // namespace

RefinedMesh subdivide(const ControlMesh& cage, int level, const std::string& path) {
    if (level < 1) throw ValueError(str(path, ": the subdivision level must be >= 1, got ", level, "."));
    check_control_mesh(cage, path);
    check_creases(cage, path);
    const CleanCage cleaned = clean_cage(cage, path);
    if (cleaned.faces.empty()) return {};

    RefinedMesh result;
    if (level == 1) {
        result = triangulate(pushed_to_limit(cleaned.cage), path);
        result.mesh = without_loose_vertices(result.mesh);
    } else {
        // Other faces than quads are cut through the middle of their edges, so that the number of steps must be even.
        const auto& counts = cleaned.cage.face_vertex_counts;
        const bool is_all_quads = std::all_of(counts.begin(), counts.end(), [](std::int32_t n) { return n == 4; });
        if (!is_all_quads && level % 2 == 1) ++level;
        Refinement refinement(cleaned.cage, level);
        result.mesh = without_loose_vertices(refinement.run(result.faces));
    }
    for (std::int32_t& face : result.faces) face = cleaned.faces[face];
    return result;
}

}  // namespace frazil
