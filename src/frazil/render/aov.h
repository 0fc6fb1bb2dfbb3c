// The one table of AOVs: film, EXR, command line and docs are driven by it.
// Model: additive layers sum to the beauty, exactly in the film.
// Units: by row.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace frazil {

enum class AovFilter {
    average,  // mean over samples, pixel filter applied
    nearest,  // the sample nearest to the camera, unfiltered
};

struct Aov {
    std::string_view name;
    std::string_view channels;  // one letter each, as in "RGB"
    std::string_view meaning;
    AovFilter filter;
    bool is_additive;  // a part of the beauty
    bool is_half;      // stored as half in the EXR unless asked otherwise
    bool is_default;   // made without being asked for
};

std::span<const Aov> aov_table();

// The row of that name; nullptr where there is none.
const Aov* find_aov(std::string_view name);

// ValueError for a name that is not in the table, or is there twice.
void check_aovs(std::span<const std::string> names);

}  // namespace frazil
