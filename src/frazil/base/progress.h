// How a long job tells how far it is and asks whether to go on. Plain callables, so that the core needs no terminal.
// Model: report(stage, fraction in [0,1]) may be called from any thread, one call at a time; is_cancelled likewise.
// Not: time left and drawing, which belong to the command line.
#pragma once

#include <functional>
#include <mutex>

#include "frazil/base/error.h"

namespace frazil {

class Progress {
  public:
    using Report = std::function<void(const char* stage, double fraction)>;
    using IsCancelled = std::function<bool()>;

    Progress() = default;
    Progress(Report report, IsCancelled is_cancelled)
        : report_(std::move(report)), is_cancelled_(std::move(is_cancelled)) {}

    // Tell the fraction of the stage that is done; throws Cancelled where the caller asked to stop.
    void update(const char* stage, double fraction) {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (report_) report_(stage, fraction);
        if (is_cancelled_ && is_cancelled_()) throw Cancelled();
    }

  private:
    Report report_;
    IsCancelled is_cancelled_;
    std::mutex mutex_;
};

}  // namespace frazil
