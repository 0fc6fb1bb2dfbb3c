// From the text of a light path expression to a tree of symbols and operators.
// Model: the grammar of Open Shading Language; see lpe.h.
// Valid: every error is a ValueError with the number of the character that is wrong, from 1.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace frazil {

// A set of labels: all of them, or those listed, or all but those listed.
struct LpeLabels {
    bool is_negated = true;
    std::vector<std::string> names;

    bool has(std::string_view label) const;
    bool operator==(const LpeLabels&) const = default;
};

// One symbol: which events it matches. `types` and `scatterings` are letters, where negated those that it does not match.
struct LpeSymbol {
    bool types_negated = true, scatterings_negated = true;
    std::string types, scatterings;
    LpeLabels first, second;

    // `event_types` may be several letters for an event that is several things at once; `scattering` 0 where it has none.
    bool matches(std::string_view event_types, char scattering, std::string_view label1, std::string_view label2) const;
    bool operator==(const LpeSymbol&) const = default;
};

struct LpeNode {
    enum class Kind { symbol, sequence, choice, repeat } kind = Kind::sequence;
    LpeSymbol symbol;
    std::vector<LpeNode> children;
    int least = 1, most = 1;  // of a repeat; most -1 = any number
};

LpeNode parse_lpe(const std::string& name, const std::string& expression);

}  // namespace frazil
