// Memory that is read or written all over the place, on large pages where the system has them: fewer look-ups of pages.
// Valid: a hint; where it isn't taken, nothing but time is lost.
#pragma once

#include <cstddef>
#include <vector>

namespace frazil {

// Ask for large pages behind these bytes; what is smaller than some of them is left as it is.
void advise_large_pages(void* begin, std::size_t bytes);

// A vector of `count` equal values on large pages.
template <class Value>
void assign_on_large_pages(std::vector<Value>& to, std::size_t count, const Value& value = Value{}) {
    to.clear();
    to.reserve(count);
    advise_large_pages(to.data(), count * sizeof(Value));
    to.assign(count, value);
}

}  // namespace frazil
