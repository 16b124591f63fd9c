#pragma once
// Dense output of a method of one step that has none of its own: Hermite's polynomial of degree 5 through states and rates at the ends of a
// step and the rates at a third and two thirds of it, which are found on those of degree 3 and 4. docs/mathematics/integration.md.
#include <cstddef>
#include <vector>

namespace cardan {

class HermiteOutput {
 public:
  explicit HermiteOutput(std::size_t n) : begin_(n), begin_rate_(n), end_(n), end_rate_(n), bend_(n), skew_(n), near_(n), far_(n), x_(n) {}

  /// State and rate where the step begins; a new step.
  void begin(const std::vector<double>& x, const std::vector<double>& rate) { begin_ = x, begin_rate_ = rate, known_ = false; }
  const std::vector<double>& begin() const { return begin_; }
  std::vector<double>& begin_rate() { return begin_rate_; }
  bool known() const { return known_; }

  /// State and rate where the step of h [s] ends: a cubic.
  void end(const std::vector<double>& x, const std::vector<double>& rate, double h) {
    end_ = x, end_rate_ = rate, h_ = h;
    bend_.assign(bend_.size(), 0.0), skew_.assign(skew_.size(), 0.0);
  }
  /// `rate_at(s, x, xdot)`: the rate at the share s of the step, from x, which it may project; false where there is none: then the degree
  /// stays what it is.
  template <class Rate>
  void complete(const Rate& rate_at) {
    known_ = true;
    const auto beyond_cubic = [&](double s, std::vector<double>& slope) {
      at(s, x_.data());
      if (!rate_at(s, x_.data(), slope.data())) return false;
      for (std::size_t i = 0; i < slope.size(); ++i)
        slope[i] = h_ * slope[i] - 6.0 * s * (1.0 - s) * (end_[i] - begin_[i]) -
                   h_ * ((1.0 - s) * (1.0 - 3.0 * s) * begin_rate_[i] + s * (3.0 * s - 2.0) * end_rate_[i]);
      return true;
    };
    if (!beyond_cubic(2.0 / 3.0, far_)) return;
    for (std::size_t i = 0; i < bend_.size(); ++i) bend_[i] = -27.0 / 4.0 * far_[i];
    if (!beyond_cubic(1.0 / 3.0, near_) || !beyond_cubic(2.0 / 3.0, far_)) return;
    for (std::size_t i = 0; i < bend_.size(); ++i) {
      skew_[i] = 81.0 / 4.0 * (near_[i] + far_[i]);
      bend_[i] = 27.0 / 4.0 * near_[i] - 2.0 / 3.0 * skew_[i];
    }
  }

  /// The state at the share s of the step.
  void at(double s, double* x) const {
    const double w = s * s * (1.0 - s) * (1.0 - s);
    for (std::size_t i = 0; i < begin_.size(); ++i)
      x[i] = begin_[i] + s * s * (3.0 - 2.0 * s) * (end_[i] - begin_[i]) +
             h_ * s * (1.0 - s) * ((1.0 - s) * begin_rate_[i] - s * end_rate_[i]) + w * (bend_[i] + s * skew_[i]);
  }

 private:
  std::vector<double> begin_, begin_rate_, end_, end_rate_;
  std::vector<double> bend_, skew_;     // s^2 (1 - s)^2 (bend + s skew) beyond the cubic one
  std::vector<double> near_, far_, x_;  // scratch
  double h_ = 0.0;                      // [s]
  bool known_ = false;                  // the end is
};

}  // namespace cardan
