#include "frazil/lighting/shaping.h"

namespace frazil {

Rgb eval(const Shaping& shaping, const V3f& towards) {
    const float cosine = towards.z;
    Rgb factor(1.0f);
    if (shaping.has_cone()) {
        const float off_axis = std::acos(std::clamp(cosine, -1.0f, 1.0f));
        const float cutoff = shaping.cone_angle * (kPi / 180.0f),
                    start = cutoff * (1.0f - std::min(1.0f, shaping.cone_softness));
        if (off_axis > cutoff) return Rgb(0.0f);
        if (off_axis > start) {
            const float x = (off_axis - start) / (cutoff - start);
            factor *= 1.0f - x * x * (3.0f - 2.0f * x);
        }
    }
    if (shaping.has_focus()) {
        const float share = std::pow(std::abs(cosine), shaping.focus);
        factor *= shaping.focus_tint * (1.0f - share) + Rgb(share);
    }
    if (shaping.ies) {
        const float scale = shaping.ies_normalize ? 1.0f / std::max(shaping.ies->mean(), 1e-30f) : 1.0f;
        factor *= shaping.ies->eval(towards, shaping.ies_angle_scale) * scale;
    }
    return factor;
}

}  // namespace frazil
