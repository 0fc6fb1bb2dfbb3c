// The Python face of the core: one bind_*.cpp per stage, and the conversions that they share.
// Model: nanobind; arrays come in by reference and go out as numpy views that keep their owner alive. The GIL is released
//   around every call that computes.
// Not: logic of any kind.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "frazil/base/error.h"
#include "frazil/base/vec.h"
#include "frazil/translucency/point_tree.h"

namespace frazil {

namespace nb = nanobind;
using namespace nb::literals;

// An argument that may be anything numpy makes an array of without losing its kind: lists, other types and orders,
// subclasses of ndarray. Copied only where it must be.
template <class T>
struct ArrayLike : nb::ndarray<const T, nb::c_contig, nb::device::cpu> {
    using Base = nb::ndarray<const T, nb::c_contig, nb::device::cpu>;
    ArrayLike() = default;
    explicit ArrayLike(Base array) : Base(std::move(array)) {}
};
using FloatArray = ArrayLike<float>;
using IntArray = ArrayLike<std::int32_t>;

// Copy an (N, 3)-like array of floats into vectors; ValueError names `what` where the shape is wrong.
std::vector<V3f> to_vectors3(const FloatArray& array, const char* what);
std::vector<V2f> to_vectors2(const FloatArray& array, const char* what);
std::vector<V3i> to_indices3(const IntArray& array, const char* what);

// A numpy view of memory that belongs to `owner`: no copy.
template <class T>
nb::ndarray<nb::numpy, T> view(T* data, std::initializer_list<std::size_t> shape, nb::handle owner) {
    return nb::ndarray<nb::numpy, T>(data, shape, owner);
}

// A numpy array of Elements, of which a T is one or more, that keeps the values.
template <class Element, class T>
nb::object array_of(std::vector<T>&& values, std::initializer_list<std::size_t> shape) {
    auto* kept = new std::vector<T>(std::move(values));
    const nb::capsule owner(kept, [](void* memory) noexcept { delete static_cast<std::vector<T>*>(memory); });
    return nb::cast(nb::ndarray<nb::numpy, Element>(reinterpret_cast<Element*>(kept->data()), shape, owner));
}

// Three and two numbers, as tuples.
using Triple = std::array<float, 3>;
using Pair = std::array<float, 2>;
inline V3f to_v3f(const Triple& t) {
    return {t[0], t[1], t[2]};
}
inline Triple from_v3f(const V3f& v) {
    return {v.x, v.y, v.z};
}

// Values of an enum by their names; ValueError, with all names, for any other.
template <class Enum, std::size_t N>
Enum from_name(const std::pair<Enum, const char*> (&names)[N], const std::string& name, const char* what) {
    std::string known;
    for (const auto& [value, text] : names) {
        if (name == text) return value;
        known += (known.empty() ? "" : ", ") + std::string(text);
    }
    throw ValueError(str(what, " must be one of ", known, ", got '", name, "'."));
}

template <class Enum, std::size_t N>
const char* to_name(const std::pair<Enum, const char*> (&names)[N], Enum value) {
    for (const auto& [known, text] : names) {
        if (known == value) return text;
    }
    return "";
}

// A (4, 4) float64 matrix for row vectors, as USD's GfMatrix4d and Imath have it.
using MatrixArray = nb::ndarray<const double, nb::shape<4, 4>, nb::c_contig, nb::device::cpu>;
M44f to_matrix(const MatrixArray& array);
M44f to_matrix_or_identity(const std::optional<MatrixArray>& array);
nb::object from_matrix(const M44f& matrix);

// ValueError for any other name.
Estimator estimator_named(const std::string& name);

void bind_geometry(nb::module_& module);
void bind_material(nb::module_& module);
void bind_density(nb::module_& module);
void bind_texture(nb::module_& module);
void bind_points(nb::module_& module);
void bind_translucency(nb::module_& module);
void bind_lighting(nb::module_& module);
void bind_lights(nb::module_& module);
void bind_scene(nb::module_& module);
void bind_render(nb::module_& module);
void bind_film(nb::module_& module);

}  // namespace frazil

namespace nanobind::detail {

template <class T>
struct type_caster<frazil::ArrayLike<T>> {
    NB_TYPE_CASTER(frazil::ArrayLike<T>, const_name("numpy.typing.ArrayLike"))

    bool from_python(handle source, std::uint8_t, cleanup_list*) noexcept {
        if (source.is_none()) return false;
        try {
            const module_ numpy = module_::import_("numpy");
            const char* type = std::is_same_v<T, float> ? "float32" : "int32";
            const object array = numpy.attr("asarray")(source).attr("astype")(type, "C", "same_kind", false, false);
            value = Value(nanobind::cast<typename Value::Base>(array));
            return true;
        } catch (python_error&) {  // not an array of that kind: nanobind reports the argument
            return false;
        } catch (cast_error&) {
            return false;
        }
    }

    static handle from_cpp(const Value&, rv_policy, cleanup_list*) noexcept = delete;
};

}  // namespace nanobind::detail
