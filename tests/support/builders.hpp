#pragma once
// Systems written by hand in tests: the registry of everything built in, bodies and hinges in one line each, and a run.
#include <Eigen/Geometry>
#include <memory>
#include <string>
#include <vector>

#include "bodies/register.hpp"
#include "core/model/model.hpp"
#include "hinges/register.hpp"
#include "plugins/devices/register.hpp"

namespace cardan::test {

inline const Registry& registry() {
  static const Registry all = [] {
    Registry r;
    register_hinges(r);
    register_bodies(r);
    register_devices(r);
    return r;
  }();
  return all;
}

/// `axis` (one vector) or `axes` (several).
inline ParamValues along(const std::vector<Eigen::Vector3d>& axes) {
  std::vector<double> flat;
  for (const auto& a : axes) flat.insert(flat.end(), a.data(), a.data() + 3);
  ParamValues out;
  out[axes.size() == 1 ? "axis" : "axes"].value = flat;
  return out;
}

inline Eigen::Matrix3d diagonal(const Eigen::Vector3d& moments) { return moments.asDiagonal(); }

inline BodySpec rigid(const std::string& name, double mass, const Eigen::Vector3d& com, const Eigen::Matrix3d& inertia_com) {
  BodySpec b;
  b.name = name;
  b.mass = mass;
  b.com = com;
  b.inertia_com = inertia_com;
  return b;
}
inline BodySpec particle(const std::string& name, double mass, const Eigen::Vector3d& com) {
  BodySpec b = rigid(name, mass, com, Eigen::Matrix3d::Zero());
  b.type = "particle";
  return b;
}

/// The body on a hinge at `onode` of `inboard` ("" = world), P at the origin of the body.
inline BodySpec on(BodySpec body, const std::string& inboard, const std::string& type, const std::vector<Eigen::Vector3d>& axes = {},
                   const Eigen::Vector3d& onode = Eigen::Vector3d::Zero()) {
  body.hinge.inboard_body = inboard;
  body.hinge.type = type;
  if (!axes.empty()) body.hinge.params = along(axes);
  body.hinge.onode_position = onode;
  return body;
}

/// A free base that turns, on it a sprung arm, all out of one plane.
inline std::vector<BodySpec> base_with_sprung_arm() {
  BodySpec base = on(rigid("base", 10.0, {0.1, 0, 0}, diagonal({2, 3, 4})), "", "free");
  base.hinge.v = {0.3, -0.2, 0.1, 0, 0, 0};
  BodySpec arm = on(rigid("arm", 2.0, {0.5, 0, 0.1}, diagonal({0.1, 0.3, 0.3})), "base", "revolute", {{0, 0, 1}}, {0.5, 0, 0});
  arm.hinge.q = {0.4};
  SpringDamper spring;
  spring.stiffness = 3.0, spring.damping = 0.05;
  arm.hinge.springs = {spring};
  return {base, arm};
}

inline GravitySpec uniform_gravity(const Eigen::Vector3d& g) {
  GravitySpec out;
  out.kind = GravitySpec::Kind::uniform;
  out.g = g;
  return out;
}
inline GravitySpec central_gravity(double mu, bool gradient, const Eigen::Vector3d& centre = Eigen::Vector3d::Zero()) {
  GravitySpec out;
  out.kind = GravitySpec::Kind::central;
  out.mu = mu;
  out.gradient = gradient;
  out.centre = centre;
  return out;
}

inline SystemSpec system(std::vector<BodySpec> bodies, const GravitySpec& gravity = {}) {
  SystemSpec s;
  s.name = "test";
  s.bodies = std::move(bodies);
  s.gravity = gravity;
  return s;
}

inline std::shared_ptr<const Model> compiled(const SystemSpec& spec, const CompileOptions& options = {}) {
  return compile(spec, registry(), options);
}

inline Eigen::Quaterniond quaternion(const double* wxyz) { return {wxyz[0], wxyz[1], wxyz[2], wxyz[3]}; }

}  // namespace cardan::test
