// cardan-bench-events: what it takes in a run to let a body go, to hold one, to lock a hinge and to close a loop, against the number of
// bodies, with the momentum that is lost.
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <functional>
#include <utility>

#include "bench/bench_model.hpp"
#include "bench/command_line.hpp"
#include "bench/time_ring.hpp"
#include "bodies/register.hpp"
#include "core/sim/rejoin.hpp"
#include "core/sim/simulation.hpp"
#include "hinges/register.hpp"

namespace cardan::bench {
namespace {

/// A free hub with two wings of finite elements (10 modes each), two arms, and a guest that flies by itself: n bodies.
SystemSpec spacecraft(int n) {
  SystemSpec spec = hub_wings(10, 1).spec;
  const std::string hub = spec.bodies[0].name;
  const auto link = [&](const std::string& name, const std::string& inboard, const Eigen::Vector3d& at) {
    BodySpec b;
    b.name = name, b.mass = 5.0, b.com = {0.2, 0.01, 0.0};
    b.inertia_com = Eigen::Vector3d(0.02, 0.06, 0.07).asDiagonal();
    b.hinge.type = "revolute", b.hinge.inboard_body = inboard, b.hinge.onode_position = at;
    b.hinge.params["axis"].value = std::vector<double>{0.6, 0.0, 0.8};
    b.hinge.q = {0.3}, b.hinge.v = {0.2};
    spec.bodies.push_back(b);
  };
  const int links = (n - 4) / 2;
  for (const char* arm : {"left", "right"})
    for (int k = 0; k < links; ++k)
      link(fmt::format("{}{}", arm, k), k == 0 ? hub : fmt::format("{}{}", arm, k - 1),
           k == 0 ? Eigen::Vector3d(*arm == 'l' ? 1.0 : -1.0, 0, 0) : Eigen::Vector3d(0.4, 0, 0));
  BodySpec guest;
  guest.name = "guest", guest.mass = 200.0, guest.inertia_com = Eigen::Vector3d(40, 50, 60).asDiagonal();
  guest.hinge.type = "free", guest.hinge.q = {1, 0, 0, 0, -4, 2, 0.5}, guest.hinge.v = {0.01, 0.02, 0.0, -0.1, 0.0, 0.0};
  spec.bodies.push_back(guest);
  spec.gravity = {};
  return spec;
}

HingeSpec& hinge_of(SystemSpec& spec, const std::string& body) { return std::ranges::find(spec.bodies, body, &BodySpec::name)->hinge; }

/// Free, on the world or held where it is.
HingeSpec six_free(const std::string& inboard, bool locked) {
  HingeSpec hinge;
  hinge.type = "free", hinge.inboard_body = inboard, hinge.locked = locked;
  return hinge;
}

void measure(int n, double seconds, const Registry& registry) {
  const SystemSpec spec = spacecraft(n);
  const std::string middle = fmt::format("left{}", (n - 4) / 4), tip = fmt::format("right{}", (n - 4) / 2 - 1);
  Simulation sim(compile(spec, registry), {});
  const Observer& seen = sim.observe();
  const auto place = [&](const std::string& body) { return seen.body_pose(sim.model().find_body(body)); };
  SystemSpec open = spec;
  LoopSpec weld;
  weld.name = "dock", weld.type = "weld", weld.open = true, weld.from.body = tip, weld.to.body = "guest";
  const Pose<double> X = inverse(place(tip)) * place("guest");
  weld.from.position = to_eigen(X.p), weld.from.R = to_eigen(X.R);
  open.loops = {weld};
  const std::pair<const char*, std::function<void(SystemSpec&)>> events[] = {
      {"detach", [&](SystemSpec& s) { hinge_of(s, middle) = six_free("", false); }},
      {"attach", [&](SystemSpec& s) { hinge_of(s, "guest") = six_free(tip, true); }},
      {"lock", [&](SystemSpec& s) { hinge_of(s, middle).locked = true; }},
      {"close", [&](SystemSpec& s) { s.loops[0].open = false; }}};
  for (const auto& [name, change] : events) {
    Simulation before(compile(open, registry), {});
    SystemSpec after = open;
    change(after);
    Rejoined next = rejoin(before, after, registry, {});
    const Timing time = time_ring(1, seconds, [&](int) { next = rejoin(before, after, registry, {}); });
    const Momentum p = before.momentum();
    Simulation then(next.model, {});
    then.set_state(next.state);
    const Momentum r = then.momentum();
    fmt::print("| {:>6} | {:>6} | {:>8.3f} | {:>7.1e} | {:>7.1e} |\n", n, name, 1e-6 * time.median_ns,
               (p.linear - r.linear).norm() / p.linear_magnitude, (p.angular - r.angular).norm() / p.angular_magnitude);
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace cardan::bench

int main(int argc, char** argv) {
  double seconds = 0.3;
  cardan::bench::CommandLine line("Bodies that part and join: time and momentum");
  line.option("--seconds", seconds, "for each figure");
  if (const auto code = line.parse(argc, argv)) return *code;
  cardan::Registry registry;
  cardan::register_hinges(registry);
  cardan::register_bodies(registry);
  fmt::print("| bodies | {:>6} | {:>8} | {:>7} | {:>7} |\n|---:|---|---:|---:|---:|\n", "event", "ms", "linear", "angular");
  for (const int n : {10, 50, 200, 1000}) cardan::bench::measure(n, seconds, registry);
  return 0;
}
