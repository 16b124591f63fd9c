// An exponential Runge-Kutta method of order 3 (ETD3RK: Cox & Matthews 2002, J. Comput. Phys. 176): the linear part that the problem
// tells is advanced in closed form, three evaluations of f give what is left, a polynomial of the step. docs/mathematics/exponential.md.
#include "core/time/linear_part_integrator.hpp"

namespace cardan {
namespace {

class Exponential final : public LinearPartIntegrator {
 public:
  Exponential(OdeProblem problem, const IntegratorOptions& options) : LinearPartIntegrator(std::move(problem), options, 3) {
    for (Eigen::ArrayXd* x : {&e_, &terms_, &lost_, &whole_}) x->setZero(n_);
    y_share_.setZero(n_y_);
    for (Eigen::ArrayXd* r : {&r_a_, &r_b_}) r->setZero(linear_.size());
  }

  std::string_view name() const override { return "exponential"; }

 private:
  double stages(double t1, double h) override {
    of_rest_ = kNever, of_polynomials_ = of_inside_ = 0.0;
    linear_.divide(1);
    linear_.advance(0.5 * h, {r_n_.data(), zero_.data(), zero_.data()}, stage_.data());
    if (!rest(t0_ + 0.5 * h, stage_, 1, r_a_)) return kNever;
    r_1_ = 2.0 * r_a_ - r_n_;
    linear_.advance(h, {r_1_.data(), zero_.data(), zero_.data()}, stage_.data());
    if (!rest(t1, stage_, 2, r_b_)) return kNever;
    linear_.sizes(stage_.data(), size_1_.data());
    // The method of order 2 on the same last stage is apart by r_2 (s^2 - s).
    r_2_ = 2.0 * (r_n_ - 2.0 * r_a_ + r_b_), r_1_ = -r_2_;
    linear_.effect(h, {zero_.data(), r_1_.data(), r_2_.data()}, e_.data());
    linear_.leave_out(h, e_.data());
    through(r_a_, r_b_);
    linear_.advance(h, {r_n_.data(), r_1_.data(), r_2_.data()}, z1_.data());
    of_rest_ = norm(e_);
    if (linear_.last_terms(terms_.data(), lost_.data()) && norm(terms_) > 1.0) look_at_polynomials(h);
    const double error = std::max({of_rest_, of_polynomials_, of_inside_});
    if (of_rest_ >= error) norm(e_);  // tells which components it is of
    return all_finite(z1_.data(), n_) && std::isfinite(error) ? error : kNever;
  }

  /// e_ knows of N alone. What is followed by polynomials of the step may swing faster than these can: where their last terms count, the
  /// step is taken in halves, and they are wrong by what that changes. Inside events are located, which end steps, and rows are written:
  /// halves are less wrong there than the whole step, whose error in its middle the start of the second half tells.
  void look_at_polynomials(double h) {
    const bool inside = problem_.n_roots > 0 || problem_.looked_inside;
    whole_ = z1_;
    if (inside) linear_.inside(0.5, stage_.data());
    linear_.divide(2);
    linear_.advance(h, {r_n_.data(), r_1_.data(), r_2_.data()}, z1_.data());
    of_polynomials_ = norm((terms_ != 0.0).select((z1_ - whole_).abs().max(lost_.abs()), 0.0));
    if (!inside) return;
    linear_.inside(0.5, lost_.data());
    of_inside_ = norm((terms_ != 0.0).select((stage_ - lost_) / kHalvedInside, 0.0));
  }

  /// r_2 (s^2 - s), a sixth of 2, -4 and 2 times the values.
  double noise() const override { return 0.82; }

  double growth(double) const override {
    return 0.9 * std::min({std::pow(of_rest_, -1.0 / 3.0), std::pow(of_polynomials_, -1.0 / kOrderOfPolynomials),
                           std::pow(of_inside_, -1.0 / kOrderInside)});
  }

  /// The rule of order 2 on the same rates, the trapezium, is apart by that; how much it is below what the trapezium adds tells what an
  /// order gains. Inside of a step the polynomial through them gains nothing.
  Eigen::ArrayXd& error_of_integrals(bool inside) override {
    for (int i = 0; i < n_y_; ++i) {
      const double apart = std::abs(g_[0][i] - 2.0 * g_[1][i] + g_[2][i]) / 3.0, trapezium = 0.5 * std::abs(g_[2][i] - g_[0][i]);
      y_share_[i] = apart * (apart < trapezium && !inside ? apart / trapezium : 1.0);
    }
    return y_share_;
  }

  static constexpr double kOrderOfPolynomials = 13.0, kOrderInside = 7.0;  // of a step of six collocation points; on its way
  static constexpr double kHalvedInside = 128.0;                           // what halves are less wrong by on their way

  double of_rest_ = 0.0, of_polynomials_ = 0.0, of_inside_ = 0.0;  // errors, 1 = what is allowed
  Eigen::ArrayXd e_, r_a_, r_b_, y_share_;
  Eigen::ArrayXd terms_, lost_, whole_;  // last terms of the polynomials; those that do not fall off; the step in one piece
};

}  // namespace

std::unique_ptr<Integrator> make_exponential(OdeProblem problem, const IntegratorOptions& options) {
  return std::make_unique<Exponential>(std::move(problem), options);
}

}  // namespace cardan
