#include "frazil/render/film_sums.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"

namespace frazil {
namespace {

constexpr int kWindow = 2;  // pixels on each side over which noise is averaged
constexpr std::size_t kRowsPerChunk = 16;

void set(float* layer, std::size_t film_pixel, const V3f& value) {
    float* pixel = layer + 3 * film_pixel;
    pixel[0] = value.x, pixel[1] = value.y, pixel[2] = value.z;
}

void increase(float* layer, std::size_t film_pixel, const V3f& value) {
    float* pixel = layer + 3 * film_pixel;
    pixel[0] += value.x, pixel[1] += value.y, pixel[2] += value.z;
}

void scale(float* layer, std::size_t film_pixel, float factor) {
    for (int channel = 0; channel < 3; ++channel) layer[3 * film_pixel + channel] *= factor;
}

}  // namespace

FilmSums::FilmSums(int width, int height, const FilmLayout& layout) : layout_(layout) {
    film_.width = width;
    film_.height = height;
    film_.groups = layout.groups;
    film_.knots = layout.knots;
    film_.compensations = layout.compensations;
    film_.overlays = layout.overlays;
    for (const char* component : kComponentNames) components_.push_back(add_grouped(component));
    for (std::size_t p = 0; p < layout.plane_count(); ++p) planes_.push_back(add_grouped(layout.plane_name(p)));
    for (const std::string& name : layout.lpe_names) lpes_.push_back(add_layer(name, 3));
    for (const std::string& name : layout.mattes) {
        mattes_.push_back(add_layer("matte." + name, 1));
        refracted_mattes_.push_back(add_layer("refracted_matte." + name, 1));
    }
    beauty_ = utility("beauty"), depth_ = utility("Z"), object_id_ = utility("object_id");
    normal_ = utility("N"), position_ = utility("P"), coverage_ = utility("coverage"), albedo_ = utility("albedo");
    sample_count_ = utility("sample_count"), variance_ = utility("variance");
    uv_ = utility("uv"), local_position_ = utility("Pref"), material_id_ = utility("material_id");
    instance_id_ = utility("instance_id"), point_spacing_ = utility("point_spacing");
    lacking_ = utility("compensation_factor"), motion_ = utility("motion");
    occlusion_ = utility("occlusion"), bent_normal_ = utility("bent_normal");
    const std::size_t count = std::size_t(width) * height;
    id_slots_.assign(layout.ids.size(), std::vector<float>(count * kIdSlots * 2, 0.0f));
    std::fill(depth_, depth_ + count, std::numeric_limits<float>::infinity());
    samples_.assign(count, 0.0f);
    subsets_.assign(count * kSampleSubsets, 0.0f);
    subset_samples_.assign(count * kSampleSubsets, 0.0f);
}

float* FilmSums::add_layer(const std::string& name, std::size_t channels) {
    Layer& layer = film_.layers[name];
    layer.channels = static_cast<int>(channels);
    layer.pixels.resize(std::size_t(film_.width) * film_.height * channels);
    return layer.pixels.data();
}

FilmSums::GroupedLayer FilmSums::add_grouped(const std::string& name) {
    GroupedLayer layer;
    layer.whole = add_layer(name, 3);
    if (layout_.groups.size() < 2) return layer;
    for (std::size_t group = 0; group < layout_.groups.size(); ++group) {
        layer.parts.push_back(add_layer(layout_.group_name(name, group), 3));
    }
    return layer;
}

float* FilmSums::utility(const char* name) {
    return layout_.has(name) ? add_layer(name, find_aov(name)->channels.size()) : nullptr;
}

void FilmSums::increase_grouped(const GroupedLayer& layer, std::size_t film_pixel, const Rgb* groups) {
    if (layer.parts.empty()) return increase(layer.whole, film_pixel, groups[0]);
    for (std::size_t g = 0; g < layer.parts.size(); ++g) increase(layer.parts[g], film_pixel, groups[g]);
}

// The average over samples; the whole is the sum of what was written to the parts.
Rgb FilmSums::finish_grouped(const GroupedLayer& layer, std::size_t film_pixel, float factor) {
    const auto pixel = [&](const float* of) {
        return Rgb(of[3 * film_pixel], of[3 * film_pixel + 1], of[3 * film_pixel + 2]);
    };
    if (layer.parts.empty()) {
        scale(layer.whole, film_pixel, factor);
    } else {
        Rgb sum(0.0f);
        for (float* part : layer.parts) {
            scale(part, film_pixel, factor);
            sum += pixel(part);
        }
        set(layer.whole, film_pixel, sum);
    }
    return pixel(layer.whole);
}

void FilmSums::add(const Tile& tile, std::size_t tile_pixel, std::size_t film_pixel, int samples) {
    for (std::size_t component = 0; component < components_.size(); ++component) {
        increase_grouped(components_[component], film_pixel, &tile.light(tile_pixel, component, 0));
    }
    for (std::size_t p = 0; p < planes_.size(); ++p) {
        increase_grouped(planes_[p], film_pixel, tile.plane(tile_pixel, p));
    }
    for (int subset = 0; subset < kSampleSubsets; ++subset) {
        subsets_[film_pixel * kSampleSubsets + subset] += tile.subset_luminance(tile_pixel, subset);
        subset_samples_[film_pixel * kSampleSubsets + subset] += tile.subset_samples(tile_pixel, subset);
    }
    increase(normal_, film_pixel, tile.normal(tile_pixel));
    increase(albedo_, film_pixel, tile.albedo(tile_pixel));
    increase(coverage_, film_pixel, tile.coverage(tile_pixel));
    beauty_[4 * film_pixel + 3] += static_cast<float>(tile.hits(tile_pixel));
    if (const PrimaryHit& nearest = tile.nearest(tile_pixel); nearest.depth < depth_[film_pixel]) {
        set(position_, film_pixel, nearest.position);
        depth_[film_pixel] = nearest.depth;
        object_id_[film_pixel] = static_cast<float>(nearest.object_id);
        const std::size_t object = nearest.object_id - 1;
        if (uv_) uv_[2 * film_pixel] = nearest.st.x, uv_[2 * film_pixel + 1] = nearest.st.y;
        if (local_position_) set(local_position_, film_pixel, nearest.local_position);
        if (material_id_) material_id_[film_pixel] = layout_.material_id[object];
        if (instance_id_) instance_id_[film_pixel] = layout_.instance_id[object];
        if (point_spacing_) point_spacing_[film_pixel] = layout_.point_spacing[object];
    }
    if (motion_ && (tile.nearest(tile_pixel).depth <= depth_[film_pixel])) {
        const V2f& motion = tile.nearest(tile_pixel).motion;
        motion_[2 * film_pixel] = motion.x, motion_[2 * film_pixel + 1] = motion.y;
    }
    if (lacking_) increase(lacking_, film_pixel, tile.lacking(tile_pixel));
    if (occlusion_) occlusion_[film_pixel] += tile.openness(tile_pixel);
    if (bent_normal_) increase(bent_normal_, film_pixel, tile.open_directions(tile_pixel));
    for (std::size_t i = 0; i < lpes_.size(); ++i) increase(lpes_[i], film_pixel, tile.lpe(tile_pixel, i));
    for (std::size_t i = 0; i < mattes_.size(); ++i) {
        mattes_[i][film_pixel] += tile.matte(tile_pixel, i, false);
        refracted_mattes_[i][film_pixel] += tile.matte(tile_pixel, i, true);
    }
    for (std::size_t i = 0; i < id_slots_.size(); ++i) {
        const FilmLayout::Ids& ids = layout_.ids[i];
        add_ids(tile.objects(tile_pixel, ids.seen_through), ids.of_object, &id_slots_[i][film_pixel * kIdSlots * 2]);
    }
    samples_[film_pixel] += static_cast<float>(samples);
}

float FilmSums::luminance_of_mean(std::size_t film_pixel) const {
    if (samples_[film_pixel] == 0.0f) return 0.0f;
    float sum = 0.0f;
    for (int subset = 0; subset < kSampleSubsets; ++subset) sum += subsets_[film_pixel * kSampleSubsets + subset];
    return sum / samples_[film_pixel];
}

// The squared standard error of the mean: the variance of the subsets' means over their number.
float FilmSums::variance_of_mean(std::size_t film_pixel) const {
    std::array<float, kSampleSubsets> means;
    float mean = 0.0f, squares = 0.0f;
    for (int subset = 0; subset < kSampleSubsets; ++subset) {
        const float own = subset_samples_[film_pixel * kSampleSubsets + subset];
        if (own == 0.0f) return std::numeric_limits<float>::infinity();
        means[subset] = subsets_[film_pixel * kSampleSubsets + subset] / own;
        mean += means[subset] / kSampleSubsets;
    }
    for (const float value : means) squares += (value - mean) * (value - mean);
    return squares / (kSampleSubsets * (kSampleSubsets - 1));
}

std::vector<char> FilmSums::noisy_pixels(float noise, int most) const {
    const int width = film_.width, height = film_.height;
    const std::size_t count = std::size_t(width) * height;
    std::vector<float> luminance(count), variance(count);
    parallel_for(count, kRowsPerChunk * width, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            luminance[i] = std::abs(luminance_of_mean(i));
            variance[i] = variance_of_mean(i);
        }
    });
    const double total = parallel_sum(count, kRowsPerChunk * width, 0.0, [&](std::size_t begin, std::size_t end) {
        double sum = 0.0;
        for (std::size_t i = begin; i < end; ++i) sum += luminance[i];
        return sum;
    });
    const auto floor = static_cast<float>(0.1 * total / static_cast<double>(count));

    std::vector<char> noisy(count, 0);
    parallel_for(height, kRowsPerChunk, [&](std::size_t begin, std::size_t end) {
        for (auto y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            for (int x = 0; x < width; ++x) {
                const std::size_t pixel = std::size_t(y) * width + x;
                if (samples(pixel) >= most) continue;
                float luminance_sum = 0.0f, variance_sum = 0.0f;
                int neighbours = 0;
                for (int v = std::max(0, y - kWindow); v <= std::min(height - 1, y + kWindow); ++v) {
                    for (int u = std::max(0, x - kWindow); u <= std::min(width - 1, x + kWindow); ++u, ++neighbours) {
                        luminance_sum += luminance[std::size_t(v) * width + u];
                        variance_sum += variance[std::size_t(v) * width + u];
                    }
                }
                const float mean = luminance_sum / static_cast<float>(neighbours);
                const float error = std::sqrt(variance_sum / static_cast<float>(neighbours));
                noisy[pixel] = error > noise * (mean + floor);
            }
        }
    });
    return noisy;
}

Film FilmSums::finish() {
    const std::size_t count = std::size_t(film_.width) * film_.height;
    parallel_for(count, kRowsPerChunk * film_.width, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const float factor = samples_[i] > 0.0f ? 1.0f / samples_[i] : 0.0f;
            Rgb beauty(0.0f);
            for (const GroupedLayer& layer : components_) beauty += finish_grouped(layer, i, factor);
            for (const GroupedLayer& layer : planes_) finish_grouped(layer, i, factor);
            for (float* lpe : lpes_) scale(lpe, i, factor);
            for (float* matte : mattes_) matte[i] *= factor;
            for (float* matte : refracted_mattes_) matte[i] *= factor;
            const float hits = beauty_[4 * i + 3];
            scale(normal_, i, hits > 0.0f ? 1.0f / hits : 0.0f);
            scale(albedo_, i, factor);
            scale(coverage_, i, factor);
            if (lacking_) scale(lacking_, i, factor);
            if (occlusion_) occlusion_[i] *= hits > 0.0f ? 1.0f / hits : 0.0f;
            if (bent_normal_) {
                float* bent = bent_normal_ + 3 * i;
                set(bent_normal_, i, V3f(bent[0], bent[1], bent[2]).normalized());
            }
            float* pixel = beauty_ + 4 * i;
            pixel[0] = beauty.x, pixel[1] = beauty.y, pixel[2] = beauty.z, pixel[3] = hits * factor;
            sample_count_[i] = samples_[i];
            const float variance = variance_of_mean(i);
            variance_[i] = std::isfinite(variance) ? variance : 0.0f;
        }
    });
    finish_ids();
    return std::move(film_);
}

// Three layers of two ranks for each Cryptomatte.
void FilmSums::finish_ids() {
    for (std::size_t i = 0; i < id_slots_.size(); ++i) {
        std::array<float*, kIdRanks / 2> layers;
        for (int k = 0; k < kIdRanks / 2; ++k) layers[k] = add_layer(str(layout_.ids[i].aov, "0", k), 4);
        parallel_for(samples_.size(), kRowsPerChunk * film_.width, [&](std::size_t begin, std::size_t end) {
            for (std::size_t pixel = begin; pixel < end; ++pixel) {
                const float factor = samples_[pixel] > 0.0f ? 1.0f / samples_[pixel] : 0.0f;
                std::array<float, 2 * kIdRanks> ranks;
                write_ranks(&id_slots_[i][pixel * kIdSlots * 2], factor, ranks.data());
                for (int k = 0; k < 2 * kIdRanks; ++k) layers[k / 4][4 * pixel + k % 4] = ranks[k];
            }
        });
    }
}

FilmState FilmSums::state() {
    FilmState result;
    for (auto& [name, layer] : film_.layers) result["layer." + name] = layer.pixels;
    for (std::size_t i = 0; i < id_slots_.size(); ++i) result["ids." + layout_.ids[i].aov] = id_slots_[i];
    result["samples"] = samples_;
    result["subsets"] = subsets_;
    result["subset_samples"] = subset_samples_;
    return result;
}

}  // namespace frazil
