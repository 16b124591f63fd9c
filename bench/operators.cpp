// cardan-bench-operators: time of each method of the operator algebra, or with --count its instructions, against the number of
// bodies, N = 10 ... 3000, and the exponent of its growth from 100 on: the instructions of what is O(N) must show 1.1 at most.
#include <fmt/format.h>

#include <cmath>
#include <functional>

#include "bench/bench_model.hpp"
#include "bench/command_line.hpp"
#include "bench/operation_count.hpp"
#include "bench/time_ring.hpp"
#include "bodies/register.hpp"
#include "core/operators/apply.hpp"
#include "core/operators/diagonalised.hpp"
#include "core/operators/hybrid.hpp"
#include "core/operators/log_det.hpp"
#include "core/operators/mass_matrix.hpp"
#include "core/operators/sensitivity.hpp"
#include "core/operators/system_properties.hpp"
#include "hinges/register.hpp"

namespace cardan::bench {
namespace {

using namespace operators;
using namespace operators::letters;
using Eigen::VectorXd;

/// Body k hangs on body (k - 1) / 2 (tree) or k - 1 (chain); hinges in turn of one, two and three degrees of freedom.
SystemSpec rigid_bodies(int n, bool tree) {
  SystemSpec spec;
  spec.name = tree ? "tree" : "chain";
  for (int k = 0; k < n; ++k) {
    BodySpec b;
    b.name = fmt::format("b{}", k);
    b.mass = 1.0 + 0.1 * (k % 7);
    b.com = {0.2, 0.05 * (k % 3), -0.03};
    b.inertia_com = Eigen::Vector3d(0.03, 0.04 + 0.001 * (k % 5), 0.05).asDiagonal();
    b.hinge.inboard_body = k == 0 ? "" : fmt::format("b{}", tree ? (k - 1) / 2 : k - 1);
    b.hinge.onode_position = k == 0 ? Eigen::Vector3d::Zero() : Eigen::Vector3d(0.4, k % 2 ? 0.1 : -0.1, 0.02);
    b.hinge.type = k % 3 == 0 ? "revolute" : k % 3 == 1 ? "universal" : "ball";
    if (k % 3 == 0) b.hinge.params["axis"].value = std::vector<double>{0, 0, 1};
    if (k % 3 == 1) b.hinge.params["axes"].value = std::vector<double>{1, 0, 0, 0, 1, 0};
    spec.bodies.push_back(b);
  }
  return spec;
}

struct Scene {
  explicit Scene(std::shared_ptr<const Model> m) : model(m), tree(m), base(m), sensitivities(m), workspace(*m) {
    VectorXd d = VectorXd::LinSpaced(m->nv, -0.3, 0.3);
    q.resize(m->nq);
    m->retract(m->initial_state().q.data(), d.data(), q.data());
    v = VectorXd::LinSpaced(m->nv, -0.5, 1.0), tau = VectorXd::LinSpaced(m->nv, 2.0, -1.0);
    for (operators::TreeOperators* t : {&tree, &base}) t->at(q.data());
    tree.articulate();
    tree.operational_space();
    base.articulate({.free = operators::base_mask(base)});
    diagonalised = std::make_unique<Diagonalised>(tree);
    sensitivities.solve({.q = q.data(), .v = v.data(), .tau = tau.data()});
    const auto all = static_cast<int>(tree.nodes().size());
    for (int j = 1; j <= 8; ++j) nodes.push_back(tree.nodes()[static_cast<std::size_t>(j * all / 8 - 1)]);
  }
  std::shared_ptr<const Model> model;
  TreeOperators tree, base;  // all free; the hinges of the roots alone
  Sensitivities sensitivities;
  std::unique_ptr<Diagonalised> diagonalised;
  Workspace workspace;
  std::vector<int> nodes;  // eight, spread over the bodies
  VectorXd q, v, tau, x, y;
};

struct Method {
  const char* name;
  int power;  // what the text claims
  std::function<void(Scene&)> call;
};

/// y = E x.
template <bool Fuse = true, class E>
Method apply_of(const char* name, E e) {
  return {name, 1, [e](Scene& s) {
            const int n = s.tree.size(Shape<E>::cols);
            if (s.x.size() != n) s.x = VectorXd::LinSpaced(n, -1.0, 1.0);
            s.y.resize(s.tree.size(Shape<E>::rows));
            apply<Fuse>(e, s.tree, s.x.data(), s.y.data());
          }};
}

std::vector<Method> methods() {
  using namespace soa;
  static const Eigen::Matrix<double, 6, 1> u = Eigen::Matrix<double, 6, 1>::Ones();
  return {
      apply_of("phi", phi),
      apply_of<false>("mass, by the rules", mass),
      apply_of("mass, by the sweeps if rigid", mass),
      apply_of<false>("mass inverse, by the rules", mass_inverse),
      apply_of("mass inverse, by the sweeps", mass_inverse),
      apply_of("Omega", omega),
      {"Position and all after it", 1, [](Scene& s) { s.tree.at(s.q.data()), s.tree.articulate(), s.tree.operational_space(); }},
      {"Inertia, OperationalSpace", 1, [](Scene& s) { s.tree.articulate(), s.tree.operational_space(); }},
      {"Direction", 1, [](Scene& s) { s.tree.along(s.v.data()); }},
      {"compliance of 8 nodes", 1, [](Scene& s) { compliance(s.tree, s.nodes); }},
      {"task of 8 nodes, its torque", 1,
       [](Scene& s) {
         const OperationalSpace space(s.tree, {s.nodes, {}});
         space.torque(VectorXd::Ones(space.rows()), s.tau);
       }},
      {"participation", 1, [](Scene& s) { participation(s.tree, s.nodes.back(), u); }},
      {"hybrid dynamics, base free", 1, [](Scene& s) { hybrid_dynamics(s.base, s.tau, s.tau, s.v); }},
      {"inter-body forces", 1,
       [](Scene& s) { s.y = interbody_forces(s.tree, s.workspace, {.q = s.q.data(), .v = s.v.data(), .vdot = s.v.data()}); }},
      {"generalised Jacobian", 1,
       [](Scene& s) {
         Unactuated(s.base).generalised_jacobian({{s.nodes.back()}, {}});
       }},
      {"mass properties", 1, [](Scene& s) { mass_properties(s.tree); }},
      {"momentum matrix, centroidal", 1, [](Scene& s) { momentum_matrix(s.tree, About::mass_centre); }},
      {"reflected inertia", 1, [](Scene& s) { reflected_inertia(s.tree); }},
      {"d tau along q", 1, [](Scene& s) { s.y.resize(s.model->nv), s.sensitivities.inverse({.q = s.v.data()}, s.y.data()); }},
      {"d v' along q", 1, [](Scene& s) { s.y.resize(s.model->nv), s.sensitivities.forward({.q = s.v.data()}, s.y.data()); }},
      {"d v' along 8 q", 1,
       [](Scene& s) {
         const std::vector<Direction> along(8, {.q = s.v.data()});
         s.y.resize(8 * s.model->nv), s.sensitivities.forward(along, s.y.data());
       }},
      {"forward dynamics", 1,
       [](Scene& s) {
         s.y.resize(s.model->nv);
         s.workspace.articulated = false;  // of another q
         forward_dynamics(*s.model, s.workspace, cardan::Inputs{.q = s.q.data(), .v = s.v.data(), .tau = s.tau.data()}, s.y.data());
       }},
      {"gradient of log det M", 1, [](Scene& s) { s.y = log_det_gradient(s.tree); }},
      {"nu of v", 1, [](Scene& s) { s.y = s.diagonalised->from_velocity(s.v); }},
      {"C(q, nu)", 1, [](Scene& s) { s.y = s.diagonalised->coriolis(s.v); }},
      {"mass matrix by composites", 2, [](Scene& s) { operators::mass_matrix(s.tree); }},
      {"its explicit inverse", 2, [](Scene& s) { operators::mass_matrix_inverse(s.tree); }},
  };
}

/// Microseconds, or thousands of instructions, of a call.
using Measure = std::function<double(const std::function<void()>&)>;

int run(const Measure& measure, const char* unit, const std::string& only, int largest) {
  Registry registry;
  register_hinges(registry);
  register_bodies(registry);
  const std::vector<int> sizes = {10, 30, 100, 300, 1000, 3000};
  const std::vector<std::pair<std::string, std::function<SystemSpec(int)>>> families = {
      {"rigid chain", [](int n) { return rigid_bodies(n, false); }},
      {"rigid tree", [](int n) { return rigid_bodies(n, true); }},
      {"flexible chain, 5 modes", [](int n) { return flexible_chain(n, 5).spec; }}};
  int bad = 0;
  fmt::print("| {:30} | {:23} |", unit, "bodies");
  for (const int n : sizes) fmt::print(" {:>9} |", fmt::format("N = {}", n));
  fmt::print(" exponent from 100 on | claim |\n|---|---|");
  for (std::size_t i = 0; i < sizes.size() + 2; ++i) fmt::print("---:|");
  fmt::print("\n");
  for (const auto& [family, make] : families) {
    std::vector<std::unique_ptr<Scene>> scenes;
    for (const int n : sizes)
      if (n <= largest) scenes.push_back(std::make_unique<Scene>(compile(make(n), registry)));
    for (const Method& m : methods()) {
      if (std::string(m.name).find(only) == std::string::npos) continue;
      fmt::print("| {:30} | {:23} |", m.name, family);
      double count = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;  // least squares over the logarithms
      for (std::size_t i = 0; i < sizes.size(); ++i) {
        if (i >= scenes.size() || (m.power == 2 && 3 * sizes[i] > largest)) {
          fmt::print(" {:>9} |", "-");
          continue;
        }
        const double cost = measure([&] { m.call(*scenes[i]); });
        fmt::print(" {:>9.1f} |", cost);
        if (sizes[i] < 100) continue;
        const double x = std::log(sizes[i]), y = std::log(cost);
        count += 1, sx += x, sy += y, sxx += x * x, sxy += x * y;
      }
      if (count > 1) {
        const double exponent = (count * sxy - sx * sy) / (count * sxx - sx * sx);
        fmt::print(" {:.3f} | {} |", exponent, m.power);
        bad += m.power == 1 && exponent > 1.1;
      } else {
        fmt::print(" - | {} |", m.power);
      }
      fmt::print("\n");
      std::fflush(stdout);
    }
  }
  return bad;
}

}  // namespace
}  // namespace cardan::bench

int main(int argc, char** argv) {
  using namespace cardan::bench;
  double seconds = 0.2;
  std::string only, dumps;
  int largest = 3000;
  bool count = false;
  CommandLine line("Growth of the operator methods with the number of bodies");
  line.option("--seconds", seconds, "time for each figure");
  line.option("--count", count, "count instructions (by Valgrind) instead; exit code 77 where there is none");
  line.option("--only", only, "methods whose name contains this");
  line.option("--largest", largest, "largest number of bodies; of what grows with its square a third");
  line.option("--dumps", dumps);  // of the run inside of Valgrind
  if (const auto code = line.parse(argc, argv)) return *code;
  int bad = 0;
  if (!dumps.empty()) {
    OperationCount counted(dumps);
    bad = run([&](const std::function<void()>& call) { return 1e-3 * counted(call); }, "1000 instructions", only, largest);
  } else if (count) {
    const std::optional<int> code = run_under_callgrind(argv[0], {argv + 1, argv + argc});
    if (!code) fmt::print(stderr, "cardan-bench-operators: --count needs Valgrind (Debian: valgrind), here and where this was built\n");
    return code.value_or(77);
  } else {
    bad = run([&](const std::function<void()>& call) { return 1e-3 * time_ring(1, seconds, [&](int) { call(); }).min_ns; }, "us", only,
              largest);
  }
  if (bad > 0) fmt::print("{} exponents above 1.1\n", bad);
  return bad > 0 && !dumps.empty();  // instructions are judged; of times memory has its part, beyond what the caches hold
}
