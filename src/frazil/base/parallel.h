// Parallel loops over index ranges, on oneTBB.
// Model: static chunks of a given grain; the body sees [begin, end) and must write only what its indices own, so that
// results do not depend on the number of threads. Reductions sum per-chunk results in chunk order.
// Valid: called from any thread; nested calls share the same workers.
#pragma once

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/partitioner.h>
#include <oneapi/tbb/task_arena.h>
#include <oneapi/tbb/task_group.h>

#include <cstddef>
#include <vector>

namespace frazil {

// Run body(begin, end) over [0, count) in chunks of `grain` (the last one shorter).
template <class Body>
void parallel_for(std::size_t count, std::size_t grain, const Body& body) {
    const std::size_t chunks = (count + grain - 1) / grain;
    oneapi::tbb::parallel_for(
        oneapi::tbb::blocked_range<std::size_t>(0, chunks, 1),
        [&](const oneapi::tbb::blocked_range<std::size_t>& range) {
            for (std::size_t chunk = range.begin(); chunk != range.end(); ++chunk) {
                body(chunk * grain, std::min(count, (chunk + 1) * grain));
            }
        },
        oneapi::tbb::simple_partitioner());
}

// Sum term(begin, end) over chunks in chunk order: the same bits for any number of threads.
template <class T, class Term>
T parallel_sum(std::size_t count, std::size_t grain, T zero, const Term& term) {
    const std::size_t chunks = (count + grain - 1) / grain;
    std::vector<T> partial(chunks, zero);
    parallel_for(count, grain, [&](std::size_t begin, std::size_t end) { partial[begin / grain] = term(begin, end); });
    T total = zero;
    for (const T& value : partial) total += value;
    return total;
}

// Whether the loop that this thread works for is being broken off by an exception: loops inside its body then end early,
// and what they were to compute must not be used.
inline bool is_breaking_off() {
    return oneapi::tbb::is_current_task_group_canceling();
}

// Run work() with at most `threads` threads in its parallel loops; 0 means all cores.
template <class Work>
auto with_threads(int threads, const Work& work) {
    oneapi::tbb::task_arena arena(threads > 0 ? threads : oneapi::tbb::task_arena::automatic);
    return arena.execute(work);
}

}  // namespace frazil
