#include "frazil/geometry/embree.h"

#include <new>

#include "frazil/base/error.h"

namespace frazil {

RTCDevice embree_device() {
    static const RTCDevice shared = rtcNewDevice(nullptr);
    if (!shared) throw std::runtime_error("Embree: no device could be made on this processor.");
    return shared;
}

void throw_if_embree_failed(const char* step) {
    const RTCError code = rtcGetDeviceError(embree_device());
    if (code == RTC_ERROR_NONE) return;
    if (code == RTC_ERROR_OUT_OF_MEMORY) throw std::bad_alloc();
    throw std::runtime_error(str("Embree: ", step, " failed with error ", int(code), "."));
}

}  // namespace frazil
