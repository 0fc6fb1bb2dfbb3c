#include "frazil/lighting/environment.h"

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"

namespace frazil {
namespace {

// What sampling counts as light: positive also where a pixel subtracts.
float weight_of(const Rgb& c) {
    return 0.2126f * std::abs(c.x) + 0.7152f * std::abs(c.y) + 0.0722f * std::abs(c.z);
}

// The interval of a cdf of `count` bins that holds u: its probability is never 0.
int find_bin(const float* cdf, int count, float u) {
    const float* upper = std::upper_bound(cdf + 1, cdf + count + 1, u);
    int bin = static_cast<int>(upper - cdf) - 1;
    if (bin >= count) bin = count - 1;
    while (bin > 0 && cdf[bin + 1] == cdf[bin]) --bin;
    return bin;
}

// Turn weights[0..count) at cdf[1..count] into a cdf ending in 1; uniform where they are all 0.
double finish_cdf(float* cdf, int count, const std::vector<double>& weights) {
    double total = 0.0;
    for (const double w : weights) total += w;
    double sum = 0.0;
    cdf[0] = 0.0f;
    for (int i = 0; i < count; ++i) {
        sum += weights[std::size_t(i)];
        cdf[i + 1] = static_cast<float>(total > 0.0 ? sum / total : double(i + 1) / count);
    }
    cdf[count] = 1.0f;
    return total;
}

}  // namespace

Environment::Environment(int width, int height, std::vector<Rgb> pixels, const std::string& path)
    : width_(width), height_(height), pixels_(std::move(pixels)) {
    if (width < 1 || height < 1 || pixels_.size() != std::size_t(width) * std::size_t(height)) {
        throw ValueError(str(path, ": pixels must be width * height of at least 1 x 1, got ", width, " x ", height,
                             " with ", pixels_.size(), " pixels."));
    }
    for (std::size_t i = 0; i < pixels_.size(); ++i) {
        if (is_finite(pixels_[i])) continue;
        throw ValueError(str(path, ": pixels must be finite, got (", pixels_[i].x, ", ", pixels_[i].y, ", ",
                             pixels_[i].z, ") at column ", i % std::size_t(width), ", row ", i / std::size_t(width),
                             ". Repair the image."));
    }
    row_cosine_.resize(std::size_t(height) + 1);
    for (int y = 0; y <= height; ++y) row_cosine_[std::size_t(y)] = std::cos(kPi * float(y) / float(height));
    row_cosine_.front() = 1.0f, row_cosine_.back() = -1.0f;

    // One distribution per row over the exact mean of the bilinear luminance in each pixel: weights 1/8, 3/4, 1/8.
    const std::size_t w = std::size_t(width), h = std::size_t(height);
    conditional_cdf_.resize(h * (w + 1));
    std::vector<double> row_weight(h);
    std::vector<V3d> row_sum(h, V3d(0.0));
    parallel_for(h, 16, [&](std::size_t begin, std::size_t end) {
        std::vector<double> column(w), smooth(w);
        for (std::size_t y = begin; y < end; ++y) {
            const Rgb* above = &pixels_[(y == 0 ? y : y - 1) * w];
            const Rgb* here = &pixels_[y * w];
            const Rgb* below = &pixels_[(y + 1 == h ? y : y + 1) * w];
            for (std::size_t x = 0; x < w; ++x) {
                column[x] = 0.125 * weight_of(above[x]) + 0.75 * weight_of(here[x]) + 0.125 * weight_of(below[x]);
                row_sum[y] += V3d(above[x]) * 0.125 + V3d(here[x]) * 0.75 + V3d(below[x]) * 0.125;
            }
            for (std::size_t x = 0; x < w; ++x) {
                smooth[x] = 0.125 * column[(x + w - 1) % w] + 0.75 * column[x] + 0.125 * column[(x + 1) % w];
            }
            row_weight[y] = finish_cdf(&conditional_cdf_[y * (w + 1)], width, smooth);
        }
    });
    V3d average(0.0);
    for (std::size_t y = 0; y < h; ++y) {
        const double share = 0.5 * (double(row_cosine_[y]) - double(row_cosine_[y + 1]));
        row_weight[y] *= share;
        average += row_sum[y] * (share / double(w));
    }
    average_ = Rgb(average);
    marginal_cdf_.resize(h + 1);
    double total = 0.0;
    for (const double weight : row_weight) total += weight;
    if (total == 0.0) {
        for (std::size_t y = 0; y < h; ++y) row_weight[y] = double(row_cosine_[y]) - double(row_cosine_[y + 1]);
    }
    finish_cdf(marginal_cdf_.data(), height, row_weight);
}

V2f Environment::pixel_of(const V3f& direction) const {
    const float theta = std::atan2(std::sqrt(direction.x * direction.x + direction.z * direction.z), direction.y);
    // Longitude is +pi at the left edge and falls to the right; +x has longitude pi/2.
    const float longitude = std::atan2(direction.x, direction.z);
    return {(0.5f - longitude * (0.5f * kInvPi)) * float(width_), theta * kInvPi * float(height_)};
}

Rgb Environment::eval(const V3f& direction) const {
    const V2f at = pixel_of(direction);
    const float x = at.x - 0.5f, y = std::clamp(at.y - 0.5f, 0.0f, float(height_ - 1));
    const float x_floor = std::floor(x);
    const int y0 = std::min(int(y), height_ - 1), y1 = std::min(y0 + 1, height_ - 1);
    const int x0 = (int(x_floor) + width_) % width_, x1 = (x0 + 1) % width_;
    const float fx = x - x_floor, fy = y - float(y0);
    const auto pixel = [&](int column, int row) -> const Rgb& {
        return pixels_[std::size_t(row) * std::size_t(width_) + std::size_t(column)];
    };
    return (pixel(x0, y0) * (1.0f - fx) + pixel(x1, y0) * fx) * (1.0f - fy) +
           (pixel(x0, y1) * (1.0f - fx) + pixel(x1, y1) * fx) * fy;
}

float Environment::pdf_of_pixel(int column, int row) const {
    const std::size_t x = std::size_t(column), y = std::size_t(row);
    const float* cdf = &conditional_cdf_[y * (std::size_t(width_) + 1)];
    const float probability = (marginal_cdf_[y + 1] - marginal_cdf_[y]) * (cdf[x + 1] - cdf[x]);
    return probability * float(width_) * (0.5f * kInvPi) / (row_cosine_[y] - row_cosine_[y + 1]);
}

V3f Environment::sample(const V2f& u, float& pdf) const {
    const int row = find_bin(marginal_cdf_.data(), height_, u.y);
    const float* cdf = &conditional_cdf_[std::size_t(row) * (std::size_t(width_) + 1)];
    const int column = find_bin(cdf, width_, u.x);
    // What is left of u within its bin becomes the place within the pixel, uniform in solid angle.
    const auto place = [](const float* bins, int bin, float value) {
        return std::clamp((value - bins[bin]) / (bins[bin + 1] - bins[bin]), 0.0f, 1.0f);
    };
    const float fx = place(cdf, column, u.x), fy = place(marginal_cdf_.data(), row, u.y);
    const std::size_t y = std::size_t(row);
    const float cosine = row_cosine_[y] + fy * (row_cosine_[y + 1] - row_cosine_[y]);
    const float sine = std::sqrt(std::max(0.0f, 1.0f - cosine * cosine));
    const float longitude = kPi - 2.0f * kPi * (float(column) + fx) / float(width_);
    pdf = pdf_of_pixel(column, row);
    return {sine * std::sin(longitude), cosine, sine * std::cos(longitude)};
}

float Environment::pdf(const V3f& direction) const {
    const V2f at = pixel_of(direction);
    const int column = std::clamp(int(at.x), 0, width_ - 1), row = std::clamp(int(at.y), 0, height_ - 1);
    return pdf_of_pixel(column, row);
}

}  // namespace frazil
