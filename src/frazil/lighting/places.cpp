#include "frazil/lighting/places.h"

#include <algorithm>

#include "frazil/base/random.h"

namespace frazil {

void find_places(const PointSet& points, const CellSource& source, std::uint32_t point, std::vector<Place>& places) {
    places.clear();
    if (source.cells) {
        const Cells& cells = *source.cells;
        float area = 0.0f;
        for (std::uint32_t i = cells.first[point]; i < cells.first[point + 1]; ++i) {
            const CellPlace& place = cells.places[i];
            area += place.area;
            places.push_back({position_of(place, *source.mesh), normal_of(place, *source.mesh), place.area});
        }
        for (Place& place : places) place.share /= area;
    }
    if (places.empty()) places.push_back({points.positions[point], points.normals[point], 1.0f});
}

void deal(std::span<const Place> places, std::size_t begin, std::uint32_t salt, std::span<std::uint32_t> place_of) {
    if (places.size() == 1) {
        std::fill(place_of.begin(), place_of.end(), 0u);
        return;
    }
    // Steps of the golden section along the places, which leave no gaps.
    const std::uint32_t start = hash(salt, 0x706c6163U);
    std::vector<float> ends(places.size());
    float sum = 0.0f;
    for (std::size_t k = 0; k < places.size(); ++k) ends[k] = sum += places[k].share;
    for (std::size_t i = 0; i < place_of.size(); ++i) {
        const float t = to_unit_float(start + 0x9e3779b9U * std::uint32_t(begin + i)) * sum;
        const auto at = std::upper_bound(ends.begin(), ends.end() - 1, t);
        place_of[i] = std::uint32_t(at - ends.begin());
    }
}

}  // namespace frazil
