#include "frazil/bindings/bindings.h"

namespace frazil {

void bind_translucency(nb::module_&) {}

}  // namespace frazil
