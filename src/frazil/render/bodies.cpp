#include "frazil/render/bodies.h"

#include <algorithm>
#include <map>
#include <optional>
#include <tuple>

#include "frazil/render/drift.h"
#include "frazil/render/interior.h"
#include "frazil/render/rays_each.h"
#include "frazil/render/stopwatch.h"
#include "frazil/render/thickness.h"
#include "frazil/render/translucency_sets.h"
#include "frazil/translucency/half_space.h"

namespace frazil {
namespace {

double single_albedo(const Medium& medium, int channel) {
    return medium.sigma_s_prime[channel] / (double(medium.sigma_s_prime[channel]) + medium.sigma_a[channel]);
}

std::shared_ptr<const std::array<DirectionalAlbedo, 3>> directional_albedos(const Medium& medium, double less_once) {
    auto result = std::make_shared<std::array<DirectionalAlbedo, 3>>();
    for (int c = 0; c < 3; ++c) (*result)[c] = DirectionalAlbedo(single_albedo(medium, c), medium.eta, less_once);
    return result;
}

}  // namespace

float Body::transmittance(float cos_theta, float roughness) const {
    return 1.0f - material->specular * boundary->eval(cos_theta, alpha_from_roughness(roughness));
}

float Body::transmittance_average(float roughness) const {
    return 1.0f - material->specular * boundary->average(alpha_from_roughness(roughness));
}

float Body::cosine_inside(float cos_theta) const {
    const float sine = std::sqrt(std::max(0.0f, 1.0f - cos_theta * cos_theta)) / medium.eta;
    return std::sqrt(std::max(0.0f, 1.0f - sine * sine));
}

Rgb Body::angular_share(float cos_theta) const {
    const float mu = cosine_inside(cos_theta);
    return {(*by_angle)[0](mu), (*by_angle)[1](mu), (*by_angle)[2](mu)};
}

Rgb Body::leaving_share(float cosine) const {
    return Rgb((*by_angle)[0](cosine), (*by_angle)[1](cosine), (*by_angle)[2](cosine)) / (*white_by_angle)(cosine);
}

Rgb Body::absorbed_at(float cosine) const {
    Rgb depth;
    for (int c = 0; c < 3; ++c) depth[c] = thin->even_light[std::size_t(c)].absorbed_at(cosine);
    return depth;
}

V3f Body::drift(const V3f& direction, const V3f& normal) const {
    return (direction - normal * direction.dot(normal)) / (medium.eta * sigma_t());
}

float Body::sigma_t() const {
    return mean_sigma_t(medium);
}

float Body::mean_free_path() const {
    return 1.0f / max_component(medium.sigma_s_prime + medium.sigma_a);
}

float Body::drift_within(float length) const {
    return first_scattering_within(length * sigma_t());
}

float Body::depth() const {
    // The mean cosine inside of light from all around, in closed form; 2/3 where the boundary does not bend it.
    const float eta = medium.eta, bent = 1.0f - 1.0f / (eta * eta);
    const float cosine = 2.0f / 3.0f * eta * eta * (1.0f - bent * std::sqrt(bent));
    return cosine / sigma_t();
}

Rgb Body::drift_length() const {
    return (angular_share(1.0f) * 2.0f - Rgb(1.0f)) / ((medium.sigma_s_prime + medium.sigma_a) * medium.eta);
}

Rgb Body::enters(float cos_theta, float roughness) const {
    return angular_share(cos_theta) * transmittance(cos_theta, roughness);
}

Rgb Body::inner_radiance_per_exitance(const Surface& surface) const {
    const float average = transmittance_average(surface.covering.roughness);
    return eval_color(material->tint, surface.texture_point) * surface.covering.tint *
           (material->translucency * kInvPi / average);
}

Rgb Body::radiance_per_exitance(const Surface& surface, const V3f& wo) const {
    const float cosine = surface.normal.dot(wo);
    return inner_radiance_per_exitance(surface) * enters(cosine, surface.covering.roughness);
}

std::vector<std::unique_ptr<Body>> make_bodies(const Scene& scene) {
    std::vector<std::unique_ptr<Body>> bodies(scene.objects.size());
    std::map<float, std::shared_ptr<const DielectricAlbedo>> boundaries;  // by eta
    struct Shared {
        std::optional<Profile> profile;
        std::shared_ptr<const TreeKernel> kernel, plain_kernel;
        std::shared_ptr<const std::array<DirectionalAlbedo, 3>> by_angle;
        std::shared_ptr<const DirectionalAlbedo> white_by_angle;
        std::shared_ptr<const ThinMedium> thin;
    };
    std::map<std::tuple<const IceMaterial*, bool, float>, Shared> shared;     // by mean density
    std::map<std::pair<const IceMaterial*, std::uint32_t>, float> densities;  // by mesh
    std::map<std::uint32_t, bool> closed;                                     // by mesh, of those that it matters for
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
        const auto* material = std::get_if<IceMaterial>(&scene.materials[scene.objects[i].material].model);
        if (!material) continue;
        auto& boundary = boundaries[material->medium.eta];
        if (!boundary) boundary = std::make_shared<DielectricAlbedo>(material->medium.eta);
        float mean = 1.0f;
        if (!material->density.is_even()) {
            const std::uint32_t mesh = scene.objects[i].mesh;
            const auto [found, is_new] = densities.try_emplace({material, mesh}, 1.0f);
            if (is_new) found->second = mean_density(material->density, scene.meshes[mesh]);
            mean = found->second;
        }
        const Medium medium = mean_medium(material->medium, material->density, mean);
        // What rays trace of the light that is scattered once, the profile leaves out.
        bool is_traced = material->volume > 0.0f;
        if (is_traced) {
            const auto [found, is_new] = closed.try_emplace(scene.objects[i].mesh, false);
            if (is_new) found->second = is_closed(scene.meshes[scene.objects[i].mesh]);
            is_traced = found->second;
        }
        const double traced = is_traced ? material->volume : 0.0;
        auto& [profile, kernel, plain_kernel, by_angle, white_by_angle, thin] = shared[{material, is_traced, mean}];
        if (!profile) {
            profile = make_profile(material->profile, medium, 1.0 - traced);
            plain_kernel = make_tree_kernel(*profile);
            const double less_once = lacks_single_scattering(material->profile) ? traced : 0.0;
            by_angle = directional_albedos(medium, less_once);
            white_by_angle = std::make_shared<const DirectionalAlbedo>(1.0, medium.eta, less_once);
            thin = std::make_shared<const ThinMedium>(ThinMedium::of(medium, static_cast<float>(less_once)));
            kernel = material->ramp.is_empty() ? plain_kernel : make_tree_kernel(*profile, material->ramp);
        }
        bodies[i] = std::make_unique<Body>(material, medium, boundary, *profile, kernel, plain_kernel);
        bodies[i]->by_angle = by_angle;
        bodies[i]->white_by_angle = white_by_angle;
        bodies[i]->thin = thin;
        if (!is_traced || !lacks_single_scattering(material->profile)) continue;
        const double white = half_space_albedo(1.0, medium.eta).single;
        bodies[i]->traced = static_cast<float>(traced);
        bodies[i]->core_scale = Rgb(static_cast<float>(1.0 / (1.0 - traced * white)));
        for (int c = 0; c < 3; ++c) {
            const double alpha = single_albedo(medium, c);
            bodies[i]->traced_once[c] = static_cast<float>(traced * half_space_albedo(alpha, medium.eta).single);
        }
    }
    return bodies;
}

void add_room(std::size_t object, const Body& body, const RayScene& scene, const Shells* shells,
              const PlacedPoints& points) {
    points.cloud().add_room(body.sigma_t(), body.depth(), [&] {
        std::vector<std::uint8_t> itself(object + 1, 0);
        itself[object] = 1;
        const int chords =
            rays_each(points.in_world(), body.mean_free_path(), ChordFinder::kMost, ChordFinder::kFewest);
        return room_of(points.in_world(), ChordFinder(scene, shells, &itself, chords), body.sigma_t());
    });
}

Mesh mesh_at_cloud(const Scene& scene, std::size_t object, const PlacedPoints& points) {
    const Object& placed = scene.objects[object];
    return transformed(scene.meshes[placed.mesh], placed.local_to_world * points.to_cloud());
}

std::shared_ptr<const PointTree> make_tree(const PlacedPoints& points, std::shared_ptr<const TreeKernel> kernel,
                                           const std::vector<Rgb>& irradiance, std::size_t groups,
                                           std::vector<V3f> moments, bool is_on_surface) {
    auto clusters = is_on_surface ? points.cloud().surface_clusters() : points.cloud().clusters();
    moments = points.into_cloud(std::move(moments));
    if (!is_on_surface) points.cloud().move_inwards(moments, groups);
    return std::make_shared<const PointTree>(std::move(clusters), std::move(kernel), irradiance, groups, moments);
}

bool ThicknessTrees::is_shared(std::size_t leader) {
    return !sets_.shells(leader) && is_closed_body(leader);
}

bool ThicknessTrees::is_closed_body(std::size_t leader) {
    const auto [found, is_new] = is_closed_.try_emplace(scene_.objects[leader].mesh, false);
    if (is_new) found->second = is_closed(scene_.meshes[scene_.objects[leader].mesh]);
    return found->second;
}

std::shared_ptr<const Thinness> ThicknessTrees::thinness_of(std::size_t leader) {
    const PlacedPoints& points = sets_.points(leader);
    const Body& body = *bodies_[leader];
    const float seen_through = is_closed_body(leader) ? body.material->refraction : 0.0f;
    std::vector<std::uint8_t> itself(leader + 1, 0);
    itself[leader] = 1;
    const auto make = [&](PlacementMask mask) {
        return thinness(points.in_world(), points.first_scattering_in_world(), ray_scene_, *body.thin, seen_through,
                        sets_.shells(leader), mask);
    };
    if (!is_shared(leader)) return std::make_shared<const Thinness>(make(nullptr));
    const Rgb &scatter = body.medium.sigma_s_prime, &absorb = body.medium.sigma_a;
    return points.cloud().thinness(
        {scatter.x, scatter.y, scatter.z, absorb.x, absorb.y, absorb.z, body.medium.eta, body.traced, seen_through},
        [&] { return make(&itself); });
}

std::shared_ptr<const ThinField> ThicknessTrees::of(std::size_t leader) {
    const PlacedPoints& points = sets_.points(leader);
    if (points.size() == 0) return nullptr;
    const Body& body = *bodies_[leader];
    const auto plant = [&] {
        const std::shared_ptr<const Thinness> known = thinness_of(leader);
        return std::make_shared<const ThinField>(points.cloud().points(), points.cloud().cells().get(), *known,
                                                 make_tree(points, body.plain_kernel, known->exponent, 2), body.thin);
    };
    if (!is_shared(leader)) return plant();
    auto& shared = fields_[{&points.cloud(), body.plain_kernel.get()}];
    if (!shared) shared = plant();
    return shared;
}

std::shared_ptr<const std::vector<Rgb>> ThicknessTrees::gains_at_points(std::size_t leader) {
    if (sets_.points(leader).size() == 0) return nullptr;
    const std::shared_ptr<const Thinness> known = thinness_of(leader);
    return {known, &known->gain};
}

Rgb Body::gain(const Compensation& compensation, const Rgb& coverage, const Rgb* thin) const {
    if (!thin) return compensation_gain(compensation, coverage, total_reflectance);
    Compensation full = compensation;
    full.strength = 1.0f;
    const Rgb gain = compensation_gain(full, coverage, total_reflectance) * *thin;
    return Rgb(1.0f) + (gain - Rgb(1.0f)) * compensation.strength;
}

void compensate_bounce(const Body& body, const std::vector<Rgb>& gains, Gathered& gathered) {
    const Compensation compensation;
    for (std::size_t i = 0; i < gathered.coverage.size(); ++i) {
        const Rgb gain = body.gain(compensation, gathered.coverage[i], gains.empty() ? nullptr : &gains[i]);
        for (std::size_t g = 0; g < gathered.groups; ++g) gathered.exitance[i * gathered.groups + g] *= gain;
    }
}

TranslucencySets plant_trees(const Scene& scene, const std::vector<LitPoints>& lit, std::size_t groups,
                             const RayScene& ray_scene, bool wants_depth, bool wants_surface,
                             std::vector<std::unique_ptr<Body>>& bodies, RenderStats& stats,
                             const std::function<void(std::size_t)>& has_taken) {
    Stopwatch watch(stats.seconds["tree"]);
    // A bake from elsewhere has no cells: make those that its light was a mean over.
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (!bodies[i] || lit[i].moments.empty()) continue;
        PointCloud& cloud = lit[i].points.cloud();
        cloud.add_cells(
            false, [&](const PointSet& points) { return cells_of(points, mesh_at_cloud(scene, i, lit[i].points), 1); });
        cloud.drop_places();
    }
    TranslucencySets sets(scene, ray_scene, bodies, lit);
    stats.warnings.insert(stats.warnings.end(), sets.warnings().begin(), sets.warnings().end());
    ThicknessTrees thickness(scene, ray_scene, bodies, sets);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (!bodies[i] || lit[i].points.size() == 0) continue;
        Body& body = *bodies[i];
        body.spacing = static_cast<float>(lit[i].points.spacing());
        const std::size_t leader = sets.leader(i);
        body.to_points = sets.points(leader).to_cloud();
        if (!sets.is_leader(i)) {
            body.trees = bodies[leader]->trees;
            continue;
        }
        const bool is_alone = !sets.shells(i);
        const auto plant = [&](bool is_on_surface) {
            if (is_alone) {
                return make_tree(lit[i].points, body.kernel, lit[i].irradiance, groups, lit[i].moments, is_on_surface);
            }
            return make_tree(sets.points(i), body.kernel,
                             sets.united(i, groups, [&](std::size_t k) { return &lit[k].irradiance; }), groups,
                             sets.united(i, groups, [&](std::size_t k) { return &lit[k].moments; }), is_on_surface);
        };
        body.trees.light = plant(false);
        const Compensation& compensation = body.material->compensation;
        if (wants_surface || !keeps_energy(compensation.mode) || compensation.strength < 1.0f) {
            body.trees.on_surface = plant(true);
        }
        if (is_alone) has_taken(i);
        if (wants_depth || compensation.mode == CompensationMode::depth) {
            body.trees.thin = thickness.of(i);
        }
        stats.points += body.trees.light->point_count();
        stats.nodes += body.trees.light->node_count();
    }
    return sets;
}

void add_gathers(const TranslucencySets& sets, std::size_t groups, PointGatherPlan plan,
                 std::vector<std::unique_ptr<Body>>& bodies, RenderStats& stats) {
    Stopwatch watch(stats.seconds["tree"]);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (!bodies[i] || !bodies[i]->trees.light) continue;
        Body& body = *bodies[i];
        if (!sets.is_leader(i)) {
            body.at_points = bodies[sets.leader(i)]->at_points;
            body.inside = bodies[sets.leader(i)]->inside;
            continue;
        }
        body.at_points = PointGathers::make(body, sets.points(i).cloud(), groups, plan);
        if (body.at_points) body.inside = std::make_shared<const InnerGathers>(body, groups, plan.options_for(body));
    }
}

std::vector<Passage> passages_of(const Scene& scene) {
    std::vector<Passage> passages(scene.objects.size());
    const SurfaceResolver resolver(scene);
    for (std::size_t i = 0; i < passages.size(); ++i) {
        const auto* ice = std::get_if<IceMaterial>(&scene.materials[scene.objects[i].material].model);
        if (!ice || ice->refraction == 0.0f) continue;
        const Medium& medium = ice->medium;
        Passage& passage = passages[i];
        passage = {ice->refraction, medium.eta, medium.sigma_s_prime + medium.sigma_a, ice->refraction_tint,
                   ice->priority};
        if (ice->density.is_even()) continue;
        passage.attenuation = medium.sigma_a * (1.0f - ice->density.absorption);
        passage.dense_attenuation = medium.sigma_s_prime + medium.sigma_a * ice->density.absorption;
        passage.depth = [field = DensityField(ice->density, scene.objects[i].local_to_world.inverse(),
                                              resolver.world_to_rest(std::uint32_t(i)))](
                            const V3f& origin, const V3f& direction, float length) {
            return field.depth(origin, direction, length);
        };
    }
    return passages;
}

}  // namespace frazil
