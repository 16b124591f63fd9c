#pragma once
// Which sweeps run: compiled for x86-64-v2, v3 and v4 (docs/adr/0013-instruction-sets.md), picked once by the processor.
#include "core/soa/sweeps.hpp"
#include "core/soa/tangent.hpp"

namespace cardan {
struct Embedding;
}

namespace cardan::soa {

struct EmbeddingWork;
struct RowsOfHinges;

/// Loops that are closed inside of the sweeps (embedding_sweeps.hpp), from poses, gamma_b, z and P to v'. `given`: what G v' is to be, per
/// row; null: gamma_c. 0: done; 1: the rank is not that of the program or rows contradict each other, nothing was changed; 2: breakdown.
using SweepEmbedded = int (*)(const SweepModel&, const Embedding&, const Sweeps<double>&, Workspace<double>&, EmbeddingWork&,
                              const Inputs<double>&, const RowsOfHinges&, const double* given, double* vdot);

/// The sweeps of one instruction set: one state at a time, and as many as its registers hold side by side.
struct InstructionSet {
  const char* name;  // "v2", "v3", "v4"
  Sweeps<double> one;
  Sweeps<Lanes<2>> two;    // v2
  Sweeps<Lanes<4>> four;   // v3
  Sweeps<Lanes<8>> eight;  // v4
  SweepEmbedded embedded;
  Sweeps<Tangents> tangents;  // of inverse dynamics
};
// One file each: half a minute to compile.
const Sweeps<double>& sweeps_v2();
const Sweeps<double>& sweeps_v3();
const Sweeps<double>& sweeps_v4();
SweepEmbedded embedded_v2();
SweepEmbedded embedded_v3();
SweepEmbedded embedded_v4();
const Sweeps<Lanes<2>>& lanes_v2();
const Sweeps<Lanes<4>>& lanes_v3();
const Sweeps<Lanes<8>>& lanes_v4();
const Sweeps<Tangents>& tangents_v2();  // kernels_tangent.cpp: for every processor
const Sweeps<Tangents>& tangents_v3();
const Sweeps<Tangents>& tangents_v4();

/// The best that the processor can run, or that named by the environment variable CARDAN_KERNELS: InputError where it cannot run
/// that, or there is none of that name.
const InstructionSet& instruction_set();

template <class T>
const Sweeps<T>& sweeps();
template <>
inline const Sweeps<double>& sweeps<double>() {
  return instruction_set().one;
}
template <>
inline const Sweeps<Lanes<2>>& sweeps<Lanes<2>>() {
  return instruction_set().two;
}
template <>
inline const Sweeps<Lanes<4>>& sweeps<Lanes<4>>() {
  return instruction_set().four;
}
template <>
inline const Sweeps<Lanes<8>>& sweeps<Lanes<8>>() {
  return instruction_set().eight;
}
template <>
inline const Sweeps<Tangents>& sweeps<Tangents>() {
  return instruction_set().tangents;
}

}  // namespace cardan::soa
