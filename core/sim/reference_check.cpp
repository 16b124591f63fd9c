#include "core/sim/reference_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <type_traits>

#include "core/reference/dense_dynamics.hpp"
#include "core/reference/factor.hpp"
#include "core/reference/quad.hpp"
#include "core/soa/field_pull.hpp"

// The twin solves a dense mass matrix and loses digits where masses differ by many orders and the sweeps do not. So it is
// never blamed in double alone: what disagrees there, or is ill-conditioned, is formed once more in 113 bits (some hundred
// times the work, at the rows concerned). A hinge of a plugin gives the same doubles to both.

namespace cardan {
namespace {

using reference::ForeignHinge;
using reference::ForeignHinges;
using reference::ForeignMotion;

/// A hinge type that the twin does not know, by the kinematics of its family: one link of the chain is not independent
/// then.
ForeignHinges foreign_hinges(const Model& m) {
  ForeignHinges all;
  for (std::size_t i = 0; i < m.user.size(); ++i) {
    const UserBody& u = m.user[i];
    if (reference::hinge_size(u.hinge_type).nq >= 0) continue;
    // Instances of one type differ in their parameters: found again by the place of their description.
    const auto motion = [&m](const HingeSpec& hinge, const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
      std::size_t at = 0;
      while (m.spec->bodies[at].hinge.at.key_path != hinge.at.key_path) ++at;
      const UserBody& user = m.user[at];
      cardan_hinge_out out{};
      const std::uint32_t zero = 0;
      user.hinge->kinematics(user.hinge_packed.data(), 1, &zero, &zero, q.data(), v.data(), &out);
      ForeignMotion f;
      f.R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out.R_OP);
      f.p = Eigen::Map<const Eigen::Vector3d>(out.p_OP);
      f.Ht = Eigen::Map<const Eigen::Matrix<double, 6, Eigen::Dynamic>>(out.Ht, 6, user.hinge->nv);
      f.Hdot_v = Eigen::Map<const Eigen::Matrix<double, 6, 1>>(out.Hdot_v);
      f.qdot.resize(user.hinge->nq);
      user.hinge->qdot(user.hinge_packed.data(), q.data(), v.data(), f.qdot.data());
      return f;
    };
    all[u.hinge_type] = ForeignHinge{static_cast<int>(u.hinge->nq), static_cast<int>(u.hinge->nv), motion};
  }
  return all;
}

/// Gravity that is a field, as its family gives it at the time of the simulation: what the twin has of its own is all that follows of it.
std::array<double, 13> sampled(const Model& m, const FieldMoment* at, const std::array<double, 3>& x) {
  std::array<double, 13> out{};
  double a[3], G[9], values[CARDAN_FIELD_NUMBERS];
  soa::detail::acceleration(m.field, at, x.data(), a, G);
  std::copy_n(a, 3, out.begin()), std::copy_n(G, 9, out.begin() + 3);
  const cardan_field_args args{sizeof args, at->t, m.field.source->packed.data(), at->prepared};
  m.field.source->family->evaluate(&args, 1, x.data(), values, nullptr);
  out[12] = values[3];
  return out;
}

template <class T>
reference::DenseTwin<T> twin_of(Simulation& sim, const ForeignHinges& foreign, const SystemSpec& spec) {
  reference::DenseModel<T> model = reference::dense_model<T>(spec, foreign);
  if (sim.model().field.source)
    model.gravity.sample = [&sim](const std::array<double, 3>& x) { return sampled(sim.model(), sim.gravity_moment(), x); };
  return reference::DenseTwin<T>(std::move(model));
}

constexpr char kPath[] = "reference/difference";
/// Below this difference the twin in double is believed; the limit of the check is kReferenceLimit.
constexpr double kSure = 1e-11;
/// Below this reciprocal condition of M with a unit diagonal v' of the twin in double may lack half of its digits.
constexpr double kSound = 1e-10;

/// Largest |v' - v'_twin| over the largest |v'| that any one force (gravity, velocity terms, springs, modes, commands)
/// causes by itself: v' may be small because large forces cancel, and rounding is of the size of each of them. Infinite
/// where one of them is no number or the twin finds no v'. `sound`: false where T may be too short for this mass matrix.
template <class T>
double difference(Simulation& sim, const reference::DenseTwin<T>& twin, bool& sound) {
  using reference::MatX, reference::VecX;
  const Model& m = sim.model();
  const Observer& observer = sim.observe();
  reference::Mat3X<T> drives(3, static_cast<Eigen::Index>(sim.drives().size()));
  for (Eigen::Index i = 0; i < drives.cols(); ++i) {
    const LoopDrive& d = sim.drives()[static_cast<std::size_t>(i)];
    drives.col(i) << T(d.more), T(d.rate), T(d.acceleration);
  }
  const reference::DenseState<T> state = twin.at(sim.state().q.cast<T>(), sim.state().v.cast<T>(), drives);
  VecX<T> tau(m.nv);
  const std::vector<double> forces = sim.applied_forces();
  for (int i = 0; i < m.nv; ++i) tau[i] = T(forces[static_cast<std::size_t>(i)]);
  reference::NodeWrenches<T> wrenches;
  for (const NodeWrench& w : sim.wrenches()) {
    const UserNode& node = m.nodes[static_cast<std::size_t>(w.node)];
    const std::string& body = m.user[static_cast<std::size_t>(node.body)].name;
    Eigen::VectorXd f = to_eigen(w.f);
    if (w.world_axes) {
      const Eigen::Matrix3d R = observer.node(w.node).R_WN.transpose();
      f << R * f.head<3>(), R * f.tail<3>();
    }
    wrenches.push_back({body, node.name == body ? "" : node.name.substr(body.size() + 1), f.cast<T>()});
  }
  const VecX<T> vdot = sim.vdot().cast<T>();
  std::vector<bool> prescribed(static_cast<std::size_t>(m.nv), false);
  for (std::size_t i = 0; i < m.prescribed.size(); ++i) prescribed[i] = m.prescribed[i] != 0;

  const VecX<T> unit = state.M.diagonal().cwiseSqrt().cwiseInverse();
  const reference::Factor<T> M(unit.asDiagonal() * state.M * unit.asDiagonal());
  sound = M.is_positive();
  if (!sound) return HUGE_VAL;
  if constexpr (std::is_same_v<T, double>) sound = M.rcond() > kSound;
  const auto largest = [](const VecX<T>& x) { return static_cast<double>(x.cwiseAbs().template maxCoeff<Eigen::PropagateNaN>()); };
  const double apart = largest(vdot - state.hybrid(tau, prescribed, vdot, wrenches).vdot);
  double scale = largest(vdot);
  for (const VecX<T>& force :
       {tau, state.bias, state.gravity_force, state.elastic_force, state.hinge_force, state.external_force(wrenches)})
    scale = std::max(scale, largest(unit.cwiseProduct(M.solve(VecX<T>(unit.cwiseProduct(force))))));
  if (apart == 0.0) return 0.0;
  const double relative = apart / scale;
  return std::isfinite(relative) ? relative : HUGE_VAL;
}

/// The description with the masses that devices give to bodies now.
SystemSpec weighed(Simulation& sim) {
  const Model& m = sim.model();
  SystemSpec spec = *m.spec;
  for (const DeviceMass& own : m.devices.masses) {
    const cardan_mass more = mass_of(m.devices.all[static_cast<std::size_t>(own.device)], sim.state().z.data(), sim.state().marks.data());
    BodySpec& b = spec.bodies[static_cast<std::size_t>(own.user)];
    const Eigen::Vector3d c = Eigen::Vector3d::Map(more.centre), com = (b.mass * b.com + more.mass * c) / (b.mass + more.mass);
    const auto about = [&](double mass, const Eigen::Vector3d& at) -> Eigen::Matrix3d {
      const Eigen::Vector3d r = at - com;
      return mass * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
    };
    const double* J = more.inertia;
    Eigen::Matrix3d inertia;
    inertia << J[0], J[3], J[4], J[3], J[1], J[5], J[4], J[5], J[2];
    b.inertia_com += inertia + about(b.mass, b.com) + about(more.mass, c);
    b.mass += more.mass, b.com = com;
  }
  return spec;
}

/// The twin in double and, where that is not enough to blame anybody, in 113 bits: made when it is first asked for.
class Judge {
 public:
  explicit Judge(Simulation& sim) : foreign_(foreign_hinges(sim.model())), twin_(twin_of<double>(sim, foreign_, *sim.model().spec)) {
    const Model& m = sim.model();
    for (std::size_t i = 0; i < m.user.size(); ++i)  // what a plugin makes of modal data is not known to the twin
      if (const UserBody& u = m.user[i]; u.n_modes > 0 && u.family_origin != "built-in")
        refuse(Code::unsupported, m.spec->bodies[i].at, "a body with modes of a built-in type, which the dense twin knows", u.type);
  }
  double difference(Simulation& sim) {
    if (sim.model().nv == 0) return 0.0;  // nothing can move
    const bool varies = !sim.model().varies.empty();
    const SystemSpec now = varies ? weighed(sim) : SystemSpec();
    if (varies) twin_ = twin_of<double>(sim, foreign_, now), exact_.reset();
    bool sound = false;
    double apart = HUGE_VAL;
    try {
      apart = cardan::difference(sim, twin_, sound);
    } catch (const NumericsError&) {  // no Cholesky factor of the free components in double
      sound = false;
    }
    if (sound && apart < kSure) return apart;
    if (!exact_) exact_.emplace(twin_of<reference::Quad>(sim, foreign_, varies ? now : *sim.model().spec));
    return cardan::difference(sim, *exact_, sound);
  }

 private:
  ForeignHinges foreign_;
  reference::DenseTwin<double> twin_;
  std::optional<reference::DenseTwin<reference::Quad>> exact_;
};

}  // namespace

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
