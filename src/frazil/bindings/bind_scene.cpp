#include <nanobind/stl/array.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/variant.h>

#include "frazil/bindings/bindings.h"
#include "frazil/render/emission.h"
#include "frazil/render/motion.h"
#include "frazil/render/scene.h"

namespace frazil {

M44f to_matrix(const MatrixArray& array) {
    M44f matrix;
    for (int row = 0; row < 4; ++row) {
        for (int column = 0; column < 4; ++column) matrix[row][column] = float(array(row, column));
    }
    return matrix;
}

nb::object from_matrix(const M44f& matrix) {
    auto* values = new double[16];
    for (int i = 0; i < 16; ++i) values[i] = matrix[i / 4][i % 4];
    nb::capsule owner(values, [](void* memory) noexcept { delete[] static_cast<double*>(memory); });
    return nb::cast(nb::ndarray<nb::numpy, double>(values, {4, 4}, owner));
}

M44f to_matrix_or_identity(const std::optional<MatrixArray>& array) {
    return array ? to_matrix(*array) : M44f();
}

namespace {

std::uint32_t check_index(int index, std::size_t size, const std::string& path, const char* what) {
    if (index < 0 || std::size_t(index) >= size) {
        throw ValueError(str(path, ": ", what, " must be in 0..", int(size) - 1, ", got ", index,
                             ". Use an index that add_", what, " gave."));
    }
    return std::uint32_t(index);
}

void bind_camera(nb::module_& module) {
    nb::class_<Camera>(module, "Camera",
                       "A camera that looks along -z of its frame, +y up.\n\n"
                       "Parameters\n----------\n"
                       "matrix : (4, 4) float64 camera to world, for row vectors, metres; None = identity.\n"
                       "focal_length, horizontal_aperture, vertical_aperture, horizontal_offset, vertical_offset :\n"
                       "    in one unit; only ratios count.\n"
                       "is_orthographic, aperture_scale : metres per unit of aperture where it is orthographic.\n"
                       "clipping : (near, far), metres.")
        .def(
            "__init__",
            [](Camera* self, const std::optional<MatrixArray>& matrix, float focal_length, float horizontal_aperture,
               float vertical_aperture, float horizontal_offset, float vertical_offset, bool is_orthographic,
               float aperture_scale, std::array<float, 2> clipping, const std::string& path) {
                new (self) Camera{path,
                                  to_matrix_or_identity(matrix),
                                  is_orthographic,
                                  focal_length,
                                  horizontal_aperture,
                                  vertical_aperture,
                                  horizontal_offset,
                                  vertical_offset,
                                  aperture_scale,
                                  V2f(clipping[0], clipping[1])};
            },
            nb::kw_only(), "matrix"_a = nb::none(), "focal_length"_a = 50.0f, "horizontal_aperture"_a = 20.955f,
            "vertical_aperture"_a = 15.2908f, "horizontal_offset"_a = 0.0f, "vertical_offset"_a = 0.0f,
            "is_orthographic"_a = false, "aperture_scale"_a = 1.0f, "clipping"_a = std::array<float, 2>{1e-4f, 1e12f},
            "path"_a = "Camera")
        .def_rw("path", &Camera::path)
        .def_prop_rw(
            "matrix", [](const Camera& camera) { return from_matrix(camera.camera_to_world); },
            [](Camera& camera, const MatrixArray& matrix) { camera.camera_to_world = to_matrix(matrix); })
        .def_rw("is_orthographic", &Camera::is_orthographic)
        .def_rw("focal_length", &Camera::focal_length)
        .def_rw("horizontal_aperture", &Camera::horizontal_aperture)
        .def_rw("vertical_aperture", &Camera::vertical_aperture)
        .def_rw("horizontal_offset", &Camera::horizontal_offset)
        .def_rw("vertical_offset", &Camera::vertical_offset)
        .def_rw("aperture_scale", &Camera::aperture_scale)
        .def_prop_rw(
            "clipping",
            [](const Camera& camera) {
                return std::array<float, 2>{camera.clipping.x, camera.clipping.y};
            },
            [](Camera& camera, std::array<float, 2> range) { camera.clipping = V2f(range[0], range[1]); })
        .def("__repr__", [](const Camera& camera) {
            return str("Camera(", camera.path, ", ", camera.is_orthographic ? "orthographic" : "perspective", ")");
        });
}

}  // namespace

void bind_scene(nb::module_& module) {
    bind_camera(module);

    nb::class_<Material>(module, "Material", "A named model of the scene.")
        .def_ro("path", &Material::path)
        .def_prop_ro("model", [](Material& material) { return material.model; })
        .def("__repr__", [](const Material& material) { return str("Material(", material.path, ")"); });

    nb::class_<Object>(module, "Object", "A mesh with a material, placed in the world.")
        .def_ro("path", &Object::path)
        .def_ro("mesh", &Object::mesh)
        .def_ro("material", &Object::material)
        .def_ro("asset", &Object::asset)
        .def_ro("translucency_set", &Object::translucency_set)
        .def_prop_ro("matrix", [](const Object& object) { return from_matrix(object.local_to_world); })
        .def("__repr__", [](const Object& object) {
            return str("Object(", object.path, ", mesh ", object.mesh, ", material ", object.material, ")");
        });

    nb::class_<Scene>(module, "Scene", nb::dynamic_attr(),
                      "All that is rendered, as plain data: one frame, metres, +y up.\n\n"
                      "Meshes and materials are added once and placed by index; lists are views of the scene's parts.")
        .def(nb::init<>())
        .def(
            "add_mesh",
            [](Scene& scene, const Mesh& mesh, const std::string& path) {
                check_mesh(mesh, path);
                scene.meshes.push_back(mesh);
                scene.mesh_paths.push_back(path);
                return int(scene.meshes.size()) - 1;
            },
            "mesh"_a, "path"_a, "Add a mesh (copied); its index. ValueError, beginning with `path`, if it is broken.")
        .def(
            "add_material",
            [](Scene& scene, const std::string& path, const std::variant<StandardMaterial, IceMaterial>& model) {
                scene.materials.push_back({path, model});
                return int(scene.materials.size()) - 1;
            },
            "path"_a, "model"_a, "Add a StandardMaterial or IceMaterial (copied); its index.")
        .def(
            "add_object",
            [](Scene& scene, const std::string& path, int mesh, int material, const std::optional<MatrixArray>& matrix,
               const std::string& asset, const std::string& translucency_set) {
                scene.objects.push_back({path, check_index(mesh, scene.meshes.size(), path, "mesh"),
                                         check_index(material, scene.materials.size(), path, "material"),
                                         to_matrix_or_identity(matrix), asset, translucency_set});
                return int(scene.objects.size()) - 1;
            },
            "path"_a, "mesh"_a, "material"_a, "matrix"_a = nb::none(), "asset"_a = "", "translucency_set"_a = "",
            "Place a mesh by a (4, 4) float64 matrix for row vectors, None = identity; the object's index.\n"
            "`asset` is what it belongs to, for Cryptomatte; '' = itself. Ice of one `translucency_set` shares its "
            "light as\n"
            "one body; '' = by itself.")
        .def(
            "add_light",
            [](Scene& scene, const Light& light) {
                scene.lights.push_back(light);
                return int(scene.lights.size()) - 1;
            },
            "light"_a, "Add a light (copied); its index.")
        .def("emissive_objects", &emissive_objects, "Indices of the objects whose material emits light.")
        .def(
            "triangle_emission",
            [](const Scene& scene, int index) -> nb::object {
                const std::uint32_t object = check_index(index, scene.objects.size(), "Scene", "object");
                std::vector<Rgb> values;
                {
                    nb::gil_scoped_release released;  // a texture that is read now may ask for it
                    values = triangle_emission(scene, object);
                }
                if (values.empty()) return nb::none();
                auto* memory = new std::vector<Rgb>(values);
                nb::capsule owner(memory, [](void* p) noexcept { delete static_cast<std::vector<Rgb>*>(p); });
                return nb::cast(nb::ndarray<nb::numpy, float>(memory->data(), {memory->size(), 3}, owner));
            },
            "object"_a, nb::sig("def triangle_emission(self, object: int) -> numpy.ndarray | None"),
            "Mean radiance (F, 3) float32 that the material of an object emits, by triangle; None where it emits none.")
        .def_rw("camera", &Scene::camera)
        .def_ro("meshes", &Scene::meshes, "Copies of the meshes, in the order of their indices.")
        .def(
            "mesh",
            [](const Scene& scene, int index) {
                return scene.meshes[check_index(index, scene.meshes.size(), "Scene", "mesh")];
            },
            "index"_a, "A copy of one mesh.")
        .def_ro("mesh_paths", &Scene::mesh_paths)
        .def_ro("materials", &Scene::materials)
        .def_ro("objects", &Scene::objects)
        .def_ro("lights", &Scene::lights)
        .def(
            "set_motion", [](Scene& scene, const Scene& next) { scene.motion = motion_between(scene, next); }, "next"_a,
            "Tell how the scene goes on, by the same scene a frame later: for the AOV motion. Objects are paired by "
            "path.")
        .def_prop_ro(
            "motion",
            [](const Scene& scene) -> nb::object {
                if (!scene.motion) return nb::none();
                nb::list matrices, positions;
                for (const M44f& matrix : scene.motion->local_to_world) matrices.append(from_matrix(matrix));
                for (const std::vector<V3f>& moved : scene.motion->positions) {
                    auto* memory = new std::vector<V3f>(moved);
                    nb::capsule owner(memory, [](void* p) noexcept { delete static_cast<std::vector<V3f>*>(p); });
                    positions.append(
                        nb::cast(nb::ndarray<nb::numpy, float>(memory->data(), {memory->size(), 3}, owner)));
                }
                nb::dict motion;
                motion["matrices"] = matrices;
                motion["positions"] = positions;
                motion["camera"] = scene.motion->camera;
                return motion;
            },
            nb::sig("def motion(self) -> dict | None"),
            "What set_motion told: (4, 4) matrices of the objects, (V, 3) positions of the meshes (empty where they "
            "stay)\n"
            "and the camera; None without.")
        .def("__repr__", [](const Scene& scene) {
            return str("Scene(", scene.objects.size(), " objects, ", scene.meshes.size(), " meshes, ",
                       scene.materials.size(), " materials, ", scene.lights.size(), " lights)");
        });
}

}  // namespace frazil
