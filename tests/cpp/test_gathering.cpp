#include <doctest/doctest.h>

#include "frazil/base/random.h"
#include "frazil/points/poisson.h"
#include "frazil/render/gathering.h"
#include "frazil/render/overlay_layers.h"
#include "relative_rms.h"
#include "scenes.h"
#include "shapes.h"

namespace frazil {
namespace {

constexpr std::size_t kPixels = 300;

// A ball of ice with a ramp and an overlay, lit from one side by one of two groups, of which every layer is asked for.
struct LayeredBall {
    static constexpr const char* kAovs[] = {"translucency_ramp",   "overlay",
                                            "compensation_factor", "compensation_off",
                                            "compensation_ratio",  "compensation_conserve",
                                            "compensation_depth",  "compensation_fill",
                                            "compensation_linear"};
    Scene scene =
        test::scene_of(test::sphere(1.0f, 4), test::ice(Rgb(0.1f, 0.3f, 1.0f), 1.31f, 0.2f, CompensationMode::depth));
    std::vector<std::unique_ptr<Body>> bodies;
    FilmLayout layout;

    LayeredBall(float spacing_in_mean_free_paths, float strength, bool has_gathers) {
        auto& ice = std::get<IceMaterial>(scene.materials[0].model);
        ice.medium.sigma_s_prime = Rgb(5.0f);
        ice.ramp = Ramp({0.0f, 0.35f, 1.0f}, {Rgb(1.0f), Rgb(0.5f), Rgb(2.0f)});
        ice.compensation.strength = strength;
        Overlay frost;
        frost.opacity = 0.4f;
        ice.overlays = {frost};
        scene.lights = {test::dome(Rgb(0.2f), "sky"), test::rect_above(1.0f, "key")};
        bodies = make_bodies(scene);
        std::vector<LitPoints> lit(1);
        const float spacing = spacing_in_mean_free_paths * bodies[0]->mean_free_path();
        lit[0].points = PlacedPoints(poisson_points(scene.meshes[0], spacing));
        const PointSet points = lit[0].points.in_world();
        for (const V3f& n : points.normals) {
            lit[0].irradiance.push_back(Rgb(std::max(0.0f, n.x), 0.2f, n.x > 0.0f ? 1.0f : 0.0f));
            lit[0].irradiance.push_back(Rgb(std::max(0.0f, -n.y)));
        }
        const std::vector<std::string> aovs(std::begin(kAovs), std::end(kAovs));
        layout = make_layout(scene, bodies, aovs, {});
        RenderStats stats;
        const RayScene ray_scene(scene.meshes, {Placement{}});
        const TranslucencySets sets =
            plant_trees(scene, lit, 2, ray_scene, layout.needs_depth(), layout.needs_surface(), bodies, stats);
        plant_overlay_trees(scene, lit, sets, layout.overlay_of, 2, bodies);
        PointGatherPlan plan;
        plan.paths = has_gathers ? 1e9 : 0.0;
        plan.bytes = std::size_t(1) << 30;
        plan.keeps_knots = true;
        add_gathers(sets, 2, plan, bodies, stats);
        REQUIRE((bodies[0]->at_points != nullptr) == has_gathers);
    }

    // All layers of places that the camera sees, or of places on the surface and inside that paths meet, one a pixel. Knots
    // of the ramp, which sum to the light, make one.
    std::vector<std::vector<Rgb>> layers(bool sees_itself, std::uint64_t& gathers) const {
        Tile tile(kPixels, layout.groups.size(), layout.plane_count());
        const PointSet places = poisson_points(scene.meshes[0], 0.15, {7});
        REQUIRE(places.size() > kPixels);
        for (std::uint32_t i = 0; i < kPixels; ++i) {
            GatherRequest request;
            request.pixel = i;
            request.is_primary = sees_itself;
            request.position = places.positions[i];
            request.normal = places.normals[i];
            request.depth = bodies[0]->depth();
            if (!sees_itself && i % 3 == 0) {  // a crack
                request.position *= 0.8f + 0.15f * to_unit_float(hash(i, 1u));
                request.normal = V3f(0.0f);
                request.depth = 0.0f;
            }
            (sees_itself ? request.translucency : request.refraction) = Rgb(0.3f, 0.2f, 0.1f);
            if (sees_itself) {
                request.first_overlay = std::uint32_t(tile.overlays.size());
                request.overlay_count = 1;
                tile.overlays.push_back({layout.overlay_plane(0), Rgb(0.1f), Rgb(-0.3f), Rgb(0.2f)});
            }
            request.entering = Rgb(0.2f);
            tile.requests.push_back(request);
        }
        Gathering(scene, bodies, layout).answer({}, tile);
        gathers = tile.gathers;
        std::vector<std::vector<Rgb>> result;
        const auto keep = [&](const auto& value_of) {
            for (std::size_t pixel = 0; pixel < kPixels; ++pixel) result.back().push_back(value_of(pixel));
        };
        for (std::size_t g = 0; g < 2; ++g) {
            for (std::size_t c = 0; c < kComponentCount; ++c) {
                result.emplace_back();
                keep([&](std::size_t pixel) { return tile.light(pixel, c, g); });
            }
            for (std::size_t p = 0; p < layout.plane_count(); ++p) {
                const std::size_t of_kind = p % layout.seen_plane_count();
                const bool goes_on = p < layout.ice_plane_count() && of_kind > 0 && of_kind < layout.knots.size();
                if (!goes_on) result.emplace_back();
                keep([&](std::size_t pixel) { return tile.plane(pixel, p)[g]; });
            }
        }
        result.emplace_back();
        keep([&](std::size_t pixel) { return tile.coverage(pixel); });
        result.emplace_back();
        keep([&](std::size_t pixel) { return Rgb(1.0f) - tile.lacking(pixel); });
        return result;
    }
};

// The greatest relative RMS of a layer; how many are not black.
std::pair<double, int> greatest_error(const std::vector<std::vector<Rgb>>& a, const std::vector<std::vector<Rgb>>& b) {
    double greatest = 0.0;
    int lit = 0;
    REQUIRE(a.size() == b.size());
    const auto is_black = [](const std::vector<Rgb>& layer) {
        return std::all_of(layer.begin(), layer.end(), [](const Rgb& v) { return v == Rgb(0.0f); });
    };
    for (std::size_t i = 0; i < a.size(); ++i) {
        REQUIRE(is_black(a[i]) == is_black(b[i]));
        if (is_black(a[i])) continue;
        ++lit;
        greatest = std::max(greatest, test::relative_rms(a[i], b[i]));
    }
    return {greatest, lit};
}

}  // namespace

TEST_CASE("gathering: every layer of ice that is seen by way of others is as if it were gathered there") {
    for (const float strength : {1.0f, 0.6f}) {
        std::uint64_t blends = 0, gathers = 0;
        const auto blended = LayeredBall(0.5f, strength, true).layers(false, blends);
        const auto there = LayeredBall(0.5f, strength, false).layers(false, gathers);
        CHECK(blends == 0);
        CHECK(gathers == kPixels);
        const auto [error, lit] = greatest_error(blended, there);
        CHECK(error < 0.02);                // as layers of inner gathers
        CHECK(lit >= 2 * (1 + 1 + 6 + 1));  // refraction, knots, modes and light as rendered, by group
    }
}

TEST_CASE("gathering: what the camera sees itself is gathered there, overlays included") {
    std::uint64_t blends = 0, gathers = 0;
    const auto with = LayeredBall(0.2f, 1.0f, true).layers(true, blends);
    const auto without = LayeredBall(0.2f, 1.0f, false).layers(true, gathers);
    CHECK(blends == kPixels);
    CHECK(with == without);
    const auto [error, lit] = greatest_error(with, without);
    CHECK(error == 0.0);
    CHECK(lit >=
          2 * (1 + 1 + 6 + 2) + 2);  // translucency, knots, modes and two of the overlay, by group; two of coverage
}

TEST_CASE("gathering: places of a pixel share a gather within half a spacing, however far a mean free path is") {
    const LayeredBall ball(0.05f, 1.0f, false);
    const float spacing = ball.bodies[0]->spacing;
    const auto gathers = [&](float begin, float apart) {
        Tile tile(1, ball.layout.groups.size(), ball.layout.plane_count());
        for (const float x : {begin, begin + apart}) {
            GatherRequest request;
            request.is_primary = true;
            request.position = V3f(x, 0.0f, 1.0f);
            request.normal = V3f(0.0f, 0.0f, 1.0f);
            tile.requests.push_back(request);
        }
        Gathering(ball.scene, ball.bodies, ball.layout).answer({}, tile);
        return tile.gathers;
    };
    for (const float begin : {0.1f, 0.4f, 0.45f, 0.6f, 0.97f}) {
        CHECK(gathers(begin * spacing, 0.2f * spacing) == 1);
        CHECK(gathers(begin * spacing, 0.49f * spacing) == 1);
        CHECK(gathers(begin * spacing, 0.51f * spacing) == 2);
        CHECK(gathers(begin * spacing, 0.6f * spacing) == 2);
    }
}

TEST_CASE("gathering: layers of compensations leave the light as it is rendered to the bit") {
    std::uint64_t gathers = 0;
    LayeredBall plain(0.2f, 1.0f, true);
    plain.bodies[0]->trees.on_surface = nullptr;
    plain.bodies[0]->at_points = nullptr;
    const auto light = LayeredBall(0.2f, 1.0f, false).layers(true, gathers);
    CHECK(light.front() == plain.layers(true, gathers).front());
}

}  // namespace frazil
