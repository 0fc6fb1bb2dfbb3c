// Refinement and displacement: no cracks, true shape and normals, seams of st stay closed.
#include <doctest/doctest.h>

#include <cmath>
#include <map>

#include "frazil/base/error.h"
#include "frazil/geometry/refinement.h"
#include "frazil/material/displacement.h"
#include "shapes.h"

using namespace frazil;
using namespace frazil::test;

namespace {

// Undirected edges that do not belong to two triangles.
int open_edges(const Mesh& mesh) {
    std::map<std::pair<int, int>, int> counts;
    for (const V3i& t : mesh.triangles) {
        for (int k = 0; k < 3; ++k) ++counts[std::minmax(t[k], t[(k + 1) % 3])];
    }
    int open = 0;
    for (const auto& [edge, count] : counts) open += count != 2;
    return open;
}

float longest(const Mesh& mesh) {
    float result = 0.0f;
    for (const V3i& t : mesh.triangles) {
        for (int k = 0; k < 3; ++k) {
            result = std::max(result, (mesh.positions[t[k]] - mesh.positions[t[(k + 1) % 3]]).length());
        }
    }
    return result;
}

// A square of this side in z = 0 that faces +z, st over it.
Mesh square(float side) {
    Mesh mesh;
    mesh.positions = {V3f(0, 0, 0), V3f(side, 0, 0), V3f(side, side, 0), V3f(0, side, 0)};
    mesh.triangles = {V3i(0, 1, 2), V3i(0, 2, 3)};
    mesh.uvs = {{V2f(0, 0), V2f(1, 0), V2f(1, 1), V2f(0, 1)}, Interpolation::vertex};
    return mesh;
}

}  // namespace

TEST_CASE("refinement: every edge is short enough, area stays, a closed mesh stays closed") {
    const Mesh mesh = sphere(1.0f, 1);
    const CutMesh cut = cut_long_edges(mesh, 0.13f, 1000000);
    CHECK(longest(cut.mesh) <= 0.13f);
    CHECK(cut.longest_edge == doctest::Approx(longest(cut.mesh)));
    CHECK(open_edges(cut.mesh) == 0);
    CHECK(surface_area(cut.mesh) == doctest::Approx(surface_area(mesh)).epsilon(1e-5));
    std::vector<double> area(mesh.triangles.size(), 0.0);
    for (std::size_t t = 0; t < cut.parents.size(); ++t) {
        area[std::size_t(cut.parents[t])] += 0.5 * triangle_cross(cut.mesh, t).length();
    }
    for (std::size_t t = 0; t < area.size(); ++t) {
        CHECK(area[t] == doctest::Approx(0.5 * triangle_cross(mesh, t).length()).epsilon(1e-4));
    }
    CHECK(cut_long_edges(mesh, 1e-3f, 5000).mesh.triangles.size() <= 5000);
    CHECK_THROWS_WITH_AS(cut_long_edges(mesh, 0.0f, 10), doctest::Contains("edge_length must be > 0"), ValueError);
}

TEST_CASE("refinement: one edge that is too long, of one triangle or two, leaves neighbours whole") {
    Mesh mesh;
    mesh.positions = {V3f(0, 0, 0), V3f(4, 0, 0), V3f(2, 1, 0), V3f(2, -1, 0)};
    mesh.triangles = {V3i(0, 1, 2), V3i(1, 0, 3)};
    const CutMesh cut = cut_long_edges(mesh, 3.0f, 100);
    CHECK(cut.mesh.triangles.size() == 4);
    CHECK(cut.mesh.positions.size() == 5);
}

TEST_CASE("displacement: a constant height moves a sphere outwards, with its normals") {
    Displacement displacement;
    displacement.height.value = 0.25f;
    const Mesh mesh = sphere(1.0f, 4);
    const Mesh moved = displaced(mesh, eval_displacement(displacement, mesh, 1.0f));
    CHECK(open_edges(moved) == 0);
    for (std::size_t i = 0; i < moved.positions.size(); ++i) {
        CHECK(moved.positions[i].length() == doctest::Approx(1.25).epsilon(1e-5));
    }
    for (std::size_t t = 0; t < moved.triangles.size(); ++t) {
        for (int k = 0; k < 3; ++k) {
            const V3f out = moved.positions[moved.triangles[t][k]].normalized();
            CHECK(moved.normals.values[3 * t + std::size_t(k)].dot(out) > 0.999f);
        }
    }
}

TEST_CASE("displacement: the area and the normals of a wave are those of its formula") {
    // z = a sin(2 pi s) over a square of side 2; st = position / 2.
    constexpr float kSide = 2.0f, kHeight = 0.1f;
    constexpr int kTexels = 256;
    std::vector<float> texels;
    for (int x = 0; x < kTexels; ++x) texels.push_back(std::sin(2.0f * kPi * (float(x) + 0.5f) / kTexels));
    Displacement displacement;
    displacement.height.lookup.texture = make_texture(kTexels, 1, 1, texels);
    displacement.height.lookup.scale = V3f(kHeight);
    const Mesh fine = cut_long_edges(square(kSide), 0.04f, 100000).mesh;
    const Mesh wave = displaced(fine, eval_displacement(displacement, fine, 1.0f));
    double length = 0.0;
    for (int i = 0; i < 10000; ++i) {
        const double slope = kHeight * 2.0 * M_PI / kSide * std::cos(2.0 * M_PI * (i + 0.5) / 10000);
        length += std::sqrt(1.0 + slope * slope) * kSide / 10000;
    }
    CHECK(surface_area(wave) == doctest::Approx(length * kSide).epsilon(2e-3));
    int inside = 0;
    for (std::size_t t = 0; t < wave.triangles.size(); ++t) {
        for (int k = 0; k < 3; ++k) {
            const V3f& p = wave.positions[wave.triangles[t][k]];
            if (p.x < 0.1f || p.x > 1.9f) continue;  // half of the faces are missing at the rim
            const float slope = kHeight * 2.0f * kPi / kSide * std::cos(2.0f * kPi * p.x / kSide);
            const V3f expected = V3f(-slope, 0.0f, 1.0f).normalized();
            CHECK(wave.normals.values[3 * t + std::size_t(k)].dot(expected) > 0.9995f);
            ++inside;
        }
    }
    CHECK(inside > 1000);
}

TEST_CASE("displacement: vectors in the frame of st, mirrored too, and in the mesh's own") {
    Displacement displacement;
    displacement.vector = MaterialInput<Rgb>{Rgb(0.1f, 0.2f, 0.3f), {}};
    Mesh mesh = square(1.0f);
    CHECK((eval_displacement(displacement, mesh, 1.0f)[0] - V3f(0.1f, 0.2f, 0.3f)).length() < 1e-6f);
    for (V2f& st : mesh.uvs.values) st.x = -st.x;
    CHECK((eval_displacement(displacement, mesh, 1.0f)[0] - V3f(-0.1f, 0.2f, 0.3f)).length() < 1e-6f);
    for (V3f& p : mesh.positions) p = V3f(p.z, p.x, p.y);  // faces +x, s along +y
    for (V2f& st : mesh.uvs.values) st.x = -st.x;
    CHECK((eval_displacement(displacement, mesh, 1.0f)[0] - V3f(0.3f, 0.1f, 0.2f)).length() < 1e-6f);
    displacement.space = VectorSpace::object;
    CHECK((eval_displacement(displacement, mesh, 1.0f)[0] - V3f(0.1f, 0.2f, 0.3f)).length() < 1e-6f);
}

TEST_CASE("displacement: seams of st do not open, hard edges stay hard") {
    // A cube whose corners are shared, with st per face that meet nowhere.
    Mesh cube;
    for (int i = 0; i < 8; ++i) cube.positions.emplace_back(float(i & 1), float(i >> 1 & 1), float(i >> 2));
    const int faces[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    cube.uvs.interpolation = cube.normals.interpolation = Interpolation::corner;
    int number = 0;
    for (const auto& f : faces) {
        cube.triangles.emplace_back(f[0], f[1], f[2]);
        cube.triangles.emplace_back(f[0], f[2], f[3]);
        const V2f st[4] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
        for (const int k : {0, 1, 2, 0, 2, 3}) cube.uvs.values.push_back(st[k] + V2f(0.37f * float(number), 0.0f));
        const V3f normal = V3f(triangle_cross(cube, cube.triangles.size() - 1).normalized());
        cube.normals.values.insert(cube.normals.values.end(), 6, normal);
        ++number;
    }
    std::vector<float> texels;
    for (int i = 0; i < 32 * 32; ++i) texels.push_back(float((i * 7919) % 101) / 101.0f);
    Displacement displacement;
    displacement.height.lookup.texture = make_texture(32, 32, 1, texels);
    displacement.height.lookup.scale = V3f(0.05f);
    const Mesh fine = cut_long_edges(cube, 0.1f, 100000).mesh;
    const Mesh moved = displaced(fine, eval_displacement(displacement, fine, 1.0f));
    CHECK(open_edges(moved) == 0);
    // Without height the normals are the cube's again.
    displacement.height = {0.0f, {}};
    const Mesh flat = displaced(fine, eval_displacement(displacement, fine, 1.0f));
    for (std::size_t i = 0; i < flat.normals.values.size(); ++i) {
        CHECK((flat.normals.values[i] - fine.normals.values[i]).length() < 1e-5f);
    }
    CHECK_THROWS_WITH_AS(displaced(fine, {}), doctest::Contains("offsets must be 3 per triangle"), ValueError);
}

TEST_CASE("displacement: a pattern is read in metres, whatever the mesh's unit") {
    Displacement displacement;
    displacement.height.value = 1.0f;
    displacement.pattern = Pattern{};
    displacement.pattern->kind = PatternKind::cells;
    displacement.pattern->size = 0.4f;
    displacement.pattern->width = 0.05f;
    const Mesh in_metres = cut_long_edges(square(1.0f), 0.05f, 100000).mesh;
    Mesh in_centimetres = in_metres;
    for (V3f& p : in_centimetres.positions) p *= 100.0f;
    const auto a = eval_displacement(displacement, in_metres, 1.0f);
    const auto b = eval_displacement(displacement, in_centimetres, 0.01f);
    float highest = 0.0f;
    for (std::size_t i = 0; i < a.size(); ++i) {
        CHECK((a[i] - b[i]).length() < 2e-3f);
        highest = std::max(highest, a[i].z);
    }
    CHECK(highest > 0.5f);
}
