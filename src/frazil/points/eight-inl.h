// Eight floats with the few operations that points need: one register where the processor has such, else an array.
// Model: a part of each Highway target; included once a target, inside of what foreach_target.h repeats.
// Valid: the same bits on every processor: no fused operation, and sums in one order.
// Not: a vector type for everything; see hwy/highway.h.
#if defined(FRAZIL_POINTS_EIGHT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef FRAZIL_POINTS_EIGHT_INL_H_
#undef FRAZIL_POINTS_EIGHT_INL_H_
#else
#define FRAZIL_POINTS_EIGHT_INL_H_
#endif

#include <bit>
#include <cmath>
#include <cstdint>

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace frazil::HWY_NAMESPACE {

constexpr int kWide = 8;
alignas(32) constexpr float kLanes[kWide] = {0, 1, 2, 3, 4, 5, 6, 7};

#if HWY_ARCH_X86 && HWY_MAX_BYTES >= 32
namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::FixedTag<float, kWide>;
using IntTag = hn::RebindToSigned<Tag>;

struct Eight {
    hn::Vec<Tag> v;
};

HWY_INLINE Eight splat(float x) {
    return {hn::Set(Tag(), x)};
}
HWY_INLINE Eight load(const float* p) {
    return {hn::LoadU(Tag(), p)};
}
HWY_INLINE void store(Eight a, float* p) {
    hn::StoreU(a.v, Tag(), p);
}
HWY_INLINE Eight operator+(Eight a, Eight b) {
    return {hn::Add(a.v, b.v)};
}
HWY_INLINE Eight operator-(Eight a, Eight b) {
    return {hn::Sub(a.v, b.v)};
}
HWY_INLINE Eight operator*(Eight a, Eight b) {
    return {hn::Mul(a.v, b.v)};
}
HWY_INLINE Eight operator/(Eight a, Eight b) {
    return {hn::Div(a.v, b.v)};
}
// Of lanes that are not numbers, least and most give the second.
HWY_INLINE Eight least(Eight a, Eight b) {
    return {hn::Min(a.v, b.v)};
}
HWY_INLINE Eight most(Eight a, Eight b) {
    return {hn::Max(a.v, b.v)};
}
// Lane by lane x where a < b or a == b; else y.
HWY_INLINE Eight where_less(Eight a, Eight b, Eight x, Eight y) {
    return {hn::IfThenElse(hn::Lt(a.v, b.v), x.v, y.v)};
}
HWY_INLINE Eight where_equal(Eight a, Eight b, Eight x, Eight y) {
    return {hn::IfThenElse(hn::Eq(a.v, b.v), x.v, y.v)};
}
// By the sign alone, that of -0 and of no number too.
HWY_INLINE Eight where_negative(Eight a, Eight x, Eight y) {
    return {hn::IfNegativeThenElse(a.v, x.v, y.v)};
}
// A bit for each lane where a < b.
HWY_INLINE unsigned less(Eight a, Eight b) {
#if HWY_TARGET == HWY_AVX2
    return static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(a.v.raw, b.v.raw, _CMP_LT_OQ)));
#else
    return _mm256_cmp_ps_mask(a.v.raw, b.v.raw, _CMP_LT_OQ);
#endif
}
HWY_INLINE Eight permute(Eight a, const std::int32_t* lanes) {
    return {
        hn::Vec<Tag>{_mm256_permutevar8x32_ps(a.v.raw, _mm256_loadu_si256(reinterpret_cast<const __m256i*>(lanes)))}};
}
HWY_INLINE float sum(Eight a) {
    const __m128 half = _mm_add_ps(_mm256_castps256_ps128(a.v.raw), _mm256_extractf128_ps(a.v.raw, 1));
    const __m128 pair = _mm_add_ps(half, _mm_movehl_ps(half, half));
    return _mm_cvtss_f32(_mm_add_ss(pair, _mm_movehdup_ps(pair)));
}
HWY_INLINE float greatest(Eight a) {
    const __m128 half = _mm_max_ps(_mm256_castps256_ps128(a.v.raw), _mm256_extractf128_ps(a.v.raw, 1));
    const __m128 pair = _mm_max_ps(half, _mm_movehl_ps(half, half));
    return _mm_cvtss_f32(_mm_max_ss(pair, _mm_movehdup_ps(pair)));
}
// The lanes whose bits are set, one after the other; writes up to eight.
HWY_INLINE void compress(Eight a, unsigned bits, float* p) {
    const std::uint8_t byte = static_cast<std::uint8_t>(bits);
    hn::StoreU(hn::Compress(a.v, hn::LoadMaskBits(Tag(), &byte)), Tag(), p);
}
#else
struct Eight {
    float v[kWide];
};

template <class F>
HWY_INLINE Eight each(const F& f) {
    Eight r;
    for (int i = 0; i < kWide; ++i) r.v[i] = f(i);
    return r;
}
HWY_INLINE Eight splat(float x) {
    return each([&](int) { return x; });
}
HWY_INLINE Eight load(const float* p) {
    return each([&](int i) { return p[i]; });
}
HWY_INLINE void store(Eight a, float* p) {
    for (int i = 0; i < kWide; ++i) p[i] = a.v[i];
}
HWY_INLINE Eight operator+(Eight a, Eight b) {
    return each([&](int i) { return a.v[i] + b.v[i]; });
}
HWY_INLINE Eight operator-(Eight a, Eight b) {
    return each([&](int i) { return a.v[i] - b.v[i]; });
}
HWY_INLINE Eight operator*(Eight a, Eight b) {
    return each([&](int i) { return a.v[i] * b.v[i]; });
}
HWY_INLINE Eight operator/(Eight a, Eight b) {
    return each([&](int i) { return a.v[i] / b.v[i]; });
}
HWY_INLINE Eight least(Eight a, Eight b) {
    return each([&](int i) { return a.v[i] < b.v[i] ? a.v[i] : b.v[i]; });
}
HWY_INLINE Eight most(Eight a, Eight b) {
    return each([&](int i) { return a.v[i] > b.v[i] ? a.v[i] : b.v[i]; });
}
HWY_INLINE Eight where_less(Eight a, Eight b, Eight x, Eight y) {
    return each([&](int i) { return a.v[i] < b.v[i] ? x.v[i] : y.v[i]; });
}
HWY_INLINE Eight where_equal(Eight a, Eight b, Eight x, Eight y) {
    return each([&](int i) { return a.v[i] == b.v[i] ? x.v[i] : y.v[i]; });
}
HWY_INLINE Eight where_negative(Eight a, Eight x, Eight y) {
    return each([&](int i) { return std::signbit(a.v[i]) ? x.v[i] : y.v[i]; });
}
HWY_INLINE unsigned less(Eight a, Eight b) {
    unsigned bits = 0;
    for (int i = 0; i < kWide; ++i) bits |= unsigned(a.v[i] < b.v[i]) << i;
    return bits;
}
HWY_INLINE Eight permute(Eight a, const std::int32_t* lanes) {
    return each([&](int i) { return a.v[lanes[i]]; });
}
HWY_INLINE float sum(Eight a) {
    const float* v = a.v;
    return ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]));
}
HWY_INLINE float greatest(Eight a) {
    float most = a.v[0];
    for (int i = 1; i < kWide; ++i) most = a.v[i] > most ? a.v[i] : most;
    return most;
}
HWY_INLINE void compress(Eight a, unsigned bits, float* p) {
    for (; bits != 0; bits &= bits - 1) *p++ = a.v[std::countr_zero(bits)];
}
#endif

}  // namespace frazil::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
