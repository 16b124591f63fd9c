#pragma once
// The editable description of a system: named, in SI, and aware of where each value came from. Nothing is numbered here
// (names exist before compile(), numbers after it). Written by the YAML reader, by Lua and by C++; read by compile() and
// by the dense twin.
#include <Eigen/Core>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/base/diagnostic.hpp"
#include "core/base/warnings.hpp"
#include "core/model/hinge_load.hpp"
#include "core/model/loop_form.hpp"
#include "core/spatial/modal_data.hpp"

namespace cardan {

/// A parameter as it stands in the input, already in SI: number, list of numbers (vectors; lists of vectors and rows of tables one
/// after the other), text (a choice; the path of a file), truth value.
struct ParamValue {
  std::variant<double, std::vector<double>, std::string, bool> value;
  Located at{};
  std::string file{};  // as the input names it, of a file and of a table that was read from one
};
struct DocNode;
using ParamValues = std::map<std::string, ParamValue, std::less<>>;

/// A point of a body where hinges, wrenches and sensors attach. Node axes N.
struct NodeSpec {
  std::string name;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // [m] body axes, undeformed
  Eigen::Matrix3d R_BN = Eigen::Matrix3d::Identity();  // node axes to body axes, undeformed
  Located at;
};

/// A linear spring and damper in parallel with one velocity component of a hinge: tau = -k (q - rest) - c v.
struct SpringDamper {
  int component = 0;
  double stiffness = 0.0, rest = 0.0, damping = 0.0;  // [N m/rad | N/m], [rad | m], [N m s/rad | N s/m]
  Located at;
};

/// Another law of force on one velocity component of a hinge.
struct HingeLoadSpec {
  int component = 0;
  HingeLaw law = HingeLaw::stop;
  HingeLoad::Parameters parameters{};  // SI
  Located at;
  Bounce bounce{};  // of a stop
};

/// How D = H P H* of a hinge is factored (docs/mathematics/tree_algorithms.md, 11).
enum class HingeFactor : std::uint8_t {
  cholesky,
  square_root  // by L* H* = Q T of P = L L*, D = T* T: near a place where the columns of H* become dependent, as the lock of a gimbal
};

/// Inboard hinge of a body: joins onode O (on the inboard body, or on the world) to pnode P (on the body).
struct HingeSpec {
  std::string type = "locked";
  std::string inboard_body;  // "" = world
  std::string inboard_node;  // "" = origin of the inboard body (or of the world)
  std::string body_node;     // "" = origin of the body
  // O and P may also be given in place, without a node name; used when the name is empty:
  Eigen::Vector3d onode_position = Eigen::Vector3d::Zero(), pnode_position = Eigen::Vector3d::Zero();  // [m]
  Eigen::Matrix3d onode_R = Eigen::Matrix3d::Identity(), pnode_R = Eigen::Matrix3d::Identity();        // node axes to body axes
  ParamValues params;        // checked against the family's schema by compile()
  std::vector<double> q, v;  // initial values; empty = the family's zero
  /// Of prescribed components, in place of v: with what their profiles begin. Nothing is given by that to the others of the hinge.
  std::vector<std::pair<int, double>> begins;
  bool locked = false;          // held at q: no velocity components
  std::vector<int> prescribed;  // velocity components whose motion is given as a function of time
  std::vector<SpringDamper> springs;
  std::vector<HingeLoadSpec> loads;  // stops, friction
  HingeFactor factor = HingeFactor::cholesky;
  Located at;
};

/// On the world, at its origin, free in all six directions.
inline bool flies(const HingeSpec& h) {
  return h.type == "free" && h.inboard_body.empty() && !h.locked && h.prescribed.empty() && h.onode_position.isZero(0.0) &&
         h.onode_R.isIdentity(0.0);
}

struct BodySpec {
  std::string name;
  std::string type = "rigid";                             // a family of the registry
  double mass = 0.0;                                      // [kg] unless it is that of modal data; so com, inertia_com
  Eigen::Vector3d com = Eigen::Vector3d::Zero();          // [m] body axes
  Eigen::Matrix3d inertia_com = Eigen::Matrix3d::Zero();  // [kg m^2] about the mass centre, body axes
  ParamValues params;                                     // of its family, checked by compile()
  std::shared_ptr<const ModalData> modal;                 // of a body with modes
  std::shared_ptr<const DocNode> modal_source;            // how to make `modal`, as written; may be null
  int level = 1;                                          // fidelity level 0, 1, 2 of a flexible body (docs/mathematics)
  double rotary_tolerance = 1e-4;                         // of a modal mass: terms of nodal rotary inertia below are left out; 0: none
  std::vector<double> eta, etadot;                        // initial modal coordinates; empty = 0
  std::vector<int> prescribed_modes;                      // modes whose motion is given as a function of time
  std::vector<NodeSpec> nodes;                            // rigid bodies; a flexible body takes those of its modal data
  HingeSpec hinge;
  Located at;
};

/// What acts on the vehicle or measures it and is neither a body nor a hinge.
struct DeviceSpec {
  /// Where it is mounted: a node ("bus.hook", or a body for its origin), a component of a hinge ("boom", "boom.rate") or the world.
  struct Mount {
    std::string target;
    Located at;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  // [m] in the world, ...
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();     // ... and the axes there to its axes
    /// Of a hinge component that a change of the vehicle has taken away: where it was, and whether it turns.
    struct Last {
      double q;
      bool turns;
    };
    std::optional<Last> last{};
  };
  /// What an input is given: a number until something else is commanded, or an output of a device ("gyro.rate_x").
  struct Input {
    std::variant<double, std::string> value;
    Located at;
    int delay = 0;                 // of a connection, in ticks of who takes it (if it does not sample: of who gives it)
    double latency = 0.0;          // [s] the same in time; one of the two
    std::optional<double> safe{};  // of a command: what it becomes when nobody has set it for `timeout`
    double timeout = 0.0;          // [s] 0: never
  };
  std::string name;
  std::string type;  // a family of devices
  ParamValues params;
  std::map<std::string, Mount, std::less<>> mounts;
  std::map<std::string, Input, std::less<>> inputs;
  std::map<std::string, ParamValue, std::less<>> initial;  // of its states and marks
  double rate = 0.0, period = 0.0;                         // [Hz], [s] of what it samples: one of them, if it samples
  double offset = 0.0;                                     // [s] of its first tick
  Located at;
};

/// A place that a loop takes hold of: a node of a body, or a pose given in place, used where `node` is empty.
struct PlaceSpec {
  std::string body;  // "" = world
  std::string node;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // [m]
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();     // its axes to axes of the body
  Located at;
};

/// What closes a loop: it holds `to` to `from`, or couples coordinates of hinges.
struct LoopSpec {
  /// Of a coupling: sum of coefficient q + sum of functions = offset.
  struct Term {
    std::string target;  // "motor", or "arm.angle" of a hinge with several
    double coefficient = 0.0;
    Located at;
  };
  /// scale F(phase + sum of coefficient q).
  struct Function {
    std::string kind;             // polynomial, sine, cosine, table
    std::vector<double> numbers;  // coefficients, ascending; an amplitude; x and F of each point
    bool periodic = false;        // of a table: it repeats
    double scale = 1.0, phase = 0.0;
    std::vector<Term> of;
    Located at;
  };
  std::string name;
  std::string type;  // weld, point, line, plane, distance, coupling, or a hinge type that stands between the two places
  PlaceSpec from, to;
  ParamValues params;   // of the hinge type, checked by compile()
  double length = 0.0;  // [m] distance
  std::vector<Term> terms;
  std::vector<Function> functions;
  double offset = 0.0;
  bool prescribed = false;  // of a distance or coupling: by how much `length` or `offset` is more is given as a function of time
  bool open = false;        // it closes nothing, until it is closed (core/sim/rejoin.hpp)
  /// [m/s, 1/s] Of what is prescribed, at the start: rates that nothing gives go with it. Not given: it is not known yet.
  std::optional<double> rate;
  /// Of what is closed in a run: a weld holds the pose that its ends have then, and `to` becomes that place; a coupling of terms takes
  /// their sum as its offset.
  bool as_found = false;
  Located at;
};

/// How a start is closed whose loops are open (docs/mathematics/loops.md, 3).
struct AssemblySpec {
  /// Hinges or components of them, named as in couplings, that stay where they start; all others on the way of a loop move. Not given:
  /// what stays is what the description gives, coordinates (HingeSpec::q) and rates (HingeSpec::v) each by themselves.
  std::optional<std::vector<std::string>> hold;
  std::map<std::string, double, std::less<>> weights;  // by hinge or component: times its inertia in what is nearest
  Located at;
};

/// What fills space and time: a magnetic field, air, another gravity (core/abi/cardan_field.h).
struct FieldSpec {
  std::string name;
  std::string type;  // a family of fields
  ParamValues params;
  bool hold = false;  // beyond limits that can hold their value: go on with it; else such a step is refused
  Located at;
};

struct GravitySpec {
  enum class Kind { none, uniform, central, field } kind = Kind::none;
  std::vector<std::string> fields;                   // names of SystemSpec::fields: their sum
  Eigen::Vector3d g = Eigen::Vector3d::Zero();       // [m/s^2] uniform, world axes
  double mu = 0.0;                                   // [m^3/s^2] central
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // [m] world axes
  bool gradient = true;                              // torque on each body and force on its modes
  Located at;
};

struct SystemSpec {
  // As the compiler makes them, compiled once (spec.cpp).
  SystemSpec();
  SystemSpec(const SystemSpec&);
  SystemSpec(SystemSpec&&) noexcept;
  SystemSpec& operator=(const SystemSpec&);
  SystemSpec& operator=(SystemSpec&&) noexcept;
  ~SystemSpec();

  std::string name;
  std::vector<BodySpec> bodies;  // in the user's order, which is that of q, v and the results
  GravitySpec gravity;
  std::vector<FieldSpec> fields;
  std::vector<DeviceSpec> devices;
  std::vector<LoopSpec> loops;
  LoopForm loop_form = LoopForm::automatic;  // of all of them
  AssemblySpec assembly;
  std::string source_file, source_text;                            // where it was read from, and its bytes (hashed in results)
  std::vector<std::pair<std::string, std::string>> defaults_used;  // key path, value: what `describe` lists
  std::map<std::string, SourceMark, std::less<>> marks;            // key path of each value of the input and where it stands
  Warnings warnings;                                               // of reading and of making the modes

  /// The key path with its place; with that of the nearest object around it where it has none of its own.
  Located locate(std::string key_path) const {
    std::string_view around = key_path;
    while (true) {
      if (const auto found = marks.find(around); found != marks.end()) return {std::move(key_path), found->second};
      const auto cut = around.find_last_of(".[");
      if (cut == std::string_view::npos) return {std::move(key_path), {source_file, 0, 0}};
      around = around.substr(0, cut);
    }
  }

  const BodySpec* find(std::string_view body) const {
    for (const auto& b : bodies)
      if (b.name == body) return &b;
    return nullptr;
  }
};

}  // namespace cardan
