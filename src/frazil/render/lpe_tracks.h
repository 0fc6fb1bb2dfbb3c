// How far a path has come in each light path expression, and what it is worth there.
// Model: a path is scattered by several lobes at once, each with its weight, so it is in several states of an automaton at
//   once; a track keeps the weight of one state, apart by the last vertex's lobe, since lights weigh lobes apart.
// Valid: exact: layers of expressions that share out all paths between them sum to the beauty.
#pragma once

#include <array>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/render/lpe.h"

namespace frazil {

struct LpeTracks {
    // Lobes in the order diffuse, specular, refraction.
    struct Track {
        std::uint32_t lpe = 0;
        LpeAutomaton::State state = 0, previous = 0;  // previous: before the last vertex
        std::array<Rgb, 3> lobes;

        Rgb sum() const { return lobes[0] + lobes[1] + lobes[2]; }
    };

    const std::vector<LpeAutomaton>* automata = nullptr;
    std::vector<Track> tracks;

    // At the camera.
    void begin(const std::vector<LpeAutomaton>& wanted) {
        automata = &wanted;
        for (std::uint32_t i = 0; i < wanted.size(); ++i) {
            const auto state = wanted[i].camera(wanted[i].start());
            if (state != LpeAutomaton::kDead) tracks.push_back({i, state, state, {Rgb(0.0f), Rgb(0.0f), Rgb(1.0f)}});
        }
    }

    void scatter(const std::array<Rgb, 3>& values, LpeKind refracted, std::size_t object) {
        if (tracks.empty()) return;
        const std::array kinds = {LpeKind::diffuse, LpeKind::glossy, refracted};
        std::vector<Track> before;
        before.swap(tracks);
        for (const Track& track : before) {
            for (int lobe = 0; lobe < 3; ++lobe) {
                if (values[lobe] == Rgb(0.0f)) continue;
                const auto state = (*automata)[track.lpe].next(track.state, kinds[lobe], object);
                if (state != LpeAutomaton::kDead || track.state != LpeAutomaton::kDead)
                    at(track.lpe, state, track.state).lobes[lobe] += track.sum() * values[lobe];
            }
        }
    }

    void scale(const Rgb& factor) {
        for (Track& track : tracks) {
            for (Rgb& lobe : track.lobes) lobe *= factor;
        }
    }

  private:
    Track& at(std::uint32_t lpe, LpeAutomaton::State state, LpeAutomaton::State previous) {
        for (Track& track : tracks) {
            if (track.lpe == lpe && track.state == state && track.previous == previous) return track;
        }
        tracks.push_back({lpe, state, previous, {Rgb(0.0f), Rgb(0.0f), Rgb(0.0f)}});
        return tracks.back();
    }
};

}  // namespace frazil
