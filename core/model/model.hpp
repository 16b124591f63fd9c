#pragma once
// The compiled system: immutable, numbered, SI. Bodies stand in sweep order (level by level, inboard before outboard);
// what the user sees (order of q, v and results, body frames) is kept in UserBody and never enters a sweep.
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/abi/cardan_device.h"
#include "core/abi/registry.hpp"
#include "core/model/coupling.hpp"
#include "core/model/spec.hpp"
#include "core/model/state.hpp"
#include "core/model/sweep_model.hpp"
#include "core/spatial/eigen_bridge.hpp"

namespace cardan {

struct Embedding;
struct AbsoluteModel;

/// A body as the user named it.
struct UserBody {
  std::string name, type, hinge_type;
  int sweep = 0;              // the sweep body that carries it (shared when merged; 0: fixed to the ground)
  bool merged = false;        // rigidly part of another sweep body
  int parent = -1;            // user index of the inboard body, -1 = world
  Pose<double> pose;          // user's body frame in the sweep frame
  Pose<double> pnode, onode;  // P in the user's body frame; O in the inboard user's frame (undeformed)
  Pose<double> merged_hinge;  // P in O when the hinge is fixed
  RigidInertia<double> M;     // own inertia in the user's frame (rigid)
  double mass = 0.0;          // [kg]
  const cardan_body_family* family = nullptr;
  const cardan_hinge_family* hinge = nullptr;
  std::string family_origin, hinge_origin;  // "built-in", or the path of the plugin
  std::vector<double> hinge_packed;
  int q = 0, nq = 0, v = 0, nv = 0;  // hinge coordinates (0 when locked)
  int n_modes = 0, eta = 0, etadot = 0;
  std::vector<std::string> q_names, v_names, q_units, v_units;

  /// True where the coordinates are a quaternion, and after it perhaps a position: a fact of the family. False of a locked hinge.
  bool has_attitude() const { return nq > 0 && has_quaternion(*hinge); }
};

/// Coordinates whose rates are velocities as they stand: q'[q ... q + n) = v[v ... v + n).
struct PlainRates {
  int q, v, n;
};

/// One line of the program of sweeps.
enum class OpCode : std::uint8_t {
  hinge_records,
  outward,
  elastic,
  world,
  central_gravity,
  devices,
  node_wrenches,
  keep,
  inward,
  acceleration,
  refine,
  loops,
  embedding,
  absolute
};
struct Op {
  OpCode code;
  int run = -1;  // index of the run, -1 = all bodies
};

/// Where a device reads and pushes.
struct DeviceMount {
  std::uint32_t use = 0;    // cardan_mount_use
  int node = -1, load = 0;  // index into SweepModel::nodes, and which wrench of devices it writes; -1: it is at a hinge
  int q = -1, v = -1;       // of a hinge component; q = -1: it has no coordinate of its own
  /// Of a hinge component that is not there, as the hinge is locked or gone: it is read there, at rest, and pushing has no effect.
  std::optional<DeviceSpec::Mount::Last> still{};
  int field = -1, at = -1;  // index into Model::fields, and which mount of the device tells the place; -1: it is no field
  Pose<double> ground{};    // of one at the world: its axes and origin
  /// Of a device that reads what lies between its nodes: the sweep body that its places are counted from, and those outboard of it to that
  /// of the node, so that they keep their digits far from the origin of the world; 0: counted from there.
  int home = 0;
  std::vector<int> way{};
};

/// Of what a plugin brought and no part of the program or of its script.
inline bool is_of_plugin(const std::string& origin) { return origin != "built-in" && origin != "the script"; }

/// A field with its name. GravityField::source points at one of these sources.
struct Field {
  std::string name, origin;  // "built-in", or the path of the plugin
  std::shared_ptr<const FieldSource> source;
};

/// Bodies are pulled one by one, and what they have of it is in the energy: there is a potential, which does not depend on time.
inline bool pulls_with_energy(const GravityField& g) {
  constexpr unsigned kBoth = CARDAN_FIELD_POTENTIAL | CARDAN_FIELD_STEADY;
  return g.central || (g.source && (g.source->family->facts & kBoth) == kBoth);
}

struct Device {
  std::string name, origin;  // "built-in", "the script", or the path of the plugin
  int spec = 0;              // index into SystemSpec::devices
  const cardan_device_family* family = nullptr;
  std::vector<double> packed;
  std::vector<DeviceMount> mounts;
  int n_in = 0, n_out = 0;
  int z = 0, mark = 0, in = 0, out = 0, mount = 0, root = 0;  // where its own begin
  bool acts = false;  // pushes, has states that do not only follow, or gives something to a device that does: its marks change the motion
};

/// Mass that a device gives to a body beside its own (cardan_device_family::mass).
struct DeviceMass {
  int device = 0, mount = 0;  // `mount`: which of its mounts
  int user = 0;               // the body
  RigidInertia<double> own;   // of the body alone, its frame
  double own_mass = 0.0;      // [kg]
};
/// About the origin of the body.
RigidInertia<double> inertia_of(const cardan_mass&);
/// What the masses of a sweep body are without those.
struct VaryingBody {
  int sweep = 0;
  RigidInertia<double> M, M_sweep;
  Sym3<double> J_P;
};
/// Mass that goes from a device that has it to where it leaves the vehicle.
struct MassFlow {
  int from = 0;               // index into Devices::masses
  int output = 0;             // [kg/s]
  int device = 0, mount = 0;  // the outlet
};
/// A component that a device holds while its first mark is not 0: it takes no part in the dynamics then, as one whose motion is given.
struct DeviceHold {
  int device = 0, v = 0;
};
/// Corners of a field that end steps, where a device that acts reads it: one place for each field and vehicle, as edges lie a step apart
/// and mounts of one vehicle do not.
struct FieldEdges {
  int field, mount;  // index into Model::fields; of all mounts, the node
  int first, n;      // of Devices::n_edges
};
/// A further output that is added to an input.
struct AddedOutput {
  int in, out;
};
/// An input that gets the sum of outputs as it was some ticks ago, and holds it in between; in Devices::from it is commanded.
struct DelayLine {
  int input;
  std::vector<int> outs;
  int clock;           // index into Devices::all: whose ticks
  int ticks = 0;       // 0: as `latency` says
  double latency = 0;  // [s]
  double fallback = 0;
};
/// That a delay or latency may have.
inline constexpr int kMostTicks = 1'000'000;
/// A command that becomes `safe` when nobody has set it for `timeout` [s].
struct CommandTimeout {
  int input;
  double safe, timeout;
};

/// All devices by name, so that the order in which they are described changes no bit, and what their ports hang on.
struct Devices {
  std::vector<Device> all;
  int n_z = 0, n_marks = 0, n_in = 0, n_out = 0, n_mounts = 0, n_roots = 0, n_loads = 0;
  std::vector<double> z0, marks0, in0, nominal;  // initial values; of z its size in use
  std::vector<int> from;                         // per input: the output that it is given, -1: it is commanded
  std::vector<AddedOutput> added;                // by input, then by output
  std::vector<DelayLine> delays;
  std::vector<CommandTimeout> timeouts;
  std::vector<int> order;            // of evaluation: who gives before who takes
  std::vector<int> first;            // evaluated once before: their outputs are taken earlier, and need no input themselves
  bool reads_nodes = false;          // some mount reads the motion of a node
  bool rough = false;                // CARDAN_FACT_ROUGH of any
  bool from_home = false;            // what acts between nodes is counted from the home of its mounts
  std::vector<DeviceMass> masses;    // in the order of devices
  std::vector<VaryingBody> varying;  // the bodies that carry them
  std::vector<MassFlow> flows;
  std::vector<DeviceHold> holds;          // in the order of devices
  std::vector<FieldEdges> edges;          // in the order of devices
  int n_edges = 0;                        // functions of all of them
  int find(std::string_view name) const;  // -1 if unknown
  bool is_commanded(int input) const;     // by scripts: no device gives it anything, at once or later
  /// visit(output) for each that input `in` is given.
  template <class Visit>
  void each_source(int in, const Visit& visit) const {
    if (from[static_cast<std::size_t>(in)] < 0) return;
    visit(from[static_cast<std::size_t>(in)]);
    for (const AddedOutput& a : added)
      if (a.in == in) visit(a.out);
  }
};

struct LoopEnd {
  int node = -1;      // index into SweepModel::nodes; -1: a place on the ground
  int sweep = 0;      // the sweep body that carries it
  Pose<double> pose;  // of a place on the ground, in the world
};
/// One closure of the open tree.
struct Loop {
  std::string name, type;
  int spec = 0;  // index into SystemSpec::loops, some of which may be open
  Closing closing = Closing::point;
  int first = 0, rows = 0;  // of all rows
  LoopEnd from, to;
  int home = 0;                         // nearest common ancestor of the bodies of both ends
  std::vector<int> from_path, to_path;  // sweep bodies from the one outboard of home to that of the end
  std::vector<int> rates;               // velocity components that move one end relative to the other; ascending
  double length = 0.0;                  // [m] distance
  const cardan_hinge_family* hinge = nullptr;
  std::vector<double> packed, q0;  // of the hinge; q0: its coordinates at the start
  Coupling coupling;
  int drive = -1;          // of what is given as a function of time: where Inputs::drive has it
  double lever = 1.0;      // [m] of its size: what compares radians with metres; of a coupling that is not linear its largest slope
  double reference = 1.0;  // what a pivot of its scaled rows is compared with
  /// Its rows hang on the coordinates.
  bool turns() const { return closing != Closing::coupling || !coupling.is_linear(); }
};

/// A coordinate or a rate of the start as it was given and as it closes the loops.
struct MovedAtStart {
  std::string name, unit;  // "rocker.angle", "rad"
  double given, found;
  bool described = false;  // `initial` of its hinge gives it
};

/// What closes the loops of the tree, and what scales their rows.
struct Loops {
  std::vector<Loop> all;
  int rows = 0;
  int rank = 0;                                   // of all rows at the start
  double dependent = 0.0;                         // a scaled pivot below was none there
  bool left_open = false;                         // a row that others imply is open there by what numbers were typed with
  int n_drives = 0;                               // rows that are given as functions of time
  std::vector<double> column_scale;               // per velocity component: 1 / sqrt(inertia) at the start
  std::shared_ptr<const Embedding> embedding;     // how they are closed inside of the sweeps; null: by multipliers over the open tree
  std::shared_ptr<const AbsoluteModel> absolute;  // the bodies in absolute coordinates, of the form `dae`; else null
  std::vector<LoopSet> sets;                      // loops that share hinges, and what became of them
  std::vector<MovedAtStart> moved;                // by the assembler; empty: the start that was given is closed
  bool empty() const { return all.empty(); }
  int find(std::string_view name) const;  // -1: there is none, or it is open
};

struct Model : SweepModel {
  // As the compiler makes them, compiled once (model.cpp): two seconds of each file that copies a model.
  Model();
  Model(const Model&);
  Model(Model&&) noexcept;
  Model& operator=(const Model&);
  Model& operator=(Model&&) noexcept;
  ~Model();

  std::string name;
  std::vector<HingeLoad> loads;
  std::vector<Field> fields;  // in the user's order
  Devices devices;
  Loops loops;
  GravitySpec gravity;
  std::vector<UserBody> user;  // in the user's order
  std::vector<int> owner;      // per sweep body: the user's body whose hinge is its hinge; -1: the ground
  std::vector<PlainRates> plain_rates;
  std::vector<int> curved;                                                    // user indices of the others: q' is up to their hinge
  std::vector<Op> program;                                                    // forward dynamics, in order of execution
  bool changes() const { return !varies.empty() || !devices.holds.empty(); }  // weigh() does something
  std::vector<std::uint8_t> varies;                                           // per sweep body: its mass does, by devices; empty: none does
  std::string refinement;                                                     // why OpCode::refine is in it; empty: it is not
  bool has(OpCode code) const {
    for (const Op& op : program)
      if (op.code == code) return true;
    return false;
  }
  std::shared_ptr<const SystemSpec> spec;

  /// Index into `user` / `nodes`; -1 if unknown.
  int find_body(std::string_view name) const;
  int find_node(std::string_view name) const;
  /// The first body whose family tells how its nodes move (cardan_body_family::node); null: there is none.
  const UserBody* find_curved_nodes() const;
  /// Puts the masses that devices give to bodies at these states and marks into all that has the mass of a body, and what
  /// they hold into `prescribed`. Empty: done; else the fault and the device. Such a model is for one user at a time: Simulation has its
  /// own.
  std::string weigh(const double* z, const double* marks, int& device);
  /// A copy with the masses, and what is held, of these states and marks of devices.
  Model weighed(const double* z, const double* marks) const;
  /// This velocity component follows a function of time; what a device holds stands still by a force and does not.
  bool has_given_motion(int v) const;
  State initial_state() const;
  /// q' = N(q) v, user order.
  void qdot(const double* q, const double* v, double* qdot) const;
  /// Unit quaternions and the like.
  void normalise(double* q) const;
  /// q moved by the tangent vector d (nv numbers): per hinge its retract, modes added.
  void retract(const double* q, const double* d, double* out) const;
  void difference(const double* q1, const double* q2, double* d) const;
};

struct CompileOptions {
  bool merge_locked = true;     // rigid bodies fixed to rigid bodies become one
  bool choose_frames = true;    // re-choose the frames of rigid bodies for the axis kernels (results stay in the user's)
  bool node_wrenches = true;    // the program takes wrenches on nodes
  bool world_wrenches = false;  // ... also such that are given in world axes
  bool from_home = false;       // Devices::from_home, also where the description tells of nothing that is far
};

/// All user errors of a description end here: throws InputError with everything that was found. Where masses grow by large ratios
/// per link it tries the model at some states, hence core/dynamics/compile.cpp.
std::shared_ptr<const Model> compile(const SystemSpec& spec, const Registry& registry, const CompileOptions& options = {});
/// The same; the model shares the description instead of keeping a copy.
std::shared_ptr<const Model> compile(std::shared_ptr<const SystemSpec> spec, const Registry& registry, const CompileOptions& options = {});
/// Its first part: numbers, frames, kernels, program. `graded`: with SweepModel::graded, for a tree of rigid bodies.
std::shared_ptr<Model> assemble(std::shared_ptr<const SystemSpec> spec, const Registry& registry, const CompileOptions& options,
                                bool graded);

}  // namespace cardan
