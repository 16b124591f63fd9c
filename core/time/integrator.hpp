#pragma once
// The seam between physics and time: an integrator owns no physics, the physics owns no step size.
// Formulas, choice of method and the meaning of an event: docs/mathematics/integration.md.
#include <array>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/checkpoint.hpp"
#include "core/base/step_interval.hpp"

namespace cardan {

/// The fast linear part of f, which `exponential` and `multirate` advance apart from the rest: with coordinates about a state, M u' + C u +
/// K y = r, where M, C, K are those of one state and r is what f is beyond them. docs/mathematics/exponential.md, 2.
class LinearPart {
 public:
  virtual ~LinearPart() = default;
  virtual int size() const = 0;  // of r
  /// Coordinates about (t, x) from now on, the start of a step, where f has just been evaluated, xdot; M, C, K anew where they have
  /// changed.
  virtual void centre(double t, const double* x, const double* xdot) = 0;
  /// r at x, where f is xdot.
  virtual void residual(const double* x, const double* xdot, double* r) const = 0;
  /// Steps of advance() in as many equal pieces from now on, 1 at first: each in closed form, which may not resolve what is fastest.
  virtual void divide(int pieces) = 0;
  /// x after h [s] from the centre with r(s) = r[0] + r[1] s + r[2] s^2, s = 0 ... 1.
  virtual void advance(double h, const std::array<const double*, 3>& r, double* x) = 0;
  /// What such an r alone does to x in h, in one piece: e[n].
  virtual void effect(double h, const std::array<const double*, 3>& r, double* e) = 0;
  /// After advance() in one piece, where it follows some coordinates of x by polynomials: the last terms of these, e[n], and `lost`, what
  /// of that falls off too slowly to be a series at all; zero elsewhere. false: it is exact, and nothing is filled in.
  virtual bool last_terms(double* /*e*/, double* /*lost*/) { return false; }
  /// Zero in the place of what a step of h does not resolve.
  virtual void leave_out(double h, double* e) const = 0;
  /// x at the fraction s of the last advance().
  virtual void inside(double s, double* x) = 0;
  /// By which errors of x are measured: |x|, of swings their amplitude.
  virtual void sizes(const double* x, double* size) const = 0;
  /// [s] The longest step that it is made for.
  virtual double longest_step() const = 0;
  /// Where M, C, K are from.
  virtual void remember(Archive& archive) = 0;
};

/// Motion in coordinates and momenta, z, for the method `variational`: a symplectic step of second order that is its own inverse with -h.
/// docs/mathematics/variational.md.
class MomentumForm {
 public:
  virtual ~MomentumForm() = default;
  virtual int size() const = 0;        // of z
  virtual int velocities() const = 0;  // of the mean velocity of a step
  /// z at the state x, and x at z; false: it cannot be evaluated there.
  virtual bool enter(const double* x, double* z) = 0;
  virtual bool leave(const double* z, double* x) = 0;
  /// The velocity at z, as step() counts it: a guess where there is no better one.
  virtual bool velocity(const double* z, double* v) = 0;
  /// z1 at t + h from z0 at t. v: a guess of the mean velocity, which is replaced by it. Returns how often it evaluated what acts; 0: the
  /// discrete equations are not solved.
  virtual int step(double t, double h, const double* z0, double* v, double* z1) = 0;
};

/// Motion as a differential-algebraic system F(t, y, y') = 0 of index 1 in unknowns y of its own, for the method `ida`.
/// docs/mathematics/loops.md, 5.
class ImplicitForm {
 public:
  virtual ~ImplicitForm() = default;
  virtual int size() const = 0;  // of y
  /// What each unknown may be off by at y.
  virtual void tolerances(double relative, const double* y, double* out) const = 0;
  /// Where F hangs on the unknowns or on their rates: rows of each column, ascending.
  virtual const std::vector<std::vector<int>>& pattern() const = 0;
  /// y and y' at the state x of time t, where motion starts; false: it cannot be evaluated there.
  virtual bool enter(double t, const double* x, double* y, double* ydot) = 0;
  /// x at y. end: of a step, from which the next ones go on.
  virtual bool leave(double t, const double* y, double* x, bool end) = 0;
  /// false: y cannot be evaluated.
  virtual bool residual(double t, const double* y, const double* ydot, double* F) = 0;
  /// The state that tells most of an unknown; -1: none does.
  virtual int state_of(int unknown) const = 0;
};

/// Motion in more digits than those of a double, for the method `extended`: it keeps the state where it is. docs/mathematics/extended.md.
class ExtendedMotion {
 public:
  virtual ~ExtendedMotion() = default;
  /// It is at x at time t; where x is what found() gave, with all digits of that.
  virtual void enter(double t, const double* x) = 0;
  struct Trial {
    int order = 0;  // 0: the error that is allowed was not met, or the way there cannot be evaluated
    int calls = 0;  // of the right-hand side
    int worst = 0;  // the state of the largest error over what is allowed
  };
  /// Tries to go from t0, where it is, to t1.
  virtual Trial step(double t0, double t1) = 0;
  /// Where the last step() came to, or enter(): the state, and after it the integrals.
  virtual void found(double* x) const = 0;
  /// What the integrals of the last step() may be off by: their rates are doubles, whose rounding its columns magnify.
  virtual void integral_errors(double* error) const = 0;
  /// It is there from now on.
  virtual void take() = 0;
  /// The digits that a double has not.
  virtual void remember(Archive& archive) = 0;
};

/// x' = f(t, x) with what an integrator may need besides. All functions are set once before the run; none may allocate,
/// but for those of the linear solver "krylov".
struct OdeProblem {
  int n = 0;             // number of states
  int n_quadrature = 0;  // integrals y' = g(t, x) beside the states, which nothing depends on: no error test, no step
  /// Fills xdot[n].
  /// false: x is outside of what can be evaluated (the step is retried smaller; after repeated failure, the run fails).
  std::function<bool(double t, const double* x, double* xdot)> rhs;
  /// g: fills ydot[n_quadrature]. rhs has been called just before, at this t and at x (Runge-Kutta) or as near to it as the
  /// corrector comes (CVODES): what it found may be used.
  std::function<void(double t, const double* x, double* ydot)> integrands;
  /// g has layers that are thin beside a step (friction that turns over, stops): Runge-Kutta methods integrate it stage by stage, as they
  /// do x, in place of once in a step.
  bool rough_integrands = false;
  /// States inside of steps are asked for, by interpolate(): a method whose error there is not that of its ends looks at it.
  bool looked_inside = false;
  /// Brings an accepted state of time t back on its manifold (unit quaternions, given motions); may be empty.
  std::function<void(double t, double* x)> project;
  std::vector<double> absolute_tolerance;  // per state [unit of the state], > 0
  /// Groups of states (coordinates and rates of hinges, of modes): the error norm is the root mean square over the groups of the root
  /// mean square in each, so that many smooth states of one kind do not dilute the errors of another. A number per state; empty: one
  /// group.
  std::vector<int> group;
  /// Event functions: `roots(t, x, g)` fills n_roots values; a sign change is located. May be empty.
  int n_roots = 0;
  std::function<void(double t, const double* x, double* g)> roots;
  /// The last of them are corners of f: nothing happens there but that a step ends near.
  int n_corners = 0;
  // For the linear solver "krylov" alone, J = df/dx; each may be empty. false: as with rhs.
  /// J dx at (t, x); empty: a difference quotient, one more evaluation of f each.
  std::function<bool(double t, const double* x, const double* dx, double* J_dx)> jacobian_times;
  /// Prepares `precondition` for 1 - gamma J at (t, x), gamma > 0 [s]. moved: x counts anew; else x is near that of the
  /// last call and gamma alone has changed.
  std::function<bool(double t, const double* x, double gamma, bool moved)> prepare;
  /// Solves (1 - gamma J) z = r approximately, a fixed linear map between two calls of prepare. Both or none.
  std::function<bool(const double* r, double* z)> precondition;
  /// A new one for the method of that name; of `exponential` and `multirate` alone.
  std::function<std::shared_ptr<LinearPart>(const std::string& method)> linear;
  std::shared_ptr<MomentumForm> momenta;     // of the methods `variational` and `variational4` alone
  std::shared_ptr<ImplicitForm> implicit;    // of the method `ida` alone
  std::shared_ptr<ExtendedMotion> extended;  // of the method `extended` alone
};

struct IntegratorOptions {
  std::string method = "dopri5";         // auto, ark_explicit, ark_imex, ark_implicit, cvode_adams, cvode_bdf, dop853, dopri5, exponential,
                                         // extended, ida, multirate, rk4, variational, variational4
  double relative_tolerance = 1e-9;      // adaptive methods
  double max_step = 0.0;                 // [s] 0 = none; adaptive methods
  double initial_step = 0.0;             // [s] 0 = the method's choice; adaptive methods
  double fixed_step = 0.0;               // [s] rk4, variational, variational4
  std::string linear_solver = {};        // of Newton's equations, ark_implicit and cvode_bdf only: dense (when empty), krylov; ida: sparse
  std::vector<std::string> rivals = {};  // of `exponential`: methods that go on in its place where they cost less; by choose_method()
  double fastest = 0.0;                  // [1/s] a swing or decay that the explicit ones of these cannot step over; 0: not known
};

struct IntegratorStatistics {
  long steps = 0, rhs_calls = 0, root_evaluations = 0, restarts = 0;
  Rejections rejected;
  long integrand_calls = 0;
  /// Sum over the steps of the estimated error of each over what the tolerances allow, at most 1 of an adaptive method; where there
  /// are integrals. Methods of equal steps estimate some of theirs.
  double error_sum = 0.0;
  long jacobian_products = 0, preconditioner_setups = 0, linear_iterations = 0;  // krylov
  long inner_steps = 0;                                                          // multirate: of the linear part
  double last_step = 0.0;                                                        // [s]
  int last_order = 0;

  /// What came after it.
  void add(const IntegratorStatistics& later) {
    steps += later.steps, rhs_calls += later.rhs_calls, root_evaluations += later.root_evaluations;
    rejected.add(later.rejected);
    restarts += later.restarts, integrand_calls += later.integrand_calls, error_sum += later.error_sum;
    jacobian_products += later.jacobian_products, preconditioner_setups += later.preconditioner_setups;
    linear_iterations += later.linear_iterations, inner_steps += later.inner_steps;
    last_step = later.last_step, last_order = later.last_order;
  }
  void remember(Archive& archive) {
    archive(steps, rhs_calls, rejected, root_evaluations, restarts, integrand_calls, error_sum, jacobian_products, preconditioner_setups,
            linear_iterations, inner_steps, last_step, last_order);
  }
};

/// What the length of a step follows from.
enum class StepLimit {
  error,  // that of Integrator::worst()
  stop,   // t_stop, or an event
  given   // a length, or a longest one, that was given or that the method is made for; one that could be evaluated or solved
};

/// Where a step ended, and which event functions crossed zero there: +1 rising, -1 falling, 0 not.
struct StepReport {
  double t = 0.0;  // [s] reached
  StepLimit limit = StepLimit::given;
  int order = 0;  // of the method in this step
  bool event = false;
  std::span<const int> crossed;  // size n_roots when event; valid until the next step
  bool stiff = false;            // explicit methods: of late stability and not accuracy has set the steps
  /// Adaptive methods: what rounding does to the estimate of the error, over the error that is allowed; 0: far less, or not looked at.
  double rounding = 0.0;
  int rounded = -1;          // most of it is that of this state
  std::string_view goes_on;  // the method that does from here, if it is another one
};

/// Factors of the states in a root mean square over all of them that make it the one over groups; empty for one group.
std::vector<double> group_weights(const std::vector<int>& group);

/// Virtual is right here: one call per step, thousands of flops behind it.
/// step() throws NumericsError N0201 (step too small), N0202 (rhs or method failed), N0108 (event function not finite).
class Integrator {
 public:
  virtual ~Integrator() = default;
  /// (Re)starts at (t, x); history is dropped, integrals go on. Call after every discontinuity. An event just reported does
  /// not fire again, even if x was changed (a bounce); one that starts at zero does not fire.
  virtual void restart(double t, const double* x) = 0;
  /// One internal step towards t_stop, never past it: the right-hand side is not evaluated beyond t_stop. Ends exactly
  /// at t_stop, or earlier at the end of an internal step or at the first event. x receives the state reached, projected.
  /// Without a restart, t_stop must not decrease.
  virtual StepReport step(double t_stop, double* x) = 0;
  /// The state at t inside the last step (dense output), projected.
  virtual void interpolate(double t, double* x) = 0;
  /// The integrals from the first start to t inside the last step; n_quadrature numbers. `error`, which may be null: an estimate of what
  /// each is off by at the states that were found, sums of magnitudes over the steps.
  virtual void integrals(double t, double* y, double* error = nullptr) = 0;
  /// What a restart keeps of all that was before it: the next step, counts, integrals. Right after restart(), on both sides: there it is
  /// written, or taken over by a new integrator of the same method and problem, which goes on with the same bits.
  virtual void remember(Archive& archive) = 0;
  virtual IntegratorStatistics statistics() const = 0;
  /// The state whose error was the largest part of that of the last step, or of a trial that shortened it or was the end of it, in the
  /// norm that chose its length; -1: there was none.
  virtual int worst() const { return -1; }
  /// Whether what it keeps of the past, its own state too, is as it was computed: projected copies alone leave it.
  virtual bool keeps_unprojected() const { return false; }
  virtual std::string_view name() const = 0;  // recorded in the result
};

/// A method as it may be asked for.
struct MethodKind {
  std::string name;
  bool adaptive;                            // chooses its steps by a tolerance; else it takes equal ones
  bool automatic;                           // stands for one of the others, which follows from the scene
  bool extended;                            // in more digits than those of a double, for references
  std::vector<std::string> linear_solvers;  // that it can be given; the first is taken when none is asked for
};
/// All methods, in the order of their names.
std::vector<MethodKind> integration_methods();
/// Whether it is a method that solves linear equations in its steps, which stiffness does not shorten.
bool is_implicit(const std::string& method);
/// Whether it needs OdeProblem::linear, which it does not follow by the steps in which it evaluates f.
bool advances_linear_part(const std::string& method);

/// Throws InputError (C0301, C0401) for unknown methods and options that do not fit the method.
void check_options(const IntegratorOptions& options);
/// The same for the options and the problem, which has to have what the method needs.
std::unique_ptr<Integrator> make_integrator(OdeProblem problem, const IntegratorOptions& options);

}  // namespace cardan
