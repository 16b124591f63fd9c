#pragma once
// One damped oscillator in closed form through a step, driven by polynomials of time: eta'' + 2 zeta omega eta' + omega^2 eta = F(t).
// As one complex number alpha = eta' - conj(mu) eta, alpha' = mu alpha + F, mu = -zeta omega + i omega sqrt(1 - zeta^2):
// docs/mathematics/exponential.md, 3.
#include <Eigen/Core>
#include <array>
#include <complex>
#include <vector>

namespace cardan {

/// Polynomials of a step [0, h] are sums of Legendre's P_0 ... P_{kDegrees - 1} of 2 t/h - 1.
inline constexpr int kDegrees = 6;
using Legendre = std::array<double, kDegrees + 1>;  // values of P_0 ... P_kDegrees

/// P_i at the fraction s of the step, 0 to 1.
Legendre legendre(double s);
/// Of the integral of P_j from the start of the step, over h: the polynomials i = j - 1 and j + 1 have a part (0 and 1 for j = 0).
constexpr double integral_of_legendre(int i, int j) {
  if (i == j) return j == 0 ? 0.5 : 0.0;
  return i == j + 1 ? 0.5 / (2 * j + 1) : i == j - 1 ? -0.5 / (2 * j + 1) : 0.0;
}

struct Oscillator {
  double frequency = 0.0;  // [rad/s] omega > 0
  double damping = 0.0;    // [-] zeta, 0 <= zeta < 1
  double damped() const;   // [rad/s] Im mu
  std::complex<double> mu() const;
  std::complex<double> alpha(double eta, double rate) const { return rate - std::conj(mu()) * eta; }
  double eta(std::complex<double> alpha) const { return alpha.imag() / damped(); }
  double rate(std::complex<double> alpha) const { return (mu() * alpha).imag() / damped(); }
};

/// An oscillator over a step of h [s], from eta and eta' at its start. It is driven by a force F = sum_j F_j P_j, j < 3, and carried along
/// by accelerations a_j P_j: it follows the part of that velocity below degree kDegrees, which keeps the energy of the whole (3.2).
class OscillatorTable {
 public:
  OscillatorTable(const Oscillator& oscillator, double h);

  /// omega^2 eta + 2 zeta omega eta' - F is the sum over i of row i of `force` times (eta, eta', F_0, F_1, F_2) P_i, but for what the
  /// carrier does ...
  Eigen::Matrix<double, kDegrees, 5> force;
  /// ... force_of_carrier(i, j) P_i, where the force on the mode is P_j.
  Eigen::Matrix<double, kDegrees, kDegrees> force_of_carrier;
  /// eta and eta' at h from (eta, eta', F_0, F_1, F_2, forces by the carrier of degree 0 ... kDegrees - 1).
  static constexpr int kCauses = 5 + kDegrees;
  using Causes = Eigen::Matrix<double, kCauses, 1>;
  Eigen::Matrix<double, 2, kCauses> end;
  /// The same at the fraction s of the step.
  std::array<double, 2> inside(double s, const Causes& causes) const;

 private:
  using Complex = std::complex<double>;
  Oscillator oscillator_;
  double h_;
  int n_;
  std::vector<Complex> rows_;  // n_ rows of kDegrees: E_j(t) = sum_i rows[i][j] P_i
};

}  // namespace cardan
