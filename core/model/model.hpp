#pragma once
// The compiled system: immutable, numbered, SI. Bodies stand in sweep order (level by level, inboard before outboard);
// what the user sees (order of q, v and results, body frames) is kept in UserBody and never enters a sweep.
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/abi/registry.hpp"
#include "core/model/spec.hpp"
#include "core/model/state.hpp"
#include "core/spatial/eigen_bridge.hpp"

namespace cardan {

/// Which kernel serves a body: the shape of its hinge, and whether the body, its nodes or its motion are anything but rigid
/// and free. General kernels take any shape.
enum class KernelKind : std::uint8_t { fixed, rotation, slide, screw, dense1, dense2, dense3, dense4, dense5, dense6,
                                       axis_x, axis_y, axis_z, tilt, tilt2,  // AxisBody: kernels_axis.hpp
                                       general0, general1, general2, general3, general4, general5, general6 };
constexpr bool is_general(KernelKind k) { return k >= KernelKind::general0; }
constexpr bool is_axis(KernelKind k) { return k >= KernelKind::axis_x && k <= KernelKind::tilt2; }

/// Deformation of a node: columns [Psi; Phi] (6 x m, column-major) over the undeformed pose in the body frame.
struct NodeShapes {
  Pose<double> pose;            // [-, m] N in B, undeformed
  int n_modes = 0;
  std::vector<double> columns;  // 6 m: per mode rotation [rad] then translation [m]; empty: the node does not deform
  bool deforms() const { return !columns.empty(); }
};

/// What a flexible body adds: the constant blocks of its inertia, its elasticity and its family's functions.
struct FlexibleBody {
  const cardan_body_family* family = nullptr;
  std::vector<double> packed;           // parameters of the family
  bool M_ee_constant = false, M_re_constant = false, M_ee_identity = false;
  bool constant = false;                // level 0: all of M_fl but the mass centre; the sweeps form it and b themselves
  bool K_diagonal = false;              // then K and C hold m numbers, else m x m
  std::vector<double> K, C;             // [N/m-like], [N s/m-like] per modal coordinate
  RigidInertia<double> M_rr;            // at eta = 0
  std::vector<double> M_re, M_ee;       // at eta = 0: 6 x m, m x m
  std::vector<double> L_ee;             // m x m lower Cholesky factor of M_ee at eta = 0
  std::vector<double> M_re_rows, U_rows;  // 6 rows of m: M_re and (M_ee^-1 M_re*)* at eta = 0
  ArticulatedInertia<double> gramian;   // M_re M_ee^-1 M_re* at eta = 0
  // Outboard hinges on deforming nodes, with shapes S. Where M_ee is constant and nothing else moves with the modes, they are
  // eliminated through these nodes (flexible.md, 7), and no matrix of size m is factored in a step:
  bool by_nodes = false;
  std::vector<int> attached;            // sweep indices of the bodies that hang there, n of them
  std::vector<double> V, V_columns;     // m x 6n: the combinations of modes that move the nodes, V* M_ee V = 1; column-major,
                                        // and six columns at a time row-major
  std::vector<double> Q;                // 6n x 6n, row-major, lower triangle: Q = S V, S M_ee^-1 S* = Q Q*
  std::vector<double> MV;               // 6 x 6n, column-major: M_re V at eta = 0
  int level = 0;
  std::shared_ptr<const ModalData> data;
};

/// What the sweeps read of one body. Index 0 is the ground.
struct SweepBody {
  int parent = 0;                       // sweep index, < own index
  KernelKind kind = KernelKind::fixed;
  std::uint8_t nv = 0;
  std::uint8_t shape = 0;               // cardan_hinge_shape
  int q = 0, v = 0;                     // offsets of the hinge coordinates in the user's q and v
  int dense = -1;                       // index of the hinge record (dense shapes)
  Pose<double> O;                       // onode in the inboard body's sweep frame (undeformed)
  Pose<double> fixed_hinge;             // P in O of a fixed hinge
  Vec3<double> axis;                    // hinge axis (axis shapes), P axes
  double pitch = 0.0;                   // [m/rad]
  RigidInertia<double> M;               // rigid body
  RigidInertia<double> M_sweep;         // what the sweeps use: M, and that of rotors folded into it
  double q0 = 0.0;                      // [rad] axis kernels: angle of the frame at q = 0
  int n_modes = 0, eta = 0, etadot = 0; // modal coordinates in q and v
  int flexible = -1;                    // index into Model::flexible
  int onode = -1, pnode = -1;           // index into Model::shapes where O (on the inboard body) or P deforms
  int n_parent_modes = 0;               // modes of the inboard body when O deforms
  bool has_prescribed = false;          // some velocity component follows a given motion
};

/// What the axis kernels read of one body (rigid, one rotation about a coordinate axis of its frame), parallel to `bodies`.
struct AxisBody {
  int parent = 0, q = 0, v = 0;
  double q0 = 0.0;                                          // [rad]
  double cos_alpha = 1, sin_alpha = 0, cos_beta = 1, sin_beta = 0;  // R_O = Rz(alpha) Ry(beta)
  double p[3] = {};                                         // [m] B in A, A axes
  double l[2] = {};                                         // [m] the same in O axes, components j and k (that along i is 0)
  double m = 0.0, h[3] = {}, J[6] = {};                     // [kg], [kg m], [kg m^2] xx yy zz xy xz yz about B
  double S[6] = {};                                         // [kg m^2] second moments: integral of r r* dm
};

/// A maximal stretch of consecutive bodies with one kernel.
struct Run {
  int begin, end;
  KernelKind kind;
};

/// Hinges of one family that fill their records in one call.
struct DenseBatch {
  const cardan_hinge_family* family;
  std::vector<double> packed;           // params_size bytes each
  std::vector<std::uint32_t> iq, iv;
  int first;                            // index of the first record
};

/// A body as the user named it.
struct UserBody {
  std::string name, type, hinge_type;
  int sweep = 0;                        // the sweep body that carries it (shared when merged; 0: fixed to the ground)
  bool merged = false;                  // rigidly part of another sweep body
  int parent = -1;                      // user index of the inboard body, -1 = world
  Pose<double> pose;                    // user's body frame in the sweep frame
  Pose<double> pnode, onode;            // P in the user's body frame; O in the inboard user's frame (undeformed)
  Pose<double> merged_hinge;            // P in O when the hinge is fixed
  RigidInertia<double> M;               // own inertia in the user's frame (rigid)
  double mass = 0.0;                    // [kg]
  const cardan_hinge_family* hinge = nullptr;
  std::vector<double> hinge_packed;
  int q = 0, nq = 0, v = 0, nv = 0;     // hinge coordinates (0 when locked)
  int n_modes = 0, eta = 0, etadot = 0;
  std::vector<std::string> q_names, v_names, q_units, v_units;
};

/// A named point.
struct UserNode {
  std::string name;                     // "bus.saddle_left"; the body's own name for its origin
  int body = 0;                         // user index
  NodeShapes shapes;                    // in the SWEEP frame of the body
};

struct Spring {
  int q, v;                             // tau[v] -= k (q[q] - rest) + c v[v]
  double stiffness, rest, damping;
};

/// One line of the program of sweeps.
enum class Kernel : std::uint8_t { hinge_records, outward, elastic, world, central_gravity, node_wrenches, inward, acceleration };
struct Op {
  Kernel kernel;
  int run = -1;                         // index of the run, -1 = all bodies
};

class Model {
 public:
  std::string name;
  int nq = 0, nv = 0;                   // all coordinates: hinges and modes
  int n_modes = 0;
  std::vector<SweepBody> bodies;        // [0] = ground
  std::vector<AxisBody> axis_bodies;    // same index; filled for axis kernels, empty when there are none
  int n_axis = 0;                       // how many bodies have an axis kernel
  std::vector<Run> runs;
  std::vector<FlexibleBody> flexible;
  std::vector<NodeShapes> shapes;       // deforming hinge nodes
  std::vector<DenseBatch> batches;
  int n_dense = 0;
  std::vector<Spring> springs;
  std::vector<std::uint8_t> prescribed; // per v: 1 = follows a given motion; empty when none does
  GravitySpec gravity;
  std::vector<UserBody> user;           // in the user's order
  std::vector<UserNode> nodes;
  std::vector<Op> program;              // forward dynamics, in order of execution
  bool has(Kernel kernel) const {
    for (const Op& op : program)
      if (op.kernel == kernel) return true;
    return false;
  }
  std::shared_ptr<const SystemSpec> spec;

  bool has_prescribed() const { return !prescribed.empty(); }
  /// Index into `user` / `nodes`; -1 if unknown.
  int find_body(std::string_view name) const;
  int find_node(std::string_view name) const;
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
  bool merge_locked = true;             // rigid bodies fixed to rigid bodies become one
  bool choose_frames = true;            // re-choose the frames of rigid bodies for the axis kernels (results stay in the user's)
  bool node_wrenches = true;            // the program takes wrenches on nodes
  bool world_wrenches = false;          // ... also such that are given in world axes
};

/// All user errors of a description end here: throws InputError with everything that was found.
std::shared_ptr<const Model> compile(const SystemSpec& spec, const Registry& registry, const CompileOptions& options = {});

}  // namespace cardan
