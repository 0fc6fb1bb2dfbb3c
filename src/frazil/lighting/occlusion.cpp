#include "frazil/lighting/occlusion.h"

#include <algorithm>

#include "frazil/base/error.h"
#include "frazil/base/morton.h"
#include "frazil/base/parallel.h"
#include "frazil/base/radix_sort.h"
#include "frazil/base/sampler.h"
#include "frazil/base/trigonometry.h"

namespace frazil {
namespace {

constexpr std::size_t kPointsPerChunk = 64;
constexpr std::size_t kLeafSize = 4;

void check(const PointSet& points, float distance) {
    if (points.normals.size() != points.size()) {
        throw ValueError(
            str("PointSet: normals must be one per point (", points.size(), "), got ", points.normals.size(), "."));
    }
    if (!(distance > 0.0f)) throw ValueError(str("occlusion: distance must be > 0, got ", distance, "."));
}

// Disks by position: a binary tree over the Morton order, its nodes in pre-order.
class DiskTree {
  public:
    explicit DiskTree(const PointSet& points) : points_(points), order_(points.size()) {
        Box3f box;
        for (const V3f& p : points.positions) box.extendBy(p);
        const MortonGrid grid(box);
        std::vector<KeyedIndex> keys(points.size()), scratch;
        for (std::uint32_t i = 0; i < keys.size(); ++i) keys[i] = {grid.code(points.positions[i]), i};
        radix_sort(keys, 3 * kMortonBits, scratch);
        for (std::size_t i = 0; i < keys.size(); ++i) order_[i] = keys[i].index;
        if (!order_.empty()) build(0, order_.size());
    }

    const std::vector<std::uint32_t>& order() const { return order_; }

    // Sum area and normals, weighed by what each point counts.
    void weigh(const std::vector<float>& weights) {
        for (std::size_t i = nodes_.size(); i-- > 0;) {
            Node& node = nodes_[i];
            node.area = 0.0f;
            node.flow = V3f(0.0f);
            const auto add = [&](float area, const V3f& flow) { node.area += area, node.flow += flow; };
            if (node.right == 0) {
                for (std::size_t k = node.begin; k < node.end; ++k) {
                    const float area = points_.areas[order_[k]] * weights[order_[k]];
                    add(area, points_.normals[order_[k]] * area);
                }
            } else {
                for (const std::size_t child : {i + 1, std::size_t(node.right)}) {
                    add(nodes_[child].area, nodes_[child].flow);
                }
            }
        }
    }

    // What hides the sky from a point: the sum over disks of their share of the hemisphere by cosine, and of the
    // directions that they hide.
    void gather(std::uint32_t point, float distance, float tolerance, const std::vector<float>& weights, float& hidden,
                V3f& hidden_flow) const {
        const V3f& position = points_.positions[point];
        const V3f& normal = points_.normals[point];
        hidden = 0.0f;
        hidden_flow = V3f(0.0f);
        const auto add = [&](const V3f& to, float area, const V3f& flow) {
            const float d2 = to.length2(), d = std::sqrt(d2);
            if (d2 == 0.0f || d > distance) return;
            const V3f direction = to / d;
            const float receiving = normal.dot(direction);
            if (receiving <= 0.0f) return;
            // Either side of a disk hides; a disk's own share stays below the hemisphere's when it is near.
            const float facing = std::abs(flow.dot(direction)), share = receiving * facing / (kPi * d2 + area);
            hidden += share;
            hidden_flow += direction * share;
        };
        std::size_t i = 0;
        while (i < nodes_.size()) {
            const Node& node = nodes_[i];
            const V3f to = node.center - position;
            const float d2 = to.length2();
            const bool is_beyond = std::sqrt(d2) > distance + node.radius;
            // Below the horizon as a whole.
            const bool is_below = to.dot(normal) < -node.radius;
            if (is_beyond || is_below) {
                i = node.skip;
            } else if (d2 > 4.0f * node.radius * node.radius && node.area < tolerance * d2) {
                add(to, node.area, node.flow);
                i = node.skip;
            } else if (node.right == 0) {
                for (std::size_t k = node.begin; k < node.end; ++k) {
                    const std::uint32_t other = order_[k];
                    if (other == point) continue;
                    const float area = points_.areas[other] * weights[other];
                    add(points_.positions[other] - position, area, points_.normals[other] * area);
                }
                i = node.skip;
            } else {
                ++i;
            }
        }
    }

  private:
    struct Node {
        V3f center = V3f(0.0f);
        float radius = 0.0f, area = 0.0f;
        V3f flow = V3f(0.0f);  // sum of area times normal
        std::size_t begin = 0, end = 0, right = 0, skip = 0;
    };
    void build(std::size_t begin, std::size_t end) {
        const std::size_t index = nodes_.size();
        nodes_.emplace_back();
        Box3f box;
        for (std::size_t k = begin; k < end; ++k) box.extendBy(points_.positions[order_[k]]);
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

Occlusion bake_occlusion(const PointSet& points, const RayScene& scene, const OcclusionOptions& options) {
    check(points, options.distance);
    if (options.samples < 1 || options.samples > (1 << 20)) {
        throw ValueError(str("occlusion: samples must be in [1, 2^20], got ", options.samples, "."));
    }
    Occlusion result{std::vector<float>(points.size(), 1.0f), points.normals};
    const ScrambledNet net(options.samples);
    parallel_for(points.size(), kPointsPerChunk, [&](std::size_t begin, std::size_t end) {
        std::vector<V2f> u(net.size());
        std::vector<Ray> rays(net.size());
        std::vector<std::uint8_t> is_hidden(net.size());
        for (std::size_t i = begin; i < end; ++i) {
            const V3f& normal = points.normals[i];
            const V3f origin = offset_origin(points.positions[i], normal);
            const auto [s, t] = tangent_frame(normal);
            net.draw(options.seed, std::uint32_t(i), u);
            for (std::size_t k = 0; k < u.size(); ++k) {
                const V2f circle = cos_sin_turns(u[k].y) * std::sqrt(u[k].x);
                const float cosine = std::sqrt(std::max(0.0f, 1.0f - u[k].x));
                rays[k] = {origin, s * circle.x + t * circle.y + normal * cosine, 0.0f, options.distance};
            }
            scene.are_occluded(rays, is_hidden);
            int open = 0;
            V3f mean(0.0f);
            for (std::size_t k = 0; k < rays.size(); ++k) {
                if (is_hidden[k]) continue;
                ++open;
                mean += rays[k].direction;
            }
            result.openness[i] = float(open) / float(rays.size());
            if (mean.length2() > 0.0f) result.bent_normals[i] = mean.normalized();
        }
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
    DiskTree tree(points);
    std::vector<float> weights(points.size(), 1.0f);
    // The first pass counts all disks; in the second those that are hidden themselves hide less.
    for (int pass = 0; pass < 2; ++pass) {
        tree.weigh(weights);
        parallel_for(points.size(), kPointsPerChunk, [&](std::size_t begin, std::size_t end) {
            for (std::size_t k = begin; k < end; ++k) {
                const std::uint32_t i = tree.order()[k];
                float hidden;
                V3f hidden_flow;
                tree.gather(i, distance, tolerance, weights, hidden, hidden_flow);
                result.openness[i] = std::max(0.0f, 1.0f - hidden);
                // The mean direction of a whole hemisphere by cosine is 2/3 of the normal.
                const V3f open = points.normals[i] * (2.0f / 3.0f) - hidden_flow;
                result.bent_normals[i] = open.length2() > 1e-8f ? open.normalized() : points.normals[i];
            }
        });
        weights = result.openness;
    }
    return result;
}

}  // namespace frazil
