// How the core refuses bad input: it throws one of these two, with a message of the form
// "<object path>: <field> must be <rule>, got <value>. <remedy>". It never prints, exits or asserts on a user's data.
// Python sees ValueError as ValueError and FileError as OSError.
// Not: internal invariants, which are asserts in debug builds.
#pragma once

#include <sstream>
#include <stdexcept>
#include <string>

namespace frazil {

struct ValueError : std::invalid_argument {
    using std::invalid_argument::invalid_argument;
};

struct FileError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

// The stop that a caller asked for (Ctrl-C): no result, nothing written.
struct Cancelled : std::runtime_error {
    Cancelled() : std::runtime_error("cancelled") {}
};

// Join values into one message: str("spacing must be > 0, got ", s).
template <class... Parts>
std::string str(const Parts&... parts) {
    std::ostringstream stream;
    (stream << ... << parts);
    return stream.str();
}

}  // namespace frazil
