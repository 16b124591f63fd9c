// A method that advances a linear part in closed form, and an explicit one that takes its place where that does not pay.
// docs/mathematics/integration.md, "Which method".
#include <algorithm>
#include <vector>

#include "core/time/methods.hpp"

namespace cardan {
namespace {

/// What swings fast may hang on how bodies stand: then the closed form is another one at each place, and its steps are shorter than those
/// by which a method of higher order follows the swings. Once kLook steps whose length the error has set were shorter on average than
/// `give_way_below`, `give_way_to` goes on; after kExplicitSteps, twice as many each time, the first one is tried again.
class Alternating final : public Integrator {
 public:
  Alternating(OdeProblem problem, const IntegratorOptions& options) : problem_(std::move(problem)), options_(options) {
    x_.assign(static_cast<std::size_t>(problem_.n), 0.0);
    for (std::vector<double>* y : {&y_, &error_, &y_now_, &error_now_}) y->assign(static_cast<std::size_t>(problem_.n_quadrature), 0.0);
    make();
  }

  void restart(double t, const double* x) override {
    turn();
    now_->restart(t, x);
    reached(t, x);
  }

  StepReport step(double t_stop, double* x) override {
    if (turns_) {
      turn();
      now_->restart(t_, x_.data());
    }
    const double t = t_;
    StepReport report = now_->step(t_stop, x);
    reached(report.t, x);
    if (explicit_) {
      turns_ = (--left_ <= 0 || report.stiff) && !report.event;
      report.stiff = false;
    } else if (report.limit == StepLimit::error) {
      length_ += report.t - t;
      if (++short_ < kLook) return report;
      turns_ = length_ < kLook * options_.give_way_below && !report.event;
      short_ = 0, length_ = 0.0;
    }
    if (turns_) report.goes_on = explicit_ ? options_.method : options_.give_way_to;
    return report;
  }

  void interpolate(double t, double* x) override { now_->interpolate(t, x); }

  void integrals(double t, double* y, double* error) override {
    now_->integrals(t, y, error);
    for (std::size_t i = 0; i < y_.size(); ++i) {
      y[i] += y_[i];
      if (error) error[i] += error_[i];
    }
  }

  void remember(Archive& archive) override {
    const bool was_explicit = explicit_;
    archive(explicit_, short_, length_, left_, stretch_, std::span(y_), std::span(error_));
    if (archive.reading() &&
        !(short_ >= 0 && short_ < kLook && left_ <= kLongestExplicitSteps && stretch_ > 0 && stretch_ <= kLongestExplicitSteps))
      archive.wrong("counts of steps are none");
    before_.remember(archive);
    if (explicit_ != was_explicit) {
      make();
      now_->restart(t_, x_.data());
    }
    now_->remember(archive);
    if (explicit_) problem_.linear->remember(archive);
  }

  IntegratorStatistics statistics() const override {
    IntegratorStatistics all = before_;
    all.add(now_->statistics());
    return all;
  }

  int worst() const override { return now_->worst(); }
  bool keeps_unprojected() const override { return now_->keeps_unprojected(); }
  std::string_view name() const override { return now_->name(); }

 private:
  static constexpr int kLook = 200;

  void make() {
    IntegratorOptions options = options_;
    options.give_way_below = 0.0, options.give_way_to.clear();
    if (explicit_) options.method = options_.give_way_to;
    now_ = make_integrator(problem_, options);
  }

  void turn() {
    if (!std::exchange(turns_, false)) return;
    now_->integrals(t_, y_now_.data(), error_now_.data());
    for (std::size_t i = 0; i < y_.size(); ++i) y_[i] += y_now_[i], error_[i] += error_now_[i];
    before_.add(now_->statistics());
    explicit_ = !explicit_;
    if (explicit_) {
      left_ = stretch_;
      stretch_ = std::min(2 * stretch_, kLongestExplicitSteps);
    }
    make();
  }

  void reached(double t, const double* x) {
    t_ = t;
    std::copy_n(x, x_.size(), x_.begin());
  }

  OdeProblem problem_;
  IntegratorOptions options_;
  std::unique_ptr<Integrator> now_;
  bool explicit_ = false, turns_ = false;     // which one it is; the next one begins where this one is
  int short_ = 0;                             // steps of the first one since it was looked at last ...
  double length_ = 0.0;                       // [s] ... and their sum
  long left_ = 0, stretch_ = kExplicitSteps;  // explicit steps until the first one is tried again; when its turn comes next
  double t_ = 0.0;                            // [s] reached
  std::vector<double> x_;
  std::vector<double> y_, error_, y_now_, error_now_;  // integrals of those before, and what they may be off by; of this one
  IntegratorStatistics before_;
};

}  // namespace

std::unique_ptr<Integrator> make_alternating(OdeProblem problem, const IntegratorOptions& options) {
  return std::make_unique<Alternating>(std::move(problem), options);
}

}  // namespace cardan
