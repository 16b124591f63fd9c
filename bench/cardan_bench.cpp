// Times the sweeps on a folder of models and measures their forward error against 113 bits on the same doubles.
//   cardan-bench [--models DIR|FILE] [--out FILE.json] [--seconds S] [--only SUBSTRING] [--exact DIR]
// One pinned core, a ring of states, minimum and median of passes over the ring. Rows: program, version, build, model, op,
// ns_min, ns_median, forward_error, bytes_per_body; then the growth exponents. With --exact it writes the 113-bit results for
// the peers instead.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "bench/bench_model.hpp"
#include "bench/command_line.hpp"
#include "bench/exact.hpp"
#include "bench/step_overhead.hpp"
#include "bench/time_ring.hpp"
#include "bodies/register.hpp"
#include "core/dynamics/batch.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/sim/simulation.hpp"
#include "hinges/register.hpp"

namespace cardan::bench {
namespace {

struct Row {
  std::string model, op, call;  // call: a variant of the op, empty for the plain one
  int bodies;
  Timing timing;
  double error;  // forward error, 2-norm relative; negative: not measured; infinite: not a number
  double bytes_per_body;
};

/// The states of a ring side by side, repeated up to a whole number of passes of a batch, in another order in each pass (at the
/// same q P would be reused).
struct Ring {
  Eigen::MatrixXd q, v, tau, vdot;
  std::vector<Eigen::Index> column;  // of each state, the first
  Ring(const std::vector<BenchState>& states, int width) {
    const auto n = static_cast<Eigen::Index>(states.size()), count = (std::max<Eigen::Index>(n, 16) + width - 1) / width * width;
    q.resize(states[0].q.size(), count), v.resize(states[0].v.size(), count), tau.resizeLike(v), vdot.resizeLike(v);
    column.resize(states.size(), -1);
    for (Eigen::Index k = 0; k < count; ++k) {
      const auto state = static_cast<std::size_t>((k + (width > 1 ? k / width : 0)) % n);
      if (column[state] < 0) column[state] = k;
      const BenchState& s = states[state];
      q.col(k) = s.q, v.col(k) = s.v, tau.col(k) = s.tau, vdot.col(k) = s.vdot;
    }
  }
  int size() const { return static_cast<int>(q.cols()); }
};

void bench_model(const BenchModel& bm, const Registry& registry, double seconds, std::vector<Row>& rows) {
  const CompileOptions options{.merge_locked = true, .choose_frames = true, .node_wrenches = false, .world_wrenches = false};
  const auto spec = std::make_shared<const SystemSpec>(bm.spec);
  double bytes = -heap_bytes();
  const auto model = compile(spec, registry, options);
  const Model& m = *model;
  Workspace ws(m);  // all that a call needs
  bytes += heap_bytes();
  Batch batch(m);
  const int n = static_cast<int>(m.bodies.size()) - 1, states = static_cast<int>(bm.states.size());
  const Ring ring(bm.states, batch.width());
  const BatchInputs all{ring.size(), ring.q.data(), ring.v.data(), ring.tau.data(), ring.vdot.data(), true};
  const auto forward = [&](int k, Eigen::VectorXd& out) {
    const BenchState& s = bm.states[static_cast<std::size_t>(k)];
    Inputs in;
    in.q = s.q.data(), in.v = s.v.data(), in.tau = s.tau.data(), in.vdot = s.vdot.data();  // vdot: of given motion
    if (!forward_dynamics(m, ws, in, out.data())) throw NumericsError(describe_breakdown(m, ws.breakdown, 0.0));
  };
  const auto inverse = [&](int k, Eigen::VectorXd& out) {
    const BenchState& s = bm.states[static_cast<std::size_t>(k)];
    Inputs in;
    in.q = s.q.data(), in.v = s.v.data(), in.vdot = s.vdot.data();
    inverse_dynamics(m, ws, in, out.data());
  };
  // x' = f(t, x) as the integrator of a scenario calls it, without the ledger.
  SimulationOptions plain;
  plain.ledger = false;
  Simulation scenario(model, plain);
  const OdeProblem ode = scenario.ode();
  Eigen::MatrixXd x(m.nq + m.nv, states);
  for (int k = 0; k < states; ++k) x.col(k) << bm.states[static_cast<std::size_t>(k)].q, bm.states[static_cast<std::size_t>(k)].v;
  Eigen::VectorXd xdot(m.nq + m.nv);
  const auto right_hand_side = [&](int k) { ode.rhs(0.0, x.col(k).data(), xdot.data()); };
  Eigen::VectorXd out(m.nv);
  Eigen::MatrixXd outs(m.nv, ring.size());
  const bool matrices = m.nv <= 128;
  Eigen::MatrixXd M(matrices ? m.nv : 0, matrices ? m.nv : 0);

  // Largest relative errors over the states whose exact results are known; negative: not measured.
  double e_forward = -1, e_rhs = -1, e_inverse = -1, e_batch = -1, e_batch_inverse = -1, e_matrix = -1, e_inverse_matrix = -1;
  if (!m.has_prescribed()) {
    const std::vector<Exact> truth = exact(bm, registry);
    const auto worst = [](double& error, const Eigen::VectorXd& computed, const Eigen::VectorXd& true_value) {
      error = std::max(error, relative_error(computed, true_value));
    };
    for (std::size_t s = 0; s < truth.size(); ++s) {
      const int k = static_cast<int>(s);
      forward(k, out), worst(e_forward, out, truth[s].vdot);
      for (int i = 0; i < m.nv; ++i) scenario.set_force(i, bm.states[s].tau[i]);
      right_hand_side(k), worst(e_rhs, xdot.tail(m.nv), truth[s].vdot);
      inverse(k, out), worst(e_inverse, out, truth[s].tau);
      batch.forward_dynamics(all, outs.data()), worst(e_batch, outs.col(ring.column[s]), truth[s].vdot);
      batch.inverse_dynamics(all, outs.data()), worst(e_batch_inverse, outs.col(ring.column[s]), truth[s].tau);
      if (!matrices) continue;
      mass_matrix(m, ws, bm.states[s].q.data(), M.data()), worst(e_matrix, M * bm.states[s].vdot, truth[s].M_vdot);
      mass_matrix_inverse(m, ws, bm.states[s].q.data(), M.data()),
          truth[s].Minv_tau.size() > 0 ? worst(e_inverse_matrix, M * bm.states[s].tau, truth[s].Minv_tau) : void();
    }
  }
  bytes /= n;
  const double batch_bytes = static_cast<double>(batch.bytes()) / n / batch.width();
  const auto row = [&](const std::string& op, const std::string& call, double error, double per_body, const auto& timed) {
    rows.push_back({bm.name, op, call, n, time_ring(states, seconds, timed), error, per_body});
    return &rows.back().timing;
  };
  const auto per_sample = [&](Timing* t) { t->min_ns /= ring.size(), t->median_ns /= ring.size(); };
  const std::string lanes = fmt::format("batch, {} lanes", batch.width());
  rows.push_back({bm.name, "compile", "", n, time_ring(1, seconds, [&](int) { compile(spec, registry, options); }), -1.0, bytes});
  row("forward_dynamics", "", e_forward, bytes, [&](int k) { forward(k, out); });
  row("right_hand_side", "", e_rhs, bytes, [&](int k) { right_hand_side(k); });
  per_sample(row("forward_dynamics", lanes, e_batch, batch_bytes, [&](int) { batch.forward_dynamics(all, outs.data()); }));
  row("inverse_dynamics", "", e_inverse, bytes, [&](int k) { inverse(k, out); });
  per_sample(row("inverse_dynamics", lanes, e_batch_inverse, batch_bytes, [&](int) { batch.inverse_dynamics(all, outs.data()); }));
  if (!matrices) return;
  row("mass_matrix", "", e_matrix, bytes, [&](int k) { mass_matrix(m, ws, bm.states[static_cast<std::size_t>(k)].q.data(), M.data()); });
  row("mass_matrix_inverse", "", e_inverse_matrix, bytes,
      [&](int k) { mass_matrix_inverse(m, ws, bm.states[static_cast<std::size_t>(k)].q.data(), M.data()); });
}

int run(int argc, char** argv) {
  CommandLine line("Times the sweeps and measures their error.");
  std::string models = CARDAN_SOURCE_DIR "/tests/reference/bench", out, only, truth;
  double seconds = 0.3;
  line.option("--models", models, "folder of models in the schema cardan-bench/1, or one of them");
  line.option("--out", out, "write the rows as JSON");
  line.option("--seconds", seconds, "time spent on each figure");
  line.option("--only", only, "models whose name contains this");
  line.option("--exact", truth, "only write the results in 113 bits, DIR/<model>.json");
  if (const auto code = line.parse(argc, argv)) return *code;
  stay_on_this_core();

  Registry registry;
  register_hinges(registry);
  register_bodies(registry);
  if (!truth.empty()) {
    for (const auto& file : models_in(models))
      if (const BenchModel bm = read_model(file); bm.name.find(only) != std::string::npos) write_exact(truth, bm, exact(bm, registry));
    return 0;
  }
  std::vector<Row> rows;
  fmt::print("| {:28} | {:35} | bodies | {:>10} | {:>10} | {:>9} | {:>7} | {:>7} |\n|---|---|---:|---:|---:|---:|---:|---:|\n", "model",
             "op", "min, ns", "median, ns", "per body", "error", "B/body");
  std::size_t printed = 0;
  const auto print_new_rows = [&] {
    for (; printed < rows.size(); ++printed) {
      const Row& r = rows[printed];
      fmt::print("| {:28} | {:35} | {:6} | {:10.0f} | {:10.0f} | {:9.1f} | {:>7} | {:7.0f} |\n", r.model,
                 r.call.empty() ? r.op : r.op + " " + r.call, r.bodies, r.timing.min_ns, r.timing.median_ns, r.timing.min_ns / r.bodies,
                 r.error < 0 ? "-" : fmt::format("{:.1e}", r.error), r.bytes_per_body);
    }
  };
  const auto bench = [&](const BenchModel& bm) {
    if (bm.name.find(only) == std::string::npos) return;
    bench_model(bm, registry, seconds, rows);
    print_new_rows();
  };
  for (const auto& file : models_in(models)) bench(read_model(file));
  for (const int modes : {5, 20, 40, 60})
    for (const int bodies : {3, 10, 30})
      if (std::filesystem::is_directory(models)) bench(flexible_chain(bodies, modes));
  for (const auto& [appendages, modes] : {std::pair{2, 5}, {2, 10}, {2, 20}, {2, 40}, {8, 10}, {16, 10}})
    for (int level = 0; level <= (appendages * modes <= 20 ? 2 : 1); ++level)
      if (std::filesystem::is_directory(models)) bench(hub_appendages(appendages, modes, level));
  for (const int modes : {5, 10, 20, 40})
    for (int level = 0; level <= 2; ++level)
      if (std::filesystem::is_directory(models) && fmt::format("wings_2x{}_level_{}", modes, level).find(only) != std::string::npos)
        bench(hub_wings(modes, level));
  const bool made = std::filesystem::is_directory(models);
  const std::string wings = "flexible_spacecraft";  // with wings of plates, as in a scenario
  if (made && wings.find(only) != std::string::npos)
    bench(vehicle_model(wings, CARDAN_SOURCE_DIR "/scenarios/01_flexible_slew/vehicle.yaml", registry));
  if (made && std::string("step_overhead").find(only) != std::string::npos)
    for (const StepOverhead& s : step_overheads(registry, seconds))
      rows.push_back({s.model, s.op, "", s.bodies, {s.min_ns, s.median_ns}, -1.0, 0.0});
  print_new_rows();

  // Growth: exponent of time in the number of bodies between the smallest and largest of a family.
  std::map<std::string, std::vector<const Row*>> families;
  for (const Row& r : rows) {
    const auto is = [&](const char* prefix) { return r.model.rfind(prefix, 0) == 0; };
    const std::string family = is("flexible_chain_")        ? "flexible_chain" + r.model.substr(r.model.find("_modes"))
                               : is("hub_") || is("wings_") ? "hub_n" + r.model.substr(r.model.find('x'))
                                                            : r.model.substr(0, r.model.rfind('_'));
    if (!is("hard_")) families[family + " " + r.op + " " + r.call].push_back(&r);
  }
  bool first = true;
  for (auto& [family, list] : families) {
    std::sort(list.begin(), list.end(), [](const Row* a, const Row* b) { return a->bodies < b->bodies; });
    for (std::size_t i = 1; i < list.size(); ++i) {
      const Row &a = *list[i - 1], &b = *list[i];
      if (std::exchange(first, false)) fmt::print("\n| {:60} | bodies | to bodies | exponent of time |\n|---|---:|---:|---:|\n", "growth");
      fmt::print("| {:60} | {:6} | {:9} | {:16.3f} |\n", family, a.bodies, b.bodies,
                 std::log(b.timing.min_ns / a.timing.min_ns) / std::log(static_cast<double>(b.bodies) / a.bodies));
    }
  }
  if (!out.empty()) {
    nlohmann::json j = nlohmann::json::array();
    for (const Row& r : rows) {
      nlohmann::json row{{"program", "cardan"},
                         {"version", CARDAN_VERSION},
                         {"build", CARDAN_BUILD},
                         {"model", r.model},
                         {"op", r.op},
                         {"bodies", r.bodies},
                         {"ns_min", r.timing.min_ns},
                         {"ns_median", r.timing.median_ns},
                         {"bytes_per_body", r.bytes_per_body}};
      if (!r.call.empty()) row["call"] = r.call;
      row["forward_error"] = r.error >= 0 && std::isfinite(r.error) ? nlohmann::json(r.error) : nlohmann::json();
      if (!std::isfinite(r.error)) row["reason"] = "fails";  // JSON has no infinity: null alone means not measured
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
