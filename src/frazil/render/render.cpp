#include "frazil/render/render.h"

#include <algorithm>
#include <array>
#include <atomic>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/render/path.h"
#include "frazil/render/stopwatch.h"

namespace frazil {
namespace {

constexpr int kTileSize = 16;          // pixels along a side
constexpr int kSamplesPerGather = 32;  // samples of a tile that share one gather: bounds its memory
constexpr std::array<const char*, kComponentCount> kComponentNames = {"translucency", "diffuse", "specular", "emission",
                                                                      "background"};

void check_options(const RenderOptions& options) {
    const auto require = [](bool holds, const char* rule, double value) {
        if (!holds) throw ValueError(str("render: ", rule, ", got ", value, "."));
    };
    require(options.width >= 1 && options.width <= 65536, "width must be in 1..65536", options.width);
    require(options.height >= 1 && options.height <= 65536, "height must be in 1..65536", options.height);
    require(options.samples >= 1, "samples must be >= 1", options.samples);
    require(options.bake_samples >= 1, "bake_samples must be >= 1", options.bake_samples);
    require(options.bake_bounces >= 0, "bake_bounces must be >= 0", options.bake_bounces);
    require(options.max_bounces >= 0, "max_bounces must be >= 0", options.max_bounces);
    require(options.threads >= 0, "threads must be >= 0", options.threads);
    require(std::isfinite(options.spacing) && options.spacing >= 0.0f, "spacing must be >= 0", options.spacing);
    require(std::isfinite(options.spacing_scale) && options.spacing_scale > 0.0f, "spacing_scale must be > 0",
            options.spacing_scale);
    require(std::isfinite(options.gather.tolerance) && options.gather.tolerance > 0.0f, "tolerance must be > 0",
            options.gather.tolerance);
}

// Offsets in pixels distributed as the filter, so that every pixel is an independent average.
class FilterSampler {
  public:
    explicit FilterSampler(PixelFilter filter) : filter_(filter) {
        // Cumulative Blackman-Harris window over its width.
        double total = 0.0;
        for (int i = 0; i < kSize; ++i) {
            const double x = 2.0 * M_PI * (i + 0.5) / kSize;
            total += 0.35875 - 0.48829 * std::cos(x) + 0.14128 * std::cos(2.0 * x) - 0.01168 * std::cos(3.0 * x);
            cdf_[i + 1] = static_cast<float>(total);
        }
        for (float& value : cdf_) value /= static_cast<float>(total);
    }

    float offset(float u) const {
        if (filter_ == PixelFilter::box) return u - 0.5f;
        const auto above = std::upper_bound(cdf_.begin() + 1, cdf_.end() - 1, u);
        const auto bin = static_cast<int>(above - cdf_.begin()) - 1;
        const float inside = (u - cdf_[bin]) / (cdf_[bin + 1] - cdf_[bin]);
        return kBlackmanHarrisWidth * ((static_cast<float>(bin) + inside) / kSize - 0.5f);
    }

  private:
    static constexpr int kSize = 256;
    static constexpr float kBlackmanHarrisWidth = 3.0f;  // pixels
    PixelFilter filter_;
    std::array<float, kSize + 1> cdf_{};
};

// The film's layers while tiles are written into them. Tiles own disjoint pixels, so no lock is needed.
class FilmWriter {
  public:
    FilmWriter(int width, int height, const std::vector<std::string>& groups) : group_count_(groups.size()) {
        film_.width = width;
        film_.height = height;
        for (const Aov& aov : aov_table()) add_layer(std::string(aov.name), aov.channels.size());
        for (const char* component : kComponentNames) {
            component_pixels_.push_back(pixels(component));
            if (group_count_ < 2) continue;
            for (const std::string& group : groups) {
                const std::string name = str(component, "_", group.empty() ? "default" : group);
                add_layer(name, 3);
                group_pixels_.push_back(pixels(name));
            }
        }
        beauty_ = pixels("beauty"), depth_ = pixels("Z"), object_id_ = pixels("object_id");
        normal_ = pixels("N"), position_ = pixels("P"), coverage_ = pixels("coverage");
    }

    // Average the samples of one pixel; the beauty is the sum of what was written to the additive layers.
    void write(const Tile& tile, std::size_t tile_pixel, std::size_t film_pixel, int samples) {
        const float scale = 1.0f / static_cast<float>(samples);
        Rgb beauty(0.0f);
        for (std::size_t component = 0; component < kComponentCount; ++component) {
            Rgb sum(0.0f);
            for (std::size_t group = 0; group < group_count_; ++group) {
                const Rgb light = tile.light(tile_pixel, component, group) * scale;
                sum += light;
                if (group_count_ > 1) set(group_pixels_[component * group_count_ + group], film_pixel, light);
            }
            set(component_pixels_[component], film_pixel, sum);
            beauty += sum;
        }
        const std::uint32_t hits = tile.hits(tile_pixel);
        float* pixel = beauty_ + 4 * film_pixel;
        pixel[0] = beauty.x, pixel[1] = beauty.y, pixel[2] = beauty.z, pixel[3] = static_cast<float>(hits) * scale;

        const PrimaryHit& nearest = tile.nearest(tile_pixel);
        set(normal_, film_pixel, hits ? tile.normal(tile_pixel) / static_cast<float>(hits) : V3f(0.0f));
        set(position_, film_pixel, nearest.position);
        set(coverage_, film_pixel, tile.coverage(tile_pixel) * scale);
        depth_[film_pixel] = nearest.depth;
        object_id_[film_pixel] = static_cast<float>(nearest.object_id);
    }

    Film take() { return std::move(film_); }

  private:
    void add_layer(const std::string& name, std::size_t channels) {
        Layer& layer = film_.layers[name];
        layer.channels = static_cast<int>(channels);
        layer.pixels.resize(std::size_t(film_.width) * film_.height * channels);
    }
    float* pixels(const std::string& name) { return film_.layers.at(name).pixels.data(); }
    static void set(float* layer, std::size_t film_pixel, const V3f& value) {
        float* pixel = layer + 3 * film_pixel;
        pixel[0] = value.x, pixel[1] = value.y, pixel[2] = value.z;
    }

    std::size_t group_count_;
    Film film_;
    std::vector<float*> component_pixels_, group_pixels_;  // by component; by component and group
    float *beauty_, *depth_, *object_id_, *normal_, *position_, *coverage_;
};

std::vector<std::size_t> groups_of(const std::vector<Light>& lights, const std::vector<std::string>& groups) {
    std::vector<std::size_t> result;
    for (const Light& light : lights) {
        result.push_back(std::find(groups.begin(), groups.end(), light.group) - groups.begin());
    }
    return result;
}

RenderResult render_in_arena(const Scene& scene, const RenderOptions& options, Progress* progress) {
    RenderStats stats;
    Stopwatch scene_watch(stats.seconds["scene"]);
    std::vector<Placement> placements;
    placements.reserve(scene.objects.size());
    for (const Object& object : scene.objects) placements.push_back({object.mesh, object.local_to_world});
    const RayScene ray_scene(scene.meshes, placements);
    const LightSampler lights(scene.lights);
    scene_watch.stop();

    const auto bodies = make_bodies(scene, ray_scene, lights, options, stats, progress);

    Stopwatch render_watch(stats.seconds["render"]);
    std::vector<std::string> groups = light_groups(scene.lights);
    if (groups.empty()) groups.push_back("");
    const std::vector<std::size_t> group_of_light = groups_of(scene.lights, groups);
    const PathTracer tracer(scene, ray_scene, lights, bodies, group_of_light, options.max_bounces);
    const FilterSampler filter(options.filter);
    FilmWriter film(options.width, options.height, groups);

    V3f view_axis;
    scene.camera.camera_to_world.multDirMatrix(V3f(0.0f, 0.0f, -1.0f), view_axis);
    view_axis.normalize();
    const float aspect = static_cast<float>(options.width) / static_cast<float>(options.height);
    const int tiles_x = (options.width + kTileSize - 1) / kTileSize;
    const int tiles_y = (options.height + kTileSize - 1) / kTileSize;
    const std::size_t tiles = std::size_t(tiles_x) * tiles_y;
    std::atomic<std::uint64_t> rays = 0, gathers = 0, dropped = 0, done = 0;

    parallel_for(tiles, 1, [&](std::size_t index, std::size_t) {
        const int x0 = static_cast<int>(index % tiles_x) * kTileSize,
                  y0 = static_cast<int>(index / tiles_x) * kTileSize;
        const int x1 = std::min(x0 + kTileSize, options.width), y1 = std::min(y0 + kTileSize, options.height);
        Tile tile(kTileSize * kTileSize, groups.size());
        for (int first = 0; first < options.samples; first += kSamplesPerGather) {
            const int last = std::min(first + kSamplesPerGather, options.samples);
            for (int y = y0; y < y1; ++y) {
                for (int x = x0; x < x1; ++x) {
                    const auto tile_pixel = static_cast<std::uint32_t>((y - y0) * kTileSize + x - x0);
                    const auto film_pixel = static_cast<std::uint32_t>(y * options.width + x);
                    for (int sample = first; sample < last; ++sample) {
                        Sampler sampler(options.seed, film_pixel, static_cast<std::uint32_t>(sample));
                        const V2f u = sampler.next_2d();
                        const float image_x = (x + 0.5f + filter.offset(u.x)) / options.width;
                        const float image_y = (y + 0.5f + filter.offset(u.y)) / options.height;
                        tracer.trace(camera_ray(scene.camera, image_x, image_y, aspect), view_axis, sampler, tile_pixel,
                                     tile);
                    }
                }
            }
            gathers += tile.requests.size();
            tracer.gather(options.gather, tile);
        }
        for (int y = y0; y < y1; ++y) {
            for (int x = x0; x < x1; ++x) {
                film.write(tile, std::size_t(y - y0) * kTileSize + (x - x0), std::size_t(y) * options.width + x,
                           options.samples);
            }
        }
        rays += tile.rays;
        dropped += tile.dropped_samples;
        const std::uint64_t finished = ++done;
        if (progress) progress->update("render", static_cast<double>(finished) / static_cast<double>(tiles));
    });
    render_watch.stop();

    stats.camera_rays = std::uint64_t(options.width) * options.height * options.samples;
    stats.other_rays = rays - std::min<std::uint64_t>(rays, stats.camera_rays);
    stats.gathers = gathers;
    stats.dropped_samples += dropped;
    return {film.take(), std::move(stats)};
}

}  // namespace

RenderResult render(const Scene& scene, const RenderOptions& options, Progress* progress) {
    check_options(options);
    check_scene(scene);
    return with_threads(options.threads, [&] { return render_in_arena(scene, options, progress); });
}

}  // namespace frazil
