#include "frazil/translucency/profile.h"

#include <algorithm>
#include <array>
#include <utility>

#include "frazil/base/error.h"

namespace frazil {
namespace {

constexpr std::array<std::pair<ProfileKind, const char*>, 5> kNames = {
    {{ProfileKind::dipole, "dipole"},
     {ProfileKind::better_dipole, "better_dipole"},
     {ProfileKind::normalized_diffusion, "normalized_diffusion"},
     {ProfileKind::photon_beam, "photon_beam"},
     {ProfileKind::multiple_scattering, "multiple_scattering"}}};

template <class Value>
Rgb per_channel(const Value& value) {
    return {static_cast<float>(value(0)), static_cast<float>(value(1)), static_cast<float>(value(2))};
}

}  // namespace

ProfileKind profile_named(const std::string& name, const std::string& path) {
    for (const auto& [kind, known] : kNames) {
        if (name == known) return kind;
    }
    throw ValueError(str(path, ": profile must be dipole, better_dipole, normalized_diffusion, photon_beam or ",
                         "multiple_scattering, got '", name, "'."));
}

std::string name_of(ProfileKind kind) {
    for (const auto& [known, name] : kNames) {
        if (kind == known) return name;
    }
    return "";
}

Profile make_profile(ProfileKind kind, const Medium& medium, double single) {
    switch (kind) {
        case ProfileKind::dipole:
            return Dipole(medium);
        case ProfileKind::better_dipole:
            return BetterDipole(medium);
        case ProfileKind::normalized_diffusion:
            return NormalizedDiffusion(medium);
        case ProfileKind::photon_beam:
            return PhotonBeamDiffusion(medium);
        case ProfileKind::multiple_scattering:
            break;
    }
    return MultipleScattering(medium, single);
}

bool lacks_single_scattering(ProfileKind kind) {
    return kind == ProfileKind::photon_beam || kind == ProfileKind::multiple_scattering;
}

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

double bend_length(const Profile& profile, int channel) {
    return std::visit([&](const auto& p) { return p.bend_length(channel); }, profile);
}

double mean_free_path(const Profile& profile, int channel) {
    const Medium& m = medium(profile);
    return 1.0 / (double(m.sigma_s_prime[channel]) + m.sigma_a[channel]);
}

double shortest_mean_free_path(const Profile& profile) {
    return std::min({mean_free_path(profile, 0), mean_free_path(profile, 1), mean_free_path(profile, 2)});
}

}  // namespace frazil
