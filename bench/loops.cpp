// cardan-bench-loops: accelerations of the mechanisms with loops of tests/reference/bench_loops in each form: time, error, operations. Ends
// with 1 where an error exceeds what the tests allow.
#include <fmt/format.h>

#include <cmath>

#include "bench/command_line.hpp"
#include "bench/time_ring.hpp"
#include "bodies/register.hpp"
#include "core/dynamics/forward.hpp"
#include "core/dynamics/loops.hpp"
#include "core/model/embedding.hpp"
#include "core/model/loops.hpp"
#include "hinges/register.hpp"
#include "tests/support/bench_loops.hpp"

namespace cardan::bench {
namespace {

struct Figure {
  double ns = 0.0, error = 0.0;
};

Figure measure(const Model& model, const bench_loops::Model& bench, double seconds, bool open) {
  Workspace ws(model);
  std::vector<Eigen::VectorXd> vdot(bench.states.size(), Eigen::VectorXd(model.nv));
  const auto call = [&](int k) {
    const bench_loops::State& s = bench.states[static_cast<std::size_t>(k)];
    const Inputs in{.q = s.q.data(), .v = s.v.data(), .tau = s.tau.data()};
    forward_dynamics(model, ws, in, vdot[static_cast<std::size_t>(k)].data());
  };
  Figure out;
  out.ns = time_ring(static_cast<int>(bench.states.size()), seconds, call).min_ns;
  for (std::size_t k = 0; !open && k < bench.states.size(); ++k) {
    const Eigen::VectorXd& want = bench.states[k].vdot;
    const double error = (vdot[k] - want).cwiseAbs().maxCoeff<Eigen::PropagateNaN>() / want.cwiseAbs().maxCoeff();
    if (!(error <= out.error)) out.error = error;
  }
  return out;
}

int run(const std::string& only, double seconds, bool absolute) {
  Registry registry;
  register_hinges(registry);
  register_bodies(registry);
  fmt::print(
      "| {:<28} | bodies | rows | {:>9} | {:>11} | {:>7} | {:>9} | {:>7} | closed by |\n|---|---:|---:|---:|---:|---:|---:|---:|---|\n",
      "us", "open tree", "multipliers", "error", "embedding", "error");
  bool good = true;
  for (const auto& file : bench_loops::files()) {
    if (file.stem().string().find(only) == std::string::npos) continue;
    bench_loops::Model bench = bench_loops::read(file);
    double floor = 0.0;
    for (const bench_loops::State& s : bench.states) floor = std::max(floor, s.floor);
    const double allowed = std::max(1e-13, 100.0 * floor);
    Figure of[2];
    std::shared_ptr<const Model> model;
    std::string how;
    for (const LoopForm form : {LoopForm::multipliers, LoopForm::automatic}) {
      bench.spec.loop_form = form;
      model = compile(bench.spec, registry);
      of[form == LoopForm::automatic] = measure(*model, bench, seconds, false);
    }
    int rates = 0;
    for (const LoopSet& set : model->loops.sets) rates += set.form == "rates";
    how = !model->loops.embedding ? "multipliers: " + model->loops.sets[0].why
                                  : fmt::format("{} by rates, {} by multipliers in the sweep, width {}, {} flops", rates,
                                                model->loops.sets.size() - static_cast<std::size_t>(rates), model->loops.embedding->width,
                                                model->loops.embedding->flops);
    const Figure tree = measure(*open_tree(model), bench, seconds, true);
    if (absolute) {
      bench.spec.loop_form = LoopForm::dae;
      const Figure all = measure(*compile(bench.spec, registry), bench, seconds, false);
      how += fmt::format("; all bodies in absolute coordinates: {:.2f} us, {:.1e}", 1e-3 * all.ns, all.error);
      good = good && all.error <= allowed;
    }
    fmt::print("| {:<28} | {:>6} | {:>4} | {:>9.2f} | {:>11.2f} | {:>7.1e} | {:>9.2f} | {:>7.1e} | {} |\n", file.stem().string(),
               bench.spec.bodies.size(), model->loops.rows, 1e-3 * tree.ns, 1e-3 * of[0].ns, of[0].error, 1e-3 * of[1].ns, of[1].error,
               how);
    std::fflush(stdout);
    good = good && of[0].error <= allowed && of[1].error <= allowed;
  }
  return good ? 0 : 1;
}

}  // namespace
}  // namespace cardan::bench

int main(int argc, char** argv) {
  cardan::bench::CommandLine line("accelerations of mechanisms with closed loops");
  std::string only;
  double seconds = 0.05;
  line.option("--only", only, "mechanisms whose name contains this");
  line.option("--seconds", seconds, "for each figure");
  bool absolute = false;
  line.option("--dae", absolute, "also all bodies in absolute coordinates (loop_form: dae)");
  if (const auto code = line.parse(argc, argv)) return *code;
  return cardan::bench::run(only, seconds, absolute);
}
