#pragma once
// Systems written by hand in tests: the registry of everything built in, bodies and hinges in one line each, and a run.
#include <Eigen/Geometry>
#include <memory>
#include <string>
#include <vector>

#include "core/model/model.hpp"

namespace cardan::test {

const Registry& registry();

/// `axis` (one vector) or `axes` (several).
ParamValues along(const std::vector<Eigen::Vector3d>& axes);

Eigen::Matrix3d diagonal(const Eigen::Vector3d& moments);

BodySpec rigid(const std::string& name, double mass, const Eigen::Vector3d& com, const Eigen::Matrix3d& inertia_com);
BodySpec particle(const std::string& name, double mass, const Eigen::Vector3d& com);

/// The body on a hinge at `onode` of `inboard` ("" = world), P at the origin of the body.
BodySpec on(BodySpec body, const std::string& inboard, const std::string& type, const std::vector<Eigen::Vector3d>& axes = {},
            const Eigen::Vector3d& onode = Eigen::Vector3d::Zero());

/// A free base that turns, on it a sprung arm, all out of one plane.
std::vector<BodySpec> base_with_sprung_arm();

GravitySpec uniform_gravity(const Eigen::Vector3d& g);
GravitySpec central_gravity(double mu, bool gradient, const Eigen::Vector3d& centre = Eigen::Vector3d::Zero());

SystemSpec system(std::vector<BodySpec> bodies, const GravitySpec& gravity = {});

inline std::shared_ptr<const Model> compiled(const SystemSpec& spec, const CompileOptions& options = {}) {
  return compile(spec, registry(), options);
}

inline Eigen::Quaterniond quaternion(const double* wxyz) { return {wxyz[0], wxyz[1], wxyz[2], wxyz[3]}; }

}  // namespace cardan::test
