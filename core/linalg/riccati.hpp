#pragma once
// Equations of Riccati and Lyapunov, by which linear feedback and filters are designed, and linear systems between two ticks.
#include <Eigen/Core>
#include <optional>

namespace cardan {

/// X = X* >= 0 for which the closed system is stable, the gain K with which u = -K x closes it, and what is left of the equation, over
/// the sum of its terms.
struct Riccati {
  Eigen::MatrixXd X, K;
  double residual;
};
/// A* X + X A - X B R^-1 B* X + Q = 0, K = R^-1 B* X: least integral of x* Q x + u* R u of x' = A x + B u. Q >= 0 and R > 0 are symmetric.
/// Nothing where no X stabilises: (A, B) has a mode that is not stable and that no input moves, or that Q does not see.
std::optional<Riccati> continuous_riccati(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B, const Eigen::MatrixXd& Q,
                                          const Eigen::MatrixXd& R);
/// X = A* X A - A* X B (R + B* X B)^-1 B* X A + Q, K = (R + B* X B)^-1 B* X A: the least sum of the same of x+ = A x + B u.
std::optional<Riccati> discrete_riccati(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B, const Eigen::MatrixXd& Q,
                                        const Eigen::MatrixXd& R);

/// x' = A x + B u + w with u constant over dt and white noise w of density W: x+ = Ad x + Bd u + wd, the covariance of wd being Wd.
struct Discretised {
  Eigen::MatrixXd A, B, W;
};
Discretised discretised(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B, const Eigen::MatrixXd& W, double dt);

}  // namespace cardan
