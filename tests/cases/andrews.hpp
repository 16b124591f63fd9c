#pragma once
// Andrews' squeezing mechanism of the published start: tree and closures of the benchmark model, whose first state that is; the spring
// is a device.
#include "tests/support/bench_loops.hpp"
#include "tests/support/builders.hpp"

namespace cardan::test {

inline constexpr double kAndrewsTorque = 0.033;      // [N m]
inline constexpr double kAndrewsStiffness = 4530.0;  // [N/m]
inline constexpr double kAndrewsRest = 0.07785;      // [m]

inline SystemSpec andrews_squeezer() {
  bench_loops::Model squeezer = bench_loops::read(CARDAN_SOURCE_DIR "/tests/reference/bench_loops/andrews.json");
  SystemSpec& spec = squeezer.spec;
  const bench_loops::Spring& spring = squeezer.springs.at(0);
  const auto node = [](const char* name, const PlaceSpec& end) { return NodeSpec{name, end.position, Eigen::Matrix3d::Identity(), {}}; };
  BodySpec frame = rigid("frame", 1.0, Eigen::Vector3d::Zero(), diagonal({1, 1, 1}));
  frame.hinge.type = "locked";
  frame.nodes.push_back(node("C", spring.from));
  spec.bodies.push_back(frame);
  spec.bodies[2].nodes.push_back(node("D", spring.to));
  DeviceSpec device;
  device.name = "spring", device.type = "spring_damper";
  device.params["stiffness"].value = kAndrewsStiffness;
  device.params["rest"].value = kAndrewsRest;
  device.mounts["from"] = {"frame.C", {}}, device.mounts["to"] = {"K3.D", {}};
  spec.devices = {device};
  return spec;
}

}  // namespace cardan::test
