#include "frazil/translucency/local_expansion.h"

#include <algorithm>
#include <array>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "frazil/translucency/local_expansion.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace frazil::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// out (rows, stride) = left (rows, kInner) times right (kInner, stride).
template <std::size_t kInner>
void multiply(const float* HWY_RESTRICT left, std::size_t rows, const float* HWY_RESTRICT right, std::size_t stride,
              float* HWY_RESTRICT out) {
    const hn::CappedTag<float, SumRows::kStep> d;
    const std::size_t lanes = hn::Lanes(d);
    for (std::size_t at = 0; at < stride; at += lanes) {
        hn::Vec<decltype(d)> column[kInner];
        for (std::size_t k = 0; k < kInner; ++k) column[k] = hn::LoadU(d, right + k * stride + at);
        for (std::size_t row = 0; row < rows; ++row) {
            auto even = hn::Zero(d), odd = hn::Zero(d);
            for (std::size_t k = 0; k < kInner; k += 2) {
                even = hn::MulAdd(hn::Set(d, left[row * kInner + k]), column[k], even);
                odd = hn::MulAdd(hn::Set(d, left[row * kInner + k + 1]), column[k + 1], odd);
            }
            hn::StoreU(hn::Add(even, odd), d, out + row * stride + at);
        }
    }
}

// The coefficients of values at nodes, and what they are at places.
void fit_here(const float* fit, const SumRows& nodes, SumRows& coefficients) {
    static_assert(LocalExpansion::kNodes % 2 == 0);
    multiply<LocalExpansion::kNodes>(fit, LocalExpansion::kTerms, nodes.data(), nodes.stride(), coefficients.data());
}
void eval_here(const float* terms, const SumRows& coefficients, SumRows& sums) {
    static_assert(LocalExpansion::kTerms % 2 == 0);
    multiply<LocalExpansion::kTerms>(terms, sums.size(), coefficients.data(), coefficients.stride(), sums.data());
}

}  // namespace frazil::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace frazil {
namespace {

HWY_EXPORT(fit_here);
HWY_EXPORT(eval_here);

constexpr std::size_t kNodes = LocalExpansion::kNodes, kTerms = LocalExpansion::kTerms;
constexpr float kCorner = 0.8f;  // of half a side

std::array<V3f, kNodes> make_nodes() {
    std::array<V3f, kNodes> nodes;
    nodes.fill(V3f(0.0f));  // where the last two stay
    for (int i = 0; i < 8; ++i)
        nodes[i] = V3f(i & 1 ? 1.0f : -1.0f, i & 2 ? 1.0f : -1.0f, i & 4 ? 1.0f : -1.0f) * kCorner;
    for (int axis = 0; axis < 3; ++axis) {
        nodes[8 + 2 * axis][axis] = 1.0f;
        nodes[9 + 2 * axis][axis] = -1.0f;
    }
    return nodes;
}

template <class T>
void terms_of(T x, T y, T z, T* out) {
    const T terms[kTerms] = {T(1), x, y, z, x * x, y * y, z * z, x * y, x * z, y * z};
    std::copy(terms, terms + kTerms, out);
}

// Coefficients by least squares from the values at the nodes, (kTerms, kNodes).
std::vector<float> make_fit() {
    const std::array<V3f, kNodes> nodes = make_nodes();
    double terms[kNodes][kTerms], normal[kTerms][kTerms + kNodes] = {};
    for (std::size_t j = 0; j < kNodes; ++j) terms_of<double>(nodes[j].x, nodes[j].y, nodes[j].z, terms[j]);
    for (std::size_t a = 0; a < kTerms; ++a) {
        for (std::size_t j = 0; j < kNodes; ++j) {
            for (std::size_t b = 0; b < kTerms; ++b) normal[a][b] += terms[j][a] * terms[j][b];
            normal[a][kTerms + j] = terms[j][a];
        }
    }
    // Gauss-Jordan: the normal equations are positive definite.
    for (std::size_t i = 0; i < kTerms; ++i) {
        const double pivot = normal[i][i];
        for (double& value : normal[i]) value /= pivot;
        for (std::size_t row = 0; row < kTerms; ++row) {
            const double factor = normal[row][i];
            for (std::size_t k = 0; row != i && k < kTerms + kNodes; ++k) normal[row][k] -= factor * normal[i][k];
        }
    }
    std::vector<float> fit;
    for (const auto& row : normal) fit.insert(fit.end(), row + kTerms, row + kTerms + kNodes);
    return fit;
}

}  // namespace

void LocalExpansion::place(const Box3f& box, BlockSums& nodes) {
    static const std::array<V3f, kNodes> places = make_nodes();
    const V3f half = box.size() * 0.5f;
    middle_ = box.center();
    for (int i = 0; i < 3; ++i) per_half_[i] = half[i] > 1e-6f * half.length() ? 1.0f / half[i] : 0.0f;
    for (std::size_t j = 0; j < kNodes; ++j) {
        nodes_[j] = middle_ + half * places[j];
    }
    nodes.place(nodes_.data(), kNodes);
}

void LocalExpansion::fit(const BlockSums& nodes, std::size_t groups, const LocalExpansion* above) {
    static const std::vector<float> fit = make_fit();
    values_.reset(kNodes, groups);
    if (above) above->eval(nodes_, values_);
    values_.add(0, nodes);
    coefficients_.reset(kTerms, groups);
    HWY_DYNAMIC_DISPATCH(fit_here)(fit.data(), values_, coefficients_);
}

void LocalExpansion::eval(std::span<const V3f> positions, SumRows& sums) const {
    thread_local std::vector<float> terms;
    terms.resize(positions.size() * kTerms);
    for (std::size_t i = 0; i < positions.size(); ++i) {
        V3f p = (positions[i] - middle_) * per_half_;
        for (int axis = 0; axis < 3; ++axis)
            p[axis] = std::clamp(p[axis], -1.0f, 1.0f);  // far from the origin, rounding
        terms_of(p.x, p.y, p.z, &terms[i * kTerms]);
    }
    HWY_DYNAMIC_DISPATCH(eval_here)(terms.data(), coefficients_, sums);
}

}  // namespace frazil
#endif
