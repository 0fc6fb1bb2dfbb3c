#include "frazil/points/point_budget.h"

#include <unistd.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <string>

#include "frazil/base/error.h"

namespace frazil {
namespace {

// The number in a one-line file; without end where there is none ("max" included).
double read_number(const char* path) {
    std::ifstream file(path);
    double number = 0.0;
    return file >> number ? number : std::numeric_limits<double>::infinity();
}

}  // namespace

double available_memory() {
    double available = double(sysconf(_SC_PHYS_PAGES)) * double(sysconf(_SC_PAGE_SIZE));
    std::ifstream info("/proc/meminfo");
    for (std::string line; std::getline(info, line);) {
        if (line.rfind("MemAvailable:", 0) == 0) available = std::stod(line.substr(13)) * 1024.0;
    }
    const double limit = read_number("/sys/fs/cgroup/memory.max");
    if (std::isfinite(limit)) available = std::min(available, limit - read_number("/sys/fs/cgroup/memory.current"));
    return std::max(0.0, available);
}

double point_limit(std::uint64_t max_points) {
    if (max_points > 0) return std::min(double(max_points), kMostPoints);
    return std::min(available_memory() / kBytesPerPoint, kMostPoints);
}

void check_budget(double points, int dimension, std::uint64_t max_points, const char* name, double value) {
    const double limit = point_limit(max_points);
    if (points <= limit) return;
    // Rounded up, so that the remedy as printed is enough.
    throw ValueError(str("Mesh: ", name, " must be >= ", value * std::pow(points / limit, 1.0 / dimension) * 1.01,
                         ", got ", value, ". It would take about ", points, " points and ",
                         points * kBytesPerPoint / 1e9, " GB, and ", limit, " points are allowed",
                         max_points > 0 ? " by max_points." : " by the memory that is free."));
}

}  // namespace frazil
