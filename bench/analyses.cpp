// cardan-bench-analyses: how the cost of each analysis of core/operators grows with the number of bodies, on chains of
// flexible bodies (two modes each), the worst trees for what walks to the base.
//   cardan-bench-analyses [bodies of the longest chain, 3000]
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <functional>

#include "bench/bench_model.hpp"
#include "bodies/register.hpp"
#include "core/operators/hybrid.hpp"
#include "core/operators/mass_matrix.hpp"
#include "core/operators/system_properties.hpp"
#include "hinges/register.hpp"

namespace cardan {
namespace {

using Eigen::VectorXd;
using namespace soa;

struct Case {
  TreeOperators tree, base;  // all free; the root's hinge alone
  std::vector<int> nodes;    // eight, spread over the chain
  VectorXd v, tau;
};

struct Analysis {
  const char* name;
  double claim;              // exponent
  int most;                  // bodies: what is quadratic stops there
  std::function<void(Case&)> run;
};

double seconds(const std::function<void()>& call) {
  double best = HUGE_VAL, total = 0.0;
  for (int k = 0; k < 5 || (total < 0.3 && k < 3000); ++k) {
    const auto start = std::chrono::steady_clock::now();
    call();
    const double t = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    best = std::min(best, t), total += t;
  }
  return best;
}

int run(int longest) {
  Registry registry;
  register_hinges(registry);
  register_bodies(registry);
  const Eigen::Matrix<double, 6, 1> u = Eigen::Matrix<double, 6, 1>::Ones();
  const std::vector<Analysis> analyses = {
      {"articulate", 1, 1 << 30, [](Case& c) { c.tree.articulate(); }},
      {"articulate + operational_space", 1, 1 << 30, [](Case& c) { c.tree.articulate(), c.tree.operational_space(); }},
      {"compliance of 8 nodes", 1, 1 << 30, [](Case& c) { compliance(c.tree, c.nodes); }},
      {"OperationalSpace of 8 nodes, torque", 1, 1 << 30,
       [](Case& c) {
         const OperationalSpace os(c.tree, {c.nodes, {}});
         os.torque(VectorXd::Ones(os.rows()), c.tau);
       }},
      {"task_jacobian of 1 node", 1, 1 << 30, [](Case& c) { task_jacobian(c.tree, {{c.nodes.back()}, {}}); }},
      {"participation", 1, 1 << 30, [&](Case& c) { participation(c.tree, c.nodes.back(), u); }},
      {"hybrid_dynamics, base given free", 1, 1 << 30, [](Case& c) { hybrid_dynamics(c.base, c.tau, c.tau, c.v); }},
      {"generalised_jacobian of 1 node", 1, 1 << 30, [](Case& c) { Unactuated(c.base).generalised_jacobian({{c.nodes.back()}, {}}); }},
      {"mass_times", 1, 1 << 30, [](Case& c) { mass_times(c.tree, c.v); }},
      {"mass_properties", 1, 1 << 30, [](Case& c) { mass_properties(c.tree); }},
      {"momentum_matrix, centroidal", 1, 1 << 30, [](Case& c) { momentum_matrix(c.tree, About::mass_centre); }},
      {"momentum_adjoint", 1, 1 << 30, [&](Case& c) { momentum_adjoint(c.tree, About::mass_centre, u); }},
      {"momentum_sharing", 1, 1 << 30, [](Case& c) { momentum_sharing(c.tree, c.v); }},
      {"reflected_inertia", 1, 1 << 30, [](Case& c) { reflected_inertia(c.tree); }},
      {"mass_matrix", 2, 1000, [](Case& c) { mass_matrix(c.tree); }},
      {"mass_matrix_inverse", 2, 1000, [](Case& c) { mass_matrix_inverse(c.tree); }},
  };
  std::vector<int> sizes;
  for (const int n : {10, 30, 100, 300, 1000, 3000, 10000})
    if (n <= longest) sizes.push_back(n);
  std::vector<std::vector<double>> times(analyses.size());
  for (const int n : sizes) {
    const bench::BenchModel chain = bench::flexible_chain(n, 2);
    const auto model = compile(chain.spec, registry);
    Case c{TreeOperators(model), TreeOperators(model), {}, chain.states[0].v, chain.states[0].tau};
    c.tree.at(chain.states[0].q.data()), c.base.at(chain.states[0].q.data());
    c.tree.articulate(), c.tree.operational_space();
    c.base.articulate({.free = base_mask(c.base)});
    const auto all = static_cast<int>(c.tree.nodes().size());
    for (int j = 1; j <= 8; ++j) c.nodes.push_back(c.tree.nodes()[static_cast<std::size_t>(j * all / 8 - 1)]);
    for (std::size_t a = 0; a < analyses.size(); ++a) {
      if (n > analyses[a].most) continue;
      if (a > 1 && !c.tree.has(Stage::operational_space)) c.tree.operational_space();
      times[a].push_back(seconds([&] { analyses[a].run(c); }));
    }
  }
  fmt::print("{:38}", "us at bodies =");
  for (const int n : sizes) fmt::print("{:>10}", n);
  fmt::print("  exponent from 100 on (claim)\n");
  for (std::size_t a = 0; a < analyses.size(); ++a) {
    fmt::print("{:38}", analyses[a].name);
    double count = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
    for (std::size_t k = 0; k < sizes.size(); ++k) {
      if (k >= times[a].size()) {
        fmt::print("{:>10}", "");
        continue;
      }
      fmt::print("{:10.1f}", 1e6 * times[a][k]);
      if (sizes[k] < 100) continue;
      const double x = std::log(sizes[k]), y = std::log(times[a][k]);
      count += 1, sx += x, sy += y, sxx += x * x, sxy += x * y;
    }
    fmt::print("  {:.2f} ({:.0f})\n", (count * sxy - sx * sy) / (count * sxx - sx * sx), analyses[a].claim);
  }
  return 0;
}

}  // namespace
}  // namespace cardan

int main(int argc, char** argv) { return cardan::run(argc > 1 ? std::atoi(argv[1]) : 3000); }
