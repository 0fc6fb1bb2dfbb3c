#include "frazil/translucency/compensation.h"

#include "frazil/base/error.h"

namespace frazil {
namespace {

// W/Rd_total, or 1 in a channel that reflects nothing.
Rgb covered_fraction(const Rgb& coverage, const Rgb& albedo, bool by_luminance) {
    if (by_luminance) {
        const float total = luminance(albedo);
        return Rgb(total > 0.0f ? luminance(coverage) / total : 1.0f);
    }
    Rgb fraction(1.0f);
    for (int c = 0; c < 3; ++c) {
        if (albedo[c] > 0.0f) fraction[c] = coverage[c] / albedo[c];
    }
    return fraction;
}

}  // namespace

bool keeps_energy(CompensationMode mode) {
    return mode == CompensationMode::conserve || mode == CompensationMode::depth;
}

const char* compensation_name(CompensationMode mode) {
    switch (mode) {
        case CompensationMode::off:
            return "off";
        case CompensationMode::ratio:
            return "ratio";
        case CompensationMode::conserve:
            return "conserve";
        case CompensationMode::depth:
            return "depth";
        case CompensationMode::fill:
            return "fill";
        case CompensationMode::linear:
            return "linear";
    }
    return "";
}

void check_compensation(const Compensation& compensation, const std::string& path) {
    if (!(compensation.limit >= 1.0f && std::isfinite(compensation.limit))) {
        throw ValueError(str(path, ": limit must be >= 1 and finite, got ", compensation.limit, ". It caps the gain."));
    }
    if (!(compensation.strength >= 0.0f && compensation.strength <= 1.0f)) {
        throw ValueError(str(path, ": strength must be in [0, 1], got ", compensation.strength, ". 1 is all of it."));
    }
}

Rgb compensation_gain(const Compensation& compensation, const Rgb& coverage, const Rgb& albedo) {
    const Rgb covered = covered_fraction(coverage, albedo, compensation.by_luminance);
    Rgb gain(1.0f);
    for (int c = 0; c < 3; ++c) {
        const float lacking = 1.0f - covered[c];
        switch (compensation.mode) {
            case CompensationMode::off:
            case CompensationMode::fill:
                break;
            case CompensationMode::ratio:
                if (lacking > 0.0f) gain[c] = 1.0f / std::max(covered[c], 1.0f / compensation.limit);
                break;
            case CompensationMode::conserve:
            case CompensationMode::depth:
                gain[c] = 1.0f / std::max(covered[c], 1.0f / compensation.limit);
                break;
            case CompensationMode::linear:
                if (lacking > 0.0f) gain[c] = std::min(1.0f + lacking, compensation.limit);
                break;
        }
        gain[c] = 1.0f + compensation.strength * (gain[c] - 1.0f);
    }
    return gain;
}

Rgb fill_amount(const Compensation& compensation, const Rgb& coverage, const Rgb& albedo) {
    if (compensation.mode != CompensationMode::fill) return Rgb(0.0f);
    const Rgb covered = covered_fraction(coverage, albedo, compensation.by_luminance);
    Rgb amount(0.0f);
    for (int c = 0; c < 3; ++c) {
        amount[c] = compensation.strength * std::max(0.0f, 1.0f - covered[c]) * albedo[c];
    }
    return amount;
}

}  // namespace frazil
