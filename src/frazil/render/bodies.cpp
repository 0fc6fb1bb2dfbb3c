#include "frazil/render/bodies.h"

#include <array>
#include <map>

#include "frazil/base/error.h"
#include "frazil/points/point_budget.h"
#include "frazil/points/poisson.h"
#include "frazil/render/bounces.h"
#include "frazil/render/stopwatch.h"

namespace frazil {
namespace {

// In mean free paths. Halving it takes the error of a bunny's translucency from 1.5 % to 0.6 %.
constexpr double kDefaultSpacing = 0.5;
// How many points the default spacing may ask of one body, at most and at least.
constexpr double kMostByDefault = 1e6, kFewestByDefault = 1e3;
// Spacing over mean free path beyond which single points show.
constexpr float kCoarse = 4.0f;

// Lengths and angles of the matrix's axes: equal for matrices that differ by a rotation, reflection or move.
std::array<float, 6> metric(const M44f& m) {
    const V3f x(m[0][0], m[0][1], m[0][2]), y(m[1][0], m[1][1], m[1][2]), z(m[2][0], m[2][1], m[2][2]);
    return {x.dot(x), y.dot(y), z.dot(z), x.dot(y), y.dot(z), z.dot(x)};
}

bool is_same_metric(const std::array<float, 6>& a, const std::array<float, 6>& b) {
    const float scale = a[0] + a[1] + a[2];
    for (std::size_t i = 0; i < a.size(); ++i) {
        if (std::abs(a[i] - b[i]) > 1e-5f * scale) return false;
    }
    return true;
}

PointSet moved(const PointSet& points, const M44f& rigid) {
    PointSet result = points;
    const M44f inverse = rigid.inverse();
    for (V3f& position : result.positions) position = position * rigid;
    for (V3f& normal : result.normals) normal = transform_normal(normal, inverse);
    return result;
}

// A point set in the world, and the placement that it was made for.
struct SharedPoints {
    float spacing;
    M44f local_to_world;
    PointSet points;
};

// The points of an object, taken from another placement of the same mesh where that is the same but for a rigid motion.
PointSet points_of(const Object& object, const Mesh& world_mesh, float spacing, std::uint32_t seed,
                   std::multimap<std::uint32_t, SharedPoints>& shared, Progress* progress) {
    const auto [begin, end] = shared.equal_range(object.mesh);
    for (auto it = begin; it != end; ++it) {
        const SharedPoints& other = it->second;
        if (other.spacing == spacing && is_same_metric(metric(other.local_to_world), metric(object.local_to_world))) {
            return moved(other.points, other.local_to_world.inverse() * object.local_to_world);
        }
    }
    PoissonOptions options;
    options.seed = seed;
    const PointSet points = poisson_points(world_mesh, spacing, options, progress);
    shared.emplace(object.mesh, SharedPoints{spacing, object.local_to_world, points});
    return points;
}

}  // namespace

float point_spacing(const IceMaterial& material, double area, const RenderOptions& options) {
    float spacing = options.spacing;
    if (spacing == 0.0f) spacing = material.spacing;
    if (spacing == 0.0f) {
        const Rgb sigma_t_prime = material.medium.sigma_s_prime + material.medium.sigma_a;
        const double finest = std::sqrt(kPointsPerSpacing2 * area / kMostByDefault);
        const double coarsest = std::sqrt(kPointsPerSpacing2 * area / kFewestByDefault);
        spacing = static_cast<float>(std::clamp(kDefaultSpacing / max_component(sigma_t_prime), finest, coarsest));
    }
    return spacing * options.spacing_scale;
}

float Body::transmittance(float cos_theta, float roughness) const {
    return 1.0f - material->specular * boundary->eval(cos_theta, alpha_from_roughness(roughness));
}

float Body::transmittance_average(float roughness) const {
    return 1.0f - material->specular * boundary->average(alpha_from_roughness(roughness));
}

Rgb Body::radiance_per_exitance(const Surface& surface, const V3f& wo) const {
    const float roughness = eval_float(material->roughness, surface.st);
    const float leaving = transmittance(surface.normal.dot(wo), roughness) / transmittance_average(roughness);
    return eval_color(material->tint, surface.st) * (material->translucency * kInvPi * leaving);
}

std::vector<std::unique_ptr<Body>> make_bodies(const Scene& scene, const RayScene& ray_scene,
                                               const LightSampler& lights, const RenderOptions& options,
                                               RenderStats& stats, Progress* progress) {
    std::vector<std::unique_ptr<Body>> bodies(scene.objects.size());
    std::vector<LitPoints> lit(scene.objects.size());
    std::multimap<std::uint32_t, SharedPoints> shared;
    std::map<float, std::shared_ptr<const DielectricAlbedo>> boundaries;  // by eta

    // Points, and the light that reaches them straight from the lights.
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
        const Object& object = scene.objects[i];
        const auto* material = std::get_if<IceMaterial>(&scene.materials[object.material].model);
        if (!material) continue;
        auto& boundary = boundaries[material->medium.eta];
        if (!boundary) boundary = std::make_shared<DielectricAlbedo>(material->medium.eta);
        const Profile profile = Dipole(material->medium);
        bodies[i] = std::make_unique<Body>(Body{material, boundary, profile, albedo(profile), nullptr});

        const Mesh world_mesh = transformed(scene.meshes[object.mesh], object.local_to_world);
        const double area = surface_area(world_mesh);
        if (!(area > 0.0)) continue;
        try {
            Stopwatch points_watch(stats.seconds["points"]);
            const float spacing = point_spacing(*material, area, options);
            const float mean_free_path =
                1.0f / max_component(material->medium.sigma_s_prime + material->medium.sigma_a);
            if (spacing > kCoarse * mean_free_path) {
                stats.warnings.push_back(
                    str(object.path, ": points are ", spacing, " m apart, ", spacing / mean_free_path,
                        " mean free paths: single points may show. Set the ",
                        "material's spacing, or a longer mean free path for a body of this size."));
            }
            lit[i].points = points_of(object, world_mesh, spacing, options.seed, shared, progress);
            points_watch.stop();

            Stopwatch bake_watch(stats.seconds["bake"]);
            const auto transmittance = [&](float cos_theta) {
                return bodies[i]->transmittance(cos_theta, material->roughness.value);
            };
            IrradianceOptions bake_options{options.bake_samples, options.seed};
            bake_options.objects = {static_cast<std::uint32_t>(i)};
            Irradiance irradiance =
                bake_irradiance(lit[i].points, ray_scene, lights, transmittance, bake_options, progress);
            stats.bake_rays += irradiance.rays;
            stats.dropped_samples += irradiance.dropped_samples;
            lit[i].irradiance = std::move(irradiance.values);
        } catch (const ValueError& error) {
            throw ValueError(str(object.path, ": ", error.what()));
        }
    }
    add_bounces(scene, ray_scene, lights, options, bodies, lit, stats, progress);

    const std::size_t groups = light_groups(scene.lights).size();
    Stopwatch tree_watch(stats.seconds["tree"]);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (!bodies[i] || lit[i].points.size() == 0) continue;
        bodies[i]->tree = std::make_unique<const PointTree>(lit[i].points, std::move(lit[i].irradiance), groups,
                                                            bodies[i]->profile, bodies[i]->material->ramp);
        stats.points += bodies[i]->tree->point_count();
        stats.nodes += bodies[i]->tree->node_count();
        lit[i] = {};
    }
    return bodies;
}

}  // namespace frazil
