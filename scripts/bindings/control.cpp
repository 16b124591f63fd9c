// control: feedback and filters of linear models by the equations of Riccati.
#include <fmt/format.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <string>
#include <string_view>

#include "core/linalg/dense.hpp"
#include "core/linalg/riccati.hpp"
#include "scripts/bindings/bind.hpp"
#include "scripts/bindings/linear.hpp"
#include "scripts/lua/matrix.hpp"

namespace cardan {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// Floating-point operations over n^3: some twenty doublings of products and solves; Hessenberg's form and QR; LU with what it solves.
constexpr int kDoublings = 300, kEigenvalues = 30, kFactor = 1;

/// Who asks, what it calls the matrices, and what is done about each argument that does not fit.
struct Asked {
  lua_State* L;
  const char* function;

  [[noreturn]] void refuse_it(const std::string& expected, const std::string& got, const std::string& hint = "") const {
    refuse(L, Code::lua_argument, function, expected, got, hint);
  }
  MatrixXd matrix(int index, Index rows, Index cols, const char* what) const {
    const MatrixXd A = to_matrix(L, index, rows, cols, fmt::format("{} of {}", what, function));
    if (!A.allFinite()) refuse_it(fmt::format("{}: a matrix of finite numbers", what), "one that is not finite");
    return A;
  }
  MatrixXd square(int index) const {
    MatrixXd A = matrix(index, kAnySize, kAnySize, "A");
    if (A.cols() != A.rows()) refuse_it("A: a square matrix", fmt::format("{} x {}", A.rows(), A.cols()));
    return A;
  }
  /// A weight or a density: a symmetric matrix, a list of what stands on its diagonal, or a number for all of that.
  MatrixXd weight(int index, Index n, const char* what, bool positive) const {
    MatrixXd W;
    if (lua_type(L, index) == LUA_TNUMBER) {
      W = lua_tonumber(L, index) * MatrixXd::Identity(n, n);
    } else if (is_vector(L, index) || is_list_of_numbers(index)) {
      W = to_vector(L, index, n, fmt::format("{} of {}, the diagonal", what, function)).asDiagonal();
    } else {
      W = matrix(index, n, n, what);
    }
    const double size = W.norm();
    if (!std::isfinite(size) || !((W - W.transpose()).norm() <= 1e-12 * size))
      refuse_it(fmt::format("{}: a symmetric matrix", what), "one that is not");
    W = (0.5 * (W + W.transpose())).eval();
    if (n == 0) return W;
    const double least = symmetric_eigenvalues(W)[0];
    if (positive ? !(least > 1e-15 * size) : !(least >= -1e-12 * size))
      refuse_it(fmt::format("{}: a matrix whose eigenvalues are {}", what, positive ? "above 0" : "not below 0"),
                fmt::format("{:g}", least));
    return W;
  }
  void charge(Index n, int operations) const { LuaHost::charge(L, operations * n * n * n / 16); }

 private:
  bool is_list_of_numbers(int index) const {
    if (!lua_istable(L, index)) return false;
    lua_rawgeti(L, index, 1);
    const bool is_number = lua_type(L, -1) == LUA_TNUMBER;
    lua_pop(L, 1);
    return is_number;
  }
};

/// Names alone: of a gain, what its units are made of is not told.
Labels names_of(Labels labels) {
  labels.units.clear();
  return labels;
}

using Solve = std::optional<Riccati> (*)(const MatrixXd&, const MatrixXd&, const MatrixXd&, const MatrixXd&);

/// Where there is no solution: why, of which that R (V) is too small for the digits of a double is seen by trying more of it.
std::string hint_of(const Asked& asked, Solve solve, const MatrixXd& A, const MatrixXd& B, const MatrixXd& Q, const MatrixXd& R,
                    std::string_view weights, const char* else_hint) {
  for (double more = 1e2; more < 1e17; more *= more) {
    asked.charge(A.rows(), kDoublings);
    if (solve(A, B, Q, more * R))
      return fmt::format("there is one with {:g} times as much {}: it is too small beside {} for the digits of numbers", more, weights[0],
                         weights[1]);
  }
  return else_hint;
}

/// (A, B, Q, R) -> K, X.
int regulator(lua_State* L, const char* function, Solve solve) {
  const Asked asked{L, function};
  const MatrixXd A = asked.square(1);
  const Index n = A.rows();
  const MatrixXd B = asked.matrix(2, n, kAnySize, "B"), Q = asked.weight(3, n, "Q", false), R = asked.weight(4, B.cols(), "R", true);
  asked.charge(n, kDoublings);
  const auto found = solve(A, B, Q, R);
  if (!found)
    asked.refuse_it("A, B and Q by which feedback can stabilise what they see", "no solution",
                    hint_of(asked, solve, A, B, Q, R, "RQ",
                            "a mode that does not decay, and that no column of B moves or no weight of Q sees? control.poles tells them; "
                            "leave such states out"));
  push_matrix(L, found->K, names_of(column_labels(L, 2)), names_of(column_labels(L, 1)));
  push_matrix(L, found->X, names_of(column_labels(L, 1)), names_of(column_labels(L, 1)));
  return 2;
}
int lqr(lua_State* L) { return regulator(L, "control.lqr", continuous_riccati); }
int dlqr(lua_State* L) { return regulator(L, "control.dlqr", discrete_riccati); }

/// (A, C, W, V) -> gain, covariance: the regulator of (A*, C*). In ticks the gain is that of the correction by a reading.
int filter(lua_State* L, const char* function, Solve solve, bool in_ticks) {
  const Asked asked{L, function};
  const MatrixXd A = asked.square(1);
  const Index n = A.rows();
  const MatrixXd C = asked.matrix(2, kAnySize, n, "C"), W = asked.weight(3, n, "W", false), V = asked.weight(4, C.rows(), "V", true);
  asked.charge(n, kDoublings);
  const auto found = solve(A.transpose(), C.transpose(), W, V);
  if (!found)
    asked.refuse_it(
        "A, C and W by which a filter can follow what they show", "no solution",
        hint_of(
            asked, solve, A.transpose(), C.transpose(), W, V, "VW",
            "a mode that does not decay, and that no row of C shows or no noise of W moves? control.poles tells them; leave such states "
            "out"));
  const MatrixXd& P = found->X;
  const MatrixXd gain =
      in_ticks ? symmetric_solve(C * P * C.transpose() + V, MatrixXd(C * P)).transpose().eval() : found->K.transpose().eval();
  push_matrix(L, gain, names_of(column_labels(L, 1)), names_of(row_labels(L, 2)));
  push_matrix(L, P, names_of(column_labels(L, 1)), names_of(column_labels(L, 1)));
  return 2;
}
int kalman(lua_State* L) { return filter(L, "control.kalman", continuous_riccati, false); }
int dkalman(lua_State* L) { return filter(L, "control.dkalman", discrete_riccati, true); }

double period(lua_State* L, int index, const char* function) {
  const double dt = lua_type(L, index) == LUA_TNUMBER ? lua_tonumber(L, index) : std::nan("");
  if (!(dt > 0.0 && std::isfinite(dt))) refuse(L, Code::lua_argument, function, "dt: a time above 0 [s]", describe_value(L, index));
  return dt;
}

/// (A, B, dt, W) -> Ad, Bd, Wd.
int discretise(lua_State* L) {
  const Asked asked{L, "control.discretise"};
  const MatrixXd A = asked.square(1);
  const Index n = A.rows();
  const MatrixXd B = asked.matrix(2, n, kAnySize, "B");
  const double dt = period(L, 3, asked.function);
  const bool noisy = !lua_isnoneornil(L, 4);
  const MatrixXd W = noisy ? asked.weight(4, n, "W", false) : MatrixXd::Zero(n, n);
  asked.charge(n, kDoublings);
  const Discretised step = discretised(A, B, W, dt);
  if (!step.A.allFinite() || !step.B.allFinite() || !step.W.allFinite())
    asked.refuse_it("a system that stays within the range of numbers over dt", "one that overflows", "is dt in seconds?");
  push_matrix(L, step.A, names_of(column_labels(L, 1)), column_labels(L, 1));
  push_matrix(L, step.B, names_of(column_labels(L, 1)), column_labels(L, 2));
  if (!noisy) return 2;
  push_matrix(L, step.W, names_of(column_labels(L, 1)), names_of(column_labels(L, 1)));
  return 3;
}

/// (A, dt): of x' = A x, or with dt of x+ = A x, as the motions that it goes through.
int poles_of(lua_State* L) {
  const Asked asked{L, "control.poles"};
  const MatrixXd A = asked.square(1);
  asked.charge(A.rows(), kEigenvalues);
  push_poles(L, lua_isnoneornil(L, 2) ? operators::poles(A) : operators::poles(A, period(L, 2, asked.function)));
  return 1;
}

/// (A, B, C, D, frequency, dt) -> gain and phase of C (s - A)^-1 B + D at s = i w, with dt at s = exp(i w dt); (s - A) x = B in real
/// numbers.
int response(lua_State* L) {
  const Asked asked{L, "control.response"};
  const MatrixXd A = asked.square(1);
  const Index n = A.rows();
  const MatrixXd B = asked.matrix(2, n, kAnySize, "B"), C = asked.matrix(3, kAnySize, n, "C");
  MatrixXd re = lua_isnoneornil(L, 4) ? MatrixXd::Zero(C.rows(), B.cols()) : asked.matrix(4, C.rows(), B.cols(), "D");
  const double frequency = lua_type(L, 5) == LUA_TNUMBER ? lua_tonumber(L, 5) : std::nan("");
  if (!(frequency >= 0.0 && std::isfinite(frequency))) asked.refuse_it("frequency: a number not below 0 [Hz]", describe_value(L, 5));
  const double w = 2.0 * std::numbers::pi * frequency;
  const std::complex<double> s = lua_isnoneornil(L, 6) ? std::complex(0.0, w) : std::polar(1.0, w * period(L, 6, asked.function));
  asked.charge(2 * n, kFactor);
  MatrixXd both(2 * n, 2 * n), on(2 * n, B.cols());
  const MatrixXd one = MatrixXd::Identity(n, n);
  both << s.real() * one - A, -s.imag() * one, s.imag() * one, s.real() * one - A;
  on << B, MatrixXd::Zero(n, B.cols());
  const MatrixXd x = lu_solve(both, on).x;
  if (!x.allFinite()) asked.refuse_it("a frequency at which the system has a response", fmt::format("{} Hz, that of a pole", frequency));
  re += C * x.topRows(n);
  const MatrixXd im = C * x.bottomRows(n), gain = re.binaryExpr(im, [](double a, double b) { return std::hypot(a, b); }),
                 phase = im.binaryExpr(re, [](double a, double b) { return std::atan2(a, b); });
  for (const MatrixXd& out : {gain, phase}) push_matrix(L, out, names_of(row_labels(L, 3)), names_of(column_labels(L, 2)));
  return 2;
}

}  // namespace

void bind_control(Scenario& s) {
  bind_module(s, "control",
              {{"lqr", lqr, 4},
               {"dlqr", dlqr, 4},
               {"kalman", kalman, 4},
               {"dkalman", dkalman, 4},
               {"discretise", discretise, 4},
               {"poles", poles_of, 2},
               {"response", response, 6}});
}

}  // namespace cardan
