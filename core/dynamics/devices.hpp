#pragma once
// The devices of a model in a right-hand side: how their mounts move, what they push with, z', and what their ports give.
// docs/mathematics/devices.md.
#include <span>
#include <utility>
#include <vector>

#include "core/dynamics/device_mounts.hpp"
#include "core/dynamics/fields.hpp"
#include "core/dynamics/forward.hpp"
#include "core/dynamics/mass_flow.hpp"

namespace cardan {

/// What devices read beside q and v, and where they put their loads. Inputs::tau and Inputs::wrenches show the same memory.
template <class T>
struct DeviceState {
  double t = 0.0;                          // [s]
  const T* z = nullptr;                    // continuous states
  const double* marks = nullptr;           // discrete ones
  T* tau = nullptr;                        // what they push with at hinges is added here
  soa::NodeWrench<T>* wrenches = nullptr;  // Devices::n_loads of them, in node axes; written
};

/// What went wrong in the last evaluation.
struct DeviceFault {
  int device = -1;   // index into Devices::all; -1: nothing
  std::string what;  // "force of mount to = nan", "evaluate returned 3"
};

/// Whose function is called.
struct ForeignCall {
  int device = -1;  // index into Devices::all; -1: none
  const char* function = "";
};

/// A port with a fault: whoever reads it gets scale x + offset + drift (t - since) in place of x, which is its own value or another's.
struct AlteredPort {
  int index;                                                   // as in Devices::in0, or of all outputs
  double scale = 1.0, offset = 0.0, drift = 0.0, since = 0.0;  // [-], [unit of the port], [unit of the port / s], [s]
  int of = 0;                                                  // so many ports further on is the one whose value x is, in the same device
  mutable double x = 0.0;                                      // as it was before any of them was altered
};
/// All of these; `values` by their indices.
inline void alter_ports(std::span<const AlteredPort> ports, double* values, double t) {
  for (const AlteredPort& p : ports) p.x = values[p.index + p.of];
  for (const AlteredPort& p : ports) values[p.index] = p.scale * p.x + p.offset + p.drift * (t - p.since);
}

/// All devices of a model, in double. Keeps what the last evaluation found.
class DeviceForces : public StateLoads<double> {
 public:
  /// `own`: the same model where its masses may vary, for set() to put them in; null: they stay as they are.
  explicit DeviceForces(const Model& model, Model* own = nullptr);
  DeviceForces(const DeviceForces& other);  // with what its last evaluation found
  DeviceForces& operator=(const DeviceForces&) = delete;

  /// Of inputs that are commanded, device by device; those of connected ones are not read. SI.
  std::vector<double> commands;

  /// Ports with faults from the next evaluation on, and no others; each once.
  void alter(std::vector<AlteredPort> inputs, std::vector<AlteredPort> outputs);
  /// One of these inputs or outputs with other numbers.
  void alter(bool input, const AlteredPort& port);
  /// Commands and faults of another one of the same model.
  void take_commands(const DeviceForces& other);

  void set(const DeviceState<double>& state);
  /// At the states and the time that it has, what it pushes with goes here from now on, as DeviceState says.
  void put_into(double* tau, NodeWrench* wrenches) { state_.tau = tau, state_.wrenches = wrenches; }
  /// Masses are those of set() again, after somebody else has used the model.
  void weigh_again();
  bool act(Workspace& ws, const Inputs& in) override;
  /// z' that hangs on v', and how the bodies move whose mass varies, for derivatives.
  bool follow(const Workspace& ws, const Inputs& in, const double* vdot) override { return follow(ws, in, vdot, After::forward); }
  bool follow(const Workspace& ws, const Inputs& in, const double* vdot, After after);
  /// Between steps, after act() at the same state, with poses and velocities in the world: the devices that the motion does not depend on,
  /// and mounts that are read at ticks.
  bool complete(Workspace& ws, const Inputs& in);
  /// How the mounts move at a trial state, without dynamics, inputs as `known` has them. `ws`: null where no mount reads a node.
  void look_at(const DeviceForces& known, Workspace* ws, const Inputs& in);
  /// Without sweeps: at mounts that move as they did in the last evaluation.
  bool evaluate();

  // Of the last evaluation
  double time() const { return args_.empty() ? 0.0 : args_[0].t; }  ///< [s]
  const double* zdot() const { return zdot_; }                      ///< Devices::n_z numbers [unit of the state / s]
  double state(int i) const { return z_[i]; }
  double output(int i) const { return out_[i]; }
  double input(int i) const { return in_[i]; }
  /// [N m, N] The most that a device holds its component with.
  double most_held(int device) const { return model_.devices.all[device].family->holds(&args_[device]); }
  /// What mass that leaves takes along, for the ledger.
  LeavingMass leaving(const FieldMoment* at) const { return leaving_mass(model_, motions_.data(), z_.data(), zdot_, marks_.data(), at); }
  /// Angular momentum that devices store beside that of bodies [N m s], world axes.
  Vec3<double> stored_momentum() const;
  /// [moment about the world's origin; force], world axes, of the loads of those that store it: they change no momentum of the whole.
  Force<double> storing_loads() const;
  /// tau += what devices push with at hinges.
  void add_hinge_forces(double* tau) const;
  /// [J] stored, of those that declare it (CARDAN_FACT_ENERGY).
  double energy() const;
  /// [W] Of one at the last evaluation; zero where it does not declare its energy.
  struct Powers {
    double delivered, lost;
  };
  Powers powers(int device) const { return {outs_[device].delivered, outs_[device].lost}; }
  /// [W] delivered - lost - power of the loads of those that declare their energy: what is to be added to the power of all loads so that
  /// it is the rate of the mechanical energy and that of devices.
  double unseen_power() const;
  /// Where something happens: Devices::n_roots numbers.
  void roots(double* g) const;
  /// Where fields have corners, after look_at(): Devices::n_edges numbers.
  void edges(double* g) { fields_.edges(time(), motions_, g); }
  /// Lets a device change its states and marks; root = its n_roots: the start.
  void event(int device, std::uint32_t root, int direction, double* z, double* marks) const;
  /// The sampled part of a device at mounts that move as they do now; false: fault() tells why.
  bool tick(int device, double period, const double* noise, double* z, double* marks);
  /// [N s], [N m s] What it pushes with all at once, per mount, just before event() or tick() with the same arguments.
  bool impulse(int device, std::uint32_t cause, int direction, std::vector<cardan_mount_load>& loads);
  /// Those with `follow`.
  std::span<const int> following() const { return following_; }
  /// What states that follow from accelerations take of a jump of velocities, which is in alpha, specific_force and vdot of the mounts:
  /// z' is affine in these, and their integrals over the jump are finite. They are zero after it. False: fault() tells why.
  bool feel(int device, std::span<cardan_mount_motion> mounts, double* z);
  /// Where the accelerations of a mount go before its tick; zero again after it.
  cardan_mount_motion& motion_of_tick(int mount) { return motions_[mount]; }
  const DeviceFault& fault() const { return fault_; }
  /// Of a call that did not come back but threw: whose it was. Index of the field likewise; -1: none.
  const ForeignCall& called() const { return called_; }
  int field_asked() const { return fields_.asked(); }
  /// Asks `evaluate` of a device once more at what it was asked last, with words around all that it may write: what is wrong with its
  /// answer; empty: nothing.
  std::string ask_again(int device) const;
  void visit_fields(const FieldsOfDevices::Visit& visit) { fields_.visit(time(), motions_, visit); }
  /// Beyond a limit of a field that is refused; null: nowhere.
  const FieldFault* passed_limit() const { return fields_.passed_limit(); }
  /// The same of a step that was tried since forget_limit(), where the field knows no value.
  const FieldFault* tried_limit() const { return fields_.tried_limit(); }
  void forget_limit() { fields_.forget_limit(); }
  /// Bits of limits beyond which a field held its value, by field.
  const std::vector<int>& held_fields() const { return fields_.held(); }
  std::size_t bytes() const;

 private:
  friend class DeviceTangents;
  struct Range {
    int begin, end;
  };
  struct Call {
    int (*evaluate)(const cardan_device_args*, cardan_device_out*);
    const cardan_device_args* args;
    cardan_device_out* out;
    int device;
    bool connected;                             // one of its inputs is
    Range given, added;                         // in given_, added_
    Range altered_in{0, 0}, altered_out{0, 0};  // in altered_in_, altered_out_
  };
  bool look_at_fields(bool in_steps);
  bool evaluate_acting();
  bool evaluate_others();
  bool evaluate(const std::vector<Call>& calls, const std::vector<Range>& numbers);
  void take_connected(const Call& call);
  static std::span<const AlteredPort> part(const std::vector<AlteredPort>& all, const Range& range) {
    return std::span(all).subspan(static_cast<std::size_t>(range.begin), static_cast<std::size_t>(range.end - range.begin));
  }
  /// What `follow` of a device reads.
  cardan_device_args followed(int device) const;
  void zero(const std::vector<Range>& numbers);
  void zero(int device);
  bool expect_finite(int device);

  const Model& model_;
  Model* own_ = nullptr;
  std::string mass_fault_;
  int mass_fault_of_ = -1;
  std::vector<Force<double>> flow_loads_;  // per load
  std::vector<VaryingMotion> varying_;
  DeviceState<double> state_;
  FieldsOfDevices fields_;
  std::vector<Call> first_, acting_, others_;  // in the order of evaluation
  Mounts in_steps_, between_, pushed_;         // mounts that are read in steps, between them alone; that devices push at
  std::vector<int> following_;                 // devices with `follow`
  std::vector<double> felt_;                   // z' of one of them with a jump, and without
  Mounts followed_;                            // their mounts, and how these move in it
  std::vector<cardan_mount_motion> motions_, followed_motions_;
  std::vector<double> z_, marks_, in_;
  std::vector<double> effects_;  // all that devices fill: loads, z', outputs; below: where they begin
  cardan_mount_load* loads_ = nullptr;
  double *zdot_ = nullptr, *out_ = nullptr;
  std::vector<Range> acting_numbers_, other_numbers_;  // in effects_
  std::vector<cardan_device_args> args_;               // per device
  std::vector<cardan_device_out> outs_;
  std::vector<std::pair<int, int>> given_;  // connected inputs, device by device, and the outputs they hang on
  std::vector<AddedOutput> added_;          // outputs that are added to those, likewise
  std::vector<Range> commanded_;            // the other inputs
  // By index: of commanded inputs, of connected ones, of outputs.
  std::vector<AlteredPort> altered_commands_, altered_in_, altered_out_;
  DeviceFault fault_;
  mutable std::vector<Vec3<double>> stored_;  // of one device: stored_momentum()
  mutable ForeignCall called_;
};

}  // namespace cardan
