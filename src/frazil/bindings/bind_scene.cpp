#include "frazil/bindings/bindings.h"

namespace frazil {

void bind_scene(nb::module_&) {}

}  // namespace frazil
