// trigonometry.h for Highway's vectors of float: the same polynomials in the same order, without fused multiply-add, so
// that every processor gives the bits of the scalar functions. Included once for each target, by files that use
// foreach_target.h.
#if defined(FRAZIL_BASE_TRIGONOMETRY_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef FRAZIL_BASE_TRIGONOMETRY_INL_H
#undef FRAZIL_BASE_TRIGONOMETRY_INL_H
#else
#define FRAZIL_BASE_TRIGONOMETRY_INL_H
#endif

#include <hwy/highway.h>

#include "frazil/base/trigonometry.h"

HWY_BEFORE_NAMESPACE();
namespace frazil::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

template <class D, class V, std::size_t N>
HWY_INLINE V horner(D d, const float (&terms)[N], V x) {
    V p = hn::Set(d, terms[0]);
    for (std::size_t i = 1; i < N; ++i) p = hn::Add(hn::Mul(p, x), hn::Set(d, terms[i]));
    return p;
}

template <class D, class V>
HWY_INLINE void cos_sin_turns(D d, V turns, V& cosine, V& sine) {
    const hn::RebindToSigned<D> di;
    const V four = hn::Set(d, 4.0f);
    const auto quarter = hn::ConvertTo(di, hn::Add(hn::Mul(four, turns), hn::Set(d, 0.5f)));
    const V rest = hn::Sub(turns, hn::Mul(hn::Set(d, 0.25f), hn::ConvertTo(d, quarter)));
    const V a = hn::Mul(hn::Set(d, 2.0f * kPi), rest), a2 = hn::Mul(a, a);
    const V s = hn::Mul(a, horner(d, kSineTerms, a2)), c = horner(d, kCosineTerms, a2);
    const auto is_odd = hn::RebindMask(d, hn::Ne(hn::And(quarter, hn::Set(di, 1)), hn::Zero(di)));
    const auto is_turned = hn::RebindMask(d, hn::Ne(hn::And(quarter, hn::Set(di, 2)), hn::Zero(di)));
    const V x = hn::IfThenElse(is_odd, hn::Neg(s), c), y = hn::IfThenElse(is_odd, c, s);
    cosine = hn::IfThenElse(is_turned, hn::Neg(x), x);
    sine = hn::IfThenElse(is_turned, hn::Neg(y), y);
}

template <class D, class V>
HWY_INLINE V fast_atan2(D d, V y, V x) {
    const V ax = hn::Abs(x), ay = hn::Abs(y);
    const V largest = hn::Max(hn::Max(ax, ay), hn::Set(d, 1e-37f));
    const V t = hn::Div(hn::Min(ax, ay), largest);
    V p = hn::Mul(t, horner(d, kAtanTerms, hn::Mul(t, t)));
    p = hn::IfThenElse(hn::Gt(ay, ax), hn::Sub(hn::Set(d, 0.5f * kPi), p), p);
    p = hn::IfThenElse(hn::Lt(x, hn::Zero(d)), hn::Sub(hn::Set(d, kPi), p), p);
    return hn::CopySign(p, y);
}

}  // namespace frazil::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
