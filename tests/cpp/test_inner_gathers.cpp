#include <doctest/doctest.h>

#include "frazil/base/random.h"
#include "frazil/points/poisson.h"
#include "frazil/render/bodies.h"
#include "frazil/render/inner_gathers.h"
#include "frazil/render/translucency_sets.h"
#include "relative_rms.h"
#include "scenes.h"
#include "shapes.h"

namespace frazil {
namespace {

// A ball of ice, lit from one side by two groups.
struct LitBall {
    Scene scene =
        test::scene_of(test::sphere(1.0f, 4), test::ice(Rgb(0.1f, 0.3f, 1.0f), 1.31f, 0.2f, CompensationMode::depth));
    std::vector<std::unique_ptr<Body>> bodies;
    GatherOptions options;

    explicit LitBall(const Ramp& ramp = {}) {
        std::get<IceMaterial>(scene.materials[0].model).ramp = ramp;
        options.ramp_layers = !ramp.is_empty();
        std::vector<LitPoints> lit(1);
        lit[0].points = PlacedPoints(poisson_points(scene.meshes[0], 0.025));  // half a mean free path
        const PointSet points = lit[0].points.in_world();
        for (const V3f& n : points.normals) {
            lit[0].irradiance.push_back(Rgb(std::max(0.0f, n.x), 0.2f, n.x > 0.0f ? 1.0f : 0.0f));
            lit[0].irradiance.push_back(Rgb(std::max(0.0f, -n.y)));
        }
        bodies = make_bodies(scene);
        RenderStats stats;
        const RayScene ray_scene(scene.meshes, {Placement{}});
        plant_trees(scene, lit, 2, ray_scene, false, true, bodies, stats);
    }
};

// From just below the surface to some mean free paths deep, on all sides.
std::vector<V3f> places_inside() {
    std::vector<V3f> places;
    for (std::uint32_t i = 0; places.size() < 400; ++i) {
        const auto coordinate = [&](std::uint32_t axis) { return 2.0f * to_unit_float(hash(i, axis)) - 1.0f; };
        const V3f place(coordinate(0), coordinate(1), coordinate(2));
        if (place.length() > 0.75f && place.length() < 0.999f) places.push_back(place);
    }
    return places;
}

CoreSums interpolated(const InnerGathers& inside, const std::vector<V3f>& places) {
    CoreSums rows(inside.columns());
    for (const V3f& place : places) inside.append(place, rows);
    return rows;
}

}  // namespace

TEST_CASE("inner gathers: between the nodes as right there, within a percent") {
    const LitBall ball(Ramp({0.0f, 0.1f, 0.3f}, {Rgb(1.0f), Rgb(0.5f), Rgb(2.0f)}));
    const InnerGathers inside(*ball.bodies[0], 2, ball.options);
    const std::vector<V3f> places = places_inside();
    const CoreSums rows = interpolated(inside, places);
    const CoreSums there = gather_core(ball.bodies[0]->trees, {places, places}, ball.options);
    const SumColumns& columns = there.columns();
    REQUIRE(rows.columns().count() == columns.count());
    REQUIRE((columns.has_surface && columns.has_thin && columns.groups == 2 && columns.knots == 3));
    const auto off_by = [&](std::size_t first, std::size_t count) {
        return test::relative_rms(test::columns(rows, first, count), test::columns(there, first, count));
    };
    for (const std::size_t tree :
         {std::size_t(0), columns.of_tree()}) {  // where light is scattered first, and on the surface
        CHECK(off_by(tree, 1) < 0.01);
        CHECK(off_by(tree + 1, 2) < 0.01);
        CHECK(off_by(tree + 3, 6) < 0.02);
        Rgb sum(0.0f), sum_there(0.0f);
        for (const Rgb& e : test::columns(rows, tree + 1, 2)) sum += e;
        for (const Rgb& e : test::columns(there, tree + 1, 2)) sum_there += e;
        for (int c = 0; c < 3; ++c) CHECK(sum[c] == doctest::Approx(sum_there[c]).epsilon(0.003));
    }
    CHECK(off_by(columns.thin(), 1) < 0.001);
}

TEST_CASE("inner gathers: a place's row does not depend on what was asked before") {
    const LitBall ball;
    const std::vector<V3f> places = places_inside();
    const InnerGathers inside(*ball.bodies[0], 2, ball.options), again(*ball.bodies[0], 2, ball.options);
    const CoreSums rows = interpolated(inside, places);
    const CoreSums reversed = interpolated(again, {places.rbegin(), places.rend()});
    for (std::size_t i = 0; i < places.size(); ++i) {
        for (std::size_t k = 0; k < rows.columns().count(); ++k) {
            CHECK(rows.row(i)[k] == reversed.row(places.size() - 1 - i)[k]);
        }
    }
}

}  // namespace frazil
