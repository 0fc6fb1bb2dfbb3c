// Answers to the gathers that paths ask for: what ice sends from a place, to the layers of the path that came there.
// Model: a tile's requests are gathered body by body, compensated, and added to the tile by light group. What one pixel
//   asks for at places so near to each other that the exitance is linear between them is gathered once, at their mean.
//   Ice that is seen by way of other surfaces is answered from the gathers at its points (point_gathers.h).
// Units: radiance.
// Valid: thread-safe, one tile a thread; the order of requests decides the order of sums.
// Not: which gathers are asked for (path_ice.cpp).
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "frazil/render/bodies.h"
#include "frazil/render/entering_light.h"
#include "frazil/render/film_layout.h"
#include "frazil/render/tile.h"

namespace frazil {

class Gathering {
  public:
    // Everything must outlive this. Without `entering_light` requests bring what enters with them.
    Gathering(const Scene& scene, const std::vector<std::unique_ptr<Body>>& bodies, const FilmLayout& layout,
              const EnteringLight* entering_light = nullptr)
        : scene_(scene), bodies_(bodies), layout_(layout), entering_light_(entering_light) {}

    // Answer the tile's requests and forget them.
    void answer(const GatherOptions& options, Tile& tile) const;

  private:
    struct Answer;
    struct Answers;
    using Requests = std::span<GatherRequest* const>;

    // Gather where the camera sees the body itself; blend the gathers at its points, where there are any, for the rest, and
    // those of a lattice inside.
    static Answers answers_for(const Body& body, Requests requests, const GatherOptions& options);
    void ask_entering_light(const Body& body, Requests requests, const Answers& answers, const Tile& tile) const;
    void add_planes(const GatherRequest& request, const Rgb& weight, std::size_t base, const Answer& answer,
                    Tile& tile) const;

    void add_overlays(const GatherRequest& request, const Answer& answer, const Rgb& fill, Tile& tile) const;
    void add_taken(const GatherRequest& request, const Answer& answer, const Rgb& gain, Tile& tile) const;

    const Scene& scene_;
    const std::vector<std::unique_ptr<Body>>& bodies_;
    const FilmLayout& layout_;
    const EnteringLight* entering_light_;
};

}  // namespace frazil
