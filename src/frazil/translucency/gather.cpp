#include <bit>
#include <cmath>
#include <deque>
#include <span>

#include "frazil/base/error.h"
#include "frazil/base/morton.h"
#include "frazil/base/parallel.h"
#include "frazil/base/radix_sort.h"
#include "frazil/translucency/block_sources.h"
#include "frazil/translucency/local_expansion.h"

namespace frazil {
namespace {

// Shading points that one thread takes at a time: of many, more.
constexpr std::size_t kChunk = 2048, kLargestChunk = 8192, kChunks = 64;
constexpr std::size_t kLeafPlaces = 48;  // no smaller blocks are made
// Half a block's diagonal that a source is smooth across, over the radius of a cluster that may stand for it, squared.
constexpr float kSmooth = 2.0f;
// The squared radius of a cluster over its trace, a tenth above that of a square: what lies far out
// counts by how much it is, as in the error of a mean kernel.
constexpr float kSquareOfTrace = 3.3f;
constexpr std::size_t kCacheLine = 64;

// The shading points that the tree reaches, along a Morton curve; to the rest belongs exactly nothing.
std::vector<KeyedIndex> sorted_positions(const PointTree::Impl& tree, const V3f* positions, std::size_t count) {
    constexpr std::size_t grain = 8192;
    constexpr int kBits = 33, kDropped = 3 * kMortonBits - kBits;
    constexpr std::uint64_t kOutside = std::uint64_t(1) << kBits;
    std::vector<KeyedIndex> keys(count), scratch;
    const Box3f& bounds = tree.clusters->bounds;
    const MortonGrid grid(bounds);
    const float reach = tree.kernel->table.reach + bounds.size().length() * 1e-3f;
    std::vector<std::size_t> outside((count + grain - 1) / grain, 0);
    parallel_for(count, grain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const bool is_outside = squared_distance(bounds, positions[i]) > reach * reach;
            keys[i] = {is_outside ? kOutside : grid.code(positions[i]) >> kDropped, static_cast<std::uint32_t>(i)};
            outside[begin / grain] += is_outside;
        }
    });
    radix_sort(keys, kBits + 1, scratch);
    std::size_t inside = count;
    for (const std::size_t n : outside) inside -= n;
    keys.resize(inside);
    return keys;
}

// Gathers at shading points along a Morton curve: blocks of them against nodes of the tree, both cut ever smaller.
// What is smooth across a block is summed at a few nodes there and handed on to its halves as a polynomial.
class BlockGather {
  public:
    BlockGather(const PointTree::Impl& tree, const OpeningRule& rule, bool has_footprints, const RampHinges& ramp)
        : tree_(tree),
          rule_(rule),
          has_footprints_(has_footprints),
          ramp_(ramp),
          far_(tree, rule, has_footprints),
          near_(tree, rule, has_footprints) {}

    // `write(place, row)` takes the sums at each place: exitance (groups, 3), then coverage.
    template <class Write>
    void run(std::span<const KeyedIndex> order, const V3f* positions, const Write& write) {
        order_ = order;
        places_.clear();
        for (const KeyedIndex& at : order) places_.push_back(positions[at.index]);
        candidates_.assign(1, 0);
        gather(0, order.size(), 0, 0, nullptr, write);
    }

  private:
    // A node that stands for its points, or a leaf that its points stand for.
    struct Pick {
        std::uint32_t node;
        bool is_cluster;
    };

    const PointClusters& clusters() const { return *tree_.clusters; }

    // What evaluation reads of a node.
    void prefetch(std::uint32_t index) const {
        const auto touch = [](const auto* first, std::size_t count) {
            const auto* bytes = reinterpret_cast<const char*>(first);
            for (std::size_t at = 0; at < count * sizeof(*first); at += kCacheLine) __builtin_prefetch(bytes + at);
            __builtin_prefetch(bytes + count * sizeof(*first) - 1);
        };
        touch(&clusters().areas_of_nodes[index], 1);
        touch(&tree_.node_powers[index * tree_.groups], tree_.groups);
    }

    // Sort the candidates from `first` on into those that are smooth across the box, those that are not, and, unless the
    // block `is_last`, those that are left to its halves: new candidates.
    void choose(const Box3f& box, std::size_t first, bool has_nodes, bool is_last) {
        const float half_squared = 0.25f * box.size().length2();
        far_picks_.clear();
        near_picks_.clear();
        const std::size_t end = candidates_.size();
        for (std::size_t at = first; at < end; ++at) {
            stack_.assign(1, candidates_[at]);
            while (!stack_.empty()) {
                const std::uint32_t index = stack_.back();
                stack_.pop_back();
                const TreeNode& node = clusters().nodes[index];
                const float q = squared_distance(box, node.center);
                const float beyond = node.radius + tree_.kernel->table.reach;
                if (q > beyond * beyond) continue;
                const float squared = kSquareOfTrace * (node.trace + (has_footprints_ ? 2.0f * node.footprint : 0.0f));
                const float largest = rule_.largest_squared(q);
                const bool is_smooth = has_nodes && half_squared * kSmooth <= largest;
                const bool is_cluster = squared <= largest && (!node.is_leaf() || node.size() > 1);
                if (!is_smooth && !is_last && (node.is_leaf() || is_cluster || squared <= half_squared)) {
                    candidates_.push_back(index);
                } else if (is_cluster || node.is_leaf()) {
                    (is_smooth ? far_picks_ : near_picks_).push_back({index, is_cluster});
                    if (is_cluster) prefetch(index);
                } else {
                    for (std::uint32_t k = node.size(); k-- > 0;) stack_.push_back(node.first + k);
                }
            }
        }
    }

    const SourceList& sources_of(const std::vector<Pick>& picks, const Box3f& box, BlockSources& sources) {
        sources.clear();
        for (const Pick& pick : picks) {
            pick.is_cluster ? sources.add_cluster(pick.node) : sources.add_points(clusters().nodes[pick.node], box);
        }
        return sources.settled();
    }

    // Where a block is cut in two: at a plane between cells of the Morton curve.
    std::size_t middle(std::size_t begin, std::size_t end) const {
        const std::uint64_t differing = order_[begin].key ^ order_[end - 1].key;
        if (differing == 0) return begin + (end - begin) / 2;
        const int shift = 63 - std::countl_zero(differing);
        const std::uint64_t left = order_[begin].key >> shift;
        return std::partition_point(order_.begin() + begin, order_.begin() + end,
                                    [&](const KeyedIndex& at) { return at.key >> shift == left; }) -
               order_.begin();
    }

    // `above` is what has been summed for places [begin, end) and more, candidates from `first` on what is left to sum.
    template <class Write>
    void gather(std::size_t begin, std::size_t end, std::size_t first, std::size_t depth, const LocalExpansion* above,
                const Write& write) {
        const std::span here(places_.data() + begin, end - begin);
        Box3f box;
        for (const V3f& p : here) box.extendBy(p);
        const std::size_t left = candidates_.size();
        const bool is_last = here.size() <= kLeafPlaces;
        choose(box, first, here.size() > LocalExpansion::kNodes, is_last);

        if (!far_picks_.empty()) {
            if (expansions_.size() <= depth) expansions_.resize(depth + 1);
            LocalExpansion& expansion = expansions_[depth];
            lanes_.clear(tree_.groups);
            expansion.place(box, lanes_);
            add_sources(tree_.kernel->table, ramp_, sources_of(far_picks_, box, far_), tree_.groups, lanes_);
            expansion.fit(lanes_, tree_.groups, above);
            above = &expansion;
        }
        if (candidates_.size() > left) {
            const std::size_t cut = middle(begin, end);
            gather(begin, cut, left, depth + 1, above, write);
            gather(cut, end, left, depth + 1, above, write);
        } else {
            sums_.reset(here.size(), tree_.groups);
            if (above) above->eval(here, sums_);
            if (!near_picks_.empty()) add_near(here, sources_of(near_picks_, box, near_));
            for (std::size_t i = 0; i < here.size(); ++i) write(order_[begin + i].index, sums_.exitance(i));
        }
        candidates_.resize(left);
    }

    void add_near(std::span<const V3f> here, const SourceList& list) {
        for (std::size_t at = 0; at < here.size(); at += kBlockLanes) {
            lanes_.clear(tree_.groups);
            lanes_.place(&here[at], std::min(kBlockLanes, here.size() - at));
            add_sources(tree_.kernel->table, ramp_, list, tree_.groups, lanes_);
            sums_.add(at, lanes_);
        }
    }

    const PointTree::Impl& tree_;
    const OpeningRule& rule_;
    bool has_footprints_;
    const RampHinges& ramp_;
    BlockSources far_, near_;
    std::span<const KeyedIndex> order_;
    std::vector<V3f> places_;
    std::vector<std::uint32_t> candidates_, stack_;
    std::vector<Pick> far_picks_, near_picks_;
    BlockSums lanes_;
    std::deque<LocalExpansion> expansions_;  // of the blocks around the one at hand
    SumRows sums_;
};

}  // namespace

Gathered PointTree::gather(const V3f* positions, std::size_t count, const GatherOptions& options) const {
    if (!(options.tolerance > 0.0f && std::isfinite(options.tolerance))) {
        throw ValueError(str("PointTree: tolerance must be > 0, got ", options.tolerance, ". ",
                             GatherOptions().tolerance, " is the default."));
    }
    const Impl& tree = *impl_;
    const TreeKernel& kernel = *tree.kernel;
    Gathered out;
    out.groups = tree.groups;
    out.exitance.assign(count * tree.groups, Rgb(0.0f));
    out.coverage.assign(count, Rgb(0.0f));
    if (options.ramp_layers && kernel.ramp.is_empty()) {
        throw ValueError("PointTree: ramp_layers must be off without a ramp, got on. Give the tree a ramp.");
    }
    if (options.ramp_layers) out.knots = kernel.ramp.distances.size();
    out.layers.assign(count * out.knots * tree.groups, Rgb(0.0f));
    if (count == 0) return out;
    check_positions(positions, count);
    const std::vector<KeyedIndex> order = sorted_positions(tree, positions, count);
    if (tree.clusters->nodes.empty()) return out;

    const OpeningRule& rule = kernel.rule(options.tolerance);
    const std::size_t chunk = std::clamp(order.size() / kChunks, kChunk, kLargestChunk);
    const auto run = [&](const RampHinges& ramp, const auto& write) {
        parallel_for(order.size(), chunk, [&](std::size_t begin, std::size_t end) {
            BlockGather block(tree, rule, options.estimator == Estimator::noise_free, ramp);
            block.run(std::span(order).subspan(begin, end - begin), positions, write);
        });
    };
    run(hinges_of(kernel.ramp, kernel.ramp_scale), [&](std::size_t place, const float* sums) {
        std::copy_n(sums, 3 * tree.groups, &out.exitance[place * tree.groups].x);
        std::copy_n(sums + 3 * tree.groups, 3, &out.coverage[place].x);
    });
    // The same cut once more for every knot of the ramp.
    for (std::size_t k = 0; k < out.knots; ++k) {
        run(hinges_of(hat(kernel.ramp, k), Rgb(1.0f)), [&](std::size_t place, const float* sums) {
            std::copy_n(sums, 3 * tree.groups, &out.layers[(place * out.knots + k) * tree.groups].x);
        });
    }
    return out;
}

}  // namespace frazil
