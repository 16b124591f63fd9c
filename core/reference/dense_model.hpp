#pragma once
// The system as the twin sees it: every body with its mass points, hinge and nodes as plain data in the scalar T. Made
// from a SystemSpec; tests that hold more digits than a double replace the numbers afterwards.
#include <array>
#include <functional>
#include <map>
#include <memory>
#include <optional>

#include "core/model/spec.hpp"
#include "core/reference/leaves.hpp"
#include "core/reference/loops.hpp"

namespace cardan::reference {

/// What a hinge type that is not built in tells the twin, in double: the same five quantities as any hinge.
struct ForeignMotion {
  Eigen::Matrix3d R;                            // P axes to O axes
  Eigen::Vector3d p;                            // [m] P from O, O axes
  Eigen::Matrix<double, 6, Eigen::Dynamic> Ht;  // velocity [angular; linear] of P in O per unit v, P axes
  Eigen::Matrix<double, 6, 1> Hdot_v;           // (d/dt Ht) v, P axes
  Eigen::VectorXd qdot;
};
struct ForeignHinge {
  int nq, nv;
  std::function<ForeignMotion(const HingeSpec&, const Eigen::VectorXd& q, const Eigen::VectorXd& v)> motion;
};
using ForeignHinges = std::map<std::string, ForeignHinge, std::less<>>;  // by type name

/// A mass that moves with the modes; its inertia [kg m^2] is about the point, in its own axes.
template <class T>
struct MassPoint {
  T mass;
  Mat3<T> inertia = Mat3<T>::Zero();
  ModalPoint<T> point;
};

template <class T>
struct DenseBody {
  std::string name;
  int parent = -1;             // index into DenseModel::bodies; -1 = world
  ModalPoint<T> onode, pnode;  // O in the axes of the parent (or of the world), P in those of the body
  HingeShape<T> shape;
  std::optional<ForeignHinge> foreign;  // instead of the shape
  HingeSpec hinge;                      // springs, and what a foreign type reads
  HingeSize size{0, 0};                 // of the hinge
  VecX<T> held;                         // q of a hinge with `locked: true`, which has no entries in q and v
  int iq = 0, iv = 0;                   // first entry of [hinge; modes] in q and v
  std::vector<int> as_one;              // rigid bodies that are fixed to each other, it among them; empty: it is alone
  std::vector<int> moving;              // the entries of v that move its frame and nodes, inboard before outboard, its modes last
  int n_modes = 0, level = 2;
  MatX<T> K, C;                            // modal stiffness and damping
  std::vector<MassPoint<T>> masses;        // a rigid body is one of them
  std::shared_ptr<const ModalData> modal;  // for its integrals, where there are no mass nodes
  std::vector<ModalPoint<T>> nodes;

  int free_nq() const { return hinge.locked ? 0 : size.nq; }
  int free_nv() const { return hinge.locked ? 0 : size.nv; }
  const ModalPoint<T>& node(std::string_view name) const;  // InputError C0202 when unknown
};

template <class T>
struct DenseGravity {  // as GravitySpec
  GravitySpec::Kind kind = GravitySpec::Kind::none;
  Vec3<T> g, centre;
  T mu;
  bool gradient = true;
  /// Of Kind::field, at a point of the world: a (3), da/dr by rows (9), U; in double, by who makes the twin.
  std::function<std::array<double, 13>(const std::array<double, 3>&)> sample;
};

template <class T>
struct DenseModel {
  std::vector<DenseBody<T>> bodies;  // in the order of the spec: that of q and v
  std::vector<int> outward;          // the same bodies, parents first
  std::vector<DenseLoop<T>> loops;
  DenseGravity<T> gravity;
  int nq = 0, nv = 0;
};

/// Throws InputError for what the twin cannot do (C0401: foreign bodies, foreign hinges not in `foreign` or in a loop) and for names
/// that lead nowhere (C0201, C0202, C0206).
template <class T>
DenseModel<T> dense_model(const SystemSpec&, const ForeignHinges& foreign = {});

}  // namespace cardan::reference
