#include "frazil/lighting/environment.h"

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"

namespace frazil {
namespace {

// What sampling counts as light: positive also where a pixel subtracts.
float weight_of(const Rgb& c) {
    return 0.2126f * std::abs(c.x) + 0.7152f * std::abs(c.y) + 0.0722f * std::abs(c.z);
}

// The last bin of cdf[first .. last] whose lower edge is <= u, without branches to mispredict.
int find_bin(const float* cdf, int first, int last, float u) {
    int bin = first, length = last - first + 1;
    while (length > 1) {
        const int half = length / 2;
        bin += cdf[bin + half] <= u ? half : 0;
        length -= half;
    }
    return bin;
}

void make_guide(const float* cdf, int count, std::uint32_t* guide) {
    for (int k = 0; k < kEnvironmentGuides; ++k)
        guide[k] = std::uint32_t(find_bin(cdf, 0, count - 1, float(k) / kEnvironmentGuides));
    guide[kEnvironmentGuides] = std::uint32_t(count - 1);
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
    if (pixels_.size() > kMostPixels) {
        throw ValueError(
            str(path, ": pixels must be at most ", kMostPixels, ", got ", width, " x ", height, ". Reduce the image."));
    }
    for (std::size_t i = 0; i < pixels_.size(); ++i) {
        if (is_finite(pixels_[i])) continue;
        throw ValueError(str(path, ": pixels must be finite, got (", pixels_[i].x, ", ", pixels_[i].y, ", ",
                             pixels_[i].z, ") at column ", i % std::size_t(width), ", row ", i / std::size_t(width),
                             ". Repair the image."));
    }
    // Rows of cells: half a pixel at each pole, whole ones between.
    const std::size_t w = std::size_t(width), rows = std::size_t(height) + 1;
    row_cosine_.resize(rows + 1);
    for (std::size_t y = 0; y <= rows; ++y) {
        row_cosine_[y] = static_cast<float>(std::cos(3.14159265358979323846 * (double(y) - 0.5) / height));
    }
    row_cosine_.front() = 1.0f, row_cosine_.back() = -1.0f;

    // One distribution per row over the mean of the corners' luminance.
    conditional_cdf_.resize(rows * (w + 1));
    guides_.resize((rows + 1) * (kEnvironmentGuides + 1));
    std::vector<double> row_weight(rows);
    parallel_for(rows, 16, [&](std::size_t begin, std::size_t end) {
        std::vector<double> column(w), cell(w);
        for (std::size_t y = begin; y < end; ++y) {
            const Rgb* above = &pixels_[(y == 0 ? 0 : y - 1) * w];
            const Rgb* below = &pixels_[std::min(y, rows - 2) * w];
            for (std::size_t x = 0; x < w; ++x) {
                column[x] = double(weight_of(above[x])) + double(weight_of(below[x]));
            }
            for (std::size_t x = 0; x < w; ++x) cell[x] = 0.25 * (column[x] + column[x + 1 == w ? 0 : x + 1]);
            row_weight[y] = finish_cdf(&conditional_cdf_[y * (w + 1)], width, cell);
            make_guide(&conditional_cdf_[y * (w + 1)], width, &guides_[y * (kEnvironmentGuides + 1)]);
        }
    });
    double total = 0.0;
    for (std::size_t y = 0; y < rows; ++y) {
        const double share = 0.5 * (double(row_cosine_[y]) - double(row_cosine_[y + 1]));
        row_weight[y] *= share;
        total += row_weight[y];
    }
    // Each cell's weight is the exact mean of its density, so that one number normalises all.
    integral_ = static_cast<float>(4.0 * 3.14159265358979323846 * total / double(w));
    if (total == 0.0) {
        for (std::size_t y = 0; y < rows; ++y) row_weight[y] = double(row_cosine_[y]) - double(row_cosine_[y + 1]);
    }
    marginal_cdf_.resize(rows + 1);
    finish_cdf(marginal_cdf_.data(), int(rows), row_weight);
    make_guide(marginal_cdf_.data(), int(rows), &guides_[rows * (kEnvironmentGuides + 1)]);
    if (total > 0.0) set_moments();
}

void Environment::set_moments() {
    const std::size_t w = std::size_t(width_), h = std::size_t(height_);
    constexpr double kPiD = 3.14159265358979323846;
    std::vector<double> cosines(w), sines(w);
    for (std::size_t x = 0; x < w; ++x) {
        const double azimuth = 2.0 * kPiD * (double(x) + 0.5) / double(w);
        cosines[x] = std::cos(azimuth), sines[x] = std::sin(azimuth);
    }
    using Moments = std::array<double, 9>;
    std::vector<Moments> of_row(h);
    parallel_for(h, 16, [&](std::size_t begin, std::size_t end) {
        for (std::size_t y = begin; y < end; ++y) {
            double sum = 0.0, c = 0.0, s = 0.0, cc = 0.0, cs = 0.0;
            for (std::size_t x = 0; x < w; ++x) {
                const double weight = double(weight_of(pixels_[y * w + x]));
                const double wc = weight * cosines[x];
                sum += weight, c += wc, s += weight * sines[x];
                cc += wc * cosines[x], cs += wc * sines[x];
            }
            const double theta = kPiD * (double(y) + 0.5) / double(h), sine = std::sin(theta), cosine = std::cos(theta);
            const double scale = 2.0 * kPiD / double(w) * 2.0 * sine * std::sin(0.5 * kPiD / double(h));
            const double up = sine * cosine * scale, flat = sine * sine * scale;
            of_row[y] = {sine * scale * s,
                         cosine * scale * sum,
                         -sine * scale * c,
                         flat * (sum - cc),
                         cosine * cosine * scale * sum,
                         flat * cc,
                         up * s,
                         -flat * cs,
                         -up * c};
        }
    });
    Moments total{};
    for (const Moments& row : of_row) {
        for (std::size_t k = 0; k < total.size(); ++k) total[k] += row[k];
    }
    const double mean = double(brightness());
    for (std::size_t k = 0; k < 3; ++k) first_moment_[int(k)] = static_cast<float>(total[k] / mean);
    for (std::size_t k = 0; k < 6; ++k) second_moment_[k] = static_cast<float>(total[k + 3] / mean);
}

float Environment::irradiance(const V3f& n) const {
    const auto& [xx, yy, zz, xy, xz, yz] = second_moment_;
    const float square =
        n.x * n.x * xx + n.y * n.y * yy + n.z * n.z * zz + 2.0f * (n.x * n.y * xy + n.x * n.z * xz + n.y * n.z * yz);
    const float whole = 4.0f * kPi;  // the moment of degree 0
    return 0.25f * whole + 0.5f * n.dot(first_moment_) + 5.0f / 32.0f * (3.0f * square - whole);
}

EnvironmentTables Environment::tables() const {
    return {width_,
            height_,
            pixels_.data(),
            marginal_cdf_.data(),
            conditional_cdf_.data(),
            guides_.data(),
            row_cosine_.data(),
            integral_};
}

void Environment::eval_many(std::span<const V3f> directions, std::span<float> pdfs, std::span<Rgb> radiances) const {
    eval_environment(tables(), directions, pdfs, radiances);
}

void Environment::sample_many(const V3f& normal, std::span<const V2f> u, std::span<V3f> directions,
                              std::span<float> pdfs, std::span<Rgb> radiances) const {
    sample_environment(tables(), normal, u, directions, pdfs, radiances);
}

Rgb Environment::eval(const V3f& direction, float& pdf) const {
    Rgb radiance;
    eval_many({&direction, 1}, {&pdf, 1}, {&radiance, 1});
    return radiance;
}

V3f Environment::sample(const V2f& u, float& pdf, Rgb& radiance) const {
    V3f direction;
    sample_many(V3f(0.0f), {&u, 1}, {&direction, 1}, {&pdf, 1}, {&radiance, 1});
    return direction;
}

}  // namespace frazil
