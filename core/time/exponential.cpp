// An exponential Runge-Kutta method of order 3 (ETD3RK: Cox & Matthews 2002, J. Comput. Phys. 176): the linear part that the problem
// tells is advanced in closed form, three evaluations of f give what is left, a polynomial of the step. docs/mathematics/exponential.md.
#include "core/time/linear_part_integrator.hpp"

namespace cardan {
namespace {

class Exponential final : public LinearPartIntegrator {
 public:
  Exponential(OdeProblem problem, const IntegratorOptions& options) : LinearPartIntegrator(std::move(problem), options, 3) {
    e_.setZero(n_), y_share_.setZero(n_y_);
    for (Eigen::ArrayXd* r : {&r_a_, &r_b_}) r->setZero(linear_.size());
  }

  std::string_view name() const override { return "exponential"; }

 private:
  double stages(double t1, double h) override {
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
    const double error = norm(e_);
    through(r_a_, r_b_);
    linear_.advance(h, {r_n_.data(), r_1_.data(), r_2_.data()}, z1_.data());
    return all_finite(z1_.data(), n_) && std::isfinite(error) ? error : kNever;
  }

  /// The rule of order 2 on the same rates, the trapezium, is apart by that; how much it is below what the trapezium adds tells what an
  /// order gains.
  Eigen::ArrayXd& error_of_integrals() override {
    for (int i = 0; i < n_y_; ++i) {
      const double apart = std::abs(g_[0][i] - 2.0 * g_[1][i] + g_[2][i]) / 3.0, trapezium = 0.5 * std::abs(g_[2][i] - g_[0][i]);
      y_share_[i] = apart * (apart < trapezium ? apart / trapezium : 1.0);
    }
    return y_share_;
  }

  Eigen::ArrayXd e_, r_a_, r_b_, y_share_;
};

}  // namespace

std::unique_ptr<Integrator> make_exponential(OdeProblem problem, const IntegratorOptions& options) {
  return std::make_unique<Exponential>(std::move(problem), options);
}

}  // namespace cardan
