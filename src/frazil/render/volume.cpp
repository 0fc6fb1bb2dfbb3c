#include "frazil/render/volume.h"

namespace frazil {
namespace {

constexpr float kFarAway = 1e18f;  // metres; finite, so that 0 times it is 0

// A way through a body in metres, and in metres of its medium.
class Way {
  public:
    // As far as `deepest` metres of the medium.
    Way(const Segment& segment, const DensityField* density, float deepest)
        : segment_(segment), density_(density), length_(std::min(segment.length, deepest)), depth_(length_) {
        if (!density_) return;
        length_ = density_->place(segment.origin, segment.direction, deepest, std::min(segment.length, kFarAway));
        depth_ = depth(length_);
    }
    float length() const { return length_; }
    float depth() const { return depth_; }
    float depth(float t) const { return density_ ? density_->depth(segment_.origin, segment_.direction, t) : t; }
    float place(float depth) const {
        return density_ ? density_->place(segment_.origin, segment_.direction, depth, length_) : depth;
    }
    float density(float t) const { return density_ ? density_->at(segment_.origin + segment_.direction * t) : 1.0f; }

  private:
    const Segment& segment_;
    const DensityField* density_;
    float length_, depth_;
};

// Drawing a depth on [0, depth] by free path, one channel in three, cut off at the end; the pdf is per metre of the medium.
class FreePath {
  public:
    FreePath(const Rgb& sigma_t, float depth) : sigma_t_(sigma_t), depth_(depth) {
        for (int c = 0; c < 3; ++c) scattered_[c] = -std::expm1(-sigma_t[c] * depth);
    }
    float sample(float u) const {
        const int channel = std::min(int(3.0f * u), 2);
        const float v = 3.0f * u - float(channel);
        const float depth = -std::log1p(-v * scattered_[channel]) / sigma_t_[channel];
        return std::clamp(depth, 0.0f, depth_);
    }
    float pdf(float depth) const {
        float sum = 0.0f;
        for (int c = 0; c < 3; ++c) {
            if (scattered_[c] > 0.0f) sum += sigma_t_[c] * std::exp(-sigma_t_[c] * depth) / scattered_[c];
        }
        return sum / 3.0f;
    }

  private:
    Rgb sigma_t_, scattered_ = Rgb(0.0f);
    float depth_;
};

// Drawing a place on [0, length] in equal angles about a centre [KullaFajardo2012].
class EquiAngular {
  public:
    EquiAngular(const V3f& origin, const V3f& direction, float length, const V3f& center) {
        along_ = (center - origin).dot(direction);
        height_ = std::max((center - origin - direction * along_).length(), 1e-6f);
        begin_ = std::atan2(-along_, height_);
        end_ = std::atan2(length - along_, height_);
        length_ = length;
    }
    float sample(float u) const {
        const float t = along_ + height_ * std::tan(begin_ + (end_ - begin_) * u);
        return std::clamp(t, 0.0f, length_);
    }
    float pdf(float t) const {
        const float d = t - along_;
        return end_ > begin_ ? height_ / ((end_ - begin_) * (height_ * height_ + d * d)) : 0.0f;
    }

  private:
    float along_, height_, begin_, end_, length_;
};

bool has_place(const Light& light) {
    return !std::holds_alternative<DomeLight>(light.shape) && !std::holds_alternative<DistantLight>(light.shape);
}

float volume_multiplier(const Light& light) {
    return light.multipliers[static_cast<int>(LightComponent::volume)];
}

// Optical depth beyond which nothing is looked for.
constexpr float kDeepest = 20.0f;

}  // namespace

float henyey_greenstein(float cosine, float g) {
    const float denominator = std::max(1.0f + g * g - 2.0f * g * cosine, 1e-9f);
    return 0.25f * kInvPi * (1.0f - g * g) / (denominator * std::sqrt(denominator));
}

V3f sample_henyey_greenstein(const V3f& direction, float g, const V2f& u) {
    float cosine = 1.0f - 2.0f * u.x;
    if (std::abs(g) > 1e-3f) {
        const float s = (1.0f - g * g) / (1.0f + g - 2.0f * g * u.x);
        cosine = std::clamp((1.0f + g * g - s * s) / (2.0f * g), -1.0f, 1.0f);
    }
    const float sine = std::sqrt(std::max(0.0f, 1.0f - cosine * cosine)), phi = 2.0f * kPi * u.y;
    const auto [x, y] = tangent_frame(direction);
    return (x * (sine * std::cos(phi)) + y * (sine * std::sin(phi)) + direction * cosine).normalized();
}

OnceScattered SingleScattering::sample(const Segment& segment, Sampler& sampler, std::uint64_t& rays) const {
    OnceScattered result;
    const float u_light = sampler.next_1d();
    const V2f u_place = sampler.next_2d(), u_direction = sampler.next_2d(), u_share = sampler.next_2d(),
              u_phase = sampler.next_2d();
    const IceMaterial& ice = *bodies_[std::size_t(interiors_.filling(segment.inside))]->material;
    const Rgb sigma_s = ice.medium.sigma_s_prime, sigma_t = sigma_s + ice.medium.sigma_a;
    if (!(max_component(sigma_s) > 0.0f)) return result;
    const auto body = static_cast<std::uint32_t>(interiors_.filling(segment.inside));
    const auto way_of = [&](const Rgb& sigma) {
        return Way(segment, interiors_.density(int(body)), kDeepest / std::min(sigma.x, std::min(sigma.y, sigma.z)));
    };

    // The light that is scattered once, from one light.
    const LightPick pick = lights_.pick({segment.origin, V3f(0.0f), body}, u_light, LightUse::volume);
    result.light = pick.light;
    if (result.light >= 0) {
        const Light& light = lights_.lights()[std::size_t(result.light)];
        const Way way = way_of(sigma_t);
        const FreePath free_path(sigma_t, way.depth());
        // What of the medium light crosses from there; the density of such places, per metre.
        float t = 0.0f, depth = 0.0f, pdf = 0.0f;
        const auto draw_depth = [&] {
            depth = free_path.sample(u_place.y);
            t = way.place(depth);
        };
        if (has_place(light)) {
            const M44f& m = light.light_to_world;
            const EquiAngular equi(segment.origin, segment.direction, way.length(), V3f(m[3][0], m[3][1], m[3][2]));
            if (u_place.x < 0.5f) {
                draw_depth();
            } else {
                t = equi.sample(u_place.y);
                depth = way.depth(t);
            }
            pdf = 0.5f * (free_path.pdf(depth) * way.density(t) + equi.pdf(t));
        } else {
            draw_depth();
            pdf = free_path.pdf(depth) * way.density(t);
        }
        const V3f place = segment.origin + segment.direction * t;
        const LightSample towards = lights_.sample_one(result.light, place, u_direction);
        if (towards.pdf > 0.0f && pdf > 0.0f) {
            const Rgb reaches =
                interiors_.visibility({place, towards.direction, 0.0f, towards.distance * (1.0f - 1e-4f)},
                                      segment.inside, rays, true, nullptr, segment.footprint);
            // Light travels along -towards.direction before and -segment.direction after.
            const float phase = henyey_greenstein(towards.direction.dot(segment.direction), ice.anisotropy);
            const float part = ice.density.absorption;
            const Rgb crosses = exp(-(sigma_s * depth + ice.medium.sigma_a * ((1.0f - part) * t + part * depth)));
            result.radiance =
                sigma_s * crosses * reaches * towards.radiance *
                (way.density(t) * phase * volume_multiplier(light) / (pdf * towards.pdf * pick.probability));
        }
    }

    // The share of all that is scattered which is scattered once and then leaves, absorption left out.
    const Way way = way_of(sigma_s);
    const FreePath free_path(sigma_s, way.depth());
    const float depth = free_path.sample(u_share.x), pdf = free_path.pdf(depth);
    if (pdf > 0.0f) {
        const V3f place = segment.origin + segment.direction * way.place(depth);
        const V3f away = -sample_henyey_greenstein(-segment.direction, ice.anisotropy, u_phase);
        const Rgb leaves =
            interiors_.visibility({place, away}, segment.inside, rays, false, nullptr, segment.footprint);
        result.share = sigma_s * exp(sigma_s * -depth) * leaves / pdf;
    }
    return result;
}

}  // namespace frazil
