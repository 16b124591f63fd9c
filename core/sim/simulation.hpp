#pragma once
// A run: model, state, integrator, clocked tasks, events and outputs. The page that computes one step is step.cpp.
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/warnings.hpp"
#include "core/dynamics/devices.hpp"
#include "core/dynamics/loops.hpp"
#include "core/io/recorder.hpp"
#include "core/model/model_map.hpp"
#include "core/sim/balances.hpp"
#include "core/sim/device_clocks.hpp"
#include "core/sim/dynamics.hpp"
#include "core/sim/headway.hpp"
#include "core/sim/holding.hpp"
#include "core/sim/momentum_keeper.hpp"
#include "core/sim/motion_profile.hpp"
#include "core/sim/port_fault.hpp"
#include "core/sim/run_profile.hpp"
#include "core/sim/schedule.hpp"
#include "core/sim/step_history.hpp"
#include "core/time/integrator.hpp"

namespace cardan {

/// Absolute tolerances of states of one kind; 0: as the others.
struct TolerancesByKind {
  double angle = 0.0;     // [rad] of hinges and attitudes
  double position = 0.0;  // [m]
  double rate = 0.0;      // [rad/s]
  double velocity = 0.0;  // [m/s]
  double modes = 0.0;     // [-] in place of the number that is scaled for each mode
};

struct SimulationOptions {
  IntegratorOptions integrator;
  double absolute_tolerance = 0.0;  // [unit of each state], up to 1; 0 = the relative tolerance. Modes are scaled, see .cpp
  TolerancesByKind tolerances;
  Dynamics dynamics = Dynamics::standard;  // which velocities are integrated, what accelerations are by; what is seen is v
  std::uint64_t seed = 0;                  // of the noise of devices
  /// What only looks, rows of outputs and sensors whose readings change no motion, lies inside of steps and does not end them: at states by
  /// the method's own polynomial over the step. docs/mathematics/integration.md, "Rows inside of steps".
  bool between_steps = false;
  bool ledger = true;  // integrate external impulse and work beside the state; no bit of the motion depends on it
};

class DiagonalisedForm;
class NewtonOperators;
template <class T>
class TwinDynamics;

/// Where a function of (t, q, v) crosses zero, something happens between two steps.
struct Event {
  std::string name;
  std::function<double(double t, const double* q, const double* v)> function;  // behind v stand the states z of devices
  int direction = 0;                                                           // +1 rising, -1 falling, 0 both
  std::function<void()> action;                                                // may change commands and state, and stop the run
  bool noted = true;                                                           // in the results
};

/// Quantities written at each output time.
struct Output {
  Channel channel;
  std::function<void(double* values)> fill;  // called after Simulation::observe(); `values` are those of the row before, at first zero
};

class Simulation {
 public:
  Simulation(std::shared_ptr<const Model> model, const SimulationOptions& options);
  ~Simulation();
  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;

  /// Where masses vary they are those of the present state.
  const Model& model() const { return *model_; }
  /// The one that its devices refer to.
  const std::shared_ptr<const Model>& own_model() const { return model_; }
  /// To keep: where masses vary they stay as they are now.
  std::shared_ptr<const Model> shared_model() const { return own_ ? std::make_shared<const Model>(*own_) : model_; }
  const State& state() const { return state_; }
  double time() const { return state_.t; }

  // Set-up -----------------------------------------------------------------------------------------------------------
  /// Before the run, and in events: changes the state; the integrator starts again from it. InputError C0402 where it is that of another
  /// vehicle.
  void set_state(const State& state);
  /// Before the run: how to integrate.
  void set_options(const SimulationOptions& options) { options_ = options, let_inside(); }
  const SimulationOptions& options() const { return options_; }
  /// The vehicle is another one from now on: its description was changed and compiled again. Bodies, nodes and devices keep their state,
  /// commands, motion profiles and wrenches by name; what is new starts as its description says. In a run it takes place at the end of
  /// the instant, after all tasks and events of it; velocities are carried over, whatever that does to momentum and energy: the ledger
  /// counts both as brought in, and an event `model` in the results tells how much. InputError C0403 where something is gone that the
  /// run may refer to, or a device with a sampled part comes or goes.
  void adopt(std::shared_ptr<const Model> model);
  /// The same with hinges and closures that are others: `make` is called at the end of the instant, once for what several callers want of
  /// it, and gives model and state, mostly by rejoin(). `told`: what happens, in the results.
  void adopt(std::function<Rejoined()> make, std::string told);
  /// Before the run goes on from a checkpoint: what it had adopted before, one after the other.
  void adopt_again(std::shared_ptr<const Model> model);
  /// Called once it has taken place; whoever holds the model or the state looks again.
  void on_adopted(std::function<void()> told) { adopted_told_ = std::move(told); }
  /// Where what had an index in the first model of this simulation is in model(): indices of the first one are ids that stay. What comes
  /// later has ids after them.
  const ModelMap& now() const { return now_; }
  /// The body with this id.
  const UserBody& user(int id) const { return model_->user[static_cast<std::size_t>(now_.body[static_cast<std::size_t>(id)])]; }
  /// State, commands and motion profiles of another simulation of the same vehicle.
  void take_over(const Simulation& other);
  /// InputError C0301 for an index that there is not, here and in all commands.
  double& q(int i) { return require_index("coordinate", i, model_->nq), changed(), state_.q[i]; }
  double& v(int i) { return require_index("velocity component", i, model_->nv), holds_.begin_anew = true, changed(), state_.v[i]; }
  /// A task that runs at every tick, in the order of these calls. Commands set by tasks hold until they are set again. Before the run, as
  /// watch(), add_event() and record(): InputError C0401 once it has begun.
  void every(Rational period, std::function<void()> task, Rational offset = {});
  /// The same of one that only looks: SimulationOptions::between_steps lets it lie inside of steps, where changing anything is refused.
  void watch(Rational period, std::function<void()> task, Rational offset = {});
  void add_event(Event event);
  /// The function of an event is another one from now on: the integrator starts anew.
  void events_changed() { start_anew_for(doing_); }
  /// What happens at instants that it chooses itself: `next` tells the one to come [s], infinite for none, at which a step ends and `work`
  /// is called, before the tasks of that instant; and once more after them, where they have chosen it.
  void at_instants(std::function<double()> next, std::function<void()> work) {
    next_instant_ = std::move(next), at_instant_ = std::move(work);
  }
  /// The motion of a prescribed component from now on; its coordinate goes on from where it is. InputError C0402 for a component
  /// that is not prescribed.
  void prescribe(int v_index, MotionProfile profile);
  /// The motion that a prescribed component was given; null: it was given none (and holds its initial rate), or is free.
  const MotionProfile* profile(int v_index) const;
  /// The same of the length or offset of a prescribed loop, which stands still until then. Where its rate jumps the vehicle takes it as a
  /// blow. InputError C0402 for a loop that is open or not prescribed.
  void prescribe_loop(std::string_view loop, MotionProfile profile);
  const MotionProfile* loop_profile(std::string_view loop) const;
  /// Before a run: InputError C1103 where initial rates move a length or offset that is given as a function of time, and no profile tells
  /// how.
  void expect_profiles();
  /// Loops that initial rates, and those of prescribed components, open, and prescribed ones that they move otherwise than their profiles
  /// begin, with these rates. From rest prescribed ones begin as their profiles.
  std::vector<std::pair<const Loop*, double>> loops_that_begin_otherwise();
  /// Of all prescribed loops that are closed, in the order of Loop::drive: how much more than the model's their length or offset is.
  std::span<const LoopDrive> drives() const { return drives_; }
  /// A wrench on a node, zero at first; returns its slot. world_axes: else node axes. InputError C0202 for a node that there is not.
  int add_wrench(int node, bool world_axes);
  /// Outputs are written at this period, at the start and at the end. The recorder must outlive the run.
  void record(Recorder& recorder, std::vector<Output> outputs, Rational period);

  // Commands, held between ticks -------------------------------------------------------------------------------------
  /// Generalised force of actuators on velocity component i [N m | N].
  double force(int i) const { return require_index("velocity component", i, model_->nv), tau_[static_cast<std::size_t>(i)]; }
  void set_force(int i, double value);
  /// slot: as add_wrench() told.
  void set_wrench(int slot, const Force<double>& f);
  /// Those of devices first, as observe() found them, then those of add_wrench().
  std::span<const NodeWrench> wrenches() const { return wrenches_; }
  /// An input of a device, index as in Devices::in0; commands of one that is connected are not read. A device that acts starts anew.
  void set_device_input(int i, double value);
  /// A port of a device has a fault from fault.from on, in place of one that it has then; an event in the results when it begins and ends.
  /// InputError C0301 for numbers out of range, a time that is over, noise of a device without ticks, and a port through which mass flows.
  /// `told`: where, for these errors.
  void fault(PortFault fault, const SourceMark& told = {});
  /// The port has no fault from now on, but for those to come; `device` is an id as in PortFault.
  void mend(int device, bool input, int place);
  /// Those that are there or to come.
  std::span<const RunningFault> faults() const { return faults_; }
  /// "gyro.rate_x"
  std::string told_port(const PortFault& fault) const;
  /// "stuck at 0 N m", "scale 0.5, bias 0.01 N m"
  std::string told_fault(const PortFault& fault) const;
  /// Of gravity that is a field, at the present state; null: it is none.
  const FieldMoment* gravity_moment() { return fields_ ? (observe(), moment_) : nullptr; }
  /// Evaluated at the present state; null where there are none.
  const DeviceForces* devices() { return devices_ ? (observe(), devices_.get()) : nullptr; }
  double device_input(int i) const { return devices_->input(i); }
  double device_output(int i) { return observe(), devices_->output(i); }
  /// [N m, N] of all actuators: force(i) and what devices push with, nv numbers.
  std::vector<double> applied_forces();
  /// Of the drives of components whose motion is given: what it needs beside springs, friction, devices and couplings there; nv numbers,
  /// zero for the others.
  void drive_forces(double* tau);
  /// What closed loops do at the present state.
  LoopForces loop_forces() { return observe(), cardan::loop_forces(workspace_); }
  /// Moment and force that a loop transmits to its end `to`, at that node, axes of the node `from`; index into Loops::all.
  Force<double> loop_wrench(int loop) { return observe(), cardan::loop_wrench(*model_, workspace_, loop); }
  /// [W] of all multipliers: that of prescribed loops.
  double loop_power() { return observe(), cardan::loop_power(*model_, workspace_, drives_.data(), false); }
  void stop() { stopped_ = true; }
  bool stopped() const { return stopped_; }

  // The run ----------------------------------------------------------------------------------------------------------
  /// Before the run: the recorder gets how the method went through each of these intervals, from StepHistory. A multiple of the period of
  /// record() adds no instant.
  void record_steps(Rational period) {
    watch(period, [this] { within_.looks ? void(within_.keep_steps = true) : keep_steps(); });
  }
  /// Between steps: ends an interval of the history here, as run() does at its end.
  void keep_steps();
  const StepHistory& step_history() const { return history_; }

  /// Runs to t_end, or until stop(). `progress` is called between steps. Throws NumericsError; then all results up to the
  /// last accepted state are written. InputError C0301 where t_end is not a number.
  void run(double t_end, const std::function<void(double t)>& progress = {});

  /// [s] Between two instants at which steps end, of what every() and the devices have asked for so far; infinite: of nothing.
  double shortest_period() const { return schedule_.shortest_period(); }

  /// How many steps of this run ended where nothing but what only looks was to happen.
  long ended_by_looking() const { return ended_by_looking_; }

  /// Before the run: takes the time of its parts.
  void take_times() { times_ = std::make_unique<RunProfile>(); }
  /// Null where they are not taken.
  const RunProfile* times() const { return times_.get(); }

  // Checkpoints ------------------------------------------------------------------------------------------------------
  /// Between steps, or in a task: all that the run goes on from, the tasks that are still to come at this instant included. The integrator
  /// starts anew, whether or not anybody keeps the checkpoint: a run that makes checkpoints at certain instants has the same bits after
  /// each of them as one that is resumed there. InputError C0401 in the action of an event.
  Checkpoint checkpoint();
  /// Before run(): goes on from a checkpoint of a simulation with the same model, options, tasks, events and wrenches. CheckpointFault
  /// where it does not fit.
  void resume(const Checkpoint& checkpoint);

  // What there is to see, between steps -------------------------------------------------------------------------------
  /// v' and all derived quantities at the present state; cheap when nothing changed since the last call.
  const Observer& observe();
  const Eigen::VectorXd& vdot();
  LedgerState ledger();
  /// Largest relative residuals seen at outputs and at the end.
  const LedgerState& worst_ledger() const { return balances_.worst(); }
  /// What did not stop the run: of the run itself, and what its owner adds.
  Warnings& warnings() { return warnings_; }
  const Warnings& warnings() const { return warnings_; }
  /// Adds one at the present time, and tells it if it is the first of its kind.
  void warn(Code code, Located at, std::string about, std::string hint);
  /// Called with each warning of the run when it comes up first, so that it can be told while the run goes on.
  void on_warning(std::function<void(const Warning&)> told) { told_ = std::move(told); }
  IntegratorStatistics statistics() const;
  /// x' = f(t, x), x = [q; v; z], with the commands as they are when it is called: what the integrator is given, of standard dynamics.
  /// Refers to this.
  OdeProblem ode();
  /// With `method = "auto"`, from the first use of the integrator on, why it is what it is; else empty.
  const std::string& why_integrator() const { return why_; }
  std::string integrator_name() const;
  /// Absolute tolerance of each state, [q; v; z], in its unit.
  std::vector<double> absolute_tolerances() const { return absolute_tolerances(*model_); }
  std::size_t workspace_bytes() const { return workspace_.bytes() + (devices_ ? devices_->bytes() : 0); }
  Energy energy();
  /// Of bodies, and what devices store beside them.
  Momentum momentum();

 private:
  static void require_index(const char* what, int i, Eigen::Index n) {
    if (i < 0 || i >= n) refuse_index(what, i, n);
  }
  [[noreturn]] static void refuse_index(const char* what, int i, Eigen::Index n);
  void build();
  void take_in();
  void changed() {
    if (within_.looks) refuse_inside();
    weigh(), start_anew_for(doing_), observed_ = ledger_known_ = false;
  }
  [[noreturn]] static void refuse_inside();
  void start_anew_for(RestartCause cause) {
    if (!restart_) restart_ = cause;
  }
  void weigh();
  bool rates(double t, const double* x, double* xdot);
  bool rhs(double t, const double* x, double* xdot);
  void integrands(double t, const double* x, double* ydot);
  bool acted_on() const;
  RunProfile::Part* timed(RunProfile::Part RunProfile::*part) { return times_ ? &((*times_).*part) : nullptr; }
  void time_calls(OdeProblem& ode);
  void diagonalise();
  const double* with_given_motion(double t, const double* x);
  void give_motion(double t, double* q, double* v) const;
  void start_given_motion();
  void start_lengths();
  void drive_loops(double t, double since, std::vector<LoopDrive>& drives) const;
  std::vector<double> absolute_tolerances(const Model& m) const;
  void apply_forces(double t, double since, const double* q, const double* v);
  bool act(double t, const double* q, const double* v);
  bool evaluate(double t, double since, const double* x, double* vdot);
  bool evaluate_twin(const double* x, double* vdot);
  void pack(double* x) const;
  const double* packed();
  void unpack(const double* x);
  /// The largest rate [rad/s, m/s], at least 1: what is far less is rounding.
  double scale_of_rates() const;
  /// Of the present state: what balances weigh.
  struct Sums {
    Momentum momentum;
    Energy energy;
  };
  Sums sums() { return {momentum(), energy()}; }
  /// Linear momentum [N s], angular momentum about the world's origin [N m s], both in world axes, and energy [J] that came since `before`.
  static Balances::Integrals gained(const Sums& before, const Sums& now);
  void device_roots(double t, const double* x, double* g);
  void roots_of_devices();
  void pass_roots(std::size_t before);
  /// As long as it is there velocities jump, by whatever; another may be within it. Where something fails in the middle nothing of it
  /// stays.
  class Jump {
   public:
    explicit Jump(Simulation& sim);
    ~Jump();
    Jump(const Jump&) = delete;
    Jump& operator=(const Jump&) = delete;
    /// Of devices, before it.
    std::vector<double> roots() const { return {sim_.passing_.begin() + from_, sim_.passing_.end()}; }
    /// The devices are others in the midst of it; 0 of those that do not count.
    void set_roots(const std::vector<double>& roots) {
      sim_.passing_.resize(static_cast<std::size_t>(from_)), sim_.passing_.insert(sim_.passing_.end(), roots.begin(), roots.end());
    }
    /// Devices feel it, and what it has carried across zero happens.
    void end();

   private:
    Simulation& sim_;
    std::ptrdiff_t from_;  // of passing_
    bool felt_ = false;
  };
  void motion_of_mounts(const Device& d, std::vector<cardan_mount_motion>& all);
  void feel_jump();
  void device_happens(int device, std::uint32_t root, int side);
  void start_device(int device);
  void start_devices(std::span<const int> but = {});
  Inputs hold_inputs(double t, const double* x);
  bool look_at_holds(double t, const double* x);
  void hold_roots(double t, const double* x, double* g);
  bool is_held(const DeviceHold& h) const;
  bool anything_is_held() const;
  double& mark_of(const DeviceHold& h);
  double hardly_moves() const;
  bool is_thrown_on(const DeviceHold& h) const;
  void break_away(std::size_t hold, int direction);
  void stop_what_is_held();
  void stop_rounding();
  void start_holds();
  void hold_again(const DeviceHold& h);
  void hold_what_rests_beside(std::span<const int> crossed);
  bool hold_what_is_blocked(const std::vector<int>& let_go);
  void settle_holds();
  void settle_holds(std::vector<int>& let_go);  // 1, -1: the way that a hold was let go
  bool hold_events(std::span<const int> crossed);
  void project(double t, double* x);
  int n_roots() const;
  void roots(double t, const double* x, double* g);
  bool close_loops(double t, double* q, double* v);
  /// After a step, where the loops are near a posture in which a row of them holds nothing.
  void pass_singular_posture(double t_stop);
  void tell_near_singular(const std::string& what);
  void tell_left_open(const double* q, const double* v);
  void keep_broken(double t, const double* q);
  void start_closed();
  bool device_events(std::span<const int> crossed);
  void sample_devices(bool late);
  void expect_before_run(const char* what) const;
  void add_task(Rational period, Rational offset, std::function<void()> work, bool looks, int device = -1);
  bool only_looks(int device) const;
  void let_inside();
  void tick_device(int device, double period);
  void sample_delays(int clock);
  void expire_commands();
  bool is_of_a_port(const PortFault& fault) const;
  void change_faults();
  void begin_faults_anew();
  void end_fault(std::ptrdiff_t i);
  void make_way(const RunningFault& begun);
  double unaltered(int port, bool input);
  double next_fault() const;
  void alter_ports();
  void renew(const PortFault& fault);
  void draw_faults(int device, bool inputs);
  Inputs inputs(const double* q, const double* v) const {
    return {.q = q,
            .v = v,
            .tau = tau_total_.data(),
            .vdot = vdot_given_.data(),
            .wrenches = wrenches_,
            .moment = moment_,
            .drives = drives_.data()};
  }
  int gravity_beyond(int sweep_body) const;
  std::string told_of_gravity() const;
  void expect_within_fields();
  RunFailure beyond_a_field(const FieldFault& fault) const;
  void say_held_fields();
  void make_integrator_once();
  void forget_failure();
  void remember(Archive& archive);
  void start_anew(Archive& archive);
  void settle();
  void restart();
  void begin();
  void step(double t_stop);
  void pass_crossings(std::span<const int> crossed);
  void tick();
  void pass_instant();
  double next_instant() const { return next_instant_ ? next_instant_() : std::numeric_limits<double>::infinity(); }
  void look_inside(double t_end);
  void handle_events(std::span<const int> crossed);
  std::string why_open() const;
  void write_outputs();
  double next_corner() const;
  void begin_ledger();
  void weigh_tolerances();  // what balances of the vehicle as it is now are worth at a rate of the absolute tolerances
  void say_doubts();
  void foresee_stiffness(double t_end);
  void say_stiff();
  void say_rounding(const StepReport& report);
  void say_whirling();
  void expect_finite(const std::vector<double>& x);
  std::string name_of(int v_index) const;
  std::pair<std::string, std::string> named_state(int state) const;
  RunFailure not_finite(int state, double value) const;
  RunFailure explain(const RunFailure&) const;
  [[noreturn]] void fail(RunFailure failure);
  /// Does it; false where a function of a plugin throws, which explain() tells then: asked again at x, the state that is tried, else at
  /// that of the run. Nothing of that goes through the integrators.
  template <class Work>
  bool unless_thrown(const Work& work, const double* x = nullptr) {
    try {
      work();
      return true;
    } catch (const InputError&) {
      throw;
    } catch (const NumericsError&) {
      throw;
    } catch (const std::exception& e) {
      keep_thrown(e.what(), x);
    } catch (...) {
      keep_thrown("an exception that is no std::exception", x);
    }
    return false;
  }
  void keep_thrown(const std::string& what, const double* x);
  void device_event(int device, std::uint32_t root, int direction);
  /// What a device pushes with all at once at an accepted instant, as its loads are before it takes note; strike() then does it.
  void ask_for_impulse(int device, std::uint32_t cause, int direction);
  void strike();
  /// The change of velocities by impulse_.wrenches and impulse_.hinges goes to impulse_.jump; and it happens, told as that of `by`.
  void find_jump();
  void jump(const std::string& by);
  /// What comes to a hard stop; `crossed`: of limits_, the side to which each was passed.
  void bounce(std::span<const int> crossed);
  void expect_good_plugins();

  std::shared_ptr<Model> own_;  // where masses vary: its own copy; else null
  std::shared_ptr<const Model> model_;
  std::function<Rejoined()> next_model_;  // from the end of this instant on
  std::string next_told_;
  ModelMap now_;
  SimulationOptions options_;
  State state_;
  Workspace workspace_;
  std::unique_ptr<Observer> observer_;
  std::unique_ptr<FieldMoments> fields_;  // of gravity that is a field; null: it is none
  int gravity_field_ = -1;
  std::string gravity_stopped_;                 // beyond which limit gravity was asked in a step; empty: it was not
  const FieldMoment* moment_ = nullptr;         // at the time of the last evaluation
  std::unique_ptr<DeviceForces> devices_;       // null: there are none
  bool stores_ = false;                         // some of them store momentum
  std::unique_ptr<DeviceForces> on_trial_;      // for their roots at trial states; null: there are none
  std::unique_ptr<Holding> holding_;            // of components that devices hold; null: there are none
  std::unique_ptr<Workspace> beside_;           // ... where they read nodes
  std::unique_ptr<LoopProjection> loops_;       // null: the vehicle is a tree
  bool told_left_open_ = false;                 // rows of these that others imply
  std::unique_ptr<MomentumKeeper> momentum_;    // of `exponential`, `multirate`; null: the vehicle does not float by itself
  bool drifted_ = false;                        // the history of the integrator is further from closed loops than its tolerance
  std::unique_ptr<NewtonOperators> newton_;     // where the linear solver asks for them
  std::unique_ptr<TwinDynamics<double>> twin_;  // of Dynamics::dense, once there is an integrator; else null
  std::vector<double> tau_twin_, qdot_twin_;    // its forces; its q' at the last evaluation
  double t_evaluated_ =
      std::numeric_limits<double>::quiet_NaN();  // with newton_ and devices: where devices were evaluated last in this step
  std::vector<double> x_evaluated_;
  std::unique_ptr<DiagonalisedForm> diagonalised_;  // between the integrator and rhs(); null: it integrates v
  std::unique_ptr<Integrator> integrator_;
  IntegratorStatistics of_former_models_;
  int adopted_ = 0;  // models, in the run
  Schedule schedule_;
  struct Task {
    std::function<void()> work;
    bool looks;  // and changes nothing ...
    int device;  // ... where the ticks of this one, an id, do not; -1: of none
  };
  std::vector<Task> tasks_;
  std::function<double()> next_instant_;  // of at_instants(); null: there are none
  std::function<void()> at_instant_;
  struct {
    bool looks = false;                       // now
    bool keep_steps = false, ledger = false;  // was asked for there: it follows where the step ends
    double t = 0.0;                           // [s] where the integrator is asked for the state
    std::vector<double> x;
    std::vector<std::pair<double, double>> event_ends;  // of the functions of events, at both ends of the step
  } within_;                                            // a step: the look of what only looks
  long ended_by_looking_ = 0;
  std::int64_t tick_ = 0;        // how-manieth of the task that runs
  bool actuators_tick_ = false;  // devices with inputs are on the schedule: after all tasks before record() or run()
  std::vector<double> noise_;
  struct {
    int by = -1;  // the device; none: there is nothing to do
    std::vector<cardan_mount_load> loads;
    std::vector<NodeWrench> wrenches;
    Eigen::VectorXd hinges, force, rest, jump;
  } impulse_;  // that strike() is to do
  DelayLines delays_;
  CommandAges ages_;
  std::vector<RunningFault> faults_;
  std::vector<Event> events_;
  struct Limit {
    int q, v, side;  // of the component; 1: an upper limit, -1: a lower one
    double value;
    Bounce bounce;
    std::size_t load;                                          // into Model::loads
    double passed = -std::numeric_limits<double>::infinity();  // [s] when, last
    bool ahead = false;  // a hard stop that the step at hand began before: until it is passed, which is located, there is none
  };
  /// Or beyond it. In the instant in which it is passed that is known to rounding.
  bool is_at(const Limit& limit) const;
  double inwards(const Limit& limit) const;
  std::string told(const Limit& limit) const;
  bool turn_over(std::span<Limit* const> together);
  std::vector<double> loads_at_;  // coordinates of Model::loads as apply_forces() took them
  std::vector<Limit> limits_;     // of stops: where q passes one the right-hand side has a corner
  struct Prescribed {
    int index;       // into v
    int coordinate;  // into q, where that is the integral of v; else -1
    MotionProfile profile;
    bool given = false;           // by prescribe(); else it keeps the rate it starts with
    double t_0 = 0.0, q_0 = 0.0;  // where the integral starts: at the last start of the integrator
  };
  std::vector<Prescribed> prescribed_;
  struct PrescribedLoop {
    std::string name;
    MotionProfile profile;
    bool given = false;
    double t_0 = 0.0, more_0 = 0.0;  // by how much it was more at the last start of the integrator
    double more(double t) const { return more_0 + profile.travel(t_0, t); }
  };
  std::vector<PrescribedLoop> prescribed_loops_;  // in the order of Loop::drive
  std::vector<LoopDrive> drives_;                 // at the time of the last evaluation
  bool struck_by_loops_ = false;                  // the rate of one has jumped, which the vehicle has still to follow
  Inputs acting_;                                 // of the method `ida`, as act() left them
  std::vector<double> tau_, tau_total_;           // of actuators; with springs and dampers, which evaluate() sets where they act
  std::vector<double> vdot_given_, x_, x_now_;    // x_now_: of packed()
  /// Of closed loops: states of one smooth stretch of motion that were reached, the newest first, with their smallest pivots, which fall.
  struct Trail {
    struct Reached {
      double t = 0.0, pivot = 1.0;
      std::vector<double> x;
    };
    std::array<Reached, 5> all;
    int n = 0;
    void add(double t, double pivot, const std::vector<double>& x);
  } trail_;
  struct {
    bool begin_anew = false;        // at settle_holds(): rates were set, or what loads them was commanded for the first time
    std::vector<double> tau, vdot;  // scratch
    std::vector<LoopDrive> drives;  // likewise
    std::vector<int> let_go;        // likewise
  } holds_;                         // Devices::holds in a run
  std::vector<double> passing_;     // roots of devices before the jumps that are under way, those of the innermost last
  struct {
    int depth = 0;  // jumps within jumps
    struct Device {
      std::vector<cardan_mount_motion> mounts, before, jumped;  // up to `mounts` it has felt what has jumped; the others are scratch
      bool is_known = false;
    };
    std::map<std::string, Device> devices;  // those with `follow`
  } felt_;
  std::vector<double> x_given_;                               // a state of the integrator with the given motions put in
  double stretch_ = std::numeric_limits<double>::infinity();  // [s] during a step: a time on its stretch between two corners
  std::vector<NodeWrench> wrenches_;
  Eigen::VectorXd vdot_;
  bool normalised_ = false;  // some coordinates have a norm to keep
  std::vector<int> roots_;   // user bodies on the world
  Recorder* recorder_ = nullptr;
  std::vector<Output> outputs_;
  std::vector<double> row_;
  double last_output_ = -1.0;
  std::string why_;
  std::unique_ptr<RunProfile> times_;
  std::optional<RestartCause> restart_ = RestartCause::start;  // of the integrator, before its next step
  RestartCause doing_ = RestartCause::start;                   // why it starts anew where something changes now
  StepHistory history_{[this](int state) {
    const auto [body, what] = named_state(state);
    return body + "." + what;
  }};
  bool observed_ = false, stopped_ = false, begun_ = false, world_rates_ = false;
  bool jumped_ = false;    // rates, by a blow where what runs now came to pass
  bool in_event_ = false;  // the action of one runs
  /// What stood in the way of the last evaluation that failed in a step, or as loops were closed: what explain() tells.
  struct Obstacle {
    soa::Breakdown breakdown;
    double t = 0.0;         // [s] of a row of loops: where ...
    std::vector<double> q;  // ... it was
    std::vector<LoopDrive> drives;
    int bad_rate = -1;    // index into v' of a value that is not finite
    double vdot = 0.0;    // that value
    std::string culprit;  // the plugin that gave no number there; empty: none did
    void forget() { breakdown = {}, bad_rate = -1, culprit.clear(); }
  } obstacle_;
  struct {
    double pivot = 1.0, t = 0.0;
  } nearest_;             // of closed loops: to a singular posture, in the run
  std::string thrown_;    // what a function of a plugin threw, and whose it is
  bool plugins_ = false;  // there are some
  Balances balances_;
  LedgerState ledger_;  // at the present state, if known
  bool ledger_known_ = false, warned_stiff_ = false;
  bool foreseen_ = false;  // expected stiffness was looked for
  Headway headway_;
  double t_end_ = 0.0;  // [s]
  Warnings warnings_;
  std::function<void(const Warning&)> told_;
  std::function<void()> adopted_told_;
};

}  // namespace cardan
