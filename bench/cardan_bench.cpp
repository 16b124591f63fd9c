// Times the sweeps on a folder of models and measures their forward error against 113 bits on the same doubles.
//   cardan-bench [--models DIR|FILE] [--out FILE.json] [--seconds S] [--only SUBSTRING] [--exact DIR]
// One pinned core, a ring of states, minimum and median of passes over the ring. Rows: program, version, build, model, op,
// ns_min, ns_median, forward_error, bytes_per_body; then the growth exponents. With --exact it writes the 113-bit results for
// the peers instead.
#include <fmt/format.h>
#include <sched.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "bench/bench_model.hpp"
#include "bench/exact.hpp"
#include "bench/time_ring.hpp"
#include "bodies/register.hpp"
#include "core/dynamics/inverse.hpp"
#include "hinges/register.hpp"

namespace cardan::bench {
namespace {

struct Row {
  std::string model, op;
  int bodies;
  Timing timing;
  double error;   // forward error, 2-norm relative; negative: not measured
  double bytes_per_body;
};

void bench_model(const BenchModel& bm, const Registry& registry, double seconds, std::vector<Row>& rows) {
  const auto model = compile(bm.spec, registry, {.merge_locked = true, .choose_frames = true, .node_wrenches = false, .world_wrenches = false});
  Workspace ws(*model);
  const int n = static_cast<int>(model->bodies.size()) - 1, states = static_cast<int>(bm.states.size());
  const double bytes = static_cast<double>(ws.bytes()) / n;
  Eigen::VectorXd out(model->nv);
  double forward = -1.0, inverse = -1.0;  // largest relative errors
  if (model->flexible.empty()) {
    const std::vector<Exact> truth = exact(bm, registry);
    for (std::size_t s = 0; s < truth.size(); ++s) {
      const BenchState& state = bm.states[s];
      Inputs in;
      in.q = state.q.data(), in.v = state.v.data(), in.tau = state.tau.data();
      if (!forward_dynamics(*model, ws, in, out.data())) throw NumericsError(describe_breakdown(*model, ws.breakdown, 0.0));
      forward = std::max(forward, relative_error(out, truth[s].vdot));
      in.vdot = state.vdot.data();
      inverse_dynamics(*model, ws, in, out.data());
      inverse = std::max(inverse, relative_error(out, truth[s].tau));
    }
  }
  rows.push_back({bm.name, "forward_dynamics", n, time_ring(states, seconds, [&](int k) {
    const BenchState& s = bm.states[static_cast<std::size_t>(k)];
    Inputs in;
    in.q = s.q.data(), in.v = s.v.data(), in.tau = s.tau.data();
    forward_dynamics(*model, ws, in, out.data());
  }), forward, bytes});
  rows.push_back({bm.name, "inverse_dynamics", n, time_ring(states, seconds, [&](int k) {
    const BenchState& s = bm.states[static_cast<std::size_t>(k)];
    Inputs in;
    in.q = s.q.data(), in.v = s.v.data(), in.vdot = s.vdot.data();
    inverse_dynamics(*model, ws, in, out.data());
  }), inverse, bytes});
}

int run(int argc, char** argv) {
  CLI::App app("Times the sweeps and measures their error.");
  std::string models = CARDAN_SOURCE_DIR "/tests/reference/bench", out, only, truth;
  double seconds = 0.3;
  app.add_option("--models", models, "folder of models in the schema cardan-bench/1, or one of them");
  app.add_option("--out", out, "write the rows as JSON");
  app.add_option("--seconds", seconds, "time spent on each figure");
  app.add_option("--only", only, "models whose name contains this");
  app.add_option("--exact", truth, "only write the results in 113 bits, DIR/<model>.json");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  }
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(sched_getcpu(), &one);
  sched_setaffinity(0, sizeof one, &one);

  Registry registry;
  register_hinges(registry);
  register_bodies(registry);
  if (!truth.empty()) {
    for (const auto& file : models_in(models))
      if (const BenchModel bm = read_model(file); bm.name.find(only) != std::string::npos) write_exact(truth, bm, exact(bm, registry));
    return 0;
  }
  std::vector<Row> rows;
  fmt::print("{:32} {:18} {:>7} {:>12} {:>12} {:>9} {:>9} {:>8}\n", "model", "op", "bodies", "min ns", "median ns", "ns/body", "error", "B/body");
  const auto bench = [&](const BenchModel& bm) {
    if (bm.name.find(only) == std::string::npos) return;
    const std::size_t first = rows.size();
    bench_model(bm, registry, seconds, rows);
    for (std::size_t i = first; i < rows.size(); ++i) {
      const Row& r = rows[i];
      fmt::print("{:32} {:18} {:7} {:12.0f} {:12.0f} {:9.1f} {:>9} {:8.0f}\n", r.model, r.op, r.bodies, r.timing.min_ns, r.timing.median_ns,
                 r.timing.min_ns / r.bodies, r.error < 0 ? "-" : fmt::format("{:.1e}", r.error), r.bytes_per_body);
    }
  };
  for (const auto& file : models_in(models)) bench(read_model(file));
  for (const int modes : {5, 20, 40, 60})
    for (const int bodies : {3, 10, 30})
      if (std::filesystem::is_directory(models)) bench(flexible_chain(bodies, modes));

  // Growth: exponent of time in the number of bodies between the smallest and largest of a family.
  std::map<std::string, std::vector<const Row*>> families;
  for (const Row& r : rows) {
    std::string family = r.model.rfind("flexible_chain_", 0) == 0 ? "flexible_chain" + r.model.substr(r.model.find("_modes")) : r.model.substr(0, r.model.rfind('_'));
    if (r.model.rfind("hard_", 0) != 0) families[family + " " + r.op].push_back(&r);
  }
  for (auto& [family, list] : families) {
    std::sort(list.begin(), list.end(), [](const Row* a, const Row* b) { return a->bodies < b->bodies; });
    for (std::size_t i = 1; i < list.size(); ++i) {
      const Row &a = *list[i - 1], &b = *list[i];
      fmt::print("growth {:45} {:5} -> {:5} bodies: exponent {:.3f}\n", family, a.bodies, b.bodies,
                 std::log(b.timing.min_ns / a.timing.min_ns) / std::log(static_cast<double>(b.bodies) / a.bodies));
    }
  }
  if (!out.empty()) {
    nlohmann::json j = nlohmann::json::array();
    for (const Row& r : rows) {
      nlohmann::json row{{"program", "cardan"}, {"version", CARDAN_VERSION}, {"build", CARDAN_BUILD}, {"model", r.model}, {"op", r.op},
                         {"bodies", r.bodies}, {"ns_min", r.timing.min_ns}, {"ns_median", r.timing.median_ns}, {"bytes_per_body", r.bytes_per_body}};
      row["forward_error"] = r.error < 0 ? nlohmann::json() : nlohmann::json(r.error);
      j.push_back(row);
    }
    std::ofstream(out) << j.dump(1) << "\n";
  }
  return 0;
}

}  // namespace
}  // namespace cardan::bench

int main(int argc, char** argv) {
  try {
    return cardan::bench::run(argc, argv);
  } catch (const std::exception& e) {
    fmt::print(stderr, "{}\n", e.what());
    return 2;
  }
}
