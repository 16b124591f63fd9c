#pragma once
// A mass on a string of prescribed length.
#include "tests/support/builders.hpp"

namespace cardan::test {

/// 2 kg at (1, 0, 0) m, held to the world's origin by the loop `string` of 1 m, whose length the mission tells.
inline SystemSpec mass_on_a_string(const Eigen::Vector3d& velocity) {
  BodySpec mass = on(particle("mass", 2.0, Eigen::Vector3d::Zero()), "", "translational");
  mass.hinge.q = {1.0, 0.0, 0.0}, mass.hinge.v = {velocity.x(), velocity.y(), velocity.z()};
  SystemSpec spec = system({mass});
  LoopSpec string;
  string.name = "string", string.type = "distance", string.length = 1.0, string.prescribed = true;
  string.to.body = "mass";
  spec.loops = {string};
  return spec;
}

}  // namespace cardan::test
