#pragma once
// From links on joints to bodies on hinges: what has no mass becomes a node, or part of a hinge with several coordinates.
#include "scripts/import/source.hpp"

namespace cardan {

/// A body that carries a link, and where; body -1: the world.
struct Carrier {
  int body = -1;
  RobotPlace place;
};

/// The hinge that a chain of joints makes.
struct RobotHinge {
  std::string type, parameters;          // "universal", "axes: [[1, 0, 0], [0, 1, 0]]"
  RobotPlace to, at;                     // of the node on the inboard body, in that body; of the node on the body
  int inboard = -1;                      // body
  std::vector<std::string> coordinates;  // of each joint; empty for those with several
};

struct RobotBody {
  const RobotLink* link = nullptr;
  RobotHinge hinge;
  std::vector<RobotSite> nodes;  // sites, and links without mass
};

struct Assembled {
  std::vector<RobotBody> bodies;  // inboard before outboard
  std::vector<Carrier> carriers;  // of each link
  struct Coordinate {
    int body, joint;
  };
  std::map<int, Coordinate> coordinates;  // by the id of the joint
};

/// Changes the links of the robot: chains of joints of links without mass go to the next link that has one. Faults go to the source.
Assembled assemble(Robot& robot, RobotSource& source);

}  // namespace cardan
