#include <nanobind/stl/pair.h>

#include <cmath>
#include <functional>

#include "frazil/bindings/bindings.h"
#include "frazil/translucency/albedo_inversion.h"
#include "frazil/translucency/compensation.h"
#include "frazil/translucency/fresnel.h"
#include "frazil/translucency/half_space.h"
#include "frazil/translucency/point_tree.h"

namespace frazil {
namespace {

nb::object to_array(const Rgb& c) {
    return array_of<float>(std::vector<float>{c.x, c.y, c.z}, {3});
}

// One number or three.
Rgb to_rgb(nb::handle value, const char* what) {
    float number;
    if (nb::try_cast<float>(value, number)) return Rgb(number);
    std::vector<float> three;
    if (!nb::try_cast<std::vector<float>>(value, three) || three.size() != 3) {
        throw ValueError(
            str(what, " must be one number or three, got ", nb::repr(value).c_str(), ". Three are red, green, blue."));
    }
    return {three[0], three[1], three[2]};
}

FloatArray as_floats(nb::handle value, const char* what) {
    try {
        return nb::cast<FloatArray>(nb::module_::import_("numpy").attr("ascontiguousarray")(value, "float32"));
    } catch (const nb::python_error&) {
        throw ValueError(str(what, " must be an array of numbers, got ", nb::repr(value.type()).c_str(),
                             ". Pass what numpy.asarray takes."));
    }
}

std::vector<float> to_scalars(nb::handle value, const char* what) {
    const FloatArray array = as_floats(value, what);
    if (array.ndim() != 1)
        throw ValueError(str(what, " must have shape (n,), got ", array.ndim(), " dimensions. Reshape the array."));
    return std::vector<float>(array.data(), array.data() + array.size());
}

// Radii as (n,) floats; a single number is an array of one.
std::vector<float> to_radii(nb::handle value, const char* what) {
    float number;
    if (nb::try_cast<float>(value, number)) return {number};
    return to_scalars(value, what);
}

nb::object map_radii(nb::handle value, const char* what, const std::function<Rgb(float)>& f) {
    const std::vector<float> radii = to_radii(value, what);
    std::vector<Rgb> out;
    out.reserve(radii.size());
    for (const float r : radii) {
        if (!(r >= 0.0f)) throw ValueError(str(what, " must be >= 0, got ", r, ". It is a distance in metres."));
        out.push_back(f(r));
    }
    const std::size_t n = out.size();
    return array_of<float>(std::move(out), {n, 3});
}

// A PointSet, or anything with positions, normals, areas and spacing; `what` is who asks. Normals are made unit length.
PointSet to_points(nb::handle object, const std::string& what) {
    PointSet points;
    if (nb::isinstance<PointSet>(object)) return nb::cast<const PointSet&>(object);
    for (const char* name : {"positions", "normals", "areas"}) {
        if (!nb::hasattr(object, name)) {
            throw ValueError(str(what, ": points must be a PointSet or have positions, normals and areas, got ",
                                 nb::repr(object.type()).c_str(), ". Make them with poisson_points."));
        }
    }
    const auto vectors = [&](const char* name) {
        const std::string field = what + ": " + name;
        return to_vectors3(as_floats(object.attr(name), field.c_str()), field.c_str());
    };
    points.positions = vectors("positions");
    points.normals = vectors("normals");
    for (V3f& n : points.normals) {
        if (is_finite(n)) n = V3f(V3d(n).normalized());
    }
    points.areas = to_scalars(object.attr("areas"), (what + ": areas").c_str());
    if (nb::hasattr(object, "spacing") && !nb::try_cast<double>(object.attr("spacing"), points.spacing)) {
        throw ValueError(str(what, ": spacing of the points must be a number, got ",
                             nb::repr(object.attr("spacing")).c_str(),
                             ". It is the distance of neighbours, in metres."));
    }
    return points;
}

// Cells and what their places lie on.
struct MeshCells {
    Mesh mesh;
    Cells cells;
};

// One vector of three per place.
template <class Value>
nb::object per_place(const MeshCells& self, const Value& value) {
    std::vector<V3f> out(self.cells.places.size());
    for (std::size_t i = 0; i < out.size(); ++i) out[i] = value(self.cells.places[i], self.mesh);
    const std::size_t n = out.size();
    return array_of<float>(std::move(out), {n, 3});
}

// Irradiance (N, 3) or (N, G, 3), and its G.
std::pair<std::vector<Rgb>, std::size_t> to_irradiance(nb::handle object) {
    const FloatArray array = as_floats(object, "PointTree: irradiance");
    const std::size_t dimensions = array.ndim();
    if ((dimensions != 2 && dimensions != 3) || array.shape(dimensions - 1) != 3) {
        std::string shape;
        for (std::size_t i = 0; i < dimensions; ++i) shape += str(i ? ", " : "", array.shape(i));
        throw ValueError(
            str("PointTree: irradiance must have shape (N, 3) or (N, G, 3), got (", shape, "). Reshape the array."));
    }
    const auto* begin = reinterpret_cast<const Rgb*>(array.data());
    return {std::vector<Rgb>(begin, begin + array.size() / 3), dimensions == 3 ? array.shape(1) : 1};
}

CompensationMode mode_named(const std::string& name) {
    if (name == "off") return CompensationMode::off;
    if (name == "ratio") return CompensationMode::ratio;
    if (name == "conserve") return CompensationMode::conserve;
    if (name == "depth") return CompensationMode::depth;
    if (name == "fill") return CompensationMode::fill;
    if (name == "linear") return CompensationMode::linear;
    throw ValueError(str("area_compensation: mode must be off, ratio, conserve, depth, fill or linear, got '", name,
                         "'. depth is what ice has."));
}

template <class Kind>
nb::class_<Kind> bind_profile(nb::module_& module, const char* name, const char* doc) {
    return nb::class_<Kind>(module, name, doc)
        .def(
            "reflectance",
            [](const Kind& self, nb::handle r) {
                const Profile profile(self);
                return map_radii(r, "reflectance: r",
                                 [&](float x) { return std::isinf(x) ? Rgb(0.0f) : reflectance(profile, x); });
            },
            "r"_a, "Rd(r) in 1/m², (n, 3), for distances r (n,) in metres.")
        .def(
            "within",
            [](const Kind& self, nb::handle radius) {
                const Profile profile(self);
                return map_radii(radius, "within: R", [&](float x) { return within(profile, x); });
            },
            "R"_a, "F(R): the fraction that leaves within R metres of where it entered, (n, 3); inf gives the albedo.")
        .def_prop_ro(
            "albedo", [](const Kind& self) { return to_array(albedo(Profile(self))); },
            "Total diffuse reflectance Rd_total = F(inf), (3,).")
        .def_prop_ro("medium", [](const Kind& self) { return self.medium; });
}

void check_index(const char* function, double eta) {
    if (eta >= 1e-6 && eta <= 1e6) return;
    throw ValueError(str(function, ": eta must be > 0 and finite, and in [1e-06, 1e+06], got ", eta,
                         ". From air into ice it is 1.31."));
}

Profile to_profile(nb::handle object) {
    if (nb::isinstance<Dipole>(object)) return nb::cast<const Dipole&>(object);
    if (nb::isinstance<BetterDipole>(object)) return nb::cast<const BetterDipole&>(object);
    if (nb::isinstance<NormalizedDiffusion>(object)) return nb::cast<const NormalizedDiffusion&>(object);
    if (nb::isinstance<PhotonBeamDiffusion>(object)) return nb::cast<const PhotonBeamDiffusion&>(object);
    if (nb::isinstance<MultipleScattering>(object)) return nb::cast<const MultipleScattering&>(object);
    throw ValueError(str("profile must be a Dipole, BetterDipole, NormalizedDiffusion, PhotonBeamDiffusion or ",
                         "MultipleScattering, got ", nb::repr(object.type()).c_str(), "."));
}

}  // namespace

void bind_translucency(nb::module_& module) {
    module.def(
        "fresnel_dielectric",
        [](double cos_theta, double eta) {
            check_index("fresnel_dielectric", eta);
            if (!(cos_theta >= 0.0 && cos_theta <= 1.0)) {
                throw ValueError(str("fresnel_dielectric: cos_theta must be in [0, 1], got ", cos_theta,
                                     ". It is the cosine between light and normal."));
            }
            return fresnel_dielectric(cos_theta, eta);
        },
        "cos_theta"_a, "eta"_a,
        "Reflected fraction of unpolarised light; eta = index it would enter / index it is in.");
    module.def(
        "fresnel_average",
        [](double eta) {
            check_index("fresnel_average", eta);
            return fresnel_average(eta);
        },
        "eta"_a, "2 ∫ F(cos) cos dcos: what comes from all around.");

    nb::class_<Medium>(module, "Medium",
                       "What a translucent body is made of.\n\n"
                       "Parameters\n----------\n"
                       "sigma_s_prime : (3,) or number, 1/m, >= 0. Reduced scattering coefficient.\n"
                       "sigma_a : (3,) or number, 1/m, >= 0. Absorption coefficient.\n"
                       "eta : index of refraction relative to the outside, 1 to 4; ice is 1.31.\n\n"
                       "Raises\n------\nValueError\n    For coefficients that are negative, NaN, or both zero.")
        .def(
            "__init__",
            [](Medium* self, nb::handle sigma_s_prime, nb::handle sigma_a, float eta) {
                const Medium medium{to_rgb(sigma_s_prime, "Medium: sigma_s_prime"), to_rgb(sigma_a, "Medium: sigma_a"),
                                    eta};
                check_medium(medium, "Medium");
                new (self) Medium(medium);
            },
            "sigma_s_prime"_a, "sigma_a"_a, "eta"_a = 1.31f)
        .def_static(
            "from_albedo",
            [](nb::handle albedo, nb::handle mean_free_path, float eta, const std::string& profile) {
                const ProfileKind kind = profile_named(profile, "Medium");
                const Rgb total = to_rgb(albedo, "Medium: albedo"),
                          path = to_rgb(mean_free_path, "Medium: mean_free_path");
                const nb::gil_scoped_release release;
                return medium_for_profile(kind, total, path, eta);
            },
            "albedo"_a, "mean_free_path"_a, "eta"_a = 1.31f, "profile"_a = "dipole",
            "The medium whose profile has total reflectance `albedo` (0 <= albedo < 1) and transport mean free path\n"
            "`mean_free_path` = 1/(sigma_s_prime + sigma_a), in metres.\n\n"
            "profile : dipole, better_dipole, normalized_diffusion, photon_beam or multiple_scattering; the last as "
            "renders\n"
            "    use it, with light of one scattering: MultipleScattering(medium, single=1).")
        .def_prop_ro("sigma_s_prime", [](const Medium& m) { return to_array(m.sigma_s_prime); })
        .def_prop_ro("sigma_a", [](const Medium& m) { return to_array(m.sigma_a); })
        .def_ro("eta", &Medium::eta)
        .def_prop_ro(
            "mean_free_path", [](const Medium& m) { return to_array(Rgb(1.0f) / (m.sigma_s_prime + m.sigma_a)); },
            "1/(sigma_s_prime + sigma_a), (3,), metres.")
        .def("__repr__", [](const Medium& m) {
            return str("Medium(sigma_s_prime=(", m.sigma_s_prime.x, ", ", m.sigma_s_prime.y, ", ", m.sigma_s_prime.z,
                       "), sigma_a=(", m.sigma_a.x, ", ", m.sigma_a.y, ", ", m.sigma_a.z, "), eta=", m.eta, ")");
        });

    bind_profile<Dipole>(module, "Dipole", "The standard dipole of Jensen et al. 2001.")
        .def(nb::init<const Medium&>(), "medium"_a);
    bind_profile<BetterDipole>(module, "BetterDipole", "The better dipole of d'Eon 2012.")
        .def(nb::init<const Medium&>(), "medium"_a);
    bind_profile<NormalizedDiffusion>(module, "NormalizedDiffusion",
                                      "The fit of Christensen and Burley 2015, single scattering included.")
        .def(nb::init<const Medium&>(), "medium"_a);
    bind_profile<PhotonBeamDiffusion>(module, "PhotonBeamDiffusion",
                                      "Photon beam diffusion of Habel et al. 2013, multiple scattering alone.")
        .def(nb::init<const Medium&>(), "medium"_a);
    bind_profile<MultipleScattering>(module, "MultipleScattering",
                                     "The curve of photon beam diffusion, scaled to the exact albedo of light that is\n"
                                     "scattered more than once, and of `single` (0..1) of the light scattered once.")
        .def(
            "__init__",
            [](MultipleScattering* self, const Medium& medium, double single) {
                if (!(single >= 0.0 && single <= 1.0)) {
                    throw ValueError(str("MultipleScattering: single must be in [0, 1], got ", single,
                                         ". It is a share of the light scattered once."));
                }
                new (self) MultipleScattering(medium, single);
            },
            "medium"_a, "single"_a = 0.0);
    module.def(
        "half_space_albedo",
        [](double alpha, double eta) {
            if (!(alpha >= 0.0 && alpha <= 1.0)) {
                throw ValueError(str("half_space_albedo: alpha must be in [0, 1], got ", alpha,
                                     ". It is the albedo of one scattering."));
            }
            if (!(eta >= 1.0 && eta <= 4.0)) {
                throw ValueError(str("half_space_albedo: eta must be in [1, 4], got ", eta, ". Ice is 1.31."));
            }
            const HalfSpaceAlbedo albedo = half_space_albedo(alpha, eta);
            return std::pair{albedo.single, albedo.multiple};
        },
        "alpha"_a, "eta"_a = 1.0,
        "What leaves a half space lit from all around, over what enters: (by one scattering, by more), exactly.");

    nb::class_<Ramp>(module, "Ramp",
                     "A colour for every distance between where light enters and where it leaves.\n\n"
                     "Parameters\n----------\n"
                     "distances : (K,) >= 0, increasing, metres; or mean free paths where mean_free_path is given.\n"
                     "colors : (K, 3) >= 0, factors; linear between knots, constant outside.\n"
                     "preserve_energy : scale each channel so that the total diffuse reflectance stays.\n"
                     "mean_free_path : metres that one unit of distance stands for.")
        .def(
            "__init__",
            [](Ramp* self, nb::handle distances, nb::handle colors, bool preserve_energy, double mean_free_path) {
                if (!(mean_free_path > 0.0 && std::isfinite(mean_free_path))) {
                    throw ValueError(
                        str("Ramp: mean_free_path must be > 0 and finite, got ", mean_free_path, ". It is in metres."));
                }
                Ramp ramp{to_radii(distances, "Ramp: distances"),
                          to_vectors3(as_floats(colors, "Ramp: colors"), "Ramp: colors"), preserve_energy};
                check_ramp(ramp, "Ramp");
                if (ramp.is_empty()) throw ValueError("Ramp: distances must hold at least one knot, got none.");
                new (self) Ramp(in_metres(ramp, mean_free_path));
            },
            "distances"_a, "colors"_a, "preserve_energy"_a = false, "mean_free_path"_a = 1.0)
        .def(
            "energy_scale",
            [](const Ramp& self, nb::handle profile) { return to_array(energy_scale(self, to_profile(profile))); },
            "profile"_a, "What preserve_energy multiplies each channel by, (3,); 1 where it is off.")
        .def(
            "eval",
            [](const Ramp& self, nb::handle r) {
                return map_radii(r, "Ramp: r", [&](float x) { return eval(self, x); });
            },
            "r"_a, "The factors at distances r (n,) in metres, (n, 3); preserve_energy is not in them.");

    nb::class_<Gathered>(module, "Gathered", "What a gather returns.")
        .def_prop_ro("exitance",
                     [](Gathered& self) {
                         return view(reinterpret_cast<float*>(self.exitance.data()),
                                     {self.coverage.size(), self.groups, 3}, nb::find(self));
                     })
        .def_prop_ro("layers",
                     [](Gathered& self) {
                         return view(reinterpret_cast<float*>(self.layers.data()),
                                     {self.coverage.size(), self.knots, self.groups, 3}, nb::find(self));
                     })
        .def_prop_ro("coverage", [](Gathered& self) {
            return view(reinterpret_cast<float*>(self.coverage.data()), {self.coverage.size(), 3}, nb::find(self));
        });

    nb::class_<MeshCells>(
        module, "Cells",
        "The surface that each point of a mesh stands for: its moments, and places spread over it.\n\n"
        "Light that is known at the places, not at the points alone, makes the sum over a tenth of the points as "
        "smooth.\n\n"
        "Parameters\n----------\n"
        "points : PointSet of poisson_points on this mesh.\n"
        "mesh : Mesh.\n"
        "places : how many a cell has at most, 1 to 4096.\n"
        "seed : of where in its piece of the cell each place lies.\n\n"
        "Raises\n------\nValueError\n    Where the points leave a part of the mesh uncovered.\n\n"
        "Examples\n--------\n"
        ">>> import frazil as fz, numpy as np\n"
        ">>> square = fz.Mesh(np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.int32([[0, 1, 2], [0, 2, "
        "3]]))\n"
        ">>> points = fz.poisson_points(square, 0.1)\n"
        ">>> cells = fz.Cells(points, square)\n"
        ">>> light = np.where(cells.positions[:, :1] > 0.5, [3.0, 2.0, 1.0], 0.0)  # a shadow's edge\n"
        ">>> tree = fz.PointTree(points, light, fz.Dipole(fz.Medium(10.0, 0.1)), cells=cells)")
        .def(
            "__init__",
            [](MeshCells* self, nb::handle points, const Mesh& mesh, int places, std::uint32_t seed) {
                const PointSet set = to_points(points, "Cells");
                const nb::gil_scoped_release release;
                new (self) MeshCells{mesh, cells_of(set, mesh, places, seed)};
            },
            "points"_a, "mesh"_a, "places"_a = 64, "seed"_a = 0)
        .def("__len__", [](const MeshCells& self) { return self.cells.size(); })
        .def_prop_ro(
            "areas", [](MeshCells& self) { return view(self.cells.areas.data(), {self.cells.size()}, nb::find(self)); },
            "(N,) m²; they sum to the mesh's.")
        .def_prop_ro(
            "centroids",
            [](MeshCells& self) {
                return view(reinterpret_cast<float*>(self.cells.centroids.data()), {self.cells.size(), 3},
                            nb::find(self));
            },
            "(N, 3) metres.")
        .def_prop_ro(
            "covariances",
            [](MeshCells& self) {
                return view(reinterpret_cast<float*>(self.cells.covariances.data()), {self.cells.size(), 6},
                            nb::find(self));
            },
            "(N, 6) m²: xx, yy, zz, xy, xz, yz about the centroid.")
        .def_prop_ro(
            "positions", [](const MeshCells& self) { return per_place(self, position_of); },
            "(M, 3) of the places, cell after cell; metres.")
        .def_prop_ro(
            "normals", [](const MeshCells& self) { return per_place(self, normal_of); }, "(M, 3) of the places.")
        .def_prop_ro(
            "weights",
            [](const MeshCells& self) {
                std::vector<float> out;
                for (const CellPlace& place : self.cells.places) out.push_back(place.area);
                const std::size_t n = out.size();
                return array_of<float>(std::move(out), {n});
            },
            "(M,) m²: the area that each place stands for.")
        .def_prop_ro(
            "owners",
            [](const MeshCells& self) {
                std::vector<std::uint32_t> out;
                for (std::uint32_t k = 0; k < self.cells.size(); ++k) {
                    out.insert(out.end(), self.cells.first[k + 1] - self.cells.first[k], k);
                }
                auto* kept = new std::vector<std::uint32_t>(std::move(out));
                nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<std::uint32_t>*>(p); });
                return nb::cast(nb::ndarray<nb::numpy, std::uint32_t>(kept->data(), {kept->size()}, owner));
            },
            "(M,) uint32: the point of each place.");

    nb::class_<PointTree>(
        module, "PointTree",
        "The octree of points with their irradiance.\n\n"
        "Parameters\n----------\n"
        "points : PointSet, or any object with positions (N, 3), normals (N, 3) and areas (N,).\n"
        "irradiance : (N, 3) or (N, G, 3), W/m²; rows with NaN are left out and counted.\n"
        "profile : Dipole, BetterDipole, NormalizedDiffusion, PhotonBeamDiffusion or MultipleScattering.\n"
        "ramp : Ramp, optional.\n"
        "cells : Cells of the points, optional. Irradiance may then be that of their places, (M, 3) or (M, G, 3), "
        "which\n"
        "    the estimator noise_free needs to be as smooth with a tenth of the points.\n\n"
        "Safe to gather from by many threads at once.")
        .def(
            "__init__",
            [](PointTree* self, nb::handle points, nb::handle irradiance, nb::handle profile, const Ramp* ramp,
               const MeshCells* cells) {
                PointSet set = to_points(points, "PointTree");
                auto [values, groups] = to_irradiance(irradiance);
                const Profile kind = to_profile(profile);
                const Ramp shade = ramp ? *ramp : Ramp{};
                nb::gil_scoped_release release;
                if (!cells) {
                    new (self) PointTree(set, std::move(values), groups, kind, shade);
                    return;
                }
                CellMeans light{std::move(values), {}};
                if (light.means.size() == cells->cells.places.size() * groups) {
                    light = cell_means(cells->cells, cells->mesh, light.means, groups);
                }
                new (self) PointTree(set, std::move(light.means), groups, kind, shade, &cells->cells, light.moments);
            },
            "points"_a, "irradiance"_a, "profile"_a, "ramp"_a = nb::none(), "cells"_a = nb::none())
        .def(
            "gather",
            [](const PointTree& self, nb::handle positions, float tolerance, const std::string& estimator,
               bool ramp_layers) {
                const std::vector<V3f> where =
                    to_vectors3(as_floats(positions, "PointTree: positions"), "PointTree: positions");
                const GatherOptions options{tolerance, estimator_named(estimator), ramp_layers};
                nb::gil_scoped_release release;
                return self.gather(where.data(), where.size(), options);
            },
            "positions"_a, "tolerance"_a = GatherOptions().tolerance, "estimator"_a = "noise_free",
            "ramp_layers"_a = false,
            "Exitance and coverage at M positions (M, 3), in any order.\n\n"
            "Returns an object with exitance (M, G, 3) and coverage (M, 3); with ramp_layers also layers (M, K, G, 3), "
            "the\n"
            "exitance per hat function of the ramp: colours times layers sum to the exitance (times "
            "Ramp.energy_scale).")
        .def(
            "gather_exact",
            [](const PointTree& self, nb::handle positions, const std::string& estimator) {
                const std::vector<V3f> where =
                    to_vectors3(as_floats(positions, "PointTree: positions"), "PointTree: positions");
                const Estimator kind = estimator_named(estimator);
                nb::gil_scoped_release release;
                return self.gather_exact(where.data(), where.size(), kind);
            },
            "positions"_a, "estimator"_a = "noise_free",
            "The same over every point in double precision: slow, to compare with.")
        .def_prop_ro("point_count", &PointTree::point_count)
        .def_prop_ro("node_count", &PointTree::node_count)
        .def_prop_ro("dropped_count", &PointTree::dropped_count, "Points left out for their non-finite irradiance.");

    module.def(
        "area_compensation",
        [](nb::handle coverage, nb::handle profile, const std::string& mode, float limit, float strength,
           bool by_luminance) {
            const Rgb total = albedo(to_profile(profile));
            const Compensation compensation{mode_named(mode), limit, strength, by_luminance};
            check_compensation(compensation, "area_compensation");
            std::vector<Rgb> gain =
                to_vectors3(as_floats(coverage, "area_compensation: coverage"), "area_compensation: coverage");
            const bool is_fill = compensation.mode == CompensationMode::fill;
            for (Rgb& w : gain) {
                for (int c = 0; c < 3; ++c) {
                    if (w[c] >= 0.0f && std::isfinite(w[c])) continue;
                    throw ValueError(str("area_compensation: coverage must be >= 0 and finite, got ", w[c],
                                         ". Take that of a gather."));
                }
                w = is_fill ? fill_amount(compensation, w, total) : compensation_gain(compensation, w, total);
            }
            const std::size_t n = gain.size();
            return array_of<float>(std::move(gain), {n, 3});
        },
        "coverage"_a, "profile"_a, "mode"_a = "ratio", "limit"_a = 8.0f, "strength"_a = 1.0f, "by_luminance"_a = false,
        "Gain (M, 3) that the exitance is multiplied by, from coverage (M, 3). For mode 'fill' it is the amount to "
        "add\n"
        "per unit of irradiance at the shading point.");
}

}  // namespace frazil
