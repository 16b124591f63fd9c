// Why the articulated inertia is stored as a symmetric matrix: the same articulated-body recursion with full 6 x 6 matrices, as
// they come out of the arithmetic and made symmetric after each body, beside the sweeps, all against 113 bits.
//   cardan-bench-symmetry [MODEL.json ...]      default: the hard models of tests/reference/bench
// Trees of rigid bodies on revolute hinges fixed to the ground.
#include <fmt/format.h>

#include <Eigen/Geometry>

#include "bench/exact.hpp"
#include "bodies/register.hpp"
#include "core/dynamics/forward.hpp"
#include "hinges/register.hpp"

namespace cardan::bench {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

Eigen::Matrix3d tilde(const Eigen::Vector3d& a) {
  Eigen::Matrix3d t;
  t << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return t;
}

/// v' by the recursion as textbooks have it: U = P H*, P(A) += phi (P - U D^-1 U*) phi* with 6 x 6 products.
Eigen::VectorXd textbook(const Model& model, const BenchState& s, bool make_symmetric) {
  const std::size_t n = model.bodies.size();
  std::vector<Matrix6> phi(n, Matrix6::Zero()), P(n, Matrix6::Zero());
  std::vector<Vector6> H(n), gamma(n, Vector6::Zero()), z(n, Vector6::Zero()), G(n), delta(n, Vector6::Zero());
  std::vector<Eigen::Vector3d> w(n, Eigen::Vector3d::Zero());
  std::vector<double> nu(n);
  Eigen::VectorXd vdot(model.nv);
  gamma[0].tail<3>() = -model.gravity.g;
  for (std::size_t k = 1; k < n; ++k) {
    const SweepBody& b = model.bodies[k];
    const auto A = static_cast<std::size_t>(b.parent);
    const Eigen::Vector3d axis = to_eigen(b.axis), p = to_eigen(b.O.p);
    const Eigen::Matrix3d R = to_eigen(b.O.R) * Eigen::AngleAxisd(s.q[b.q], axis).toRotationMatrix();
    phi[k] << R, tilde(p) * R, Eigen::Matrix3d::Zero(), R;  // a wrench at B referred to A; its transpose takes twists along
    H[k] << axis, Eigen::Vector3d::Zero();
    const Eigen::Vector3d w1 = R.transpose() * w[A], rate = s.v[b.v] * axis;
    w[k] = w1 + rate;
    gamma[k] = phi[k].transpose() * gamma[A];
    gamma[k].head<3>() += w1.cross(rate);
    gamma[k].tail<3>() += R.transpose() * w[A].cross(w[A].cross(p));
    const Eigen::Matrix3d J = to_eigen(b.M.J);
    const Eigen::Vector3d h = to_eigen(b.M.h);
    P[k] << J, tilde(h), -tilde(h), b.M.m * Eigen::Matrix3d::Identity();
    z[k] = P[k] * gamma[k];
    z[k].head<3>() += w[k].cross(J * w[k]);
    z[k].tail<3>() += w[k].cross(w[k].cross(h));
  }
  for (std::size_t k = n - 1; k > 0; --k) {
    const SweepBody& b = model.bodies[k];
    const auto A = static_cast<std::size_t>(b.parent);
    const Vector6 PH = P[k] * H[k];
    const double D = H[k].dot(PH), eps = s.tau[b.v] - H[k].dot(z[k]);
    G[k] = PH / D;
    nu[k] = eps / D;
    P[A] += phi[k] * (P[k] - PH * PH.transpose() / D) * phi[k].transpose();
    if (make_symmetric) P[A] = 0.5 * (P[A] + P[A].transpose()).eval();
    z[A] += phi[k] * (z[k] + G[k] * eps);
  }
  for (std::size_t k = 1; k < n; ++k) {
    const SweepBody& b = model.bodies[k];
    delta[k] = phi[k].transpose() * delta[static_cast<std::size_t>(b.parent)];
    vdot[b.v] = nu[k] - G[k].dot(delta[k]);
    delta[k] += vdot[b.v] * H[k];
  }
  return vdot;
}

int run(std::vector<std::filesystem::path> files) {
  if (files.empty())
    for (const auto& file : models_in(CARDAN_SOURCE_DIR "/tests/reference/bench"))
      if (file.stem().string().starts_with("hard_")) files.push_back(file);
  Registry registry;
  register_hinges(registry);
  register_bodies(registry);
  fmt::print("| {:20} | {:>10} | {:>14} | {:>7} |\n|---|---:|---:|---:|\n", "forward error", "full 6 x 6", "made symmetric", "sweeps");
  for (const auto& file : files) {
    const BenchModel bm = read_model(file);
    const auto plain = compile(bm.spec, registry, {.merge_locked = false, .choose_frames = false});
    const auto model = compile(bm.spec, registry);
    Workspace ws(*model);
    const std::vector<Exact> truth = exact(bm, registry);
    double full = 0.0, symmetric = 0.0, ours = 0.0;
    for (std::size_t k = 0; k < truth.size(); ++k) {
      const BenchState& s = bm.states[k];
      full = std::max(full, relative_error(textbook(*plain, s, false), truth[k].vdot));
      symmetric = std::max(symmetric, relative_error(textbook(*plain, s, true), truth[k].vdot));
      Eigen::VectorXd vdot(model->nv);
      Inputs in;
      in.q = s.q.data(), in.v = s.v.data(), in.tau = s.tau.data();
      forward_dynamics(*model, ws, in, vdot.data());
      ours = std::max(ours, relative_error(vdot, truth[k].vdot));
    }
    fmt::print("| {:20} | {:10.1e} | {:14.1e} | {:7.1e} |\n", bm.name, full, symmetric, ours);
  }
  return 0;
}

}  // namespace
}  // namespace cardan::bench

int main(int argc, char** argv) {
  try {
    return cardan::bench::run({argv + 1, argv + argc});
  } catch (const std::exception& e) {
    fmt::print(stderr, "{}\n", e.what());
    return 2;
  }
}
