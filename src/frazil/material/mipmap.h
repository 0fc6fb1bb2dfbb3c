// An image and its halved copies, read level by level: what nobody looks at closely is never kept at full size.
// Model: each level is the exact box mean of the one before, down to one texel; odd sizes by covered area. A tile that
//   comes with a loader keeps the levels that were asked for and all coarser ones, so that memory follows what is seen.
// Units: linear values.
// Valid: 1 to 4 channels, any size; level() is thread-safe and its values do not depend on the order of the questions.
// Not: eviction: a level once loaded stays. Wrapping at the edges: halved copies stay inside the image.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "frazil/base/vec.h"

namespace frazil {

// One level; row 0 is the top.
struct MipLevel {
    int width = 0, height = 0;
    std::vector<float> texels;          // or, where that is enough,
    std::vector<std::uint16_t> halves;  // the bits of half floats

    float at(std::size_t index) const { return halves.empty() ? texels[index] : half_value(halves[index]); }
    static float half_value(std::uint16_t bits);
};

class Mipmap {
  public:
    // All levels of an image that is at hand. ValueError, beginning with `path`, where sizes do not agree or a texel is not
    // finite.
    Mipmap(int width, int height, int channels, std::vector<float> texels, const std::string& path);
    // An image that `load` gives in full (height * width * channels floats, called from any thread, one at a time) when a
    // level finer than `kept` texels on a side is asked for. `texels` is the same image now, for the coarse levels.
    // `is_half`: half floats are exact enough.
    Mipmap(int width, int height, int channels, std::vector<float> texels, std::function<std::vector<float>()> load,
           int kept, bool is_half, const std::string& path);
    ~Mipmap();

    int width() const { return width_; }
    int height() const { return height_; }
    int channels() const { return channels_; }
    int level_count() const { return level_count_; }
    // Level 0 is the image. A loader that fails leaves the finest level that there is.
    const MipLevel& level(int number) const;
    // What is kept now.
    std::size_t bytes() const;
    // Whether all levels are at hand.
    bool is_whole() const { return !load_; }

  private:
    static constexpr int kMaxLevels = 32;
    void check(const std::vector<float>& texels, const std::string& path) const;
    // Keep the levels from `first` on.
    void keep(std::vector<float> texels, int first) const;
    const MipLevel& load_level(int number) const;

    int width_, height_, channels_, level_count_ = 1;
    bool is_half_ = false;
    std::function<std::vector<float>()> load_;
    mutable std::mutex mutex_;
    mutable std::array<std::atomic<const MipLevel*>, kMaxLevels> levels_{};
    mutable bool has_failed_ = false;
};

}  // namespace frazil
