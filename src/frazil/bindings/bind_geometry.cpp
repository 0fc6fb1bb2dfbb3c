#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>

#include "frazil/bindings/bindings.h"
#include "frazil/geometry/mesh.h"
#include "frazil/geometry/refinement.h"
#include "frazil/geometry/self_intersections.h"
#include "frazil/geometry/subdivision.h"

namespace frazil {
namespace {

// What an array of that length can only be; vertex wins where lengths coincide.
Interpolation interpolation_of(std::size_t length, const Mesh& mesh, const char* what) {
    if (length == mesh.positions.size()) return Interpolation::vertex;
    if (length == 3 * mesh.triangles.size()) return Interpolation::corner;
    if (length == mesh.triangles.size()) return Interpolation::uniform;
    if (length == 1) return Interpolation::constant;
    throw ValueError(str("Mesh: ", what, " must have one row per vertex (", mesh.positions.size(),
                         ") or per triangle corner (", 3 * mesh.triangles.size(), "), got ", length, " rows."));
}

Interpolation interpolation_named(const std::string& name) {
    if (name == "constant") return Interpolation::constant;
    if (name == "uniform") return Interpolation::uniform;
    if (name == "vertex") return Interpolation::vertex;
    if (name == "corner") return Interpolation::corner;
    throw ValueError(str("Mesh: interpolation must be constant, uniform, vertex or corner, got '", name, "'."));
}

template <class T>
void set_primvar(Primvar<T>& primvar, std::vector<T> values, const std::optional<std::string>& interpolation,
                 const Mesh& mesh, const char* what) {
    primvar.interpolation =
        interpolation ? interpolation_named(*interpolation) : interpolation_of(values.size(), mesh, what);
    primvar.values = std::move(values);
    check_mesh(mesh, "Mesh");
}

const char* interpolation_name(Interpolation interpolation) {
    constexpr const char* kNames[] = {"constant", "uniform", "vertex", "corner"};
    return kNames[int(interpolation)];
}

template <class T, class Mesh>
nb::object view_primvar(Primvar<T>& primvar, Mesh& owner) {
    if (primvar.is_empty()) return nb::none();
    return nb::cast(
        view(&primvar.values.data()->x, {primvar.values.size(), sizeof(T) / sizeof(float)}, nb::find(owner)));
}

std::vector<std::int32_t> to_integers(const IntArray& array) {
    return {array.data(), array.data() + array.size()};
}

template <class T>
Primvar<T> to_primvar(const std::optional<std::pair<FloatArray, std::string>>& given,
                      std::vector<T> (*convert)(const FloatArray&, const char*), const char* what) {
    if (!given) return {};
    return {convert(given->first, what), interpolation_named(given->second)};
}

nb::ndarray<nb::numpy, std::int32_t> to_array(std::vector<std::int32_t> values) {
    auto* kept = new std::vector<std::int32_t>(std::move(values));
    nb::capsule owner(kept, [](void* memory) noexcept { delete static_cast<std::vector<std::int32_t>*>(memory); });
    return nb::ndarray<nb::numpy, std::int32_t>(kept->data(), {kept->size()}, owner);
}

void bind_control_mesh(nb::module_& module) {
    using OptionalPrimvar = std::optional<std::pair<FloatArray, std::string>>;
    nb::class_<ControlMesh>(
        module, "ControlMesh",
        "Polygons as USD gives them, right-handed.\n\n"
        "Parameters\n----------\n"
        "points : (V, 3) float32, metres.\n"
        "face_vertex_counts, face_vertex_indices, hole_indices : int32.\n"
        "crease_indices, crease_lengths, crease_sharpnesses, corner_indices, corner_sharpnesses : as in USD.\n"
        "normals, uvs, colors : (array, interpolation) with 'constant', 'uniform', 'vertex' or 'corner'.\n"
        "is_boundary_smooth : interpolateBoundary is edgeOnly.")
        .def(
            "__init__",
            [](ControlMesh* self, const FloatArray& points, const IntArray& counts, const IntArray& indices,
               const std::optional<IntArray>& holes, const std::optional<IntArray>& crease_indices,
               const std::optional<IntArray>& crease_lengths, std::vector<float> crease_sharpnesses,
               const std::optional<IntArray>& corner_indices, std::vector<float> corner_sharpnesses,
               const OptionalPrimvar& normals, const OptionalPrimvar& uvs, const OptionalPrimvar& colors,
               bool is_boundary_smooth) {
                const auto integers = [](const std::optional<IntArray>& array) {
                    return array ? to_integers(*array) : std::vector<std::int32_t>();
                };
                new (self) ControlMesh{to_vectors3(points, "ControlMesh: points"),
                                       to_integers(counts),
                                       to_integers(indices),
                                       integers(holes),
                                       integers(crease_indices),
                                       integers(crease_lengths),
                                       std::move(crease_sharpnesses),
                                       integers(corner_indices),
                                       std::move(corner_sharpnesses),
                                       to_primvar(normals, &to_vectors3, "ControlMesh: normals"),
                                       to_primvar(uvs, &to_vectors2, "ControlMesh: uvs"),
                                       to_primvar(colors, &to_vectors3, "ControlMesh: colors"),
                                       is_boundary_smooth};
            },
            "points"_a, "face_vertex_counts"_a, "face_vertex_indices"_a, nb::kw_only(), "hole_indices"_a = nb::none(),
            "crease_indices"_a = nb::none(), "crease_lengths"_a = nb::none(),
            "crease_sharpnesses"_a = std::vector<float>(), "corner_indices"_a = nb::none(),
            "corner_sharpnesses"_a = std::vector<float>(), "normals"_a = nb::none(), "uvs"_a = nb::none(),
            "colors"_a = nb::none(), "is_boundary_smooth"_a = false);

    module.def(
        "triangulate",
        [](const ControlMesh& cage, const std::string& path) {
            RefinedMesh refined;
            {
                nb::gil_scoped_release released;
                refined = triangulate(cage, path);
            }
            return std::pair(std::move(refined.mesh), to_array(std::move(refined.faces)));
        },
        "cage"_a, "path"_a = "ControlMesh",
        "Flat polygons as triangles: (Mesh, the face of each triangle (F,) int32). ValueError, beginning with `path`,\n"
        "for indices or primvars that do not fit together.");
    module.def(
        "subdivide",
        [](const ControlMesh& cage, int level, const std::string& path) {
            RefinedMesh refined;
            {
                nb::gil_scoped_release released;
                refined = subdivide(cage, level, path);
            }
            return std::pair(std::move(refined.mesh), to_array(std::move(refined.faces)));
        },
        "cage"_a, "level"_a, "path"_a = "ControlMesh",
        "The Catmull-Clark limit surface, `level` quads along each edge: (Mesh, the face of each triangle).");
    module.def(
        "cut_long_edges",
        [](const Mesh& mesh, float edge_length, std::size_t most_triangles) {
            CutMesh cut;
            {
                nb::gil_scoped_release released;
                cut = cut_long_edges(mesh, edge_length, most_triangles);
            }
            const float longest = cut.longest_edge;
            return std::tuple(std::move(cut.mesh), to_array(std::move(cut.parents)), longest);
        },
        "mesh"_a, "edge_length"_a, "most_triangles"_a = std::size_t(4000000),
        "Halve edges until none is longer than edge_length: (Mesh, the triangle that each was cut from (F,) int32, "
        "the\n"
        "longest edge that is left). No more than most_triangles are made.");
    module.def(
        "displaced",
        [](const Mesh& mesh, const FloatArray& offsets) {
            const std::vector<V3f> vectors = to_vectors3(offsets, "displaced: offsets");
            nb::gil_scoped_release released;
            return displaced(mesh, vectors);
        },
        "mesh"_a, "offsets"_a,
        "Move the vertices by offsets (3F, 3) at the corners of the triangles, their mean at each vertex, and give "
        "the\n"
        "shape its normals. No cracks open.");
    module.def(
        "self_intersections",
        [](const Mesh& mesh) {
            std::vector<std::int32_t> found;
            {
                nb::gil_scoped_release released;
                found = self_intersections(mesh);
            }
            return to_array(std::move(found));
        },
        "mesh"_a,
        "The triangles (N,) int32 that run through another of the mesh: what is inside is not well defined there, and "
        "light\n"
        "that goes through such a solid is lost or counted twice. Crossings of less than a thousandth of an edge do "
        "not\n"
        "count, nor do triangles that lie flat on each other.");
}

}  // namespace

void bind_geometry(nb::module_& module) {
    nb::class_<Mesh>(
        module, "Mesh",
        "A triangle mesh.\n\n"
        "Parameters\n----------\n"
        "positions : (V, 3) float32, metres, finite.\n"
        "triangles : (F, 3) int32, counter-clockwise seen from outside.\n"
        "normals : (V, 3) or (3F, 3) float32, unit length, optional; without them the mesh is faceted.\n"
        "uvs : (V, 2) or (3F, 2) float32, optional.\n\n"
        "Raises\n------\nValueError\n    For wrong shapes, NaN or infinite positions, indices out of range.\n\n"
        "The arrays are copied; the properties are views of the mesh's own memory.")
        .def(
            "__init__",
            [](Mesh* self, const FloatArray& positions, const IntArray& triangles,
               const std::optional<FloatArray>& normals, const std::optional<FloatArray>& uvs) {
                new (self) Mesh{to_vectors3(positions, "Mesh: positions"),
                                to_indices3(triangles, "Mesh: triangles"),
                                {},
                                {},
                                {},
                                {},
                                {}};
                check_mesh(*self, "Mesh");
                if (normals) set_primvar(self->normals, to_vectors3(*normals, "Mesh: normals"), {}, *self, "normals");
                if (uvs) set_primvar(self->uvs, to_vectors2(*uvs, "Mesh: uvs"), {}, *self, "uvs");
            },
            "positions"_a, "triangles"_a, "normals"_a = nb::none(), "uvs"_a = nb::none())
        .def_prop_ro("positions",
                     [](Mesh& mesh) {
                         return view(&mesh.positions.data()->x, {mesh.positions.size(), 3}, nb::find(mesh));
                     })
        .def_prop_ro("triangles",
                     [](Mesh& mesh) {
                         return view(&mesh.triangles.data()->x, {mesh.triangles.size(), 3}, nb::find(mesh));
                     })
        .def(
            "set_normals",
            [](Mesh& mesh, const FloatArray& values, const std::optional<std::string>& interpolation) {
                set_primvar(mesh.normals, to_vectors3(values, "Mesh: normals"), interpolation, mesh, "normals");
            },
            "values"_a, "interpolation"_a = nb::none(),
            "Give normals; interpolation is constant, uniform (per triangle), vertex or corner, found from the length\n"
            "where it is not given.")
        .def(
            "set_uvs",
            [](Mesh& mesh, const FloatArray& values, const std::optional<std::string>& interpolation) {
                set_primvar(mesh.uvs, to_vectors2(values, "Mesh: uvs"), interpolation, mesh, "uvs");
            },
            "values"_a, "interpolation"_a = nb::none(), "Give texture coordinates; see set_normals.")
        .def(
            "set_colors",
            [](Mesh& mesh, const FloatArray& values, const std::optional<std::string>& interpolation) {
                set_primvar(mesh.colors, to_vectors3(values, "Mesh: colors"), interpolation, mesh, "colors");
            },
            "values"_a, "interpolation"_a = nb::none(), "Give display colours, linear RGB; see set_normals.")
        .def(
            "set_rest",
            [](Mesh& mesh, const FloatArray& values) {
                mesh.rest = to_vectors3(values, "Mesh: rest");
                check_mesh(mesh, "Mesh");
            },
            "values"_a,
            "Give positions (V, 3) float32, metres, in a pose that does not move: points are placed there and stay on\n"
            "their triangles in every other pose.")
        .def(
            "set_spacing",
            [](Mesh& mesh, const FloatArray& values) {
                mesh.spacing.assign(values.data(), values.data() + values.size());
                check_mesh(mesh, "Mesh");
            },
            "values"_a,
            "Give the spacing (V,) float32 of the points that a render places on this mesh, metres in the world: it "
            "takes\n"
            "the place of the material's.")
        .def_prop_ro(
            "spacing",
            [](Mesh& mesh) -> nb::object {
                if (mesh.spacing.empty()) return nb::none();
                return nb::cast(view(mesh.spacing.data(), {mesh.spacing.size()}, nb::find(mesh)));
            },
            nb::sig("def spacing(self) -> numpy.ndarray | None"), "View of the points' spacing, or None.")
        .def_prop_ro(
            "rest",
            [](Mesh& mesh) -> nb::object {
                if (mesh.rest.empty()) return nb::none();
                return nb::cast(view(&mesh.rest.data()->x, {mesh.rest.size(), 3}, nb::find(mesh)));
            },
            nb::sig("def rest(self) -> numpy.ndarray | None"), "View of the rest positions, or None.")
        .def_prop_ro(
            "normals", [](Mesh& mesh) { return view_primvar(mesh.normals, mesh); },
            nb::sig("def normals(self) -> numpy.ndarray | None"), "View of the normals, or None.")
        .def_prop_ro(
            "uvs", [](Mesh& mesh) { return view_primvar(mesh.uvs, mesh); },
            nb::sig("def uvs(self) -> numpy.ndarray | None"), "View of the texture coordinates, or None.")
        .def_prop_ro(
            "colors", [](Mesh& mesh) { return view_primvar(mesh.colors, mesh); },
            nb::sig("def colors(self) -> numpy.ndarray | None"), "View of the display colours, or None.")
        .def_prop_ro("normals_interpolation",
                     [](const Mesh& mesh) { return interpolation_name(mesh.normals.interpolation); })
        .def_prop_ro("uvs_interpolation", [](const Mesh& mesh) { return interpolation_name(mesh.uvs.interpolation); })
        .def_prop_ro("colors_interpolation",
                     [](const Mesh& mesh) { return interpolation_name(mesh.colors.interpolation); })
        .def(
            "submesh",
            [](const Mesh& mesh, const IntArray& triangles) {
                const std::vector<std::int32_t> kept = to_integers(triangles);
                for (const std::int32_t t : kept) {
                    if (t < 0 || std::size_t(t) >= mesh.triangles.size()) {
                        throw ValueError(
                            str("Mesh: triangles must be in 0..", int(mesh.triangles.size()) - 1, ", got ", t, "."));
                    }
                }
                return submesh(mesh, kept);
            },
            "triangles"_a, "Some of the triangles, by their indices (N,) int32, with the vertices that they use.")
        .def(
            "transformed",
            [](const Mesh& mesh, const MatrixArray& matrix) { return transformed(mesh, to_matrix(matrix)); },
            "matrix"_a, "Moved by a (4, 4) float64 matrix for row vectors; a mirroring one also flips the winding.")
        .def_prop_ro("area", &surface_area, "Surface area in square metres.")
        .def("__repr__", [](const Mesh& mesh) {
            return str("Mesh(", mesh.positions.size(), " vertices, ", mesh.triangles.size(), " triangles)");
        });
    bind_control_mesh(module);
}

}  // namespace frazil
