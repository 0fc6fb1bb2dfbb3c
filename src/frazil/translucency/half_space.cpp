#include "frazil/translucency/half_space.h"

#include <cmath>
#include <vector>

#include "frazil/base/quadrature.h"
#include "frazil/translucency/fresnel.h"

namespace frazil {
namespace {

struct Nodes {
    std::vector<double> mu, weight;
};

// Gauss nodes over cosines, split at the critical angle, crowded there and at 0, where integrands have roots.
Nodes cosine_nodes(double critical) {
    Nodes nodes;
    const GaussRule& rule = gauss_rule_32();
    const auto add = [&](double begin, double end) {
        if (!(end > begin)) return;
        for (int i = -16; i < 16; ++i) {
            const double x = i < 0 ? -rule.node[-i - 1] : rule.node[i], w = rule.weight[i < 0 ? -i - 1 : i];
            const double s = 0.5 * (1.0 + x);
            nodes.mu.push_back(begin + (end - begin) * s * s);
            nodes.weight.push_back((end - begin) * s * w);
        }
    };
    add(0.0, critical);
    add(critical, 1.0);
    return nodes;
}

// H at the nodes: H = 1/(sqrt(1 - alpha) + alpha/2 ∫ mu' H(mu')/(mu + mu') dmu').
std::vector<double> h_function(double alpha, const Nodes& nodes) {
    const std::size_t n = nodes.mu.size();
    std::vector<double> h(n, 1.0), next(n);
    for (int step = 0; step < 2000; ++step) {
        double change = 0.0;
        for (std::size_t i = 0; i < n; ++i) {
            double sum = 0.0;
            for (std::size_t j = 0; j < n; ++j) {
                sum += nodes.weight[j] * nodes.mu[j] * h[j] / (nodes.mu[i] + nodes.mu[j]);
            }
            next[i] = 1.0 / (std::sqrt(1.0 - alpha) + 0.5 * alpha * sum);
            change = std::max(change, std::abs(next[i] - h[i]));
        }
        // Halfway steps: full ones swing about the solution.
        for (std::size_t i = 0; i < n; ++i) h[i] = 0.5 * (h[i] + next[i]);
        if (change < 1e-12) break;
    }
    return h;
}

double uncollided_fraction(double mu) {
    return mu > 0.0 ? 0.5 * (1.0 + mu * std::log1p(1.0 / mu)) : 0.5;
}

}  // namespace

HalfSpaceAlbedo half_space_albedo(double alpha, double eta) {
    if (alpha == 0.0) return {0.0, 0.0};
    const Nodes nodes = cosine_nodes(std::sqrt(1.0 - 1.0 / (eta * eta)));
    const std::size_t n = nodes.mu.size();
    const std::vector<double> h = h_function(alpha, nodes);
    // Radiance that enters from a uniform sky, per cosine inside, and the boundary's reflection from inside.
    std::vector<double> reflected(n), entered(n), inward, outward(n), straight(n);
    double entered_flux = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        reflected[i] =
            eta == 1.0 ? 0.0 : fresnel_dielectric(static_cast<float>(nodes.mu[i]), static_cast<float>(1.0 / eta));
        entered[i] = 1.0 - reflected[i];
        entered_flux += nodes.weight[i] * nodes.mu[i] * entered[i];
    }
    const auto scatter = [&](const std::vector<double>& from, bool is_single, std::vector<double>& to) {
        for (std::size_t i = 0; i < n; ++i) {
            double sum = 0.0;
            for (std::size_t j = 0; j < n; ++j) {
                const double orders = is_single ? 1.0 : h[i] * h[j];
                sum += nodes.weight[j] * orders * nodes.mu[j] / (nodes.mu[i] + nodes.mu[j]) * from[j];
            }
            to[i] = 0.5 * alpha * sum;
        }
    };
    const auto leaving = [&](const std::vector<double>& radiance) {
        double flux = 0.0;
        for (std::size_t i = 0; i < n; ++i) flux += nodes.weight[i] * nodes.mu[i] * (1.0 - reflected[i]) * radiance[i];
        return flux / entered_flux;
    };
    scatter(entered, true, straight);
    // Scatter, reflect inside, scatter again, until nothing changes.
    inward = entered;
    double all = 0.0;
    for (int step = 0; step < 2000; ++step) {
        scatter(inward, false, outward);
        const double before = all;
        all = leaving(outward);
        for (std::size_t i = 0; i < n; ++i) inward[i] = entered[i] + reflected[i] * outward[i];
        if (std::abs(all - before) < 1e-10) break;
    }
    const double single = leaving(straight);
    return {single, all - single};
}

float multiple_scattering_angle(float mu) {
    static const double mean =
        integrate_gauss32([](double s) { return 4.0 * s * s * s * uncollided_fraction(s * s); }, 0.0, 1.0);
    return static_cast<float>(uncollided_fraction(mu) / mean);
}

}  // namespace frazil
