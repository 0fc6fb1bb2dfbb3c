#include <doctest/doctest.h>

#include <cstdint>
#include <vector>

#include "frazil/base/vec.h"

TEST_CASE("large arrays begin at large pages, small ones and those of no size are as ever") {
#if defined(__linux__) && !defined(__SANITIZE_ADDRESS__)
    const std::vector<frazil::V3f> large(std::size_t(1) << 20, frazil::V3f(0.5f));
    CHECK(reinterpret_cast<std::uintptr_t>(large.data()) % (std::uintptr_t(1) << 21) == 0);
    CHECK(large.back() == frazil::V3f(0.5f));
#endif
    std::vector<std::vector<char>> small;
    for (std::size_t size = 1; size < (std::size_t(1) << 23); size = 2 * size + 1) {
        small.emplace_back(size, char(size));
        CHECK(small.back().back() == char(size));
    }
    void* none = ::operator new(0);
    CHECK(none != nullptr);
    ::operator delete(none);
}
