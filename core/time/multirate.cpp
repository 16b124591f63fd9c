// A multirate method of order 4 for f = L x + N: few evaluations of N in a long step, L advanced in pieces of it that are as short as it
// asks for. Three sweeps over the step, each through better values of N: an exponential Runge-Kutta method of the kind of Luan, Chinomona &
// Reynolds 2020 (SIAM J. Sci. Comput. 42). Two errors are kept apart: that of N as a polynomial, from the last two sweeps, which have their
// values at other places, and that of the pieces, from as many again. docs/mathematics/multirate.md.
#include "core/time/linear_part_integrator.hpp"

namespace cardan {
namespace {

class Multirate final : public LinearPartIntegrator {
 public:
  Multirate(OdeProblem problem, const IntegratorOptions& options) : LinearPartIntegrator(std::move(problem), options, 4) {
    for (Eigen::ArrayXd* x : {&middle_, &end_, &coarse_, &e_}) x->setZero(n_);
    for (Eigen::ArrayXd* r : {&r_a_, &r_b_}) r->setZero(linear_.size());
    for (Eigen::ArrayXd* g : {&g_a_, &g_b_, &y_share_}) g->setZero(n_y_);
  }

  void restart(double t, const double* x) override {
    if (t != t1_) piece_ = 0.0;
    LinearPartIntegrator::restart(t, x);
  }

  void remember(Archive& archive) override {
    LinearPartIntegrator::remember(archive);
    archive(piece_, rounding_, calm_);
  }

  std::string_view name() const override { return "multirate"; }

 private:
  static constexpr int kFewest = 2, kMost = 4096;  // pieces of a step: even, so that one ends in the middle
  static constexpr double kShare = 0.1;            // of the tolerance, that the pieces may be off by
  static constexpr double kOfStages = 10.0;        // tolerances: an error of the pieces that N at the stages may have
  static constexpr double kHalved = 4096.0;        // their error over that of pieces half as long, at most: they are of order 12
  // Differences that do not fall to a part of what they were as pieces are halved some times are rounding, which is forgotten slowly. It
  // may be all that keeps pieces from being longer: each few steps that is tried.
  static constexpr double kFalls = 0.25, kForgotten = 0.99, kOfRounding = 2.0;  // tolerances, that it may be
  static constexpr int kStands = 4, kCalm = 16;
  // Places of the second sweep, by the golden ratio: no swing of few turns in a step has the same phase there as at the start, the middle
  // and the end. One of four turns has so at quarters, where nothing tells it from what stands still.
  static constexpr double kLate = 0.5 * std::numbers::phi, kEarly = 1.0 - kLate;

  double stages(double t1, double h) override {
    for (;;) {
      const int n = pieces(h);
      if (n > kMost || !sweep(t1, h, n)) return kNever;
      through(r_a_, r_b_);
      advance(h, n, {r_n_.data(), r_1_.data(), r_2_.data()}, coarse_);
      e_ = coarse_ - end_;
      const double first = refine(h, n);
      if (!std::isfinite(first)) return kNever;
      if (apart_ > share()) return std::max(2.0, apart_);
      if (first <= kOfStages) return norm(e_);
      count_rejection(statistics_.rejected, problem_, largest_of(share_.data(), n_));
    }
  }

  /// The rule by the start, the middle and the end, from that by the start and both places between.
  double noise() const override { return 1.06; }

  int pieces(double h) {
    if (!(piece_ > 0.0)) piece_ = h / kFewest;
    int n = kFewest;
    while (n <= kMost && h > n * piece_ * (1.0 + 1e-9)) n *= 2;
    return n;
  }

  void advance(double h, int n, const std::array<const double*, 3>& r, Eigen::ArrayXd& x) {
    linear_.divide(n);
    linear_.advance(h, r, x.data());
    statistics_.inner_steps += n;
  }

  /// r_a_, r_b_: N at the middle and the end; end_: the state there through N at the places between, of an order less.
  bool sweep(double t1, double h, int n) {
    const auto at = [&](double s) { return t0_ + s * h; };
    advance(0.5 * h, n / 2, {r_n_.data(), zero_.data(), zero_.data()}, middle_);
    if (!rest(at(0.5), middle_, 1, r_a_)) return false;
    r_1_ = 2.0 * (r_a_ - r_n_);
    advance(h, n, {r_n_.data(), r_1_.data(), zero_.data()}, end_);
    linear_.inside(kLate, end_.data());
    linear_.inside(kEarly, middle_.data());
    if (!rest(at(kEarly), middle_, 1, r_a_) || !rest(at(kLate), end_, 2, r_b_)) return false;
    g_a_ = g_[1], g_b_ = g_[2];
    r_2_ = ((r_b_ - r_n_) / kLate - (r_a_ - r_n_) / kEarly) / (kLate - kEarly);
    r_1_ = (r_a_ - r_n_) / kEarly - kEarly * r_2_;
    advance(h, n, {r_n_.data(), r_1_.data(), r_2_.data()}, end_);
    linear_.inside(0.5, middle_.data());
    linear_.sizes(end_.data(), size_1_.data());
    return rest(at(0.5), middle_, 1, r_a_) && rest(t1, end_, 2, r_b_);
  }

  /// Of the tolerance, that the pieces may be off by; where rounding is above that, their differences say no more.
  double share() const { return std::max(kShare, rounding_); }

  /// z1_ by twice as many pieces, and by twice as many again while that counts; apart_: the last difference. Returns the first one.
  double refine(double h, int n) {
    double first = kNever, least = kNever, most = 0.0;  // of the differences since they fell for the last time
    int stands = 0;                                     // doublings since
    rounding_ *= kForgotten;
    for (int fine = 2 * n; fine <= 2 * kMost; fine *= 2, coarse_ = z1_) {
      advance(h, fine, {r_n_.data(), r_1_.data(), r_2_.data()}, z1_);
      if (!all_finite(z1_.data(), n_)) return kNever;
      apart_ = norm(z1_ - coarse_);
      fine_ = fine;
      if (fine == 2 * n) first = apart_;
      if (apart_ < kFalls * least)
        least = most = apart_, stands = 0;
      else
        least = std::min(least, apart_), most = std::max(most, apart_), ++stands;
      if (stands == kStands && most <= kOfRounding) rounding_ = 2.0 * most;
      if (apart_ > share()) continue;
      if (fine > 2 * n)
        piece_ = 2.0 * h / (fine >> stands);
      else if (n > kFewest && (kHalved * apart_ <= kShare || ++calm_ % kCalm == 0))
        piece_ = 2.0 * h / n;
      break;
    }
    return first;
  }

  /// What the rule through five rates, two of them of the sweep before, tells of Simpson's, and these two of its polynomial inside. Where
  /// they do not fall off, the step has swings in it that they do not resolve: then by how much they differ.
  Eigen::ArrayXd& error_of_integrals(bool inside) override {
    constexpr double kFallsOff = 0.05, u = kLate - kEarly, p = kEarly * kLate;
    for (int i = 0; i < n_y_; ++i) {
      const double a = g_[0][i], b = g_a_[i], c = g_[1][i], d = g_b_[i], e = g_[2][i];
      const double whole = std::abs((a + e) / p - (b + d) / (u * u * p) + 8.0 * c / (u * u)) / 60.0;
      const auto off = [c](double near, double value, double far) {  // of a value at a place between
        return std::abs(value - kLate * u * near - 4.0 * p * c + kEarly * u * far);
      };
      const auto [least, most] = std::minmax({a, b, c, d, e});
      const double apart = most - least, share = inside ? std::max(off(a, b, e), off(e, d, a)) : whole;
      y_share_[i] = fine_ <= 2 * kFewest && share <= kFallsOff * apart ? share : apart;
    }
    return y_share_;
  }

  double piece_ = 0.0;                        // [s] the longest piece to try; 0: not known
  int fine_ = 0;                              // pieces of the last step
  double rounding_ = 0.0;                     // what the differences of pieces are, at least, in the norm of the error
  long calm_ = 0;                             // steps whose pieces could have been no longer, as far as their differences tell
  double apart_ = 0.0;                        // of the last two numbers of pieces, in the norm of the error
  Eigen::ArrayXd middle_, end_, coarse_, e_;  // states; e_: by the last two sweeps
  Eigen::ArrayXd r_a_, r_b_;                  // N
  Eigen::ArrayXd g_a_, g_b_, y_share_;        // rates of the integrals at the places between
};

}  // namespace

std::unique_ptr<Integrator> make_multirate(OdeProblem problem, const IntegratorOptions& options) {
  return std::make_unique<Multirate>(std::move(problem), options);
}

}  // namespace cardan
