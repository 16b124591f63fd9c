#pragma once
// Which sweeps run: compiled for x86-64-v2, v3 and v4 (docs/adr/0013-instruction-sets.md), picked once by the processor.
#include "core/soa/sweeps.hpp"

namespace cardan::soa {

/// The sweeps of one instruction set: one state at a time, and as many as its registers hold side by side (none on v2).
struct Kernels {
  const char* name;                  // "v2", "v3", "v4"
  Sweeps<double> one;
  Sweeps<Lanes<4>> four;             // v3
  Sweeps<Lanes<8>> eight;            // v4
};
const Kernels& kernels_v2();
const Kernels& kernels_v3();
const Kernels& kernels_v4();

/// The best that the processor can run, or that named by the environment variable CARDAN_KERNELS: InputError where it cannot run
/// that, or there is none of that name.
const Kernels& kernels();

template <class T>
const Sweeps<T>& sweeps();
template <>
inline const Sweeps<double>& sweeps<double>() { return kernels().one; }
template <>
inline const Sweeps<Lanes<4>>& sweeps<Lanes<4>>() { return kernels().four; }
template <>
inline const Sweeps<Lanes<8>>& sweeps<Lanes<8>>() { return kernels().eight; }

}  // namespace cardan::soa
