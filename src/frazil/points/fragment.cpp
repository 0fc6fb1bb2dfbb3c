#include "frazil/points/fragment.h"

#include "frazil/points/polygon_clip.h"

namespace frazil {
namespace {

struct Corner {
    V3d position;
    V2d uv;
    double radius;
};

Corner mix(const Corner& a, const Corner& b, double t) {
    return {a.position + (b.position - a.position) * t, a.uv + (b.uv - a.uv) * t, a.radius + (b.radius - a.radius) * t};
}

void halve(const Corner& a, const Corner& b, const Corner& c, double longest_edge, const V3f& normal,
           std::int32_t triangle, std::vector<Fragment>& fragments) {
    const double ab = (b.position - a.position).length2(), bc = (c.position - b.position).length2(),
                 ca = (a.position - c.position).length2();
    const double longest = std::max(ab, std::max(bc, ca));
    const double limit = longest_edge * std::min(a.radius, std::min(b.radius, c.radius));
    if (longest <= limit * limit) {
        fragments.push_back({{V3f(a.position), V3f(b.position), V3f(c.position)},
                             {float(a.radius), float(b.radius), float(c.radius)},
                             {a.uv, b.uv, c.uv},
                             normal,
                             triangle});
        return;
    }
    if (ab < longest && bc == longest) return halve(b, c, a, longest_edge, normal, triangle, fragments);
    if (ab < longest) return halve(c, a, b, longest_edge, normal, triangle, fragments);
    const Corner middle = mix(a, b, 0.5);
    halve(a, middle, c, longest_edge, normal, triangle, fragments);
    halve(middle, b, c, longest_edge, normal, triangle, fragments);
}

}  // namespace

V3f unit_normal(const Mesh& mesh, std::size_t triangle) {
    V3d cross = triangle_cross(mesh, triangle);
    // Scale first, so that the square of a tiny area does not vanish.
    const double largest = std::max(std::abs(cross.x), std::max(std::abs(cross.y), std::abs(cross.z)));
    if (!(largest > 0.0)) return V3f(0.0f);
    cross /= largest;
    return V3f(cross / std::sqrt(cross.dot(cross)));
}

void append_fragments(const Mesh& mesh, const SpacingField& spacing, const TileFrame& frame, std::int32_t triangle,
                      double longest_edge, std::vector<Fragment>& fragments) {
    const V3f normal = unit_normal(mesh, triangle);
    if (normal == V3f(0.0f)) return;

    ClipPolygon<Corner> polygon;
    for (int k = 0; k < 3; ++k) {
        const std::int32_t vertex = mesh.triangles[triangle][k];
        polygon.push(
            {frame.to_local(mesh.positions[vertex]), V2d(k == 1, k == 2), spacing.at_vertex(vertex) / frame.unit});
    }
    for (int axis = 0; axis < 3; ++axis) {
        polygon.clip([&](const Corner& corner) { return -corner.position[axis]; }, mix);
        polygon.clip([&](const Corner& corner) { return corner.position[axis] - frame.size; }, mix);
    }
    for (int k = 2; k < polygon.count; ++k) {
        halve(polygon.vertices[0], polygon.vertices[k - 1], polygon.vertices[k], longest_edge, normal, triangle,
              fragments);
    }
}

}  // namespace frazil
