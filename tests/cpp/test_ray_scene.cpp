#include <doctest/doctest.h>

#include <cmath>

#include "frazil/base/sampler.h"
#include "frazil/base/trigonometry.h"
#include "frazil/geometry/ray_scene.h"

using namespace frazil;

namespace {

// A unit square in z = 0 that faces +z.
Mesh square() {
    Mesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    return mesh;
}

M44f moved(float x, float y, float z) {
    M44f m;
    m.translate(V3f(x, y, z));
    return m;
}

const V3f kDown(0.0f, 0.0f, -1.0f);

}  // namespace

TEST_CASE("a mesh placed once and one placed often give the same hits") {
    M44f squeezed = moved(2, 0, 0);
    squeezed[0][0] = 0.5f;
    const std::vector<Mesh> meshes = {square()};
    const RayScene single(meshes, {{0, squeezed}});
    const RayScene often(meshes, {{0, moved(-5, 0, 0)}, {0, squeezed}});
    const Ray ray{V3f(2.1f, 0.7f, 3.0f), kDown};
    Hit a, b;
    REQUIRE(single.intersect(ray, a));
    REQUIRE(often.intersect(ray, b));
    CHECK(a.t == doctest::Approx(3.0));
    CHECK(b.t == doctest::Approx(3.0));
    CHECK(b.placement == 1);
    CHECK(a.triangle == b.triangle);
    CHECK(a.uv.x == doctest::Approx(b.uv.x));
    CHECK(b.geometric_normal.z == doctest::Approx(1.0));
}

TEST_CASE("a mirrored placement keeps its outside, baked or instanced") {
    M44f mirrored;
    mirrored[0][0] = -1.0f;
    const std::vector<Mesh> meshes = {square()};
    for (const auto& placements : {std::vector<Placement>{{0, mirrored}}, {{0, mirrored}, {0, moved(9, 0, 0)}}}) {
        Hit hit;
        REQUIRE(RayScene(meshes, placements).intersect({V3f(-0.2f, 0.3f, 1.0f), kDown}, hit));
        CHECK(hit.geometric_normal.z == doctest::Approx(1.0));
    }
}

TEST_CASE("occlusion respects the end of the ray, and an empty scene occludes nothing") {
    const std::vector<Mesh> meshes = {square()};
    const RayScene scene(meshes, {{0, M44f()}});
    CHECK(scene.is_occluded({V3f(0.5f, 0.4f, 1.0f), kDown, 0.0f, 2.0f}));
    CHECK_FALSE(scene.is_occluded({V3f(0.5f, 0.4f, 1.0f), kDown, 0.0f, 0.5f}));
    CHECK_FALSE(RayScene({}, {}).is_occluded({V3f(0.5f, 0.4f, 1.0f), kDown}));
}

TEST_CASE("many rays at once see what each sees alone, in any directions and any number") {
    const std::vector<Mesh> meshes = {square()};
    M44f mirrored = moved(-1, 0, 0.5f);
    mirrored[0][0] = -1.0f;
    const RayScene scene(meshes, {{0, M44f()}, {0, mirrored}, {0, moved(0.5f, 0.5f, 1.0f)}});
    Sampler random(1, 2, 3);
    for (const std::size_t count : {0U, 1U, 7U, 8U, 1000U}) {
        std::vector<Ray> rays;
        for (std::size_t i = 0; i < count; ++i) {
            const V2f u = random.next_2d(), v = random.next_2d();
            const V3f local = cosine_hemisphere(v);
            rays.push_back({V3f(4.0f * u.x - 2.0f, 2.0f * u.y - 0.5f, 0.25f), {local.x, local.y, local.z}});
            if (i % 2) rays.back().direction.z *= -1.0f;
            if (i % 3 == 0) rays.back().t_max = 0.5f;
        }
        std::vector<Hit> hits(count);
        std::vector<std::uint8_t> is_occluded(count);
        scene.intersect(rays, hits);
        scene.are_occluded(rays, is_occluded);
        std::size_t met = 0;
        for (std::size_t i = 0; i < count; ++i) {
            Hit alone;
            const bool is_hit = scene.intersect(rays[i], alone);
            REQUIRE(is_hit == std::isfinite(hits[i].t));
            REQUIRE(is_hit == bool(is_occluded[i]));
            met += is_hit;
            if (!is_hit) continue;
            CHECK(hits[i].t == doctest::Approx(alone.t));
            CHECK(hits[i].placement == alone.placement);
            CHECK(hits[i].triangle == alone.triangle);
            CHECK((hits[i].uv - alone.uv).length() < 1e-5f);
            CHECK((hits[i].geometric_normal - alone.geometric_normal).length() < 1e-6f);
        }
        if (count == 1000) CHECK((met > 100 && met < 900));
    }
}

TEST_CASE("an offset origin does not meet its own surface, near the origin or far from it") {
    for (const float far : {0.0f, 1.0f, 1e5f}) {
        const std::vector<Mesh> meshes = {square()};
        const RayScene scene(meshes, {{0, moved(0, 0, far)}});
        Hit hit;
        REQUIRE(scene.intersect({V3f(0.4f, 0.3f, far + 1.0f), kDown}, hit));
        const V3f origin = offset_origin(V3f(0.4f, 0.3f, far), hit.geometric_normal);
        CHECK(origin.z > far);
        CHECK_FALSE(scene.is_occluded({origin, V3f(0.99f, 0.0f, 0.141f).normalized()}));
    }
}
