#include "core/sim/diagonalised_form.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include "core/base/diagnostic.hpp"

namespace cardan {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

std::shared_ptr<const Model> honoured_vehicle(std::shared_ptr<const Model> model, Dynamics dynamics, const IntegratorOptions& options) {
  DiagonalisedForm::expect_honoured(*model, dynamics, options, {"dynamics"});
  return model;
}

/// An integrator of [q; nu; z] for who speaks of [q; v; z].
class InNu final : public Integrator {
 public:
  InNu(DiagonalisedForm& form, std::unique_ptr<Integrator> inner, int n_q, int n_v, int n)
      : form_(form), inner_(std::move(inner)), n_q_(n_q), n_v_(n_v), y_(static_cast<std::size_t>(n)) {}
  void restart(double t, const double* x) override {
    if (!form_.enter(x, y_.data())) std::fill_n(y_.begin() + n_q_, n_v_, kNone);  // the first evaluation tells
    inner_->restart(t, y_.data());
  }
  StepReport step(double t_stop, double* x) override {
    const StepReport report = inner_->step(t_stop, y_.data());
    leave(x);
    return report;
  }
  void interpolate(double t, double* x) override {
    inner_->interpolate(t, y_.data());
    leave(x);
  }
  void integrals(double t, double* y, double* error) override { inner_->integrals(t, y, error); }
  void remember(Archive& archive) override { inner_->remember(archive); }
  IntegratorStatistics statistics() const override { return inner_->statistics(); }
  int worst() const override { return inner_->worst(); }
  bool keeps_unprojected() const override { return inner_->keeps_unprojected(); }
  std::string_view name() const override { return inner_->name(); }

 private:
  void leave(double* x) {
    if (!form_.leave(y_.data(), x)) std::fill_n(x + n_q_, n_v_, kNone);
  }
  DiagonalisedForm& form_;
  std::unique_ptr<Integrator> inner_;
  int n_q_, n_v_;
  std::vector<double> y_;
};

}  // namespace

std::string DiagonalisedForm::refusal(const Model& model) {
  if (!model.loops.empty()) return "closed loops";
  if (!model.varies.empty()) return "masses that change";
  if (model.has(OpCode::refine)) return "masses that grow by large ratios per link";
  return {};
}

std::string DiagonalisedForm::refusal(const IntegratorOptions& options) {
  if (options.method == "exponential" || options.method == "multirate" || options.method.starts_with("variational"))
    return "the method " + options.method;
  if (options.linear_solver == "krylov") return "linear_solver krylov";
  return {};
}

void DiagonalisedForm::expect_honoured(const Model& model, Dynamics dynamics, const IntegratorOptions& options, const Located& at) {
  const std::string of_model = refusal(model), of_method = refusal(options);
  if (!of_model.empty())
    refuse(Code::unsupported, at, "dynamics that take " + of_model, name_of(dynamics) + ", which do not", "dynamics = \"standard\"");
  if (!of_method.empty())
    refuse(Code::unsupported, at, "dynamics that take " + of_method, name_of(dynamics) + ", which do not",
           "dynamics = \"standard\", or another method, as dopri5 or dop853");
}

DiagonalisedForm::DiagonalisedForm(std::shared_ptr<const Model> model, Dynamics dynamics, const IntegratorOptions& options, Hooks hooks)
    : model_(honoured_vehicle(std::move(model), dynamics, options)),
      hooks_(std::move(hooks)),
      velocities_(model_, dynamics == Dynamics::diagonalised) {
  const auto n = static_cast<std::size_t>(model_->nq + model_->nv + model_->devices.n_z);
  x_.resize(n), vdot_.resize(static_cast<std::size_t>(model_->nv)), seen_.assign(n, kNone);
  t_seen_ = kNone;
}

/// Does it, which tells whether it could.
template <class Work>
bool DiagonalisedForm::attempt(const double* q, const Work& work) {
  bool good = false;
  const auto told = [&] { good = work(); };
  if (!hooks_.guard(std::ref(told))) return false;
  if (!good) hooks_.broken(velocities_.breakdown(), q);
  return good;
}

bool DiagonalisedForm::at(const double* q) {
  return attempt(q, [&] { return velocities_.at(q); });
}

bool DiagonalisedForm::enter(const double* x, double* y) {
  velocities_.look_at_given();  // what devices hold may be something else from now on
  t_seen_ = kNone;
  std::copy_n(x, x_.size(), y);
  if (!at(x)) return false;
  velocities_.from_velocity(x + model_->nq, y + model_->nq);
  return true;
}

bool DiagonalisedForm::leave(const double* y, double* x) {
  t_seen_ = kNone;  // y may lie inside of the last step
  std::copy_n(y, x_.size(), x);
  if (!at(y)) return false;
  velocities_.to_velocity(y + model_->nq, x + model_->nq);
  return true;
}

/// x_ of y, with the motions that are given.
bool DiagonalisedForm::look(double t, const double* y) {
  if (t == t_seen_ && std::memcmp(y, seen_.data(), sizeof(double) * seen_.size()) == 0) return true;
  t_seen_ = kNone;
  std::copy_n(y, seen_.size(), seen_.begin());
  std::copy_n(y, x_.size(), x_.begin());
  double *q = x_.data(), *v = q + model_->nq;
  hooks_.give(t, q, v);
  if (!at(q)) return false;
  velocities_.to_velocity(v, v);
  t_seen_ = t;
  return true;
}

bool DiagonalisedForm::rhs(double t, const double* y, double* ydot) {
  if (!look(t, y) || !of_v_.rhs(t, x_.data(), ydot)) return false;
  const double *q = x_.data(), *v = q + model_->nq;
  std::copy_n(ydot + model_->nq, model_->nv, vdot_.begin());
  return attempt(q, [&] { return velocities_.rate(q, ydot, v, vdot_.data(), ydot + model_->nq); });
}

OdeProblem DiagonalisedForm::problem(OdeProblem of_v) {
  of_v_ = std::move(of_v);
  OdeProblem out = of_v_;
  out.rhs = [this](double t, const double* y, double* ydot) { return rhs(t, y, ydot); };
  if (of_v_.integrands)
    out.integrands = [this](double t, const double* y, double* ydot) {
      if (look(t, y)) return of_v_.integrands(t, x_.data(), ydot);
      std::fill_n(ydot, of_v_.n_quadrature, 0.0);
    };
  // A state is projected as it stands: what is given, and quaternions; nu stays what it is.
  if (of_v_.roots)
    out.roots = [this](double t, const double* y, double* g) {
      if (!look(t, y)) std::fill_n(x_.begin() + model_->nq, model_->nv, kNone);
      of_v_.roots(t, x_.data(), g);
    };
  // Those of v as what the vehicle as it is described makes of them: a run that goes on from a checkpoint has the same.
  const State start = model_->initial_state();
  if (at(start.q.data())) velocities_.size(of_v_.absolute_tolerance.data() + model_->nq, out.absolute_tolerance.data() + model_->nq);
  return out;
}

std::unique_ptr<Integrator> DiagonalisedForm::integrator(std::unique_ptr<Integrator> of_nu) {
  return std::make_unique<InNu>(*this, std::move(of_nu), model_->nq, model_->nv, static_cast<int>(x_.size()));
}

}  // namespace cardan
