#include "tests/support/builders.hpp"

#include "bodies/register.hpp"
#include "hinges/register.hpp"
#include "plugins/devices/register.hpp"

namespace cardan::test {

const Registry& registry() {
  static const Registry all = [] {
    Registry r;
    register_hinges(r);
    register_bodies(r);
    register_devices(r);
    return r;
  }();
  return all;
}

ParamValues along(const std::vector<Eigen::Vector3d>& axes) {
  std::vector<double> flat;
  for (const auto& a : axes) flat.insert(flat.end(), a.data(), a.data() + 3);
  ParamValues out;
  out[axes.size() == 1 ? "axis" : "axes"].value = flat;
  return out;
}

Eigen::Matrix3d diagonal(const Eigen::Vector3d& moments) { return moments.asDiagonal(); }

BodySpec rigid(const std::string& name, double mass, const Eigen::Vector3d& com, const Eigen::Matrix3d& inertia_com) {
  BodySpec b;
  b.name = name;
  b.mass = mass;
  b.com = com;
  b.inertia_com = inertia_com;
  return b;
}
BodySpec particle(const std::string& name, double mass, const Eigen::Vector3d& com) {
  BodySpec b = rigid(name, mass, com, Eigen::Matrix3d::Zero());
  b.type = "particle";
  return b;
}

BodySpec on(BodySpec body, const std::string& inboard, const std::string& type, const std::vector<Eigen::Vector3d>& axes,
            const Eigen::Vector3d& onode) {
  body.hinge.inboard_body = inboard;
  body.hinge.type = type;
  if (!axes.empty()) body.hinge.params = along(axes);
  body.hinge.onode_position = onode;
  return body;
}

std::vector<BodySpec> base_with_sprung_arm() {
  BodySpec base = on(rigid("base", 10.0, {0.1, 0, 0}, diagonal({2, 3, 4})), "", "free");
  base.hinge.v = {0.3, -0.2, 0.1, 0, 0, 0};
  BodySpec arm = on(rigid("arm", 2.0, {0.5, 0, 0.1}, diagonal({0.1, 0.3, 0.3})), "base", "revolute", {{0, 0, 1}}, {0.5, 0, 0});
  arm.hinge.q = {0.4};
  SpringDamper spring;
  spring.stiffness = 3.0, spring.damping = 0.05;
  arm.hinge.springs = {spring};
  return {base, arm};
}

GravitySpec uniform_gravity(const Eigen::Vector3d& g) {
  GravitySpec out;
  out.kind = GravitySpec::Kind::uniform;
  out.g = g;
  return out;
}
GravitySpec central_gravity(double mu, bool gradient, const Eigen::Vector3d& centre) {
  GravitySpec out;
  out.kind = GravitySpec::Kind::central;
  out.mu = mu;
  out.gradient = gradient;
  out.centre = centre;
  return out;
}

SystemSpec system(std::vector<BodySpec> bodies, const GravitySpec& gravity) {
  SystemSpec s;
  s.name = "test";
  s.bodies = std::move(bodies);
  s.gravity = gravity;
  return s;
}

}  // namespace cardan::test
