#include "frazil/points/patch.h"

#include "frazil/points/polygon_clip.h"

namespace frazil {
namespace {

// A place in the plane of a triangle, from its first corner, and the spacing there; all in the tile's unit.
struct PlanePlace {
    double u, v, spacing;
};
using PlanePolygon = ClipPolygon<PlanePlace, kMostCorners>;

PlanePlace mix(const PlanePlace& a, const PlanePlace& b, double t) {
    return {a.u + (b.u - a.u) * t, a.v + (b.v - a.v) * t, a.spacing + (b.spacing - a.spacing) * t};
}

struct Corners {
    V3d position[3];
    double edge2[3];  // squared lengths of 01, 12, 20
    int longest;      // of the edges
};

Corners corners_of(const Mesh& mesh, std::size_t triangle) {
    Corners c;
    const V3i& t = mesh.triangles[triangle];
    for (int k = 0; k < 3; ++k) c.position[k] = V3d(mesh.positions[t[k]]);
    for (int k = 0; k < 3; ++k) c.edge2[k] = (c.position[k == 2 ? 0 : k + 1] - c.position[k]).length2();
    c.longest = c.edge2[0] >= c.edge2[1] && c.edge2[0] >= c.edge2[2] ? 0 : c.edge2[1] >= c.edge2[2] ? 1 : 2;
    return c;
}

bool is_whole(const Corners& c, const Mesh& mesh, const SpacingField& spacing, std::size_t triangle) {
    const V3i& t = mesh.triangles[triangle];
    const double least = std::min(spacing.at_vertex(t.x), std::min(spacing.at_vertex(t.y), spacing.at_vertex(t.z)));
    return c.edge2[c.longest] <= (kLongestEdge * kLongestEdge) * (least * least);
}

V3d cross_of(const Corners& c) {
    return (c.position[1] - c.position[0]).cross(c.position[2] - c.position[0]);
}

V3d circle_center(const Corners& c) {
    const double a2 = c.edge2[1], b2 = c.edge2[2], c2 = c.edge2[0];  // opposite to corners 0, 1, 2
    const double longest2 = c.edge2[c.longest];
    if (2.0 * longest2 >= a2 + b2 + c2) return (c.position[c.longest] + c.position[(c.longest + 1) % 3]) * 0.5;
    const double wa = a2 * (b2 + c2 - a2), wb = b2 * (c2 + a2 - b2), wc = c2 * (a2 + b2 - c2);
    return (c.position[0] * wa + c.position[1] * wb + c.position[2] * wc) / (wa + wb + wc);
}

V3d unit_of(const V3d& v) {
    // Scale first, so that the square of a tiny vector does not vanish.
    const double largest = std::max(std::abs(v.x), std::max(std::abs(v.y), std::abs(v.z)));
    if (!(largest > 0.0)) return V3d(0.0);
    const V3d scaled = v / largest;
    return scaled / std::sqrt(scaled.dot(scaled));
}

// The plane of a triangle, with its first axis along the longest edge.
struct Plane {
    V3d origin, axes[2];  // in the tile's unit, from the tile's origin
    V3f normal;
    std::int32_t triangle;
    double unit;
    double origin_spacing, spacing_slope[2];

    // The patch around the place (u, v).
    Patch patch(const PlanePolygon& polygon, double u, double v) const {
        Patch p;
        const V3d exact = origin + axes[0] * u + axes[1] * v;
        p.center = to_stored(exact);
        p.axes[0] = V3f(axes[0]);
        p.axes[1] = V3f(axes[1]);
        p.normal = normal;
        // The centre as it is stored is the origin of the corners.
        const V3d rounding = V3d(p.center) - exact;
        u += rounding.dot(axes[0]);
        v += rounding.dot(axes[1]);
        p.center_spacing = static_cast<float>(origin_spacing + spacing_slope[0] * u + spacing_slope[1] * v);
        p.spacing_slope = V2f(spacing_slope[0], spacing_slope[1]);
        p.low = V2f(1e30f);
        p.high = V2f(-1e30f);
        p.least_spacing = 1e30f;
        p.largest_spacing = 0.0f;
        float radius2 = 0.0f;
        for (int i = 0; i < kMostCorners; ++i) {
            const PlanePlace& corner = polygon.vertices[std::min(i, polygon.count - 1)];
            p.x[i] = float(corner.u - u);
            p.y[i] = float(corner.v - v);
            p.spacing[i] = float(corner.spacing);
            p.low = V2f(std::min(p.low.x, p.x[i]), std::min(p.low.y, p.y[i]));
            p.high = V2f(std::max(p.high.x, p.x[i]), std::max(p.high.y, p.y[i]));
            p.least_spacing = std::min(p.least_spacing, p.spacing[i]);
            p.largest_spacing = std::max(p.largest_spacing, p.spacing[i]);
            radius2 = std::max(radius2, p.x[i] * p.x[i] + p.y[i] * p.y[i]);
        }
        p.radius = std::sqrt(radius2) * (1.0f + 1e-6f);
        p.count = polygon.count;
        p.triangle = triangle;
        double twice = 0.0;
        for (int i = 2; i < polygon.count; ++i) {
            const PlanePlace &a = polygon.vertices[0], &b = polygon.vertices[i - 1], &c = polygon.vertices[i];
            twice += (b.u - a.u) * (c.v - a.v) - (b.v - a.v) * (c.u - a.u);
        }
        p.area = 0.5 * std::abs(twice) * unit * unit;
        return p;
    }
};

struct Cutter {
    const Plane& plane;
    const TileFrame& frame;
    std::vector<Patch>& patches;

    void cut(const PlanePolygon& polygon) const {
        PlanePlace low = polygon.vertices[0], high = low;
        for (int i = 1; i < polygon.count; ++i) {
            const PlanePlace& p = polygon.vertices[i];
            low = {std::min(low.u, p.u), std::min(low.v, p.v), std::min(low.spacing, p.spacing)};
            high = {std::max(high.u, p.u), std::max(high.v, p.v), 0.0};
        }
        // Leave out what cannot reach into the tile.
        const double du = 0.5 * (high.u - low.u), dv = 0.5 * (high.v - low.v);
        const V3d middle = plane.origin + plane.axes[0] * (low.u + du) + plane.axes[1] * (low.v + dv);
        for (int axis = 0; axis < 3; ++axis) {
            const double reach =
                (std::abs(plane.axes[0][axis]) * du + std::abs(plane.axes[1][axis]) * dv) * 1.001 + 1e-3;
            if (middle[axis] + reach < 0.0 || middle[axis] - reach > frame.size()) return;
        }
        const double width = kPatchWidth * low.spacing, extent = 2.0 * std::max(du, dv);
        if (extent <= width) {
            double u = 0.0, v = 0.0;
            for (int i = 0; i < polygon.count; ++i) {
                u += polygon.vertices[i].u;
                v += polygon.vertices[i].v;
            }
            u /= polygon.count;
            v /= polygon.count;
            const V3d owner = (plane.origin + plane.axes[0] * u + plane.axes[1] * v) * frame.unit + frame.origin();
            if (frame.is_inside(owner)) patches.push_back(plane.patch(polygon, low.u + du, low.v + dv));
            return;
        }
        // In as many parts as are needed, half of them on either side.
        const double parts = std::ceil(extent / width), share = std::floor(0.5 * parts) / parts;
        PlanePolygon below = polygon, above = polygon;
        if (du >= dv) {
            const double at = low.u + extent * share;
            below.clip([&](const PlanePlace& p) { return p.u - at; }, mix);
            above.clip([&](const PlanePlace& p) { return at - p.u; }, mix);
        } else {
            const double at = low.v + extent * share;
            below.clip([&](const PlanePlace& p) { return p.v - at; }, mix);
            above.clip([&](const PlanePlace& p) { return at - p.v; }, mix);
        }
        if (below.count > 2) cut(below);
        if (above.count > 2) cut(above);
    }
};

}  // namespace

V3i TileFrame::tile_at(const V3d& world, const V3d& grid_origin, double width) {
    V3i tile;
    for (int axis = 0; axis < 3; ++axis) {
        tile[axis] = static_cast<int>(std::floor((world[axis] - grid_origin[axis]) / width));
    }
    return tile;
}

V3f to_stored(const V3d& place) {
    return V3f(place);
}

V3f unit_normal(const Mesh& mesh, std::size_t triangle) {
    return V3f(unit_of(triangle_cross(mesh, triangle)));
}

TriangleShape shape_of(const Mesh& mesh, const SpacingField& spacing, std::size_t triangle) {
    const Corners c = corners_of(mesh, triangle);
    return {cross_of(c) != V3d(0.0), is_whole(c, mesh, spacing, triangle), circle_center(c)};
}

void append_patches(const Mesh& mesh, const SpacingField& spacing, const TileFrame& frame, std::int32_t triangle,
                    std::vector<Patch>& patches) {
    const Corners c = corners_of(mesh, triangle);
    const V3d normal = unit_of(cross_of(c));
    const int a = c.longest, b = (a + 1) % 3;
    const V3d along = unit_of(c.position[b] - c.position[a]);
    Plane plane = {
        frame.to_local(c.position[a]), {along, normal.cross(along)}, V3f(normal), triangle, frame.unit, 0.0, {}};
    PlanePolygon polygon;
    for (int k = 0; k < 3; ++k) {
        const int corner = (a + k) % 3;
        const V3d from_first = (c.position[corner] - c.position[a]) / frame.unit;
        polygon.push({from_first.dot(plane.axes[0]), k < 2 ? 0.0 : from_first.dot(plane.axes[1]),
                      spacing.at_vertex(mesh.triangles[triangle][corner]) / frame.unit});
    }
    const PlanePlace* corner = polygon.vertices;
    plane.origin_spacing = corner[0].spacing;
    plane.spacing_slope[0] = (corner[1].spacing - corner[0].spacing) / corner[1].u;
    plane.spacing_slope[1] =
        (corner[2].spacing - corner[0].spacing - plane.spacing_slope[0] * corner[2].u) / corner[2].v;
    if (is_whole(c, mesh, spacing, triangle)) {
        const V3d center = (circle_center(c) - c.position[a]) / frame.unit;
        patches.push_back(plane.patch(polygon, center.dot(plane.axes[0]), center.dot(plane.axes[1])));
    } else {
        Cutter{plane, frame, patches}.cut(polygon);
    }
}

}  // namespace frazil
