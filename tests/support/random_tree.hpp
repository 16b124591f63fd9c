#pragma once
// Random systems for tests: every hinge, rigid and modal bodies, branching, forests; the same on every machine for a
// seed. State and loads are kept by the name of the body, so that a system can be cut, reordered or re-rooted.
#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "core/model/spec.hpp"

namespace cardan::test {

inline const std::vector<std::string> kAllHinges = {"revolute",          "prismatic", "helical",  "cylindrical", "universal",
                                                    "constant_velocity", "gimbal",    "ball",     "planar",      "locked",
                                                    "translational",     "free",      "free_body"};

/// The first seed of properties on random systems: CARDAN_FIRST_SEED, or 1. From another one on they are drawn anew.
unsigned first_seed();

struct TreeOptions {
  int bodies = 8;
  int roots = 2;              // at most: bodies on the world
  double flexible = 0.4;      // share of modal bodies
  int level = -1;             // of modal bodies; -1: any
  int modes = 0;              // of each; 0: one to four
  bool floating = false;      // every root on a `free` hinge
  double wheels = 0.25;       // share of bodies that become wheels: axisymmetric about a revolute hinge
  double locked = 0.0;        // share of hinges with `locked: true`, at a random position
  double prescribed = 0.0;    // share of velocity components whose motion is given
  bool free_modes = false;    // none of them a mode
  bool damping = true;        // of the modes
  bool plain_masses = false;  // of modal bodies: no rotary inertia, no second-order displacements
  bool springs = false;       // springs and dampers on hinges
  bool loads = false;         // stops and friction on them
  std::vector<std::string> hinges = kAllHinges;
  GravitySpec::Kind gravity = GravitySpec::Kind::uniform;
  bool gradient = true;  // of a central field, some 20 m away: it matters
};

/// A wrench [moment; force] on a node of a body, in node axes or in world axes.
struct Load {
  std::string body, node;
  bool world_axes;
  Eigen::Matrix<double, 6, 1> wrench;
};

using ByBody = std::map<std::string, Eigen::VectorXd>;  // [hinge components; modes] of each body

struct RandomTree {
  unsigned seed = 0;
  SystemSpec spec;   // with the state as initial state
  ByBody tau, vdot;  // forces of actuators; accelerations: of prescribed components, or for inverse dynamics
  std::vector<Load> loads;
};

RandomTree random_tree(unsigned seed, const TreeOptions& options);

/// With all hinges factored like this that have a square-root form.
RandomTree with_factor(RandomTree tree, HingeFactor factor);

/// Without this body and all that hangs on it.
RandomTree without(const RandomTree& tree, const std::string& body);

/// The bodies with their hinges, one per line.
std::string describe(const RandomTree& tree);

/// The rigid body with the mass properties of an undeformed modal body, on the same hinge and with the same nodes.
BodySpec frozen(const BodySpec& modal_body);

}  // namespace cardan::test
