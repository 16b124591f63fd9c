#pragma once
// The dense twin as it sees a vehicle in a run: what acts on it at an instant, and how it moves then. For `mission.dynamics = "dense"` and
// for --check-against-reference.
#include <span>

#include "core/dynamics/workspace.hpp"
#include "core/model/model.hpp"
#include "core/reference/dense_dynamics.hpp"
#include "core/time/integrator.hpp"

namespace cardan {

/// What acts at a state.
template <class T>
struct TwinLoads {
  const double* tau = nullptr;           // of actuators and devices [N m, N], nv numbers; springs, stops and friction are the twin's own
  std::span<const NodeWrench> wrenches;  // in node or world axes
  reference::Mat3X<T> drives;            // of prescribed loops, each [more; rate; acceleration]
  const T* vdot = nullptr;               // of prescribed components, nv numbers
  const FieldMoment* moment = nullptr;   // of gravity that is a field
  const double *z = nullptr, *marks = nullptr;  // states of devices that give bodies their mass
};

template <class T>
reference::Mat3X<T> twin_drives(std::span<const LoopDrive> drives);

/// Instantiated for double and for reference::Quad.
template <class T>
class TwinDynamics {
 public:
  using VecX = reference::VecX<T>;

  /// Throws InputError C0401 for what the twin does not know: bodies with modes of a plugin, hinges of a plugin in loops. A hinge of a
  /// plugin in the tree moves as its family says, in double.
  explicit TwinDynamics(const Model& model);
  TwinDynamics(const TwinDynamics&) = delete;  // the twin asks it for gravity
  TwinDynamics& operator=(const TwinDynamics&) = delete;
  /// The equations of motion at (q, v).
  reference::DenseState<T> at(const VecX& q, const VecX& v, const TwinLoads<T>& loads);
  reference::NodeWrenches<T> wrenches(const reference::DenseState<T>& state, const TwinLoads<T>& loads) const;
  /// v' of at(); throws NumericsError N0101 where M of the free components is not positive definite.
  VecX vdot(const reference::DenseState<T>& state, const TwinLoads<T>& loads) const;
  /// Which components of v are given now: what devices hold comes and goes.
  std::vector<bool> prescribed() const;

 private:
  reference::DenseTwin<T> made(const SystemSpec& spec);

  const Model& model_;
  reference::ForeignHinges foreign_;
  const FieldMoment* moment_ = nullptr;
  reference::DenseTwin<T> twin_;
};

/// Throws InputError C0401 where a run by the twin is not to be had: what the twin does not know, and the methods that do not ask for
/// accelerations.
void expect_twin_takes(const Model& model, const IntegratorOptions& options, const Located& at = {"mission.dynamics"});

}  // namespace cardan
