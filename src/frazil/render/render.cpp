#include "frazil/render/render.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>
#include <optional>
#include <shared_mutex>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/lighting/group_balance.h"
#include "frazil/render/buried_lights.h"
#include "frazil/render/film_layout.h"
#include "frazil/render/film_sums.h"
#include "frazil/render/gathering.h"
#include "frazil/render/inside_out.h"
#include "frazil/render/motion.h"
#include "frazil/render/openness.h"
#include "frazil/render/overlay_layers.h"
#include "frazil/render/path.h"
#include "frazil/render/receivers.h"
#include "frazil/render/stopwatch.h"

namespace frazil {
namespace {

constexpr int kTileSize = 16;                   // pixels along a side
constexpr std::uint32_t kCameraDimensions = 1;  // of the sampler, pairs
// Memory for gathers at the points of all bodies; bodies that it does not suffice for are gathered wherever they are seen.
constexpr std::size_t kMostPointGathers = std::size_t(1) << 30;
// Samples of a pass: those of a tile share one gather, which bounds its memory; with a noise target passes are shorter, where
// few samples are shaded they are longer.
constexpr int kSamplesPerPass = 32, kSamplesPerNoisePass = 16, kMostSamplesPerPass = 128;
constexpr int kOpennessRays = 2, kMostOpennessRays = 1 << 20;  // at a point, times its shadow rays

std::vector<std::size_t> groups_of(const std::vector<Light>& lights, const std::vector<std::string>& groups) {
    std::vector<std::size_t> result;
    for (const Light& light : lights) {
        result.push_back(std::find(groups.begin(), groups.end(), light.group) - groups.begin());
    }
    return result;
}

RayScene make_ray_scene(const Scene& scene, const RenderOptions& options, RenderStats& stats) {
    Stopwatch watch(stats.seconds["scene"]);
    std::vector<Placement> placements;
    placements.reserve(scene.objects.size());
    for (const Object& object : scene.objects) placements.push_back({object.mesh, object.local_to_world});
    RayScene ray_scene(scene.meshes, placements);
    if (options.translucent_shadows) ray_scene.set_passages(passages_of(scene));
    return ray_scene;
}

// The picture in the making: its sums, and which tiles and pixels the running pass still has to serve.
class Canvas {
  public:
    Canvas(const RenderOptions& options, const FilmLayout& layout)
        : options_(options),
          sums_(options.width, options.height, layout),
          tiles_x_((options.width + kTileSize - 1) / kTileSize),
          tiles_y_((options.height + kTileSize - 1) / kTileSize),
          is_wanted_(std::size_t(options.width) * options.height, 1.0f),
          is_done_(std::size_t(tiles_x_) * tiles_y_, 0.0f) {}

    struct Region {
        int x0, y0, x1, y1;
    };
    Region region(std::size_t tile) const {
        const int x0 = static_cast<int>(tile % tiles_x_) * kTileSize,
                  y0 = static_cast<int>(tile / tiles_x_) * kTileSize;
        return {x0, y0, std::min(x0 + kTileSize, options_.width), std::min(y0 + kTileSize, options_.height)};
    }
    std::size_t film_pixel(int x, int y) const { return std::size_t(y) * options_.width + x; }
    std::size_t tile_count() const { return is_done_.size(); }

    // The samples [first, last) of a pixel in this pass.
    std::pair<int, int> samples(std::size_t film_pixel) const {
        if (is_wanted_[film_pixel] == 0.0f) return {0, 0};
        const int first = sums_.samples(film_pixel);
        return {first, std::min(first + samples_per_pass(), options_.samples)};
    }

    // The tiles that this pass still has to serve.
    std::vector<std::size_t> open_tiles() const {
        std::vector<std::size_t> open;
        for (std::size_t tile = 0; tile < tile_count(); ++tile) {
            if (is_done_[tile] == 0.0f && has_wanted_pixel(region(tile))) open.push_back(tile);
        }
        return open;
    }

    // Add what a pass has brought to a tile. Several threads may add different tiles.
    void add(const Tile& tile, std::size_t index) {
        const std::shared_lock<std::shared_mutex> lock(mutex_);
        const Region r = region(index);
        for (int y = r.y0; y < r.y1; ++y) {
            for (int x = r.x0; x < r.x1; ++x) {
                const auto [first, last] = samples(film_pixel(x, y));
                if (first == last) continue;
                sums_.add(tile, std::size_t(y - r.y0) * kTileSize + (x - r.x0), film_pixel(x, y), last - first);
            }
        }
        is_done_[index] = 1.0f;
    }

    // Go to the next pass; false where no pixel wants one.
    bool begin_next_pass() {
        std::fill(is_done_.begin(), is_done_.end(), 0.0f);
        const int least = std::min(options_.min_samples, options_.samples);
        std::vector<char> noisy;
        if (options_.noise > 0.0f) noisy = sums_.noisy_pixels(options_.noise, options_.samples);
        bool is_any_wanted = false;
        for (std::size_t i = 0; i < is_wanted_.size(); ++i) {
            const int samples = sums_.samples(i);
            is_wanted_[i] = samples < options_.samples && (samples < least || noisy.empty() || noisy[i]) ? 1.0f : 0.0f;
            is_any_wanted |= is_wanted_[i] != 0.0f;
        }
        return is_any_wanted;
    }

    // How much of the longest way to the end is behind.
    double fraction(std::uint64_t tiles_done) const {
        const double passes = std::ceil(double(options_.samples) / samples_per_pass());
        return std::min(1.0, static_cast<double>(tiles_done) / (passes * static_cast<double>(tile_count())));
    }

    void save(const Checkpoints& checkpoints) {
        const std::unique_lock<std::shared_mutex> lock(mutex_);
        checkpoints.save(state());
    }

    void resume(const FilmState& saved) {
        for (auto& [name, own] : state()) {
            const auto found = saved.find(name);
            if (found == saved.end() || found->second.size() != own.size()) {
                throw ValueError(str("checkpoint: ", name, " must have ", own.size(), " values, got ",
                                     found == saved.end() ? 0 : found->second.size(), ". Render without resuming."));
            }
            std::copy(found->second.begin(), found->second.end(), own.begin());
        }
    }

    Film finish() { return sums_.finish(); }

  private:
    int samples_per_pass() const {
        if (options_.noise > 0.0f) return kSamplesPerNoisePass;
        if (options_.shading_samples == 0) return kSamplesPerPass;
        // Samples that are not shaded ask for nothing.
        const auto per_pass = std::int64_t(kSamplesPerPass) * options_.samples / options_.shading_samples;
        return static_cast<int>(std::clamp<std::int64_t>(per_pass, kSamplesPerPass, kMostSamplesPerPass));
    }
    bool has_wanted_pixel(const Region& r) const {
        for (int y = r.y0; y < r.y1; ++y) {
            for (int x = r.x0; x < r.x1; ++x) {
                if (is_wanted_[film_pixel(x, y)] != 0.0f) return true;
            }
        }
        return false;
    }
    FilmState state() {
        FilmState result = sums_.state();
        result["pass.wanted"] = is_wanted_;
        result["pass.done"] = is_done_;
        return result;
    }

    const RenderOptions& options_;
    FilmSums sums_;
    int tiles_x_, tiles_y_;
    std::vector<float> is_wanted_;  // per pixel; 0 or 1, as the whole state is of floats
    std::vector<float> is_done_;    // per tile
    std::shared_mutex mutex_;       // shared by those that add, alone for the one that saves
};

// Saves the canvas at intervals, from whichever thread comes by when it is time.
class CheckpointClock {
  public:
    explicit CheckpointClock(const Checkpoints* checkpoints) : checkpoints_(checkpoints) {}

    void tick(Canvas& canvas) {
        if (!checkpoints_ || !checkpoints_->save || !(checkpoints_->every_seconds > 0.0)) return;
        const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
        if (!lock) return;
        const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - last_;
        if (passed.count() < checkpoints_->every_seconds) return;
        canvas.save(*checkpoints_);
        last_ = std::chrono::steady_clock::now();
    }

  private:
    const Checkpoints* checkpoints_;
    std::mutex mutex_;
    std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

// How many of a pixel's samples are shaded, and which subset they count in.
struct ShadingPlan {
    explicit ShadingPlan(const RenderOptions& options)
        : samples(options.samples),
          shaded(options.shading_samples),
          is_decoupled(shaded > 0 && shaded < samples),
          run(std::clamp(shaded / kSampleSubsets, 1, kSubsetRun)) {}

    // Of the first `count` samples.
    int before(int count) const { return static_cast<int>((std::int64_t(count) * shaded + samples - 1) / samples); }
    int subset(int index) const { return index / run % kSampleSubsets; }

    int samples, shaded;
    bool is_decoupled;
    int run;
};

// Trace and gather what this pass wants of a tile.
void render_tile(const Scene& scene, const RenderOptions& options, const PathTracer& tracer, const Gathering& gathering,
                 const V3f& view_axis, const FilterSampler& filter, const Canvas& canvas, std::size_t index,
                 Tile& tile) {
    const Canvas::Region r = canvas.region(index);
    const float aspect = static_cast<float>(options.width) / static_cast<float>(options.height);
    const ShadingPlan plan(options);
    thread_local std::vector<Ray> rays;
    thread_local std::vector<FirstHit> hits;
    thread_local std::vector<Sampler> samplers;
    thread_local std::vector<ShadedSample> shaded;
    for (int y = r.y0; y < r.y1; ++y) {
        for (int x = r.x0; x < r.x1; ++x) {
            const auto tile_pixel = static_cast<std::uint32_t>((y - r.y0) * kTileSize + x - r.x0);
            const auto film_pixel = static_cast<std::uint32_t>(canvas.film_pixel(x, y));
            const auto [first, last] = canvas.samples(film_pixel);
            rays.clear(), samplers.clear();
            for (int sample = first; sample < last; ++sample) {
                Sampler& sampler = samplers.emplace_back(options.seed, film_pixel, static_cast<std::uint32_t>(sample));
                const V2f u = sampler.next_2d();
                const float image_x = (x + 0.5f + filter.offset(u.x)) / options.width;
                const float image_y = (y + 0.5f + filter.offset(u.y)) / options.height;
                rays.push_back(camera_ray(scene.camera, image_x, image_y, aspect));
            }
            tile.camera_rays += rays.size();
            tracer.see(rays, hits, tile);
            for (std::size_t k = 0; plan.is_decoupled && k < hits.size(); ++k) {
                tracer.note_first(hits[k], view_axis, samplers[k], tile_pixel, tile);
            }
            if (!plan.is_decoupled) {
                for (int k = 0; k < last - first; ++k) {
                    tile.begin_shaded(tile_pixel, subset_of(first + k), 1.0f);
                    tracer.trace(hits[k], 1.0f, view_axis, samplers[k], tile_pixel, tile);
                }
                continue;
            }
            const int begin = plan.before(first), end = plan.before(last);
            choose_shaded(hits, end - begin, hash(options.seed, film_pixel, std::uint32_t(first)), shaded);
            for (int k = 0; k < static_cast<int>(shaded.size()); ++k) {
                // Numbers of their own sequence, so that what is shaded is stratified; more than planned take those that
                // no pass plans.
                const int index = k < end - begin ? begin + k : options.samples + first + k;
                Sampler sampler(options.seed, film_pixel, static_cast<std::uint32_t>(index));
                sampler.set_dimension(kCameraDimensions);
                const auto [sample, weight] = shaded[k];
                tile.begin_shaded(tile_pixel, plan.subset(k < end - begin ? index : k), weight);
                tracer.trace(hits[sample], weight, view_axis, sampler, tile_pixel, tile);
            }
        }
    }
    gathering.answer(options.gather, tile);
}

RenderResult render_in_arena(const Scene& scene, const RenderOptions& options, Progress* progress, const Bake* baked,
                             const Checkpoints* checkpoints) {
    RenderStats stats;
    const RayScene ray_scene = make_ray_scene(scene, options, stats);
    LightSampler lights(scene.lights);
    if (!baked) stats.warnings = warnings_of_buried_lights(scene, ray_scene, lights);
    const float aspect = static_cast<float>(options.width) / static_cast<float>(options.height);
    balance_groups(lights, ray_scene, receivers_in_view(scene.camera, aspect, ray_scene));
    std::vector<std::unique_ptr<Body>> bodies = make_bodies(scene);
    FilmLayout layout = make_layout(scene, bodies, options.aovs, options.lpes, options.mattes);
    const std::vector<std::string> groups = light_groups(scene.lights);
    std::optional<Openness> openness;
    const bool has_overlays = layout.has("overlay");
    const auto plant = [&](const std::vector<LitPoints>& lit, const std::function<void(std::size_t)>& has_taken) {
        const double paths = double(options.width) * options.height * options.samples;
        const TranslucencySets sets = plant_trees(scene, lit, groups.size(), ray_scene, layout.needs_depth(),
                                                  layout.needs_surface(), bodies, stats, has_taken);
        if (has_overlays) {
            Stopwatch watch(stats.seconds["tree"]);
            plant_overlay_trees(scene, lit, sets, layout.overlay_of, groups.size(), bodies);
        }
        add_gathers(sets, groups.size(), {paths, kMostPointGathers, options.gather, !layout.knots.empty()}, bodies,
                    stats);
        if (layout.has("occlusion") || layout.has("bent_normal")) {
            Stopwatch watch(stats.seconds["occlusion"]);
            const int at_a_point = options.bake_samples > 0 ? options.bake_samples : kBakeSamples;
            const int rays = std::min(kOpennessRays * at_a_point, kMostOpennessRays);
            openness.emplace(lit, ray_scene, rays, options.seed);
        }
    };
    if (baked) {
        check_bake(scene, *baked);
        plant(baked->bodies, [](std::size_t) {});
    } else {
        Bake bake = make_bake(scene, ray_scene, bodies, options, {}, stats, progress);
        plant(bake.bodies, [&](std::size_t object) {
            if (has_overlays) return;
            bake.bodies[object].irradiance = {};
            bake.bodies[object].moments = {};
        });
    }

    Stopwatch render_watch(stats.seconds["render"]);
    const std::vector<std::size_t> group_of_light = groups_of(scene.lights, layout.groups);
    const MotionVectors motion(scene, options.width, options.height);
    const PathTracer tracer(scene, ray_scene, lights, bodies, group_of_light, layout, options.max_bounces,
                            pixel_cone(scene.camera, options.width, options.height),
                            layout.has("motion") ? &motion : nullptr);
    const EnteringLight entering_light(ray_scene, lights, bodies, group_of_light);
    const Gathering gathering(scene, bodies, layout, &entering_light);
    for (const std::string& warning : tracer.warnings()) stats.warnings.push_back(warning);
    const FilterSampler filter(options.filter);
    V3f view_axis;
    scene.camera.camera_to_world.multDirMatrix(V3f(0.0f, 0.0f, -1.0f), view_axis);
    view_axis.normalize();

    for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (bodies[i]) layout.point_spacing[i] = bodies[i]->spacing;
    }
    Canvas canvas(options, layout);
    if (checkpoints && checkpoints->resume_from) canvas.resume(*checkpoints->resume_from);
    CheckpointClock clock(checkpoints);
    std::atomic<std::uint64_t> camera_rays = 0, rays = 0, gathers = 0, dropped = 0, done = 0;
    try {
        do {
            const std::vector<std::size_t> open = canvas.open_tiles();
            parallel_for(open.size(), 1, [&](std::size_t i, std::size_t) {
                Tile tile(kTileSize * kTileSize, layout.groups.size(), layout.plane_count(), layout.lpes.size(),
                          layout.mattes.size());
                tile.keeps_places = openness.has_value();
                render_tile(scene, options, tracer, gathering, view_axis, filter, canvas, open[i], tile);
                if (openness) openness->answer(tile);
                if (is_breaking_off()) return;
                canvas.add(tile, open[i]);
                camera_rays += tile.camera_rays;
                rays += tile.rays;
                gathers += tile.gathers;
                dropped += tile.dropped_samples;
                const std::uint64_t finished = ++done;
                clock.tick(canvas);
                if (progress) progress->update("render", canvas.fraction(finished));
            });
        } while (canvas.begin_next_pass());
    } catch (const Cancelled&) {
        if (checkpoints && checkpoints->save) canvas.save(*checkpoints);
        throw;
    }
    render_watch.stop();

    stats.camera_rays = camera_rays;
    stats.other_rays = rays - std::min<std::uint64_t>(rays, camera_rays);
    stats.gathers = gathers;
    stats.dropped_samples += dropped;
    return {canvas.finish(), std::move(stats)};
}

void drop_thinness(const Bake& bake) {
    for (const LitPoints& lit : bake.bodies) {
        if (lit.points.size() > 0) lit.points.cloud().drop_thinness();
    }
}

BakeResult bake_in_arena(const Scene& scene, const RenderOptions& options, Bake known, Progress* progress) {
    RenderStats stats;
    const RayScene ray_scene = make_ray_scene(scene, options, stats);
    stats.warnings = warnings_of_buried_lights(scene, ray_scene, LightSampler(scene.lights));
    const std::vector<std::unique_ptr<Body>> bodies = make_bodies(scene);
    Bake result = make_bake(scene, ray_scene, bodies, options, std::move(known), stats, progress);
    for (const LitPoints& lit : result.bodies) stats.points += lit.points.size();
    drop_thinness(result);
    return {std::move(result), std::move(stats)};
}

void add_warnings(RenderStats& stats, const std::vector<std::string>& more) {
    stats.warnings.insert(stats.warnings.end(), more.begin(), more.end());
}

}  // namespace

BakeResult bake(const Scene& scene, const RenderOptions& options, Bake known, Progress* progress) {
    check_options(options);
    check_scene(scene);
    const TurnedScene turned = turned_outwards(scene);
    const Scene& seen = turned.scene ? *turned.scene : scene;
    BakeResult result =
        with_threads(options.threads, [&] { return bake_in_arena(seen, options, std::move(known), progress); });
    add_warnings(result.stats, turned.warnings);
    return result;
}

RenderResult render(const Scene& scene, const RenderOptions& options, Progress* progress, const Bake* baked,
                    const Checkpoints* checkpoints) {
    check_options(options);
    check_scene(scene);
    const TurnedScene turned = turned_outwards(scene);
    const Scene& seen = turned.scene ? *turned.scene : scene;
    RenderResult result =
        with_threads(options.threads, [&] { return render_in_arena(seen, options, progress, baked, checkpoints); });
    add_warnings(result.stats, turned.warnings);
    return result;
}

}  // namespace frazil
