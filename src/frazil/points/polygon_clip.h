// Convex polygons cut by half-spaces: the one clip that tiles, fragments and nearest-point areas share.
// Model: Sutherland-Hodgman, one plane at a time, vertices of any type that can be mixed linearly.
// Valid: convex polygons; a cut adds at most one vertex.
// Not: concave polygons; topology.
#pragma once

namespace frazil {

template <class Vertex, int kCapacity = 24>
struct ClipPolygon {
    Vertex vertices[kCapacity];
    int count = 0;

    void push(const Vertex& vertex) {
        if (count < kCapacity) vertices[count++] = vertex;
    }

    // Keep the part where height(vertex) <= 0; mix(a, b, t) makes the vertices on the cut.
    template <class Height, class Mix>
    void clip(const Height& height, const Mix& mix) {
        double heights[kCapacity];
        bool any_out = false, any_in = false;
        for (int i = 0; i < count; ++i) {
            heights[i] = height(vertices[i]);
            (heights[i] > 0.0 ? any_out : any_in) = true;
        }
        if (!any_out) return;
        if (!any_in) {
            count = 0;
            return;
        }
        ClipPolygon kept;
        for (int i = 0; i < count; ++i) {
            const int j = i + 1 == count ? 0 : i + 1;
            if (heights[i] <= 0.0) kept.push(vertices[i]);
            if ((heights[i] <= 0.0) != (heights[j] <= 0.0)) {
                // Always from the inner to the outer end, so that two polygons that share the edge share the cut.
                const int in = heights[i] <= 0.0 ? i : j, out = in == i ? j : i;
                kept.push(mix(vertices[in], vertices[out], heights[in] / (heights[in] - heights[out])));
            }
        }
        count = kept.count;
        for (int i = 0; i < count; ++i) vertices[i] = kept.vertices[i];
    }
};

}  // namespace frazil
