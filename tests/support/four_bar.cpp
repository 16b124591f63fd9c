#include "tests/support/four_bar.hpp"

#include <cmath>
#include <numbers>

namespace cardan::test {

SystemSpec four_bar(const std::string& closing, double rate, double branch) {
  BodySpec crank = on(rigid("crank", 1.0, {0.1, 0, 0}, diagonal({0.002, 0.01, 0.01})), "", "revolute", {{0, 0, 1}});
  BodySpec coupler = on(rigid("coupler", 1.5, {0.3, 0, 0}, diagonal({0.002, 0.05, 0.05})), "crank", "revolute", {{0, 0, 1}}, {0.2, 0, 0});
  BodySpec rocker = on(rigid("rocker", 1.2, {0.2, 0, 0}, diagonal({0.002, 0.03, 0.03})), "coupler", "revolute", {{0, 0, 1}}, {0.6, 0, 0});
  // Crank upwards: its tip is at (0, 0.2); the rocker's fixed pivot at (0.5, 0) and its length 0.4 put the other tip at p.
  const Eigen::Vector2d a(0, 0.2), b(0.5, 0.0), way = b - a;
  const double d = way.norm(), along = (0.36 - 0.16 + d * d) / (2 * d), up = std::sqrt(0.36 - along * along);
  const Eigen::Vector2d e = way / d, p = a + along * e + branch * up * Eigen::Vector2d(-e.y(), e.x());
  const double crank_angle = std::numbers::pi / 2, coupler_angle = std::atan2(p.y() - a.y(), p.x() - a.x()),
               rocker_angle = std::atan2(b.y() - p.y(), b.x() - p.x());
  crank.hinge.q = {crank_angle}, coupler.hinge.q = {coupler_angle - crank_angle}, rocker.hinge.q = {rocker_angle - coupler_angle};
  // w_crank x (tip) + w_coupler x (p - a) + w_rocker x (b - p) = 0
  Eigen::Matrix2d A;
  A << -(p - a).y(), -(b - p).y(), (p - a).x(), (b - p).x();
  const Eigen::Vector2d w = A.inverse() * Eigen::Vector2d(rate * a.y(), -rate * a.x());
  crank.hinge.v = {rate}, coupler.hinge.v = {w[0] - rate}, rocker.hinge.v = {w[1] - w[0]};
  SystemSpec spec = system({crank, coupler, rocker}, uniform_gravity({0, -9.81, 0}));
  LoopSpec loop;
  loop.name = "pivot", loop.type = closing;
  if (closing == "revolute") loop.params = test::along({{0, 0, 1}});
  loop.from.position = {0.5, 0, 0};
  loop.to.body = "rocker", loop.to.position = {0.4, 0, 0};
  spec.loops = {loop};
  return spec;
}

}  // namespace cardan::test
