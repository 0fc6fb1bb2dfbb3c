#include "frazil/render/placed_points.h"

#include "frazil/base/parallel.h"

namespace frazil {

std::shared_ptr<const Cells> PointCloud::cells() const {
    const std::lock_guard lock(mutex_);
    return cells_;
}

void PointCloud::add_cells(bool needs_places, const std::function<Cells(const PointSet&)>& make) {
    const std::lock_guard lock(mutex_);
    if (cells_ && !(needs_places && cells_->places.empty())) return;
    cells_ = std::make_shared<const Cells>(make(points_));
    clusters_ = surface_clusters_ = nullptr;
}

void PointCloud::drop_places() {
    const std::lock_guard lock(mutex_);
    if (!cells_ || cells_->places.empty()) return;
    Cells moments;
    moments.areas = cells_->areas;
    moments.centroids = cells_->centroids;
    moments.covariances = cells_->covariances;
    moments.normals = cells_->normals;
    cells_ = std::make_shared<const Cells>(std::move(moments));
}

std::shared_ptr<const PointClusters> PointCloud::clusters() {
    const std::lock_guard lock(mutex_);
    if (clusters_) return clusters_;
    PointSet points = points_;
    for (std::size_t k = 0; k < room_.inwards.size(); ++k) {
        points.positions[k] += points_.normals[k] * (-depth_ * room_.inwards[k]);
    }
    const Cells cells = cells_inwards();
    clusters_ = std::make_shared<const PointClusters>(cluster_points(points, cells_ ? &cells : nullptr));
    return clusters_;
}

Cells PointCloud::cells_inwards() const {
    Cells cells;
    if (!cells_) return cells;
    cells.areas = cells_->areas;
    cells.centroids = cells_->centroids;
    cells.covariances = cells_->covariances;
    for (std::size_t k = 0; k < room_.inwards.size(); ++k) {
        const float outwards = -depth_ * room_.inwards[k];
        move_along_normals(outwards, cells_->normals[k], cells.centroids[k], cells.covariances[k]);
    }
    return cells;
}

std::shared_ptr<const PointClusters> PointCloud::surface_clusters() {
    const std::lock_guard lock(mutex_);
    if (!surface_clusters_) {
        surface_clusters_ = std::make_shared<const PointClusters>(cluster_points(points_, cells_.get()));
    }
    return surface_clusters_;
}

void PointCloud::add_room(float sigma_t, float depth, const std::function<Room()>& make) {
    const std::lock_guard lock(mutex_);
    if (!room_.inwards.empty() && sigma_t_ == sigma_t && depth_ == depth) return;
    room_ = make();
    sigma_t_ = sigma_t;
    depth_ = depth;
    clusters_ = nullptr;
}

std::shared_ptr<const Thinness> PointCloud::thinness(const ThinBody& of, const std::function<Thinness()>& make) {
    {
        const std::lock_guard lock(mutex_);
        if (thinness_ && thin_body_ == of) return thinness_;
    }
    auto made = std::make_shared<const Thinness>(make());  // which asks for inward positions itself
    const std::lock_guard lock(mutex_);
    thinness_ = std::move(made);
    thin_body_ = of;
    return thinness_;
}

void PointCloud::drop_thinness() {
    const std::lock_guard lock(mutex_);
    thinness_ = nullptr;
}

std::vector<V3f> PointCloud::inward_positions() const {
    const std::lock_guard lock(mutex_);
    std::vector<V3f> positions = points_.positions;
    for (std::size_t k = 0; k < room_.inwards.size(); ++k) {
        positions[k] -= points_.normals[k] * (depth_ * room_.inwards[k]);
    }
    return positions;
}

void PointCloud::move_inwards(std::vector<V3f>& moments, std::size_t groups) const {
    const std::lock_guard lock(mutex_);
    if (!cells_ || room_.inwards.empty()) return;
    parallel_for(moments.size() / groups, 4096, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            const CellBend bend(cells_->normals[k], cells_->covariances[k], -depth_ * room_.inwards[k]);
            for (std::size_t g = 0; g < groups; ++g) moments[k * groups + g] = bend.moved(moments[k * groups + g]);
        }
    });
}

FirstScattering PointCloud::first_scattering() const {
    FirstScattering result{inward_positions(), {}, {}};
    const std::lock_guard lock(mutex_);
    result.depths.assign(points_.size(), 0.0f);
    for (std::size_t k = 0; k < room_.inwards.size(); ++k) result.depths[k] = depth_ * room_.inwards[k];
    if (!cells_) return result;
    Cells cells = cells_inwards();
    for (std::size_t k = 0; k < points_.size(); ++k) {
        result.axes.push_back(ellipse_of(cells.covariances[k], points_.normals[k]));
    }
    result.centers = std::move(cells.centroids);
    return result;
}

std::vector<float> PointCloud::room_along() const {
    const std::lock_guard lock(mutex_);
    return room_.along;
}

std::shared_ptr<const PointLookup> PointCloud::lookup() {
    const std::lock_guard lock(mutex_);
    if (!lookup_) lookup_ = std::make_shared<const PointLookup>(points_);
    return lookup_;
}

PointSet PlacedPoints::in_world() const {
    if (!cloud_) return {};
    PointSet result = cloud_->points();
    if (to_world_ == M44f()) return result;  // to the bit: normals made anew may differ in their last one
    for (V3f& position : result.positions) position = position * to_world_;
    for (V3f& normal : result.normals) normal = transform_normal(normal, to_cloud_);
    return result;
}

FirstScattering PlacedPoints::first_scattering_in_world() const {
    if (!cloud_) return {};
    FirstScattering result = cloud_->first_scattering();
    for (V3f& center : result.centers) center = center * to_world_;
    for (std::array<V3f, 2>& axes : result.axes) {
        for (V3f& axis : axes) to_world_.multDirMatrix(V3f(axis), axis);
    }
    return result;
}

Cells PlacedPoints::cells_in_world() const {
    Cells result = *cloud_->cells();
    for (V3f& centroid : result.centroids) centroid = centroid * to_world_;
    const auto turn = [&](Covariance& c) {
        // Row by row, then column by column.
        V3f rows[3] = {{c[0], c[3], c[4]}, {c[3], c[1], c[5]}, {c[4], c[5], c[2]}};
        for (V3f& row : rows) to_world_.multDirMatrix(V3f(row), row);
        V3f columns[3];
        for (int i = 0; i < 3; ++i) to_world_.multDirMatrix(V3f(rows[0][i], rows[1][i], rows[2][i]), columns[i]);
        c = {columns[0].x, columns[1].y, columns[2].z, columns[0].y, columns[0].z, columns[1].z};
    };
    for (Covariance& c : result.covariances) turn(c);
    for (CellNormals& normals : result.normals) {
        to_world_.multDirMatrix(V3f(normals.mean), normals.mean);
        turn(normals.with_place);
        turn(normals.own);
    }
    return result;
}

std::vector<V3f> PlacedPoints::into_cloud(std::vector<V3f> vectors) const {
    for (V3f& v : vectors) to_cloud_.multDirMatrix(V3f(v), v);
    return vectors;
}

}  // namespace frazil
