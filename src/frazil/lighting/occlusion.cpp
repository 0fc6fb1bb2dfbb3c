#include "frazil/lighting/occlusion.h"

#include <algorithm>
#include <array>

#include "frazil/base/error.h"
#include "frazil/base/morton_order.h"
#include "frazil/base/parallel.h"
#include "frazil/base/sampler.h"
#include "frazil/base/trigonometry.h"

namespace frazil {
namespace {

constexpr std::size_t kPointsPerChunk = 64, kRaysPerBatch = 4096;
constexpr std::size_t kLeafSize = 4;

void check(const PointSet& points, float distance) {
    if (points.normals.size() != points.size()) {
        throw ValueError(
            str("PointSet: normals must be one per point (", points.size(), "), got ", points.normals.size(), "."));
    }
    if (!(distance > 0.0f)) throw ValueError(str("occlusion: distance must be > 0, got ", distance, "."));
}

const OcclusionOptions& checked(const OcclusionOptions& options) {
    if (options.samples >= 1 && options.samples <= (1 << 20)) return options;
    throw ValueError(str("occlusion: samples must be in [1, 2^20], got ", options.samples, "."));
}

// The hemisphere over a point as a raster of its cosine-weighted measure: a disk of equal cells [Christensen2008].
class Raster {
  public:
    static constexpr int kSize = 16;

    Raster() {
        for (int y = 0; y < kSize; ++y) {
            for (int x = 0; x < kSize; ++x) {
                const float u = (2.0f * float(x) + 1.0f) / kSize - 1.0f, v = (2.0f * float(y) + 1.0f) / kSize - 1.0f;
                const float rest = 1.0f - u * u - v * v;
                cell_at_[std::size_t(y * kSize + x)] = rest > 0.0f ? int(directions_.size()) : -1;
                if (rest > 0.0f) directions_.emplace_back(u, v, std::sqrt(rest));
            }
        }
    }

    std::size_t size() const { return directions_.size(); }
    const std::vector<V3f>& directions() const { return directions_; }  // local, the normal is z

    // The solid angle of a cell in a direction of this cosine.
    static float solid_angle(float cosine) { return (2.0f / kSize) * (2.0f / kSize) / std::max(cosine, 1.0f / kSize); }
    // Hide a part of a cell's size about a direction: shared out to the four cells whose middles are nearest.
    void hide_part(const V3f& direction, float part, std::vector<float>& hidden) const {
        const float x = (direction.x + 1.0f) * (0.5f * kSize) - 0.5f, y = (direction.y + 1.0f) * (0.5f * kSize) - 0.5f;
        const int left = int(std::floor(x)), low = int(std::floor(y));
        for (int k = 0; k < 4; ++k) {
            const int column = left + (k & 1), row = low + (k >> 1);
            if (column < 0 || row < 0 || column >= kSize || row >= kSize) continue;
            const int cell = cell_at_[std::size_t(row * kSize + column)];
            if (cell < 0) continue;
            const float share = (1.0f - std::abs(x - float(column))) * (1.0f - std::abs(y - float(row)));
            float& value = hidden[std::size_t(cell)];
            value = std::min(1.0f, value + share * part);
        }
    }
    // Hide what a disk hides: its middle, unit normal and radius.
    void hide_disk(const V3f& to, const V3f& normal, float radius, std::vector<float>& hidden) const {
        const float distance = to.length(), plane = to.dot(normal);
        // Directions to it differ from that to its middle by no more than this.
        const float reach = std::min(1.0f, distance > radius ? 1.5f * radius / distance : 1.0f) + 1.0f / kSize;
        const V2f center(to.x / distance, to.y / distance);
        const auto bound = [](float x) { return std::clamp(int((x + 1.0f) * (0.5f * kSize)), 0, kSize - 1); };
        for (int y = bound(center.y - reach); y <= bound(center.y + reach); ++y) {
            for (int x = bound(center.x - reach); x <= bound(center.x + reach); ++x) {
                const int cell = cell_at_[std::size_t(y * kSize + x)];
                if (cell < 0 || hidden[std::size_t(cell)] >= 1.0f) continue;
                const V3f& direction = directions_[std::size_t(cell)];
                const float slope = direction.dot(normal);
                if (slope == 0.0f) continue;
                const float t = plane / slope;
                if (t > 0.0f && (direction * t - to).length2() <= radius * radius) hidden[std::size_t(cell)] = 1.0f;
            }
        }
    }

  private:
    std::vector<V3f> directions_;
    std::array<int, std::size_t(kSize) * kSize> cell_at_{};
};

// Disks by position: a binary tree over the Morton order, its nodes in pre-order.
class DiskTree {
  public:
    explicit DiskTree(const PointSet& points) : points_(points), order_(morton_order(points.positions)) {
        if (!order_.empty()) build(0, order_.size());
    }

    const std::vector<std::uint32_t>& order() const { return order_; }

    // What hides each cell of a point's raster, 0 to 1. A cluster that is seen under less than `tolerance` counts as one
    // disk that faces the point.
    void gather(std::uint32_t point, float distance, float tolerance, const Raster& raster,
                std::vector<float>& hidden) const {
        hidden.assign(raster.size(), 0.0f);
        const V3f& position = points_.positions[point];
        const V3f& normal = points_.normals[point];
        const auto [s, t] = tangent_frame(normal);
        const V3f side = s, other_side = t;
        const auto to_local = [&](const V3f& v) { return V3f(v.dot(side), v.dot(other_side), v.dot(normal)); };
        std::size_t i = 0;
        while (i < nodes_.size()) {
            const Node& node = nodes_[i];
            const V3f to = node.center - position;
            const float d2 = to.length2(), d = std::sqrt(d2);
            if (d > distance + node.radius || to.dot(normal) < -node.radius) {
                i = node.skip;
                continue;
            }
            if (d > 2.0f * node.radius && node.area < tolerance * d2 && d <= distance) {
                // A cluster that the horizon cuts counts in part.
                const float above = std::clamp(0.5f + 0.5f * to.dot(normal) / node.radius, 0.0f, 1.0f);
                hide_cluster(to_local(to), above * seen_area(node, to / d), raster, hidden);
                i = node.skip;
                continue;
            }
            if (node.right == 0) {
                for (std::size_t k = node.begin; k < node.end; ++k) {
                    const std::uint32_t other = order_[k];
                    const V3f to_other = points_.positions[other] - position;
                    if (other == point || to_other.length2() > distance * distance) continue;
                    const float area = points_.areas[other];
                    const float radius = std::sqrt(area * kInvPi);
                    const V3f local = to_local(to_other);
                    if (local.z + radius <= 0.0f || local.length2() == 0.0f) continue;
                    const V3f facing = to_local(points_.normals[other]);
                    if (area > Raster::solid_angle(local.z / local.length()) * local.length2()) {
                        raster.hide_disk(local, facing, radius, hidden);
                    } else if (local.z > 0.0f) {
                        hide_cluster(local, area * std::abs(facing.dot(local)) / local.length(), raster, hidden);
                    }
                }
                i = node.skip;
                continue;
            }
            ++i;
        }
    }

  private:
    struct Node {
        V3f center = V3f(0.0f);
        float radius = 0.0f, area = 0.0f;
        V3f flow = V3f(0.0f);  // sum of area times normal
        std::size_t begin = 0, end = 0, right = 0, skip = 0;
    };

    // What a cluster hides in a direction: what looks one way by its cosine, the rest as a convex body, a quarter.
    static float seen_area(const Node& node, const V3f& direction) {
        return std::abs(node.flow.dot(direction)) + 0.25f * std::max(0.0f, node.area - node.flow.length());
    }

    static void hide_cluster(const V3f& to, float area, const Raster& raster, std::vector<float>& hidden) {
        const float d2 = to.length2();
        if (!(to.z > 0.0f)) return;
        const V3f direction = to / std::sqrt(d2);
        const float cell = Raster::solid_angle(direction.z);
        if (area > cell * d2) {
            raster.hide_disk(to, direction, std::sqrt(area * kInvPi), hidden);
        } else {
            raster.hide_part(direction, area / (cell * d2), hidden);
        }
    }

    void build(std::size_t begin, std::size_t end) {
        const std::size_t index = nodes_.size();
        nodes_.emplace_back();
        Box3f box;
        for (std::size_t k = begin; k < end; ++k) {
            const std::uint32_t point = order_[k];
            box.extendBy(points_.positions[point]);
            nodes_[index].area += points_.areas[point];
            nodes_[index].flow += points_.normals[point] * points_.areas[point];
        }
        nodes_[index].center = (box.min + box.max) * 0.5f;
        nodes_[index].radius = 0.5f * (box.max - box.min).length();
        nodes_[index].begin = begin, nodes_[index].end = end;
        if (end - begin > kLeafSize) {
            const std::size_t middle = (begin + end) / 2;
            build(begin, middle);
            nodes_[index].right = nodes_.size();
            build(middle, end);
        }
        nodes_[index].skip = nodes_.size();
    }

    const PointSet& points_;
    std::vector<std::uint32_t> order_;
    std::vector<Node> nodes_;
};

}  // namespace

OcclusionBaker::OcclusionBaker(const RayScene& scene, const OcclusionOptions& options)
    : scene_(scene), options_(options), net_(checked(options).samples) {}

std::size_t OcclusionBaker::run_size() const {
    return std::clamp<std::size_t>(kRaysPerBatch / net_.size(), 1, kPointsPerChunk);
}

void OcclusionBaker::bake(const PointSet& points, std::span<const std::uint32_t> run, std::size_t first,
                          Occlusion& result) const {
    std::vector<V2f> u(net_.size());
    std::vector<Ray> rays;
    for (const std::uint32_t i : run) {
        const V3f& normal = points.normals[i];
        const V3f origin = offset_origin(points.positions[i], normal);
        const auto [s, t] = tangent_frame(normal);
        net_.draw_part(options_.seed, std::uint32_t(first++), u);
        for (const V2f& sample : u) {
            const V3f local = cosine_hemisphere(sample);
            rays.push_back({origin, s * local.x + t * local.y + normal * local.z, 0.0f, options_.distance});
        }
    }
    std::vector<std::uint8_t> is_hidden(rays.size());
    scene_.are_occluded(rays, is_hidden);
    std::size_t ray = 0;
    for (const std::uint32_t i : run) {
        int open = 0;
        V3f mean(0.0f);
        for (std::size_t sample = 0; sample < net_.size(); ++sample, ++ray) {
            if (is_hidden[ray]) continue;
            ++open;
            mean += rays[ray].direction;
        }
        result.openness[i] = float(open) / float(net_.size());
        result.bent_normals[i] = mean.length2() > 0.0f ? mean.normalized() : points.normals[i];
    }
}

Occlusion bake_occlusion(const PointSet& points, const RayScene& scene, const OcclusionOptions& options) {
    check(points, options.distance);
    const OcclusionBaker baker(scene, options);
    Occlusion result{std::vector<float>(points.size()), std::vector<V3f>(points.size())};
    const std::vector<std::uint32_t> order = morton_order(points.positions);
    parallel_for(points.size(), baker.run_size(), [&](std::size_t begin, std::size_t end) {
        baker.bake(points, std::span(order).subspan(begin, end - begin), begin, result);
    });
    return result;
}

Occlusion point_occlusion(const PointSet& points, float distance, float tolerance) {
    check(points, distance);
    if (points.areas.size() != points.size()) {
        throw ValueError(
            str("PointSet: areas must be one per point (", points.size(), "), got ", points.areas.size(), "."));
    }
    if (!(tolerance > 0.0f)) throw ValueError(str("occlusion: tolerance must be > 0, got ", tolerance, "."));
    Occlusion result{std::vector<float>(points.size(), 1.0f), points.normals};
    const DiskTree tree(points);
    const Raster raster;
    parallel_for(points.size(), kPointsPerChunk, [&](std::size_t begin, std::size_t end) {
        std::vector<float> hidden;
        for (std::size_t k = begin; k < end; ++k) {
            const std::uint32_t i = tree.order()[k];
            tree.gather(i, distance, tolerance, raster, hidden);
            float open = 0.0f;
            V3f mean(0.0f);
            for (std::size_t cell = 0; cell < raster.size(); ++cell) {
                open += 1.0f - hidden[cell];
                mean += raster.directions()[cell] * (1.0f - hidden[cell]);
            }
            result.openness[i] = open / float(raster.size());
            const auto [s, t] = tangent_frame(points.normals[i]);
            const V3f bent = s * mean.x + t * mean.y + points.normals[i] * mean.z;
            if (bent.length2() > 1e-8f) result.bent_normals[i] = bent.normalized();
        }
    });
    return result;
}

}  // namespace frazil
