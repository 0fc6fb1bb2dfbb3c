#include "frazil/bindings/bindings.h"
#include "frazil/material/density.h"

namespace frazil {
namespace {

// The field of a density in its object's own frame, whose unit is taken for the metre.
DensityField checked_field(const Density& density) {
    check_density(density, "Density");
    return {density, M44f(), M44f()};
}

}  // namespace

void bind_density(nb::module_& module) {
    const Density preset;
    nb::class_<Density>(
        module, "Density",
        "How much denser ice is than its medium from place to place: noise, or a grid.\n\n"
        "Parameters\n----------\n"
        "values : (X, Y, Z) float32 >= 0, at least two a side, interpolated trilinearly; None = noise.\n"
        "matrix : (4, 4) float64 for row vectors: voxel (i, j, k) lies at (i, j, k) * matrix in the object's own "
        "frame.\n"
        "outside : density beyond the grid.\n"
        "contrast : standard deviation of the noise's logarithm, in [0, 4]; its mean is 1.\n"
        "size : of its widest features, metres. octaves : 1..8, each twice as fine and half as strong. seed.\n"
        "scale : of noise or grid, >= 0.\n"
        "absorption : how much of the density counts for sigma_a, in [0, 1]; 0 = for bubbles, which scatter alone.\n\n"
        "Ranges are checked when the scene is rendered.")
        .def(
            "__init__",
            [](Density* self, const std::optional<FloatArray>& values, const std::optional<MatrixArray>& matrix,
               float outside, float contrast, float size, int octaves, std::uint32_t seed, float scale,
               float absorption) {
                Density made{nullptr, contrast, size, octaves, seed, scale, absorption};
                if (values) {
                    if (values->ndim() != 3) {
                        throw ValueError(
                            str("Density: values must have shape (X, Y, Z), got ", values->ndim(), " dimensions."));
                    }
                    auto grid = std::make_shared<DensityGrid>();
                    grid->size = V3i(int(values->shape(0)), int(values->shape(1)), int(values->shape(2)));
                    grid->values.assign(values->data(), values->data() + values->size());
                    grid->index_to_object = to_matrix_or_identity(matrix);
                    grid->outside = outside;
                    made.grid = std::move(grid);
                }
                new (self) Density(std::move(made));
            },
            "values"_a = nb::none(), "matrix"_a = nb::none(), nb::kw_only(), "outside"_a = 0.0f,
            "contrast"_a = preset.contrast, "size"_a = preset.size, "octaves"_a = preset.octaves,
            "seed"_a = preset.seed, "scale"_a = preset.scale, "absorption"_a = preset.absorption)
        .def_prop_ro("values",
                     [](nb::handle self) -> nb::object {
                         const auto& grid = nb::cast<const Density&>(self).grid;
                         if (!grid) return nb::none();
                         return nb::cast(view(
                             grid->values.data(),
                             {std::size_t(grid->size.x), std::size_t(grid->size.y), std::size_t(grid->size.z)}, self));
                     })
        .def_prop_ro("matrix", [](const Density& d) { return from_matrix(d.grid ? d.grid->index_to_object : M44f()); })
        .def_prop_ro("outside", [](const Density& d) { return d.grid ? d.grid->outside : 0.0f; })
        .def_rw("contrast", &Density::contrast)
        .def_rw("size", &Density::size)
        .def_rw("octaves", &Density::octaves)
        .def_rw("seed", &Density::seed)
        .def_rw("scale", &Density::scale)
        .def_rw("absorption", &Density::absorption)
        .def(
            "eval",
            [](const Density& density, const FloatArray& positions) {
                const auto p = to_vectors3(positions, "Density.eval: positions");
                const DensityField field = checked_field(density);
                std::vector<float> values(p.size());
                {
                    nb::gil_scoped_release release;
                    for (std::size_t i = 0; i < p.size(); ++i) values[i] = field.at(p[i]);
                }
                return values;
            },
            "positions"_a, "The density at positions (N, 3) in the object's frame. A list of N floats.")
        .def(
            "depth",
            [](const Density& density, const FloatArray& origins, const FloatArray& ends) {
                const auto a = to_vectors3(origins, "Density.depth: origins");
                const auto b = to_vectors3(ends, "Density.depth: ends");
                if (a.size() != b.size()) {
                    throw ValueError(
                        str("Density.depth: ends must be as many as origins, ", a.size(), ", got ", b.size(), "."));
                }
                const DensityField field = checked_field(density);
                std::vector<float> depths(a.size());
                {
                    nb::gil_scoped_release release;
                    for (std::size_t i = 0; i < a.size(); ++i) {
                        const V3f way = b[i] - a[i];
                        depths[i] = field.depth(a[i], way.normalized(), way.length());
                    }
                }
                return depths;
            },
            "origins"_a, "ends"_a,
            "The density's integral from origins (N, 3) straight to ends (N, 3) in the object's frame: metres of the\n"
            "medium. A list of N floats.")
        .def("__repr__", [](const Density& d) {
            if (!d.grid) return str("Density(contrast=", d.contrast, ", size=", d.size, ")");
            return str("Density(", d.grid->size.x, " x ", d.grid->size.y, " x ", d.grid->size.z, " voxels)");
        });
}

}  // namespace frazil
