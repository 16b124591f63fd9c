#pragma once
// Small modal data of both kinds, for tests of what reads and writes them.
#include <Eigen/Dense>
#include <vector>

#include "bodies/modal/lumped.hpp"
#include "bodies/modal/modal_source.hpp"

namespace cardan::test {

/// Two modes on three masses, one with a moment of inertia that turns.
inline ModalData lumped() {
  std::vector<MassNode> masses(3);
  for (std::size_t j = 0; j < 3; ++j) {
    const double x = static_cast<double>(j);
    masses[j].mass = 1.0 + x;
    masses[j].position = {x, 0.5 * x * x, 0.1};
    masses[j].Phi = (Eigen::MatrixXd(3, 2) << 0.1 * x, 0.2, x, -0.3 * x, 0.4, x * x).finished();
    masses[j].Q.assign(3, Eigen::MatrixXd::Constant(2, 2, 0.01 * x));
  }
  masses[2].inertia = Eigen::Vector3d(0.1, 0.2, 0.25).asDiagonal();
  masses[2].Psi = (Eigen::MatrixXd(3, 2) << 0, 0.1, 0.2, 0, 0.3, -0.1).finished();
  ModalNode tip;
  tip.name = "tip";
  tip.Phi = masses[2].Phi;
  ModalNode other = tip;
  other.name = "other";
  return lumped_modal_data(masses, Eigen::Vector2d(4, 9).asDiagonal(), Eigen::Vector2d(0.1, 0.1).asDiagonal(), {tip, other});
}

/// A consistent-mass beam: integrals without mass nodes.
inline ModalData beam() {
  ModalSource source;
  BeamModel model;
  model.length = 2.0;
  model.material = {70e9, 0.3, 2700.0};
  model.section = rectangle_section(0.02, 0.01);
  model.elements = 8;
  source.model = model;
  source.modes.count = 3;
  return make_modal_data(source);
}

}  // namespace cardan::test
