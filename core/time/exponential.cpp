// An exponential Runge-Kutta method of order 3 (ETD3RK: Cox & Matthews 2002, J. Comput. Phys. 176): the linear part that the problem
// tells is advanced in closed form, three evaluations of f give what is left, a polynomial of the step. docs/mathematics/exponential.md.
#include <fmt/format.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <limits>

#include "core/time/event_finder.hpp"
#include "core/time/methods.hpp"

namespace cardan {
namespace {

class Exponential final : public Integrator {
 public:
  Exponential(OdeProblem problem, const IntegratorOptions& options)
      : problem_(std::move(problem)),
        options_(options),
        linear_(*problem_.linear),
        events_(problem_),
        n_(problem_.n),
        n_y_(problem_.n_quadrature),
        absolute_(Eigen::Map<const Eigen::ArrayXd>(problem_.absolute_tolerance.data(), n_)) {
    const std::vector<double> weights = group_weights(problem_.group);
    weight_ = Eigen::Map<const Eigen::ArrayXd>(weights.data(), static_cast<Eigen::Index>(weights.size()));
    for (Eigen::ArrayXd* x : {&z0_, &z1_, &stage_, &xdot_, &e_, &share_, &size_, &size_1_}) x->setZero(n_);
    for (Eigen::ArrayXd* r : {&r_n_, &r_a_, &r_b_, &r_1_, &r_2_, &zero_}) r->setZero(linear_.size());
    for (Eigen::ArrayXd& g : g_) g.setZero(n_y_);
    y0_.setZero(n_y_), y1_.setZero(n_y_);
  }

  void restart(double t, const double* x) override {
    if (!started_ || t != t1_) h_ = options_.initial_step;
    started_ = true;
    integrals(t1_, y1_.data(), nullptr);
    t0_ = t1_ = t;
    std::copy_n(x, n_, z1_.data());
    if (problem_.n_roots > 0) events_.restart(t, z1_.data());
    ++statistics_.restarts;
  }

  StepReport step(double t_stop, double* x) override {
    StepReport report;
    if (t1_ < t_stop) {
      begin();
      ++statistics_.steps;
      report.limit = adaptive_step(t_stop);
      if (problem_.n_roots > 0) find_event(report);
      if (report.event) report.limit = StepLimit::stop;
      statistics_.last_step = t1_ - t0_;
    }
    report.t = t1_;
    report.order = kOrder;
    std::copy_n(z1_.data(), n_, x);
    return report;
  }

  void interpolate(double t, double* x) override {
    if (t == t1_) return void(std::copy_n(z1_.data(), n_, x));
    inside(t, x);
  }

  /// Through the rates at the start, the middle and the end.
  void integrals(double t, double* y, double* error) override {
    if (error) std::fill_n(error, n_y_, 0.0);
    Eigen::Map<Eigen::ArrayXd> out(y, n_y_);
    const double h = step_, s = h > 0.0 ? (t - t0_) / h : 0.0;
    if (t0_ == t1_) return void(out = y1_);
    out = y0_ + h * s * (g_[0] + s * ((-1.5 * g_[0] + 2.0 * g_[1] - 0.5 * g_[2]) + s / 3.0 * (2.0 * g_[0] - 4.0 * g_[1] + 2.0 * g_[2])));
  }

  void remember(Archive& archive) override {
    archive(h_, statistics_, std::span(y1_.data(), static_cast<std::size_t>(n_y_)), events_);
    linear_.remember(archive);
  }

  IntegratorStatistics statistics() const override {
    IntegratorStatistics s = statistics_;
    s.root_evaluations = events_.evaluations();
    s.last_order = kOrder;
    return s;
  }

  int worst() const override { return worst_; }

  std::string_view name() const override { return "exponential"; }

 private:
  static constexpr int kOrder = 3;

  bool rhs(double t, const Eigen::ArrayXd& z, int stage, Eigen::ArrayXd& r) {
    ++statistics_.rhs_calls;
    bad_ = -1;
    const bool known = problem_.rhs(t, z.data(), xdot_.data());
    if (!known || !all_finite(xdot_.data(), n_)) return bad_ = first_not_finite(xdot_.data(), n_), false;
    if (n_y_ > 0) {
      ++statistics_.integrand_calls;
      problem_.integrands(t, z.data(), g_[static_cast<std::size_t>(stage)].data());
    }
    linear_.residual(z.data(), xdot_.data(), r.data());
    return true;
  }

  std::string trouble() const {
    if (bad_ >= 0) return fmt::format("the rate of state {} is {}", bad_, xdot_[bad_]);
    return "the right-hand side cannot be evaluated";
  }

  void begin() {
    integrals(t1_, y1_.data(), nullptr);
    y0_ = y1_;
    t0_ = t1_;
    z0_.swap(z1_);
    linear_.centre(t0_, z0_.data());
    if (!rhs(t0_, z0_, 0, r_n_))
      fail_integration(Code::integrator_failed, t0_, bad_ < 0 ? "the right-hand side cannot be evaluated at the start" : trouble(), {});
    linear_.sizes(z0_.data(), size_.data());
  }

  double norm(const auto& value) {
    if (n_ == 0) return 0.0;
    share_ = value / (absolute_ + options_.relative_tolerance * size_.max(size_1_));
    if (weight_.size() != 0) share_ *= weight_;
    return std::sqrt(share_.square().mean());
  }

  /// The estimated error of the step, 1 = what is allowed; infinite where a stage cannot be evaluated.
  double try_step(double t1, double h) {
    constexpr double never = std::numeric_limits<double>::infinity();
    t1_ = t1, step_ = h;
    linear_.advance(0.5 * h, {r_n_.data(), zero_.data(), zero_.data()}, stage_.data());
    if (!rhs(t0_ + 0.5 * h, stage_, 1, r_a_)) return never;
    r_1_ = 2.0 * r_a_ - r_n_;
    linear_.advance(h, {r_1_.data(), zero_.data(), zero_.data()}, stage_.data());
    if (!rhs(t1, stage_, 2, r_b_)) return never;
    linear_.sizes(stage_.data(), size_1_.data());
    // The method of order 2 on the same last stage is apart by r_2 (s^2 - s).
    r_2_ = 2.0 * (r_n_ - 2.0 * r_a_ + r_b_), r_1_ = -r_2_;
    linear_.effect(h, {zero_.data(), r_1_.data(), r_2_.data()}, e_.data());
    linear_.leave_out(h, e_.data());
    const double error = norm(e_);
    r_1_ = -3.0 * r_n_ + 4.0 * r_a_ - r_b_;
    linear_.advance(h, {r_n_.data(), r_1_.data(), r_2_.data()}, z1_.data());
    return all_finite(z1_.data(), n_) && std::isfinite(error) ? error : never;
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
      const double error = try_step(h == left ? t_stop : t0_ + h, h);
      const double factor = std::clamp(0.9 * std::pow(error, -1.0 / 3), 0.2, 4.0);
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

  void find_event(StepReport& report) {
    const auto state_at = [this](double t) {
      if (t == t1_) return z1_.data();
      inside(t, stage_.data());
      return stage_.data();
    };
    double t = t1_;
    if (!events_.find(t, state_at)) return;
    report.event = true;
    report.crossed = events_.crossed();
    if (t == t1_) return;
    inside(t, z1_.data());
    integrals(t, y1_.data(), nullptr);
    t1_ = t;
  }

  OdeProblem problem_;
  IntegratorOptions options_;
  LinearPart& linear_;
  EventFinder events_;
  int n_, n_y_;
  double t0_ = 0.0, t1_ = 0.0, step_ = 0.0;  // [s] begin and end of the last step; its length, which an event ended earlier
  double h_ = 0.0;                           // [s] the next step to try
  int worst_ = -1;                           // state: of the last step or rejection
  bool started_ = false;
  int bad_ = -1;                                                       // state whose rate was no number in the last evaluation
  Eigen::ArrayXd z0_, z1_, stage_, xdot_, e_, share_, size_, size_1_;  // states; share_: of each in the last error
  Eigen::ArrayXd r_n_, r_a_, r_b_, r_1_, r_2_, zero_;                  // residuals of the stages; polynomials of them
  std::array<Eigen::ArrayXd, 3> g_;                                    // rates of the integrals
  Eigen::ArrayXd y0_, y1_;                                             // integrals
  Eigen::ArrayXd absolute_, weight_;
  IntegratorStatistics statistics_;
};

}  // namespace

std::unique_ptr<Integrator> make_exponential(OdeProblem problem, const IntegratorOptions& options) {
  return std::make_unique<Exponential>(std::move(problem), options);
}

}  // namespace cardan
