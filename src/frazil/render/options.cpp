#include "frazil/render/options.h"

#include <cmath>

#include "frazil/base/error.h"

namespace frazil {

void check_options(const RenderOptions& options) {
    const auto require = [](bool holds, const char* rule, double value) {
        if (!holds) throw ValueError(str("render: ", rule, ", got ", value, "."));
    };
    require(options.width >= 1 && options.width <= 65536, "width must be in 1..65536", options.width);
    require(options.height >= 1 && options.height <= 65536, "height must be in 1..65536", options.height);
    require(options.samples >= 1, "samples must be >= 1", options.samples);
    require(options.shading_samples >= 0, "shading_samples must be >= 0", options.shading_samples);
    require(std::isfinite(options.noise) && options.noise >= 0.0f, "noise must be >= 0", options.noise);
    require(options.min_samples >= 1, "min_samples must be >= 1", options.min_samples);
    require(options.bake_samples >= 0, "bake_samples must be >= 0", options.bake_samples);
    require(std::isfinite(options.bake_error) && options.bake_error >= 0.0f, "bake_error must be >= 0",
            options.bake_error);
    require(options.bake_bounces >= 0, "bake_bounces must be >= 0", options.bake_bounces);
    require(options.max_bounces >= 0, "max_bounces must be >= 0", options.max_bounces);
    require(options.threads >= 0, "threads must be >= 0", options.threads);
    require(std::isfinite(options.spacing) && options.spacing >= 0.0f, "spacing must be >= 0", options.spacing);
    require(std::isfinite(options.spacing_scale) && options.spacing_scale > 0.0f, "spacing_scale must be > 0",
            options.spacing_scale);
    require(std::isfinite(options.spacing_pixels) && options.spacing_pixels >= 0.0f, "spacing_pixels must be >= 0",
            options.spacing_pixels);
    require(std::isfinite(options.gather.tolerance) && options.gather.tolerance > 0.0f, "tolerance must be > 0",
            options.gather.tolerance);
}

}  // namespace frazil
