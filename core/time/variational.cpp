// Equal steps that keep the structure of mechanics: the variational midpoint rule (MomentumForm), of order 2, and five of it that make one
// of order 4 (Suzuki 1990). docs/mathematics/variational.md.
#include <algorithm>
#include <array>
#include <cmath>

#include "core/time/event_finder.hpp"
#include "core/time/methods.hpp"
#include "core/time/node_quadrature.hpp"

namespace cardan {
namespace {

/// Parts of a step: each a step of the midpoint rule.
struct Composition {
  int order, parts;
  double length[5];  // of the whole
};
constexpr double kSuzuki = 0.41449077179437573714;  // 1 / (4 - 4^(1/3))
constexpr Composition kMidpoint = {2, 1, {1.0}}, kFourth = {4, 5, {kSuzuki, kSuzuki, 1.0 - 4.0 * kSuzuki, kSuzuki, kSuzuki}};

/// The mean velocities of the last steps, and the next by the polynomial through them: a guess.
class Extrapolation {
 public:
  explicit Extrapolation(int n) : n_(static_cast<std::size_t>(n)), past_(n_ * kMost) {}

  void forget() { count_ = 0; }

  /// For a step as long as those before.
  void guess(double* v) const {
    std::fill_n(v, n_, 0.0);
    for (std::size_t k = 0; k < order_; ++k)
      for (std::size_t i = 0; i < n_; ++i) v[i] += kWeight[order_ - 1][k] * at(k)[i];
  }
  bool empty() const { return count_ == 0; }

  /// v was the next one: it tells which order would have been the best.
  void add(const double* v) {
    double least = 0.0;
    std::size_t best = 1;
    for (std::size_t order = 1; order <= count_; ++order) {
      double error = 0.0;
      for (std::size_t i = 0; i < n_; ++i) {
        double d = v[i];
        for (std::size_t k = 0; k < order; ++k) d -= kWeight[order - 1][k] * at(k)[i];
        error = std::max(error, std::abs(d));
      }
      if (order == 1 || error < least) least = error, best = order;
    }
    first_ = (first_ + kMost - 1) % kMost;
    std::copy_n(v, n_, past_.begin() + static_cast<std::ptrdiff_t>(n_ * first_));
    const bool grows = best == count_ && count_ < kMost;
    count_ = std::min(count_ + 1, kMost);
    order_ = grows ? count_ : std::max<std::size_t>(best, 1);
  }

 private:
  static constexpr std::size_t kMost = 8;
  static constexpr auto kWeight = [] {  // binomial coefficients with alternating signs
    std::array<std::array<double, kMost>, kMost> w{};
    for (std::size_t order = 1; order <= kMost; ++order) {
      double c = 1.0;
      for (std::size_t k = 0; k < order; ++k) {
        c *= static_cast<double>(order - k) / static_cast<double>(k + 1);
        w[order - 1][k] = k % 2 == 0 ? c : -c;
      }
    }
    return w;
  }();
  const double* at(std::size_t back) const { return past_.data() + n_ * ((first_ + back) % kMost); }

  std::size_t n_;
  std::vector<double> past_;  // ring, the last one at first_
  std::size_t first_ = 0, count_ = 0, order_ = 1;
};

class Variational final : public Integrator {
 public:
  Variational(OdeProblem problem, const IntegratorOptions& options)
      : problem_(std::move(problem)),
        options_(options),
        parts_(options.method == "variational4" ? kFourth : kMidpoint),
        form_(*problem_.momenta),
        events_(problem_),
        nodes_(problem_.n_quadrature) {
    const auto size = static_cast<std::size_t>(form_.size()), n = static_cast<std::size_t>(problem_.n);
    for (std::vector<double>* z : {&z0_, &z1_, &part_}) z->resize(size);
    for (std::vector<double>* x : {&x0_, &x1_, &x_, &rate_0_, &rate_1_}) x->resize(n);
    v_.resize(static_cast<std::size_t>(form_.velocities()));
    y_.resize(static_cast<std::size_t>(problem_.n_quadrature));
    past_.assign(static_cast<std::size_t>(parts_.parts), Extrapolation(form_.velocities()));
    weights_ = group_weights(problem_.group);
  }

  void restart(double t, const double* x) override {
    nodes_.begin_stretch(t1_);
    t0_ = t1_ = t;
    std::copy_n(x, problem_.n, x1_.begin());
    forget();
    entered_ = false;
    if (problem_.n_roots > 0) events_.restart(t, x1_.data());
    ++statistics_.restarts;
  }

  StepReport step(double t_stop, double* x) override {
    StepReport report;
    if (t1_ < t_stop) {
      begin();
      const double left = t_stop - t0_, n = std::max(1.0, std::ceil(left / options_.fixed_step - 1e-6)),
                   t1 = n == 1.0 ? t_stop : t0_ + left / n;
      if (std::abs(t1 - t0_ - h_) > 1e-6 * h_) forget();  // not as long as the one before
      h_ = t1 - t0_;
      to(t1, true);
      double t = t1_;
      const auto state_at = [&](double at) { return at == t1 ? x1_.data() : (between(at, x_.data()), x_.data()); };
      const auto beside_at = [&](double at, double dt) { return at == t0_ || at == t1_ ? beside(at, dt) : state_at(at + dt); };
      if (problem_.n_roots > 0 && events_.find(t, state_at, state_at, beside_at)) report.event = true, report.crossed = events_.crossed();
      if (t != t1_) to(t, false), forget();
      ++statistics_.steps;
      if (problem_.n_quadrature > 0) add_node();
      if (report.event || t1_ == t_stop) report.limit = StepLimit::stop;
      statistics_.last_step = t1_ - t0_;
    }
    report.t = t1_;
    report.order = parts_.order;
    std::copy_n(x1_.begin(), problem_.n, x);
    return report;
  }

  /// A step of its own that ends there.
  void interpolate(double t, double* x) override {
    if (t == t1_) return void(std::copy_n(x1_.begin(), problem_.n, x));
    between(t, x);
  }
  void integrals(double t, double* y, double* error) override { nodes_.at(t, y, error); }

  void remember(Archive& archive) override {  // what a restart keeps: its integrals and counts
    std::vector<double> error(y_);
    nodes_.at(t1_, y_.data(), error.data());
    archive(std::span(y_), std::span(error), statistics_, events_);
    if (archive.reading()) nodes_.begin_stretch_at(y_.data(), error.data());
  }

  IntegratorStatistics statistics() const override {
    IntegratorStatistics s = statistics_;
    s.root_evaluations = events_.evaluations();
    s.last_order = parts_.order;
    return s;
  }
  std::string_view name() const override { return parts_.parts == 1 ? "variational" : "variational4"; }

 private:
  static constexpr int kSampled = 8;  // steps to each that is estimated

  void forget() {
    for (Extrapolation& past : past_) past.forget();
  }

  void begin() {
    t0_ = t1_;
    if (!entered_ && !form_.enter(x1_.data(), z1_.data())) give_up();
    if (!entered_ && problem_.n_quadrature > 0) {
      rates(t1_, x1_, rate_1_);
      problem_.integrands(t1_, x1_.data(), y_.data());
      ++statistics_.integrand_calls;
      nodes_.add(t1_, y_.data());
    }
    entered_ = true;
    x0_.swap(x1_), z0_.swap(z1_), rate_0_.swap(rate_1_);
  }

  /// Where it cannot go on from: the right-hand side there tells why, if it can.
  [[noreturn]] void give_up() {
    rates(t0_, x1_, rate_1_);
    fail_integration(Code::integrator_failed, t0_, "the discrete equations of motion are not solved", "a smaller step");
  }

  void rates(double t, const std::vector<double>& x, std::vector<double>& to) {
    ++statistics_.rhs_calls;
    if (!problem_.rhs(t, x.data(), to.data()) || !all_finite(to.data(), problem_.n))
      fail_integration(Code::integrator_failed, t, "the right-hand side cannot be evaluated", "a smaller step");
  }

  /// part_ at t from z0_. whole: it is the step itself.
  bool advance(double t, bool whole) {
    const double h = t - t0_;
    double at = t0_;
    std::copy(z0_.begin(), z0_.end(), part_.begin());
    for (int i = 0; i < parts_.parts; ++i) {
      Extrapolation& past = past_[static_cast<std::size_t>(i)];
      const double part = h * parts_.length[i];
      if (past.empty() ? !form_.velocity(part_.data(), v_.data()) : (past.guess(v_.data()), false)) return false;
      const int calls = form_.step(at, part, part_.data(), v_.data(), part_.data());
      if (calls == 0) return false;
      statistics_.rhs_calls += calls;
      if (whole) past.add(v_.data());
      at += part;
    }
    return true;
  }
  void to(double t, bool whole) {
    if (!advance(t, whole) || !form_.leave(part_.data(), x1_.data())) {
      x1_ = x0_;
      give_up();
    }
    std::swap(z1_, part_);
    t1_ = t;
  }
  void between(double t, double* x) {
    if (!advance(t, false) || !form_.leave(part_.data(), x)) x1_ = x0_, give_up();
  }

  /// The state near one of the ends of the step, by the rate there.
  const double* beside(double end, double dt) {
    const std::vector<double>& x = end == t1_ ? x1_ : x0_;
    rates(end, x, x_);
    for (std::size_t i = 0; i < x.size(); ++i) x_[i] = x[i] + dt * x_[i];
    return x_.data();
  }

  void add_node() {
    rates(t1_, x1_, rate_1_);
    problem_.integrands(t1_, x1_.data(), y_.data());
    ++statistics_.integrand_calls;
    nodes_.add(t1_, y_.data());
    if (statistics_.steps % kSampled != 0) return;
    // The trapezoid through the rates at both ends is apart from the step by errors of order 2 of both.
    double sum = 0.0;
    for (std::size_t i = 0; i < x1_.size(); ++i) {
      const double e = x1_[i] - x0_[i] - 0.5 * (t1_ - t0_) * (rate_0_[i] + rate_1_[i]);
      double share = e / (problem_.absolute_tolerance[i] + options_.relative_tolerance * std::max(std::abs(x0_[i]), std::abs(x1_[i])));
      if (!weights_.empty()) share *= weights_[i];
      sum += share * share;
    }
    statistics_.error_sum += kSampled * std::sqrt(sum / std::max(1.0, static_cast<double>(x1_.size())));
  }

  OdeProblem problem_;
  IntegratorOptions options_;
  Composition parts_;
  MomentumForm& form_;
  EventFinder events_;
  NodeQuadrature nodes_;
  bool entered_ = false;        // z1_ is that of x1_
  double t0_ = 0.0, t1_ = 0.0;  // [s] of the last step
  double h_ = 0.0;              // [s] as it was meant to be
  std::vector<double> z0_, z1_, part_, x0_, x1_, x_, rate_0_, rate_1_, v_, y_, weights_;
  std::vector<Extrapolation> past_;  // per part
  IntegratorStatistics statistics_;
};

}  // namespace

std::unique_ptr<Integrator> make_variational(OdeProblem problem, const IntegratorOptions& options) {
  return std::make_unique<Variational>(std::move(problem), options);
}

}  // namespace cardan
