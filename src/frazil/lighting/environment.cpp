#include "frazil/lighting/environment.h"

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/base/trigonometry.h"

namespace frazil {
namespace {

// What sampling counts as light: positive also where a pixel subtracts.
float weight_of(const Rgb& c) {
    return 0.2126f * std::abs(c.x) + 0.7152f * std::abs(c.y) + 0.0722f * std::abs(c.z);
}

// A search begins in one of so many equal intervals of u, whose first bin is known.
constexpr int kGuides = 256;
// So many lookups wait for memory together.
constexpr std::size_t kBatch = 32;

void prefetch(const void* address) {
    __builtin_prefetch(address);
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
    for (int k = 0; k < kGuides; ++k) guide[k] = std::uint32_t(find_bin(cdf, 0, count - 1, float(k) / kGuides));
    guide[kGuides] = std::uint32_t(count - 1);
}

// The bin that holds u: its probability is never 0.
int find_bin(const float* cdf, const std::uint32_t* guide, float u) {
    const int k = std::min(int(u * kGuides), kGuides - 1);
    int bin = find_bin(cdf, int(guide[k]), int(guide[k + 1]), u);
    while (bin > 0 && cdf[bin + 1] == cdf[bin]) --bin;
    return bin;
}

// x in [0, 1] with density proportional to the line from a to b; a and b >= 0.
float sample_line(float u, float a, float b) {
    if (a + b <= 0.0f) return u;
    return std::min(u * (a + b) / (a + std::sqrt(a * a * (1.0f - u) + b * b * u) + 1e-37f), 1.0f);
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
    // Rows of cells: half a pixel at each pole, whole ones between.
    const std::size_t w = std::size_t(width), rows = std::size_t(height) + 1;
    row_cosine_.resize(rows + 1);
    for (std::size_t y = 0; y <= rows; ++y) {
        row_cosine_[y] = static_cast<float>(std::cos(3.14159265358979323846 * (double(y) - 0.5) / height));
    }
    row_cosine_.front() = 1.0f, row_cosine_.back() = -1.0f;

    // One distribution per row over the mean of the corners' luminance.
    conditional_cdf_.resize(rows * (w + 1));
    guides_.resize((rows + 1) * (kGuides + 1));
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
            make_guide(&conditional_cdf_[y * (w + 1)], width, &guides_[y * (kGuides + 1)]);
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
    make_guide(marginal_cdf_.data(), int(rows), &guides_[rows * (kGuides + 1)]);
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

void Environment::set_corners(Cell& cell) const {
    const int right = cell.column + 1 == width_ ? 0 : cell.column + 1;
    const Rgb* above = &pixels_[std::size_t(std::max(cell.row - 1, 0)) * std::size_t(width_)];
    const Rgb* below = &pixels_[std::size_t(std::min(cell.row, height_ - 1)) * std::size_t(width_)];
    cell.corner[0] = above + cell.column, cell.corner[1] = above + right;
    cell.corner[2] = below + cell.column, cell.corner[3] = below + right;
}

Environment::Cell Environment::cell_of(const V3f& direction) const {
    const float theta = fast_atan2(std::sqrt(direction.x * direction.x + direction.z * direction.z), direction.y);
    // Longitude is +pi at the left edge and falls to the right; +x has longitude pi/2.
    const float longitude = fast_atan2(direction.x, direction.z);
    float x = (0.5f - longitude * (0.5f * kInvPi)) * float(width_) - 0.5f;
    if (x < 0.0f) x += float(width_);
    const float y = theta * kInvPi * float(height_) + 0.5f;
    Cell cell;
    cell.column = std::clamp(int(x), 0, width_ - 1);
    cell.row = std::clamp(int(y), 0, height_);
    cell.across = std::clamp(x - float(cell.column), 0.0f, 1.0f);
    cell.down = std::clamp(y - float(cell.row), 0.0f, 1.0f);
    set_corners(cell);
    return cell;
}

Rgb Environment::radiance_in(const Cell& cell) {
    const float x = cell.across, y = cell.down;
    return (*cell.corner[0] * (1.0f - x) + *cell.corner[1] * x) * (1.0f - y) +
           (*cell.corner[2] * (1.0f - x) + *cell.corner[3] * x) * y;
}

float Environment::pdf_in(const Cell& cell, float down_cosine) const {
    if (integral_ == 0.0f) return 0.25f * kInvPi;
    const float x = cell.across;
    const float upper = weight_of(*cell.corner[0]) * (1.0f - x) + weight_of(*cell.corner[1]) * x;
    const float lower = weight_of(*cell.corner[2]) * (1.0f - x) + weight_of(*cell.corner[3]) * x;
    return (upper * (1.0f - down_cosine) + lower * down_cosine) / integral_;
}

Rgb Environment::eval(const V3f& direction) const {
    return radiance_in(cell_of(direction));
}

Rgb Environment::eval_in(const Cell& cell, const V3f& direction, float& pdf) const {
    const float top = row_cosine_[std::size_t(cell.row)], bottom = row_cosine_[std::size_t(cell.row) + 1];
    pdf = pdf_in(cell, std::clamp((top - direction.y) / (top - bottom), 0.0f, 1.0f));
    return radiance_in(cell);
}

Rgb Environment::eval(const V3f& direction, float& pdf) const {
    return eval_in(cell_of(direction), direction, pdf);
}

void Environment::eval_many(std::span<const V3f> directions, std::span<float> pdfs, std::span<Rgb> radiances) const {
    Cell cells[kBatch];
    for (std::size_t begin = 0; begin < directions.size(); begin += kBatch) {
        const std::size_t count = std::min(kBatch, directions.size() - begin);
        for (std::size_t i = 0; i < count; ++i) {
            cells[i] = cell_of(directions[begin + i]);
            prefetch(cells[i].corner[0]);
            prefetch(cells[i].corner[2]);
        }
        for (std::size_t i = 0; i < count; ++i) {
            radiances[begin + i] = eval_in(cells[i], directions[begin + i], pdfs[begin + i]);
        }
    }
}

float Environment::pdf(const V3f& direction) const {
    float pdf;
    eval(direction, pdf);
    return pdf;
}

const std::uint32_t* Environment::guide_of(int row) const {
    return &guides_[std::size_t(row) * (kGuides + 1)];
}

int Environment::sample_row(float u) const {
    return find_bin(marginal_cdf_.data(), guide_of(height_ + 1), u);
}

void Environment::sample_column(float u, Cell& cell) const {
    const float* cdf = &conditional_cdf_[std::size_t(cell.row) * (std::size_t(width_) + 1)];
    cell.column = find_bin(cdf, guide_of(cell.row), u);
    set_corners(cell);
}

V3f Environment::sample_in(Cell& cell, const V2f& u, float& pdf, Rgb& radiance) const {
    const float* cdf = &conditional_cdf_[std::size_t(cell.row) * (std::size_t(width_) + 1)];
    // What is left of u within its bin becomes the place within the cell, by the slope between its corners.
    const auto rest = [](const float* bins, int bin, float value) {
        return std::clamp((value - bins[bin]) / (bins[bin + 1] - bins[bin]), 0.0f, 1.0f);
    };
    const float a = weight_of(*cell.corner[0]), b = weight_of(*cell.corner[1]);
    const float c = weight_of(*cell.corner[2]), d = weight_of(*cell.corner[3]);
    const float down = sample_line(rest(marginal_cdf_.data(), cell.row, u.y), a + b, c + d);
    cell.across = sample_line(rest(cdf, cell.column, u.x), a + (c - a) * down, b + (d - b) * down);

    const float top = row_cosine_[std::size_t(cell.row)], bottom = row_cosine_[std::size_t(cell.row) + 1];
    const float cosine = top + down * (bottom - top);
    const float sine = std::sqrt(std::max(0.0f, 1.0f - cosine * cosine));
    // From the left edge, at longitude +pi, to the right, and over the seam.
    const float turns = (float(cell.column) + 0.5f + cell.across) / float(width_);
    const V2f turn = cos_sin_turns(turns > 1.0f ? turns - 1.0f : turns);
    const float theta = fast_atan2(sine, cosine);
    cell.down = std::clamp(theta * kInvPi * float(height_) + 0.5f - float(cell.row), 0.0f, 1.0f);
    radiance = radiance_in(cell);
    pdf = pdf_in(cell, down);
    return {sine * turn.y, cosine, -sine * turn.x};
}

V3f Environment::sample(const V2f& u, float& pdf, Rgb& radiance) const {
    Cell cell;
    cell.row = sample_row(u.y);
    sample_column(u.x, cell);
    return sample_in(cell, u, pdf, radiance);
}

void Environment::sample_many(std::span<const V2f> u, std::span<V3f> directions, std::span<float> pdfs,
                              std::span<Rgb> radiances) const {
    Cell cells[kBatch];
    for (std::size_t begin = 0; begin < u.size(); begin += kBatch) {
        const std::size_t count = std::min(kBatch, u.size() - begin);
        for (std::size_t i = 0; i < count; ++i) {
            cells[i].row = sample_row(u[begin + i].y);
            prefetch(guide_of(cells[i].row) + int(u[begin + i].x * kGuides));
        }
        for (std::size_t i = 0; i < count; ++i) {
            sample_column(u[begin + i].x, cells[i]);
            prefetch(cells[i].corner[0]);
            prefetch(cells[i].corner[2]);
        }
        for (std::size_t i = 0; i < count; ++i) {
            directions[begin + i] = sample_in(cells[i], u[begin + i], pdfs[begin + i], radiances[begin + i]);
        }
    }
}

}  // namespace frazil
