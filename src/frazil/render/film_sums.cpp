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

FilmSums::FilmSums(int width, int height, const std::vector<std::string>& groups) : group_count_(groups.size()) {
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
    normal_ = pixels("N"), position_ = pixels("P"), coverage_ = pixels("coverage"), albedo_ = pixels("albedo");
    sample_count_ = pixels("sample_count"), variance_ = pixels("variance");
    const std::size_t count = std::size_t(width) * height;
    std::fill(depth_, depth_ + count, std::numeric_limits<float>::infinity());
    samples_.assign(count, 0.0f);
    subsets_.assign(count * kSampleSubsets, 0.0f);
}

void FilmSums::add_layer(const std::string& name, std::size_t channels) {
    Layer& layer = film_.layers[name];
    layer.channels = static_cast<int>(channels);
    layer.pixels.resize(std::size_t(film_.width) * film_.height * channels);
}

void FilmSums::add(const Tile& tile, std::size_t tile_pixel, std::size_t film_pixel, int samples) {
    for (std::size_t component = 0; component < kComponentCount; ++component) {
        for (std::size_t group = 0; group < group_count_; ++group) {
            float* layer =
                group_count_ > 1 ? group_pixels_[component * group_count_ + group] : component_pixels_[component];
            increase(layer, film_pixel, tile.light(tile_pixel, component, group));
        }
    }
    for (int subset = 0; subset < kSampleSubsets; ++subset) {
        subsets_[film_pixel * kSampleSubsets + subset] += tile.subset_luminance(tile_pixel, subset);
    }
    increase(normal_, film_pixel, tile.normal(tile_pixel));
    increase(albedo_, film_pixel, tile.albedo(tile_pixel));
    increase(coverage_, film_pixel, tile.coverage(tile_pixel));
    beauty_[4 * film_pixel + 3] += static_cast<float>(tile.hits(tile_pixel));
    if (const PrimaryHit& nearest = tile.nearest(tile_pixel); nearest.depth < depth_[film_pixel]) {
        set(position_, film_pixel, nearest.position);
        depth_[film_pixel] = nearest.depth;
        object_id_[film_pixel] = static_cast<float>(nearest.object_id);
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
    const auto samples = static_cast<int>(samples_[film_pixel]);
    constexpr int kRound = kSampleSubsets * kSubsetRun;
    if (samples <= kRound - kSubsetRun) return std::numeric_limits<float>::infinity();
    std::array<float, kSampleSubsets> means;
    float mean = 0.0f, squares = 0.0f;
    for (int subset = 0; subset < kSampleSubsets; ++subset) {
        const int own = samples / kRound * kSubsetRun + std::clamp(samples % kRound - subset * kSubsetRun, 0, kSubsetRun);
        means[subset] = subsets_[film_pixel * kSampleSubsets + subset] / static_cast<float>(own);
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
            for (std::size_t component = 0; component < kComponentCount; ++component) {
                float* whole = component_pixels_[component];
                if (group_count_ < 2) {
                    scale(whole, i, factor);
                } else {
                    Rgb sum(0.0f);
                    for (std::size_t group = 0; group < group_count_; ++group) {
                        float* part = group_pixels_[component * group_count_ + group];
                        scale(part, i, factor);
                        sum += Rgb(part[3 * i], part[3 * i + 1], part[3 * i + 2]);
                    }
                    set(whole, i, sum);
                }
                beauty += Rgb(whole[3 * i], whole[3 * i + 1], whole[3 * i + 2]);
            }
            const float hits = beauty_[4 * i + 3];
            scale(normal_, i, hits > 0.0f ? 1.0f / hits : 0.0f);
            scale(albedo_, i, factor);
            scale(coverage_, i, factor);
            float* pixel = beauty_ + 4 * i;
            pixel[0] = beauty.x, pixel[1] = beauty.y, pixel[2] = beauty.z, pixel[3] = hits * factor;
            sample_count_[i] = samples_[i];
            const float variance = variance_of_mean(i);
            variance_[i] = std::isfinite(variance) ? variance : 0.0f;
        }
    });
    return std::move(film_);
}

FilmState FilmSums::state() {
    FilmState result;
    for (auto& [name, layer] : film_.layers) result["layer." + name] = layer.pixels;
    result["samples"] = samples_;
    result["subsets"] = subsets_;
    return result;
}

}  // namespace frazil
