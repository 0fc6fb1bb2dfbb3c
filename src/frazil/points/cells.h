// The surface that each point stands for, its cell: by its moments, and by places spread over it.
// Model: the mesh is cut into pieces smaller than a cell, each of which belongs to the nearest point on its side; moments
//   are the exact sums over these pieces. So cells need not be the nearest surface to the last piece: whatever they are,
//   together they are the mesh, and nothing is lost or counted twice.
// Units: metres, m².
// Valid: points that cover the mesh within their spacing, as poisson_points makes them; the same bits for any number of
//   threads.
// Not: kept with the points: cells belong to one pose of the mesh, and are made anew in about the time of a few rays each.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/geometry/mesh.h"
#include "frazil/points/point_set.h"

namespace frazil {

// Second central moments: xx, yy, zz, xy, xz, yz.
using Covariance = std::array<float, 6>;

// The covariance of a flat disc of that area, as seen from its rim's plane: what a point stands for where cells are unknown.
Covariance disc_covariance(float area, const V3f& normal);

// A place on the mesh, and the area of its cell that it stands for.
struct CellPlace {
    std::uint32_t triangle = 0;
    V2f barycentrics = V2f(0.0f);  // of the triangle's second and third corner
    float area = 0.0f;
};

// How the normals of a cell vary over it: their mean, their covariance with the place, made symmetric, and their own.
struct CellNormals {
    V3f mean{0.0f};
    Covariance with_place{}, own{};
};

struct Cells {
    std::vector<float> areas;
    std::vector<V3f> centroids;
    std::vector<Covariance> covariances;
    std::vector<CellNormals> normals;
    // Places of point k are places[first[k]] to places[first[k + 1]]; none where no surface is nearest to it.
    std::vector<std::uint32_t> first;
    std::vector<CellPlace> places;

    std::size_t size() const { return areas.size(); }
};

// `most_places` of each cell are kept, at most; more numerous pieces are sampled without bias [Duffield2007].
// ValueError where points and mesh do not belong together.
Cells cells_of(const PointSet& points, const Mesh& mesh, int most_places = 64, std::uint32_t seed = 0);

// The half axes of an ellipse in a plane that has, evenly filled, a cell's covariance there.
std::array<V3f, 2> ellipse_of(const Covariance& covariance, const V3f& normal);

// How vectors along a cell change where all of it moves by `distance` along its normals: a linear map of its plane, by the
// regression of normals on places.
class CellBend {
  public:
    CellBend(const CellNormals& normals, const Covariance& covariance, float distance);
    V3f moved(const V3f& v) const;

  private:
    V3f axes_[2] = {V3f(0.0f), V3f(0.0f)};
    float change_[2][2] = {};
};

// Move all of a cell by this along its normals: a bent cell shrinks or grows, areas stay.
void move_along_normals(float distance, const CellNormals& normals, V3f& centroid, Covariance& covariance);

// A place's position and geometric normal.
V3f position_of(const CellPlace& place, const Mesh& mesh);
V3f normal_of(const CellPlace& place, const Mesh& mesh);

// Values at places, (places, groups) row by row, as a mean over each cell and, summed over channels, its covariance with the
// place. ValueError where there are not as many rows as places.
struct CellMeans {
    std::vector<Rgb> means;    // (N, groups)
    std::vector<V3f> moments;  // (N, groups), in metres times the values' unit
};
CellMeans cell_means(const Cells& cells, const Mesh& mesh, const std::vector<Rgb>& values, std::size_t groups);

}  // namespace frazil
