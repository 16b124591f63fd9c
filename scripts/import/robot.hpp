#pragma once
// A robot as its file describes it, before it is a vehicle: links on chains of joints, what closes loops, and the place of each in the
// file.
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/source_mark.hpp"
#include "core/spatial/pose.hpp"

namespace cardan {

struct RobotInertial {
  double mass = 0.0;   // [kg]
  Vec3<double> com{};  // [m] link axes
  Sym3<double> J{};    // [kg m^2] about the mass centre, link axes
  std::string from{};  // where it is not the inertial that the file gives: "3 geoms"
  SourceMark mass_mark, inertia_mark;
};

/// One joint of the chain between a link and its parent. Joints follow each other from the parent outward; axes and points are in the frame
/// of the link, all coordinates zero.
struct RobotJoint {
  enum class Kind { hinge, slide, ball, planar, free } kind = Kind::hinge;
  int id = -1;  // by which couplings find it, wherever it goes
  std::string name;
  SourceMark mark, axis_mark;
  Vec3<double> axis{1.0, 0.0, 0.0}, point{};
  double stiffness = 0.0, rest = 0.0, damping = 0.0, friction = 0.0;  // SI
  std::optional<double> lower, upper;                                 // limits of the coordinate
  std::string remark;                                                 // what else the file says of it
  std::optional<double> initial;                                      // coordinate at the start
};

/// A pose, and how the file wrote its orientation, as YAML: empty where it was computed.
struct RobotPlace {
  Pose<double> X;
  std::string written;
};

struct RobotSite {
  std::string name, what;  // "site", "link"
  RobotPlace place;        // in the link
  SourceMark mark;
};

struct RobotLink {
  std::string name, what = "link";  // what the file calls it: "link", "body"
  SourceMark mark;
  int parent = -1;                 // -1: the world. Before its children in the list
  RobotPlace place;                // in the parent, all coordinates zero
  std::vector<RobotJoint> joints;  // none: fixed to the parent
  std::optional<RobotInertial> inertial;
  std::vector<RobotSite> sites;
};

/// What closes a loop, or couples coordinates.
struct RobotClosure {
  struct End {
    int link = -1;  // -1: the world
    RobotPlace place;
  };
  std::string name, what, type;  // "connect"; a type of loop of a vehicle
  SourceMark mark;
  End from, to;
  std::optional<Vec3<double>> axis;
  std::vector<std::pair<int, double>> terms;  // ids of joints
  std::vector<double> polynomial;             // beside them: less these coefficients, ascending, of a coordinate; empty: nothing
  int of = -1;                                // the id of its joint
  double offset = 0.0;
  int dependent = -1;  // the id of the joint whose start follows from those of the others
};

struct Robot {
  std::string name, file, format;  // "URDF", "MJCF"
  std::vector<RobotLink> links;
  std::vector<RobotClosure> closures;
  std::optional<Vec3<double>> gravity;  // [m/s^2]; none: the file has none
  int n_joints = 0;
};

}  // namespace cardan
