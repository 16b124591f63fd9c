// A method that advances a linear part in closed form, and rivals that take its place where they cost less.
// docs/mathematics/integration.md, "Which method".
#include <algorithm>
#include <vector>

#include "core/time/methods.hpp"

namespace cardan {
namespace {

/// What swings fast may hang on how bodies stand, and one of its methods then follows it for a fraction of what another one costs. No
/// initial state tells that, so it is tried: once the error has set most of kLook steps of the first method, each rival in turn goes on for
/// as much as these cost, and the one that cost least in a second does for kStretch times as much, twice that each time; then the first
/// one is looked at again. Costs are counted and not timed: the same bits each time.
class Alternating final : public Integrator {
 public:
  Alternating(OdeProblem problem, const IntegratorOptions& options)
      : problem_(std::move(problem)), options_(options), names_(options.rivals) {
    names_.insert(names_.begin(), options.method);
    options_.rivals.clear();
    price_.assign(names_.size(), 0.0);
    x_.assign(static_cast<std::size_t>(problem_.n), 0.0);
    for (std::vector<double>* y : {&y_, &error_, &y_now_, &error_now_}) y->assign(static_cast<std::size_t>(problem_.n_quadrature), 0.0);
    make(options.initial_step);
  }

  void restart(double t, const double* x) override {
    turn();
    now_->restart(t, x);
    reached(t, x);
  }

  StepReport step(double t_stop, double* x) override {
    if (next_ != turn_) {
      turn();
      now_->restart(t_, x_.data());
    }
    const double t = t_;
    StepReport report = now_->step(t_stop, x);
    reached(report.t, x);
    passed_ += report.t - t;
    ++steps_;
    if (report.limit == StepLimit::error) ++by_error_;
    report.stiff = false;  // of a rival, whose price tells
    if (!report.event && (trying_ ? tried() : cost() >= stretch_)) report.goes_on = decide();
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
    const int was = turn_;
    archive(turn_, trying_, far_, steps_, by_error_, passed_, cost_before_, budget_, stretch_, longer_, told_, std::span(price_),
            std::span(y_), std::span(error_));
    const auto known = [&](int method) { return method == 0 || is_rival(method); };
    if (archive.reading() && !(known(turn_) && known(told_) && longer_ >= 1 && longer_ <= kLongest))
      archive.wrong("counts of steps are none");
    before_.remember(archive);
    next_ = turn_;
    if (turn_ != was) {
      make(0.0);
      now_->restart(t_, x_.data());
    }
    now_->remember(archive);
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
  static constexpr int kStretch = 10, kLongest = 64;
  static constexpr double kFar = 10.0;  // [rad] of the fastest motion in a step of the first: an explicit method costs more
  static constexpr double kDear = std::numeric_limits<double>::max();
  // Evaluations of f by an explicit method that take as long: for each of `exponential` with what it advances, each of `multirate`, and
  // each of its pieces.
  static constexpr double kInClosedForm = 3.3, kBesidePieces = 2.0, kPiece = 0.5;

  /// In evaluations of f by an explicit method, since it was counted last.
  double cost() const {
    const IntegratorStatistics s = now_->statistics();
    const std::string& name = name_of(turn_);
    const double of_call = name == "multirate" ? kBesidePieces : advances_linear_part(name) ? kInClosedForm : 1.0;
    return of_call * static_cast<double>(s.rhs_calls) + kPiece * static_cast<double>(s.inner_steps) - cost_before_;
  }

  void count_anew() {
    cost_before_ += cost();
    passed_ = 0.0;
    steps_ = by_error_ = 0;
  }

  /// Whether that is enough of the method that is tried.
  bool tried() {
    if (turn_ > 0) return cost() >= budget_;
    if (steps_ < kLook) return false;
    if (2 * by_error_ >= steps_) return true;
    count_anew();  // ticks and events set its steps
    return false;
  }

  /// What goes on, if it is another one than that which was told last.
  std::string_view decide() {
    const double cost_now = cost();
    if (!trying_) {
      next_ = 0, trying_ = true;
    } else {
      price_[static_cast<std::size_t>(turn_)] = passed_ > 0.0 ? cost_now / passed_ : kDear;
      if (turn_ == 0) budget_ = cost_now, far_ = passed_ * options_.fastest > kFar * static_cast<double>(steps_);
      for (next_ = turn_ + 1; is_rival(next_) && far_ && !advances_linear_part(name_of(next_)); ++next_)
        price_[static_cast<std::size_t>(next_)] = kDear;
      if (!is_rival(next_)) {
        next_ = static_cast<int>(std::ranges::min_element(price_) - price_.begin());
        trying_ = false;
        stretch_ = kStretch * longer_ * budget_;
        longer_ = std::min(2 * longer_, kLongest);
      }
    }
    count_anew();
    if (trying_ || next_ == told_) return {};
    told_ = next_;
    return name_of(told_);
  }

  bool is_rival(int method) const { return method > 0 && method < static_cast<int>(names_.size()); }
  const std::string& name_of(int method) const { return names_[static_cast<std::size_t>(method)]; }

  void make(double initial_step) {
    options_.method = name_of(turn_);
    options_.initial_step = initial_step;
    now_ = make_integrator(problem_, options_);
  }

  void turn() {
    if (next_ == turn_) return;
    now_->integrals(t_, y_now_.data(), error_now_.data());
    for (std::size_t i = 0; i < y_.size(); ++i) y_[i] += y_now_[i], error_[i] += error_now_[i];
    before_.add(now_->statistics());
    turn_ = next_;
    cost_before_ = 0.0;
    make(0.0);
  }

  void reached(double t, const double* x) {
    t_ = t;
    std::copy_n(x, x_.size(), x_.begin());
  }

  OdeProblem problem_;
  IntegratorOptions options_;
  std::vector<std::string> names_;  // the first method, its rivals
  std::unique_ptr<Integrator> now_;
  int turn_ = 0, next_ = 0, told_ = 0;   // which one it is; which one begins where this one is; which one was told to go on
  bool far_ = false;                     // no explicit one is tried
  bool trying_ = true;                   // else it goes on
  long steps_ = 0, by_error_ = 0;        // since it is tried; of them, those whose length the error has set
  double passed_ = 0.0;                  // [s] since then
  double cost_before_ = 0.0;             // of what it did before that
  double budget_ = 0.0, stretch_ = 0.0;  // what a trial may cost; what the stretch after it may
  int longer_ = 1;                       // of the next stretch
  double t_ = 0.0;                       // [s] reached
  std::vector<double> price_;            // of each in a second
  std::vector<double> x_;
  std::vector<double> y_, error_, y_now_, error_now_;  // integrals of those before, and what they may be off by; of this one
  IntegratorStatistics before_;
};

}  // namespace

std::unique_ptr<Integrator> make_alternating(OdeProblem problem, const IntegratorOptions& options) {
  return std::make_unique<Alternating>(std::move(problem), options);
}

}  // namespace cardan
