#include "frazil/base/parallel.h"
#include "frazil/bindings/bindings.h"
#include "frazil/points/point_file.h"
#include "frazil/points/poisson.h"
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

}  // namespace

void bind_points(nb::module_& module) {
    nb::class_<PointSet>(module, "PointSet",
                         "Points on a mesh that stand for its surface. The arrays are views of the set's own memory.")
        .def_prop_ro(
            "positions", [](PointSet& p) { return view(&raw(p.positions)->x, {p.size(), 3}, nb::find(p)); },
            "(N, 3) float32, metres.")
        .def_prop_ro(
            "normals", [](PointSet& p) { return view(&raw(p.normals)->x, {p.size(), 3}, nb::find(p)); },
            "(N, 3) float32: the triangles' geometric normals, unit length.")
        .def_prop_ro(
            "areas", [](PointSet& p) { return view(raw(p.areas), {p.size()}, nb::find(p)); },
            "(N,) float32, m²: the surface nearest to each point on its side; their sum is the mesh's area.")
        .def_prop_ro(
            "triangles", [](PointSet& p) { return view(raw(p.triangles), {p.size()}, nb::find(p)); },
            "(N,) int32: the triangle that each point lies on.")
        .def_prop_ro(
            "barycentrics", [](PointSet& p) { return view(&raw(p.barycentrics)->x, {p.size(), 2}, nb::find(p)); },
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
        .def("__len__", &PointSet::size)
        .def("__repr__", [](const PointSet& p) { return str("PointSet(", p.size(), " points, spacing ", p.spacing, ")"); });

    module.def(
        "poisson_points",
        [](const Mesh& mesh, double spacing, std::uint32_t seed, bool thin_walls, std::uint64_t max_points, int threads,
           const std::optional<nb::callable>& progress) {
            Progress told = make_progress(progress);
            const nb::gil_scoped_release release;
            return with_threads(threads,
                                [&] { return poisson_points(mesh, spacing, {seed, thin_walls, max_points}, &told); });
        },
        "mesh"_a, "spacing"_a, "seed"_a = 0, "thin_walls"_a = true, "max_points"_a = 0, "threads"_a = 0,
        "progress"_a = nb::none(),
        "Poisson-disk points on any mesh: never nearer than spacing, no surface farther than it from a point.\n\n"
        "Parameters\n----------\n"
        "mesh : Mesh, any triangle soup with some area.\n"
        "spacing : float > 0, metres.\n"
        "seed : int; the result depends on (mesh, spacing, seed) alone.\n"
        "thin_walls : bool; True gives each side of a thin sheet its own points, False forbids any two points nearer\n"
        "    than spacing.\n"
        "max_points : int; refuse to make more. 0 allows what fits into free memory.\n"
        "threads : int; 0 takes all cores.\n"
        "progress : callable (stage, fraction), optional.\n\n"
        "Returns\n-------\nPointSet, about 0.7 area / spacing² points.\n\n"
        "Raises\n------\nValueError\n    For spacing that is not > 0 or would make too many points, or a mesh without area.");
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
