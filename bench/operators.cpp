// cardan-bench-operators: time of each method of the operator algebra against the number of bodies, N = 10 ... 3000, and the
// exponent of its growth from 100 to 3000: what is O(N) must show 1.1 at most.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <functional>

#include "bench/bench_model.hpp"
#include "bench/time_ring.hpp"
#include "bodies/register.hpp"
#include "core/operators/apply.hpp"
#include "hinges/register.hpp"

namespace cardan::bench {
namespace {

using namespace operators;
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

struct Method {
  const char* name;
  const char* order;                                          // what the text claims
  std::function<std::function<void(int)>(TreeOperators&)> at; // prepared for a tree: one call
};

/// y = E x, with room that lives as long as the call.
template <bool Fuse = true, class E>
Method apply_of(const char* name, E e) {
  return {name, "N", [e](TreeOperators& tree) {
            const auto x = std::make_shared<VectorXd>(VectorXd::LinSpaced(tree.size(Shape<E>::cols), -1.0, 1.0));
            const auto y = std::make_shared<VectorXd>(tree.size(Shape<E>::rows));
            return [&tree, x, y, e](int) { apply<Fuse>(e, tree, x->data(), y->data()); };
          }};
}

std::vector<Method> methods() {
  return {
      apply_of("phi", phi),
      apply_of<false>("mass, by the rules", mass),
      apply_of("mass, by the sweeps", mass),
      apply_of<false>("mass inverse, by the rules", mass_inverse),
      apply_of("mass inverse, by the sweeps", mass_inverse),
      apply_of("Omega", omega),
      {"Position and all after it", "N", [](TreeOperators& tree) { return [&tree](int) { const std::vector<double> q = tree.q(); tree.at(q.data()); tree.articulate(); tree.operational_space(); }; }},
      {"Inertia (Riccati)", "N", [](TreeOperators& tree) { return [&tree](int) { tree.articulate(); tree.operational_space(); }; }},
      {"OperationalSpace", "N", [](TreeOperators& tree) { return [&tree](int) { tree.operational_space(); }; }},
      {"Direction", "N", [](TreeOperators& tree) {
         const auto u = std::make_shared<VectorXd>(VectorXd::Ones(tree.model().nv));
         return [&tree, u](int) { tree.along(u->data()); };
       }},
  };
}

int run(double seconds, const std::string& only, int largest) {
  Registry registry;
  register_hinges(registry);
  register_bodies(registry);
  const std::vector<int> sizes = {10, 30, 100, 300, 1000, 3000};
  const std::vector<std::pair<std::string, std::function<SystemSpec(int)>>> families = {
      {"rigid chain", [](int n) { return rigid_bodies(n, false); }},
      {"rigid tree", [](int n) { return rigid_bodies(n, true); }},
      {"flexible chain, 5 modes", [](int n) { return flexible_chain(n, 5).spec; }}};
  int bad = 0;
  fmt::print("{:28}{:26}", "ns per body", "N =");
  for (const int n : sizes) fmt::print("{:>9}", n);
  fmt::print("{:>10}\n", "exponent");
  for (const auto& [family, make] : families) {
    std::vector<std::shared_ptr<TreeOperators>> trees;
    for (const int n : sizes) {
      if (n > largest) break;
      const auto model = compile(make(n), registry);
      auto tree = std::make_shared<TreeOperators>(model);
      VectorXd d = VectorXd::LinSpaced(model->nv, -0.3, 0.3), q(model->nq);
      model->retract(model->initial_state().q.data(), d.data(), q.data());
      tree->at(q.data());
      tree->articulate();
      tree->operational_space();
      trees.push_back(tree);
    }
    for (const Method& m : methods()) {
      if (std::string(m.name).find(only) == std::string::npos) continue;
      fmt::print("{:28}{:26}", m.name, family);
      std::vector<double> ns;
      for (std::size_t i = 0; i < trees.size(); ++i) {
        ns.push_back(time_ring(1, seconds, m.at(*trees[i])).min_ns);
        fmt::print("{:9.1f}", ns.back() / sizes[i]);
      }
      if (trees.size() >= 4) {
        const double exponent = std::log(ns.back() / ns[2]) / std::log(static_cast<double>(sizes[trees.size() - 1]) / sizes[2]);
        fmt::print("{:10.3f}", exponent);
        bad += std::string(m.order) == "N" && exponent > 1.1;
      }
      fmt::print("\n");
    }
  }
  return bad;
}

}  // namespace
}  // namespace cardan::bench

int main(int argc, char** argv) {
  double seconds = 0.2;
  std::string only;
  int largest = 3000;
  CLI::App app{"Growth of the operator methods with the number of bodies"};
  app.add_option("--seconds", seconds, "time for each figure");
  app.add_option("--only", only, "methods whose name contains this");
  app.add_option("--largest", largest, "largest number of bodies");
  CLI11_PARSE(app, argc, argv);
  const int bad = cardan::bench::run(seconds, only, largest);
  if (bad > 0) fmt::print("{} exponents above 1.1\n", bad);
  return bad > 0;
}
