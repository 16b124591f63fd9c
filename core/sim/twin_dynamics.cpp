#include "core/sim/twin_dynamics.hpp"

#include <algorithm>
#include <array>

#include "core/dynamics/devices.hpp"
#include "core/reference/quad.hpp"
#include "core/soa/field_pull.hpp"

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

/// Gravity that is a field, as its family gives it at that time: what the twin has of its own is all that follows of it.
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

/// The description with the masses that devices give to bodies.
template <class T>
SystemSpec weighed(const Model& m, const TwinLoads<T>& loads) {
  SystemSpec spec = *m.spec;
  for (const DeviceMass& own : m.devices.masses) {
    const cardan_mass more = mass_of(m.devices.all[static_cast<std::size_t>(own.device)], loads.z, loads.marks);
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

/// What a plugin makes of modal data is not known to the twin, nor which rows another program takes where they contradict each other.
const Model& known(const Model& m) {
  if (m.loops.left_open)
    refuse(Code::unsupported, m.spec->locate("loops"), "loops that close but for rounding, for the dense twin",
           "rows that others imply and that are open by what numbers were typed with",
           "more digits of lengths, places and axes: `cardan check` names the row");
  for (std::size_t i = 0; i < m.user.size(); ++i)
    if (const UserBody& u = m.user[i]; u.n_modes > 0 && u.family_origin != "built-in")
      refuse(Code::unsupported, m.spec->bodies[i].at, "a body with modes of a built-in type, which the dense twin knows", u.type);
  return m;
}

}  // namespace

template <class T>
reference::Mat3X<T> twin_drives(std::span<const LoopDrive> drives) {
  reference::Mat3X<T> out(3, static_cast<Eigen::Index>(drives.size()));
  for (Eigen::Index i = 0; i < out.cols(); ++i) {
    const LoopDrive& d = drives[static_cast<std::size_t>(i)];
    out.col(i) << T(d.more), T(d.rate), T(d.acceleration);
  }
  return out;
}

template <class T>
TwinDynamics<T>::TwinDynamics(const Model& model) : model_(known(model)), foreign_(foreign_hinges(model)), twin_(made(*model.spec)) {}

template <class T>
std::vector<bool> TwinDynamics<T>::prescribed() const {
  std::vector<bool> out(static_cast<std::size_t>(model_.nv), false);
  for (std::size_t i = 0; model_.has_prescribed() && i < out.size(); ++i) out[i] = model_.prescribed[i] != 0;
  return out;
}

template <class T>
reference::DenseTwin<T> TwinDynamics<T>::made(const SystemSpec& spec) {
  reference::DenseModel<T> model = reference::dense_model<T>(spec, foreign_);
  if (model_.field.source) model.gravity.sample = [this](const std::array<double, 3>& x) { return sampled(model_, moment_, x); };
  return reference::DenseTwin<T>(std::move(model));
}

template <class T>
reference::DenseState<T> TwinDynamics<T>::at(const VecX& q, const VecX& v, const TwinLoads<T>& loads) {
  moment_ = loads.moment;
  if (!model_.varies.empty()) twin_ = made(weighed(model_, loads));
  return twin_.at(q, v, loads.drives);
}

template <class T>
reference::NodeWrenches<T> TwinDynamics<T>::wrenches(const reference::DenseState<T>& state, const TwinLoads<T>& loads) const {
  reference::NodeWrenches<T> all;
  for (const NodeWrench& w : loads.wrenches) {
    const UserNode& node = model_.nodes[static_cast<std::size_t>(w.node)];
    const std::string& body = model_.user[static_cast<std::size_t>(node.body)].name;
    const std::string name = node.name == body ? "" : node.name.substr(body.size() + 1);
    VecX f = to_eigen(w.f).template cast<T>();
    if (w.world_axes) {
      const reference::Mat3<T> R = state.node(body, name).R.transpose();
      f.template head<3>() = (R * f.template head<3>()).eval(), f.template tail<3>() = (R * f.template tail<3>()).eval();
    }
    all.push_back({body, name, f});
  }
  return all;
}

template <class T>
typename TwinDynamics<T>::VecX TwinDynamics<T>::vdot(const reference::DenseState<T>& state, const TwinLoads<T>& loads) const {
  VecX tau(model_.nv), given = VecX::Zero(model_.nv);
  const std::vector<bool> is_given = prescribed();
  for (int i = 0; i < model_.nv; ++i) {
    tau[i] = T(loads.tau[i]);
    if (is_given[static_cast<std::size_t>(i)]) given[i] = loads.vdot[i];
  }
  return state.hybrid(tau, is_given, given, wrenches(state, loads)).vdot;
}

template reference::Mat3X<double> twin_drives(std::span<const LoopDrive>);
template reference::Mat3X<reference::Quad> twin_drives(std::span<const LoopDrive>);
template class TwinDynamics<double>;
template class TwinDynamics<reference::Quad>;

void expect_twin_takes(const Model& model, const IntegratorOptions& options, const Located& at) {
  if (options.method.starts_with("variational") || options.method == "ida")
    refuse(Code::unsupported, at, "a method that asks for accelerations, as the dense twin gives them", options.method, "dopri5, dop853");
  const TwinDynamics<double> twin(model);
}

}  // namespace cardan
