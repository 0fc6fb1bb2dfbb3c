#include "frazil/bindings/bindings.h"

namespace frazil {

void bind_points(nb::module_&) {}

}  // namespace frazil
