#include "bodies/modal/modal_check.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <cmath>
#include <set>

#include "bodies/modal/modal_integrals.hpp"
#include "bodies/modal/refuse.hpp"
#include "core/base/units.hpp"
#include "core/base/utf8.hpp"
#include "core/linalg/dense.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

constexpr double kFit = 1e-6;  // of sums that somebody else took, relative to what they could be at most

[[noreturn]] void bad(const Located& at, std::string expected, std::string got, std::string hint = {}) {
  refuse(at, {}, Code::bad_modal_data, std::move(expected), std::move(got), std::move(hint));
}

std::string size_of(const MatrixXd& A) { return fmt::format("{} x {}", A.rows(), A.cols()); }

double smallest_eigenvalue(const MatrixXd& A) { return symmetric_eigenvalues(A)(0); }

void check_symmetric(const MatrixXd& A, Eigen::Index m, const char* name, const Located& at) {
  if (A.rows() != m || A.cols() != m) bad(at, fmt::format("{} x {} matrix {}", m, m, name), size_of(A));
  if (!A.allFinite()) bad(at, fmt::format("finite numbers in {}", name), "a value that is not finite");
  if ((A - A.transpose()).cwiseAbs().maxCoeff() > 1e-10 * A.cwiseAbs().maxCoeff())
    bad(at, fmt::format("a symmetric matrix {}", name), "a matrix that is not symmetric");
}

void check_shape(const MatrixXd& shape, Eigen::Index m, const std::string& what, const Located& at) {
  if (shape.size() > 0 && (shape.rows() != 3 || shape.cols() != m)) bad(at, fmt::format("3 x {} {}", m, what), size_of(shape));
  if (!shape.allFinite()) bad(at, fmt::format("finite numbers in {}", what), "a value that is not finite");
}

Matrix3d tilde(const Vector3d& a) {
  Matrix3d out;
  out << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return out;
}

/// The largest entry by magnitude of everything in a list, 0 if there is nothing.
template <class List>
double largest(const List& list) {
  double out = 0.0;
  for (const auto& A : list)
    if (A.size() > 0) out = std::max(out, A.cwiseAbs().maxCoeff());
  return out;
}

template <class List>
void check_finite(const List& list, const char* name, const Located& at) {
  for (const auto& A : list)
    if (!A.allFinite()) bad(at, fmt::format("finite numbers in {}", name), "a value that is not finite");
}

void check_all_finite(const ModalIntegrals& I, const Located& at) {
  const auto one = [&](const auto& A, const char* name) { check_finite(std::vector{A}, name, at); };
  one(I.I2, "I2");
  one(I.I3, "I3");
  one(I.I4, "I4");
  one(I.I6, "I6");
  one(I.I7, "I7");
  check_finite(I.I5, "I5", at);
  check_finite(I.I8, "I8", at);
  check_finite(I.I9, "I9", at);
  check_finite(I.rotary_ww, "rotary_ww", at);
  check_finite(I.rotary_we, "rotary_we", at);
  check_finite(I.rotary_ee, "rotary_ee", at);
  if (!(I.rotary_turn.array() >= 0.0).all() || !I.rotary_turn.allFinite() || !(I.rotary_share >= 0.0))
    bad(at, "rotary_turn and rotary_share of at least 0", "others");
}

/// [I7 I2~ I4; . m 1 I3; . . I6] with a unit diagonal: its smallest eigenvalue.
double smallest_of_mass_matrix(const ModalIntegrals& I) {
  const Eigen::Index m = I.I6.rows();
  MatrixXd M = MatrixXd::Zero(6 + m, 6 + m);
  M.topLeftCorner<3, 3>() = I.I7;
  M.block<3, 3>(0, 3) = tilde(I.I2);
  M.block(0, 6, 3, m) = I.I4;
  M.block<3, 3>(3, 3) = I.I1 * Matrix3d::Identity();
  M.block(3, 6, 3, m) = I.I3;
  M.bottomRightCorner(m, m) = I.I6;
  M.triangularView<Eigen::StrictlyLower>() = M.transpose();
  // Rows of one kind share a scale: a moment of inertia may be zero, as that of a mass on an axis through the origin is.
  Eigen::VectorXd scale(6 + m);
  scale.head<3>().setConstant(I.I7.diagonal().cwiseAbs().maxCoeff());
  scale.segment<3>(3).setConstant(I.I1);
  scale.tail(m) = I.I6.diagonal();
  for (double& s : scale) s = s > 0.0 ? 1.0 / std::sqrt(s) : 1.0;
  return smallest_eigenvalue(scale.asDiagonal() * M * scale.asDiagonal());
}

/// What sums over masses could be at most, by Schwarz's inequality: they may be zero, but for rounding.
struct Largest {
  double r, phi;  // the roots of sum m r^2 and of the largest sum m phi^2
  explicit Largest(const ModalIntegrals& I)
      : r(std::sqrt(std::max(0.5 * I.I7.trace(), 0.0))), phi(std::sqrt(std::max(I.I6.diagonal().maxCoeff(), 0.0))) {}
};

void compare(const ModalData& data, const Located& at) {
  const auto n = static_cast<Eigen::Index>(data.mass_nodes.size()), m = Eigen::Index{data.n_modes};
  MassField field;
  field.mass.resize(n);
  field.position.resize(3, n);
  for (int a = 0; a < 3; ++a) field.Phi[a] = field.Psi[a] = MatrixXd::Zero(n, m);
  for (Eigen::Index j = 0; j < n; ++j) {
    const MassNode& node = data.mass_nodes[static_cast<std::size_t>(j)];
    field.mass(j) = node.mass;
    field.position.col(j) = node.position;
    field.inertia.push_back(node.inertia);
    for (int a = 0; a < 3; ++a) {
      if (node.Phi.size() > 0) field.Phi[a].row(j) = node.Phi.row(a);
      if (node.Psi.size() > 0) field.Psi[a].row(j) = node.Psi.row(a);
    }
  }
  const ModalIntegrals sum = modal_integrals(field), &given = data.integrals;
  const auto same = [&](const auto& a, const auto& b, const char* name, double most = 0.0) {
    const double scale = std::max({largest(a), largest(b), most});
    bool fits = a.size() == b.size();
    for (std::size_t i = 0; fits && i < a.size(); ++i) fits = a[i].size() == 0 || (a[i] - b[i]).cwiseAbs().maxCoeff() <= kFit * scale;
    if (!fits)
      bad(at, fmt::format("{}: the sum over the mass nodes", name), "another one",
          "leave `integrals` out: they are computed from the mass nodes");
  };
  const auto one = [](const auto& A) { return std::vector<MatrixXd>{A}; };
  same(one(MatrixXd::Constant(1, 1, given.I1)), one(MatrixXd::Constant(1, 1, sum.I1)), "I1");
  const auto [r, phi] = Largest(sum);
  const double root_mass = std::sqrt(sum.I1);
  same(one(given.I2), one(sum.I2), "I2", root_mass * r);
  same(one(given.I3), one(sum.I3), "I3", root_mass * phi);
  same(one(given.I4), one(sum.I4), "I4", r * phi);
  same(given.I5, sum.I5, "I5", phi * phi);
  same(one(given.I6), one(sum.I6), "I6");
  same(one(given.I7), one(sum.I7), "I7");
  same(given.I8, sum.I8, "I8", r * phi);
  if (!given.I9.empty()) same(given.I9, sum.I9, "I9");
  same(given.rotary_ww, sum.rotary_ww, "rotary_ww");
  same(given.rotary_we, sum.rotary_we, "rotary_we");
  same(given.rotary_ee, sum.rotary_ee, "rotary_ee");
  if (given.rotary_turn.size() > 0) same(one(given.rotary_turn), one(sum.rotary_turn), "rotary_turn");
}

}  // namespace

void check_stiffness(const MatrixXd& K, const MatrixXd& C, const Located& at) {
  const Eigen::Index m = K.rows();
  if (m == 0) bad(at, "at least one mode", "none", "a body without modes is `type: rigid`");
  check_symmetric(K, m, "K", at);
  check_symmetric(C, m, "C", at);
  const double k_max = K.cwiseAbs().maxCoeff(), k_min = smallest_eigenvalue(K);
  if (k_min < -1e-12 * k_max) bad(at, "a positive definite K", fmt::format("eigenvalue {:.3g}", k_min));
  if (k_min <= 1e-14 * k_max)
    refuse(at, {}, Code::rigid_body_mode, "a positive definite K", fmt::format("eigenvalue {:.3g}", k_min),
           "take the rigid-body modes out: the body frame already carries them");
  if (const double c_min = smallest_eigenvalue(C); c_min < -1e-12 * C.cwiseAbs().maxCoeff())
    bad(at, "a positive semidefinite C", fmt::format("eigenvalue {:.3g}", c_min), "negative damping would create energy");
}

void check_mass_node(const MassNode& node, Eigen::Index m, std::size_t j, const Located& at) {
  const std::string which = fmt::format("mass node {}", j);
  if (!(node.mass > 0.0) || !std::isfinite(node.mass)) bad(at, "a positive mass", fmt::format("{} kg at {}", node.mass, which));
  if (!node.position.allFinite()) bad(at, "a finite position of " + which, "a value that is not finite");
  if (!node.inertia.isZero(0.0)) {
    const Matrix3d& J = node.inertia;
    if (!J.allFinite() || !J.isApprox(J.transpose(), 1e-12)) bad(at, "a symmetric inertia at " + which, "something else");
    const Vector3d p = symmetric_eigenvalues(J);
    if (p(0) < -kFit * p(2) || p(2) > (p(0) + p(1)) * (1 + kFit))
      bad(at, fmt::format("an inertia that a body can have at {}: moments >= 0, none above the sum of the others", which),
          fmt::format("{:.6g}, {:.6g}, {:.6g} kg m^2", p(2), p(1), p(0)));
  }
  check_shape(node.Phi, m, "Phi at " + which, at);
  check_shape(node.Psi, m, "Psi at " + which, at);
  if (node.Q.empty()) return;
  if (node.Q.size() != 3) bad(at, fmt::format("three matrices Q at {}, for x, y and z", which), fmt::format("{}", node.Q.size()));
  for (const MatrixXd& Q : node.Q) {
    if (Q.rows() != m || Q.cols() != m) bad(at, fmt::format("{} x {} Q at {}", m, m, which), size_of(Q));
    if (!Q.allFinite()) bad(at, "finite numbers in Q at " + which, "a value that is not finite");
    if ((Q - Q.transpose()).cwiseAbs().maxCoeff() > 1e-10 * Q.cwiseAbs().maxCoeff())
      bad(at, "symmetric matrices Q at " + which, "one that is not",
          "component a of the displacement is 1/2 eta* Q[a] eta: take the mean of Q[a] and its transpose");
  }
}

void check_nodes(const std::vector<ModalNode>& nodes, Eigen::Index m, const Located& at) {
  std::set<std::string_view> names;
  for (const ModalNode& node : nodes) {
    if (node.name.empty() || node.name == "world" || node.name.find('.') != std::string::npos || printable(node.name) != node.name)
      refuse(at, "nodes", Code::bad_name, "a name of one line without a point, other than `world`", in_quotes(node.name));
    if (!names.insert(node.name).second)
      refuse(at, "nodes", Code::duplicate_name, "a name of its own for each node of a body", in_quotes(node.name));
    const std::string which = fmt::format("node \"{}\"", node.name);
    check_shape(node.Phi, m, "Phi of " + which, at);
    check_shape(node.Psi, m, "Psi of " + which, at);
    if (!node.position.allFinite()) bad(at, "a finite position of " + which, "a value that is not finite");
    const double error = (node.R_BN * node.R_BN.transpose() - Matrix3d::Identity()).cwiseAbs().maxCoeff();
    if (!(error < 1e-9) || node.R_BN.determinant() < 0.0)
      refuse(at, {}, Code::not_a_rotation, fmt::format("an orthonormal right-handed matrix R_BN of {}", which),
             fmt::format("an entry of R R^T - 1 is {:.3g}, determinant {:.3g}", error, node.R_BN.determinant()));
  }
}

void check_integrals(const ModalData& data, const Located& at) {
  const ModalIntegrals& I = data.integrals;
  const auto m = static_cast<std::size_t>(data.n_modes);
  if (!(I.I1 > 0.0) || !std::isfinite(I.I1)) bad(at, "a positive mass I1", fmt::format("{} kg", I.I1));
  check_all_finite(I, at);
  check_symmetric(I.I6, I.I6.rows(), "I6", at);
  check_symmetric(I.I7, 3, "I7", at);
  if (const double least = smallest_of_mass_matrix(I); !(least > -kFit))
    bad(at, "I1 ... I7 of some body: a mass matrix without negative eigenvalues",
        fmt::format("eigenvalue {:.3g} of that with a unit diagonal", least), "is a sign wrong, or are the moments not about the origin?");
  const auto [r, phi] = Largest(I);
  const double of_modes = kFit * phi * phi, of_I8 = kFit * r * phi;
  for (std::size_t l = 0; l < m; ++l) {
    const auto column = static_cast<Eigen::Index>(l);
    for (std::size_t k = 0; k <= l; ++k) {
      if ((I.I5[l].col(static_cast<Eigen::Index>(k)) + I.I5[k].col(column)).cwiseAbs().maxCoeff() > of_modes)
        bad(at, "I5 that changes its sign when its two modes change places", fmt::format("modes {} and {}", l, k));
      if (!I.I9.empty() && (I.I9[l * m + k] - I.I9[k * m + l].transpose()).cwiseAbs().maxCoeff() > of_modes)
        bad(at, "I9 that is transposed when its two modes change places", fmt::format("modes {} and {}", l, k));
    }
    if (I.of_change && I.rotary_ww.empty() && (I.I8[l] - I.I8[l].transpose() + tilde(I.I4.col(column))).cwiseAbs().maxCoeff() > of_I8)
      bad(at, "I8 - I8* = -I4~, as sums of m r~* phi~ and m r~ phi have", fmt::format("mode {} without", l));
  }
  if (!data.mass_nodes.empty()) compare(data, at);
}

}  // namespace cardan
