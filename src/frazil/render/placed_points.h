// A body's points where it stands: a cloud that all bodies of its shape share, and the way from there into the world.
// Model: the way is a rotation or reflection and a move, so that distances and areas are the same in both.
// Units: metres.
// Valid: thread-safe.
// Not: the light on the points, which every body has for itself (LitPoints).
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

#include "frazil/points/cells.h"
#include "frazil/points/point_lookup.h"
#include "frazil/points/point_set.h"
#include "frazil/render/drift.h"
#include "frazil/render/thickness.h"
#include "frazil/translucency/point_clusters.h"

namespace frazil {

class PointCloud {
  public:
    explicit PointCloud(PointSet points) : points_(std::move(points)) {}

    const PointSet& points() const { return points_; }
    // Null where light is baked at the points alone.
    std::shared_ptr<const Cells> cells() const;
    // Give it cells unless it has some; with places where `needs_places`.
    void add_cells(bool needs_places, const std::function<Cells(const PointSet&)>& make);
    // Places are of use to bakes alone.
    void drop_places();

    // Give it the room that its body leaves for a first scattering, `depth` metres inwards where there is room; unless it has
    // it already.
    void add_room(float sigma_t, float depth, const std::function<Room()>& make);
    // Where light is scattered first, on the mean: what its clusters are made of, and exitance is summed at.
    std::vector<V3f> inward_positions() const;
    // The same of all that points stand for.
    FirstScattering first_scattering() const;
    std::vector<float> room_along() const;
    // Moments of light in cells, (N, groups), from the surface to there.
    void move_inwards(std::vector<V3f>& moments, std::size_t groups) const;

    // What thin parts around its points return (thickness.h), for one body: made anew where the body it is `of` is another.
    using ThinBody = std::array<float, 9>;
    std::shared_ptr<const Thinness> thinness(const ThinBody& of, const std::function<Thinness()>& make);
    // Of use from the bake until trees are planted, while bodies stay where they are.
    void drop_thinness();

    // Made when first asked for, with the cells and the room that are there by then.
    std::shared_ptr<const PointClusters> clusters();
    // The same without that room: on the surface.
    std::shared_ptr<const PointClusters> surface_clusters();
    std::shared_ptr<const PointLookup> lookup();

  private:
    // Their moments alone, where light is scattered first; with the lock held.
    Cells cells_inwards() const;

    PointSet points_;
    mutable std::mutex mutex_;  // over what follows
    std::shared_ptr<const Cells> cells_;
    Room room_;
    float sigma_t_ = 0.0f, depth_ = 0.0f;  // of the room
    ThinBody thin_body_{};
    std::shared_ptr<const Thinness> thinness_;
    std::shared_ptr<const PointClusters> clusters_, surface_clusters_;
    std::shared_ptr<const PointLookup> lookup_;
};

class PlacedPoints {
  public:
    PlacedPoints() = default;
    PlacedPoints(std::shared_ptr<PointCloud> cloud, const M44f& to_world)
        : cloud_(std::move(cloud)), to_world_(to_world), to_cloud_(to_world.inverse()) {}
    // A cloud of its own, in the world already.
    explicit PlacedPoints(PointSet points) : cloud_(std::make_shared<PointCloud>(std::move(points))) {}

    PointCloud& cloud() const { return *cloud_; }
    const M44f& to_cloud() const { return to_cloud_; }
    std::size_t size() const { return cloud_ ? cloud_->points().size() : 0; }
    double spacing() const { return cloud_ ? cloud_->points().spacing : 0.0; }

    PointSet in_world() const;
    // PointCloud::first_scattering() in the world.
    FirstScattering first_scattering_in_world() const;
    // Moved into the world; places stay as they are.
    Cells cells_in_world() const;
    // Vectors of the world, such as moments of light, in the frame of the cloud.
    std::vector<V3f> into_cloud(std::vector<V3f> vectors) const;
    V3f into_cloud(const V3f& vector) const {
        V3f turned;
        to_cloud_.multDirMatrix(vector, turned);
        return turned;
    }

  private:
    std::shared_ptr<PointCloud> cloud_;
    M44f to_world_, to_cloud_;
};

}  // namespace frazil
