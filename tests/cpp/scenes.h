// Small scenes that several tests render, and how they read the film.
#pragma once

#include <doctest/doctest.h>

#include "frazil/render/render.h"
#include "shapes.h"

namespace frazil::test {

inline Light dome(const Rgb& radiance, const std::string& group = "") {
    Light light;
    light.path = "/dome";
    light.group = group;
    light.shape = DomeLight{};
    light.radiance = radiance;
    return light;
}

inline Light rect_above(float radiance, const std::string& group) {
    Light light;
    light.path = "/rect";
    light.group = group;
    light.shape = RectLight{2.0f, 2.0f};
    light.radiance = Rgb(radiance);
    light.light_to_world.rotate(V3f(-kPi / 2.0f, 0.0f, 0.0f));
    light.light_to_world[3][1] = 3.0f;
    return light;
}

inline Scene scene_of(Mesh mesh, const Material& material) {
    Scene scene;
    scene.meshes = {std::move(mesh)};
    scene.mesh_paths = {"/shape"};
    scene.materials = {material};
    scene.objects = {{"/shape", 0, 0, M44f()}};
    scene.camera.path = "/camera";
    scene.camera.horizontal_aperture = scene.camera.vertical_aperture = 20.0f;
    scene.camera.camera_to_world.translate(V3f(0.0f, 0.0f, 6.0f));
    return scene;
}

inline Material ice(const Rgb& sigma_a, float eta, float roughness, CompensationMode mode) {
    IceMaterial model;
    model.medium = {Rgb(20.0f), sigma_a, eta};
    model.roughness.value = roughness;
    model.compensation.mode = mode;
    model.spacing.value = 0.04f;
    return {"/ice", model};
}

inline RenderOptions small() {
    RenderOptions options;
    options.width = options.height = 24;
    options.samples = 16;
    options.filter = PixelFilter::box;
    options.threads = 2;
    return options;
}

inline const float* pixel(const Film& film, const char* layer, int x, int y) {
    const Layer& found = film.layers.at(layer);
    return &found.pixels[(std::size_t(y) * film.width + x) * found.channels];
}

// Mean of a layer's channel over pixels that the object fills.
inline double mean_inside(const Film& film, const char* layer, int channel) {
    double sum = 0.0;
    int count = 0;
    for (int y = 0; y < film.height; ++y) {
        for (int x = 0; x < film.width; ++x) {
            if (pixel(film, "beauty", x, y)[3] < 1.0f) continue;
            sum += pixel(film, layer, x, y)[channel];
            ++count;
        }
    }
    REQUIRE(count > 20);
    return sum / count;
}

}  // namespace frazil::test
