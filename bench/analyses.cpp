// cardan-bench-analyses: times node compliance, operational space inertia, derivatives of forward dynamics and the linear model on models
// in the schema cardan-bench/1, and measures their error against the dense twin in 113 bits.
//   cardan-bench-analyses [--models DIR|FILE] [--only SUBSTRING] [--seconds S] [--out FILE.json] [--exact DIR]
// Rows are those of cardan-bench. With --exact it writes what is to come out for the peers instead. cardan-bench-report --analyses runs it
// and them in turn.
#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "bench/bench_model.hpp"
#include "bench/command_line.hpp"
#include "bench/exact.hpp"
#include "bench/time_ring.hpp"
#include "bodies/register.hpp"
#include "core/dynamics/node_compliance.hpp"
#include "core/operators/linear_model.hpp"
#include "core/operators/sensitivity.hpp"
#include "core/reference/dense_dynamics.hpp"
#include "core/reference/factor.hpp"
#include "core/reference/quad.hpp"
#include "hinges/register.hpp"

namespace cardan::bench {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Bodies that carry no other, and of them the first at the end of the longest path: nodes that are looked at, at their origins.
std::vector<int> ends_of(const SystemSpec& spec, const Model& model) {
  std::vector<int> nodes;
  for (const BodySpec& b : spec.bodies)
    if (std::ranges::none_of(spec.bodies, [&](const BodySpec& other) { return other.hinge.inboard_body == b.name; }))
      nodes.push_back(model.find_node(b.name));
  return nodes;
}
int hand_of(const SystemSpec& spec, const Model& model) {
  const auto depth = [&](int node) {
    int d = 0;
    for (std::string name = model.nodes[static_cast<std::size_t>(node)].name; !name.empty(); ++d)
      name = std::ranges::find(spec.bodies, name, &BodySpec::name)->hinge.inboard_body;
    return d;
  };
  const std::vector<int> ends = ends_of(spec, model);
  return *std::ranges::max_element(ends, {}, depth);
}

/// What is to come out at one state, columns one after the other: C (6s x 6s), Lambda (6 x 6), [dv'/dq dv'/dv dv'/dtau] (nv x 3 nv).
struct ExactAnalyses {
  VectorXd compliance, inertia, derivatives;
};

ExactAnalyses exact_analyses(const BenchModel& bm, const Model& model, const BenchState& state) {
  using T = reference::Quad;
  using Vector = reference::VecX<T>;
  using Matrix = reference::MatX<T>;
  const auto down = [](const Matrix& x) { return VectorXd(x.cast<double>().reshaped()); };
  const reference::DenseTwin<T> twin(bm.spec);
  const Vector q = state.q.cast<T>(), v = state.v.cast<T>(), tau = state.tau.cast<T>();
  const auto here = twin.at(q, v);
  const auto jacobian = [&](const std::vector<int>& nodes) {
    Matrix J(6 * static_cast<Eigen::Index>(nodes.size()), model.nv);
    for (std::size_t a = 0; a < nodes.size(); ++a)
      J.middleRows(6 * static_cast<Eigen::Index>(a), 6) = here.node(model.nodes[static_cast<std::size_t>(nodes[a])].name, "").J;
    return J;
  };
  const Eigen::LLT<Matrix> mass(here.M);
  const auto compliance = [&](const std::vector<int>& nodes) {
    const Matrix J = jacobian(nodes);
    return Matrix(J * mass.solve(Matrix(J.transpose())));
  };
  ExactAnalyses out;
  out.compliance = down(compliance(ends_of(bm.spec, model)));
  const Matrix C = compliance({hand_of(bm.spec, model)});
  out.inertia = down(Eigen::LLT<Matrix>(C).solve(Matrix(Matrix::Identity(6, 6))));
  // Differences of fourth order: h^4 and 2^-113 / h are both far below 2^-53.
  const T h(1e-6);
  Matrix all(model.nv, 3 * model.nv);
  const auto slope = [&](Eigen::Index column, const Vector& dq, const Vector& dv) {
    Vector sum = Vector::Zero(model.nv);
    for (const auto& [steps, weight] : {std::pair(1, 8), {-1, -8}, {2, -1}, {-2, 1}})
      sum += T(weight) * twin.at(q + T(steps) * h * dq, v + T(steps) * h * dv).forward(tau);
    all.col(column) = sum / (T(12) * h);
  };
  VectorXd rate(model.nq);
  for (int j = 0; j < model.nv; ++j) {
    const VectorXd unit = VectorXd::Unit(model.nv, j);
    model.qdot(state.q.data(), unit.data(), rate.data());
    slope(j, rate.cast<T>(), Vector::Zero(model.nv));
    slope(model.nv + j, Vector::Zero(model.nq), unit.cast<T>());
  }
  all.rightCols(model.nv) = mass.solve(Matrix(Matrix::Identity(model.nv, model.nv)));
  out.derivatives = down(all);
  return out;
}

/// The first states: the twin in 113 bits is asked 8 nv times for each.
std::vector<ExactAnalyses> exact_analyses(const BenchModel& bm, const Model& model) {
  std::vector<ExactAnalyses> all;
  for (std::size_t k = 0; k < std::min<std::size_t>(2, bm.states.size()); ++k) all.push_back(exact_analyses(bm, model, bm.states[k]));
  return all;
}

struct Row {
  std::string op, call;
  Timing timing;
  double error;
};

std::vector<Row> rows_of(const BenchModel& bm, const std::shared_ptr<const Model>& model, const std::vector<ExactAnalyses>& truth,
                         double seconds) {
  const std::vector<int> ends = ends_of(bm.spec, *model), hand{hand_of(bm.spec, *model)};
  const auto state = [&](int k) -> const BenchState& { return bm.states[static_cast<std::size_t>(k)]; };
  NodeCompliance nodes(model);
  operators::Sensitivities about(model);
  MatrixXd C, Lambda;
  operators::ForwardDerivatives derivatives;
  operators::LinearModel linear;
  const auto side_by_side = [&](const MatrixXd& q, const MatrixXd& v, const MatrixXd& tau) {
    MatrixXd all(model->nv, 3 * model->nv);
    all << q, v, tau;
    return VectorXd(all.reshaped());
  };
  struct Analysis {
    const char *op, *call;
    std::function<void(int)> run;
    std::function<VectorXd()> result;
    VectorXd ExactAnalyses::*truth;
  };
  const std::vector<Analysis> all{
      {"node_compliance", "", [&](int k) { nodes.compliance(state(k).q.data(), ends, C); }, [&] { return VectorXd(C.reshaped()); },
       &ExactAnalyses::compliance},
      {"operational_inertia", "", [&](int k) { nodes.inertia(state(k).q.data(), hand, Lambda); },
       [&] { return VectorXd(Lambda.reshaped()); }, &ExactAnalyses::inertia},
      {"forward_derivatives", "sensitivities",
       [&](int k) {
         about.solve({.q = state(k).q.data(), .v = state(k).v.data(), .tau = state(k).tau.data()});
         derivatives = about.forward();
       },
       [&] { return side_by_side(derivatives.q, derivatives.v, derivatives.tau); }, &ExactAnalyses::derivatives},
      {"forward_derivatives", "linear model",
       [&](int k) { linear = operators::linearize(about, {.q = state(k).q.data(), .v = state(k).v.data(), .tau = state(k).tau.data()}); },
       [&] {
         const int nv = model->nv;
         return side_by_side(linear.A.bottomLeftCorner(nv, nv), linear.A.bottomRightCorner(nv, nv), linear.B.bottomRows(nv));
       },
       &ExactAnalyses::derivatives},
  };
  std::vector<Row> rows;
  for (const Analysis& a : all) {
    double error = -1.0;
    for (std::size_t k = 0; k < truth.size(); ++k) {
      a.run(static_cast<int>(k));
      error = std::max(error, relative_error(a.result(), truth[k].*a.truth));
    }
    rows.push_back({a.op, a.call, time_ring(static_cast<int>(bm.states.size()), seconds, a.run), error});
  }
  return rows;
}

int run(int argc, char** argv) {
  CommandLine line("Times analyses and measures their error.");
  std::string models = CARDAN_SOURCE_DIR "/tests/reference/bench", out, only = "spacecraft", exact;
  double seconds = 0.3;
  line.option("--models", models, "folder of models in the schema cardan-bench/1, or one of them");
  line.option("--out", out, "write the rows as JSON");
  line.option("--seconds", seconds, "time spent on each figure");
  line.option("--only", only, "models whose name contains this");
  line.option("--exact", exact, "only write the results in 113 bits, DIR/<model>.json");
  if (const auto code = line.parse(argc, argv)) return *code;
  stay_on_this_core();
  Registry registry;
  register_hinges(registry);
  register_bodies(registry);
  nlohmann::json list = nlohmann::json::array();
  bool good = true;
  if (exact.empty()) fmt::print("| model | analysis | min, us | median, us | error |\n|---|---|---:|---:|---:|\n");
  for (const auto& file : models_in(models)) {
    const BenchModel bm = read_model(file);
    if (bm.name.find(only) == std::string::npos) continue;
    const auto model = compile(bm.spec, registry);
    const std::vector<ExactAnalyses> truth = exact_analyses(bm, *model);
    if (!exact.empty()) {
      const auto numbers = [](const VectorXd& x) { return std::vector<double>(x.data(), x.data() + x.size()); };
      nlohmann::json j;
      for (const ExactAnalyses& e : truth)
        j.push_back({{"node_compliance", numbers(e.compliance)},
                     {"operational_inertia", numbers(e.inertia)},
                     {"forward_derivatives", numbers(e.derivatives)}});
      std::filesystem::create_directories(exact);
      std::ofstream(std::filesystem::path(exact) / (bm.name + ".json")) << j.dump() << "\n";
      continue;
    }
    for (const Row& r : rows_of(bm, model, truth, seconds)) {
      fmt::print("| {} | {} | {:.2f} | {:.2f} | {:.1e} |\n", bm.name, r.call.empty() ? r.op : r.op + ", " + r.call, 1e-3 * r.timing.min_ns,
                 1e-3 * r.timing.median_ns, r.error);
      good = good && r.error < 1e-11;
      list.push_back({{"program", "cardan"},
                      {"version", CARDAN_VERSION},
                      {"build", CARDAN_BUILD},
                      {"model", bm.name},
                      {"op", r.op},
                      {"call", r.call.empty() ? r.op : r.call},
                      {"bodies", bm.spec.bodies.size()},
                      {"ns_min", r.timing.min_ns},
                      {"ns_median", r.timing.median_ns},
                      {"forward_error", r.error}});
    }
  }
  if (!out.empty()) std::ofstream(out) << list.dump(1) << "\n";
  return good ? 0 : 1;
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
