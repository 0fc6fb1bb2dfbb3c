// Translucent bodies: every object of ice with its boundary, its profile and the tree that sums the light of its points.
// Model: one tree per object, or per set of objects that share their light (translucency_sets.h), of the points and light
//   that were baked (bake.h).
// Units: metres, world space.
// Not: light that diffuses from one body into another that it touches.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "frazil/base/progress.h"
#include "frazil/geometry/ray_scene.h"
#include "frazil/lighting/irradiance.h"
#include "frazil/material/microfacet.h"
#include "frazil/render/core_sums.h"
#include "frazil/render/inner_gathers.h"
#include "frazil/render/options.h"
#include "frazil/render/placed_points.h"
#include "frazil/render/point_gathers.h"
#include "frazil/render/scene.h"
#include "frazil/render/shells.h"
#include "frazil/render/surface.h"
#include "frazil/render/thickness.h"
#include "frazil/translucency/half_space.h"
#include "frazil/translucency/point_tree.h"

namespace frazil {

// Of light that leaves, on the mean over angles.
constexpr float kMeanCosine = 2.0f / 3.0f;

struct Body {
    Body(const IceMaterial* of_material, const Medium& of_medium, std::shared_ptr<const DielectricAlbedo> with_boundary,
         const Profile& with_profile, std::shared_ptr<const TreeKernel> sum,
         std::shared_ptr<const TreeKernel> plain_sum)
        : material(of_material),
          medium(of_medium),
          boundary(std::move(with_boundary)),
          profile(with_profile),
          kernel(std::move(sum)),
          plain_kernel(std::move(plain_sum)),
          total_reflectance(albedo(with_profile)) {}

    const IceMaterial* material = nullptr;
    Medium medium;  // of the core: the material's at the body's mean density
    std::shared_ptr<const DielectricAlbedo> boundary;
    Profile profile;
    std::shared_ptr<const TreeKernel> kernel, plain_kernel;  // of the profile, with the material's ramp and without
    Rgb total_reflectance = Rgb(0.0f);                       // Rd_total
    std::shared_ptr<const std::array<DirectionalAlbedo, 3>> by_angle;
    std::shared_ptr<const DirectionalAlbedo> white_by_angle;  // were nothing absorbed
    // Trees stand where their points do: places are brought there by `to_points`.
    M44f to_points;
    CoreTrees trees;
    std::vector<std::uint32_t> overlay_layers;  // which the columns of trees.overlays are
    // Light of one scattering that rays trace and the profile leaves out: its plane albedo, over irradiance; and what the
    // core's radiance is scaled by, so that it averages to the exitance less what each ray finds to be scattered once.
    float traced = 0.0f;  // how much of it
    Rgb traced_once = Rgb(0.0f), core_scale = Rgb(1.0f);
    float spacing = 0.0f;                                     // of its points
    std::shared_ptr<const PointGathers> at_points = nullptr;  // where a render has a use for them
    std::shared_ptr<const InnerGathers> inside = nullptr;     // beside at_points

    std::shared_ptr<const ThinMedium> thin = nullptr;

    // What exitance is scaled by where W is `coverage`; `thin` is what thin parts gain (thin_gain), null without.
    Rgb gain(const Compensation& compensation, const Rgb& coverage, const Rgb* thin) const;

    // What the boundary lets in (and out) at this angle; its mean over all directions; for one user roughness.
    float transmittance(float cos_theta, float roughness) const;
    float transmittance_average(float roughness) const;
    // How light that enters or leaves depends on the angle (cosine outside): the directional albedo of a half space of the
    // core, over its mean.
    Rgb angular_share(float cos_theta) const;
    // As it leaves to a camera, over what a white core would send there: rays find that themselves (cross_interior). `cosine`
    // inside, times how far in it comes from on the mean, in free paths.
    Rgb leaving_share(float cosine) const;
    // How many free paths deep it is on the mean that light is absorbed that would leave there: EvenLight::absorbed_at.
    Rgb absorbed_at(float cosine) const;
    // The cosine inside of a ray outside.
    float cosine_inside(float cos_theta) const;
    // The tangential part of a free path inside along a `direction` outside.
    V3f drift(const V3f& direction, const V3f& normal) const;
    // The mean way to where light that comes along the surface is scattered first, per channel, weighted by what leaves again.
    Rgb drift_length() const;
    // What is left of such a way where light that is not scattered leaves the body after `length` metres.
    float drift_within(float length) const;
    // How far inwards a free path goes, on the mean over light from all around.
    float depth() const;
    float sigma_t() const;  // mean over channels
    // Of the channel that scatters and absorbs most.
    float mean_free_path() const;

    // What enters at this angle of the light outside, weighted by how much of it leaves the core again.
    Rgb enters(float cos_theta, float roughness) const;
    // Radiance over squared index, inside below the surface, per unit of exitance: what leaves before the boundary dims
    // it, averaged over angles.
    Rgb inner_radiance_per_exitance(const Surface& surface) const;
    // Radiance towards wo per unit of exitance: as it leaves inside, then through the boundary, so that it averages to one.
    Rgb radiance_per_exitance(const Surface& surface, const V3f& wo) const;
};

// A body's points and the light that enters them.
struct LitPoints {
    PlacedPoints points;
    std::vector<Rgb> irradiance;    // (N, groups)
    std::vector<V3f> moments = {};  // (N, groups), as in Irradiance; empty where light was baked at the points alone
    std::vector<Flow> flows = {};   // (N, groups), while light is baked
};

// Give the points of an object (of a set that it leads, where there are shells) the room that is there for a first scattering.
void add_room(std::size_t object, const Body& body, const RayScene& scene, const Shells* shells,
              const PlacedPoints& points);

// The mesh of an object where its points' cloud is.
Mesh mesh_at_cloud(const Scene& scene, std::size_t object, const PlacedPoints& points);
// A tree of light on points that stand somewhere, as far inwards as there is room or on the surface; `moments` in the world.
std::shared_ptr<const PointTree> make_tree(const PlacedPoints& points, std::shared_ptr<const TreeKernel> kernel,
                                           const std::vector<Rgb>& irradiance, std::size_t groups,
                                           std::vector<V3f> moments = {}, bool is_on_surface = false);

class TranslucencySets;

// Trees that sum the exponent of thin parts (thickness.h) over the points of bodies. A closed body's chords end at its own other
// side, so that bodies that share their points share this too; an open one's at whatever is there.
class ThicknessTrees {
  public:
    // All must outlive this.
    ThicknessTrees(const Scene& scene, const RayScene& ray_scene, const std::vector<std::unique_ptr<Body>>& bodies,
                   const TranslucencySets& sets)
        : scene_(scene), ray_scene_(ray_scene), bodies_(bodies), sets_(sets) {}

    // Of a leader of translucency sets; null where it has no points.
    std::shared_ptr<const ThinField> of(std::size_t leader);
    // The gain of each of its points; null where it has none.
    std::shared_ptr<const std::vector<Rgb>> gains_at_points(std::size_t leader);

  private:
    bool is_shared(std::size_t leader);
    bool is_closed_body(std::size_t leader);
    std::shared_ptr<const Thinness> thinness_of(std::size_t leader);

    const Scene& scene_;
    const RayScene& ray_scene_;
    const std::vector<std::unique_ptr<Body>>& bodies_;
    const TranslucencySets& sets_;
    std::map<std::uint32_t, bool> is_closed_;  // by mesh
    // By what they depend on: points, and a kernel that a material has for itself.
    using Key = std::pair<const PointCloud*, const TreeKernel*>;
    std::map<Key, std::shared_ptr<const ThinField>> fields_;
};

// Scale the exitance that was gathered for bounces: by `depth` at full strength, whatever the material asks for where it is
// seen. So bounces keep energy, and a picture's compensation can be changed exactly after its render. `gains` as above.
void compensate_bounce(const Body& body, const std::vector<Rgb>& gains, Gathered& gathered);
// What each object lets through for shadow rays: ice what its boundary transmits and its medium, as dense as it is in each
// place, neither scatters nor absorbs; others nothing. The scene must outlive these.
std::vector<Passage> passages_of(const Scene& scene);

// One entry per object of the scene, without trees; null for those that are not ice.
std::vector<std::unique_ptr<Body>> make_bodies(const Scene& scene);

// Give every body the tree of its points, (N, groups) of light each, and that of its thickness where its compensation has a
// use for it or a layer `wants_depth`; that of its surface where its compensation has, or a layer `wants_surface`. `has_taken(i)`
// is called when the light of an object is needed no more. Fills points, nodes and seconds of the stats. Returns which
// bodies share their tree; it refers to what was given.
TranslucencySets plant_trees(
    const Scene& scene, const std::vector<LitPoints>& lit, std::size_t groups, const RayScene& ray_scene,
    bool wants_depth, bool wants_surface, std::vector<std::unique_ptr<Body>>& bodies, RenderStats& stats,
    const std::function<void(std::size_t)>& has_taken = [](std::size_t) {});

// Give every body that has its trees, of so many light groups, the gathers at its points where the plan wants them.
void add_gathers(const TranslucencySets& sets, std::size_t groups, PointGatherPlan plan,
                 std::vector<std::unique_ptr<Body>>& bodies, RenderStats& stats);

}  // namespace frazil
