// The shadow rays that the bake of irradiance sends from a point: one light's, or a crowd's, with what each would bring.
// Model: irradiance.h.
// Units: values in W/m².
// Valid: the same rays for any number of threads, whatever the other lights; a workspace serves one thread.
// Not: whether the light arrives.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "frazil/base/sampler.h"
#include "frazil/lighting/irradiance.h"
#include "frazil/lighting/light_picker.h"
#include "frazil/lighting/light_sampling.h"
#include "frazil/lighting/places.h"

namespace frazil {

// cos * T(cos), read linearly from a table.
class EntryTable {
  public:
    explicit EntryTable(const Transmittance& transmittance);
    Rgb operator()(float cosine) const {
        const float x = std::min(cosine, 1.0f) * kSteps;
        const int i = int(x);
        const float f = x - float(i);
        return (values_[std::size_t(i)] * (1.0f - f) + values_[std::size_t(i) + 1] * f) * cosine;
    }

  private:
    static constexpr int kSteps = 1024;
    std::vector<Rgb> values_;
};

// The rays of one light, or crowd, at one point, and room for making them: kept from point to point.
struct BakeRays {
    std::vector<Place> places;            // of the point at hand
    std::vector<std::uint32_t> place_of;  // by sample
    std::vector<std::uint32_t> order;     // samples, place after place
    std::vector<V2f> drawn;
    std::vector<std::size_t> counts;
    std::vector<std::uint32_t> kept;  // the ray's index in order of place
    std::vector<V2f> u;
    std::vector<LightSample> samples;
    std::vector<Ray> rays;
    std::vector<Rgb> values;               // what each ray brings where nothing is in its way
    std::vector<std::uint32_t> sample_of;  // the ray's index among the samples as they were drawn
    std::vector<int> lights;               // of each ray, in a crowd
    std::vector<V3f> directions;           // of a dome's lookups, and what they give
    std::vector<float> pdfs;
    std::vector<Rgb> radiances;
    LightPicker::Weights weights;
    std::size_t count = 0;      // samples that the rays stand for
    std::uint64_t dropped = 0;  // samples that are not finite
    std::uint32_t part = 0;     // of the points' sequence, which samples are this point's: its number in the curve
};

// A light that reaches the component, or a crowd of them, and where its irradiance goes.
struct BakeTask {
    int light;  // -1 = the crowd
    std::size_t group;
    float multiplier;
    std::shared_ptr<const LightPicker> crowd;
};

// The lights of a component with a multiplier other than 0, and of each group with more than kCrowd lights with a surface
// these as one crowd. `groups` are the sampler's.
std::vector<BakeTask> bake_tasks(const LightSampler& sampler, const std::vector<std::string>& groups,
                                 LightComponent component);

// Makes the rays; what it is made of must outlive it.
class RayMaker {
  public:
    RayMaker(const PointSet& points, const LightSampler& lights, const EntryTable& entry,
             const IrradianceOptions& options);

    // Fill rays.places with where the rays of a point start.
    void find_places(std::uint32_t point, BakeRays& rays) const;
    // Fill rays.rays, values, sample_of, place_of, lights and count; find_places comes first. Rounds are independent of one
    // another.
    void make_rays(std::uint32_t point, const BakeTask& task, std::uint32_t round, BakeRays& rays) const;

  private:
    std::uint32_t object_of(std::uint32_t point) const;
    // Deal the samples [begin, end) out to the places, by their shares, so that those that follow one another go to
    // different places, and bring them and their u in order of place.
    static void spread(std::size_t begin, std::size_t end, std::uint32_t salt, BakeRays& rays);
    // A light that needs one ray alone gets one from every place, unless there are more of these than samples.
    static void one_each(const WorldLight& light, BakeRays& rays);
    // Half of the samples by cosine, half by the image (or portals), each a net of its own, under the balance heuristic [Veach1995]:
    // the density of a sample is the mean of both techniques', by their shares.
    void sample_dome(const WorldLight& dome, std::uint32_t point, std::uint32_t seed, BakeRays& rays) const;
    // Each sample picks a light of the crowd.
    void sample_crowd(const LightPicker& crowd, std::uint32_t point, std::uint32_t seed, BakeRays& rays) const;
    // Keep the samples that can bring light: L T cos / pdf and the ray that asks whether it arrives.
    void keep_useful(BakeRays& rays) const;

    const PointSet& points_;
    const LightSampler& lights_;
    const EntryTable& entry_;
    const IrradianceOptions& options_;
    // A (0,m,2)-net for every point. All lights share it: a light and its negative twin then cancel to the bit, and a
    // light's share does not depend on the others.
    const ScrambledNet whole_, first_half_, second_half_;
};

}  // namespace frazil
