#include "frazil/translucency/albedo_inversion.h"

#include <algorithm>
#include <cmath>

#include "frazil/base/error.h"

namespace frazil {
namespace {

// x in [0, 1] where `error`, which falls from `above` >= 0 at 0 to `below` <= 0 at 1, is zero within `enough`.
template <class Function>
double find_zero(const Function& error, double above, double below, double enough) {
    double low = 0.0, high = 1.0;
    for (int step = 0; step < 100 && high - low > 1e-9 * high; ++step) {
        // The end that stays is weighed down; every fourth step halves.
        const double x = step % 4 == 3 ? 0.5 * (low + high) : (high * above - low * below) / (above - below);
        const double here = error(x);
        if (std::abs(here) < enough) return x;
        if (here > 0.0) {
            low = x, above = here, below *= 0.5;
        } else {
            high = x, below = here, above *= 0.5;
        }
    }
    return 0.5 * (low + high);
}

}  // namespace

Medium medium_for_profile(ProfileKind kind, const Rgb& wanted, const Rgb& mean_free_path, float eta) {
    Medium medium =
        medium_from_albedo(wanted, mean_free_path, eta);  // the dipole's; and what is out of range is refused
    if (kind == ProfileKind::dipole) return medium;
    const auto albedo_at = [&](double x) {
        const Medium unit{Rgb(static_cast<float>(1.0 - x * x)), Rgb(static_cast<float>(x * x)), eta};
        return albedo(make_profile(kind, unit, 1.0), 0);
    };
    const double most = albedo_at(0.0);
    for (int c = 0; c < 3; ++c) {
        const double a = wanted[c];
        if (a == 0.0) continue;
        if (!(a < most)) {
            throw ValueError(str("Medium: albedo must be < ", most, " for the profile ", name_of(kind), ", got ",
                                 wanted[c], ". That is what it returns where nothing is absorbed."));
        }
        const double x =
            find_zero([&](double at) { return albedo_at(at) - a; }, most - a, -a, 1e-6 * std::min(a, 1.0 - a));
        medium.sigma_s_prime[c] = static_cast<float>((1.0 - x * x) / mean_free_path[c]);
        medium.sigma_a[c] = static_cast<float>(x * x / mean_free_path[c]);
    }
    return medium;
}

}  // namespace frazil
