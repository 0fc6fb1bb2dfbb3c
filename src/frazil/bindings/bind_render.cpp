#include <nanobind/stl/map.h>
#include <nanobind/stl/pair.h>
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
        row["is_default"] = aov.is_default;
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

nb::list knots_of(const Film& film) {
    nb::list knots;
    const auto list = [](const Rgb& c) { return nb::make_tuple(c.x, c.y, c.z); };
    for (const RampKnot& knot : film.knots) {
        nb::dict row;
        row["material"] = knot.material;
        row["distance"] = knot.distance;
        row["color"] = list(knot.color);
        row["share"] = list(knot.share);
        row["preserves_energy"] = knot.preserves_energy;
        row["is_fixed"] = knot.is_fixed;
        knots.append(row);
    }
    return knots;
}

nb::list compensations_of(const Film& film) {
    nb::list rows;
    for (const RenderedCompensation& rendered : film.compensations) {
        nb::dict row;
        row["material"] = rendered.material;
        row["mode"] = compensation_name(rendered.compensation.mode);
        row["strength"] = rendered.compensation.strength;
        rows.append(row);
    }
    return rows;
}

nb::list overlays_of(const Film& film) {
    nb::list rows;
    for (const RenderedOverlay& overlay : film.overlays) {
        nb::dict row;
        row["name"] = overlay.name;
        row["material"] = overlay.material;
        row["opacity"] = overlay.opacity;
        row["age"] = overlay.age;
        row["age_begin"] = overlay.age_begin;
        row["age_end"] = overlay.age_end;
        rows.append(row);
    }
    return rows;
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

// Tells Python how far the core is, and hears from it whether to stop.
// A Python error (Ctrl-C among them) stops the job and is raised once the threads are home.
class Reporter {
  public:
    explicit Reporter(nb::object report)
        : report_(std::move(report)),
          progress_([this](const char* stage, double fraction) { tell(stage, fraction); },
                    [this] { return is_stopped(); }) {}

    // Run work(progress) without the GIL.
    template <class Work>
    auto run(const Work& work) {
        try {
            const nb::gil_scoped_release no_gil;
            return work(&progress_);
        } catch (const Cancelled&) {
            if (python_error_) std::rethrow_exception(python_error_);
            throw;
        }
    }

    // Call back into Python from any thread; an error there stops the job.
    template <class Call>
    void call(const Call& call) {
        const nb::gil_scoped_acquire gil;
        try {
            call();
        } catch (...) {
            if (!python_error_) python_error_ = std::current_exception();
        }
    }

  private:
    void tell(const char* stage, double fraction) {
        if (report_.is_none() || python_error_) return;
        call([&] { report_(stage, fraction); });
    }
    bool is_stopped() {
        if (python_error_) return true;
        call([] {
            if (PyErr_CheckSignals() != 0) throw nb::python_error();
        });
        return python_error_ != nullptr;
    }

    nb::object report_;
    std::exception_ptr python_error_;
    Progress progress_;
};

nb::dict state_of(const FilmState& state) {
    nb::dict result;
    for (const auto& [name, values] : state) {
        // A copy: what is written must not change while the render goes on.
        auto* copy = new std::vector<float>(values.begin(), values.end());
        const nb::capsule owner(copy, [](void* memory) noexcept { delete static_cast<std::vector<float>*>(memory); });
        result[name.c_str()] = view(copy->data(), {copy->size()}, owner);
    }
    return result;
}

RenderResult render_from_python(const Scene& scene, const RenderOptions& options, nb::object progress,
                                const Bake* baked, nb::object checkpoint, double checkpoint_seconds,
                                const std::optional<std::map<std::string, FloatArray>>& resume) {
    Reporter reporter(std::move(progress));
    FilmState saved;
    if (resume) {
        for (const auto& [name, array] : *resume) saved[name] = {const_cast<float*>(array.data()), array.size()};
    }
    Checkpoints checkpoints;
    checkpoints.every_seconds = checkpoint_seconds;
    if (!checkpoint.is_none()) {
        checkpoints.save = [&](const FilmState& state) { reporter.call([&] { checkpoint(state_of(state)); }); };
    }
    if (resume) checkpoints.resume_from = &saved;
    return reporter.run([&](Progress* report) { return render(scene, options, report, baked, &checkpoints); });
}

BakeResult bake_from_python(const Scene& scene, const RenderOptions& options, const Bake* known, nb::object progress) {
    Reporter reporter(std::move(progress));
    return reporter.run([&](Progress* report) { return bake(scene, options, known ? *known : Bake{}, report); });
}

void bind_options(nb::module_& module) {
    nb::class_<RenderOptions>(module, "RenderOptions", "What a render is asked for; see frazil.render for each.")
        .def(nb::init<>())
        .def_rw("width", &RenderOptions::width)
        .def_rw("height", &RenderOptions::height)
        .def_rw("samples", &RenderOptions::samples)
        .def_rw("noise", &RenderOptions::noise)
        .def_rw("shading_samples", &RenderOptions::shading_samples)
        .def_rw("min_samples", &RenderOptions::min_samples)
        .def_rw("seed", &RenderOptions::seed)
        .def_rw("threads", &RenderOptions::threads)
        .def_rw("max_bounces", &RenderOptions::max_bounces)
        .def_rw("spacing", &RenderOptions::spacing)
        .def_rw("spacing_scale", &RenderOptions::spacing_scale)
        .def_rw("spacing_pixels", &RenderOptions::spacing_pixels)
        .def_rw("bake_samples", &RenderOptions::bake_samples)
        .def_rw("bake_error", &RenderOptions::bake_error)
        .def_rw("translucent_shadows", &RenderOptions::translucent_shadows)
        .def_rw("bake_bounces", &RenderOptions::bake_bounces)
        .def_rw("aovs", &RenderOptions::aovs)
        .def_rw("lpes", &RenderOptions::lpes)
        .def_rw("mattes", &RenderOptions::mattes)
        .def_prop_rw(
            "tolerance", [](const RenderOptions& self) { return self.gather.tolerance; },
            [](RenderOptions& self, float tolerance) { self.gather.tolerance = tolerance; })
        .def_prop_rw(
            "estimator",
            [](const RenderOptions& self) { return self.gather.estimator == Estimator::sum ? "sum" : "noise_free"; },
            [](RenderOptions& self, const std::string& name) { self.gather.estimator = estimator_named(name); })
        .def_prop_rw(
            "filter",
            [](const RenderOptions& self) { return self.filter == PixelFilter::box ? "box" : "blackman_harris"; },
            [](RenderOptions& self, const std::string& name) { self.filter = filter_named(name); });
}

void bind_bake(nb::module_& module) {
    nb::class_<Bake>(module, "Bake",
                     "Points and light of every translucent body of a scene: what serves all cameras and frames that\n"
                     "show the same shapes under the same lights.")
        .def(nb::init<>(), "A bake of nothing.")
        .def_ro("groups", &Bake::groups, "The light groups.")
        .def(
            "__len__", [](const Bake& bake) { return bake.bodies.size(); }, "Objects of the scene.")
        .def(
            "points",
            [](const Bake& bake, std::size_t index) {
                if (index >= bake.bodies.size()) throw nb::index_error();
                return bake.bodies[index].points.in_world();
            },
            "index"_a, "A copy of the PointSet of an object, in the world; empty where it is not ice.")
        .def(
            "irradiance",
            [](nb::handle self, std::size_t index) {
                Bake& bake = nb::cast<Bake&>(self);
                if (index >= bake.bodies.size()) throw nb::index_error();
                LitPoints& lit = bake.bodies[index];
                return view(&lit.irradiance.data()->x, {lit.points.size(), bake.groups.size(), 3}, self);
            },
            "index"_a, "(N, G, 3) float32: light that enters an object's points, per light group.")
        .def(
            "moments",
            [](nb::handle self, std::size_t index) -> nb::object {
                Bake& bake = nb::cast<Bake&>(self);
                if (index >= bake.bodies.size()) throw nb::index_error();
                LitPoints& lit = bake.bodies[index];
                if (lit.moments.empty()) return nb::none();
                return nb::cast(view(&lit.moments.data()->x, {lit.points.size(), bake.groups.size(), 3}, self));
            },
            "index"_a,
            "(N, G, 3) float32: covariance of the light, summed over channels, with the place in each point's cell;\n"
            "None where light was baked at the points alone.")
        .def(
            "append",
            [](Bake& bake, const PointSet& points, const FloatArray& irradiance, std::optional<FloatArray> moments) {
                if (irradiance.ndim() != 3 || irradiance.shape(0) != points.size() ||
                    irradiance.shape(1) != bake.groups.size() || irradiance.shape(2) != 3) {
                    throw ValueError(
                        str("Bake: irradiance must be of shape (", points.size(), ", ", bake.groups.size(), ", 3)."));
                }
                const auto* values = reinterpret_cast<const Rgb*>(irradiance.data());
                LitPoints& lit = bake.bodies.emplace_back();
                if (points.size() > 0) lit.points = PlacedPoints(points);
                lit.irradiance.assign(values, values + points.size() * bake.groups.size());
                if (!moments) return;
                if (moments->size() != irradiance.size()) {
                    throw ValueError("Bake: moments must be of the shape of irradiance, or None.");
                }
                const auto* first = reinterpret_cast<const V3f*>(moments->data());
                lit.moments.assign(first, first + lit.irradiance.size());
            },
            "points"_a, "irradiance"_a, "moments"_a = nb::none(), "Add the next object (copied).")
        .def(
            "__init__",
            [](Bake* self, std::vector<std::string> groups) {
                new (self) Bake{std::move(groups), {}};
            },
            "groups"_a, "A bake of these light groups, without objects yet.");
}

}  // namespace

void bind_render(nb::module_& module) {
    bind_options(module);
    bind_bake(module);
    nb::class_<RenderResult>(module, "RenderResult", "What a render gives: layers and statistics.")
        .def_prop_ro(
            "layers", [](nb::handle self) { return layers_of(nb::cast<RenderResult&>(self), self); },
            "dict of AOV or layer name to (height, width, channels) float32; views of the film's own memory.")
        .def_prop_ro(
            "light_groups", [](const RenderResult& self) { return self.film.groups; },
            "list of str: in the order of the layers; '' for lights without a group.")
        .def_prop_ro(
            "ramp_knots", [](const RenderResult& self) { return knots_of(self.film); },
            "list of dict, one per layer translucency_ramp<K>: material, distance (metres), color, share of energy, "
            "...")
        .def_prop_ro(
            "compensations", [](const RenderResult& self) { return compensations_of(self.film); },
            "list of dict, one per material of ice: material, mode, strength.")
        .def_prop_ro(
            "overlays", [](const RenderResult& self) { return overlays_of(self.film); },
            "list of dict, one per overlay that has layers: name, material, opacity, age, age_begin, age_end.")
        .def_prop_ro(
            "stats", [](const RenderResult& self) { return stats_of(self.stats); },
            "dict: points, nodes, rays, gathers, dropped samples, seconds per stage.");
    nb::class_<BakeResult>(module, "BakeResult", "What a bake gives: itself and statistics.")
        .def_ro("bake", &BakeResult::bake)
        .def_prop_ro(
            "stats", [](const BakeResult& self) { return stats_of(self.stats); }, "As of a render.");
    module.def("aov_table", &aov_rows, "The AOV table: a list of dicts (name, channels, meaning, filter, ...).");
    module.def("render", &render_from_python, "scene"_a, "options"_a, nb::kw_only(), "progress"_a = nb::none(),
               "bake"_a = nb::none(), "checkpoint"_a = nb::none(), "checkpoint_seconds"_a = 0.0,
               "resume"_a = nb::none(),
               "Render a scene; see frazil.render. progress(stage, fraction) is called now and then from any thread;\n"
               "an exception that it raises stops the render. checkpoint(state) gets a dict of float32 arrays every\n"
               "checkpoint_seconds (0: never) and when the render is stopped; `resume` takes such a dict.");
    module.def(
        "bake", &bake_from_python, "scene"_a, "options"_a, nb::kw_only(), "known"_a = nb::none(),
        "progress"_a = nb::none(),
        "Points and light of a scene's translucent bodies; what is `known` (points of objects that have some, light\n"
        "of the groups that are named) is taken over.");
}

}  // namespace frazil
