#include "frazil/render/bake.h"

#include <Imath/ImathMatrixAlgo.h>

#include <algorithm>
#include <array>
#include <map>

#include "frazil/base/error.h"
#include "frazil/points/point_budget.h"
#include "frazil/points/poisson.h"
#include "frazil/points/pose.h"
#include "frazil/points/sampled_spacing.h"
#include "frazil/render/bounces.h"
#include "frazil/render/drift.h"
#include "frazil/render/rays_each.h"
#include "frazil/render/stopwatch.h"

namespace frazil {
namespace {

// In mean free paths. Halving it takes the error of a bunny's translucency from 1.5 % to 0.6 %.
constexpr double kDefaultSpacing = 0.5;
// How many points the default spacing may ask of one body, at most and at least.
constexpr double kMostByDefault = 1e6, kFewestByDefault = 1e3;
// Places of a body that the bake keeps at once, 16 bytes each.
constexpr std::size_t kMostPlaces = 32'000'000;
// Of a cell. One is noisier than light at the points; two are not (tests/python/test_cells.py).
constexpr int kFewestPlaces = 2;
// Spacing over mean free path beyond which single points show.
constexpr float kCoarse = 4.0f;
// How much finer points may be where a texture is dark, which may be black by mistake.
constexpr float kFinestByTexture = 64.0f;
// How much coarser points may be where the camera is far.
constexpr float kCoarsestByPixels = 64.0f;

// The matrix without its rotation, reflection and move: the symmetric S of linear part = S R. Rounded, so that it does not
// change where a body only turns, and with it the points.
M44f stretch_of(const M44f& m) {
    Imath::M33d gram(0.0);
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            for (int k = 0; k < 3; ++k) gram[i][j] += double(m[i][k]) * m[j][k];
        }
    }
    Imath::V3d squares;
    Imath::M33d axes;
    Imath::jacobiEigenSolver(gram, squares, axes);
    const double largest = std::sqrt(std::max({squares.x, squares.y, squares.z, 1e-300}));
    const double step = std::ldexp(1.0, std::ilogb(largest) - 19);
    M44f result;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            double sum = 0.0;
            for (int k = 0; k < 3; ++k) sum += axes[i][k] * std::sqrt(std::max(0.0, squares[k])) * axes[j][k];
            result[i][j] = static_cast<float>(std::round(sum / step) * step);
        }
    }
    return result;
}

// The largest value of a texture on a mesh, by samples of all triangles.
float largest_on(const Mesh& mesh, const MaterialInput<float>& texture) {
    constexpr double kSamples = 1 << 16;
    const int steps = static_cast<int>(std::clamp(std::sqrt(kSamples / double(mesh.triangles.size())), 1.0, 64.0));
    float largest = 0.0f;
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
        for (int u = 0; u <= steps; ++u) {
            for (int v = 0; u + v <= steps; ++v) {
                const V2f at = V2f(float(u), float(v)) / float(steps);
                largest = std::max(largest, eval_float(texture, mesh.uvs.at(mesh.triangles, i, at)));
            }
        }
    }
    return largest;
}

// How far apart points are on an object, in the world: the same all over, linear between vertices, or anything else.
struct PointSpacing {
    float constant = 0.0f;
    std::vector<float> at_vertices;
    SpacingFunction anywhere;
};

// The mesh's own spacing or a texture's, and no finer than the pixels asked for.
PointSpacing spacing_on(const Scene& scene, const Object& object, float constant, const RenderOptions& options) {
    const Mesh& mesh = scene.meshes[object.mesh];
    const auto& texture = std::get<IceMaterial>(scene.materials[object.material].model).spacing;
    PointSpacing result;
    result.constant = constant;
    std::function<float(std::uint32_t, const V2f&)> base = [constant](std::uint32_t, const V2f&) { return constant; };
    if (options.spacing == 0.0f && !mesh.spacing.empty()) {
        result.at_vertices = mesh.spacing;
        for (float& value : result.at_vertices) value *= options.spacing_scale;
        base = [&mesh, scale = options.spacing_scale](std::uint32_t triangle, const V2f& uv) {
            const V3i& t = mesh.triangles[triangle];
            return scale *
                   (mesh.spacing[t.x] * (1.0f - uv.x - uv.y) + mesh.spacing[t.y] * uv.x + mesh.spacing[t.z] * uv.y);
        };
    } else if (options.spacing == 0.0f && texture.lookup.texture && !mesh.uvs.is_empty()) {
        const float largest = largest_on(mesh, texture);
        if (largest > 0.0f) {
            const float least = largest / kFinestByTexture;
            base = [&mesh, &texture, least, scale = options.spacing_scale](std::uint32_t triangle, const V2f& uv) {
                return scale * std::max(least, eval_float(texture, mesh.uvs.at(mesh.triangles, triangle, uv)));
            };
            result.anywhere = at_each_place(base);
        }
    }
    if (options.spacing_pixels == 0.0f) return result;
    const PixelCone cone = pixel_cone(scene.camera, options.width, options.height);
    const V3f eye = V3f(0.0f) * scene.camera.camera_to_world;
    result.anywhere = at_each_place([=, &mesh, &object, pixels = options.spacing_pixels](std::uint32_t triangle,
                                                                                         const V2f& uv) {
        const V3i& t = mesh.triangles[triangle];
        const V3f place =
            mesh.positions[t.x] * (1.0f - uv.x - uv.y) + mesh.positions[t.y] * uv.x + mesh.positions[t.z] * uv.y;
        const float distance = (place * object.local_to_world - eye).length(), finest = base(triangle, uv);
        return std::clamp(pixels * 2.0f * (cone.radius + cone.spread * distance), finest, kCoarsestByPixels * finest);
    });
    return result;
}

// A mesh in a size and shape that it has in the world, turned and moved nowhere yet, and its points: what all objects
// share that place it so, and all frames in which it only moves.
struct Shape {
    M44f stretch;
    double area;
    std::map<std::array<float, 3>, std::shared_ptr<PointCloud>> points;  // by spacing and first scattering
};

class Shapes {
  public:
    explicit Shapes(const Scene& scene) : scene_(scene) {}

    Shape& of(const Object& object) {
        const M44f stretch = stretch_of(object.local_to_world);
        const auto [begin, end] = shapes_.equal_range(object.mesh);
        const auto known = std::find_if(begin, end, [&](const auto& entry) { return entry.second.stretch == stretch; });
        if (known != end) return known->second;
        const Mesh mesh = transformed(scene_.meshes[object.mesh], stretch);
        return shapes_.emplace(object.mesh, Shape{stretch, surface_area(mesh), {}})->second;
    }

    // For an object of that shape.
    PlacedPoints points_of(const Object& object, const Body& body, Shape& shape, float spacing,
                           const RenderOptions& options, Progress* progress) {
        const M44f to_world = shape.stretch.inverse() * object.local_to_world;
        const PointSpacing wanted = spacing_on(scene_, object, spacing, options);
        if (wanted.anywhere) return {place(object, shape, wanted.anywhere, options, progress), to_world};
        if (!wanted.at_vertices.empty()) return {place(object, shape, wanted.at_vertices, options, progress), to_world};
        auto& known = shape.points[{spacing, body.sigma_t(), body.depth()}];
        if (!known) known = place(object, shape, spacing, options, progress);
        return {known, to_world};
    }

  private:
    template <class Spacing>
    std::shared_ptr<PointCloud> place(const Object& object, const Shape& shape, const Spacing& spacing,
                                      const RenderOptions& options, Progress* progress) const {
        const PoissonOptions poisson{options.seed, true, 0};
        const Mesh mesh = transformed(scene_.meshes[object.mesh], shape.stretch);
        return std::make_shared<PointCloud>(place_in_rest(mesh, poisson.thin_walls, [&](const Mesh& rest) {
            return poisson_points(rest, spacing, poisson, progress);
        }));
    }

    const Scene& scene_;
    std::multimap<std::uint32_t, Shape> shapes_;
};

// Bodies whose points are too far apart for their medium: one warning for all those that are alike, as instances are.
class CoarsePoints {
  public:
    void add(const std::string& path, float spacing, float mean_free_path) {
        if (spacing > kCoarse * mean_free_path) paths_[{spacing, mean_free_path}].push_back(path);
    }

    void warn(std::vector<std::string>& warnings) const {
        for (const auto& [distances, paths] : paths_) {
            const auto [spacing, mean_free_path] = distances;
            const std::string others = paths.size() > 1 ? str(" (and ", paths.size() - 1, " more bodies)") : "";
            warnings.push_back(str(paths.front(), others, ": points are ", spacing, " m apart, ",
                                   spacing / mean_free_path, " mean free paths: single points may show. Set the ",
                                   "material's spacing, or a longer mean free path for a body of this size."));
        }
    }

  private:
    std::map<std::pair<float, float>, std::vector<std::string>> paths_;
};

// The points of every body that has none yet.
void add_points(const Scene& scene, const std::vector<std::unique_ptr<Body>>& bodies, const RenderOptions& options,
                std::vector<LitPoints>& lit, RenderStats& stats, Progress* progress) {
    Stopwatch watch(stats.seconds["points"]);
    Shapes shapes(scene);
    CoarsePoints coarse;
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
        if (!bodies[i] || lit[i].points.size() > 0) continue;
        const Object& object = scene.objects[i];
        Shape& shape = shapes.of(object);
        if (!(shape.area > 0.0)) continue;
        try {
            const float spacing = point_spacing(*bodies[i], shape.area, options);
            coarse.add(object.path, spacing, bodies[i]->mean_free_path());
            lit[i].points = shapes.points_of(object, *bodies[i], shape, spacing, options, progress);
        } catch (const ValueError& error) {
            throw ValueError(str(object.path, ": ", error.what()));
        }
    }
    coarse.warn(stats.warnings);
}

struct EnteringLight {
    std::vector<Rgb> irradiance;
    std::vector<V3f> moments;
};

// Light that enters all points, by way of these lights alone.
std::vector<EnteringLight> bake_lights(const Scene& scene, const RayScene& ray_scene, const LightSampler& lights,
                                       const std::vector<std::unique_ptr<Body>>& bodies, const RenderOptions& options,
                                       std::vector<LitPoints>& lit, RenderStats& stats, Progress* progress) {
    const SurfaceResolver resolver(scene);
    for (std::size_t i = 0; i < lit.size(); ++i) {
        if (lit[i].points.size() == 0) continue;
        Stopwatch watch(stats.seconds["bake"]);
        const IceMaterial& material = *bodies[i]->material;
        const PointSet in_world = lit[i].points.in_world();
        const int samples = bake_samples_each(in_world, bodies[i]->mean_free_path(), options);
        IrradianceOptions bake_options{samples, options.seed};
        bake_options.objects = {static_cast<std::uint32_t>(i)};
        bake_options.error = options.bake_error;
        bake_options.with_flows = true;
        Mesh mesh;
        std::shared_ptr<const Cells> cells;
        if (options.gather.estimator == Estimator::noise_free) {
            PointCloud& cloud = lit[i].points.cloud();
            // No more than shadow rays; fewer where points are so many that their cells are small.
            const int places = std::clamp(static_cast<int>(kMostPlaces / cloud.points().size()), kFewestPlaces,
                                          std::clamp(samples, 8, 256));
            cloud.add_cells(true, [&](const PointSet& points) {
                return cells_of(points, mesh_at_cloud(scene, i, lit[i].points), places);
            });
            cells = cloud.cells();
            mesh = transformed(scene.meshes[scene.objects[i].mesh], scene.objects[i].local_to_world);
            bake_options.cells = {cells.get(), &mesh};
        }
        Irradiance irradiance = bake_irradiance(
            in_world, ray_scene, lights,
            [&](float cosine) { return bodies[i]->enters(cosine, material.roughness.value); }, bake_options, progress);
        stats.bake_rays += irradiance.rays;
        stats.dropped_samples += irradiance.dropped_samples;
        keep_entering(resolver.entering(static_cast<std::uint32_t>(i), in_world), irradiance);
        lit[i].irradiance = std::move(irradiance.values);
        lit[i].moments = std::move(irradiance.moments);
        lit[i].flows = std::move(irradiance.flows);
    }
    add_bounces(scene, ray_scene, lights, options, bodies, lit, stats, progress);
    for (std::size_t i = 0; i < lit.size(); ++i) {
        if (lit[i].points.size() == 0) continue;
        Stopwatch watch(stats.seconds["bake"]);
        add_room(i, *bodies[i], ray_scene, nullptr, lit[i].points);
        carry_on(lit[i].points.in_world(), lit[i].flows, bodies[i]->drift_length(), lit[i].irradiance,
                 lit[i].points.cloud().room_along());
        lit[i].flows = {};
    }
    std::vector<EnteringLight> result(lit.size());
    for (std::size_t i = 0; i < lit.size(); ++i) {
        result[i] = {std::move(lit[i].irradiance), std::move(lit[i].moments)};
    }
    return result;
}

std::size_t index_of(const std::vector<std::string>& names, const std::string& name) {
    return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
}

// Copy column `from` of (N, from_count) into column `to` of (N, to_count).
template <class Value>
void copy_group(const std::vector<Value>& source, std::size_t from, std::size_t from_count, std::vector<Value>& target,
                std::size_t to, std::size_t to_count) {
    for (std::size_t k = 0; k * from_count < source.size(); ++k) {
        target[k * to_count + to] = source[k * from_count + from];
    }
}

}  // namespace

float point_spacing(const Body& body, double area, const RenderOptions& options) {
    float spacing = options.spacing;
    if (spacing == 0.0f) spacing = body.material->spacing.value;
    if (spacing == 0.0f) {
        const double finest = std::sqrt(kPointsPerSpacing2 * area / kMostByDefault);
        const double coarsest = std::sqrt(kPointsPerSpacing2 * area / kFewestByDefault);
        spacing = static_cast<float>(std::clamp(kDefaultSpacing * body.mean_free_path(), finest, coarsest));
    }
    return spacing * options.spacing_scale;
}

Bake make_bake(const Scene& scene, const RayScene& ray_scene, const std::vector<std::unique_ptr<Body>>& bodies,
               const RenderOptions& options, Bake known, RenderStats& stats, Progress* progress) {
    Bake bake;
    bake.groups = light_groups(scene.lights);
    bake.bodies.resize(scene.objects.size());
    known.bodies.resize(scene.objects.size());
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (bodies[i]) bake.bodies[i].points = std::move(known.bodies[i].points);
    }
    add_points(scene, bodies, options, bake.bodies, stats, progress);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        const std::size_t values = bake.bodies[i].points.size() * known.groups.size();
        const bool wants_moments = options.gather.estimator == Estimator::noise_free;
        if (known.bodies[i].irradiance.size() == values &&
            known.bodies[i].moments.size() == (wants_moments ? values : 0)) {
            continue;
        }
        known.groups.clear();
        break;
    }

    // The lights of the groups that are not known yet.
    std::vector<Light> wanted;
    for (const Light& light : scene.lights) {
        if (index_of(known.groups, light.group) == known.groups.size()) wanted.push_back(light);
    }
    const LightSampler lights(wanted);
    const std::vector<std::string> fresh_groups = light_groups(wanted);
    std::vector<EnteringLight> fresh(bodies.size());
    if (!wanted.empty()) {
        fresh = bake_lights(scene, ray_scene, lights, bodies, options, bake.bodies, stats, progress);
    }

    const std::size_t groups = bake.groups.size();
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        LitPoints& lit = bake.bodies[i];
        if (!wanted.empty() && fresh_groups == bake.groups) {
            lit.irradiance = std::move(fresh[i].irradiance);
            lit.moments = std::move(fresh[i].moments);
            continue;
        }
        lit.irradiance.assign(lit.points.size() * groups, Rgb(0.0f));
        lit.moments.assign(options.gather.estimator == Estimator::noise_free ? lit.irradiance.size() : 0, V3f(0.0f));
        for (std::size_t g = 0; g < groups; ++g) {
            const std::size_t old = index_of(known.groups, bake.groups[g]);
            if (old < known.groups.size()) {
                const std::size_t columns = known.groups.size();
                copy_group(known.bodies[i].irradiance, old, columns, lit.irradiance, g, groups);
                copy_group(known.bodies[i].moments, old, columns, lit.moments, g, groups);
            } else {
                const std::size_t from = index_of(fresh_groups, bake.groups[g]), columns = fresh_groups.size();
                copy_group(fresh[i].irradiance, from, columns, lit.irradiance, g, groups);
                copy_group(fresh[i].moments, from, columns, lit.moments, g, groups);
            }
        }
        fresh[i] = {};
    }
    for (LitPoints& lit : bake.bodies) {
        if (lit.points.size() > 0) lit.points.cloud().drop_places();
    }
    return bake;
}

void check_bake(const Scene& scene, const Bake& bake) {
    if (bake.bodies.size() != scene.objects.size()) {
        throw ValueError(str("bake: bodies must be one per object (", scene.objects.size(), "), got ",
                             bake.bodies.size(), ". Bake the scene anew."));
    }
    if (bake.groups != light_groups(scene.lights)) {
        throw ValueError("bake: light groups must be the scene's, got others. Bake the scene anew.");
    }
    for (std::size_t i = 0; i < bake.bodies.size(); ++i) {
        const LitPoints& lit = bake.bodies[i];
        if (lit.irradiance.size() == lit.points.size() * bake.groups.size() &&
            (lit.moments.empty() || lit.moments.size() == lit.irradiance.size())) {
            continue;
        }
        throw ValueError(str(scene.objects[i].path, ": irradiance must be one per point and light group (",
                             lit.points.size() * bake.groups.size(), "), got ", lit.irradiance.size(), "."));
    }
}

}  // namespace frazil
