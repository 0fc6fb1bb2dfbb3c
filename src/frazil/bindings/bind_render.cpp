#include <nanobind/stl/map.h>
#include <nanobind/stl/string_view.h>

#include <atomic>

#include "frazil/bindings/bindings.h"
#include "frazil/render/render.h"

namespace frazil {
namespace {

nb::list aov_rows() {
    nb::list rows;
    for (const Aov& aov : aov_table()) {
        nb::dict row;
        row["name"] = aov.name;
        row["channels"] = aov.channels;
        row["meaning"] = aov.meaning;
        row["filter"] = aov.filter == AovFilter::average ? "average" : "nearest";
        row["is_additive"] = aov.is_additive;
        row["is_half"] = aov.is_half;
        rows.append(row);
    }
    return rows;
}

PixelFilter filter_named(const std::string& name) {
    if (name == "box") return PixelFilter::box;
    if (name == "blackman_harris") return PixelFilter::blackman_harris;
    throw ValueError(str("render: filter must be box or blackman_harris, got '", name, "'."));
}

nb::dict layers_of(RenderResult& result, nb::handle owner) {
    nb::dict layers;
    const auto height = static_cast<std::size_t>(result.film.height),
               width = static_cast<std::size_t>(result.film.width);
    for (auto& [name, layer] : result.film.layers) {
        layers[name.c_str()] = view(layer.pixels.data(), {height, width, std::size_t(layer.channels)}, owner);
    }
    return layers;
}

nb::dict stats_of(const RenderStats& stats) {
    nb::dict result;
    result["points"] = stats.points;
    result["nodes"] = stats.nodes;
    result["camera_rays"] = stats.camera_rays;
    result["other_rays"] = stats.other_rays;
    result["bake_rays"] = stats.bake_rays;
    result["gathers"] = stats.gathers;
    result["dropped_samples"] = stats.dropped_samples;
    result["seconds"] = stats.seconds;
    result["warnings"] = stats.warnings;
    return result;
}

// Render without the GIL; take it back for each progress report, where Ctrl-C is seen too.
RenderResult render_from_python(const Scene& scene, int width, int height, int samples, std::uint32_t seed, int threads,
                                const std::string& filter, int max_bounces, float spacing, float spacing_scale,
                                int bake_samples, int bake_bounces, float tolerance, const std::string& estimator,
                                nb::object progress) {
    RenderOptions options;
    options.width = width;
    options.height = height;
    options.samples = samples;
    options.seed = seed;
    options.threads = threads;
    options.filter = filter_named(filter);
    options.max_bounces = max_bounces;
    options.spacing = spacing;
    options.spacing_scale = spacing_scale;
    options.bake_samples = bake_samples;
    options.bake_bounces = bake_bounces;
    options.gather = {tolerance, estimator_named(estimator)};

    // A Python error (Ctrl-C among them) stops the render and is raised once the threads are home.
    std::exception_ptr python_error;
    Progress reporter(
        [&](const char* stage, double fraction) {
            if (progress.is_none() || python_error) return;
            const nb::gil_scoped_acquire gil;
            try {
                progress(stage, fraction);
            } catch (...) {
                python_error = std::current_exception();
            }
        },
        [&] {
            if (python_error) return true;
            const nb::gil_scoped_acquire gil;
            try {
                if (PyErr_CheckSignals() != 0) throw nb::python_error();
            } catch (...) {
                python_error = std::current_exception();
            }
            return python_error != nullptr;
        });
    try {
        const nb::gil_scoped_release no_gil;
        return render(scene, options, &reporter);
    } catch (const Cancelled&) {
        if (python_error) std::rethrow_exception(python_error);
        throw;
    }
}

}  // namespace

void bind_render(nb::module_& module) {
    nb::class_<RenderResult>(module, "RenderResult", "What a render gives: layers and statistics.")
        .def_prop_ro(
            "layers", [](nb::handle self) { return layers_of(nb::cast<RenderResult&>(self), self); },
            "dict of AOV or layer name to (height, width, channels) float32; views of the film's own memory.")
        .def_prop_ro(
            "stats", [](const RenderResult& self) { return stats_of(self.stats); },
            "dict: points, nodes, rays, gathers, dropped samples, seconds per stage.");
    module.def("aov_table", &aov_rows, "The AOV table: a list of dicts (name, channels, meaning, filter, ...).");
    module.def("render", &render_from_python, "scene"_a, nb::kw_only(), "width"_a = 960, "height"_a = 540,
               "samples"_a = 32, "seed"_a = 0, "threads"_a = 0, "filter"_a = "blackman_harris", "max_bounces"_a = 4,
               "spacing"_a = 0.0f, "spacing_scale"_a = 1.0f, "bake_samples"_a = 64, "bake_bounces"_a = 1,
               "tolerance"_a = 0.01f, "estimator"_a = "noise_free", "progress"_a = nb::none(),
               "Render a scene; see frazil.render. progress(stage, fraction) is called now and then from any thread;\n"
               "an exception that it raises stops the render.");
}

}  // namespace frazil
