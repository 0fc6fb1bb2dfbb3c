// Answers to the gathers that paths ask for: what ice sends from a place, to the layers of the path that came there.
// Model: a tile's requests are gathered body by body, compensated, and added to the tile by light group. What one pixel
//   asks for at places so near to each other that the exitance is linear between them is gathered once, at their mean.
//   Ice that is seen by way of other surfaces is answered from the gathers at its points (point_gathers.h).
// Units: radiance.
// Valid: thread-safe, one tile a thread; the order of requests decides the order of sums.
// Not: which gathers are asked for (path_ice.cpp).
#pragma once

#include <memory>
#include <vector>

#include "frazil/render/bodies.h"
#include "frazil/render/film_layout.h"
#include "frazil/render/tile.h"

namespace frazil {

class Gathering {
  public:
    // Everything must outlive this.
    Gathering(const Scene& scene, const std::vector<std::unique_ptr<Body>>& bodies, const FilmLayout& layout)
        : scene_(scene), bodies_(bodies), layout_(layout) {}

    // Answer the tile's requests and forget them.
    void answer(const GatherOptions& options, Tile& tile) const;

  private:
    struct Answer;
    void add_planes(const GatherRequest& request, const Rgb& weight, std::size_t base, const Answer& answer,
                    Tile& tile) const;

    void add_overlays(const GatherRequest& request, const Answer& answer, const Rgb& fill, Tile& tile) const;
    void add_taken(const GatherRequest& request, const Answer& answer, const Rgb& gain, Tile& tile) const;

    const Scene& scene_;
    const std::vector<std::unique_ptr<Body>>& bodies_;
    const FilmLayout& layout_;
};

}  // namespace frazil
