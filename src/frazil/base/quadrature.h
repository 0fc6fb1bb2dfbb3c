// Numerical integration of smooth functions on an interval.
// Model: Gauss-Legendre with 32 nodes: exact for polynomials of degree 63.
// Units: those of the integrand.
// Valid: finite intervals, integrands smooth inside; split where there is a kink.
// Not: adaptive; the caller knows where its function bends.
#pragma once

#include <array>
#include <cmath>

namespace frazil {

struct GaussRule {
    std::array<double, 16> node, weight;  // the positive half; the other is its mirror image
};

// Nodes and weights by Newton's method on the Legendre polynomial, once.
inline const GaussRule& gauss_rule_32() {
    static const GaussRule rule = [] {
        GaussRule made{};
        for (int i = 0; i < 16; ++i) {
            double x = std::cos(3.14159265358979323846 * (i + 0.75) / 32.5), slope = 1.0;
            for (int step = 0; step < 8; ++step) {
                double previous = 1.0, value = x;
                for (int n = 2; n <= 32; ++n) {
                    const double next = ((2 * n - 1) * x * value - (n - 1) * previous) / n;
                    previous = value;
                    value = next;
                }
                slope = 32.0 * (x * value - previous) / (x * x - 1.0);
                x -= value / slope;
            }
            made.node[i] = x;
            made.weight[i] = 2.0 / ((1.0 - x * x) * slope * slope);
        }
        return made;
    }();
    return rule;
}

// ∫ f over [begin, end].
template <class Function>
double integrate_gauss32(const Function& f, double begin, double end) {
    const GaussRule& rule = gauss_rule_32();
    const double middle = 0.5 * (begin + end), half = 0.5 * (end - begin);
    double sum = 0.0;
    for (int i = 0; i < 16; ++i) {
        sum += rule.weight[i] * (f(middle - half * rule.node[i]) + f(middle + half * rule.node[i]));
    }
    return sum * half;
}

}  // namespace frazil
