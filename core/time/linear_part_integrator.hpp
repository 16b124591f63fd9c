#pragma once
// What the methods that advance a linear part in closed form have in common: f is L x + N, N a polynomial of the step through its values at
// stages. Their own are the stages, try_step(). docs/mathematics/exponential.md.
#include <fmt/format.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <limits>

#include "core/time/event_finder.hpp"
#include "core/time/methods.hpp"

namespace cardan {

class LinearPartIntegrator : public Integrator {
 public:
  LinearPartIntegrator(OdeProblem problem, const IntegratorOptions& options, int order)
      : problem_(std::move(problem)),
        part_(problem_.linear(options.method)),
        linear_(*part_),
        n_(problem_.n),
        n_y_(problem_.n_quadrature),
        options_(options),
        order_(order),
        events_(problem_),
        absolute_(Eigen::Map<const Eigen::ArrayXd>(problem_.absolute_tolerance.data(), n_)) {
    const std::vector<double> weights = group_weights(problem_.group);
    weight_ = Eigen::Map<const Eigen::ArrayXd>(weights.data(), static_cast<Eigen::Index>(weights.size()));
    for (Eigen::ArrayXd* x : {&z0_, &z1_, &stage_, &xdot_, &share_, &size_, &size_1_}) x->setZero(n_);
    for (Eigen::ArrayXd* r : {&r_n_, &r_1_, &r_2_, &zero_}) r->setZero(linear_.size());
    for (Eigen::ArrayXd& g : g_) g.setZero(n_y_);
    y0_.setZero(n_y_), y1_.setZero(n_y_), y_error_.setZero(n_y_);
  }

  void restart(double t, const double* x) override {
    if (!started_ || t != t1_) h_ = options_.initial_step;
    started_ = true;
    integrals(t1_, y1_.data(), nullptr);
    t0_ = t1_ = t;
    std::copy_n(x, n_, z1_.data());
    if (problem_.n_roots > 0) events_.restart(t, z1_.data());
    tries_ = kTries;
    ++statistics_.restarts;
  }

  StepReport step(double t_stop, double* x) override {
    StepReport report;
    if (t1_ < t_stop) {
      begin();
      if (++statistics_.steps % kLooks == 0) look_at_rounding(report);
      do report.limit = adaptive_step(t_stop);
      while (problem_.n_roots > 0 && !find_event(report));
      if (n_y_ > 0) y_error_ += step_ * error_of_integrals(report.event);
      tries_ = 0;
      if (report.event) report.limit = StepLimit::stop;
      statistics_.last_step = t1_ - t0_;
    }
    report.t = t1_;
    report.order = order_;
    std::copy_n(z1_.data(), n_, x);
    return report;
  }

  void interpolate(double t, double* x) override {
    if (t == t1_) return void(std::copy_n(z1_.data(), n_, x));
    inside(t, x);
  }

  /// Through the rates at the start, the middle and the end.
  void integrals(double t, double* y, double* error) override {
    if (error) std::copy_n(y_error_.data(), n_y_, error);
    Eigen::Map<Eigen::ArrayXd> out(y, n_y_);
    const double h = step_, s = h > 0.0 ? (t - t0_) / h : 0.0;
    if (t0_ == t1_) return void(out = y1_);
    out = y0_ + h * s * (g_[0] + s * ((-1.5 * g_[0] + 2.0 * g_[1] - 0.5 * g_[2]) + s / 3.0 * (2.0 * g_[0] - 4.0 * g_[1] + 2.0 * g_[2])));
  }

  void remember(Archive& archive) override {
    const auto n = static_cast<std::size_t>(n_y_);
    archive(h_, statistics_, std::span(y1_.data(), n), std::span(y_error_.data(), n), events_);
    linear_.remember(archive);
  }

  IntegratorStatistics statistics() const override {
    IntegratorStatistics s = statistics_;
    s.root_evaluations = events_.evaluations();
    s.last_order = order_;
    return s;
  }

  int worst() const override { return worst_; }

 protected:
  static constexpr double kNever = std::numeric_limits<double>::infinity();

  /// Stages of the step of h [s] to t1 from z0_, where N is r_n_: z1_ and rates of the integrals. Returns the estimated error, 1 = what is
  /// allowed, kNever where a stage cannot be evaluated.
  virtual double stages(double t1, double h) = 0;
  /// Of the estimate of the error, over that of N, a step long: what their weights make of the values at the stages.
  virtual double noise() const = 0;
  /// How many times as long as the last step the next one may be.
  virtual double growth(double error) const { return 0.9 * std::pow(error, -1.0 / order_); }
  /// Of the step just done, over its length; of integrals that end inside of it.
  virtual Eigen::ArrayXd& error_of_integrals(bool inside) = 0;

  /// N at (t, z) and the rates of the integrals, the `place`th.
  bool rest(double t, const Eigen::ArrayXd& z, std::size_t place, Eigen::ArrayXd& r) {
    if (!rates(t, z, place)) return false;
    linear_.residual(z.data(), xdot_.data(), r.data());
    return true;
  }

  /// xdot_ at (t, z) and the rates of the integrals.
  bool rates(double t, const Eigen::ArrayXd& z, std::size_t place) {
    ++statistics_.rhs_calls;
    bad_ = -1;
    const bool known = problem_.rhs(t, z.data(), xdot_.data());
    if (!known || !all_finite(xdot_.data(), n_)) return bad_ = first_not_finite(xdot_.data(), n_), false;
    if (n_y_ > 0) {
      ++statistics_.integrand_calls;
      problem_.integrands(t, z.data(), g_[place].data());
    }
    return true;
  }

  /// r_1_, r_2_: the polynomial r_n_ + r_1_ s + r_2_ s^2 through the values at the start, the middle and the end.
  void through(const Eigen::ArrayXd& middle, const Eigen::ArrayXd& end) {
    r_1_ = -3.0 * r_n_ + 4.0 * middle - end;
    r_2_ = 2.0 * (r_n_ - 2.0 * middle + end);
  }

  double norm(const auto& value) {
    if (n_ == 0) return 0.0;
    share_ = value / (absolute_ + options_.relative_tolerance * size_.max(size_1_));
    if (weight_.size() != 0) share_ *= weight_;
    return std::sqrt(share_.square().mean());
  }

  OdeProblem problem_;
  std::shared_ptr<LinearPart> part_;
  LinearPart& linear_;
  int n_, n_y_;
  double t0_ = 0.0, t1_ = 0.0, step_ = 0.0;  // [s] begin and end of the last step; its length, which an event ended earlier
  Eigen::ArrayXd z0_, z1_, stage_, xdot_, share_, size_, size_1_;  // states; share_: of each in the last error
  Eigen::ArrayXd r_n_, r_1_, r_2_, zero_;                          // N at the start; polynomials of it
  std::array<Eigen::ArrayXd, 3> g_;                                // rates of the integrals at the start, the middle and the end
  IntegratorStatistics statistics_;

 private:
  std::string trouble() const {
    if (bad_ >= 0) return fmt::format("the rate of state {} is {}", bad_, xdot_[bad_]);
    return "the right-hand side cannot be evaluated";
  }

  void begin() {
    integrals(t1_, y1_.data(), nullptr);
    y0_ = y1_;
    t0_ = t1_;
    z0_.swap(z1_);
    if (!rates(t0_, z0_, 0))
      fail_integration(Code::integrator_failed, t0_, bad_ < 0 ? "the right-hand side cannot be evaluated at the start" : trouble(), {});
    linear_.centre(t0_, z0_.data(), xdot_.data());
    linear_.residual(z0_.data(), xdot_.data(), r_n_.data());
    linear_.sizes(z0_.data(), size_.data());
  }

  /// By a step as long as the last one.
  void look_at_rounding(StepReport& report) {
    for (int i = 0; i < n_; ++i) stage_[i] = moved_by_digits(z0_[i], i);
    if (n_ == 0 || !problem_.rhs(t0_, stage_.data(), xdot_.data())) return;
    linear_.residual(stage_.data(), xdot_.data(), r_1_.data());
    r_1_ -= r_n_;
    linear_.effect(statistics_.last_step, {r_1_.data(), zero_.data(), zero_.data()}, stage_.data());
    const double rounding = kLostOfMoved * noise() * norm(stage_);
    if (!(rounding > kMuchRounding)) return;
    report.rounding = rounding;
    report.rounded = largest_of(share_.data(), n_);
  }

  /// Steps that fit a whole number of times into what is left, halved or doubled: what belongs to a length of step is used again.
  double fitting(double wanted, double left) const {
    if (wanted >= left * (1.0 - 1e-9)) return left;
    const double last = statistics_.last_step, times = std::round(left / last);
    if (last > 0.0 && std::abs(left - times * last) <= 1e-9 * left) {
      double h = last;
      while (h > wanted * (1.0 + 1e-9)) h *= 0.5;
      for (double n = times; 2.0 * h <= wanted * (1.0 + 1e-9) && std::fmod(n, 2.0) == 0.0; n *= 0.5) h *= 2.0;
      return h;
    }
    return left * std::exp2(-std::ceil(std::log2(left / wanted) - 1e-9));
  }

  StepLimit adaptive_step(double t_stop) {
    constexpr int max_rejections = 40;
    const double left = t_stop - t0_;
    if (!(h_ > 0.0)) h_ = std::min(left, 1.0);
    worst_ = -1;
    for (int rejections = 0;; ++rejections) {
      const double longest = options_.max_step > 0.0 ? std::min(options_.max_step, linear_.longest_step()) : linear_.longest_step();
      h_ = std::min(h_, longest);
      const double h = fitting(h_, left);
      t1_ = h == left ? t_stop : t0_ + h, step_ = h;
      const double error = stages(t1_, h);
      const double factor = std::clamp(growth(error), 0.2, 4.0);
      if (error <= 1.0) {
        const bool is_longest = h_ == longest, cut = h_ > left;
        const double next = h * (rejections > 0 ? std::min(factor, 1.0) : factor);
        h_ = h < h_ ? std::max(next, h_) : next;
        statistics_.error_sum += error;
        if (problem_.project) problem_.project(t1_, z1_.data());
        if (rejections > 0) return worst_ >= 0 ? StepLimit::error : StepLimit::given;
        if (cut || is_longest) return cut ? StepLimit::stop : StepLimit::given;
        worst_ = largest_of(share_.data(), n_);
        return worst_ >= 0 ? StepLimit::error : StepLimit::given;
      }
      worst_ = std::isfinite(error) ? largest_of(share_.data(), n_) : -1;
      count_rejection(statistics_.rejected, problem_, worst_);
      h_ = h * (error > 1.0 && factor < 1.0 ? std::max(factor, 0.25) : 0.25);
      if (rejections == max_rejections || h_ < 16.0 * std::numeric_limits<double>::epsilon() * std::abs(t0_))
        fail_integration(
            Code::step_too_small, t0_,
            fmt::format("step = {:.3g} s after {} rejections: {}", h_, rejections + 1,
                        std::isfinite(error) ? fmt::format("the error is {:.3g} times what the tolerances allow", error) : trouble()),
            "a discontinuity that is no event, a singularity, or a fast motion that is not linear: dopri5, cvode_bdf");
    }
  }

  void inside(double t, double* x) {
    linear_.inside((t - t0_) / step_, x);
    if (problem_.project) problem_.project(t, x);
  }

  /// false: the length of the first step after a start is none of what acts now, and its stages may have gone past something as short as a
  /// contact; h_ is a part of the way to the event now.
  bool find_event(StepReport& report) {
    const auto state_at = [this](double t) {
      if (t == t1_) return z1_.data();
      inside(t, stage_.data());
      return stage_.data();
    };
    double t = t1_;
    if (!events_.find(t, state_at)) return true;
    if (t < t1_ && t - t0_ > 1e-6 * (t1_ - t0_) && tries_ > 0) {
      --tries_;
      h_ = 0.25 * (t - t0_);
      events_.take_back();
      return false;
    }
    report.event = true;
    report.crossed = events_.crossed();
    if (t == t1_) return true;
    inside(t, z1_.data());
    integrals(t, y1_.data(), nullptr);
    t1_ = t;
    statistics_.error_sum += 1.0;  // the error of the step is that of its end
    return true;
  }

  static constexpr int kTries = 8;
  static constexpr long kLooks = 1000;  // steps to each at which rounding is looked at

  IntegratorOptions options_;
  int order_;
  EventFinder events_;
  double h_ = 0.0;  // [s] the next step to try
  int worst_ = -1;  // state: of the last step or rejection
  int tries_ = 0;   // that are left for the first step after a start
  bool started_ = false;
  int bad_ = -1;                      // state whose rate was no number in the last evaluation
  Eigen::ArrayXd y0_, y1_, y_error_;  // integrals; what they may be off by
  Eigen::ArrayXd absolute_, weight_;
};

}  // namespace cardan
