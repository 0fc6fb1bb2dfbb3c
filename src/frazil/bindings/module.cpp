#include "frazil/bindings/bindings.h"

namespace frazil {
namespace {

template <class Vector, class Scalar, class Array>
std::vector<Vector> to_vectors(const Array& array, const char* what, std::size_t width) {
    if (array.ndim() != 2 || array.shape(1) != width) {
        std::string shape;
        for (std::size_t i = 0; i < array.ndim(); ++i) shape += str(i ? ", " : "", array.shape(i));
        throw ValueError(str(what, " must have shape (N, ", width, "), got (", shape, "). Reshape the array."));
    }
    const auto* begin = reinterpret_cast<const Vector*>(static_cast<const Scalar*>(array.data()));
    return std::vector<Vector>(begin, begin + array.shape(0));
}

}  // namespace

std::vector<V3f> to_vectors3(const FloatArray& array, const char* what) {
    return to_vectors<V3f, float>(array, what, 3);
}
std::vector<V2f> to_vectors2(const FloatArray& array, const char* what) {
    return to_vectors<V2f, float>(array, what, 2);
}
std::vector<V3i> to_indices3(const IntArray& array, const char* what) {
    return to_vectors<V3i, std::int32_t>(array, what, 3);
}

Estimator estimator_named(const std::string& name) {
    if (name == "noise_free") return Estimator::noise_free;
    if (name == "sum") return Estimator::sum;
    throw ValueError(str("estimator must be noise_free or sum, got '", name, "'. noise_free is the default."));
}

}  // namespace frazil

NB_MODULE(_frazil, module) {
    using namespace frazil;
    nb::exception<Cancelled>(module, "Cancelled", PyExc_KeyboardInterrupt);
    nb::register_exception_translator([](const std::exception_ptr& pointer, void*) {
        try {
            std::rethrow_exception(pointer);
        } catch (const FileError& error) {
            PyErr_SetString(PyExc_OSError, error.what());
        }
    });
    bind_geometry(module);
    bind_points(module);
    bind_translucency(module);
    bind_lights(module);
    bind_lighting(module);
    bind_material(module);
    bind_scene(module);
    bind_render(module);
    bind_film(module);
}
