#include "frazil/bindings/bindings.h"

namespace frazil {

void bind_lighting(nb::module_&) {}

}  // namespace frazil
