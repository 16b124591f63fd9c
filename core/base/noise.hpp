#pragma once
// Random numbers as functions of where they are used, never of the order of calls: Philox 4x32 with ten rounds [Salmon, Moraes, Dror & Shaw
// 2011, Supercomputing], a bijection of counters under a key.
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string_view>

namespace cardan {

constexpr std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter, std::array<std::uint32_t, 2> key) {
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t a = std::uint64_t{0xD2511F53} * counter[0], b = std::uint64_t{0xCD9E8D57} * counter[2];
    counter = {static_cast<std::uint32_t>(b >> 32) ^ counter[1] ^ key[0], static_cast<std::uint32_t>(b),
               static_cast<std::uint32_t>(a >> 32) ^ counter[3] ^ key[1], static_cast<std::uint32_t>(a)};
    key[0] += 0x9E3779B9, key[1] += 0xBB67AE85;
  }
  return counter;
}

/// The key of whoever has this name in a run with this seed: 64-bit FNV-1a of both.
constexpr std::array<std::uint32_t, 2> noise_key(std::uint64_t seed, std::string_view name) {
  std::uint64_t hash = 0xcbf29ce484222325;
  const auto take = [&](unsigned char byte) { hash = (hash ^ byte) * 0x100000001b3; };
  for (int i = 0; i < 8; ++i) take(static_cast<unsigned char>(seed >> (8 * i)));
  for (const char c : name) take(static_cast<unsigned char>(c));
  return {static_cast<std::uint32_t>(hash), static_cast<std::uint32_t>(hash >> 32)};
}

/// In (0, 1], of 53 bits: from two words of one number of the bijection.
constexpr double uniform_noise(std::uint32_t high, std::uint32_t low) {
  return (static_cast<double>((std::uint64_t{high} << 32 | low) >> 11) + 1.0) * 0x1p-53;
}

/// n independent numbers of the normal distribution (mean 0, variance 1) for a tick, by pairs [Box & Muller 1958].
inline void normal_noise(std::array<std::uint32_t, 2> key, std::uint64_t tick, std::uint32_t n, double* out) {
  for (std::uint32_t i = 0; i < n; i += 2) {
    const auto word = philox({static_cast<std::uint32_t>(tick), static_cast<std::uint32_t>(tick >> 32), i / 2, 0}, key);
    const double r = std::sqrt(-2.0 * std::log(uniform_noise(word[0], word[1]))),
                 angle = 2.0 * std::numbers::pi * uniform_noise(word[2], word[3]);
    out[i] = r * std::cos(angle);
    if (i + 1 < n) out[i + 1] = r * std::sin(angle);
  }
}

}  // namespace cardan
