// UsdPreviewSurface: what everything but ice is made of.
// Model: UsdPreviewSurface 2.6: diffuse + GGX specular (metallic or specular workflow) + clearcoat + emission + opacity.
// Units: roughness is the user's (alpha = roughness²).
// Valid: the ranges of the specification.
#pragma once

#include "frazil/material/texture.h"

namespace frazil {

struct StandardMaterial {
    MaterialInput<Rgb> diffuse_color{Rgb(0.18f), {}};
    bool uses_display_color = false;  // the mesh's displayColor takes the place of diffuse_color
    MaterialInput<Rgb> emissive_color{Rgb(0.0f), {}};
    bool use_specular_workflow = false;
    MaterialInput<Rgb> specular_color{Rgb(0.0f), {}};
    MaterialInput<float> metallic{0.0f, {}};
    MaterialInput<float> roughness{0.5f, {}};
    MaterialInput<float> clearcoat{0.0f, {}};
    MaterialInput<float> clearcoat_roughness{0.01f, {}};
    MaterialInput<float> opacity{1.0f, {}};
    float opacity_threshold = 0.0f;
    float ior = 1.5f;
    TextureLookup normal;  // tangent-space normal map, scale and bias as authored (usually 2 and -1)
};

}  // namespace frazil
