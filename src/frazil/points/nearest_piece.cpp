#include "frazil/points/nearest_piece.h"

#include <cstring>

namespace frazil {
namespace {

constexpr int kMostCorners = 16;

}  // namespace

float share_of(const CornerDistances* candidates, const std::vector<int>& kept, int self) {
    alignas(32) float u[kMostCorners] = {0.0f, 1.0f, 0.0f}, v[kMostCorners] = {0.0f, 0.0f, 1.0f};
    alignas(32) float heights[kMostCorners];
    alignas(32) float next_u[kMostCorners + 1], next_v[kMostCorners + 1];
    int count = 3;
    const double* p = candidates[self].d;
    for (const int other : kept) {
        if (other == self) continue;
        const double* q = candidates[other].d;
        const float f0 = float(p[0] - q[0]), fu = float((p[1] - q[1]) - (p[0] - q[0])),
                    fv = float((p[2] - q[2]) - (p[0] - q[0]));
        // Lanes past the last corner hold copies of old ones or the origin; they are not looked at.
        bool any_out = false, any_in = false;
        for (int i = 0; i < 8; ++i) heights[i] = f0 + fu * u[i] + fv * v[i];
        for (int i = 8; i < count; ++i) heights[i] = f0 + fu * u[i] + fv * v[i];
        for (int i = 0; i < count; ++i) {
            any_out |= heights[i] > 0.0f;
            any_in |= heights[i] < 0.0f;
        }
        if (!any_out) continue;
        if (!any_in) return 0.0f;
        int kept_corners = 0;
        for (int i = 0; i < count; ++i) {
            const int j = i + 1 == count ? 0 : i + 1;
            const bool is_in = heights[i] <= 0.0f;
            if (is_in) {
                next_u[kept_corners] = u[i];
                next_v[kept_corners++] = v[i];
            }
            if (is_in != (heights[j] <= 0.0f)) {
                const float t = heights[i] / (heights[i] - heights[j]);
                next_u[kept_corners] = u[i] + (u[j] - u[i]) * t;
                next_v[kept_corners++] = v[i] + (v[j] - v[i]) * t;
            }
            if (kept_corners >= kMostCorners) {
                // More corners than we keep here: the general clip does it.
                Piece piece;
                clip_piece(candidates, kept, self, piece);
                return static_cast<float>(piece_share(piece));
            }
        }
        count = kept_corners;
        std::memcpy(u, next_u, sizeof(float) * count);
        std::memcpy(v, next_v, sizeof(float) * count);
        if (count < 3) return 0.0f;
    }
    float twice = 0.0f;
    for (int i = 2; i < count; ++i) {
        twice += (u[i - 1] - u[0]) * (v[i] - v[0]) - (v[i - 1] - v[0]) * (u[i] - u[0]);
    }
    return std::abs(twice);
}

}  // namespace frazil
