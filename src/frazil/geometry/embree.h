// The one Embree device of the process, and Embree 3 and 4 under one include.
// Model: Embree keeps its own threads in TBB, so a second device would gain nothing.
// Valid: thread-safe.
#pragma once

#if FRAZIL_EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace frazil {

RTCDevice embree_device();

// bad_alloc where Embree ran out of memory, runtime_error naming `step` for any other error since the last call.
void throw_if_embree_failed(const char* step);

}  // namespace frazil
