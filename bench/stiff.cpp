// cardan-bench-stiff: BDF with a dense Newton matrix and by Krylov, on chains of flexible bodies whose modes are fast
// and damped out, for 30, 100, 300 and 1000 states: time and counts beside the error against dopri5 with a tight
// tolerance.
#include <fmt/format.h>

#include <cmath>
#include <ctime>

#include "bench/bench_model.hpp"
#include "bench/command_line.hpp"
#include "bodies/register.hpp"
#include "core/sim/simulation.hpp"
#include "hinges/register.hpp"

namespace cardan::bench {
namespace {

/// flexible_chain with modes from 5000 rad/s on, 30 % of critical damping, on hinges with springs and dampers; let go
/// at an angle. 2 n (1 + m) states.
SystemSpec stiff_chain(int bodies, int modes) {
  SystemSpec spec = flexible_chain(bodies, modes).spec;
  for (BodySpec& b : spec.bodies) {
    auto modal = std::make_shared<ModalData>(*b.modal);
    modal->K *= 1e6;
    modal->C = Eigen::MatrixXd((0.6 * modal->K.diagonal().cwiseSqrt()).asDiagonal());
    b.modal = modal;
    b.hinge.q = {0.1};
    SpringDamper spring;
    spring.stiffness = 2e4, spring.damping = 500.0;
    b.hinge.springs = {spring};
    b.eta.assign(static_cast<std::size_t>(modes), 0.0);
  }
  return spec;
}

struct Outcome {
  Eigen::VectorXd x;
  double seconds = 0.0;
  IntegratorStatistics counts;
};

Outcome run(const std::shared_ptr<const Model>& model, const IntegratorOptions& integrator, double t_end) {
  SimulationOptions options;
  options.integrator = integrator;
  options.ledger = false;
  Simulation sim(model, options);
  const std::clock_t begin = std::clock();  // of the process: what others run does not count
  sim.run(t_end);
  Outcome out;
  out.seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  out.counts = sim.statistics();
  out.x.resize(model->nq + model->nv);
  out.x << sim.state().q, sim.state().v;
  return out;
}

int compare(double relative, double t_end, int repeats, int largest, const std::string& only, bool against_dopri5) {
  Registry registry;
  register_hinges(registry);
  register_bodies(registry);
  fmt::print(
      "| states | {:>7} | {:>9} | {:>7} | {:>9} | {:>9} | {:>9} | precond | {:>9} |\n|---:|---|---:|---:|---:|---:|---:|---:|---:|\n",
      "solver", "cpu, s", "steps", "f", "J v", "linear", "error");
  for (const auto& [bodies, modes] : {std::pair{3, 4}, {5, 9}, {10, 14}, {25, 19}}) {
    const auto model = compile(stiff_chain(bodies, modes), registry);
    const int n = model->nq + model->nv;
    if (n > largest) continue;
    IntegratorOptions bdf{.method = "cvode_bdf", .relative_tolerance = relative};
    Outcome dense, krylov, truth;
    if (against_dopri5) truth = run(model, {.method = "dopri5", .relative_tolerance = 1e-11}, t_end);
    for (int i = 0; i < repeats; ++i)
      for (const char* solver : {"dense", "krylov"}) {
        if (std::string(solver).find(only) == std::string::npos) continue;
        bdf.linear_solver = solver;
        Outcome now = run(model, bdf, t_end);
        Outcome& best = *solver == 'd' ? dense : krylov;
        if (best.x.size() == 0 || now.seconds < best.seconds) best = now;
      }
    for (const auto& [name, o] : {std::pair<const char*, const Outcome&>{"dense", dense}, {"krylov", krylov}, {"dopri5", truth}}) {
      if (o.x.size() == 0) continue;
      // of the coordinates alone, over the largest of them
      const double error =
          against_dopri5 ? (o.x - truth.x).head(model->nq).cwiseAbs().maxCoeff() / truth.x.head(model->nq).cwiseAbs().maxCoeff() : NAN;
      fmt::print("| {:>6} | {:>7} | {:>9.4f} | {:>7} | {:>9} | {:>9} | {:>9} | {:>7} | {:>9.1e} |\n", n, name, o.seconds, o.counts.steps,
                 o.counts.rhs_calls, o.counts.jacobian_products, o.counts.linear_iterations, o.counts.preconditioner_setups, error);
      std::fflush(stdout);
    }
  }
  return 0;
}

}  // namespace
}  // namespace cardan::bench

int main(int argc, char** argv) {
  double relative = 1e-4, t_end = 0.1;
  int repeats = 1, largest = 1000;
  std::string only;
  bool no_reference = false;
  cardan::bench::CommandLine line("Stiff chains of flexible bodies: BDF, dense and Krylov");
  line.option("--relative", relative, "relative tolerance of BDF");
  line.option("--duration", t_end, "simulated time [s]");
  line.option("--repeats", repeats, "runs of each; the fastest counts");
  line.option("--largest", largest, "largest number of states");
  line.option("--only", only, "dense or krylov");
  line.option("--no-reference", no_reference, "leave dopri5 and the errors out");
  if (const auto code = line.parse(argc, argv)) return *code;
  return cardan::bench::compare(relative, t_end, repeats, largest, only, !no_reference);
}
