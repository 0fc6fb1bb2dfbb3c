#include "frazil/base/parallel.h"
#include "frazil/bindings/bindings.h"
#include "frazil/points/point_file.h"
#include "frazil/points/poisson.h"
#include "frazil/points/pose.h"
#include "frazil/points/sampled_spacing.h"
#include "frazil/points/statistics.h"
#include "frazil/points/tessellated.h"

namespace frazil {
namespace {

template <class T>
T* raw(std::vector<T>& values) {
    return values.data();
}

// Ctrl-C ends a long job: asked for with the GIL, and only where Python runs its signal handlers.
Progress::IsCancelled interrupt_check() {
    return [] {
        const nb::gil_scoped_acquire gil;
        return PyErr_CheckSignals() != 0;
    };
}

Progress make_progress(const std::optional<nb::callable>& report) {
    Progress::Report call;
    if (report) {
        call = [&report](const char* stage, double fraction) {
            const nb::gil_scoped_acquire gil;
            (*report)(stage, fraction);
        };
    }
    return Progress(call, interrupt_check());
}

// A function of (positions, triangles, barycentrics) as numpy arrays, which returns as many values. Held by whoever calls
// it, so that no thread touches its references.
SpacingFunction spacing_of_arrays(const Mesh& mesh, const nb::callable& function) {
    return [&mesh, &function](std::span<const SpacingPlace> places, std::span<float> spacings) {
        const std::size_t count = places.size();
        std::vector<double> positions(3 * count);
        std::vector<std::int32_t> triangles(count);
        std::vector<float> barycentrics(2 * count);
        for (std::size_t i = 0; i < count; ++i) {
            const auto& [triangle, uv] = places[i];
            const V3i& t = mesh.triangles[triangle];
            const V3d a(mesh.positions[t.x]), b(mesh.positions[t.y]), c(mesh.positions[t.z]);
            const V3d position = a + (b - a) * double(uv.x) + (c - a) * double(uv.y);
            for (int k = 0; k < 3; ++k) positions[3 * i + k] = position[k];
            triangles[i] = static_cast<std::int32_t>(triangle);
            barycentrics[2 * i] = uv.x;
            barycentrics[2 * i + 1] = uv.y;
        }
        const nb::gil_scoped_acquire gil;
        const nb::object result = function(array_of<double>(std::move(positions), {count, 3}),
                                           array_of<std::int32_t>(std::move(triangles), {count}),
                                           array_of<float>(std::move(barycentrics), {count, 2}));
        FloatArray values;
        if (!nb::try_cast(result, values) || values.ndim() != 1 || values.size() != count) {
            throw ValueError(str("poisson_points: spacing(positions) must return shape (", count, ",) of numbers, got ",
                                 nb::cast<std::string>(nb::str(nb::getattr(result, "shape", result.type()))),
                                 ". Return one value per position."));
        }
        std::copy(values.data(), values.data() + count, spacings.begin());
    };
}

}  // namespace

void bind_points(nb::module_& module) {
    nb::class_<PointSet>(module, "PointSet",
                         "Points on a mesh that stand for its surface. The arrays are views of the set's own memory.")
        .def(nb::init<>(), "No points.")
        .def_prop_ro(
            "positions",
            [](PointSet& p) {
                return view(&raw(p.positions)->x, {p.size(), 3}, nb::find(p));
            },
            "(N, 3) float32, metres.")
        .def_prop_ro(
            "normals",
            [](PointSet& p) {
                return view(&raw(p.normals)->x, {p.size(), 3}, nb::find(p));
            },
            "(N, 3) float32: the triangles' geometric normals, unit length.")
        .def_prop_ro(
            "areas", [](PointSet& p) { return view(raw(p.areas), {p.size()}, nb::find(p)); },
            "(N,) float32, m²: the surface nearest to each point on its side; their sum is the mesh's area.")
        .def_prop_ro(
            "triangles", [](PointSet& p) { return view(raw(p.triangles), {p.size()}, nb::find(p)); },
            "(N,) int32: the triangle that each point lies on.")
        .def_prop_ro(
            "barycentrics",
            [](PointSet& p) {
                return view(&raw(p.barycentrics)->x, {p.size(), 2}, nb::find(p));
            },
            "(N, 2) float32 in [0, 1]: the weights of the triangle's second and third corner.")
        .def_ro("spacing", &PointSet::spacing, "The distance asked for, metres; the largest where it varies.")
        .def(
            "save",
            [](const PointSet& points, const nb::object& path) {
                const std::string name = nb::cast<std::string>(nb::str(path));
                const nb::gil_scoped_release release;
                save_points(points, name);
            },
            "path"_a, "Write a binary PLY file with all arrays. OSError where it cannot be written.")
        .def_static(
            "load",
            [](const nb::object& path) {
                const std::string name = nb::cast<std::string>(nb::str(path));
                const nb::gil_scoped_release release;
                return load_points(name);
            },
            "path"_a, "Read a file that save() wrote. OSError where it cannot be read.")
        .def(
            "on",
            [](const PointSet& points, const Mesh& mesh, bool thin_walls) {
                const nb::gil_scoped_release release;
                return points_on(points, mesh, thin_walls);
            },
            "mesh"_a, "thin_walls"_a = true,
            "The same points, with the same ids, on another pose of the mesh that they were made on: positions and\n"
            "normals follow their triangles, and each area is the pose's surface that is nearest to the point there.\n"
            "ValueError where the pose has fewer triangles.")
        .def("__len__", &PointSet::size)
        .def("__repr__",
             [](const PointSet& p) { return str("PointSet(", p.size(), " points, spacing ", p.spacing, ")"); });

    const auto place = [&](const char* name, auto make) {
        module.def(name, make, "mesh"_a, "spacing"_a, "seed"_a = 0, "thin_walls"_a = true, "max_points"_a = 0,
                   "threads"_a = 0, "progress"_a = nb::none());
    };
    using MaybeCall = std::optional<nb::callable>;
    place("poisson_points_constant", [](const Mesh& mesh, double spacing, std::uint32_t seed, bool thin_walls,
                                        std::uint64_t max_points, int threads, const MaybeCall& progress) {
        Progress told = make_progress(progress);
        const nb::gil_scoped_release release;
        return with_threads(threads, [&] {
            return place_in_rest(mesh, thin_walls, [&](const Mesh& rest) {
                return poisson_points(rest, spacing, {seed, thin_walls, max_points}, &told);
            });
        });
    });
    place("poisson_points_varying", [](const Mesh& mesh, const FloatArray& spacing, std::uint32_t seed, bool thin_walls,
                                       std::uint64_t max_points, int threads, const MaybeCall& progress) {
        const std::vector<float> values(spacing.data(), spacing.data() + spacing.size());
        Progress told = make_progress(progress);
        const nb::gil_scoped_release release;
        return with_threads(threads, [&] {
            return place_in_rest(mesh, thin_walls, [&](const Mesh& rest) {
                return poisson_points(rest, values, {seed, thin_walls, max_points}, &told);
            });
        });
    });
    place("poisson_points_sampled", [](const Mesh& mesh, const nb::callable& spacing, std::uint32_t seed,
                                       bool thin_walls, std::uint64_t max_points, int threads,
                                       const MaybeCall& progress) {
        Progress told = make_progress(progress);
        const nb::gil_scoped_release release;
        return with_threads(threads, [&] {
            return place_in_rest(mesh, thin_walls, [&](const Mesh& rest) {
                return poisson_points(rest, spacing_of_arrays(rest, spacing), {seed, thin_walls, max_points}, &told);
            });
        });
    });
    place("poisson_points_by_count", [](const Mesh& mesh, std::uint64_t count, std::uint32_t seed, bool thin_walls,
                                        std::uint64_t max_points, int threads, const MaybeCall& progress) {
        Progress told = make_progress(progress);
        const nb::gil_scoped_release release;
        return with_threads(threads, [&] {
            return place_in_rest(mesh, thin_walls, [&](const Mesh& rest) {
                return poisson_points_by_count(rest, count, {seed, thin_walls, max_points}, &told);
            });
        });
    });
    nb::class_<PointStatistics>(module, "PointStatistics", "How good a point set is; distances in metres.")
        .def_ro("count", &PointStatistics::count)
        .def_ro("min_distance", &PointStatistics::min_distance, "Of any two points on the same side.")
        .def_ro("mean_distance", &PointStatistics::mean_distance, "From a point to its nearest.")
        .def_ro("distance_spread", &PointStatistics::distance_spread, "Its standard deviation over its mean.")
        .def_ro("gap", &PointStatistics::gap, "The largest sampled distance from the surface to its nearest point.")
        .def_ro("mean_area", &PointStatistics::mean_area)
        .def_ro("area_spread", &PointStatistics::area_spread, "Standard deviation of the areas over their mean.")
        .def_ro("area_sum", &PointStatistics::area_sum)
        .def("__repr__", [](const PointStatistics& s) {
            return str("PointStatistics(count=", s.count, ", min_distance=", s.min_distance, ", gap=", s.gap,
                       ", distance_spread=", s.distance_spread, ", area_spread=", s.area_spread, ")");
        });
    module.def(
        "point_statistics",
        [](const PointSet& points, const Mesh& mesh, bool thin_walls, std::size_t samples) {
            const nb::gil_scoped_release release;
            return point_statistics(points, mesh, thin_walls, samples);
        },
        "points"_a, "mesh"_a, "thin_walls"_a = true, "samples"_a = 0,
        "Measure a point set: nearest pair, largest gap over `samples` places of the surface (0: ten a point, at "
        "least\n"
        "100,000), spread of nearest distances and of areas.");
    module.def(
        "tessellated_points",
        [](const Mesh& mesh, double edge_length) {
            const nb::gil_scoped_release release;
            return tessellated_points(mesh, edge_length);
        },
        "mesh"_a, "edge_length"_a,
        "The centres of a regular cut of every triangle into parts with edges of at most edge_length (metres), with\n"
        "their areas. ValueError where edge_length is not > 0 or would make too many points.");
}

}  // namespace frazil
