#pragma once
#include <cstdlib>
namespace frazil { inline float knob(const char* n, float d) { const char* s = std::getenv(n); return s ? float(std::atof(s)) : d; } }
