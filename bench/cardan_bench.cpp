// Times the sweeps on a folder of models and measures their forward error against 113 bits on the same doubles.
//   cardan-bench [--models DIR] [--out FILE.json] [--seconds S] [--only SUBSTRING]
// One pinned core, a ring of states, minimum and median of passes over the ring. Rows: program, version, build, model, op,
// ns_min, ns_median, forward_error, bytes_per_body; then the growth exponents.
#include <fmt/format.h>
#include <sched.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "bench/bench_model.hpp"
#include "bench/forward_error.hpp"
#include "bodies/register.hpp"
#include "core/dynamics/inverse.hpp"
#include "hinges/register.hpp"

namespace cardan::bench {
namespace {

using Clock = std::chrono::steady_clock;

struct Timing {
  double min_ns, median_ns;
};

/// Mean time of a call over the ring, repeated for `seconds`.
template <class Call>
Timing time_ring(int states, double seconds, const Call& call) {
  for (int k = 0; k < states; ++k) call(k);  // warm-up
  auto begin = Clock::now();
  call(0);
  const double once = std::chrono::duration<double>(Clock::now() - begin).count();
  const int passes = std::max(1, static_cast<int>(2e-4 / std::max(1e-9, once * states)));
  std::vector<double> samples;
  const auto start = Clock::now();
  do {
    begin = Clock::now();
    for (int p = 0; p < passes; ++p)
      for (int k = 0; k < states; ++k) call(k);
    samples.push_back(std::chrono::duration<double, std::nano>(Clock::now() - begin).count() / (passes * states));
  } while (samples.size() < 5 || std::chrono::duration<double>(Clock::now() - start).count() < seconds);
  std::sort(samples.begin(), samples.end());
  return {samples.front(), samples[samples.size() / 2]};
}

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
  double error = -1.0;
  if (std::ranges::all_of(model->flexible, [](const FlexibleBody& f) { return f.constant; })) {
    error = 0.0;
    const auto plain = compile(bm.spec, registry, {.merge_locked = false, .choose_frames = false, .node_wrenches = false, .world_wrenches = false});
    for (int s = 0; s < std::min(3, states); ++s) {
      const BenchState& state = bm.states[static_cast<std::size_t>(s)];
      Inputs in;
      in.q = state.q.data(), in.v = state.v.data(), in.tau = state.tau.data();
      if (!forward_dynamics(*model, ws, in, out.data())) throw NumericsError(describe_breakdown(*model, ws.breakdown, 0.0));
      error = std::max(error, forward_error(*plain, state, out));
    }
  }
  rows.push_back({bm.name, "forward_dynamics", n, time_ring(states, seconds, [&](int k) {
    const BenchState& s = bm.states[static_cast<std::size_t>(k)];
    Inputs in;
    in.q = s.q.data(), in.v = s.v.data(), in.tau = s.tau.data();
    forward_dynamics(*model, ws, in, out.data());
  }), error, bytes});
  rows.push_back({bm.name, "inverse_dynamics", n, time_ring(states, seconds, [&](int k) {
    const BenchState& s = bm.states[static_cast<std::size_t>(k)];
    Inputs in;
    in.q = s.q.data(), in.v = s.v.data(), in.vdot = s.vdot.data();
    inverse_dynamics(*model, ws, in, out.data());
  }), -1.0, bytes});
}

int run(int argc, char** argv) {
  CLI::App app("Times the sweeps and measures their error.");
  std::string models = CARDAN_SOURCE_DIR "/tests/reference/bench", out, only;
  double seconds = 0.3;
  app.add_option("--models", models, "folder of models in the schema cardan-bench/1");
  app.add_option("--out", out, "write the rows as JSON");
  app.add_option("--seconds", seconds, "time spent on each figure");
  app.add_option("--only", only, "models whose name contains this");
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
    for (const int bodies : {3, 10, 30}) bench(flexible_chain(bodies, modes));
  for (const auto& [appendages, modes] : {std::pair{2, 5}, {2, 10}, {2, 20}, {2, 40}, {8, 10}, {16, 10}})
    for (int level = 0; level <= (appendages * modes <= 20 ? 2 : 1); ++level) bench(hub_appendages(appendages, modes, level));

  // Growth: exponent of time in the number of bodies between the smallest and largest of a family.
  std::map<std::string, std::vector<const Row*>> families;
  for (const Row& r : rows) {
    const auto is = [&](const char* prefix) { return r.model.rfind(prefix, 0) == 0; };
    const std::string family = is("flexible_chain_") ? "flexible_chain" + r.model.substr(r.model.find("_modes"))
                               : is("hub_")          ? "hub_n" + r.model.substr(r.model.find('x'))
                                                     : r.model.substr(0, r.model.rfind('_'));
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
