#pragma once
// What a modal-flexible body is made of, as plain data: the result of bodies/modal, the input of the model compiler and
// of the dense twin. Everything is expressed in the axes of the body frame B (the floating frame) about its origin.
// Symbols and integrals: docs/mathematics/flexible.md (Shabana 2013 numbering I1 ... I9).
#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

namespace cardan {

/// A lumped mass of the body, for level 2 with rotary inertia and for the dense twin.
struct MassNode {
  double mass = 0.0;                                   // [kg]
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // [m] undeformed
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();   // [kg m^2] about the node, body axes when undeformed
  Eigen::MatrixXd Phi, Psi;                            // 3 x m: translation [m], rotation [rad] per unit modal coordinate
  std::vector<Eigen::MatrixXd> Q;                      // empty, or 3 matrices m x m: second-order displacement 1/2 eta* Q eta
};

/// A named point of the body to which hinges, wrenches and sensors attach.
struct ModalNode {
  std::string name;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // [m] undeformed
  Eigen::Matrix3d R_BN = Eigen::Matrix3d::Identity();  // node axes to body axes, undeformed
  Eigen::MatrixXd Phi, Psi;                            // 3 x m, body axes; zero-sized or zero where the node does not deform
};

/// Inertia invariants. Index order: I5[l].col(k) = I5_lk, I9[l * m + k] = I9_lk, I8[k].
struct ModalIntegrals {
  double I1 = 0.0;                               // [kg] mass
  Eigen::Vector3d I2 = Eigen::Vector3d::Zero();  // [kg m] sum m r
  Eigen::MatrixXd I3, I4;                        // 3 x m
  std::vector<Eigen::MatrixXd> I5;               // m of 3 x m: I5_lk = sum m phi_l~ phi_k
  Eigen::MatrixXd I6;                            // m x m modal mass
  Eigen::Matrix3d I7 = Eigen::Matrix3d::Zero();  // [kg m^2] about the body origin
  std::vector<Eigen::Matrix3d> I8;               // m: sum m r~* phi_k~
  std::vector<Eigen::Matrix3d> I9;               // m * m: sum m phi_l~* phi_k~ (may be empty: then no level 2)
  // First-order rotary terms (levels 1 and 2), empty when no node has rotary inertia with rotation shapes; we and ee also where they are
  // left out:
  std::vector<Eigen::Matrix3d> rotary_ww;  // m: sum psi_k~ J0 - J0 psi_k~
  std::vector<Eigen::MatrixXd> rotary_we;  // [l].col(k) = sum (psi_l~ J0 - 1/2 J0 psi_l~) psi_k
  std::vector<Eigen::MatrixXd> rotary_ee;  // [i](k,l) = sum 1/2 psi_k* (psi_i~ J0 - J0 psi_i~) psi_l
  Eigen::VectorXd rotary_turn;             // m: largest |psi_k| of a point with J0 [rad per unit]; empty: not known
  bool of_change = true;      // false: how inertia changes with the deformation is not known, I5 and I8 are zero; level 0 alone
  double rotary_share = 0.0;  // largest part that J0 has in a modal mass, or in I7 about the mass centre, of |J0| for each point
};

/// What is known of one mode of the full model, kept or not.
struct ModeRecord {
  double frequency = 0.0;                                                            // [Hz]
  Eigen::Matrix<double, 6, 1> effective_mass = Eigen::Matrix<double, 6, 1>::Zero();  // [kg m^2 | kg] rotation, translation
  bool kept = true;
  std::string kind, reason;  // "normal", "Craig-Bampton"; why it is kept or not
};

/// What is drawn of the modes: some points of the mesh, lines between them, and how far each of the first modes moves the points.
struct ModalDrawing {
  Eigen::MatrixXd points;               // n x 3 [m] undeformed, body axes; no rows: nothing is known
  Eigen::MatrixXd lines;                // k x 2: indices of points
  std::vector<Eigen::MatrixXd> shapes;  // of n x 3 [m] per unit modal coordinate
};

struct ModalData {
  int n_modes = 0;
  ModalIntegrals integrals;
  Eigen::MatrixXd K, C;  // m x m modal stiffness and damping
  std::vector<ModalNode> nodes;
  std::vector<MassNode> mass_nodes;  // empty when the source is a consistent-mass model
  std::vector<ModeRecord> audit;
  ModalDrawing drawing;
  // Of a model, not of a source (core/model/rotary_terms.hpp):
  std::shared_ptr<const ModalData> whole;  // what the source has, where rotary terms were left out: mass_nodes have more than the integrals
  double left_out = 0.0;                   // [-] at most of a modal mass, at 0.1 rad
  std::string source;                      // one line: "plate 12.0 x 2.4 m, 40 x 8 elements, 2214 dofs, ARPACK shift-invert"
  std::string content_hash;
};

}  // namespace cardan
