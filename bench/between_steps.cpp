// cardan-bench-between-steps: rows and readings inside of steps beside such that end steps: time, steps, and what either is off by.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <vector>

#include "bench/bench_model.hpp"
#include "bench/command_line.hpp"
#include "bodies/register.hpp"
#include "core/io/recorder.hpp"
#include "core/sim/outputs.hpp"
#include "core/sim/simulation.hpp"
#include "hinges/register.hpp"
#include "plugins/devices/register.hpp"

namespace cardan::bench {
namespace {

struct Scene {
  std::string name;
  SystemSpec spec;
  double duration = 0.0;  // [s]
  Rational period;        // of the rows [s]
};

BodySpec free_body(const std::string& name, double mass, const Eigen::Vector3d& moments) {
  BodySpec b;
  b.name = name, b.mass = mass, b.inertia_com = moments.asDiagonal();
  b.hinge.type = "free";
  return b;
}

std::vector<Scene> scenes() {
  Scene orbit{"orbit", {}, 86400.0, {1, 10}};
  orbit.spec.bodies = {free_body("bus", 500.0, {120, 150, 200})};
  orbit.spec.bodies[0].hinge.q = {1, 0, 0, 0, 6.878e6, 0, 0}, orbit.spec.bodies[0].hinge.v = {0, 0, 1e-4, 0, 7.61e3, 0.5e3};
  orbit.spec.gravity.kind = GravitySpec::Kind::central, orbit.spec.gravity.mu = 3.986004418e14;
  orbit.spec.gravity.gradient = false;  // with it a body that turns this slowly tumbles without order

  Scene tumbling{"tumbling", {}, 600.0, {1, 10}};
  tumbling.spec.bodies = {free_body("bus", 500.0, {120, 150, 200})};
  tumbling.spec.bodies[0].hinge.q = {1, 0, 0, 0, 0, 0, 0}, tumbling.spec.bodies[0].hinge.v = {0.02, 0.2, 0.01, 0, 0, 0};

  Scene flexible{"flexible", hub_wings(10, 1).spec, 20.0, {1, 1000}};
  flexible.spec.gravity = {};
  for (BodySpec& b : flexible.spec.bodies)
    if (b.hinge.type == "free") b.hinge.v = {0.01, 0.02, -0.01, 0, 0, 0};

  Scene sensors = tumbling;
  sensors.name = "sensors", sensors.duration = 600.0, sensors.period = {1, 1};
  DeviceSpec imu;
  imu.name = "imu", imu.type = "imu", imu.rate = 100.0, imu.mounts["at"] = {"bus", {}};
  imu.params["angle_random_walk"].value = 1e-5;
  sensors.spec.devices = {imu};
  return {orbit, tumbling, flexible, sensors};
}

/// Of very many rows every seventh.
struct Rows final : Recorder {
  explicit Rows(double expected) : every(expected > 1e5 ? 7 : 1) {}
  std::vector<std::vector<double>> all;
  long every, n = 0;
  void begin(const RunHeader&, const std::vector<Channel>&) override {}
  void row(double, std::span<const double> values) override {
    if (n++ % every == 0) all.emplace_back(values.begin(), values.end());
  }
  void attach(const std::string&, const std::string&) override {}
  void restart_state(double, std::span<const double>) override {}
  void flush() override {}
  void close(std::string_view) override {}
};

struct Run {
  double seconds = 0.0;
  long steps = 0, n = 0;  // n: of rows
  std::vector<std::vector<double>> rows;
  std::vector<std::size_t> sizes;  // of the channels
};

Run run_of(const Scene& scene, const Registry& registry, const std::string& method, double relative, bool between_steps) {
  SimulationOptions options;
  options.integrator.method = method, options.integrator.relative_tolerance = relative;
  options.between_steps = between_steps;
  Simulation sim(compile(scene.spec, registry), options);
  std::vector<Output> outputs = standard_outputs(sim);
  std::erase_if(outputs, [](const Output& o) { return o.channel.path.starts_with("ledger/"); });
  Rows rows(scene.duration * static_cast<double>(scene.period.denominator) / static_cast<double>(scene.period.numerator));
  std::vector<std::size_t> sizes;
  for (const Output& o : outputs) sizes.push_back(o.channel.components.size());
  sim.record(rows, std::move(outputs), scene.period);
  const auto begin = std::chrono::steady_clock::now();
  sim.run(scene.duration);
  return {std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(), sim.statistics().steps, rows.n,
          std::move(rows.all), std::move(sizes)};
}

/// The largest difference of a number over the largest of its channel.
double apart(const Run& a, const Run& b) {
  if (a.rows.size() != b.rows.size()) return HUGE_VAL;
  double most = 0.0;
  std::size_t first = 0;
  for (const std::size_t n : b.sizes) {
    double size = 0.0, off = 0.0;
    for (std::size_t i = 0; i < b.rows.size(); ++i)
      for (std::size_t c = first; c < first + n; ++c)
        size = std::max(size, std::abs(b.rows[i][c])), off = std::max(off, std::abs(a.rows[i][c] - b.rows[i][c]));
    if (off > 0.0) most = std::max(most, off / size);
    first += n;
  }
  return most;
}

bool measure(const Scene& scene, const Registry& registry) {
  const Run reference = run_of(scene, registry, "dop853", 1e-13, false);
  bool good = true;
  for (const char* method : {"dopri5", "dop853", "cvode_adams"})
    for (const double relative : {1e-6, 1e-9}) {
      const Run ends = run_of(scene, registry, method, relative, false), inside = run_of(scene, registry, method, relative, true);
      const double off = apart(inside, reference);
      fmt::print("| {:>8} | {:>11} | {:g} | {:>6} | {:>6} | {:>6} | {:>6.3f} | {:>6.3f} | {:>4.1f} | {:.1e} | {:.1e} |\n", scene.name,
                 method, relative, inside.n, ends.steps, inside.steps, ends.seconds, inside.seconds, ends.seconds / inside.seconds,
                 apart(ends, reference), off);
      std::fflush(stdout);
      good = good && inside.steps <= ends.steps && std::isfinite(off);
    }
  return good;
}

}  // namespace
}  // namespace cardan::bench

int main(int argc, char** argv) {
  std::string only;
  cardan::bench::CommandLine line("Rows inside of steps: time, steps and errors");
  line.option("--only", only, "orbit, tumbling, flexible or sensors");
  if (const auto code = line.parse(argc, argv)) return *code;
  cardan::Registry registry;
  cardan::register_hinges(registry);
  cardan::register_bodies(registry);
  cardan::register_devices(registry);
  fmt::print("| scene | method | relative | rows | steps | inside | s | inside | times | off by | inside |\n");
  fmt::print("|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n");
  bool good = true;
  for (const cardan::bench::Scene& scene : cardan::bench::scenes())
    if (only.empty() || only == scene.name) good = cardan::bench::measure(scene, registry) && good;
  return good ? 0 : 1;
}
