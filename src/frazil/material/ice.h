// frazil:ice: a clear to translucent core under a glossy dielectric boundary.
// Model: GGX reflection and refraction over a core that light crosses unscattered (refraction), scattered once (volume)
//   or many times (translucency, M/pi * T(wo)/T_avg) [Xie2014]. Along a refracted ray the unscattered part u =
//   exp(-sigma_s_prime d) goes to what lies behind, the rest to the core, so that all sums to <= 1 (furnace).
// Units: see Medium; roughness is the user's (alpha = roughness²).
// Valid: roughness in [0,1], eta in [1,4], weights in [0,1], anisotropy in [-0.95, 0.95].
#pragma once

#include <vector>

#include "frazil/material/density.h"
#include "frazil/material/overlay.h"
#include "frazil/material/texture.h"
#include "frazil/translucency/compensation.h"
#include "frazil/translucency/medium.h"
#include "frazil/translucency/profile.h"
#include "frazil/translucency/ramp.h"

namespace frazil {

struct IceMaterial {
    Medium medium;
    ProfileKind profile = ProfileKind::multiple_scattering;
    MaterialInput<float> roughness{0.1f, {}};
    float specular = 1.0f;                   // weight of the reflection, 0..1
    float translucency = 1.0f;               // weight of the core, 0..1
    float refraction = 1.0f;                 // how much of what the medium leaves unscattered is seen, 0..1
    float refraction_roughness = -1.0f;      // of light that goes through the boundary, 0..1; -1 = as roughness
    Rgb refraction_tint = Rgb(1.0f);         // of light each time that it goes through the boundary unscattered, 0..1
    float volume = 0.0f;                     // how much of the light scattered once is traced, 0..1
    float anisotropy = 0.0f;                 // g of the once-scattered light (Henyey-Greenstein)
    Density density;                         // what the medium is multiplied by along refracted rays
    std::vector<Overlay> overlays;           // cracks, frost, snow ... from below to the top
    float age = 0.5f;                        // 0 = fresh .. 1 = old: how much of its opacity each overlay has
    int priority = 0;                        // where bodies overlap, the highest fills the place
    MaterialInput<Rgb> tint{Rgb(1.0f), {}};  // multiplies what leaves the core
    TextureLookup normal;                    // tangent-space normal map
    MaterialInput<float> bump{0.0f, {}};     // height, metres; a texture
    Ramp ramp;
    Compensation compensation;
    // Of the points, metres; 0 = from the mean free path. A texture is read at the mesh's vertices.
    MaterialInput<float> spacing{0.0f, {}};

    // Whether fracture planes may be seen inside.
    bool has_sheets() const {
        for (const Overlay& overlay : overlays) {
            if (overlay.internal > 0.0f && overlay.pattern.kind == PatternKind::fracture) return true;
        }
        return false;
    }
};

}  // namespace frazil
