#include "bench/step_overhead.hpp"

#include <algorithm>
#include <array>
#include <chrono>

#include "bench/bench_model.hpp"
#include "core/sim/simulation.hpp"

namespace cardan::bench {
namespace {

using Clock = std::chrono::steady_clock;

double nanoseconds_since(Clock::time_point begin) { return std::chrono::duration<double, std::nano>(Clock::now() - begin).count(); }

SystemSpec pendulums(int n) {
  SystemSpec spec;
  spec.name = "pendulums_" + std::to_string(n);
  spec.gravity.kind = GravitySpec::Kind::uniform;
  spec.gravity.g = {0, 0, -9.81};
  for (int k = 0; k < n; ++k) {
    BodySpec body;
    body.name = "b" + std::to_string(k);
    body.mass = 1.0;
    body.com = {0, 0, -1.0 - 0.1 * k};
    body.inertia_com = Eigen::Vector3d(0.1, 0.1, 0.1).asDiagonal();
    body.hinge.type = "revolute";
    body.hinge.params["axis"] = {std::vector<double>{1, 0, 0}, {}};
    body.hinge.q = {0.3 + 0.02 * k};
    spec.bodies.push_back(std::move(body));
  }
  return spec;
}

/// A run with a task every second, timed in stretches of one second: ns per step.
class Run {
 public:
  Run(std::shared_ptr<const Model> model, const SimulationOptions& options) : sim_(std::move(model), options) {
    sim_.every({1, 1}, [] {});
    sim_.run(1.5);  // warm-up
  }
  double operator()() {
    const long steps = sim_.statistics().steps;
    const auto begin = Clock::now();
    sim_.run(sim_.time() + 1.0);
    return nanoseconds_since(begin) / static_cast<double>(sim_.statistics().steps - steps);
  }

 private:
  Simulation sim_;
};

/// Minimum and median.
std::pair<double, double> least_and_middle(std::vector<double> samples) {
  std::ranges::sort(samples);
  return {samples.front(), samples[samples.size() / 2]};
}

/// What some runs take, measured in turn for so many seconds: samples of each.
template <std::size_t N, class Measurement>
std::array<std::vector<double>, N> in_turn(double seconds, Measurement&& ns) {
  std::array<std::vector<double>, N> samples;
  const auto begin = Clock::now();
  do
    for (std::size_t i = 0; i < N; ++i) samples[i].push_back(ns(i));
  while (samples[0].size() < 5 || nanoseconds_since(begin) < 1e9 * seconds * N);
  return samples;
}

}  // namespace

std::vector<StepOverhead> step_overheads(const Registry& registry, double seconds) {
  CompileOptions no_loads;
  no_loads.node_wrenches = false;
  const auto model = compile(pendulums(15), registry, no_loads);
  const auto without_sweeps = std::make_shared<Model>(*model);
  without_sweeps->program.clear();
  Workspace ws(*model);
  const State at = model->initial_state();
  Eigen::VectorXd vdot(model->nv);
  Inputs in;
  in.q = at.q.data(), in.v = at.v.data();
  const double left_of_forward_dynamics = least_and_middle(in_turn<1>(0.1 * seconds,
                                                                      [&](std::size_t) {
                                                                        constexpr int calls = 1000;
                                                                        const auto begin = Clock::now();
                                                                        for (int k = 0; k < calls; ++k)
                                                                          forward_dynamics(*without_sweeps, ws, in, vdot.data());
                                                                        return nanoseconds_since(begin) / calls;
                                                                      })[0])
                                              .first;

  std::vector<StepOverhead> all;
  const auto add = [&](const std::string& op, std::vector<double> samples, double less = 0.0) {
    const auto [least, middle] = least_and_middle(std::move(samples));
    all.push_back({model->name, op, static_cast<int>(model->bodies.size()) - 1, least - less, middle - less});
  };
  for (const auto& [method, evaluations] :
       {std::pair<std::string, double>{"rk4", 4.0}, {"dopri5", 6.0}, {"dop853", 12.0}}) {  // of f in a step
    SimulationOptions options;
    options.integrator.method = method;
    (method == "rk4" ? options.integrator.fixed_step : options.integrator.max_step) = 0.01;
    options.ledger = false;
    Run bare(without_sweeps, options), plain(model, options);
    options.ledger = true;
    Run with_ledger(model, options);
    Run* runs[] = {&bare, &plain, &with_ledger};
    auto samples = in_turn<3>(seconds, [&](std::size_t i) { return (*runs[i])(); });
    for (std::size_t i = 0; i < samples[1].size(); ++i) samples[2][i] -= samples[1][i];  // what the machine does besides is in both
    add("step_" + method, samples[1]);
    add("step_overhead_" + method, samples[0], evaluations * left_of_forward_dynamics);
    const double middle = least_and_middle(samples[2]).second;
    all.push_back({model->name, "step_ledger_" + method, static_cast<int>(model->bodies.size()) - 1, middle, middle});
  }
  for (const std::string method : {"variational", "variational4"}) {  // its sweeps are no program that could be left out
    SimulationOptions options;
    options.integrator.method = method;
    options.integrator.fixed_step = 0.01;
    options.ledger = false;
    Run plain(model, options);
    add("step_" + method, in_turn<1>(seconds, [&](std::size_t) { return plain(); })[0]);
  }
  return all;
}

}  // namespace cardan::bench
