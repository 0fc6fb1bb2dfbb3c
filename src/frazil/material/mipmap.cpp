#include "frazil/material/mipmap.h"

#include <Imath/half.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "frazil/base/error.h"

namespace frazil {
namespace {

// The mean over each of `to` cells of `from` rows of `stride` values.
std::vector<float> halve_rows(const std::vector<float>& values, int from, int to, std::size_t stride) {
    std::vector<float> result(std::size_t(to) * stride, 0.0f);
    const double step = double(from) / to;
    for (int i = 0; i < to; ++i) {
        const double begin = i * step, end = (i + 1) * step;
        float* out = &result[std::size_t(i) * stride];
        for (int j = int(begin); j < from && j < end; ++j) {
            const double covered = std::min(end, j + 1.0) - std::max(begin, double(j));
            if (covered <= 1e-9) continue;
            const auto weight = float(covered / step);
            const float* in = &values[std::size_t(j) * stride];
            for (std::size_t k = 0; k < stride; ++k) out[k] += weight * in[k];
        }
    }
    return result;
}

std::vector<float> halve(const std::vector<float>& texels, int width, int height, int channels) {
    const int w = std::max(1, width / 2), h = std::max(1, height / 2);
    std::vector<float> rows =
        h == height ? texels : halve_rows(texels, height, h, std::size_t(width) * std::size_t(channels));
    if (w == width) return rows;
    std::vector<float> result;
    result.reserve(std::size_t(w) * std::size_t(h) * std::size_t(channels));
    const std::size_t pitch = std::size_t(width) * std::size_t(channels);
    std::vector<float> row(pitch);
    for (int y = 0; y < h; ++y) {
        std::copy_n(&rows[std::size_t(y) * pitch], pitch, row.begin());
        const std::vector<float> halved = halve_rows(row, width, w, std::size_t(channels));
        result.insert(result.end(), halved.begin(), halved.end());
    }
    return result;
}

}  // namespace

float MipLevel::half_value(std::uint16_t bits) {
    half value;
    value.setBits(bits);
    return value;
}

Mipmap::Mipmap(int width, int height, int channels, std::vector<float> texels, const std::string& path)
    : width_(width), height_(height), channels_(channels) {
    check(texels, path);
    level_count_ = int(std::bit_width(unsigned(std::max(width, height))));
    keep(std::move(texels), 0);
}

Mipmap::Mipmap(int width, int height, int channels, std::vector<float> texels, std::function<std::vector<float>()> load,
               int kept, bool is_half, const std::string& path)
    : width_(width), height_(height), channels_(channels), is_half_(is_half), load_(std::move(load)) {
    check(texels, path);
    level_count_ = int(std::bit_width(unsigned(std::max(width, height))));
    int first = 0;
    while ((std::max(width_, height_) >> first) > std::max(kept, 1)) ++first;
    keep(std::move(texels), first);
}

Mipmap::~Mipmap() {
    for (auto& level : levels_) delete level.load();
}

void Mipmap::check(const std::vector<float>& texels, const std::string& path) const {
    if (channels_ < 1 || channels_ > 4) {
        throw ValueError(str(path, ": channels must be 1 to 4, got ", channels_, ". Convert the image."));
    }
    if (width_ < 1 || height_ < 1) {
        throw ValueError(
            str(path, ": size must be at least 1 x 1, got ", width_, " x ", height_, ". Give an image with pixels."));
    }
    const std::size_t expected = std::size_t(width_) * std::size_t(height_) * std::size_t(channels_);
    if (texels.size() != expected) {
        throw ValueError(
            str(path, ": texels must be width * height * channels = ", expected, " values, got ", texels.size(), "."));
    }
    for (std::size_t i = 0; i < expected; ++i) {
        if (std::isfinite(texels[i])) continue;
        const std::size_t pixel = i / std::size_t(channels_);
        throw ValueError(str(path, ": pixels must be finite, got ", texels[i], " at column ",
                             pixel % std::size_t(width_), ", row ", pixel / std::size_t(width_),
                             ". Repair the image."));
    }
}

void Mipmap::keep(std::vector<float> texels, int first) const {
    int width = width_, height = height_, number = 0;
    while (true) {
        std::vector<float> next;
        const bool is_last = width == 1 && height == 1;
        if (!is_last) next = halve(texels, width, height, channels_);
        if (number >= first && !levels_[std::size_t(number)].load(std::memory_order_relaxed)) {
            auto level = std::make_unique<MipLevel>();
            level->width = width, level->height = height;
            if (is_half_) {
                level->halves.reserve(texels.size());
                for (const float value : texels) {
                    level->halves.push_back(half(std::clamp(value, -65504.0f, 65504.0f)).bits());
                }
            } else {
                level->texels = std::move(texels);
            }
            levels_[std::size_t(number)].store(level.release(), std::memory_order_release);
        }
        if (is_last) break;
        texels = std::move(next);
        width = std::max(1, width / 2), height = std::max(1, height / 2);
        ++number;
    }
}

const MipLevel& Mipmap::level(int number) const {
    number = std::clamp(number, 0, level_count_ - 1);
    const MipLevel* level = levels_[std::size_t(number)].load(std::memory_order_acquire);
    return level ? *level : load_level(number);
}

const MipLevel& Mipmap::load_level(int number) const {
    const std::lock_guard lock(mutex_);
    auto at = std::size_t(number);
    if (!levels_[at].load(std::memory_order_acquire) && !has_failed_) {
        std::vector<float> texels = load_();
        const std::size_t expected = std::size_t(width_) * std::size_t(height_) * std::size_t(channels_);
        has_failed_ = texels.size() != expected;
        if (!has_failed_) keep(std::move(texels), number);
    }
    while (!levels_[at].load(std::memory_order_acquire)) ++at;
    return *levels_[at].load(std::memory_order_acquire);
}

std::size_t Mipmap::bytes() const {
    std::size_t sum = 0;
    for (const auto& slot : levels_) {
        if (const MipLevel* level = slot.load(std::memory_order_acquire)) {
            sum += level->texels.size() * sizeof(float) + level->halves.size() * sizeof(std::uint16_t);
        }
    }
    return sum;
}

}  // namespace frazil
