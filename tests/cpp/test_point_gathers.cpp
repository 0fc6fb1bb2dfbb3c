#include <doctest/doctest.h>

#include "frazil/points/poisson.h"
#include "frazil/render/bodies.h"
#include "frazil/render/point_gathers.h"
#include "frazil/render/translucency_sets.h"
#include "relative_rms.h"
#include "scenes.h"
#include "shapes.h"

namespace frazil {
namespace {

// A ball of ice, lit from one side, with its trees and points.
struct LitBall {
    Scene scene =
        test::scene_of(test::sphere(1.0f, 4), test::ice(Rgb(0.1f, 0.3f, 1.0f), 1.31f, 0.2f, CompensationMode::depth));
    PointSet points = poisson_points(scene.meshes[0], 0.025);  // half a mean free path
    PlacedPoints placed = PlacedPoints(points);
    std::vector<std::unique_ptr<Body>> bodies;

    explicit LitBall(const Ramp& ramp = {}) {
        std::get<IceMaterial>(scene.materials[0].model).ramp = ramp;
        std::vector<LitPoints> lit(1);
        lit[0].points = placed;
        for (const V3f& n : points.normals) {
            lit[0].irradiance.push_back(Rgb(std::max(0.0f, n.x), 0.2f, n.x > 0.0f ? 1.0f : 0.0f));
        }
        bodies = make_bodies(scene);
        RenderStats stats;
        const RayScene ray_scene(scene.meshes, {Placement{}});
        plant_trees(scene, lit, 1, ray_scene, false, true, bodies, stats);
    }
};

PointGatherPlan plenty() {
    PointGatherPlan plan;
    plan.paths = 1e9;
    plan.bytes = std::size_t(1) << 30;
    plan.keeps_knots = true;
    return plan;
}

}  // namespace

TEST_CASE("point gathers: a blend comes within some thousandths of a gather at the place") {
    const LitBall ball(Ramp({0.0f, 0.1f, 0.3f}, {Rgb(1.0f), Rgb(0.5f), Rgb(2.0f)}));
    PointGatherPlan plan = plenty();
    const auto at_points = PointGathers::make(*ball.bodies[0], ball.placed.cloud(), 1, plan);
    REQUIRE(at_points);
    CHECK(plan.bytes < plenty().bytes);
    CHECK(plan.paths == plenty().paths - double(ball.points.size()));
    const PointSet places = poisson_points(ball.scene.meshes[0], 0.1, {7});
    CoreSums blended(at_points->columns());
    for (std::size_t i = 0; i < places.size(); ++i) {
        REQUIRE(at_points->append(places.positions[i], places.normals[i], blended));
    }
    GatherOptions options;
    options.ramp_layers = true;
    // Rows are of as far below as light is scattered first.
    const Body& body = *ball.bodies[0];
    CorePlaces gathers{places.positions, places.positions};
    for (std::size_t i = 0; i < places.size(); ++i) gathers.below[i] -= places.normals[i] * body.depth();
    gathers.absorbing = absorbing_below(body, places);
    const CoreSums there = gather_core(body.trees, gathers, options);
    const SumColumns& columns = there.columns();
    REQUIRE(blended.columns().count() == columns.count());
    REQUIRE((columns.has_surface && columns.has_thin && columns.knots == 3));
    const auto off_by = [&](std::size_t first, std::size_t count) {
        return test::relative_rms(test::columns(blended, first, count), test::columns(there, first, count));
    };
    for (const std::size_t tree : {std::size_t(0), columns.of_tree()}) {  // below, and on the surface
        CHECK(off_by(tree, 1) < 0.005);
        CHECK(off_by(tree + 1, 1) < 0.006);
        CHECK(off_by(tree + 2, 3) < 0.012);
    }
    // Slopes are noisier.
    CHECK(off_by(columns.thin(), 1) < 0.008);
    CHECK(off_by(columns.thin() + 1, 1) < 0.1);
}

TEST_CASE("point gathers: no rows off the surface or on its other side") {
    const LitBall ball;
    PointGatherPlan plan = plenty();
    const auto at_points = PointGathers::make(*ball.bodies[0], ball.placed.cloud(), 1, plan);
    REQUIRE(at_points);
    CoreSums rows(at_points->columns());
    CHECK_FALSE(at_points->append(V3f(0.5f, 0.0f, 0.0f), V3f(1.0f, 0.0f, 0.0f), rows));
    CHECK_FALSE(at_points->append(V3f(1.0f, 0.0f, 0.0f), V3f(-1.0f, 0.0f, 0.0f), rows));
    CHECK(rows.size() == 0);
    CHECK(at_points->append(V3f(1.0f, 0.0f, 0.0f), V3f(1.0f, 0.0f, 0.0f), rows));
    CHECK(rows.size() == 1);
}

TEST_CASE("point gathers: what the camera sees itself is gathered there, however near the points are to each other") {
    Scene scene =
        test::scene_of(test::box_of(V3f(-0.7f), V3f(0.7f)), test::ice(Rgb(0.1f), 1.31f, 0.2f, CompensationMode::depth));
    auto& ice = std::get<IceMaterial>(scene.materials[0].model);
    ice.medium.sigma_s_prime = Rgb(5.0f);
    scene.lights = {test::rect_above(5.0f, "")};
    RenderOptions options = test::small();
    const auto translucency = [&](float spacing, int samples) {
        ice.spacing.value = spacing;
        options.samples = samples;
        const RenderResult result = render(scene, options);
        CHECK(result.stats.gathers > 0);
        return test::mean_inside(result.film, "translucency", 1);
    };
    // With fewer paths than points there are no gathers at these.
    CHECK(translucency(0.045f, 64) == doctest::Approx(translucency(0.02f, 16)).epsilon(0.0005));
}

TEST_CASE("point gathers: none where paths are few, memory is short or the spacing varies") {
    const LitBall ball;
    PointGatherPlan few = plenty(), tight = plenty(), plan = plenty();
    few.paths = double(ball.points.size()) - 1.0;
    tight.bytes = 1000;
    CHECK_FALSE(PointGathers::make(*ball.bodies[0], ball.placed.cloud(), 1, few));
    CHECK_FALSE(PointGathers::make(*ball.bodies[0], ball.placed.cloud(), 1, tight));
    CHECK(tight.bytes == 1000);
    PointSet uneven = ball.points;
    uneven.spacing *= 2.0;
    CHECK_FALSE(PointGathers::make(*ball.bodies[0], PointCloud(uneven), 1, plan));
}

}  // namespace frazil
