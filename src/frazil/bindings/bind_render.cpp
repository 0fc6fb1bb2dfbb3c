#include "frazil/bindings/bindings.h"

namespace frazil {

void bind_render(nb::module_&) {}

}  // namespace frazil
