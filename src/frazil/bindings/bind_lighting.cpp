#include <ctime>

#include <nanobind/stl/pair.h>

#include "frazil/base/parallel.h"
#include "frazil/bindings/bindings.h"
#include "frazil/lighting/irradiance.h"
#include "frazil/lighting/occlusion.h"
#include "frazil/material/microfacet.h"
#include "frazil/translucency/fresnel.h"

namespace frazil {
namespace {

// Positions and normals of any object that has them: a PointSet, or a plain namespace of arrays.
PointSet to_points(const nb::object& points) {
    PointSet result;
    result.positions = to_vectors3(nb::cast<FloatArray>(points.attr("positions")), "points: positions");
    result.normals = to_vectors3(nb::cast<FloatArray>(points.attr("normals")), "points: normals");
    return result;
}

std::vector<Placement> one_each(std::size_t count) {
    std::vector<Placement> placements(count);
    for (std::uint32_t i = 0; i < count; ++i) placements[i].mesh = i;
    return placements;
}

std::vector<Ray> to_rays(const FloatArray& origins, const FloatArray& directions, float t_max) {
    const std::vector<V3f> from = to_vectors3(origins, "origins"), along = to_vectors3(directions, "directions");
    if (from.size() != along.size()) {
        throw ValueError(str("directions must have one row per origin (", from.size(), "), got ", along.size(), "."));
    }
    std::vector<Ray> rays(from.size());
    for (std::size_t i = 0; i < rays.size(); ++i) rays[i] = {from[i], along[i], 0.0f, t_max};
    return rays;
}

}  // namespace

void bind_lighting(nb::module_& module) {
    nb::class_<RayScene>(module, "RayScene",
                         "Meshes that rays can hit.\n\n"
                         "Parameters\n----------\nmeshes : list of Mesh, in world space, metres. Copied.")
        .def(
            "__init__",
            [](RayScene* self, const std::vector<Mesh>& meshes) {
                nb::gil_scoped_release release;
                new (self) RayScene(meshes, one_each(meshes.size()));
            },
            "meshes"_a)
        .def(
            "are_occluded",
            [](const RayScene& scene, const FloatArray& origins, const FloatArray& directions, float t_max) {
                const std::vector<Ray> rays = to_rays(origins, directions, t_max);
                std::vector<std::uint8_t> result(rays.size());
                {
                    nb::gil_scoped_release release;
                    parallel_for(rays.size(), 4096, [&](std::size_t begin, std::size_t end) {
                        scene.are_occluded(std::span(rays).subspan(begin, end - begin),
                                           std::span(result).subspan(begin, end - begin));
                    });
                }
                const std::size_t count = result.size();
                return array_of<bool>(std::move(result), {count});
            },
            "origins"_a, "directions"_a, "t_max"_a = std::numeric_limits<float>::infinity(),
            "Whether anything lies on each ray: (M,) bool for origins and directions (M, 3).");

    module.def("light_groups", &light_groups, "lights"_a,
               "Names of the light groups in order of first appearance; '' is the default group. One default group "
               "where there\n"
               "is no light.");

    module.def(
        "bake_irradiance",
        [](const nb::object& points, const RayScene& scene, const std::vector<Light>& lights, float eta,
           float roughness, int samples, std::uint32_t seed, float error, int max_rounds,
           std::optional<std::vector<std::uint32_t>> objects, bool return_error) -> nb::object {
            const PointSet set = to_points(points);
            std::optional<Irradiance> baked;
            {
                nb::gil_scoped_release release;
                const LightSampler sampler(lights);
                const DielectricAlbedo albedo(eta);
                const float alpha = alpha_from_roughness(roughness);
                IrradianceOptions options;
                options.samples = samples, options.seed = seed;
                options.error = error, options.max_rounds = max_rounds;
                if (objects) options.objects = *objects;
                const auto transmittance = [&](float cosine) { return Rgb(1.0f - albedo.eval(cosine, alpha)); };
                baked = bake_irradiance(set, scene, sampler, transmittance, options);
            }
            const std::size_t groups = baked->groups;
            nb::object values = array_of<float>(std::move(baked->values), {set.size(), groups, 3});
            if (!return_error) return values;
            return nb::make_tuple(values, array_of<float>(std::move(baked->errors), {set.size()}));
        },
        "points"_a, "scene"_a, "lights"_a, nb::kw_only(), "eta"_a = 1.31f, "roughness"_a = 0.0f, "samples"_a = 64,
        "seed"_a = 0, "error"_a = 0.0f, "max_rounds"_a = 16, "objects"_a = nb::none(), "return_error"_a = false,
        nb::sig("def bake_irradiance(points: object, scene: RayScene, lights: Sequence[Light], *, eta: float = 1.31, "
                "roughness: float = 0.0, samples: int = 64, seed: int = 0, error: float = 0.0, max_rounds: int = 16, "
                "objects: Sequence[int] | None = None, return_error: bool = False) -> numpy.ndarray"),
        "Irradiance that enters at points, with ray-traced shadows.\n\n"
        "Parameters\n----------\n"
        "points : PointSet, or any object with positions and normals (N, 3) float32, metres.\n"
        "scene : RayScene that casts the shadows.\n"
        "lights : list of Light; the translucency multiplier of each is applied.\n"
        "eta : index of the body relative to the outside, 1 to 4; 1 lets all light in.\n"
        "roughness : of the boundary, 0 to 1.\n"
        "samples : shadow rays per point and light.\n"
        "seed : changes the noise, not the expectation.\n"
        "error : relative error (one standard deviation) at each point to which samples are added; 0 = none. Relative "
        "to what\n"
        "    arrives, or to a tenth of what would arrive if nothing were in the way, whichever is larger.\n"
        "max_rounds : how many times `samples` a light may take at a point for that.\n"
        "objects : of the scene, that the points lie on, for light linking: one each, one for all, or None.\n"
        "return_error : return the estimated standard deviation of each point's luminance too.\n\n"
        "Returns\n-------\n"
        "(N, G, 3) float32, W/m²: one row per light group, see light_groups; with `return_error` a tuple of it and "
        "(N,).\n\n"
        "Raises\n------\nValueError\n    For lights, points or options out of range, by name.");

    const auto occlusion_arrays = [](Occlusion&& occlusion) {
        const std::size_t count = occlusion.openness.size();
        return nb::make_tuple(array_of<float>(std::move(occlusion.openness), {count}),
                              array_of<float>(std::move(occlusion.bent_normals), {count, 3}));
    };
    module.def(
        "bake_occlusion",
        [occlusion_arrays](const nb::object& points, const RayScene& scene, int samples, std::uint32_t seed,
                           float distance) {
            const PointSet set = to_points(points);
            std::optional<Occlusion> result;
            {
                nb::gil_scoped_release release;
                result = bake_occlusion(set, scene, {samples, seed, distance});
            }
            return occlusion_arrays(std::move(*result));
        },
        "points"_a, "scene"_a, nb::kw_only(), "samples"_a = 64, "seed"_a = 0,
        "distance"_a = std::numeric_limits<float>::infinity(),
        "How much of the sky each point sees, by rays.\n\n"
        "Parameters\n----------\n"
        "points : PointSet, or any object with positions and normals (N, 3) float32, metres.\n"
        "scene : RayScene that occludes. samples : rays per point. distance : metres within which things occlude.\n\n"
        "Returns\n-------\n"
        "openness (N,) from 0 to 1, weighed by the cosine, and bent normals (N, 3): the mean open directions.\n\n"
        "Raises\n------\nValueError\n    For options out of range.");
    module.def(
        "point_occlusion",
        [occlusion_arrays](const PointSet& points, float distance, float tolerance) {
            std::optional<Occlusion> result;
            {
                nb::gil_scoped_release release;
                result = point_occlusion(points, distance, tolerance);
            }
            return occlusion_arrays(std::move(*result));
        },
        "points"_a, nb::kw_only(), "distance"_a = std::numeric_limits<float>::infinity(), "tolerance"_a = 0.2f,
        "The same as bake_occlusion from the points alone, without rays: each hides as a disk of its area.\n\n"
        "`tolerance` is the solid angle in steradian below which a cluster of points counts as one disk.");

    module.def(
        "measure_bake",
        [](const nb::object& points, const RayScene& scene, const std::vector<Light>& lights, int samples,
           bool is_bare) {
            const PointSet set = to_points(points);
            const LightSampler sampler(lights);
            IrradianceOptions options;
            options.samples = samples;
            const std::vector<Ray> rays = is_bare ? shadow_rays(set, sampler, options) : std::vector<Ray>();
            nb::gil_scoped_release release;
            const std::clock_t start = std::clock();
            std::uint64_t count = rays.size();
            if (is_bare) {
                std::vector<std::uint8_t> result(rays.size());
                parallel_for(rays.size(), 4096, [&](std::size_t begin, std::size_t end) {
                    for (std::size_t i = begin; i < end; ++i) result[i] = scene.is_occluded(rays[i]);
                });
            } else {
                const auto full = [](float) { return Rgb(1.0f); };
                count = bake_irradiance(set, scene, sampler, full, options).rays;
            }
            return std::pair(count, double(std::clock() - start) / CLOCKS_PER_SEC);
        },
        "points"_a, "scene"_a, "lights"_a, "samples"_a, "is_bare"_a,
        "(rays, seconds of processor time) of a bake, or of tracing the very same rays one by one and nothing else. "
        "For bench/.");
}

}  // namespace frazil
