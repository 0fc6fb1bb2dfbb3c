// Large arrays lie on large pages: points, meshes, sums and tables are read here and there, and with pages of 4 KiB nearly
// every such read looks the page up in memory first.
// Model: the global operator new aligns what is larger than such a page to it and advises the kernel, as NumPy does for its
//   arrays [madvise(2), MADV_HUGEPAGE]; all memory is malloc's, so that whoever deletes it may simply free it.
// Valid: Linux; elsewhere, where the kernel has none to give and under sanitizers nothing changes but the pages.
// Not: what libraries allocate themselves (Embree asks for large pages of its own accord).
#include <cstdlib>
#include <new>

#if defined(__linux__) && !defined(__SANITIZE_ADDRESS__)
#include <sys/mman.h>

namespace {

constexpr std::size_t kLargePage = std::size_t(1) << 21, kLeast = 2 * kLargePage;

void* allocate(std::size_t size) {
    if (size < kLeast) return std::malloc(size > 0 ? size : 1);
    const std::size_t whole = (size + kLargePage - 1) / kLargePage * kLargePage;
    void* memory = std::aligned_alloc(kLargePage, whole);
    if (memory) madvise(memory, whole, MADV_HUGEPAGE);
    return memory;
}

}  // namespace

void* operator new(std::size_t size) {
    while (true) {
        if (void* memory = allocate(size)) return memory;
        const std::new_handler handler = std::get_new_handler();
        if (!handler) throw std::bad_alloc();
        handler();
    }
}

void operator delete(void* memory) noexcept {
    std::free(memory);
}

void operator delete(void* memory, std::size_t) noexcept {
    std::free(memory);
}

#endif
