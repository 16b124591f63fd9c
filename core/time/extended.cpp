// Steps in more digits than those of a double (ExtendedMotion): how long they are, events, what a run asks of a method beside.
// docs/mathematics/extended.md.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/time/event_finder.hpp"
#include "core/time/methods.hpp"

namespace cardan {
namespace {

constexpr int kGood = 20;  // an order that a step may need: one that needs less is short ...
constexpr int kHigh = 24;  // ... one that needs more is long
constexpr double kLonger = 1.5, kShorter = 0.7;
constexpr double kFirst = 1e-2;  // [s] of the first trial, where nothing is known

class Extended final : public Integrator {
 public:
  Extended(OdeProblem problem, const IntegratorOptions& options)
      : problem_(std::move(problem)), options_(options), motion_(*problem_.extended), events_(problem_) {
    for (std::vector<double>* x : {&x0_, &x1_, &x_}) x->resize(static_cast<std::size_t>(problem_.n + problem_.n_quadrature));
    off_.resize(static_cast<std::size_t>(problem_.n_quadrature));
    next_ = options.initial_step > 0.0 ? options.initial_step : kFirst;
  }

  void restart(double t, const double* x) override {
    t0_ = t1_ = t;
    std::copy_n(x, problem_.n, x1_.begin());
    take();
    motion_.enter(t, x1_.data());
    if (problem_.n_roots > 0) events_.restart(t, x1_.data());
    ++statistics_.restarts;
  }

  StepReport step(double t_stop, double* x) override {
    StepReport report;
    if (t1_ < t_stop) {
      begin();
      report.limit = StepLimit::error;
      const double most = options_.max_step > 0.0 ? options_.max_step : std::numeric_limits<double>::infinity();
      double h = std::min(next_, most);
      if (h == most) report.limit = StepLimit::given;
      bool shortened = false;
      for (;;) {
        const double left = t_stop - t0_;
        const bool to_the_end = h >= left * (1.0 - 1e-12);
        const double t1 = to_the_end ? t_stop : std::min(t0_ + (left < 2.0 * h ? 0.5 * left : h), t_stop);
        if (!(t1 > t0_)) fail_integration(Code::step_too_small, t0_, too_small(h), "a larger relative tolerance");
        const ExtendedMotion::Trial trial = motion_.step(t0_, t1);
        statistics_.rhs_calls += trial.calls;
        if (trial.order == 0) {
          count_rejection(statistics_.rejected, problem_, -1);
          h = 0.5 * (t1 - t0_), shortened = true, report.limit = StepLimit::error;
          if (h <= 1e-12 * std::max(std::abs(t0_), 1e-6))
            fail_integration(Code::step_too_small, t0_, too_small(h),
                             "a larger relative tolerance; a law with corners has none in 113 bits");
          continue;
        }
        t1_ = t1, report.order = trial.order, worst_ = trial.worst;
        // What a stop cut short tells nothing of longer steps, unless it needed many columns.
        const double taken = t1 - t0_;
        if (trial.order > kHigh)
          next_ = kShorter * taken;
        else if (trial.order < kGood && !shortened)
          next_ = std::max(next_, kLonger * taken);
        else if (shortened)
          next_ = taken;
        if (to_the_end) report.limit = StepLimit::stop;
        break;
      }
      motion_.found(x1_.data());
      taken_ = false;
      double t = t1_;
      const auto state_at = [&](double at) { return at == t1_ ? x1_.data() : (between(at, x_.data()), x_.data()); };
      const auto beside_at = [&](double at, double dt) { return at == t0_ || at == t1_ ? beside(at, dt) : state_at(at + dt); };
      if (problem_.n_roots > 0) {
        const double end = t1_;
        const bool event = events_.find(t, state_at, state_at, beside_at);
        if (event) report.event = true, report.crossed = events_.crossed(), report.limit = StepLimit::stop;
        if (event || looked_inside_) go_to(event ? t : end);
      }
      ++statistics_.steps;
      statistics_.last_step = t1_ - t0_;
      statistics_.last_order = report.order;
    }
    report.t = t1_;
    std::copy_n(x1_.begin(), problem_.n, x);
    return report;
  }

  /// A step of its own that ends there.
  void interpolate(double t, double* x) override {
    const bool inside = t != t1_ && !taken_;
    if (inside) between(t, x_.data());
    std::copy_n((inside ? x_ : x1_).begin(), problem_.n, x);
    if (inside) go_to(t1_);
  }
  void integrals(double t, double* y, double* error) override {
    const bool inside = t != t1_ && !taken_;
    if (inside) between(t, x_.data());
    std::copy_n((inside ? x_ : x1_).begin() + problem_.n, problem_.n_quadrature, y);
    if (error) errors(error);
    if (inside) go_to(t1_);
  }

  void remember(Archive& archive) override {
    archive(next_, statistics_, events_, std::span(off_));
    motion_.remember(archive);
    if (archive.reading()) motion_.found(x1_.data());
  }

  IntegratorStatistics statistics() const override {
    IntegratorStatistics s = statistics_;
    s.root_evaluations = events_.evaluations();
    return s;
  }
  int worst() const override { return worst_; }
  std::string_view name() const override { return "extended"; }

 private:
  static std::string too_small(double h) { return fmt::format("the step became too small: {:.3g} s", h); }

  /// What the integrals may be off by, to where the last step ends.
  void errors(double* error) {
    last_.assign(off_.size(), 0.0);
    if (!taken_) motion_.integral_errors(last_.data());
    for (std::size_t i = 0; i < off_.size(); ++i) error[i] = off_[i] + last_[i];
  }
  void take() {
    errors(off_.data());
    if (!taken_) motion_.take();
    taken_ = true;
  }
  /// The state at which the last step ended is where the next begins.
  void begin() {
    take();
    t0_ = t1_;
    x0_ = x1_;
    looked_inside_ = false;
  }
  void between(double t, double* x) {
    looked_inside_ = true;
    if (t == t0_) return void(std::copy(x0_.begin(), x0_.end(), x));
    const ExtendedMotion::Trial trial = motion_.step(t0_, t);
    statistics_.rhs_calls += trial.calls;
    if (trial.order == 0) fail_integration(Code::integrator_failed, t0_, "the state inside of a step is not found", "a shorter max_step");
    motion_.found(x);
  }
  /// The state near one of the ends, by the rate there, which needs no more digits than a double has.
  const double* beside(double end, double dt) {
    const std::vector<double>& x = end == t1_ ? x1_ : x0_;
    ++statistics_.rhs_calls;
    if (!problem_.rhs(end, x.data(), x_.data()))
      fail_integration(Code::integrator_failed, end, "the right-hand side cannot be evaluated", "a shorter max_step");
    for (int i = 0; i < problem_.n; ++i)
      x_[static_cast<std::size_t>(i)] = x[static_cast<std::size_t>(i)] + dt * x_[static_cast<std::size_t>(i)];
    return x_.data();
  }
  /// The last step ends there.
  void go_to(double t) {
    between(t, x1_.data());
    t1_ = t;
    looked_inside_ = false;
  }

  OdeProblem problem_;
  IntegratorOptions options_;
  ExtendedMotion& motion_;
  EventFinder events_;
  double t0_ = 0.0, t1_ = 0.0;  // [s] of the last step
  double next_;                 // [s] of a step that needs an order that is good
  int worst_ = -1;
  bool taken_ = true;                // the motion is at t1_, not at t0_ with a step to t1_ found
  bool looked_inside_ = false;       // since then another step was found
  std::vector<double> off_, last_;   // by which integrals may be off, to t0; of the last step
  std::vector<double> x0_, x1_, x_;  // at both ends of it, and inside: with the integrals after the state
  IntegratorStatistics statistics_;
};

}  // namespace

std::unique_ptr<Integrator> make_extended(OdeProblem problem, const IntegratorOptions& options) {
  return std::make_unique<Extended>(std::move(problem), options);
}

}  // namespace cardan
