#include "frazil/geometry/refinement.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include "frazil/base/error.h"

namespace frazil {
namespace {

constexpr float kSmoothCosine = 0.866f;      // of a faceted mesh: neighbours that were one surface
constexpr float kSameNormalCosine = 0.999f;  // corners of one vertex that shared a normal

std::uint64_t edge_key(std::int32_t a, std::int32_t b) {
    return std::uint64_t(std::uint32_t(std::min(a, b))) << 32 | std::uint32_t(std::max(a, b));
}

// Where a vertex is as cuts see it: in the rest pose, where there is one, so that all poses are cut alike.
const V3f& place(const Mesh& mesh, std::int32_t vertex) {
    return mesh.rest.empty() ? mesh.positions[vertex] : mesh.rest[vertex];
}

// One round of cuts; false where nothing was too long.
class Round {
  public:
    Round(const CutMesh& from, float edge_length) : from_(from), length2_(edge_length * edge_length) {}

    std::size_t mark() {
        const Mesh& mesh = from_.mesh;
        vertex_count_ = mesh.positions.size();
        std::size_t triangles = mesh.triangles.size();
        for (const V3i& t : mesh.triangles) {
            for (int k = 0; k < 3; ++k) {
                const std::int32_t a = t[k], b = t[(k + 1) % 3];
                if ((place(mesh, a) - place(mesh, b)).length2() <= length2_) continue;
                ++triangles;  // every cut edge of a triangle makes one more of it
                const auto [at, is_new] = middles_.try_emplace(edge_key(a, b), std::int32_t(vertex_count_));
                if (is_new) ++vertex_count_;
            }
        }
        return triangles;
    }
    bool has_marks() const { return !middles_.empty(); }

    CutMesh cut() {
        const Mesh& old = from_.mesh;
        CutMesh result;
        Mesh& mesh = result.mesh;
        mesh.positions = old.positions;
        mesh.positions.resize(vertex_count_);
        mesh.normals.interpolation = old.normals.interpolation;
        mesh.uvs.interpolation = old.uvs.interpolation;
        mesh.colors.interpolation = old.colors.interpolation;
        grow(old.normals, mesh.normals);
        grow(old.uvs, mesh.uvs);
        grow(old.colors, mesh.colors);
        mesh.rest = old.rest, mesh.spacing = old.spacing;
        if (!mesh.rest.empty()) mesh.rest.resize(vertex_count_);
        if (!mesh.spacing.empty()) mesh.spacing.resize(vertex_count_);
        for (const auto& [key, middle] : middles_) {
            const auto a = std::int32_t(key >> 32), b = std::int32_t(key & 0xffffffffU);
            mesh.positions[middle] = (old.positions[a] + old.positions[b]) * 0.5f;
            if (!mesh.rest.empty()) mesh.rest[middle] = (mesh.rest[a] + mesh.rest[b]) * 0.5f;
            if (!mesh.spacing.empty()) mesh.spacing[middle] = (mesh.spacing[a] + mesh.spacing[b]) * 0.5f;
            halve(mesh.normals, a, b, middle);
            halve(mesh.uvs, a, b, middle);
            halve(mesh.colors, a, b, middle);
        }
        for (std::size_t t = 0; t < old.triangles.size(); ++t) cut_triangle(t, result);
        if (mesh.normals.interpolation == Interpolation::vertex) {
            for (V3f& n : mesh.normals.values) n.normalize();
        }
        return result;
    }

  private:
    template <class T>
    void grow(const Primvar<T>& old, Primvar<T>& primvar) const {
        if (old.is_empty()) return;
        if (old.interpolation == Interpolation::constant) primvar.values = old.values;
        if (old.interpolation == Interpolation::vertex) {
            primvar.values = old.values;
            primvar.values.resize(vertex_count_);
        }
    }
    template <class T>
    void halve(Primvar<T>& primvar, std::int32_t a, std::int32_t b, std::int32_t middle) const {
        if (primvar.is_empty() || primvar.interpolation != Interpolation::vertex) return;
        primvar.values[middle] = (primvar.values[a] + primvar.values[b]) * 0.5f;
    }
    template <class T>
    void add_corners(const Primvar<T>& old, Primvar<T>& primvar, std::size_t triangle, const int corners[3]) const {
        if (old.is_empty()) return;
        if (old.interpolation == Interpolation::uniform) primvar.values.push_back(old.values[triangle]);
        if (old.interpolation != Interpolation::corner) return;
        const T* values = &old.values[3 * triangle];
        for (int k = 0; k < 3; ++k) {
            // 0..2 are corners, 3..5 the middles of the edges that leave them.
            const int c = corners[k];
            primvar.values.push_back(c < 3 ? values[c] : (values[c - 3] + values[(c - 2) % 3]) * 0.5f);
        }
    }

    void cut_triangle(std::size_t triangle, CutMesh& result) const {
        const V3i& t = from_.mesh.triangles[triangle];
        std::int32_t vertices[6] = {t.x, t.y, t.z, -1, -1, -1};
        int cuts = 0;
        for (int k = 0; k < 3; ++k) {
            const auto found = middles_.find(edge_key(t[k], t[(k + 1) % 3]));
            if (found != middles_.end()) vertices[3 + k] = found->second, ++cuts;
        }
        const auto add = [&](int a, int b, int c) {
            const int corners[3] = {a, b, c};
            result.mesh.triangles.emplace_back(vertices[a], vertices[b], vertices[c]);
            result.parents.push_back(from_.parents[triangle]);
            add_corners(from_.mesh.normals, result.mesh.normals, triangle, corners);
            add_corners(from_.mesh.uvs, result.mesh.uvs, triangle, corners);
            add_corners(from_.mesh.colors, result.mesh.colors, triangle, corners);
        };
        if (cuts == 0) return add(0, 1, 2);
        if (cuts == 3) {
            add(0, 3, 5), add(3, 1, 4), add(5, 4, 2), add(3, 4, 5);
            return;
        }
        if (cuts == 1) {
            const int e = vertices[3] >= 0 ? 0 : vertices[4] >= 0 ? 1 : 2;  // from corner e to e + 1
            add(e, 3 + e, (e + 2) % 3), add(3 + e, (e + 1) % 3, (e + 2) % 3);
            return;
        }
        // Two cuts: the corner between them, and a quad that is cut along its shorter diagonal.
        const int whole = vertices[3] < 0 ? 0 : vertices[4] < 0 ? 1 : 2;  // the edge without a cut
        const int a = whole, b = (whole + 1) % 3, c = (whole + 2) % 3;
        const int bc = 3 + b, ca = 3 + c;
        add(c, ca, bc);
        const float to_bc = (place(result.mesh, vertices[a]) - place(result.mesh, vertices[bc])).length2();
        const float to_ca = (place(result.mesh, vertices[b]) - place(result.mesh, vertices[ca])).length2();
        if (to_bc <= to_ca) {
            add(a, b, bc), add(a, bc, ca);
        } else {
            add(a, b, ca), add(b, bc, ca);
        }
    }

    const CutMesh& from_;
    float length2_;
    std::unordered_map<std::uint64_t, std::int32_t> middles_;
    std::size_t vertex_count_ = 0;
};

float longest_edge(const Mesh& mesh) {
    float longest2 = 0.0f;
    for (const V3i& t : mesh.triangles) {
        for (int k = 0; k < 3; ++k) {
            longest2 = std::max(longest2, (place(mesh, t[k]) - place(mesh, t[(k + 1) % 3])).length2());
        }
    }
    return std::sqrt(longest2);
}

}  // namespace

CutMesh cut_long_edges(const Mesh& mesh, float edge_length, std::size_t most_triangles) {
    if (!(edge_length > 0.0f)) {
        throw ValueError(str("cut_long_edges: edge_length must be > 0, got ", edge_length, ". Give a length."));
    }
    CutMesh result{mesh, std::vector<std::int32_t>(mesh.triangles.size()), 0.0f};
    std::iota(result.parents.begin(), result.parents.end(), 0);
    for (int round = 0; round < 24; ++round) {
        Round next(result, edge_length);
        const std::size_t triangles = next.mark();
        if (!next.has_marks() || triangles > most_triangles) break;
        result = next.cut();
    }
    result.longest_edge = longest_edge(result.mesh);
    return result;
}

Mesh displaced(const Mesh& mesh, const std::vector<V3f>& offsets) {
    const std::size_t corners = 3 * mesh.triangles.size();
    if (offsets.size() != corners) {
        throw ValueError(str("displaced: offsets must be 3 per triangle, ", corners, ", got ", offsets.size(), "."));
    }
    const auto vertex_of = [&](std::size_t corner) { return mesh.triangles[corner / 3][int(corner % 3)]; };
    std::vector<V3f> sums(mesh.positions.size(), V3f(0.0f));
    std::vector<int> counts(mesh.positions.size(), 0);
    // Triangles without area have a say only where there are no others.
    for (const bool has_area : {true, false}) {
        const std::vector<int> before = counts;
        for (std::size_t i = 0; i < corners; ++i) {
            if (!is_finite(offsets[i])) {
                throw ValueError(
                    str("displaced: offsets must be finite, got ", offsets[i].x, " at triangle ", i / 3, "."));
            }
            if ((triangle_cross(mesh, i / 3).length2() > 0.0) != has_area || before[vertex_of(i)] > 0) continue;
            sums[vertex_of(i)] += offsets[i];
            ++counts[vertex_of(i)];
        }
    }
    Mesh result = mesh;
    for (std::size_t v = 0; v < sums.size(); ++v) {
        if (counts[v] > 0) result.positions[v] += sums[v] / float(counts[v]);
    }

    if (corners == 0) return result;

    // The corners at each vertex, and which of them were one surface before.
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < corners; ++i) order.push_back(i);
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return vertex_of(a) < vertex_of(b); });
    const bool is_faceted = mesh.normals.is_empty();
    std::vector<V3f> before(corners), faces(mesh.triangles.size());
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        faces[t] = V3f(triangle_cross(result, t));  // weighted by area
        const V3f flat = is_faceted ? V3f(triangle_cross(mesh, t).normalized()) : V3f(0.0f);
        for (int k = 0; k < 3; ++k) {
            const V2f corner(k == 1 ? 1.0f : 0.0f, k == 2 ? 1.0f : 0.0f);
            before[3 * t + std::size_t(k)] =
                is_faceted ? flat : mesh.normals.at(mesh.triangles, std::uint32_t(t), corner);
        }
    }
    const float same = is_faceted ? kSmoothCosine : kSameNormalCosine;
    result.normals.interpolation = Interpolation::corner;
    result.normals.values.assign(corners, V3f(0.0f));
    for (std::size_t begin = 0, end = 0; begin < order.size(); begin = end) {
        while (end < order.size() && vertex_of(order[end]) == vertex_of(order[begin])) ++end;
        for (std::size_t i = begin; i < end; ++i) {
            V3f sum(0.0f);
            for (std::size_t j = begin; j < end; ++j) {
                if (before[order[i]].dot(before[order[j]]) >= same) sum += faces[order[j] / 3];
            }
            if (!(sum.length2() > 0.0f)) sum = faces[order[i] / 3];
            result.normals.values[order[i]] = sum.length2() > 0.0f ? sum.normalized() : before[order[i]];
        }
    }
    return result;
}

}  // namespace frazil
