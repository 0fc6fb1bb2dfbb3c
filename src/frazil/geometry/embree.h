// The one Embree device of the process, what is made on it, and Embree 3 and 4 under one include.
// Model: Embree keeps its own threads in TBB, so a second device would gain nothing.
// Valid: thread-safe.
#pragma once

#if FRAZIL_EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "frazil/geometry/mesh.h"

namespace frazil {

RTCDevice embree_device();

// bad_alloc where Embree ran out of memory, runtime_error naming `step` for any other error since the last call.
void throw_if_embree_failed(const char* step);

// A triangle geometry with its own copy of the vertices, moved by `local_to_world`.
RTCGeometry make_triangles(const Mesh& mesh, const M44f& local_to_world);

// An empty scene whose queries may bring a filter; watertight along shared edges.
RTCScene make_scene();

}  // namespace frazil
