#pragma once
// One damped oscillator in closed form through a step, driven by polynomials of time: eta'' + 2 zeta omega eta' + omega^2 eta = F(t).
// As one complex number alpha = eta' - conj(mu) eta, alpha' = mu alpha + F, mu = -zeta omega + i omega sqrt(1 - zeta^2):
// docs/mathematics/exponential.md, 3.
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

/// An oscillator over a step of h [s]. `driven` by a force F = P_j, or `coupled` to an acceleration P_j of what carries it: it follows
/// the part of that velocity below degree kDegrees, which keeps the energy of the whole (3.2).
class OscillatorTable {
 public:
  using Complex = std::complex<double>;
  OscillatorTable(const Oscillator& oscillator, double h);

  Complex decay;                                  // e^{mu h}
  std::array<Complex, kDegrees> driven, coupled;  // alpha at h
  std::array<Complex, kDegrees> free_force;       // omega^2 eta + 2 zeta omega eta' = Im(free_force[i] alpha_0) P_i
  double force_of_drive[kDegrees][3];             // the same of F = P_0, P_1, P_2: [i][j] P_i
  double force_of_coupling[kDegrees][kDegrees];   // ... of a unit acceleration P_j
  static double jump(double h) {
    return h / (2.0 * (2 * kDegrees - 1));
  }  // eta' lags what carries it by this times P_kDegrees of its last coefficient

  /// alpha at a time of the step from start, drive and coupling coefficients.
  Complex inside(double s, Complex alpha_0, const double* drive, const double* coupling) const;

 private:
  Oscillator oscillator_;
  double h_;
  int n_;
  std::vector<Complex> rows_;  // n_ rows of kDegrees: E_j(t) = sum_i rows[i][j] P_i
};

}  // namespace cardan
