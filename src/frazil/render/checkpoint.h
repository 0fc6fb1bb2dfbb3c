// A render that can be stopped and taken up again to the same bits.
// Model: the state is what the samples so far have summed up to, and which tiles of the running pass are done; every later
//   sample is a pure function of (seed, pixel, sample), so that nothing else is needed.
// Valid: for the same scene and options; whoever saves the state sees to that.
// Not: files; bakes, which are made anew or come from a cache.
#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>

namespace frazil {

// Everything that a render has so far, by name, as views of its memory.
using FilmState = std::map<std::string, std::span<float>>;

struct Checkpoints {
    // Called every `every_seconds` and when the render is stopped, while no thread writes to the state. Its errors stop
    // the render.
    std::function<void(const FilmState&)> save;
    double every_seconds = 600.0;
    const FilmState* resume_from = nullptr;  // of the same scene and options; ValueError where sizes differ
};

}  // namespace frazil
