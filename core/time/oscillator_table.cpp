#include "core/time/oscillator_table.hpp"

#include <cmath>

namespace cardan {
namespace {

using Complex = std::complex<double>;
constexpr int q = kDegrees;

/// Solves (1 - mu Theta) x = b for several b side by side, Theta the integral of Legendre series cut to n rows, times h: tridiagonal, by
/// elimination with exchange of neighbours.
void solve_integral_equation(Complex mu_h, int n, int columns, std::vector<Complex>& b) {
  struct Row {
    Complex diagonal, next, after;
  };
  std::vector<Row> rows(static_cast<std::size_t>(n));
  const auto entry = [&](int i, int j) { return (i == j ? 1.0 : 0.0) - mu_h * integral_of_legendre(i, j); };
  const auto at = [&](int i, int j) -> Complex& { return b[static_cast<std::size_t>(i * columns + j)]; };
  Row current{entry(0, 0), n > 1 ? entry(0, 1) : 0.0, 0.0};
  for (int i = 0; i + 1 < n; ++i) {
    Row below{entry(i + 1, i), entry(i + 1, i + 1), i + 2 < n ? entry(i + 1, i + 2) : 0.0};
    if (std::abs(below.diagonal) > std::abs(current.diagonal)) {
      std::swap(below, current);
      for (int j = 0; j < columns; ++j) std::swap(at(i, j), at(i + 1, j));
    }
    const Complex factor = below.diagonal / current.diagonal;
    for (int j = 0; j < columns; ++j) at(i + 1, j) -= factor * at(i, j);
    rows[static_cast<std::size_t>(i)] = current;
    current = {below.next - factor * current.next, below.after - factor * current.after, 0.0};
  }
  rows[static_cast<std::size_t>(n - 1)] = current;
  for (int i = n - 1; i >= 0; --i)
    for (int j = 0; j < columns; ++j) {
      const Row& row = rows[static_cast<std::size_t>(i)];
      Complex sum = at(i, j);
      if (i + 1 < n) sum -= row.next * at(i + 1, j);
      if (i + 2 < n) sum -= row.after * at(i + 2, j);
      at(i, j) = sum / row.diagonal;
    }
}

/// What a carrier does by the last degree of its acceleration: the velocity lags by P_q of it, which is a jump at the start and lower
/// degrees. E: what the other degrees do, `swing`: what a unit of alpha at the start does. Times h.
constexpr double kLag = 1.0 / (2.0 * (2 * q - 1));
Complex without_last_degree(const Complex* E, Complex swing, double h) {
  Complex sum = -h * kLag * (q % 2 == 0 ? 1.0 : -1.0) * swing;
  for (int k = q - 3; k >= 0; k -= 2) sum -= (2.0 * k + 1.0) / (2.0 * q - 1.0) * E[k];
  return sum;
}

}  // namespace

Legendre legendre(double s) {
  const double x = 2.0 * s - 1.0;
  Legendre P;
  P[0] = 1.0, P[1] = x;
  for (int i = 1; i < kDegrees; ++i) P[i + 1] = ((2 * i + 1) * x * P[i] - i * P[i - 1]) / (i + 1);
  return P;
}

double Oscillator::damped() const { return frequency * std::sqrt((1.0 - damping) * (1.0 + damping)); }
Complex Oscillator::mu() const { return {-damping * frequency, damped()}; }

OscillatorTable::OscillatorTable(const Oscillator& oscillator, double h) : oscillator_(oscillator), h_(h) {
  constexpr int columns = q + 1;
  const Complex mu = oscillator.mu(), to_force = -mu * mu / oscillator.damped();
  n_ = q + static_cast<int>(std::ceil(0.6 * std::abs(mu) * h)) + 30;
  std::vector<Complex> x(static_cast<std::size_t>(n_ * columns));
  for (int j = 0; j < q; ++j)
    for (int i = std::max(0, j - 1); i <= j + 1; ++i) x[static_cast<std::size_t>(i * columns + j)] = h * integral_of_legendre(i, j);
  x[q] = 1.0;  // e^{mu t}
  solve_integral_equation(mu * h, n_, columns, x);

  std::array<Complex, q> E{};
  rows_.resize(static_cast<std::size_t>(n_ * q));
  for (int i = n_ - 1; i >= 0; --i)
    for (int j = 0; j < q; ++j) {
      const Complex c = x[static_cast<std::size_t>(i * columns + j)];
      rows_[static_cast<std::size_t>(i * q + j)] = c;
      E[static_cast<std::size_t>(j)] += c;
    }
  const Complex of_eta = -std::conj(mu);  // alpha = eta' + of_eta eta
  for (int i = 0; i < q; ++i) {
    const Complex* c = x.data() + i * columns;
    force(i, 0) = (to_force * c[q] * of_eta).imag(), force(i, 1) = (to_force * c[q]).imag();
    for (int j = 0; j < 3; ++j) force(i, 2 + j) = (to_force * c[j]).imag() - (i == j ? 1.0 : 0.0);
    for (int j = 0; j + 1 < q; ++j) force_of_carrier(i, j) = (to_force * c[j]).imag();
    force_of_carrier(i, q - 1) = (to_force * without_last_degree(c, c[q], h)).imag();
  }
  std::array<Complex, kCauses> alpha;  // at h
  const Complex swing = std::exp(mu * h);
  alpha[0] = swing * of_eta, alpha[1] = swing;
  for (std::size_t j = 0; j < 3; ++j) alpha[2 + j] = E[j];
  for (std::size_t j = 0; j + 1 < q; ++j) alpha[5 + j] = E[j];
  alpha[kCauses - 1] = without_last_degree(E.data(), swing, h);
  for (int k = 0; k < kCauses; ++k) {
    const Complex a = alpha[static_cast<std::size_t>(k)];
    end(0, k) = oscillator.eta(a), end(1, k) = oscillator.rate(a);
  }
  end(1, kCauses - 1) += h * kLag;
}

std::array<double, 2> OscillatorTable::inside(double s, const Causes& causes) const {
  const double x = 2.0 * s - 1.0;
  std::array<Complex, q> E{};
  double before = 0.0, P = 1.0;
  for (int i = 0; i < n_; ++i) {
    for (int j = 0; j < q; ++j) E[static_cast<std::size_t>(j)] += rows_[static_cast<std::size_t>(i * q + j)] * P;
    const double next = ((2 * i + 1) * x * P - i * before) / (i + 1);
    before = P, P = next;
  }
  const Complex swing = std::exp(oscillator_.mu() * (s * h_));
  Complex alpha = swing * oscillator_.alpha(causes[0], causes[1]);
  for (std::size_t j = 0; j < 3; ++j) alpha += E[j] * causes[static_cast<Eigen::Index>(2 + j)];
  for (std::size_t j = 0; j + 1 < q; ++j) alpha += E[j] * causes[static_cast<Eigen::Index>(5 + j)];
  alpha += without_last_degree(E.data(), swing, h_) * causes[kCauses - 1];
  return {oscillator_.eta(alpha), oscillator_.rate(alpha) + h_ * kLag * legendre(s)[q] * causes[kCauses - 1]};
}

}  // namespace cardan
