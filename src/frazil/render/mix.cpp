#include "frazil/render/mix.h"

#include <algorithm>

#include "frazil/base/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "frazil/render/mix.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace frazil::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Float = hn::CappedTag<float, 16>;
using Half = hn::Rebind<hwy::float16_t, Float>;

HWY_INLINE hn::Vec<Float> load(const float* from) {
    return hn::LoadU(Float(), from);
}
HWY_INLINE hn::Vec<Float> load(const std::uint16_t* from) {
    const Half d;
    return hn::PromoteTo(Float(), hn::LoadU(d, reinterpret_cast<const hwy::float16_t*>(from)));
}

// out += weight * layer for `count` values, whose first belongs to channel 0. Three vectors hold all phases of RGB.
template <class T>
void add_scaled(const T* layer, const float* weights, std::size_t count, float* out) {
    const Float d;
    const std::size_t lanes = hn::Lanes(d);
    const auto w0 = hn::LoadU(d, weights), w1 = hn::LoadU(d, weights + lanes), w2 = hn::LoadU(d, weights + 2 * lanes);
    const auto step = [&](std::size_t at, auto w) HWY_ATTR {
        hn::StoreU(hn::Add(hn::LoadU(d, out + at), hn::Mul(w, load(layer + at))), d, out + at);
    };
    for (std::size_t at = 0; at + 3 * lanes <= count; at += 3 * lanes) {
        step(at, w0);
        step(at + lanes, w1);
        step(at + 2 * lanes, w2);
    }
}

std::size_t lanes_here() {
    return hn::Lanes(Float());
}

void add_halves_here(const std::uint16_t* layer, const float* weights, std::size_t count, float* out) {
    add_scaled(layer, weights, count, out);
}

void add_floats_here(const float* layer, const float* weights, std::size_t count, float* out) {
    add_scaled(layer, weights, count, out);
}

}  // namespace frazil::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace frazil {
namespace {

HWY_EXPORT(lanes_here);
HWY_EXPORT(add_halves_here);
HWY_EXPORT(add_floats_here);

constexpr std::size_t kMostLanes = 16;
constexpr std::size_t kBlock = 48 * 85;  // values that stay in the first cache; a multiple of 3 vectors of any width

}  // namespace

void mix(std::span<const MixLayer> layers, std::size_t pixels, float* out) {
    const std::size_t lanes = HWY_DYNAMIC_DISPATCH(lanes_here)(), count = 3 * pixels;
    parallel_for(count, 8 * kBlock, [&](std::size_t chunk_begin, std::size_t chunk_end) {
        float weights[3 * kMostLanes], padded[3 * kMostLanes], padded_out[3 * kMostLanes];
        std::uint16_t padded_halves[3 * kMostLanes];
        for (std::size_t begin = chunk_begin; begin < chunk_end; begin += kBlock) {
            const std::size_t end = std::min(begin + kBlock, chunk_end);
            // Whole vectors first; what is left at the picture's end goes through a padded copy.
            const std::size_t whole = (end - begin) / (3 * lanes) * (3 * lanes), rest = end - begin - whole;
            std::fill(out + begin, out + end, 0.0f);
            for (const MixLayer& layer : layers) {
                for (std::size_t i = 0; i < 3 * lanes; ++i) weights[i] = layer.weight[static_cast<int>(i % 3)];
                std::fill(padded_out, padded_out + 3 * kMostLanes, 0.0f);
                std::copy(out + begin + whole, out + end, padded_out);
                if (layer.halves) {
                    HWY_DYNAMIC_DISPATCH(add_halves_here)(layer.halves + begin, weights, whole, out + begin);
                    std::fill(padded_halves, padded_halves + 3 * kMostLanes, std::uint16_t(0));
                    std::copy(layer.halves + begin + whole, layer.halves + end, padded_halves);
                    HWY_DYNAMIC_DISPATCH(add_halves_here)(padded_halves, weights, 3 * lanes, padded_out);
                } else {
                    HWY_DYNAMIC_DISPATCH(add_floats_here)(layer.floats + begin, weights, whole, out + begin);
                    std::fill(padded, padded + 3 * kMostLanes, 0.0f);
                    std::copy(layer.floats + begin + whole, layer.floats + end, padded);
                    HWY_DYNAMIC_DISPATCH(add_floats_here)(padded, weights, 3 * lanes, padded_out);
                }
                std::copy(padded_out, padded_out + rest, out + begin + whole);
            }
        }
    });
}

}  // namespace frazil
#endif
