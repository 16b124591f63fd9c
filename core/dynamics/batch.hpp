#pragma once
// Many states of one model at once: campaigns, finite differences, sigma points. One state per lane of a register: 8 in one
// pass of the sweeps with AVX-512, 4 with AVX2, else one.
#include <memory>

#include "core/model/model.hpp"

namespace cardan {

/// n states side by side: state k at q + k nq, v + k nv, and so on (matrices with one column per state; user's order, units as
/// in Model). q must be given; the others may be null = zero.
struct BatchInputs {
  int n = 0;
  const double* q = nullptr;
  const double* v = nullptr;
  const double* tau = nullptr;   // forward dynamics
  const double* vdot = nullptr;  // inverse dynamics; forward: the prescribed components, the others zero
  bool gravity = true;
  const FieldMoment* moment = nullptr;  // of gravity that is a field of a family; null: t = 0
};

/// Scratch of one thread. A state gives the same bits whatever the others are, wherever it stands and however many there are;
/// against one state at a time (forward.hpp) the round-off may differ.
class Batch {
 public:
  /// InputError (C0401): it has devices that push or carry mass, whose states are no part of the inputs.
  explicit Batch(const Model& model);
  static bool takes(const Model& model);  ///< has no such devices
  ~Batch();
  Batch(Batch&&) noexcept;

  int width() const;  ///< states in one pass
  /// vdot: nv x n. Returns how many states had a direction without inertia; their columns are not a number, and `failed`
  /// (n entries, may be null) is 1 for them.
  int forward_dynamics(const BatchInputs& in, double* vdot, std::uint8_t* failed = nullptr);
  /// tau: nv x n, as inverse_dynamics (inverse.hpp) for each state.
  void inverse_dynamics(const BatchInputs& in, double* tau);
  /// M^-1 f at one q, column by column (nv x n), O(N) each: the articulated sweeps without velocities, loads and gravity. Zero at
  /// prescribed components. False: a direction without inertia.
  bool mass_inverse(const double* q, int n, const double* f, double* out);
  std::size_t bytes() const;  ///< of working memory

  struct Passes;  // of one width

 private:
  std::unique_ptr<Passes> passes_;
};

}  // namespace cardan
