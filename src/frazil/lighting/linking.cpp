#include "frazil/lighting/linking.h"

#include <algorithm>

namespace frazil {

std::uint32_t LinkTable::add(const std::shared_ptr<const ObjectSet>& set) {
    if (!set) return 0;
    const auto known = by_pointer_.find(set.get());
    if (known != by_pointer_.end()) return known->second;
    std::vector<std::uint32_t> objects = set->objects;
    std::sort(objects.begin(), objects.end());
    objects.erase(std::unique(objects.begin(), objects.end()), objects.end());
    const auto [entry, is_new] = by_objects_.emplace(objects, std::uint32_t(sets_.size()) + 1);
    if (is_new) {
        sets_.emplace_back(objects.empty() ? 0 : std::size_t(objects.back()) + 1, std::uint8_t(0));
        for (const std::uint32_t object : objects) sets_.back()[object] = 1;
    }
    by_pointer_.emplace(set.get(), entry->second);
    return entry->second;
}

}  // namespace frazil
