#include "frazil/lighting/light_image.h"

#include "frazil/base/error.h"

namespace frazil {
namespace {

double weight_of(const Rgb& c) {
    return double(luminance({std::abs(c.x), std::abs(c.y), std::abs(c.z)}));
}

// Turn weights at cdf[1..count] into a cdf that ends in 1; even where they are all 0.
double finish_cdf(float* cdf, const std::vector<double>& weights) {
    double total = 0.0, sum = 0.0;
    for (const double w : weights) total += w;
    cdf[0] = 0.0f;
    for (std::size_t i = 0; i < weights.size(); ++i) {
        sum += weights[i];
        cdf[i + 1] = static_cast<float>(total > 0.0 ? sum / total : double(i + 1) / double(weights.size()));
    }
    cdf[weights.size()] = 1.0f;
    return total;
}

// The bin of cdf[0 .. count] that holds u, and where in it.
int find_bin(const float* cdf, int count, float u, float& rest) {
    int bin = int(std::upper_bound(cdf + 1, cdf + count, u) - cdf) - 1;
    while (bin > 0 && cdf[bin + 1] == cdf[bin]) --bin;
    rest = std::clamp((u - cdf[bin]) / (cdf[bin + 1] - cdf[bin]), 0.0f, 0.999999f);
    return bin;
}

}  // namespace

LightImage::LightImage(int width, int height, std::vector<Rgb> pixels, const std::string& path)
    : width_(width), height_(height), pixels_(std::move(pixels)) {
    if (width < 1 || height < 1 || pixels_.size() != std::size_t(width) * std::size_t(height)) {
        throw ValueError(str(path, ": pixels must be width * height of at least 1 x 1, got ", width, " x ", height,
                             " with ", pixels_.size(), " pixels."));
    }
    const std::size_t w = std::size_t(width), h = std::size_t(height);
    std::vector<double> rows(h), columns(w);
    column_cdf_.resize(h * (w + 1));
    row_cdf_.resize(h + 1);
    for (std::size_t y = 0; y < h; ++y) {
        for (std::size_t x = 0; x < w; ++x) {
            const Rgb& pixel = pixels_[y * w + x];
            if (!is_finite(pixel)) {
                throw ValueError(str(path, ": pixels must be finite, got (", pixel.x, ", ", pixel.y, ", ", pixel.z,
                                     ") at column ", x, ", row ", y, ". Repair the image."));
            }
            columns[x] = weight_of(pixel);
        }
        rows[y] = finish_cdf(&column_cdf_[y * (w + 1)], columns);
    }
    brightness_ = static_cast<float>(finish_cdf(row_cdf_.data(), rows) / double(w * h));
}

Rgb LightImage::eval(const V2f& position) const {
    const float x = std::clamp(position.x * float(width_) - 0.5f, 0.0f, float(width_ - 1));
    const float y = std::clamp(position.y * float(height_) - 0.5f, 0.0f, float(height_ - 1));
    const int x0 = int(x), y0 = int(y), x1 = std::min(x0 + 1, width_ - 1), y1 = std::min(y0 + 1, height_ - 1);
    const auto at = [&](int column, int row) { return pixels_[std::size_t(row) * std::size_t(width_) + column]; };
    const float fx = x - float(x0), fy = y - float(y0);
    return (at(x0, y0) * (1.0f - fx) + at(x1, y0) * fx) * (1.0f - fy) +
           (at(x0, y1) * (1.0f - fx) + at(x1, y1) * fx) * fy;
}

V2f LightImage::sample(const V2f& u, float& pdf) const {
    V2f rest;
    const int row = find_bin(row_cdf_.data(), height_, u.y, rest.y);
    const float* cdf = &column_cdf_[std::size_t(row) * (std::size_t(width_) + 1)];
    const int column = find_bin(cdf, width_, u.x, rest.x);
    pdf = (row_cdf_[std::size_t(row) + 1] - row_cdf_[std::size_t(row)]) * float(height_) *
          (cdf[column + 1] - cdf[column]) * float(width_);
    return {(float(column) + rest.x) / float(width_), (float(row) + rest.y) / float(height_)};
}

float LightImage::pdf(const V2f& position) const {
    const int column = std::clamp(int(position.x * float(width_)), 0, width_ - 1);
    const int row = std::clamp(int(position.y * float(height_)), 0, height_ - 1);
    const float* cdf = &column_cdf_[std::size_t(row) * (std::size_t(width_) + 1)];
    return (row_cdf_[std::size_t(row) + 1] - row_cdf_[std::size_t(row)]) * float(height_) *
           (cdf[column + 1] - cdf[column]) * float(width_);
}

}  // namespace frazil
