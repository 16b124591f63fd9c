#include "core/model/model.hpp"

#include <algorithm>

#include "core/model/initial.hpp"

namespace cardan {

Model::Model() = default;
Model::Model(const Model&) = default;
Model::Model(Model&&) noexcept = default;
Model& Model::operator=(const Model&) = default;
Model& Model::operator=(Model&&) noexcept = default;
Model::~Model() = default;

int Model::find_body(std::string_view wanted) const {
  for (std::size_t i = 0; i < user.size(); ++i)
    if (user[i].name == wanted) return static_cast<int>(i);
  return -1;
}

int Model::find_node(std::string_view wanted) const {
  for (std::size_t i = 0; i < nodes.size(); ++i)
    if (nodes[i].name == wanted) return static_cast<int>(i);
  return -1;
}

const UserBody* Model::find_curved_nodes() const {
  const auto found = std::ranges::find_if(
      user, [&](const UserBody& u) { return u.n_modes > 0 && flexible[static_cast<std::size_t>(bodies[u.sweep].flexible)].curved; });
  return found == user.end() ? nullptr : &*found;
}

bool Devices::is_commanded(int input) const {
  return from[static_cast<std::size_t>(input)] < 0 && std::ranges::find(delays, input, &DelayLine::input) == delays.end();
}

int Devices::find(std::string_view wanted) const {
  for (std::size_t i = 0; i < all.size(); ++i)
    if (all[i].name == wanted) return static_cast<int>(i);
  return -1;
}

State Model::initial_state() const {
  State s;
  s.q = Eigen::VectorXd::Zero(nq);
  s.v = Eigen::VectorXd::Zero(nv);
  s.z = Eigen::VectorXd::Map(devices.z0.data(), devices.n_z);
  s.marks = Eigen::VectorXd::Map(devices.marks0.data(), devices.n_marks);
  for (std::size_t i = 0; i < user.size(); ++i) {
    const UserBody& u = user[i];
    const BodySpec& b = spec->bodies[i];
    if (u.nq > 0) {
      std::ranges::copy(initial_coordinates(*u.hinge, u.hinge_packed.data(), b.hinge.q), s.q.begin() + u.q);
      for (std::size_t j = 0; j < b.hinge.v.size() && j < static_cast<std::size_t>(u.nv); ++j)
        s.v[u.v + static_cast<int>(j)] = b.hinge.v[j];
      for (const auto& [component, rate] : b.hinge.begins) s.v[u.v + component] = rate;
    }
    for (std::size_t j = 0; j < b.eta.size() && j < static_cast<std::size_t>(u.n_modes); ++j) s.q[u.eta + static_cast<int>(j)] = b.eta[j];
    for (std::size_t j = 0; j < b.etadot.size() && j < static_cast<std::size_t>(u.n_modes); ++j)
      s.v[u.etadot + static_cast<int>(j)] = b.etadot[j];
  }
  return s;
}

void Model::qdot(const double* q, const double* v, double* out) const {
  for (const PlainRates& r : plain_rates) std::copy_n(v + r.v, r.n, out + r.q);
  for (const int i : curved) {
    const UserBody& u = user[i];
    u.hinge->qdot(u.hinge_packed.data(), q + u.q, v + u.v, out + u.q);
  }
}

void Model::normalise(double* q) const {
  for (const auto& u : user)
    if (u.nq > 0 && u.hinge->normalise) u.hinge->normalise(u.hinge_packed.data(), q + u.q);
}

void Model::retract(const double* q, const double* d, double* out) const {
  for (const auto& u : user) {
    if (u.nq > 0 && u.hinge->retract)
      u.hinge->retract(u.hinge_packed.data(), q + u.q, d + u.v, out + u.q);
    else
      for (int j = 0; j < u.nq; ++j) out[u.q + j] = q[u.q + j] + d[u.v + j];
    for (int j = 0; j < u.n_modes; ++j) out[u.eta + j] = q[u.eta + j] + d[u.etadot + j];
  }
}

void Model::difference(const double* q1, const double* q2, double* d) const {
  for (const auto& u : user) {
    if (u.nq > 0 && u.hinge->difference)
      u.hinge->difference(u.hinge_packed.data(), q1 + u.q, q2 + u.q, d + u.v);
    else
      for (int j = 0; j < u.nq; ++j) d[u.v + j] = q2[u.q + j] - q1[u.q + j];
    for (int j = 0; j < u.n_modes; ++j) d[u.etadot + j] = q2[u.eta + j] - q1[u.eta + j];
  }
}

}  // namespace cardan
