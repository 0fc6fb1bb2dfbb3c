#include "frazil/bindings/bindings.h"
#include "frazil/geometry/mesh.h"

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
                new (self) Mesh{
                    to_vectors3(positions, "Mesh: positions"), to_indices3(triangles, "Mesh: triangles"), {}, {}, {}};
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
        .def_prop_ro("area", &surface_area, "Surface area in square metres.")
        .def("__repr__", [](const Mesh& mesh) {
            return str("Mesh(", mesh.positions.size(), " vertices, ", mesh.triangles.size(), " triangles)");
        });
}

}  // namespace frazil
