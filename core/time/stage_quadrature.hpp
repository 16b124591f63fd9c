#pragma once
// Integrals of rates by the weights of a Runge-Kutta method whose stages another program asks for: of evaluations at one time in a row the
// last counts, of those before the end of a step as many as the method has stages. docs/mathematics/integration.md, "Integrals".
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace cardan {

class StageQuadrature {
 public:
  /// n integrals; b, c: weights and places of all stages, the first at the start of the step, of a method of this order, 5 or 6.
  StageQuadrature(int n, std::vector<double> b, const std::vector<double>& c, int order)
      : n_(static_cast<std::size_t>(n)),
        one_more_(order == 5),
        b_(std::move(b)),
        begin_(n_),
        sum_(n_),
        error_(n_),
        error_before_(n_),
        start_(n_),
        end_(n_) {
    before_ = third_ = two_thirds_ = sum_;
    noted_.resize(n_ * (b_.size() - 1));
    for (std::size_t s = 1; s < b_.size(); ++s)
      if (std::abs(c[s] - 0.5) < std::abs(c[middle_] - 0.5)) middle_ = s;
    const double m = c[middle_];
    three_ = {0.0, 1.0 / (6.0 * m * (1.0 - m)), (2.0 - 3.0 * m) / (6.0 * (1.0 - m))};
    three_[0] = 1.0 - three_[1] - three_[2];
  }

  void set(const double* y, const double* error) {
    std::copy_n(y, n_, sum_.begin());
    std::copy_n(error, n_, error_.begin());
  }
  void set_sum(const std::vector<double>& y) { sum_ = y; }
  /// Rates where the next step starts, and at the end of the one just done.
  double* start() { return start_.data(); }
  double* end() { return end_.data(); }
  /// Where the rates of a stage at t go.
  double* stage(double t) {
    if (t != noted_t_) last_ = (last_ + 1) % (b_.size() - 1);
    noted_t_ = t;
    return noted_.data() + n_ * last_;
  }
  /// A step of h is done, the rates at its end are known.
  void step(double h) {
    begin_ = sum_, error_before_ = error_;
    for (std::size_t i = 0; i < n_; ++i) {
      const auto rate = [&](std::size_t stage) {
        return noted_[n_ * ((last_ + stage) % (b_.size() - 1)) + i];
      };  // after the last: the oldest
      double by = b_[0] * start_[i];
      for (std::size_t stage = 1; stage < b_.size(); ++stage) by += b_[stage] * rate(stage);
      sum_[i] += h * by;
      // A rule of three points tells the error of its order, 4; how much that is below the trapezium's tells what two orders gain. States
      // at stages are of a lower order than the step: the weights of the method make up for it, to its order and no further.
      const double lower = h * std::abs(by - three_[0] * start_[i] - three_[1] * rate(middle_) - three_[2] * end_[i]);
      const double trapezium = 0.5 * h * std::abs(end_[i] - start_[i]);
      const double two_more = lower < trapezium ? lower / trapezium : 1.0;
      error_[i] += lower * (one_more_ ? std::sqrt(two_more) : two_more);
    }
    before_ = start_;
    start_ = end_;
    h_ = h;
    noted_t_ = std::numeric_limits<double>::quiet_NaN();
  }
  /// It has not been; start() is not known.
  void take_back() { sum_ = begin_, error_ = error_before_; }
  /// Where the rates at one and at two thirds of the last step go, for inside().
  double* third() { return third_.data(); }
  double* two_thirds() { return two_thirds_.data(); }
  /// They are not known: between those of the ends.
  void guess_inside() {
    for (std::size_t i = 0; i < n_; ++i)
      third_[i] = (2.0 * before_[i] + end_[i]) / 3.0, two_thirds_[i] = (before_[i] + 2.0 * end_[i]) / 3.0;
  }
  /// At the share s of the last step, by the polynomial through these and the ends; what the stages know better is spread evenly.
  void inside(double s, double* y) const {
    const auto at = [](double u) -> std::array<double, 4> {  // integrals of Lagrange's polynomials
      return {u * (1.0 + u * (-11.0 / 4.0 + u * (3.0 - u * 9.0 / 8.0))), u * u * (9.0 / 2.0 + u * (-15.0 / 2.0 + u * 27.0 / 8.0)),
              u * u * (-9.0 / 4.0 + u * (6.0 - u * 27.0 / 8.0)), u * u * (1.0 / 2.0 + u * (-3.0 / 2.0 + u * 9.0 / 8.0))};
    };
    const std::array<double, 4> here = at(s), all = at(1.0);
    for (std::size_t i = 0; i < n_; ++i) {
      const auto through = [&](const std::array<double, 4>& w) {
        return h_ * (w[0] * before_[i] + w[1] * third_[i] + w[2] * two_thirds_[i] + w[3] * end_[i]);
      };
      y[i] = begin_[i] + through(here) + s * (sum_[i] - begin_[i] - through(all));
    }
  }
  const std::vector<double>& sum() const { return sum_; }
  const std::vector<double>& error() const { return error_; }

 private:
  std::size_t n_;
  bool one_more_;  // order than the rule that tells the error
  std::vector<double> b_;
  std::size_t middle_ = 0;         // of the stages
  std::array<double, 3> three_{};  // weights at the start, there and at the end
  std::vector<double> begin_, sum_, error_, error_before_, start_, end_, noted_, before_, third_, two_thirds_;
  double h_ = 0.0;  // [s]
  std::size_t last_ = 0;
  double noted_t_ = std::numeric_limits<double>::quiet_NaN();  // [s]
};

}  // namespace cardan
