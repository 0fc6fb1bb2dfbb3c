#include <nanobind/stl/string_view.h>

#include "frazil/bindings/bindings.h"
#include "frazil/render/cryptomatte.h"
#include "frazil/render/mix.h"

namespace frazil {
namespace {

using AnyArray = nb::ndarray<nb::ro, nb::c_contig, nb::device::cpu>;
using Target = nb::ndarray<float, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

void mix_from_python(const std::vector<AnyArray>& layers, const FloatArray& weights, Target out) {
    const std::size_t pixels = out.shape(0) * out.shape(1);
    if (weights.ndim() != 2 || weights.shape(0) != layers.size() || weights.shape(1) != 3) {
        throw ValueError(str("mix: weights must be of shape (", layers.size(), ", 3)."));
    }
    std::vector<MixLayer> rows;
    for (std::size_t i = 0; i < layers.size(); ++i) {
        const AnyArray& layer = layers[i];
        if (layer.ndim() != 3 || layer.shape(0) != out.shape(0) || layer.shape(1) != out.shape(1) ||
            layer.shape(2) != 3 || out.shape(2) != 3) {
            throw ValueError("mix: layers must be (H, W, 3) like the output.");
        }
        const bool is_half = layer.dtype() == nb::dlpack::dtype{std::uint8_t(nb::dlpack::dtype_code::Float), 16, 1};
        if (!is_half && layer.dtype() != nb::dtype<float>()) {
            throw ValueError("mix: layers must be float16 or float32.");
        }
        MixLayer row;
        if (is_half) {
            row.halves = static_cast<const std::uint16_t*>(layer.data());
        } else {
            row.floats = static_cast<const float*>(layer.data());
        }
        const float* weight = weights.data() + 3 * i;
        row.weight = Rgb(weight[0], weight[1], weight[2]);
        rows.push_back(row);
    }
    const nb::gil_scoped_release no_gil;
    mix(rows, pixels, out.data());
}

}  // namespace

void bind_film(nb::module_& module) {
    module.def("cryptomatte_hash", &murmur3_32, "name"_a, "MurmurHash3_32 of a name, as Cryptomatte has it.");
    module.def("cryptomatte_id", &cryptomatte_id, "name"_a, "The float32 that stands for a name in a Cryptomatte.");
    module.def("mix_layers", &mix_from_python, "layers"_a, "weights"_a, "out"_a,
               "Write the weighted sum of (H, W, 3) layers, float16 or float32, to the float32 array `out`.\n"
               "weights: (layers, 3), per channel.");
}

}  // namespace frazil
