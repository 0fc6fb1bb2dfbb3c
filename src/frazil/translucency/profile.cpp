#include "frazil/translucency/profile.h"

namespace frazil {
namespace {

template <class Value>
Rgb per_channel(const Value& value) {
    return {static_cast<float>(value(0)), static_cast<float>(value(1)), static_cast<float>(value(2))};
}

}  // namespace

double reflectance(const Profile& profile, int channel, double r) {
    return std::visit([&](const auto& p) { return p.reflectance(channel, r); }, profile);
}

double within(const Profile& profile, int channel, double radius) {
    return std::visit([&](const auto& p) { return p.within(channel, radius); }, profile);
}

double albedo(const Profile& profile, int channel) {
    return std::visit([&](const auto& p) { return p.albedo(channel); }, profile);
}

Rgb reflectance(const Profile& profile, float r) {
    return per_channel([&](int c) { return reflectance(profile, c, r); });
}

Rgb within(const Profile& profile, float radius) {
    return per_channel([&](int c) { return within(profile, c, radius); });
}

Rgb albedo(const Profile& profile) {
    return per_channel([&](int c) { return albedo(profile, c); });
}

const Medium& medium(const Profile& profile) {
    return std::visit([](const auto& p) -> const Medium& { return p.medium; }, profile);
}

double mean_free_path(const Profile& profile, int channel) {
    const Medium& m = medium(profile);
    return 1.0 / (double(m.sigma_s_prime[channel]) + m.sigma_a[channel]);
}

}  // namespace frazil
