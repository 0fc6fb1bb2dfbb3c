#include <nanobind/stl/array.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/variant.h>

#include "frazil/bindings/bindings.h"
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

namespace {

using Triple = std::array<float, 3>;
using ImageArray = nb::ndarray<const float, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;

M44f to_matrix_or_identity(const std::optional<MatrixArray>& array) {
    return array ? to_matrix(*array) : M44f();
}

std::uint32_t check_index(int index, std::size_t size, const std::string& path, const char* what) {
    if (index < 0 || std::size_t(index) >= size) {
        throw ValueError(str(path, ": ", what, " must be in 0..", int(size) - 1, ", got ", index,
                             ". Use an index that add_", what, " gave."));
    }
    return std::uint32_t(index);
}

void bind_lights(nb::module_& module) {
    nb::class_<DomeLight>(
        module, "DomeLight",
        "Light from all around.\n\n"
        "Parameters\n----------\n"
        "image : (height, width, 3) float32 lat-long radiance, row 0 = +y, centre = +z, or None for a\n"
        "    uniform dome. Copied.")
        .def(
            "__init__",
            [](DomeLight* self, const std::optional<ImageArray>& image, const std::string& path) {
                if (!image) {
                    new (self) DomeLight{};
                    return;
                }
                const auto* pixels = reinterpret_cast<const Rgb*>(image->data());
                new (self) DomeLight{std::make_shared<const Environment>(
                    int(image->shape(1)), int(image->shape(0)),
                    std::vector<Rgb>(pixels, pixels + image->shape(0) * image->shape(1)), path)};
            },
            "image"_a = nb::none(), "path"_a = "DomeLight")
        .def_prop_ro("has_image", [](const DomeLight& light) { return light.image != nullptr; })
        .def_prop_ro(
            "image",
            [](nb::handle self) -> nb::object {
                const DomeLight& light = nb::cast<const DomeLight&>(self);
                if (!light.image) return nb::none();
                const Environment& image = *light.image;
                return nb::cast(view(&image.pixels().data()->x,
                                     {std::size_t(image.height()), std::size_t(image.width()), 3}, self));
            },
            "(height, width, 3) float32, or None for a uniform dome.")
        .def(
            "radiance",
            [](const DomeLight& light, const Triple& direction) {
                const Rgb c = light.image ? light.image->eval(V3f(direction[0], direction[1], direction[2])) : Rgb(1);
                return Triple{c.x, c.y, c.z};
            },
            "direction"_a, "Radiance from a unit direction in the light's own frame; 1 without an image.");
    nb::class_<DistantLight>(module, "DistantLight", "A sun along -z; `angle` is its full angle in degrees.")
        .def(nb::init<float>(), "angle"_a = 0.53f)
        .def_rw("angle", &DistantLight::angle);
    nb::class_<RectLight>(module, "RectLight", "A rectangle in x and y that shines along -z, in the light's units.")
        .def(nb::init<float, float>(), "width"_a = 1.0f, "height"_a = 1.0f)
        .def_rw("width", &RectLight::width)
        .def_rw("height", &RectLight::height);
    nb::class_<DiskLight>(module, "DiskLight", "A disk in x and y that shines along -z, in the light's units.")
        .def(nb::init<float>(), "radius"_a = 0.5f)
        .def_rw("radius", &DiskLight::radius);
    nb::class_<SphereLight>(module, "SphereLight", "A sphere that shines outwards, in the light's units.")
        .def(nb::init<float>(), "radius"_a = 0.5f)
        .def_rw("radius", &SphereLight::radius);
    nb::class_<CylinderLight>(module, "CylinderLight",
                              "A tube about x without caps that shines outwards, in the light's units.")
        .def(nb::init<float, float>(), "length"_a = 1.0f, "radius"_a = 0.5f)
        .def_rw("length", &CylinderLight::length)
        .def_rw("radius", &CylinderLight::radius);

    nb::class_<Light>(
        module, "Light",
        "A light of the scene.\n\n"
        "Parameters\n----------\n"
        "shape : DomeLight, DistantLight, RectLight, DiskLight, SphereLight or CylinderLight.\n"
        "radiance : RGB, the product of intensity, exposure, colour and colour temperature.\n"
        "matrix : (4, 4) float64 light to world, for row vectors; None = identity.\n"
        "path : name for messages. group : light group, '' = the default one.\n"
        "normalize : divide by the light's area in square metres.\n"
        "diffuse, specular, translucency, refraction, volume : multipliers of what the light does to each component.")
        .def(
            "__init__",
            [](Light* self, LightShape shape, const Triple& radiance, const std::optional<MatrixArray>& matrix,
               const std::string& path, const std::string& group, bool normalize, float diffuse, float specular,
               float translucency, float refraction, float volume) {
                new (self) Light{path,
                                 group,
                                 std::move(shape),
                                 Rgb(radiance[0], radiance[1], radiance[2]),
                                 normalize,
                                 to_matrix_or_identity(matrix),
                                 {diffuse, specular, translucency, refraction, volume}};
            },
            "shape"_a, nb::kw_only(), "radiance"_a = Triple{1, 1, 1}, "matrix"_a = nb::none(), "path"_a = "Light",
            "group"_a = "", "normalize"_a = false, "diffuse"_a = 1.0f, "specular"_a = 1.0f, "translucency"_a = 1.0f,
            "refraction"_a = 1.0f, "volume"_a = 1.0f)
        .def_rw("path", &Light::path)
        .def_rw("group", &Light::group)
        .def_rw("shape", &Light::shape)
        .def_prop_rw(
            "radiance",
            [](const Light& light) {
                return Triple{light.radiance.x, light.radiance.y, light.radiance.z};
            },
            [](Light& light, const Triple& value) { light.radiance = Rgb(value[0], value[1], value[2]); })
        .def_rw("normalize", &Light::normalize)
        .def_prop_rw(
            "matrix", [](const Light& light) { return from_matrix(light.light_to_world); },
            [](Light& light, const MatrixArray& matrix) { light.light_to_world = to_matrix(matrix); })
        .def_prop_ro("diffuse", [](const Light& light) { return light.multipliers[int(LightComponent::diffuse)]; })
        .def_prop_ro("specular", [](const Light& light) { return light.multipliers[int(LightComponent::specular)]; })
        .def_prop_ro("translucency",
                     [](const Light& light) { return light.multipliers[int(LightComponent::translucency)]; })
        .def_prop_ro("refraction",
                     [](const Light& light) { return light.multipliers[int(LightComponent::refraction)]; })
        .def_prop_ro("volume", [](const Light& light) { return light.multipliers[int(LightComponent::volume)]; })
        .def("__repr__", [](const Light& light) {
            constexpr const char* kShapes[] = {"dome", "distant", "rect", "disk", "sphere", "cylinder"};
            return str("Light(", light.path, ", ", kShapes[light.shape.index()], ", radiance=(", light.radiance.x, ", ",
                       light.radiance.y, ", ", light.radiance.z, "))");
        });
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
    bind_lights(module);
    bind_camera(module);

    nb::class_<Material>(module, "Material", "A named model of the scene.")
        .def_ro("path", &Material::path)
        .def_prop_ro("model", [](Material& material) { return material.model; })
        .def("__repr__", [](const Material& material) { return str("Material(", material.path, ")"); });

    nb::class_<Object>(module, "Object", "A mesh with a material, placed in the world.")
        .def_ro("path", &Object::path)
        .def_ro("mesh", &Object::mesh)
        .def_ro("material", &Object::material)
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
            [](Scene& scene, const std::string& path, int mesh, int material,
               const std::optional<MatrixArray>& matrix) {
                scene.objects.push_back({path, check_index(mesh, scene.meshes.size(), path, "mesh"),
                                         check_index(material, scene.materials.size(), path, "material"),
                                         to_matrix_or_identity(matrix)});
                return int(scene.objects.size()) - 1;
            },
            "path"_a, "mesh"_a, "material"_a, "matrix"_a = nb::none(),
            "Place a mesh by a (4, 4) float64 matrix for row vectors, None = identity; the object's index.")
        .def(
            "add_light",
            [](Scene& scene, const Light& light) {
                scene.lights.push_back(light);
                return int(scene.lights.size()) - 1;
            },
            "light"_a, "Add a light (copied); its index.")
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
        .def("__repr__", [](const Scene& scene) {
            return str("Scene(", scene.objects.size(), " objects, ", scene.meshes.size(), " meshes, ",
                       scene.materials.size(), " materials, ", scene.lights.size(), " lights)");
        });
}

}  // namespace frazil
