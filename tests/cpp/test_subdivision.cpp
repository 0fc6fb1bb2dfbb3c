// Subdivision and triangulation: limit positions against Catmull-Clark's closed forms, watertight edges, areas.
#include <doctest/doctest.h>

#include <array>
#include <map>

#include "frazil/base/error.h"
#include "frazil/geometry/subdivision.h"

using namespace frazil;

namespace {

ControlMesh cube() {
    ControlMesh cage;
    for (int i = 0; i < 8; ++i) {
        cage.positions.emplace_back(i & 1 ? 1.0f : -1.0f, i & 2 ? 1.0f : -1.0f, i & 4 ? 1.0f : -1.0f);
    }
    cage.face_vertex_counts = {4, 4, 4, 4, 4, 4};
    cage.face_vertex_indices = {0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5};
    return cage;
}

// A prism over a regular polygon: n-gon caps, quad sides.
ControlMesh prism(int n) {
    ControlMesh cage;
    for (int side = 0; side < 2; ++side) {
        for (int i = 0; i < n; ++i) {
            const float angle = 2.0f * kPi * float(i) / float(n);
            cage.positions.emplace_back(std::cos(angle), std::sin(angle), side ? 1.0f : -1.0f);
        }
    }
    cage.face_vertex_counts = {n, n};
    for (int i = n; i-- > 0;) cage.face_vertex_indices.push_back(i);
    for (int i = 0; i < n; ++i) cage.face_vertex_indices.push_back(n + i);
    for (int i = 0; i < n; ++i) {
        const int j = (i + 1) % n;
        cage.face_vertex_counts.push_back(4);
        for (const int v : {i, j, n + j, n + i}) cage.face_vertex_indices.push_back(v);
    }
    return cage;
}

bool is_watertight(const Mesh& mesh) {
    std::map<std::array<int, 2>, int> balance;
    for (const V3i& t : mesh.triangles) {
        for (int i = 0; i < 3; ++i) {
            const int a = t[i], b = t[(i + 1) % 3];
            balance[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
        }
    }
    return std::all_of(balance.begin(), balance.end(), [](const auto& edge) { return edge.second == 0; });
}

double volume(const Mesh& mesh) {
    double six = 0.0;
    for (const V3i& t : mesh.triangles) {
        six += V3d(mesh.positions[t.x]).dot(V3d(mesh.positions[t.y]).cross(V3d(mesh.positions[t.z])));
    }
    return six / 6.0;
}

// Limit of a cage vertex of valence n among quads: (n² p + 4 Σ edge neighbours + Σ face neighbours) / (n (n + 5)).
V3f limit_of_cube_corner(const V3f& p) {
    V3f sum = p * 9.0f;
    for (int axis = 0; axis < 3; ++axis) {
        V3f edge = p, face = -p;
        edge[axis] *= -1.0f;
        face[axis] *= -1.0f;  // two signs flipped: the corner across a face
        sum += edge * 4.0f + face;
    }
    return sum / 24.0f;
}

bool has_vertex_near(const Mesh& mesh, const V3f& p, float tolerance) {
    return std::any_of(mesh.positions.begin(), mesh.positions.end(),
                       [&](const V3f& q) { return (p - q).length() < tolerance; });
}

}  // namespace

TEST_CASE("a cube's corners go to their Catmull-Clark limits") {
    const ControlMesh cage = cube();
    for (const int level : {1, 2, 3, 4}) {
        const RefinedMesh refined = subdivide(cage, level, "/Cube");
        CHECK(refined.mesh.triangles.size() == std::size_t(6 * 2 * level * level));
        CHECK(is_watertight(refined.mesh));
        CHECK(volume(refined.mesh) > 0.0);
        for (const V3f& p : cage.positions) CHECK(has_vertex_near(refined.mesh, limit_of_cube_corner(p), 1e-4f));
    }
}

TEST_CASE("normals of a subdivided cube point outwards, along the diagonals at its corners") {
    const RefinedMesh refined = subdivide(cube(), 4, "/Cube");
    const Mesh& mesh = refined.mesh;
    REQUIRE(mesh.normals.interpolation == Interpolation::vertex);
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
        CHECK(mesh.normals.values[i].length() == doctest::Approx(1.0f));
        CHECK(mesh.normals.values[i].dot(mesh.positions[i].normalized()) > 0.9f);
    }
    const V3f corner = limit_of_cube_corner(V3f(1.0f));
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
        if ((mesh.positions[i] - corner).length() > 1e-4f) continue;
        CHECK(mesh.normals.values[i].dot(V3f(1.0f).normalized()) == doctest::Approx(1.0f).epsilon(1e-4));
    }
}

TEST_CASE("n-gons of 3 to 20 corners give watertight meshes with outward winding") {
    for (const int n : {3, 5, 6, 8, 15, 16, 20}) {
        CAPTURE(n);
        const RefinedMesh refined = subdivide(prism(n), 2, "/Prism");
        CHECK(is_watertight(refined.mesh));
        CHECK(volume(refined.mesh) > 0.4);
        CHECK(volume(refined.mesh) < 2.0 * kPi);
        for (const std::int32_t face : refined.faces) CHECK(face < n + 2);
        // Neighbouring samples of one surface: no triangle reaches across the prism.
        for (const V3i& t : refined.mesh.triangles) {
            const auto& p = refined.mesh.positions;
            CHECK((p[t.x] - p[t.y]).length() < 1.5f);
        }
    }
}

TEST_CASE("infinite creases keep a cube") {
    ControlMesh cage = cube();
    for (const std::array<int, 2> edge :
         {std::array{0, 1}, {1, 3}, {3, 2}, {2, 0}, {4, 5}, {5, 7}, {7, 6}, {6, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}}) {
        cage.crease_indices.insert(cage.crease_indices.end(), edge.begin(), edge.end());
        cage.crease_lengths.push_back(2);
        cage.crease_sharpnesses.push_back(10.0f);
    }
    const RefinedMesh refined = subdivide(cage, 4, "/Cube");
    CHECK(volume(refined.mesh) == doctest::Approx(8.0).epsilon(1e-3));
    CHECK(surface_area(refined.mesh) == doctest::Approx(24.0).epsilon(1e-3));
    REQUIRE(refined.mesh.normals.interpolation == Interpolation::corner);
    // Every corner normal is that of its own face.
    for (std::size_t t = 0; t < refined.mesh.triangles.size(); ++t) {
        const V3f flat(triangle_cross(refined.mesh, t).normalized());
        for (int i = 0; i < 3; ++i) {
            CHECK(refined.mesh.normals.values[3 * t + i].dot(flat) == doctest::Approx(1.0f).epsilon(1e-3));
        }
    }
}

TEST_CASE("a flat grid stays flat, keeps its outline and its face-varying st") {
    ControlMesh cage;
    for (int y = 0; y < 3; ++y) {
        for (int x = 0; x < 3; ++x) cage.positions.emplace_back(float(x), float(y), 0.0f);
    }
    cage.uvs.interpolation = Interpolation::corner;
    for (int y = 0; y < 2; ++y) {
        for (int x = 0; x < 2; ++x) {
            cage.face_vertex_counts.push_back(4);
            for (const int v : {3 * y + x, 3 * y + x + 1, 3 * y + x + 4, 3 * y + x + 3}) {
                cage.face_vertex_indices.push_back(v);
                cage.uvs.values.emplace_back(cage.positions[v].x / 2.0f, cage.positions[v].y / 2.0f);
            }
        }
    }
    const RefinedMesh refined = subdivide(cage, 4, "/Grid");
    CHECK(surface_area(refined.mesh) == doctest::Approx(4.0).epsilon(1e-5));
    REQUIRE(refined.mesh.uvs.interpolation == Interpolation::corner);
    for (std::size_t t = 0; t < refined.mesh.triangles.size(); ++t) {
        for (int i = 0; i < 3; ++i) {
            const V3f p = refined.mesh.positions[refined.mesh.triangles[t][i]];
            CHECK(p.z == 0.0f);
            // Both follow the same rules along a straight boundary, so that st stays proportional to the position.
            CHECK(refined.mesh.uvs.values[3 * t + i].x == doctest::Approx(p.x / 2.0f).epsilon(1e-4));
            CHECK(refined.mesh.uvs.values[3 * t + i].y == doctest::Approx(p.y / 2.0f).epsilon(1e-4));
        }
    }
}

TEST_CASE("holes are left out but shape their neighbours") {
    ControlMesh cage = cube();
    const double whole = surface_area(subdivide(cage, 2, "/Cube").mesh);
    cage.hole_faces = {0};
    const RefinedMesh refined = subdivide(cage, 2, "/Cube");
    CHECK(surface_area(refined.mesh) == doctest::Approx(whole * 5.0 / 6.0).epsilon(1e-4));
    for (const std::int32_t face : refined.faces) CHECK(face != 0);
}

TEST_CASE("triangulate: convex and concave polygons keep their area and orientation") {
    const auto area_of = [](std::vector<V3f> outline) {
        ControlMesh cage;
        cage.face_vertex_counts = {int(outline.size())};
        for (int i = 0; i < int(outline.size()); ++i) cage.face_vertex_indices.push_back(i);
        cage.positions = std::move(outline);
        const RefinedMesh refined = triangulate(cage, "/Polygon");
        CHECK(refined.mesh.triangles.size() == cage.positions.size() - 2);
        double signed_area = 0.0;
        for (std::size_t t = 0; t < refined.mesh.triangles.size(); ++t) {
            signed_area += 0.5 * triangle_cross(refined.mesh, t).z;
            CHECK(triangle_cross(refined.mesh, t).z >= 0.0);
        }
        return signed_area;
    };
    CHECK(area_of({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}) == doctest::Approx(1.0));
    // An arrow head as a quad, either corner first.
    CHECK(area_of({{0, 0, 0}, {2, -2, 0}, {0, 2, 0}, {-2, -2, 0}}) == doctest::Approx(4.0));
    CHECK(area_of({{2, -2, 0}, {0, 2, 0}, {-2, -2, 0}, {0, 0, 0}}) == doctest::Approx(4.0));
    // A comb with teeth, and a corner in the middle of a straight edge.
    CHECK(area_of({{0, 0, 0},
                   {5, 0, 0},
                   {5, 3, 0},
                   {4, 3, 0},
                   {4, 1, 0},
                   {3, 1, 0},
                   {3, 3, 0},
                   {2, 3, 0},
                   {2, 1, 0},
                   {1, 1, 0},
                   {1, 3, 0},
                   {0, 3, 0},
                   {0, 1, 0}}) == doctest::Approx(11.0));
    // A square with a square hole, joined by a bridge.
    CHECK(area_of({{0, 0, 0},
                   {3, 0, 0},
                   {3, 3, 0},
                   {0, 3, 0},
                   {0, 0, 0},
                   {1, 1, 0},
                   {1, 2, 0},
                   {2, 2, 0},
                   {2, 1, 0},
                   {1, 1, 0}}) == doctest::Approx(8.0));
}

TEST_CASE("triangulate ends on polygons that cross themselves or have no area") {
    ControlMesh cage;
    for (int i = 0; i < 12; ++i) cage.positions.emplace_back(float(i % 3), float((i * 7) % 5), 0.0f);
    cage.face_vertex_counts = {12, 5};
    for (int i = 0; i < 12; ++i) cage.face_vertex_indices.push_back((i * 5) % 12);
    for (int i = 0; i < 5; ++i) cage.face_vertex_indices.push_back(0);
    CHECK(triangulate(cage, "/Star").mesh.triangles.size() == 13);
}

TEST_CASE("broken cages are refused with their path") {
    ControlMesh cage = cube();
    cage.face_vertex_indices[3] = 8;
    CHECK_THROWS_WITH_AS(triangulate(cage, "/Cube"),
                         "/Cube: faceVertexIndices must be in 0..7, got 8 at entry 3. The mesh has 8 points.",
                         ValueError);
    cage = cube();
    cage.face_vertex_counts.push_back(4);
    CHECK_THROWS_AS(subdivide(cage, 2, "/Cube"), ValueError);
    cage = cube();
    cage.positions[2].y = std::numeric_limits<float>::quiet_NaN();
    CHECK_THROWS_AS(subdivide(cage, 2, "/Cube"), ValueError);
    cage = cube();
    cage.crease_lengths = {3};
    CHECK_THROWS_AS(subdivide(cage, 2, "/Cube"), ValueError);
}
