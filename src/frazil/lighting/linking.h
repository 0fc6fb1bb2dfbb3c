// Which objects of the scene a light lights, or which cast its shadows.
// Model: a set of object indices per light (UsdLux's light:link and shadow:link, resolved by the reader); lights with
//   equal sets share one entry of the table.
// Valid: thread-safe after construction. kNoObject (a place on no object) is in every set.
// Not: collections and their rules, which are the reader's.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

namespace frazil {

inline constexpr std::uint32_t kNoObject = ~std::uint32_t(0);

// Objects of a scene by index, in any order.
struct ObjectSet {
    std::vector<std::uint32_t> objects;
};

// The distinct sets of many lights, ready for quick questions. Set 0 is "every object".
class LinkTable {
  public:
    // The number of the set; 0 for a null pointer.
    std::uint32_t add(const std::shared_ptr<const ObjectSet>& set);

    bool has(std::uint32_t set, std::uint32_t object) const {
        if (set == 0 || object == kNoObject) return true;
        const std::vector<std::uint8_t>& members = sets_[set - 1];
        return object < members.size() && members[object];
    }
    // One byte per object up to the last member; null for set 0. Lives as long as the table.
    const std::vector<std::uint8_t>* members(std::uint32_t set) const { return set == 0 ? nullptr : &sets_[set - 1]; }

  private:
    std::vector<std::vector<std::uint8_t>> sets_;
    std::map<const ObjectSet*, std::uint32_t> by_pointer_;
    std::map<std::vector<std::uint32_t>, std::uint32_t> by_objects_;
};

}  // namespace frazil
