// Light path expressions: which paths a layer keeps, in the grammar of Open Shading Language.
// Model: a path is a word of events from the camera to the light; the expression is a regular language over them, turned
//   into a deterministic automaton, whose states a path carries along. An event is <type scattering 'label' 'label'>:
//   types C camera, R reflect, T transmit, V volume, L light, B background, O emitting object; scattering D diffuse, G
//   glossy, S singular, s straight; labels of R, T, V, O: lobe, object path; of L, B: light group, light path.
//   In words: . | * + ? {n} {n,m} ( ) [ ] [^ ]; outside <> a letter stands for its type or scattering.
// Valid: up to 64 different symbols in an expression; a dome is L and B at once.
// Not: what happened inside ice before light came to its surface: translucency is one event <TD>, then the light.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace frazil {

// What may happen to a path in Frazil.
enum class LpeKind { camera, diffuse, glossy, refraction, inner_reflection, translucency, volume, emission };
inline constexpr std::size_t kLpeKindCount = 8;

// What labels can name in a scene.
struct LpeAlphabet {
    struct Light {
        std::string group, path;
        bool is_dome = false;
    };
    std::vector<std::string> objects;
    std::vector<Light> lights;
    std::vector<std::string> groups;  // lights that are known by their group alone: those that were baked
};

class LpeAutomaton {
  public:
    using State = std::uint32_t;
    static constexpr State kDead = 0;  // from which no word is kept

    // ValueError that begins with `name` and tells the place of what is wrong.
    LpeAutomaton(const std::string& name, const std::string& expression, const LpeAlphabet& alphabet);

    State start() const { return start_; }
    State next(State state, LpeKind kind, std::size_t object) const {
        return step(state, class_of_object_[object * kLpeKindCount + static_cast<std::size_t>(kind)]);
    }
    State camera(State state) const { return step(state, camera_class_); }
    // Does the word that ends with this light belong to the language?
    bool ends_in_light(State state, std::size_t light) const { return accepts_[step(state, class_of_light_[light])]; }
    bool ends_in_group(State state, std::size_t group) const { return accepts_[step(state, class_of_group_[group])]; }
    bool ends_in_emission(State state, std::size_t object) const {
        return accepts_[next(state, LpeKind::emission, object)];
    }

  private:
    State step(State state, std::uint32_t event_class) const {
        return transitions_[state * class_count_ + event_class];
    }

    State start_ = 0;
    std::size_t class_count_ = 0;
    std::vector<State> transitions_;  // (states, classes)
    std::vector<char> accepts_;
    std::uint32_t camera_class_ = 0;
    std::vector<std::uint32_t> class_of_object_, class_of_light_, class_of_group_;
};

}  // namespace frazil
