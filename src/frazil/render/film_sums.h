// A film while it is rendered: sums over the samples so far, pixel by pixel, and how noisy they still are.
// Model: additive layers and planes of translucency (FilmLayout) are summed per light group; finish() divides by each pixel's samples and makes the
//   beauty their sum. Noise is the standard error of the beauty's luminance, from the spread of kSampleSubsets
//   interleaved subsets of a pixel's samples, averaged over 5x5 pixels.
// Units: by AOV.
// Valid: pixels may be added to in parallel where no two threads share one; add() in a fixed order of samples per pixel.
// Not: which pixels get more samples (render.cpp), files.
#pragma once

#include <string>
#include <vector>

#include "frazil/render/checkpoint.h"
#include "frazil/render/film.h"
#include "frazil/render/film_layout.h"
#include "frazil/render/tile.h"

namespace frazil {

class FilmSums {
  public:
    // `layout` must outlive the sums.
    FilmSums(int width, int height, const FilmLayout& layout);
    FilmSums(const FilmSums&) = delete;
    FilmSums& operator=(const FilmSums&) = delete;

    // Add what `samples` samples of a pixel have brought.
    void add(const Tile& tile, std::size_t tile_pixel, std::size_t film_pixel, int samples);

    int samples(std::size_t film_pixel) const { return static_cast<int>(samples_[film_pixel]); }

    // 1 for every pixel whose standard error is above `noise` times its luminance plus a tenth of the picture's mean; 0
    // for the others and for those that have `most` samples already.
    std::vector<char> noisy_pixels(float noise, int most) const;

    // The average of every layer. Leaves the sums behind in no state of use.
    Film finish();

    // All of the state, by name, for saving it and for going on from it.
    FilmState state();

  private:
    // A layer that is the sum of its parts by light group; without parts where there is one group.
    struct GroupedLayer {
        float* whole = nullptr;
        std::vector<float*> parts;
    };

    float* add_layer(const std::string& name, std::size_t channels);
    GroupedLayer add_grouped(const std::string& name);
    void finish_ids();
    float* utility(const char* name);  // null where the layout does not have it
    void increase_grouped(const GroupedLayer& layer, std::size_t film_pixel, const Rgb* groups);
    static Rgb finish_grouped(const GroupedLayer& layer, std::size_t film_pixel, float factor);
    float luminance_of_mean(std::size_t film_pixel) const;
    float variance_of_mean(std::size_t film_pixel) const;

    const FilmLayout& layout_;
    Film film_;
    std::vector<GroupedLayer> components_, planes_;
    std::vector<float*> lpes_, mattes_, refracted_mattes_;
    std::vector<std::vector<float>> id_slots_;  // by Cryptomatte: (pixels, kIdSlots, 2)
    float *uv_, *local_position_, *material_id_, *instance_id_, *point_spacing_, *lacking_, *motion_, *occlusion_,
        *bent_normal_;  // null where not asked for
    float *beauty_, *depth_, *object_id_, *normal_, *position_, *coverage_, *albedo_, *sample_count_, *variance_;
    std::vector<float> samples_;  // per pixel; exact up to 2^24
    // (pixels, kSampleSubsets): sums of the beauty's luminance, and the samples that they stand for.
    std::vector<float> subsets_, subset_samples_;
};

}  // namespace frazil
