#pragma once
// What the sweeps read of a compiled system: plain numbers, in sweep order (level by level, inboard before outboard). No Eigen
// and no inline code of libraries: the sweeps are compiled once per instruction set (docs/adr/0013-instruction-sets.md).
#include <cstdint>
#include <memory>
#include <new>
#include <string>
#include <vector>

#include "core/abi/cardan_abi.h"
#include "core/abi/cardan_body.h"
#include "core/abi/cardan_field.h"
#include "core/abi/hinge_slopes.hpp"
#include "core/spatial/inertia.hpp"

namespace cardan {

struct ModalData;

/// Which kernel serves a body: the shape of its hinge, and whether the body, its nodes or its motion are anything but rigid
/// and free. General kernels take any shape.
enum class BodyKernel : std::uint8_t {
  fixed,
  rotation,
  slide,
  screw,
  dense1,
  dense2,
  dense3,
  dense4,
  dense5,
  dense6,
  free,  // six degrees of freedom: kernels_free.hpp
  axis_x,
  axis_y,
  axis_z,
  tilt,
  tilt2,  // AxisBody: kernels_axis.hpp
  rotor,  // AxisBody: axisymmetric, folded into its carrier
  general0,
  general1,
  general2,
  general3,
  general4,
  general5,
  general6
};
static constexpr bool is_general(BodyKernel k) { return k >= BodyKernel::general0; }
static constexpr bool is_axis(BodyKernel k) { return k >= BodyKernel::axis_x && k <= BodyKernel::rotor; }

/// Deformation of a node: columns [Psi; Phi] (6 x m, column-major) over the undeformed pose in the body frame.
struct NodeShapes {
  Pose<double> pose;            // [-, m] N in B, undeformed
  int n_modes = 0;              // 0: the node does not deform
  std::vector<double> columns;  // 6 m: per mode rotation [rad] then translation [m]
  int curved = -1;              // its number where the family of the body tells how it moves (cardan_body_family::node); then no columns
  [[gnu::always_inline]] bool deforms() const { return n_modes > 0; }
  [[gnu::always_inline]] bool is_curved() const { return curved >= 0; }
};

/// Numbers that a sweep streams through, from the beginning of a cache line on: no vector of them lies across two lines.
template <class T>
struct LineAllocator {
  using value_type = T;
  T* allocate(std::size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), std::align_val_t(64))); }
  void deallocate(T* p, std::size_t) { ::operator delete(p, std::align_val_t(64)); }
  bool operator==(const LineAllocator&) const { return true; }
};
using Stream = std::vector<double, LineAllocator<double>>;

/// What a flexible body adds: the constant blocks of its inertia, its elasticity and its family's functions.
struct FlexibleBody {
  const cardan_body_family* family = nullptr;
  std::vector<double> packed;  // parameters of the family
  bool M_ee_constant = false, M_re_constant = false, M_ee_identity = false;
  bool states = false;                 // its family evaluates many states at once: of lanes
  bool curved = false;                 // its family tells how its nodes move: their shapes depend on eta
  bool constant = false;               // level 0: all of M_fl but the mass centre; the sweeps form it and b themselves
  bool K_diagonal = false;             // then K and C hold m numbers, else m x m
  Stream K, C;                         // [N/m-like], [N s/m-like] per modal coordinate
  RigidInertia<double> M_rr;           // at eta = 0
  std::vector<double> M_re, M_ee;      // at eta = 0: 6 x m, m x m
  std::vector<double> L_ee;            // m x m lower Cholesky factor of M_ee at eta = 0
  std::vector<double> M_re_rows, U;    // 6 rows of m: M_re; m x 6: M_ee^-1 M_re*; at eta = 0
  ArticulatedInertia<double> gramian;  // M_re M_ee^-1 M_re* at eta = 0
  // Outboard hinges on deforming nodes, with shapes S. Where M_ee is constant and nothing else moves with the modes, they are
  // eliminated through these nodes (flexible.md, 7), and no matrix of size m is factored in a step:
  bool by_nodes = false;
  bool pushed_by_loops = false;  // coordinates of loops cross its modes: their mass matrix is factored in each evaluation
  std::vector<int> attached;     // sweep indices of the bodies that hang there, n of them
  // Column by column of the modes, so that one pass over them serves the body and its nodes: [M_re; shapes of the nodes], M_re
  // where all is constant; and [U*; V*], U where M_re is constant, V: the combinations of modes that move the nodes, V* M_ee V = 1,
  // where the body is eliminated through them. UV: the latter row by row.
  Stream shapes, UV_columns, UV;
  std::vector<double> Q;   // 6n x 6n, row-major, lower triangle: Q = S V, S M_ee^-1 S* = Q Q*
  std::vector<double> MV;  // 6 x 6n, column-major: M_re V at eta = 0
  int level = 0;
  // Derivatives of the inertia for the gradient of gravity, per mode xx yy zz xy xz yz: dJ/d eta_k at eta = 0, and at level 2
  // d^2 J / d eta_k d eta_l (k-major); empty where the scene has no such gravity, and where J_by_family: J is no such polynomial of the
  // modes (nodes with rotary inertia at level 2), and the velocity terms of its family tell how it changes.
  std::vector<double> dJ, d2J;
  bool J_by_family = false;
  std::shared_ptr<const ModalData> data;
};

/// What the sweeps read of one body. Index 0 is the ground.
struct SweepBody {
  int parent = 0;  // sweep index, < own index
  BodyKernel kind = BodyKernel::fixed;
  std::uint8_t nv = 0;
  std::uint8_t shape = 0;                // cardan_hinge_shape
  int q = 0, v = 0;                      // offsets of the hinge coordinates in the user's q and v
  int dense = -1;                        // index of the hinge record (dense shapes)
  Pose<double> O;                        // onode in the inboard body's sweep frame (undeformed)
  Pose<double> fixed_hinge;              // P in O of a fixed hinge
  Vec3<double> axis;                     // hinge axis (axis shapes), P axes
  double pitch = 0.0;                    // [m/rad]
  RigidInertia<double> M;                // rigid body
  RigidInertia<double> M_sweep;          // what the sweeps use: M, and that of rotors folded into it; of a rotor: M seen from A
  Sym3<double> J_P;                      // [kg m^2] what P starts from: J of M_sweep without the moments that its rotors turn under
  double q0 = 0.0;                       // [rad] axis kernels: angle of the frame at q = 0
  int n_modes = 0, eta = 0, etadot = 0;  // modal coordinates in q and v
  int flexible = -1;                     // index into Model::flexible
  int onode = -1, pnode = -1;            // index into Model::shapes where O (on the inboard body) or P deforms
  int n_parent_modes = 0;                // modes of the inboard body when O deforms
  bool has_prescribed = false;           // some velocity component follows a given motion
  bool square_root = false;              // its hinge is factored in square-root form (HingeFactor): its kernel is a general one
};

/// What the axis kernels read of one body (rigid, one rotation about a coordinate axis of its frame), parallel to `bodies`.
struct AxisBody {
  BodyKernel kind = BodyKernel::fixed;
  bool leaf = false;  // nothing hangs on it but rotors: its P is constant
  int parent = 0, q = 0, v = 0;
  int angle = 0;                                                    // place of its sine and cosine in the workspace
  double q0 = 0.0;                                                  // [rad]
  double cos_alpha = 1, sin_alpha = 0, cos_beta = 1, sin_beta = 0;  // R_O = Rz(alpha) Ry(beta)
  double p[3] = {};                                                 // [m] B in A, A axes
  double l[2] = {};                                                 // [m] the same in O axes, components j and k (that along i is 0)
  bool written_by_child = false;                                    // one of its children is `first`
  bool first = false;                                               // tip to base: the first of its siblings
  double m = 0.0, h[3] = {};                                        // [kg], [kg m] about B
  ArticulatedInertia<double> P;                                     // what P starts from
  double S[6] = {};                                                 // [kg m^2] second moments: integral of r r* dm
  double u[3] = {}, J_axial = 0.0;                                  // rotor: axis in A, [kg m^2] moment about it
};

/// An angle whose sine and cosine the sweeps need: q[q] + q0.
struct AxisAngle {
  int q;
  double q0;  // [rad]
};

/// A maximal stretch of consecutive bodies with one kernel, all or none with given motions, all or none in square-root form.
struct Run {
  int begin, end;
  BodyKernel kind;
  bool prescribed = false;  // given motions move its bodies: of their hinges, their modes, or the modes they hang on
  bool square_root = false;
};

/// Hinges of one family that fill their records in one call.
struct DenseBatch {
  const cardan_hinge_family* family;
  std::vector<double> packed;  // params_size bytes each; one hinge alone where the size is that of its instance
  std::vector<std::uint32_t> iq, iv;
  int first;           // index of the first record
  HingeSlopes slopes;  // null: by differences
};

/// A named point.
struct UserNode {
  std::string name;   // "bus.saddle_left"; the body's own name for its origin
  int body = 0;       // user index
  int sweep = 0;      // sweep index of the body that carries it
  NodeShapes shapes;  // in the SWEEP frame of the body
};

/// A rigid inertia by its mass centre: a particle is one exactly, which m, h = m c and J, rounded one by one, cannot be.
struct CentralInertia {
  double m = 0.0;    // [kg]
  Vec3<double> c{};  // [m] mass centre from B
  Sym3<double> S{};  // [kg m^2] second moments about it: integral of r r* dm, zero for a particle
};

/// A hinge record that is turned after its family filled it: the frame of the body is S, not P.
struct TurnedRecord {
  int body = 0;  // sweep index
  Mat3<double> R_PS;
};

/// Columns of matrices depth-first (column_order.hpp): those of a body, and after them those outboard of it, are a range. Only of trees of
/// rigid bodies.
struct ColumnOrder {
  struct Of {
    int begin = 0, end = 0;  // columns of the body, and of those outboard of it
    int limit = 0;           // end of the columns of its whole tree
    int slot = 0;            // where its motion stands
    bool leaf = false;       // nothing hangs on it
    bool last = false;       // of its siblings
  };
  std::vector<int> bodies;  // sweep indices
  std::vector<Of> of;       // per sweep body
  std::vector<int> v;       // per column: the velocity component
  std::vector<int> ends;    // per column: the end of those outboard of it
  int slots = 1;
  bool as_given = false;   // columns stand in the user's order
  bool one_chain = false;  // each column is outboard of all before it
};

/// What is kept of masses that grow by large ratios per link, for the refinement of v' (kernels_refine.hpp); empty in other models.
struct GradedMasses {
  std::vector<CentralInertia> swept;  // per sweep body, in B: with the rotors that are folded into it
  std::vector<CentralInertia> own;    // without them; of a rotor: in the frame of its carrier
  std::vector<Vec3<double>> arm;      // [m] per node: from the mass centre `swept` of its sweep body, B axes
  std::vector<TurnedRecord> turned;
};

/// A field of a family, with its parameters.
struct FieldSource {
  const cardan_field_family* family = nullptr;
  std::vector<double> packed;
  std::vector<double> prepared;  // for t = 0
  int held = 0;                  // bits of limits beyond which it goes on with the value of its end; beyond others the step is refused
  /// Of a code of `evaluate`: something is wrong with it, or a limit is passed that is not held.
  bool refuses(int code) const { return code < 0 || (code & ~held) != 0; }
};
/// When a field is asked: t, and what its family prepared for it.
struct FieldMoment {
  double t = 0.0;  // [s]
  const void* prepared = nullptr;
  int beyond = 0;  // bits of limits that `prepare` told
};

/// Gravity as the sweeps see it, world axes.
struct GravityField {
  bool uniform = false, central = false;
  Vec3<double> g{};                     // [m/s^2] uniform
  double mu = 0.0;                      // [m^3/s^2] central
  Vec3<double> centre{};                // [m]
  bool gradient = true;                 // torque on each body and force on its modes
  const FieldSource* source = nullptr;  // a field of a family, that of Model::fields
  /// Bodies are pulled one by one.
  bool pulls() const { return central || source; }
};

struct SweepModel {
  int nq = 0, nv = 0;  // all coordinates: hinges and modes
  int n_modes = 0;
  std::vector<SweepBody> bodies;      // [0] = ground
  std::vector<AxisBody> axis_bodies;  // same index; filled for axis kernels, empty when there are none
  std::vector<AxisAngle> angles;      // of the axis kernels
  std::vector<int> rotors;            // sweep indices
  std::vector<Run> runs;
  std::vector<FlexibleBody> flexible;
  std::vector<NodeShapes> shapes;  // deforming hinge nodes
  std::vector<DenseBatch> batches;
  int n_dense = 0;
  std::vector<std::uint8_t> prescribed;  // per v: 1 = follows a given motion; empty when none does
  std::vector<UserNode> nodes;
  GravityField field;
  GradedMasses graded;
  ColumnOrder columns;
  bool rigid = true;   // no body has a general kernel
  bool world = false;  // the program keeps poses and velocities in the world

  [[gnu::always_inline]] bool has_prescribed() const { return !prescribed.empty(); }
};

}  // namespace cardan
