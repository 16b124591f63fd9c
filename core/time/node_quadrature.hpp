#pragma once
// Integrals of rates that are known at the ends of steps alone, for methods whose right-hand side is never evaluated inside a step:
// multistep methods. Each interval is integrated through the polynomial of its neighbours on both sides, of as many of them as make
// it better; the last term that did tells what it may be off by. Nothing here feeds back: steps are what they would be without it.
// docs/mathematics/integration.md, "Integrals".
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

namespace cardan {

class NodeQuadrature {
 public:
  static constexpr std::size_t kPoints = 8;  // of a polynomial: at most

  explicit NodeQuadrature(int n)
      : n_(static_cast<std::size_t>(n)), sum_(n_), end_(n_), error_(n_), end_error_(n_), rates_(stride_ * kHeld), sums_(n_), errors_(n_) {}

  /// Of the present stretch, but for those that have served.
  std::size_t nodes() const { return count_; }

  /// The rates jump at t, which is not after the last node: what follows has nothing to do with what was before.
  void begin_stretch(double t) {
    at(t, end_.data(), end_error_.data());
    begin_stretch_at(end_.data(), end_error_.data());
  }
  /// The same with the integrals up to here and their errors.
  void begin_stretch_at(const double* y, const double* error) {
    std::copy_n(y, n_, sum_.begin());
    std::copy_n(error, n_, error_.begin());
    count_ = done_ = 0;
  }

  /// By which the integrals are off because the rates are.
  void add_error(const double* error) {
    for (std::size_t i = 0; i < n_; ++i) error_[i] += error[i];
  }
  /// The rates at t, after all nodes of this stretch. A step that is nothing beside the one before makes no node: differences over it
  /// would be round-off.
  void add(double t, const double* rates) {
    if (count_ > 1 && t - times_[count_ - 1] < 1e-5 * (times_[count_ - 1] - times_[count_ - 2])) return;
    times_[count_] = t;
    std::copy_n(rates, n_, rates_.begin() + static_cast<std::ptrdiff_t>(stride_ * count_));
    ++count_;
    if (count_ >= kPoints && count_ > done_ + kGroup + kAhead) {
      const double* h = &times_[done_];
      const auto [least, most] = std::minmax({h[1] - h[0], h[2] - h[1], h[3] - h[2]});
      if (most < 2.0 * least) {  // one polynomial for all three
        integrate(done_, done_ + kGroup, times_[done_ + kGroup]);
        for (std::size_t i = 0; i < n_; ++i) sum_[i] += sums_[i], error_[i] += errors_[i];
      } else {
        at(times_[done_ + kGroup], end_.data(), end_error_.data());
        sum_ = end_, error_ = end_error_;
      }
      done_ += kGroup;
    }
    if (count_ < kHeld) return;
    const std::size_t served = done_ - kBehind;
    std::copy(times_.begin() + static_cast<std::ptrdiff_t>(served), times_.end(), times_.begin());
    std::copy(rates_.begin() + static_cast<std::ptrdiff_t>(stride_ * served), rates_.end(), rates_.begin());
    count_ -= served, done_ -= served;
  }

  /// The integrals from the first start to t, which lies in one of the last intervals, at the end of the last or next to it; `error`, which
  /// may be null: what each is off by, by an estimate.
  void at(double t, double* y, double* error) {
    std::copy(sum_.begin(), sum_.end(), y);
    if (error) std::copy(error_.begin(), error_.end(), error);
    for (std::size_t k = done_; k + 1 < count_ && times_[k] < t; ++k) {
      integrate(k, k + 1, k + 2 < count_ ? std::min(t, times_[k + 1]) : t);
      for (std::size_t i = 0; i < n_; ++i) y[i] += sums_[i];
      for (std::size_t i = 0; error && i < n_; ++i) error[i] += errors_[i];
    }
  }

 private:
  static constexpr std::size_t kGroup = 3;   // intervals done at once
  static constexpr std::size_t kAhead = 2;   // nodes beyond them at least
  static constexpr std::size_t kBehind = 5;  // nodes kept before the first that is not done
  static constexpr std::size_t kHeld = kBehind + kGroup + kAhead + 7;
  /// Of the interval: neighbours that are closer to one another tell more of the errors of the rates than of their derivatives, which the
  /// interval multiplies by its length over theirs. Steps that end at an instant of the schedule can be that short.
  static constexpr double kApart = 0.01;
  // Gauss, Legendre: exact up to degree kPoints - 1.
  static constexpr std::array<double, 4> kAbscissae = {-0.8611363115940526, -0.3399810435848563, 0.3399810435848563, 0.8611363115940526};
  static constexpr std::array<double, 4> kWeights = {0.3478548451374538, 0.6521451548625461, 0.6521451548625461, 0.3478548451374538};

  /// sums_ = integral from node k to b, about node m. Newton's polynomial, point by point outwards from the interval; of each
  /// integral the terms while they do not grow: where neighbours are too far to tell, they do. errors_: the last of them; at kinks and
  /// jumps it is right but for a factor of ten.
  void integrate(std::size_t k, std::size_t m, double b) {
    const double a = times_[k], middle = 0.5 * (a + times_[m]), half = 0.5 * (b - a);
    const double apart = kApart * (times_[m] - a);
    std::size_t points = std::min(count_, kPoints);
    std::array<std::size_t, kPoints> node;
    std::array<double, kPoints> at, weight;  // weight: integral of (t - at[0]) .. (t - at[p - 1])
    std::array<std::array<double, kPoints>, kPoints> over;
    std::array<double, 4> basis = {1.0, 1.0, 1.0, 1.0};
    for (std::size_t p = 0, left = k, right = k; p < points; ++p) {  // nodes [left, right] are in use or passed over
      node[p] = k;
      if (p > 0 && right < m) {
        node[p] = ++right;
      } else if (p > 0) {
        std::size_t before = left, after = right + 1;  // the next ones at each side: before - 1 and after
        while (before > 0 && times_[left] - times_[before - 1] < apart) --before;
        while (after < count_ && times_[after] - times_[right] < apart) ++after;
        if (before == 0 && after >= count_) {
          points = p;
          break;
        }
        const bool forwards = before == 0 || (after < count_ && times_[after] - middle < middle - times_[before - 1]);
        node[p] = forwards ? right = after : left = before - 1;
      }
      at[p] = times_[node[p]];
      weight[p] = 0.0;
      for (std::size_t g = 0; g < 4; ++g) {
        if (p > 0) basis[g] *= a + half * (1.0 + kAbscissae[g]) - at[p - 1];
        weight[p] += half * kWeights[g] * basis[g];
      }
      for (std::size_t j = 0; j < p; ++j) over[p][j] = 1.0 / (at[p] - at[p - 1 - j]);
    }
    for (std::size_t block = 0; block < stride_; block += kLanes) {
      using Lanes = std::array<double, kLanes>;
      std::array<Lanes, kPoints> difference;  // divided, of order j in row j, that end at the last point
      Lanes total{}, best{}, before{}, last{}, least;
      least.fill(std::numeric_limits<double>::infinity());
      for (std::size_t p = 0; p < points; ++p) {
        Lanes d;
        std::copy_n(rates_.begin() + static_cast<std::ptrdiff_t>(stride_ * node[p] + block), kLanes, d.begin());
        for (std::size_t j = 0; j < p; ++j)
          for (std::size_t i = 0; i < kLanes; ++i) {
            const double next = (d[i] - difference[j][i]) * over[p][j];
            difference[j][i] = d[i];
            d[i] = next;
          }
        difference[p] = d;
        for (std::size_t i = 0; i < kLanes; ++i) {
          const double term = weight[p] * d[i], size = std::abs(term);
          const double two = std::max(size, before[i]);  // one alone may be zero by chance
          total[i] += term;
          const bool inside = p <= m - k, kept = inside || two <= 10.0 * least[i];
          best[i] = kept ? total[i] : best[i];
          last[i] = kept ? size : last[i];
          before[i] = size;
          if (!inside) least[i] = kept ? std::min(two, least[i]) : -1.0;  // none after one that grew
        }
      }
      std::copy_n(best.begin(), std::min(kLanes, n_ - block), sums_.begin() + static_cast<std::ptrdiff_t>(block));
      std::copy_n(last.begin(), std::min(kLanes, n_ - block), errors_.begin() + static_cast<std::ptrdiff_t>(block));
    }
  }

  static constexpr std::size_t kLanes = 8;
  std::size_t n_, stride_ = (n_ + kLanes - 1) / kLanes * kLanes;  // of them; room for them at a node
  std::vector<double> sum_, end_, error_, end_error_;             // of the intervals before node done_; scratch
  std::array<double, kHeld> times_{};
  std::vector<double> rates_;  // stride_ at each node
  std::size_t count_ = 0, done_ = 0;
  std::vector<double> sums_, errors_;
};

}  // namespace cardan
