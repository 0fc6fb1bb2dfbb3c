#include "frazil/render/lpe.h"

#include <algorithm>
#include <array>
#include <map>
#include <set>

#include "frazil/base/error.h"
#include "frazil/render/lpe_parser.h"

namespace frazil {
namespace {

constexpr std::size_t kMostSymbols = 64, kMostStates = 4096;

// A nondeterministic automaton: every state has steps by symbol and steps for nothing.
struct Nfa {
    struct State {
        std::vector<std::pair<std::size_t, std::size_t>> by_symbol;  // symbol, target
        std::vector<std::size_t> by_nothing;
    };
    std::vector<State> states;
    std::vector<LpeSymbol> symbols;

    std::size_t add() {
        states.emplace_back();
        return states.size() - 1;
    }

    std::size_t symbol_index(const LpeSymbol& symbol) {
        const auto found = std::find(symbols.begin(), symbols.end(), symbol);
        if (found != symbols.end()) return static_cast<std::size_t>(found - symbols.begin());
        symbols.push_back(symbol);
        return symbols.size() - 1;
    }

    // Add what the node accepts after `from`; the state that is then reached [Thompson1968].
    std::size_t append(const LpeNode& node, std::size_t from) {
        std::size_t to = 0;
        switch (node.kind) {
            case LpeNode::Kind::symbol:
                to = add();
                states[from].by_symbol.emplace_back(symbol_index(node.symbol), to);
                return to;
            case LpeNode::Kind::sequence:
                for (const LpeNode& child : node.children) from = append(child, from);
                return from;
            case LpeNode::Kind::choice:
                to = add();
                for (const LpeNode& child : node.children) {
                    const std::size_t begin = add();
                    states[from].by_nothing.push_back(begin);
                    const std::size_t end = append(child, begin);
                    states[end].by_nothing.push_back(to);
                }
                return to;
            case LpeNode::Kind::repeat:
                for (int i = 0; i < node.least; ++i) from = append(node.children[0], from);
                if (node.most < 0) {
                    const std::size_t begin = add();
                    states[from].by_nothing.push_back(begin);
                    const std::size_t end = append(node.children[0], begin);
                    states[end].by_nothing.push_back(begin);
                    return begin;
                }
                to = add();
                for (int i = node.least; i < node.most; ++i) {
                    states[from].by_nothing.push_back(to);
                    from = append(node.children[0], from);
                }
                states[from].by_nothing.push_back(to);
                return to;
        }
        return from;
    }

    std::set<std::size_t> closed(std::set<std::size_t> subset) const {
        std::vector<std::size_t> open(subset.begin(), subset.end());
        while (!open.empty()) {
            const std::size_t state = open.back();
            open.pop_back();
            for (const std::size_t target : states[state].by_nothing) {
                if (subset.insert(target).second) open.push_back(target);
            }
        }
        return subset;
    }
};

struct Event {
    std::string_view types;
    char scattering;
    std::string_view lobe;
};
constexpr std::array<Event, kLpeKindCount> kEvents = {{{"C", 0, ""},
                                                       {"R", 'D', "diffuse"},
                                                       {"R", 'G', "specular"},
                                                       {"T", 'G', "refraction"},
                                                       {"R", 'G', "refraction"},
                                                       {"T", 'D', "translucency"},
                                                       {"V", 0, "volume"},
                                                       {"O", 0, "emission"}}};

}  // namespace

LpeAutomaton::LpeAutomaton(const std::string& name, const std::string& expression, const LpeAlphabet& alphabet) {
    Nfa nfa;
    const std::size_t begin = nfa.add();
    const std::size_t end = nfa.append(parse_lpe(name, expression), begin);
    if (nfa.symbols.size() > kMostSymbols) {
        throw ValueError(str(name, ": expression must have at most ", kMostSymbols, " different symbols, got ",
                             nfa.symbols.size(), "."));
    }

    // Events that match the same symbols are one class.
    std::map<std::uint64_t, std::uint32_t> classes;
    const auto class_of = [&](std::string_view types, char scattering, std::string_view label1,
                              std::string_view label2) {
        std::uint64_t mask = 0;
        for (std::size_t i = 0; i < nfa.symbols.size(); ++i) {
            if (nfa.symbols[i].matches(types, scattering, label1, label2)) mask |= std::uint64_t(1) << i;
        }
        return classes.emplace(mask, static_cast<std::uint32_t>(classes.size())).first->second;
    };
    camera_class_ = class_of("C", 0, "", "");
    for (const std::string& object : alphabet.objects) {
        for (const Event& event : kEvents) {
            class_of_object_.push_back(class_of(event.types, event.scattering, event.lobe, object));
        }
    }
    for (const LpeAlphabet::Light& light : alphabet.lights) {
        class_of_light_.push_back(class_of(light.is_dome ? "LB" : "L", 0, light.group, light.path));
    }
    for (const std::string& group : alphabet.groups) class_of_group_.push_back(class_of("L", 0, group, ""));
    class_count_ = classes.size();

    // Sets of states become states; the empty set is the dead one.
    std::map<std::set<std::size_t>, State> known{{{}, kDead}};
    std::vector<std::set<std::size_t>> subsets{{}};
    const auto state_of = [&](const std::set<std::size_t>& subset) {
        const auto [found, is_new] = known.emplace(subset, static_cast<State>(subsets.size()));
        if (is_new) subsets.push_back(subset);
        if (subsets.size() > kMostStates) {
            throw ValueError(str(name, ": expression must be simpler, it has more than ", kMostStates, " states."));
        }
        return found->second;
    };
    start_ = state_of(nfa.closed({begin}));
    for (std::size_t s = 0; s < subsets.size(); ++s) {
        transitions_.resize((s + 1) * class_count_, kDead);
        const std::set<std::size_t> subset = subsets[s];
        for (const auto& [mask, event_class] : classes) {
            std::set<std::size_t> reached;
            for (const std::size_t state : subset) {
                for (const auto& [symbol, target] : nfa.states[state].by_symbol) {
                    if (mask >> symbol & 1) reached.insert(target);
                }
            }
            transitions_[s * class_count_ + event_class] = state_of(nfa.closed(std::move(reached)));
        }
    }
    accepts_.resize(subsets.size(), 0);
    for (std::size_t s = 0; s < subsets.size(); ++s) accepts_[s] = subsets[s].count(end) > 0;
}

}  // namespace frazil
