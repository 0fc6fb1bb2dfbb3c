#include "frazil/render/cryptomatte.h"

#include <algorithm>
#include <array>
#include <bit>

namespace frazil {

std::uint32_t murmur3_32(std::string_view text) {
    constexpr std::uint32_t c1 = 0xcc9e2d51u, c2 = 0x1b873593u;
    const auto byte = [&](std::size_t i) { return static_cast<std::uint32_t>(static_cast<unsigned char>(text[i])); };
    const auto mixed = [](std::uint32_t k) { return std::rotl(k * c1, 15) * c2; };
    std::uint32_t hash = 0;
    const std::size_t blocks = text.size() / 4 * 4;
    for (std::size_t i = 0; i < blocks; i += 4) {
        hash ^= mixed(byte(i) | byte(i + 1) << 8 | byte(i + 2) << 16 | byte(i + 3) << 24);
        hash = std::rotl(hash, 13) * 5 + 0xe6546b64u;
    }
    std::uint32_t rest = 0;
    for (std::size_t i = text.size(); i > blocks; --i) rest = rest << 8 | byte(i - 1);
    if (text.size() > blocks) hash ^= mixed(rest);
    hash ^= static_cast<std::uint32_t>(text.size());
    hash ^= hash >> 16;
    hash *= 0x85ebca6bu;
    hash ^= hash >> 13;
    hash *= 0xc2b2ae35u;
    hash ^= hash >> 16;
    return hash;
}

float cryptomatte_id(std::string_view name) {
    std::uint32_t bits = murmur3_32(name);
    const std::uint32_t exponent = bits >> 23 & 255u;
    if (exponent == 0 || exponent == 255) bits ^= 1u << 23;
    return std::bit_cast<float>(bits);
}

void count_id(IdCounts& counts, std::uint32_t object, float samples) {
    for (auto& [known, count] : counts) {
        if (known == object) {
            count += samples;
            return;
        }
    }
    counts.emplace_back(object, samples);
}

void add_ids(const IdCounts& counts, std::span<const float> id_of_object, float* slots) {
    for (const auto& [object, samples] : counts) {
        const float id = id_of_object[object];
        int place = 0;
        for (int i = 0; i < kIdSlots; ++i) {
            if (slots[2 * i] == id && slots[2 * i + 1] > 0.0f) {
                place = i;
                break;
            }
            if (slots[2 * i + 1] < slots[2 * place + 1]) place = i;
        }
        if (slots[2 * place] == id || slots[2 * place + 1] == 0.0f) {
            slots[2 * place] = id;
            slots[2 * place + 1] += samples;
        } else if (samples > slots[2 * place + 1]) {
            slots[2 * place] = id;
            slots[2 * place + 1] = samples;
        }
    }
}

void write_ranks(const float* slots, float scale, float* ranks) {
    std::array<int, kIdSlots> order;
    for (int i = 0; i < kIdSlots; ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return slots[2 * a + 1] > slots[2 * b + 1]; });
    for (int rank = 0; rank < kIdRanks; ++rank) {
        ranks[2 * rank] = slots[2 * order[rank]];
        ranks[2 * rank + 1] = slots[2 * order[rank] + 1] * scale;
    }
}

}  // namespace frazil
