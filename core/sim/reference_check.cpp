#include "core/sim/reference_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <type_traits>
#include <vector>

#include "core/reference/factor.hpp"
#include "core/reference/quad.hpp"
#include "core/sim/twin_dynamics.hpp"

// The twin solves a dense mass matrix and loses digits where masses differ by many orders and the sweeps do not. So it is
// never blamed in double alone: what disagrees there, or is ill-conditioned, is formed once more in 113 bits (some hundred
// times the work, at the rows concerned). A hinge of a plugin gives the same doubles to both.

namespace cardan {
namespace {

constexpr char kPath[] = "reference/difference";
/// Below this difference the twin in double is believed; the limit of the check is kReferenceLimit.
constexpr double kSure = 1e-11;
/// Below this reciprocal condition of M with a unit diagonal v' of the twin in double may lack half of its digits.
constexpr double kSound = 1e-10;
/// Roundings of a mass matrix below whose reciprocal condition it is singular: closed loops may hold such motions.
constexpr double kSingular = 1e3;
/// Roundings of products of velocities, in 113 bits, below which a difference is none.
constexpr double kRounded = 1e3;
/// Roundings of attitudes, in double, by which what hangs at rest may be pulled aside: one for each body on the way, some for its axes.
constexpr double kAside = 1e2;

/// Largest |v' - v'_twin| over the largest |v'| that any one force (gravity, velocity terms, springs, modes, commands,
/// a device at a node) causes by itself: v' may be small because large forces cancel, and rounding is of the size of each of them. Infinite
/// where one of them is no number or the twin finds no v'. `sound`: false where T may be too short for this mass matrix.
template <class T>
double difference(Simulation& sim, TwinDynamics<T>& twin, bool& sound) {
  using reference::MatX, reference::VecX, std::sqrt;
  sim.observe();
  const std::vector<double> forces = sim.applied_forces();
  const VecX<T> vdot = sim.vdot().cast<T>();
  TwinLoads<T> loads;
  loads.tau = forces.data(), loads.vdot = vdot.data();
  loads.wrenches = sim.wrenches(), loads.drives = twin_drives<T>(sim.drives()), loads.moment = sim.gravity_moment();
  loads.z = sim.state().z.data(), loads.marks = sim.state().marks.data();
  const reference::DenseState<T> state = twin.at(sim.state().q.cast<T>(), sim.state().v.cast<T>(), loads);

  const VecX<T> unit = state.M.diagonal().unaryExpr([](const T& m) { return m > T(0) ? T(1) / sqrt(m) : T(1); });
  MatX<T> scaled = unit.asDiagonal() * state.M * unit.asDiagonal();
  reference::Factor<T> M(scaled);
  if (!sim.model().loops.empty() && !(M.is_positive() && M.rcond() > kSingular * static_cast<double>(std::numeric_limits<T>::epsilon())))
    M = reference::Factor<T>(scaled +=
                             MatX<T>::Identity(scaled.rows(), scaled.cols()));  // loops hold what has no inertia: a scale all the same
  sound = M.is_positive();
  if (!sound) return HUGE_VAL;
  if constexpr (std::is_same_v<T, double>) sound = M.rcond() > kSound;
  const auto largest = [](const VecX<T>& x) { return static_cast<double>(x.cwiseAbs().template maxCoeff<Eigen::PropagateNaN>()); };
  const double apart = largest(vdot - twin.vdot(state, loads));
  double scale = largest(vdot);
  const VecX<T> tau = Eigen::VectorXd::Map(forces.data(), vdot.size()).template cast<T>();
  std::vector<VecX<T>> alone = {tau, state.bias, state.gravity_force, state.elastic_force, state.hinge_force};
  for (const auto& wrench : twin.wrenches(state, loads)) alone.push_back(state.external_force({wrench}));
  const auto caused_by = [&](const VecX<T>& force) { return largest(unit.cwiseProduct(M.solve(VecX<T>(unit.cwiseProduct(force))))); };
  for (const VecX<T>& force : alone) scale = std::max(scale, caused_by(force));
  if (apart == 0.0) return 0.0;
  if constexpr (!std::is_same_v<T, double>) {
    // Of a vehicle that glides all of these are zero, but the twin's velocity terms are products of velocities that cancel up to rounding,
    // and so are in double those of closed loops.
    const VecX<T> v = sim.state().v.cast<T>();
    const VecX<T> products = v.cwiseAbs().maxCoeff() * (state.M * v).cwiseAbs();
    const double rounding = kRounded * static_cast<double>(std::numeric_limits<T>::epsilon()),
                 in_loops = sim.model().loops.empty() ? 0.0 : kAside * std::numeric_limits<double>::epsilon();
    if (std::max(apart, scale) <= std::max(rounding, in_loops) * caused_by(products)) return 0.0;
    // Of what hangs at rest gravity's force is zero, but for the rounding of attitudes times what it is across: no more than the root of
    // the diagonal of M times that of the sum of m g^2 (Cauchy-Schwarz).
    const VecX<T> across = VecX<T>::Constant(vdot.size(), sqrt(state.pull_squared));
    const double aside = kAside * std::numeric_limits<double>::epsilon() * largest(unit.cwiseProduct(M.solve(across)));
    if (std::max(apart, caused_by(state.gravity_force)) <= aside) return 0.0;
  }
  const double relative = apart / scale;
  return std::isfinite(relative) ? relative : HUGE_VAL;
}

/// The twin in double and, where that is not enough to blame anybody, in 113 bits: made when it is first asked for.
class Judge {
 public:
  explicit Judge(const Simulation& sim) { look(sim.model()); }
  double difference(Simulation& sim) {
    if (sim.model().spec != spec_) look(sim.model());  // the vehicle has become another one
    if (sim.model().nv == 0) return 0.0;               // nothing can move
    bool sound = false;
    double apart = HUGE_VAL;
    try {
      apart = cardan::difference(sim, *twin_, sound);
    } catch (const NumericsError&) {  // no Cholesky factor of the free components in double
      sound = false;
    }
    if (sound && apart < kSure) return apart;
    if (!exact_) exact_.emplace(sim.model());
    return cardan::difference(sim, *exact_, sound);
  }

 private:
  void look(const Model& model) {
    twin_.reset(), exact_.reset();
    spec_ = model.spec;
    twin_.emplace(model);
  }

  std::shared_ptr<const SystemSpec> spec_;  // of the model that the twins refer to; held, so that no other one has its address
  std::optional<TwinDynamics<double>> twin_;
  std::optional<TwinDynamics<reference::Quad>> exact_;
};

}  // namespace

double difference_from_twin(Simulation& sim) { return Judge(sim).difference(sim); }

Output reference_output(Simulation& sim) {
  const auto judge = std::make_shared<Judge>(sim);
  return {{kPath, {"difference"}, "1", "", "largest difference of v' from the dense twin, relative"},
          [&sim, judge](double* x) { *x = judge->difference(sim); }};
}

Check reference_check(const std::vector<Range>& ranges) {
  Check c{"agreement with the dense reference",
          std::nan(""),  // NaN in any row, and no row at all, is no agreement
          kReferenceLimit,
          false,
          "1",
          fmt::format("below {:g}, at every output time", kReferenceLimit)};
  for (const Range& r : ranges)
    if (r.path == kPath) c.value = std::min(r.largest, std::numeric_limits<double>::max());  // inf: no v' to compare with
  c.pass = c.value >= 0.0 && c.value <= c.limit;
  c.most = c.limit;
  return c;
}

}  // namespace cardan
