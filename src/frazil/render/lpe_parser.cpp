#include "frazil/render/lpe_parser.h"

#include <algorithm>
#include <cctype>

#include "frazil/base/error.h"

namespace frazil {
namespace {

constexpr std::string_view kTypes = "CRTVLBO", kScatterings = "DGSs";
constexpr int kMostRepeats = 32;

class Parser {
  public:
    Parser(const std::string& name, const std::string& text) : name_(name), text_(text) {}

    LpeNode parse() {
        skip_spaces();
        if (is_at_end()) fail("an expression must not be empty");
        LpeNode node = choice();
        if (!is_at_end()) fail(peek() == ')' ? "')' has no '(' before it" : unexpected());
        return node;
    }

  private:
    LpeNode choice() {
        LpeNode node = sequence();
        if (peek() != '|') return node;
        LpeNode result{LpeNode::Kind::choice, {}, {std::move(node)}, 1, 1};
        while (take('|')) result.children.push_back(sequence());
        return result;
    }

    LpeNode sequence() {
        LpeNode result{LpeNode::Kind::sequence, {}, {}, 1, 1};
        while (!is_at_end() && peek() != '|' && peek() != ')') result.children.push_back(repeated());
        if (result.children.empty()) fail("an event is missing");
        return result;
    }

    LpeNode repeated() {
        LpeNode node = atom();
        while (true) {
            int least = 1, most = 1;
            if (take('*')) {
                least = 0, most = -1;
            } else if (take('+')) {
                least = 1, most = -1;
            } else if (take('?')) {
                least = 0, most = 1;
            } else if (take('{')) {
                least = most = number();
                if (take(',')) most = peek() == '}' ? -1 : number();
                if (!take('}')) fail("'}' is missing");
                if (most >= 0 && most < least)
                    fail(str("the most must not be less than the least, got {", least, ",", most, "}"));
            } else {
                return node;
            }
            LpeNode outer{LpeNode::Kind::repeat, {}, {std::move(node)}, least, most};
            node = std::move(outer);
        }
    }

    LpeNode atom() {
        if (take('(')) {
            LpeNode node = choice();
            if (!take(')')) fail("')' is missing");
            return node;
        }
        LpeNode node;
        node.kind = LpeNode::Kind::symbol;
        if (take('<')) {
            node.symbol = event();
        } else if (take('[')) {
            return set();
        } else {
            node.symbol = letter();
        }
        return node;
    }

    // One letter outside <>: a type, a scattering, '.', or a label.
    LpeSymbol letter() {
        LpeSymbol symbol;
        const char c = peek();
        if (c == '.') {
            take(c);
        } else if (c == '\'') {
            symbol.first = {false, {label()}};
        } else if (kTypes.find(c) != kTypes.npos && c != 0) {
            symbol.types_negated = false;
            symbol.types = c;
            take(c);
        } else if (kScatterings.find(c) != kScatterings.npos && c != 0) {
            symbol.scatterings_negated = false;
            symbol.scatterings = c;
            take(c);
        } else {
            fail(unexpected());
        }
        return symbol;
    }

    // [..] of whole events: a choice, or where negated, of letters of one kind, what is none of them.
    LpeNode set() {
        const bool is_negated = take('^');
        if (!is_negated) {
            LpeNode node{LpeNode::Kind::choice, {}, {}, 1, 1};
            while (!is_at_end() && peek() != ']') node.children.push_back(atom());
            if (!take(']')) fail("']' is missing");
            if (node.children.empty()) fail("a set must not be empty");
            return node;
        }
        LpeNode node;
        node.kind = LpeNode::Kind::symbol;
        while (!is_at_end() && peek() != ']') {
            const char c = peek();
            if (kTypes.find(c) != kTypes.npos) {
                node.symbol.types += c;
            } else if (kScatterings.find(c) != kScatterings.npos) {
                node.symbol.scatterings += c;
            } else if (c == '\'') {
                node.symbol.first.names.push_back(label());
                continue;
            } else {
                fail(unexpected());
            }
            take(c);
        }
        if (!take(']')) fail("']' is missing");
        return node;
    }

    LpeSymbol event() {
        LpeSymbol symbol;
        letters(kTypes, "type", symbol.types_negated, symbol.types);
        if (peek() != '>' && !is_at_end())
            letters(kScatterings, "scattering", symbol.scatterings_negated, symbol.scatterings);
        if (peek() != '>' && !is_at_end()) symbol.first = labels();
        if (peek() != '>' && !is_at_end()) symbol.second = labels();
        if (!take('>'))
            fail(is_at_end() ? "'>' is missing"
                             : "an event has a type, a scattering and two labels at most; '>' is missing");
        return symbol;
    }

    // A slot of an event: one letter, '.', [letters] or [^letters].
    void letters(std::string_view known, const char* what, bool& is_negated, std::string& chosen) {
        if (take('.')) return;
        const bool is_set = take('[');
        is_negated = is_set && take('^');
        do {
            const char c = peek();
            if (c == 0 || known.find(c) == known.npos) {
                fail(str("a ", what, " must be one of ", known, ", got ",
                         is_at_end() ? std::string("the end") : str("'", c, "'")));
            }
            chosen += c;
            take(c);
        } while (is_set && peek() != ']');
        if (is_set) take(']');
    }

    LpeLabels labels() {
        if (take('.')) return {};
        LpeLabels result{false, {}};
        const bool is_set = take('[');
        result.is_negated = is_set && take('^');
        do {
            if (peek() != '\'') fail("a label must be in quotes, as in 'key', or be '.'");
            result.names.push_back(label());
        } while (is_set && peek() != ']' && !is_at_end());
        if (is_set && !take(']')) fail("']' is missing");
        return result;
    }

    std::string label() {
        const std::size_t begin = ++place_;
        const std::size_t end = text_.find('\'', begin);
        if (end == text_.npos) {
            place_ = begin - 1;
            fail("the quote that closes the label is missing");
        }
        place_ = end + 1;
        skip_spaces();
        return text_.substr(begin, end - begin);
    }

    int number() {
        int value = 0;
        if (!std::isdigit(static_cast<unsigned char>(peek()))) fail("a number is missing");
        while (std::isdigit(static_cast<unsigned char>(peek()))) {
            value = 10 * value + (peek() - '0');
            if (value > kMostRepeats) fail(str("a number of repeats must be at most ", kMostRepeats));
            take(peek());
        }
        return value;
    }

    bool is_at_end() const { return place_ >= text_.size(); }
    char peek() const { return is_at_end() ? '\0' : text_[place_]; }
    bool take(char c) {
        if (is_at_end() || text_[place_] != c) return false;
        ++place_;
        skip_spaces();
        return true;
    }
    void skip_spaces() {
        while (!is_at_end() && std::isspace(static_cast<unsigned char>(text_[place_]))) ++place_;
    }
    std::string unexpected() const {
        if (is_at_end()) return "an event is missing";
        return str("'", peek(), "' is no event: there are ", kTypes, " and ", kScatterings);
    }
    [[noreturn]] void fail(const std::string& what) const {
        throw ValueError(str(name_, ": ", what, ", at character ", place_ + 1, " of '", text_, "'."));
    }

    const std::string &name_, &text_;
    std::size_t place_ = 0;
};

bool contains(bool is_negated, std::string_view letters, std::string_view any_of) {
    return (letters.find_first_of(any_of) != letters.npos) != is_negated;
}

}  // namespace

bool LpeLabels::has(std::string_view label) const {
    return (std::find(names.begin(), names.end(), label) != names.end()) != is_negated;
}

bool LpeSymbol::matches(std::string_view event_types, char scattering, std::string_view label1,
                        std::string_view label2) const {
    const bool scatters_so =
        scattering == 0 ? scatterings_negated : contains(scatterings_negated, scatterings, {&scattering, 1});
    return contains(types_negated, types, event_types) && scatters_so && first.has(label1) && second.has(label2);
}

LpeNode parse_lpe(const std::string& name, const std::string& expression) {
    return Parser(name, expression).parse();
}

}  // namespace frazil
