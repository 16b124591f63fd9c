// cardan-bench-loops: accelerations of the mechanisms with loops of tests/reference/bench_loops in each form: time, error, operations. Ends
// with 1 where an error exceeds what the tests allow.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

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

/// Nanoseconds per call of the tree that has neither couplings nor the bodies that they name last: the rotors of robots. None: 0.
double without_rotors(const bench_loops::Model& bench, const Registry& registry, double seconds) {
  SystemSpec spec = bench.spec;
  std::set<std::string> rotors;
  for (const LoopSpec& loop : spec.loops)
    for (const LoopSpec::Term& term : loop.terms)
      if (term.target.find("rotor") != std::string::npos) rotors.insert(term.target);
  if (rotors.empty()) return 0.0;
  spec.loops.clear();
  bench_loops::Model tree;
  tree.name = bench.name, tree.states.resize(bench.states.size());
  const std::shared_ptr<const Model> model = compile(bench.spec, registry);
  std::erase_if(spec.bodies, [&](const BodySpec& body) { return rotors.contains(body.name); });
  tree.spec = spec;
  const std::shared_ptr<const Model> left = compile(tree.spec, registry);
  for (std::size_t k = 0; k < bench.states.size(); ++k) {
    bench_loops::State& to = tree.states[k];
    const bench_loops::State& from = bench.states[k];
    to.q.resize(left->nq), to.v.resize(left->nv), to.tau.resize(left->nv);
    for (const UserBody& b : left->user) {
      const UserBody& old = *std::ranges::find(model->user, b.name, &UserBody::name);
      to.q.segment(b.q, b.nq) = from.q.segment(old.q, b.nq);
      to.v.segment(b.v, b.nv) = from.v.segment(old.v, b.nv);
      to.tau.segment(b.v, b.nv) = from.tau.segment(old.v, b.nv);
    }
  }
  return measure(*left, tree, seconds, true).ns;
}

int run(const std::string& only, double seconds, bool absolute) {
  Registry registry;
  register_hinges(registry);
  register_bodies(registry);
  fmt::print(
      "| {:<28} | bodies | rows | {:>9} | {:>11} | {:>7} | {:>9} | {:>7} |{} closed by |\n|---|---:|---:|---:|---:|---:|---:|---:|{}---|\n",
      "us", "open tree", "multipliers", "error", "embedding", "error", absolute ? fmt::format(" {:>8} | {:>7} |", "dae", "error") : "",
      absolute ? "---:|---:|" : "");
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
    if (const double ns = without_rotors(bench, registry, seconds); ns > 0.0)
      how += fmt::format("; without its rotors {:.2f} us, {:.2f} times that", 1e-3 * ns, of[1].ns / ns);
    std::string dae;
    if (absolute) {
      bench.spec.loop_form = LoopForm::dae;
      const Figure all = measure(*compile(bench.spec, registry), bench, seconds, false);
      dae = fmt::format(" {:>8.1f} | {:>7.1e} |", 1e-3 * all.ns, all.error);
      good = good && all.error <= allowed;
    }
    fmt::print("| {:<28} | {:>6} | {:>4} | {:>9.2f} | {:>11.2f} | {:>7.1e} | {:>9.2f} | {:>7.1e} |{} {} |\n", file.stem().string(),
               bench.spec.bodies.size(), model->loops.rows, 1e-3 * tree.ns, 1e-3 * of[0].ns, of[0].error, 1e-3 * of[1].ns, of[1].error, dae,
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
