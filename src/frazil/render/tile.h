// The sums of one tile of pixels while its samples are traced.
// Model: additive light is summed per pixel, component and light group; utility AOVs beside it. A contribution that is
//   not finite is dropped and counted. One tile belongs to one thread.
// Units: radiance.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/render/cryptomatte.h"

namespace frazil {

// The additive rows of the AOV table, in its order.
enum class Component { translucency, diffuse, specular, refraction, volume, emission, background };
inline constexpr std::size_t kComponentCount = 7;
inline constexpr std::array<const char*, kComponentCount> kComponentNames = {
    "translucency", "diffuse", "specular", "refraction", "volume", "emission", "background"};
// A pixel's samples are dealt in runs to so many subsets, whose spread tells the noise of all together. A run of four is a
// net of its own; samples dealt one by one would share a quarter of the sampler's first dimension.
inline constexpr int kSampleSubsets = 4, kSubsetRun = 4;
inline int subset_of(int sample) {
    return sample / kSubsetRun % kSampleSubsets;
}

// What the camera sees first along one sample.
struct PrimaryHit {
    float depth = std::numeric_limits<float>::infinity();
    V3f position = V3f(0.0f);
    std::uint32_t object_id = 0;
    V2f st = V2f(0.0f);
    V3f local_position = V3f(0.0f);
    V2f motion = V2f(0.0f);  // of the background where nothing is hit
};

// A place on the surface of ice where light may enter (entering_light.h).
struct EnteringPlace {
    std::uint32_t object = 0;
    V3f position = V3f(0.0f), normal = V3f(0.0f), geometric_normal = V3f(0.0f);
    float roughness = 0.0f;             // of the boundary
    float bare = 1.0f;                  // what overlays let through
    float u_pick = 0.0f, u_ask = 0.0f;  // choose a light, and whether it is asked at all
    V2f u = V2f(0.0f);                  // chooses a direction
};

// Exitance wanted at a place on ice, and what becomes of it.
struct GatherRequest {
    std::uint32_t object = 0;
    std::uint32_t pixel = 0;
    int subset = 0;                                // of the pixel's samples
    bool is_primary = false;                       // seen by the camera itself
    float samples = 1.0f;                          // of the camera that the request stands for
    V3f position = V3f(0.0f), normal = V3f(0.0f);  // as in IceCore
    float depth = 0.0f;                            // as in IceCore
    Rgb plane = Rgb(1.0f);                         // what of even light a half space's core sends there
    // Where the rest is absorbed, on the mean: the place, and Body::absorbed_at.
    V3f absorbing = V3f(0.0f);
    Rgb absorbed_at = Rgb(0.0f);
    // Radiance per exitance, by the layer that it goes to: the primary ice's is translucency, further light goes the way of
    // its first lobe.
    Rgb translucency = Rgb(0.0f), diffuse = Rgb(0.0f), specular = Rgb(0.0f), refraction = Rgb(0.0f);
    // Light that enters right here, for the compensation that fills up; its light group.
    Rgb entering = Rgb(0.0f);
    std::uint32_t entering_group = 0;
    // Where that is: an index into Tile::entering_places; its light is asked for when it is known how much fills up.
    static constexpr std::uint32_t kNowhere = ~std::uint32_t(0);
    std::uint32_t entering_place = kNowhere;
    // Of light path expressions: number, state, radiance per exitance.
    struct Lpe {
        std::uint32_t lpe = 0, state = 0;
        Rgb weight = Rgb(0.0f);
    };
    std::vector<Lpe> lpes;
    // Of the overlays where the path began: their plane, and the change of its light through diffuse reflection, from the
    // core and through the surface.
    struct Overlay {
        std::size_t plane = 0;
        Rgb diffuse = Rgb(0.0f), core = Rgb(0.0f), seen_through = Rgb(0.0f);
    };
    std::uint32_t first_overlay = 0, overlay_count = 0;  // in Tile::overlays
};

// Where a sample's path first meets a surface, for the layers of its openness; `u` chooses a direction.
struct SeenPlace {
    std::uint32_t pixel = 0, object = 0;
    V3f position = V3f(0.0f), normal = V3f(0.0f);
    V2f u = V2f(0.0f);
};

class Tile {
  public:
    // `planes` of translucency, `lpes`, light path expressions, and `mattes` beside the components: see FilmLayout.
    Tile(std::size_t pixels, std::size_t groups, std::size_t planes = 0, std::size_t lpes = 0, std::size_t mattes = 0)
        : groups_(groups),
          plane_count_(planes),
          lpe_count_(lpes),
          matte_count_(mattes),
          light_(pixels * kComponentCount * groups, Rgb(0.0f)),
          planes_(pixels * planes * groups, Rgb(0.0f)),
          lpes_(pixels * lpes, Rgb(0.0f)),
          mattes_(2 * pixels * mattes, 0.0f),
          luminance_(pixels * kSampleSubsets),
          subset_samples_(pixels * kSampleSubsets, 0.0f),
          normal_(pixels, V3f(0.0f)),
          albedo_(pixels, Rgb(0.0f)),
          coverage_(pixels, Rgb(0.0f)),
          lacking_(pixels, Rgb(0.0f)),
          hits_(pixels),
          nearest_(pixels),
          openness_(pixels, 0.0f),
          open_directions_(pixels, V3f(0.0f)),
          objects_(2 * pixels) {}

    // The next light is of a shaded sample that stands for so many of the camera.
    void begin_shaded(std::size_t pixel, int of_subset, float samples) {
        subset = of_subset;
        subset_samples_[pixel * kSampleSubsets + std::size_t(of_subset)] += samples;
    }

    void add(std::size_t pixel, Component component, std::size_t group, const Rgb& radiance) {
        if (!is_finite(radiance)) {
            ++dropped_samples;
            return;
        }
        light_[(pixel * kComponentCount + static_cast<std::size_t>(component)) * groups_ + group] += radiance;
        luminance_[pixel * kSampleSubsets + subset] += luminance(radiance);
    }

    void add_to_plane(std::size_t pixel, std::size_t plane, std::size_t group, const Rgb& radiance) {
        if (is_finite(radiance)) planes_[(pixel * plane_count_ + plane) * groups_ + group] += radiance;
    }

    void add_lpe(std::size_t pixel, std::size_t lpe, const Rgb& radiance) {
        if (is_finite(radiance)) lpes_[pixel * lpe_count_ + lpe] += radiance;
    }

    // How much of a sample shows a matte's objects; `seen_through` ice or directly.
    void add_matte(std::size_t pixel, std::size_t matte, bool seen_through, float weight) {
        if (std::isfinite(weight)) mattes_[(2 * pixel + (seen_through ? 1 : 0)) * matte_count_ + matte] += weight;
    }

    // What samples show first; `seen_through` ice or directly.
    void add_object(std::size_t pixel, std::uint32_t object, bool seen_through, float samples = 1.0f) {
        count_id(objects_[seen_through ? hits_.size() + pixel : pixel], object, samples);
    }

    // Count a sample that shows something; whether that is nearer than all before.
    bool add_hit(std::size_t pixel, float depth) {
        ++hits_[pixel];
        return depth < nearest_[pixel].depth;
    }
    void set_nearest(std::size_t pixel, const PrimaryHit& hit) { nearest_[pixel] = hit; }

    // What shading finds where a sample sees a surface, for as many samples as it stands for.
    void add_shaded(std::size_t pixel, const V3f& normal, const Rgb& albedo, float samples) {
        normal_[pixel] += normal * samples;
        albedo_[pixel] += albedo * samples;
    }

    // Where a sample shows nothing.
    void add_background(std::size_t pixel, const V2f& motion) {
        if (std::isinf(nearest_[pixel].depth)) nearest_[pixel].motion = motion;
    }

    void add_coverage(std::size_t pixel, const Rgb& coverage, const Rgb& lacking) {
        coverage_[pixel] += coverage;
        lacking_[pixel] += lacking;
    }

    // The share of the hemisphere that is open, and the mean of the open directions times it.
    void add_openness(std::size_t pixel, float openness, const V3f& directions) {
        openness_[pixel] += openness;
        open_directions_[pixel] += directions;
    }

    const Rgb& light(std::size_t pixel, std::size_t component, std::size_t group) const {
        return light_[(pixel * kComponentCount + component) * groups_ + group];
    }
    float subset_luminance(std::size_t pixel, int of_subset) const {
        return luminance_[pixel * kSampleSubsets + of_subset];
    }
    float subset_samples(std::size_t pixel, int of_subset) const {
        return subset_samples_[pixel * kSampleSubsets + of_subset];
    }
    const Rgb& albedo(std::size_t pixel) const { return albedo_[pixel]; }
    // One value per light group.
    const Rgb* plane(std::size_t pixel, std::size_t plane) const {
        return &planes_[(pixel * plane_count_ + plane) * groups_];
    }
    const Rgb& lpe(std::size_t pixel, std::size_t lpe) const { return lpes_[pixel * lpe_count_ + lpe]; }
    float matte(std::size_t pixel, std::size_t matte, bool seen_through) const {
        return mattes_[(2 * pixel + (seen_through ? 1 : 0)) * matte_count_ + matte];
    }
    const V3f& normal(std::size_t pixel) const { return normal_[pixel]; }
    const Rgb& coverage(std::size_t pixel) const { return coverage_[pixel]; }
    const Rgb& lacking(std::size_t pixel) const { return lacking_[pixel]; }
    const IdCounts& objects(std::size_t pixel, bool seen_through) const {
        return objects_[seen_through ? hits_.size() + pixel : pixel];
    }
    float openness(std::size_t pixel) const { return openness_[pixel]; }
    const V3f& open_directions(std::size_t pixel) const { return open_directions_[pixel]; }
    std::uint32_t hits(std::size_t pixel) const { return hits_[pixel]; }
    const PrimaryHit& nearest(std::size_t pixel) const { return nearest_[pixel]; }

    std::vector<GatherRequest> requests;
    // Of all requests.
    std::vector<GatherRequest::Overlay> overlays;
    std::vector<EnteringPlace> entering_places;
    std::span<const GatherRequest::Overlay> overlays_of(const GatherRequest& request) const {
        return {overlays.data() + request.first_overlay, request.overlay_count};
    }
    std::vector<SeenPlace> places;
    bool keeps_places = false;
    int subset = 0;  // of the sample that is traced or gathered now
    std::uint64_t camera_rays = 0, rays = 0, gathers = 0, dropped_samples = 0;

  private:
    std::size_t groups_, plane_count_, lpe_count_, matte_count_;
    std::vector<Rgb> light_, planes_, lpes_;
    std::vector<float> mattes_;                      // (pixels, directly or through ice, mattes)
    std::vector<float> luminance_, subset_samples_;  // by subset
    std::vector<V3f> normal_;
    std::vector<Rgb> albedo_;
    std::vector<Rgb> coverage_, lacking_;
    std::vector<std::uint32_t> hits_;
    std::vector<PrimaryHit> nearest_;
    std::vector<float> openness_;
    std::vector<V3f> open_directions_;
    std::vector<IdCounts> objects_;  // per pixel, seen directly; then once more, seen through ice
};

}  // namespace frazil
