#include "frazil/translucency/half_space.h"

#include <algorithm>
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

// Light in a half space under a uniform sky of radiance 1, by the nodes of cosines inside.
struct SkyLight {
    Nodes nodes;
    std::vector<double> h, reflected;     // H; what the boundary reflects from inside
    std::vector<double> entered, inward;  // radiance that entered, and all that goes in: with what was reflected inside
    double entered_flux = 0.0;

    double flux(const std::vector<double>& radiance) const {
        double sum = 0.0;
        for (std::size_t i = 0; i < radiance.size(); ++i) {
            sum += nodes.weight[i] * nodes.mu[i] * (1.0 - reflected[i]) * radiance[i];
        }
        return sum;
    }
};

// Radiance that is scattered from `from` towards mu, where H is h_mu; H is 1 all over for one scattering.
double scattered(double alpha, double mu, double h_mu, const Nodes& nodes, const std::vector<double>& h,
                 const std::vector<double>& from) {
    double sum = 0.0;
    for (std::size_t j = 0; j < h.size(); ++j) {
        sum += nodes.weight[j] * h[j] * nodes.mu[j] / (mu + nodes.mu[j]) * from[j];
    }
    return 0.5 * alpha * h_mu * sum;
}

// Scatter, reflect inside, scatter again, until nothing changes.
SkyLight sky_light(double alpha, double eta) {
    SkyLight sky;
    sky.nodes = cosine_nodes(std::sqrt(1.0 - 1.0 / (eta * eta)));
    const std::vector<double>& mu = sky.nodes.mu;
    const std::size_t n = mu.size();
    sky.h = h_function(alpha, sky.nodes);
    sky.reflected.assign(n, 0.0);
    for (std::size_t i = 0; i < n && eta != 1.0; ++i) {
        sky.reflected[i] = fresnel_dielectric(static_cast<float>(mu[i]), static_cast<float>(1.0 / eta));
    }
    for (const double r : sky.reflected) sky.entered.push_back(1.0 - r);
    sky.inward = sky.entered;
    sky.entered_flux = sky.flux(std::vector<double>(n, 1.0));
    double before = 0.0;
    for (int step = 0; step < 2000; ++step) {
        std::vector<double> outward(n);
        for (std::size_t i = 0; i < n; ++i)
            outward[i] = scattered(alpha, mu[i], sky.h[i], sky.nodes, sky.h, sky.inward);
        for (std::size_t i = 0; i < n; ++i) sky.inward[i] = sky.entered[i] + sky.reflected[i] * outward[i];
        const double all = sky.flux(outward);
        if (std::abs(all - before) < 1e-10 * sky.entered_flux) break;
        before = all;
    }
    return sky;
}

constexpr double kShallowest = 1e-3;
constexpr std::size_t kDepths = 96;

// E2 from the nodes of cosines.
double exponential_integral_2(const Nodes& nodes, double depth) {
    double sum = 0.0;
    for (std::size_t i = 0; i < nodes.mu.size(); ++i) sum += nodes.weight[i] * std::exp(-depth / nodes.mu[i]);
    return sum;
}

// Solve a x = b by elimination; rows of `a` are dominated by their diagonals.
std::vector<double> solve(std::vector<double> a, std::vector<double> b) {
    const std::size_t n = b.size();
    for (std::size_t k = 0; k < n; ++k) {
        for (std::size_t i = k + 1; i < n; ++i) {
            const double factor = a[i * n + k] / a[k * n + k];
            for (std::size_t j = k; j < n; ++j) a[i * n + j] -= factor * a[k * n + j];
            b[i] -= factor * b[k];
        }
    }
    for (std::size_t k = n; k-- > 0;) {
        for (std::size_t j = k + 1; j < n; ++j) b[k] -= a[k * n + j] * b[j];
        b[k] /= a[k * n + k];
    }
    return b;
}

}  // namespace

// Milne's equation for B = 1 - J, constant over cells about the depths: with nothing absorbed all light comes back, so that
// B(t) = 1 - alpha + alpha/2 ∫ B(s) E1(|t - s|) ds. B is 1 below the last cell.
HalfSpaceDepths half_space_absorbed(double alpha) {
    const Nodes nodes = cosine_nodes(0.0);
    // Diffusion's decay, in closed form; light of single scattering reaches further where albedos are low.
    const double decay = std::sqrt(3.0 * (1.0 - alpha)), deepest = 25.0 / std::min(decay, 1.0);
    const double step = std::log(deepest / kShallowest) / double(kDepths - 1);
    HalfSpaceDepths result;
    std::vector<double> edges{0.0};
    for (std::size_t i = 0; i < kDepths; ++i) {
        result.depths.push_back(kShallowest * std::exp(step * double(i)));
        edges.push_back(result.depths.back() * std::exp(0.5 * step));
    }
    const auto e2 = [&](double depth) { return exponential_integral_2(nodes, depth); };
    std::vector<double> matrix(kDepths * kDepths), right(kDepths);
    for (std::size_t i = 0; i < kDepths; ++i) {
        const double depth = result.depths[i];
        std::vector<double> to_edge;
        for (const double edge : edges) to_edge.push_back(e2(std::abs(edge - depth)));
        right[i] = 1.0 - alpha + 0.5 * alpha * to_edge[kDepths];
        for (std::size_t j = 0; j < kDepths; ++j) {
            const double share = j == i ? 2.0 - to_edge[j] - to_edge[j + 1] : std::abs(to_edge[j] - to_edge[j + 1]);
            matrix[i * kDepths + j] = (i == j ? 1.0 : 0.0) - 0.5 * alpha * share;
        }
    }
    result.absorbed = solve(std::move(matrix), std::move(right));
    return result;
}

HalfSpaceAlbedo half_space_albedo(double alpha, double eta) {
    if (alpha == 0.0) return {0.0, 0.0};
    const SkyLight sky = sky_light(alpha, eta);
    const std::size_t n = sky.h.size();
    const std::vector<double> ones(n, 1.0);
    std::vector<double> once(n), all(n);
    for (std::size_t i = 0; i < n; ++i) {
        const double mu = sky.nodes.mu[i];
        once[i] = scattered(alpha, mu, 1.0, sky.nodes, ones, sky.entered);
        all[i] = scattered(alpha, mu, sky.h[i], sky.nodes, sky.h, sky.inward);
    }
    const double single = sky.flux(once) / sky.entered_flux;
    return {single, sky.flux(all) / sky.entered_flux - single};
}

DirectionalAlbedo::DirectionalAlbedo(double alpha, double eta, double less_once) {
    values_.fill(1.0f);
    if (alpha == 0.0) return;
    const SkyLight sky = sky_light(alpha, eta);
    const std::vector<double> ones(sky.h.size(), 1.0);
    const HalfSpaceAlbedo exact = half_space_albedo(alpha, eta);
    const double mean = exact.multiple + (1.0 - less_once) * exact.single;
    for (int i = 0; i <= kSteps; ++i) {
        const double root = double(i) / kSteps, mu = root * root;
        // H(mu) from H at the nodes.
        const double h = 1.0 / (std::sqrt(1.0 - alpha) + scattered(alpha, mu, 1.0, sky.nodes, sky.h, ones));
        const double all = scattered(alpha, mu, h, sky.nodes, sky.h, sky.inward);
        const double once = less_once * scattered(alpha, mu, 1.0, sky.nodes, ones, sky.entered);
        values_[std::size_t(i)] = static_cast<float>((all - once) / mean);
    }
}

float DirectionalAlbedo::operator()(float mu) const {
    const float x = std::sqrt(std::clamp(mu, 0.0f, 1.0f)) * kSteps;
    const int i = std::min(static_cast<int>(x), kSteps - 1);
    const float f = x - static_cast<float>(i);
    return values_[std::size_t(i)] * (1.0f - f) + values_[std::size_t(i) + 1] * f;
}

}  // namespace frazil
