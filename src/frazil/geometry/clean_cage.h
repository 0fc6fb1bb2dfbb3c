// A cage without what a limit surface cannot be made of, and the way back to the cage that was given.
// Model: edges without length are dropped; faces of more than 15 corners (Embree's limit) or that pass a vertex twice are
//   triangulated; faces of fewer than three corners are left out.
// Valid: any cage that check_control_mesh lets pass.
// Not: non-manifold edges and loose vertices, which Embree takes.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "frazil/geometry/subdivision.h"

namespace frazil {

struct CleanCage {
    ControlMesh cage;
    std::vector<std::int32_t> faces;
    std::vector<std::size_t> corners;  // the original corner of each kept corner
};

CleanCage clean_cage(const ControlMesh& cage, const std::string& path);

// ValueError, beginning with `path`, for creases and corners whose arrays do not fit together or that are not >= 0.
void check_creases(const ControlMesh& cage, const std::string& path);

}  // namespace frazil
