// Seconds of a stage, added to a total when the stage ends.
// Units: seconds of wall time.
#pragma once

#include <chrono>

namespace frazil {

class Stopwatch {
  public:
    explicit Stopwatch(double& total) : total_(&total) {}
    Stopwatch(const Stopwatch&) = delete;
    Stopwatch& operator=(const Stopwatch&) = delete;
    ~Stopwatch() { stop(); }

    void stop() {
        if (!total_) return;
        *total_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
        total_ = nullptr;
    }

  private:
    double* total_;
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace frazil
