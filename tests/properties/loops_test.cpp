// Closed loops: published models with their exact results; a hinge that closes a loop against the same hinge in the tree; the dense twin
// with its multipliers; runs; what does not honour loops says so.
#include "core/dynamics/loops.hpp"

#include <numbers>
#include <numeric>
#include <random>

#include "core/dynamics/batch.hpp"
#include "core/dynamics/hinge_laws.hpp"
#include "core/dynamics/loop_pass.hpp"
#include "core/dynamics/observe.hpp"
#include "core/linalg/dense.hpp"
#include "core/model/embedding.hpp"
#include "core/operators/closed_system.hpp"
#include "core/operators/linear_model.hpp"
#include "core/operators/sensitivity.hpp"
#include "core/operators/system_modes.hpp"
#include "core/reference/dense_dynamics.hpp"
#include "core/reference/quad.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/closed_mechanisms.hpp"
#include "tests/properties/loaded_simulation.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/support/bench_loops.hpp"
#include "tests/support/custom_cam.hpp"
#include "tests/support/four_bar.hpp"

namespace cardan::test {
namespace {

using reference::DenseTwin;
using reference::Quad;

double error_of(const VectorXd& got, const VectorXd& want) { return relative(distance(got, want), largest(want)); }

// ---- published models ----

class BenchLoops : public testing::TestWithParam<std::filesystem::path> {};

VectorXd multipliers(const Model& model, Workspace& ws, const Inputs& in) {
  settle_loops(model, ws, in);
  return Eigen::Map<const VectorXd>(loop_forces(ws).multipliers.data(), model.loops.rows);
}

// 1e-13, or 100 times what rounding q, v and tau to double changes.
TEST_P(BenchLoops, HaveTheirExactAccelerationsAndForces) {
  bench_loops::Model bench = bench_loops::read(GetParam());
  for (const LoopForm form : {LoopForm::multipliers, LoopForm::embedding, LoopForm::automatic, LoopForm::dae}) {
    bench.spec.loop_form = form;
    const auto model = compiled(bench.spec);
    EXPECT_EQ(model->loops.embedding != nullptr, form == LoopForm::embedding || form == LoopForm::automatic);
    EXPECT_EQ(model->loops.absolute != nullptr, form == LoopForm::dae);
    Workspace ws(*model);
    for (const bench_loops::State& s : bench.states) {
      VectorXd vdot(model->nv);
      const Inputs in{.q = s.q.data(), .v = s.v.data(), .tau = s.tau.data()};
      ASSERT_TRUE(forward_dynamics(*model, ws, in, vdot.data()));
      EXPECT_LE(error_of(vdot, s.vdot), worse(1e-13, 100.0 * s.floor));
      EXPECT_EQ(ws.loops && ws.loops->unsettled, model->loops.embedding != nullptr) << "by the program of the start";
      const VectorXd lambda = multipliers(*model, ws, in);
      const LoopRank rank = loop_rank(*model, ws, s.q.data());
      EXPECT_EQ(rank.rank, bench.json["rank"].get<int>());
      EXPECT_GT(rank.smallest, 1e-4);
      EXPECT_LT(rank.largest, 1e-15);
      EXPECT_LE(error_of(loop_matrix(*model, ws, s.q.data()).transpose() * lambda, s.force), worse(1e-13, 100.0 * s.floor));
    }
  }
}

// Rates and multipliers in the sweep, mixed; sets of loops that share hinges by rates. Up to 40 rates that are eliminated together lose
// digits, which is why `auto` does not take them so: as many as the condition of the tree's mass matrix says, 2e7 with 81 links.
TEST_P(BenchLoops, HaveTheirExactAccelerationsInAnyMixOfForms) {
  bench_loops::Model bench = bench_loops::read(GetParam());
  const auto model = compiled(bench.spec);
  bench.spec.loops.clear();
  const auto tree = compiled(bench.spec);
  const auto rounding = [&](const VectorXd& q) {
    Workspace ws(*tree);
    const VectorXd M = mass_matrix(*tree, ws, q.data()).selfadjointView<Eigen::Lower>().eigenvalues();
    return M[M.size() - 1] / M[0] * std::numeric_limits<double>::epsilon();  // in ascending order
  };
  std::mt19937_64 random(7);
  for (int mix = 0; mix < 4; ++mix) {
    std::vector<std::uint8_t> by_rates(model->loops.all.size(), 1);
    for (const LoopSet& set : model->loops.sets)
      if (set.loops.size() == 1) by_rates[static_cast<std::size_t>(set.loops[0])] = mix > 0 ? random() % 2 : 0;
    const auto mixed = embedded_by(*model, by_rates);
    Workspace ws(*mixed);
    for (const bench_loops::State& s : bench.states) {
      VectorXd vdot(model->nv);
      ASSERT_TRUE(forward_dynamics(*mixed, ws, {.q = s.q.data(), .v = s.v.data(), .tau = s.tau.data()}, vdot.data()));
      EXPECT_LE(error_of(vdot, s.vdot), worse(1e-13, rounding(s.q))) << mix;
      EXPECT_TRUE(ws.loops->unsettled) << "by the program of the start";
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Of, BenchLoops, testing::ValuesIn(bench_loops::files()),
                         [](const auto& file) { return file.param.stem().string(); });

// Dropped rows change no motion, and of all multipliers that push alike those of smallest norm are told.
TEST(Loops, MultipliersOfRedundantRowsHaveTheSmallestNorm) {
  const bench_loops::Model bench = bench_loops::read(CARDAN_SOURCE_DIR "/tests/reference/bench_loops/andrews.json");
  const auto model = compiled(bench.spec);
  Workspace ws(*model);
  for (const bench_loops::State& s : bench.states) {
    VectorXd vdot(model->nv);
    ASSERT_TRUE(forward_dynamics(*model, ws, {.q = s.q.data(), .v = s.v.data(), .tau = s.tau.data()}, vdot.data()));
    settle_loops(*model, ws, {.q = s.q.data(), .v = s.v.data(), .tau = s.tau.data()});
    VectorXd in_ground_axes(model->loops.rows);
    Observer observer(*model, ws);
    observer.update({.q = s.q.data(), .v = s.v.data(), .tau = s.tau.data()}, vdot.data());
    for (std::size_t l = 0; l < model->loops.all.size(); ++l) {
      const Loop& loop = model->loops.all[l];
      ASSERT_EQ(loop.closing, Closing::point);
      const Eigen::Matrix3d R = loop.from.node >= 0 ? observer.node(loop.from.node).R_WN : to_eigen(loop.from.pose.R);
      in_ground_axes.segment<3>(loop.first) = R * to_eigen(loop_wrench(*model, ws, static_cast<int>(l)).f);
    }
    EXPECT_LE(error_of(in_ground_axes, s.lambda), 1e-13);
  }
}

// ---- a hinge that closes is a hinge ----

/// Error of the accelerations of all nodes, and of what the hinges that were cut transmit.
double of_the_same_motion(const RandomTree& given, LoopForm form) {
  Cut both = cut(given, given.seed / 2 % 3);
  if (both.bodies.empty()) return 0.0;
  both.closed.spec.loop_form = form;
  Loaded tree(both.tree), closed(both.closed);
  const VectorXd a = tree.forward(), b = closed.forward();
  std::map<std::string, Vector6d> of_closed = closed.node_accelerations(b);
  std::erase_if(of_closed, [](const auto& node) { return node.first.starts_with("loops."); });
  double worst = apart(of_closed, tree.node_accelerations(a)), size = 0.0, difference = 0.0;
  Observer observer(*tree.model, tree.ws);
  observer.update(tree.in(), a.data());
  Observer other(*closed.model, closed.ws);
  other.update(closed.in(), b.data());
  for (std::size_t l = 0; l < both.bodies.size(); ++l) {
    const Loop& loop = closed.model->loops.all[l];
    const auto axes = [&](const LoopEnd& end) -> Eigen::Matrix3d {
      return end.node >= 0 ? other.node(end.node).R_WN : to_eigen(end.pose.R);
    };
    const Eigen::Matrix3d R = axes(loop.to).transpose() * axes(loop.from);
    const Force<double> f = loop_wrench(*closed.model, closed.ws, static_cast<int>(l)),
                        g = observer.hinge_wrench(tree.model->find_body(both.bodies[l]));
    difference = worse({difference, distance(R * to_eigen(f.n), to_eigen(g.n)), distance(R * to_eigen(f.f), to_eigen(g.f))});
    size = worse({size, largest(to_eigen(g.n)), largest(to_eigen(g.f))});
  }
  for (const double c : loop_forces(closed.ws).residual) worst = worse(worst, std::abs(c));
  return worse(worst, relative(difference, size));
}

TEST(Loops, AHingeThatClosesDoesWhatItDoesInTheTree) {
  const auto of_the_same_motion = [](const RandomTree& tree) {
    constexpr LoopForm forms[] = {LoopForm::automatic, LoopForm::multipliers, LoopForm::dae};
    return cardan::test::of_the_same_motion(tree, forms[tree.seed / 6 % 3]);
  };
  for (const double prescribed : {0.0, 0.2}) {
    for_all_trees({.flexible = 0.0, .prescribed = prescribed}, 1e-11, of_the_same_motion, 100);
    for_all_trees({.bodies = 6, .level = 2, .prescribed = prescribed, .free_modes = true}, 1e-11, of_the_same_motion, 100);
  }
  for (const std::string& type : kAllHinges) {
    if (type == "free" || type == "free_body") continue;
    for_all_trees({.bodies = 5, .roots = 1, .hinges = {type}}, 1e-11, of_the_same_motion, 20);
  }
}

/// Of a tree at its start under its loads, with what its devices do.
operators::LinearModel linear_model(const RandomTree& of, const operators::LinearPorts& ports) {
  if (of.spec.devices.empty()) {
    const Loaded at(of);
    return operators::linearize(
        *at.model,
        {.q = at.state.q.data(), .v = at.state.v.data(), .tau = at.tau.data(), .vdot = at.vdot_given.data(), .wrenches = at.wrenches},
        ports);
  }
  SimulationOptions plain;
  plain.ledger = false;
  CompileOptions loads;
  loads.world_wrenches = true;
  Simulation sim(compiled(of.spec, loads), plain);
  set_loads(sim, of);
  const std::vector<double> tau = sim.applied_forces();
  return operators::linearize(
      sim.model(),
      {.q = sim.state().q.data(), .v = sim.state().v.data(), .tau = tau.data(), .wrenches = sim.wrenches(), .devices = sim.devices()},
      ports);
}

/// Linear models of both, through what is seen of all bodies: deviations that place and move them alike accelerate them alike, and so do
/// forces.
double of_the_same_linear_model(const RandomTree& given, bool devices) {
  Cut both = cut(given, given.seed / 2 % 3);
  if (both.bodies.empty()) return 0.0;
  if (given.seed % 2) both.closed.spec.loop_form = LoopForm::multipliers;
  const auto is_cut = [&](const std::string& body) { return std::ranges::find(both.bodies, body) != both.bodies.end(); };
  operators::LinearPorts states, accelerations;
  if (devices)
    for (const DeviceSpec& d : with_devices(both.tree.spec, given.seed).devices) {
      if (const auto at = d.mounts.find("at"); d.name == "friction" && is_cut(at->second.target.substr(0, at->second.target.find('.'))))
        continue;
      both.tree.spec.devices.push_back(d), both.closed.spec.devices.push_back(d);
      if (!d.initial.empty()) states.outputs.push_back(d.name + "." + d.initial.begin()->first);
    }
  const auto n_z = static_cast<Eigen::Index>(states.outputs.size());
  const auto bare = compiled(both.tree.spec);
  for (const UserNode& n : bare->nodes) {
    for (const char* what : {":position", ":attitude", ":velocity", ":rate"}) states.outputs.push_back(n.name + what);
    for (const char* what : {":acceleration", ":specific_force"}) accelerations.outputs.push_back(n.name + what);
    for (const char* what : {":force", ":torque"}) accelerations.inputs.push_back(n.name + what);
  }
  for (const UserBody& u : bare->user) {
    if (u.nv > 0 && !is_cut(u.name)) accelerations.inputs.push_back(u.name);
    for (int j = 1; j <= u.n_modes; ++j) {
      for (const char* what : {".eta_", ".etadot_"}) states.outputs.push_back(fmt::format("{}{}{}", u.name, what, j));
      accelerations.inputs.push_back(fmt::format("{}.eta_{}", u.name, j));
    }
  }
  states.inputs = {accelerations.inputs.front()};
  const MatrixXd placed = linear_model(both.tree, states).C, placed_closed = linear_model(both.closed, states).C;
  if (placed.cols() != placed_closed.cols()) return HUGE_VAL;
  MatrixXd T(placed_closed.cols(), placed.cols());
  for (Eigen::Index j = 0; j < T.cols(); ++j) T.col(j) = least_squares(placed_closed, placed.col(j));
  const operators::LinearModel a = linear_model(both.tree, accelerations), b = linear_model(both.closed, accelerations);
  double worst = worse({apart(placed_closed * T, placed), apart(b.C * T, a.C), apart(b.D, a.D), apart(b.y0, a.y0)});
  if (n_z > 0)
    worst = worse({worst, apart(b.A.bottomRows(n_z) * T, a.A.bottomRows(n_z)), apart(b.B.bottomRows(n_z), a.B.bottomRows(n_z), 1.0)});
  return worst;
}

TEST(Loops, AHingeThatClosesHasTheLinearModelThatItHasInTheTree) {
  const auto bare = [](const RandomTree& tree) { return of_the_same_linear_model(tree, false); };
  const auto equipped = [](const RandomTree& tree) { return of_the_same_linear_model(tree, true); };
  for (const double prescribed : {0.0, 0.2}) {
    for_all_trees({.bodies = 6, .flexible = 0.0, .prescribed = prescribed}, 1e-11, bare, 20);
    for_all_trees({.bodies = 5, .level = 2, .prescribed = prescribed, .free_modes = true}, 1e-11, bare, 20);
  }
  for_all_trees({.bodies = 5}, 1e-11, equipped, 20);
  for_all_trees({.bodies = 4, .gravity = GravitySpec::Kind::central}, 1e-11, bare, 10);
  for (const std::string& type : kAllHinges) {
    if (type == "free" || type == "free_body") continue;
    for_all_trees({.bodies = 4, .roots = 1, .hinges = {type}}, 1e-11, bare, 10);
  }
}

/// M_c^-1 against differences of forward dynamics, which is linear in forces; forces for the v' of others, of all components, of
/// independent ones and of too few.
double of_forces_and_motions(const RandomTree& given) {
  Cut both = cut(given, given.seed / 2 % 3);
  if (both.bodies.empty()) return 0.0;
  if (given.seed % 2) both.closed.spec.loop_form = LoopForm::multipliers;
  Loaded at(both.closed);
  const Model& m = *at.model;
  const auto moved_by = [&](const VectorXd& tau) {
    const VectorXd kept = at.tau;
    at.tau = tau;
    hinge_laws::add_forces(m, at.state.q.data(), at.state.v.data(), at.tau.data());
    const VectorXd vdot = at.forward();
    at.tau = kept;
    return vdot;
  };
  VectorXd more(m.nv);
  for (int i = 0; i < m.nv; ++i) more[i] = m.has_prescribed() && m.prescribed[idx(i)] ? 0.0 : 3.0 * std::sin(1.7 * i + given.seed);
  const VectorXd before = moved_by(at.tau), after = moved_by(at.tau + more);
  const operators::ClosedSystem closed(at.model, at.state.q.data());
  const operators::TreeOperators& tree = closed.tree();
  double worst = apart(tree.to_model(closed.respond(tree.from_model(more))), after - before);
  std::vector<std::uint8_t> actuated(idx(m.nv), 1);
  for (const bool all : {true, false}) {
    if (!all) {
      std::ranges::fill(actuated, 0);
      for (const int v : closed.freedom().independent) actuated[idx(v)] = 1;
    }
    const auto found = operators::closed_inverse_dynamics(at.model, at.in(), after, actuated);
    worst = worse({worst, apart(moved_by(at.tau + found.tau), after), relative(largest(found.missing), largest(more))});
  }
  const auto none = operators::closed_inverse_dynamics(at.model, at.in(), after, std::vector<std::uint8_t>(idx(m.nv), 0));
  return worse(worst, apart(moved_by(at.tau + none.missing), after));
}

TEST(Loops, ForcesAndMotionsOfClosedSystemsAnswerEachOther) {
  for (const double prescribed : {0.0, 0.2}) {
    for_all_trees({.bodies = 6, .flexible = 0.0, .wheels = 0.1, .prescribed = prescribed, .springs = true}, 1e-11, of_forces_and_motions,
                  40);
    for_all_trees({.bodies = 5, .level = 2, .prescribed = prescribed, .free_modes = true}, 1e-11, of_forces_and_motions, 40);
  }
}

TEST(Loops, AHingeOfAPluginClosesALoop) {
  const auto links = [] {
    BodySpec base = on(rigid("base", 4.0, {0.1, 0, 0}, diagonal({1, 2, 3})), "", "gimbal", {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
    base.hinge.q = {0.3, -0.4, 0.2}, base.hinge.v = {0.5, 0.3, -0.7};
    BodySpec follower =
        on(rigid("follower", 1.5, {0, 0.2, 0.1}, diagonal({0.2, 0.3, 0.4})), "base", "custom_cam", {{0, 0, 1}}, {0.5, 0.1, 0});
    for (const auto& [key, value] : {std::pair("a", 0.3), std::pair("b", 0.2), std::pair("c", 1.2)})
      follower.hinge.params[key].value = value;
    follower.hinge.q = {0.4}, follower.hinge.v = {0.9};
    return system({base, follower}, uniform_gravity({0, 0, -9.81}));
  };
  const SystemSpec spec = links();
  const auto tree = compile(spec, registry_with_cam());
  Workspace ws(*tree);
  const State at = tree->initial_state();
  VectorXd a(tree->nv);
  const Inputs in{.q = at.q.data(), .v = at.v.data()};
  ASSERT_TRUE(forward_dynamics(*tree, ws, in, a.data()));
  Observer observer(*tree, ws);
  observer.update(in, a.data());
  const NodeState n = observer.node(tree->find_node("follower"));
  SystemSpec cut_spec = spec;
  HingeSpec& hinge = cut_spec.bodies[1].hinge;
  LoopSpec loop;
  loop.name = "cam", loop.type = "custom_cam", loop.params = hinge.params;
  loop.from = {"base", "", hinge.onode_position, hinge.onode_R, {}}, loop.to.body = "follower";
  cut_spec.loops = {loop};
  const Eigen::Quaterniond turn(n.R_WN);
  const Eigen::Vector3d velocity = n.R_WN * n.velocity.tail<3>();
  hinge = {};
  hinge.type = "free";
  hinge.q = {turn.w(), turn.x(), turn.y(), turn.z(), n.position.x(), n.position.y(), n.position.z()};
  hinge.v = {n.velocity[0], n.velocity[1], n.velocity[2], velocity.x(), velocity.y(), velocity.z()};
  const auto closed = compile(cut_spec, registry_with_cam());
  Workspace other(*closed);
  const State start = closed->initial_state();
  VectorXd b(closed->nv);
  ASSERT_TRUE(forward_dynamics(*closed, other, {.q = start.q.data(), .v = start.v.data()}, b.data()));
  EXPECT_LE(error_of(b.head(3), a.head(3)), 1e-12);
  settle_loops(*closed, other, {.q = start.q.data(), .v = start.v.data()});
  const Force<double> f = loop_wrench(*closed, other, 0), g = observer.hinge_wrench(1);
  Observer seen(*closed, other);
  seen.update({.q = start.q.data(), .v = start.v.data()}, b.data());
  const Eigen::Matrix3d R = n.R_WN.transpose() * seen.node(closed->find_node("base")).R_WN;
  EXPECT_LE(distance(R * to_eigen(f.f), to_eigen(g.f)), 1e-12 * largest(to_eigen(g.f)));
}

// ---- the dense twin, in 113 bits ----

/// The closed vehicle with further closures that its state fulfils, and rates that keep all of them closed. By all forms, which agree with
/// each other in their multipliers too.
double of_the_twin(const RandomTree& given, int& compared) {
  Cut both = cut(given, given.seed / 2 % 3);
  if (both.closed.spec.bodies.size() < 2) return 0.0;
  Loaded still(both.closed);
  Observer observer(*still.model, still.ws);
  still.forward();
  observer.update(still.in(), nullptr);
  SystemSpec& spec = both.closed.spec;
  const auto ground = [&](const std::string& body, double turned) {
    const NodeState n = observer.node(still.model->find_node(body));
    PlaceSpec place;
    place.position = n.position;
    place.R = Eigen::AngleAxisd(turned, Eigen::Vector3d(0.6, 0.0, 0.8)).toRotationMatrix() * n.R_WN;
    return place;
  };
  const std::string first = spec.bodies.front().name, last = spec.bodies.back().name;
  const char* types[] = {"plane", "line", "point", "distance"};
  const std::string type = types[given.seed % 4];
  LoopSpec more;
  more.name = "more", more.type = type;
  if (type == "distance") {
    more.from.body = first, more.to.body = last;
    more.length = (observer.node(still.model->find_node(first)).position - observer.node(still.model->find_node(last)).position).norm();
    if (more.length < 1e-3) return 0.0;
  } else {
    more.from = ground(last, 0.4), more.to.body = last;
  }
  spec.loops.push_back(more);
  both.closed.loads.clear();
  for (BodySpec& b : spec.bodies) std::ranges::fill(b.hinge.v, 0.0), std::ranges::fill(b.etadot, 0.0);
  State state = still.state;
  VectorXd of_embedding;
  double worst = 0.0;
  std::unique_ptr<Loaded> closed;
  reference::ClosedMotion<Quad> exact;
  std::vector<reference::VecX<Quad>> wrenches;
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers, LoopForm::dae}) {
    spec.loop_form = form;
    try {
      closed = std::make_unique<Loaded>(both.closed);
    } catch (const InputError&) {
      return 0.0;  // nothing moves the ends against each other
    }
    if ((closed->model->loops.embedding != nullptr) != (form == LoopForm::embedding)) return HUGE_VAL;
    closed->state = state;
    LoopProjection projection(*closed->model);
    if (form == LoopForm::embedding && !projection.close(state.q.data(), state.v.data())) return HUGE_VAL;
    closed->state = state;
    const VectorXd vdot = closed->forward();
    if (form == LoopForm::embedding) {
      const DenseTwin<Quad> twin(spec);
      const auto at = twin.at(state.q.cast<Quad>(), state.v.cast<Quad>());
      exact = at.closed(closed->tau.cast<Quad>());
      wrenches = at.hinge_wrenches(exact.vdot, {}, exact.lambda);
    }
    const auto in_double = [](const reference::VecX<Quad>& x) {
      VectorXd out(x.size());
      for (Eigen::Index i = 0; i < x.size(); ++i) out[i] = static_cast<double>(x[i]);
      return out;
    };
    worst = worse(worst, error_of(vdot, in_double(exact.vdot)));
    double size = 0.0, difference = 0.0;
    if (exact.rank != loop_rank(*closed->model, closed->ws, closed->state.q.data()).rank) return HUGE_VAL;
    closed->forward();
    Observer seen(*closed->model, closed->ws);
    seen.update(closed->in(), vdot.data());
    for (std::size_t k = 0; k < wrenches.size(); ++k) {
      const VectorXd want = in_double(wrenches[k]);
      size = worse(size, largest(want));
      difference = worse(difference, distance(to_eigen(seen.hinge_wrench(static_cast<int>(k))), want));
    }
    const VectorXd lambda = Eigen::Map<const VectorXd>(loop_forces(closed->ws).multipliers.data(), closed->model->loops.rows);
    if (form == LoopForm::embedding)
      of_embedding = lambda;
    else
      worst = worse(worst, error_of(of_embedding, lambda));
    worst = worse(worst, relative(difference, size));
  }
  ++compared;
  return worst;
}

/// Seeds 1 to `count`; nearly all of them are mechanisms. v', multipliers and the wrenches of all hinges: of 220, in 53 bits, no form is
/// further off than 8e-14 (`worst` of the report).
void expect_each_form_to_be_the_twin(const TreeOptions& options, int count) {
  int compared = 0;
  for_all_trees(
      options, 1e-12, [&](const RandomTree& tree) { return of_the_twin(tree, compared); }, count);
  EXPECT_GE(compared, count - 2);
}

TEST(Loops, OfRigidBodiesAreThoseOfTheDenseTwinInEachForm) {
  expect_each_form_to_be_the_twin({.bodies = 6, .flexible = 0.0, .wheels = 0.1}, 80);
}
TEST(Loops, OfBodiesThatBendAreThoseOfTheDenseTwinInEachForm) {
  expect_each_form_to_be_the_twin({.bodies = 5, .flexible = 0.5, .level = 2, .plain_masses = true}, 60);
}
TEST(Loops, OfAnyLevelAreThoseOfTheDenseTwinInEachForm) { expect_each_form_to_be_the_twin({.bodies = 6, .flexible = 0.6}, 60); }
TEST(Loops, OfManyModesAreThoseOfTheDenseTwinInEachForm) {
  expect_each_form_to_be_the_twin({.bodies = 4, .flexible = 0.7, .modes = 14, .plain_masses = true}, 10);
}

// ---- closed inside of the sweeps ----

SystemSpec bench_model(const std::string& name) {
  return bench_loops::read(CARDAN_SOURCE_DIR "/tests/reference/bench_loops/" + name + ".json").spec;
}

TEST(Loops, EmbeddedCostGrowsWithTheirNumber) {
  const auto flops = [](const SystemSpec& spec) { return static_cast<double>(compiled(spec)->loops.embedding->flops); };
  double before = flops(bench_model("fourbar_chain_4"));
  for (const char* longer : {"fourbar_chain_8", "fourbar_chain_16", "fourbar_chain_32"}) {
    const double now = flops(bench_model(longer));
    EXPECT_LT(now, 2.2 * before) << longer;
    before = now;
  }
  EXPECT_LT(flops(bench_model("lattice_16")), 5.0 * flops(bench_model("lattice_4")));  // whose ends are cheaper: 4 but for them
  before = flops(touching_four_bars(8));
  for (const int n : {16, 32, 64}) {
    const double now = flops(touching_four_bars(n));
    EXPECT_LT(now, 2.2 * before) << n;
    before = now;
    EXPECT_LE(compiled(touching_four_bars(n))->loops.embedding->width, 4);
  }
}

TEST(Loops, EmbeddedCostGrowsWithTheirNumberWhereTheyBend) {
  const auto both = [](const auto& make) {
    double before = static_cast<double>(compiled(make(8))->loops.embedding->flops);
    for (const int n : {16, 32, 64}) {
      const auto now = static_cast<double>(compiled(make(n))->loops.embedding->flops);
      EXPECT_LT(now, 2.2 * before) << n;
      before = now;
    }
  };
  both([](int n) { return bending_four_bars(n); });
  both([](int n) { return bending_tower(n); });
  EXPECT_LE(compiled(bending_tower(64))->loops.embedding->width, 4);
}

/// v', multipliers, accelerations of nodes of all forms, and v' of the twin.
double forms_apart(SystemSpec spec, const VectorXd& vdot_given = {},
                   const std::vector<LoopForm>& forms = {LoopForm::embedding, LoopForm::multipliers, LoopForm::dae}) {
  std::vector<VectorXd> vdot, lambda, nodes;
  for (const LoopForm form : forms) {
    spec.loop_form = form;
    const auto model = compiled(spec);
    EXPECT_EQ(model->loops.embedding != nullptr, form == LoopForm::embedding);
    Workspace ws(*model);
    const State at = model->initial_state();
    VectorXd out(model->nv), tau = VectorXd::LinSpaced(model->nv, -0.5, 1.5);
    const Inputs in{.q = at.q.data(), .v = at.v.data(), .tau = tau.data(), .vdot = vdot_given.size() > 0 ? vdot_given.data() : nullptr};
    EXPECT_TRUE(forward_dynamics(*model, ws, in, out.data()));
    vdot.push_back(out);
    lambda.push_back(multipliers(*model, ws, in));
    Observer seen(*model, ws);
    seen.update(in, out.data());
    VectorXd a(3 * static_cast<Eigen::Index>(model->nodes.size()));
    for (std::size_t i = 0; i < model->nodes.size(); ++i)
      a.segment<3>(3 * static_cast<Eigen::Index>(i)) = seen.node(static_cast<int>(i)).acceleration.tail<3>();
    nodes.push_back(a);
    if (vdot_given.size() > 0) continue;
    const DenseTwin<Quad> twin(spec);
    const auto exact = twin.at(at.q.cast<Quad>(), at.v.cast<Quad>()).closed(tau.cast<Quad>()).vdot;
    VectorXd want(model->nv);
    for (Eigen::Index i = 0; i < model->nv; ++i) want[i] = static_cast<double>(exact[i]);
    vdot.push_back(want);
  }
  double worst = 0.0;
  for (const VectorXd& x : lambda) worst = worse(worst, error_of(x, lambda.front()));
  for (const VectorXd& x : vdot) worst = worse(worst, error_of(x, vdot.back()));
  for (const VectorXd& x : nodes) worst = worse(worst, error_of(x, nodes.front()));
  return worst;
}

/// A platform that legs of two turns and a slide carry on a free base: on the first by a ball hinge, or (`apart`) by a free hinge on the
/// base, all others closed. Axes, places and inertias are any. The third slide stands turned on its cylinder, the fourth leg has one turn
/// more, on the last cylinder hangs an arm. `stretched`: the second leg points along its first axis, about which its end hardly moves.
/// `alike`: so many legs, none with any of this, closed by one type; of even seeds about coordinate axes.
SystemSpec platform_on_legs(std::uint64_t seed, bool apart, bool stretched, int alike = 0) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  const auto vector = [&] { return Eigen::Vector3d(number(random), number(random), number(random)); };
  const auto turned = [&] { return Eigen::AngleAxisd(number(random), vector().normalized()).toRotationMatrix(); };
  const auto heavy = [&](const std::string& name, double mass) {
    const Eigen::Matrix3d R = turned();
    return rigid(name, mass, 0.2 * vector(), R * diagonal({0.3 * mass, 0.2 * mass, 0.25 * mass}) * R.transpose());
  };
  const auto moved = [&](BodySpec body, double q) {
    body.hinge.q = {q}, body.hinge.v = {number(random)};
    return body;
  };
  BodySpec base = on(heavy("base", 40.0), "", "free");
  base.hinge.v = {0.3, -0.2, 0.1, 0, 0, 0};
  SystemSpec spec = system({base}, uniform_gravity({0.5, -0.3, -9.81}));
  const char* closings[] = {"point", "point", "point", "line", "point"};
  std::vector<LoopSpec> loops;
  for (int i = 0; i < (alike ? alike : 5); ++i) {
    const std::string leg = std::to_string(i);
    const bool along = stretched && i == 1;
    const auto axis_of = [&](const Eigen::Vector3d& axis, bool wanted) -> Eigen::Vector3d {
      return wanted || (alike && seed % 2 == 0) ? axis : vector().normalized();
    };
    spec.bodies.push_back(moved(on(heavy("cross" + leg, 0.3), "base", "revolute", {axis_of({1, 0, 0}, along)}, vector()), number(random)));
    std::string inboard = "cross" + leg;
    if (i == 3 && !alike) {
      spec.bodies.push_back(moved(on(heavy("turn", 0.2), inboard, "revolute", {vector().normalized()}), number(random)));
      inboard = "turn";
    }
    spec.bodies.push_back(
        moved(on(heavy("cylinder" + leg, 1.5), inboard, "revolute", {axis_of({0, 1, 0}, along)}), along ? 1.567 : number(random)));
    BodySpec rod = moved(on(heavy("rod" + leg, 0.8), "cylinder" + leg, "prismatic", {axis_of({0, 0, 1}, along)},
                            along ? Eigen::Vector3d(0, 0, 0.4) : vector()),
                         0.5 + 0.2 * number(random));
    if (i == 2 && !alike) rod.hinge.onode_R = turned();
    spec.bodies.push_back(rod);
    if (i == 4 && !alike)
      spec.bodies.push_back(moved(on(heavy("arm", 0.6), "cylinder4", "revolute", {vector().normalized()}, vector()), number(random)));
    if (i == 0) {
      BodySpec platform = on(heavy("platform", seed % 2 ? 20.0 : 200.0), apart ? "base" : "rod0", apart ? "free" : "ball", {}, vector());
      const Eigen::Quaterniond at(turned());
      platform.hinge.q = {at.w(), at.x(), at.y(), at.z()};
      if (apart) platform.hinge.q.insert(platform.hinge.q.end(), {0.2, -0.1, 1.0});
      spec.bodies.push_back(platform);
      if (!apart) continue;
    }
    LoopSpec loop;
    loop.name = "leg" + leg, loop.type = alike ? closings[seed % 4 / 2 + 2] : closings[i];
    loop.from.body = "rod" + leg, loop.from.position = along ? Eigen::Vector3d(0, 0, 0.3) : Eigen::Vector3d(0.3 * vector()),
    loop.from.R = turned();
    loop.to.body = "platform";
    loops.push_back(loop);
  }
  // The ends on the platform are where the legs have theirs; rates are the nearest that keep them there.
  const auto tree = compiled(spec);
  Workspace ws(*tree);
  const State at = tree->initial_state();
  VectorXd vdot(tree->nv);
  const Inputs in{.q = at.q.data(), .v = at.v.data()};
  EXPECT_TRUE(forward_dynamics(*tree, ws, in, vdot.data()));
  Observer seen(*tree, ws);
  seen.update(in, vdot.data());
  const NodeState platform = seen.node(tree->find_node("platform"));
  for (LoopSpec& loop : loops) {
    const NodeState rod = seen.node(tree->find_node(loop.from.body));
    loop.to.position = platform.R_WN.transpose() * (rod.position + rod.R_WN * loop.from.position - platform.position);
  }
  spec.loops = loops;
  for (BodySpec& body : spec.bodies) std::ranges::fill(body.hinge.v, 0.0);
  const auto closed = compiled(spec);
  State start = closed->initial_state();
  for (double& rate : start.v) rate = number(random);
  EXPECT_TRUE(LoopProjection(*closed).close(start.q.data(), start.v.data()));
  for (const UserBody& b : closed->user)
    for (BodySpec& body : spec.bodies)
      if (body.name == b.name) body.hinge.v.assign(start.v.data() + b.v, start.v.data() + b.v + b.nv);
  return spec;
}

TEST(Loops, OfLegsOfAPlatformAgreeWithTheDenseTwin) {
  int by_own = 0, more = 0, by_any = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
    for (const bool apart : {false, true})
      for (const bool stretched : {false, true}) {
        const SystemSpec spec = platform_on_legs(seed, apart, stretched);
        EXPECT_LE(forms_apart(spec), 1e-12) << seed << apart << stretched;
        const auto model = compiled(spec);
        Workspace ws(*model);
        const State at = model->initial_state();
        VectorXd vdot(model->nv);
        ASSERT_TRUE(forward_dynamics(*model, ws, {.q = at.q.data(), .v = at.v.data()}, vdot.data()));
        // The rates of a leg follow those of the platform, but where it is stretched.
        EXPECT_TRUE(ws.loops->unsettled) << "by the program of the start";
        const Embedding& e = *model->loops.embedding;
        for (std::size_t l = 0; l < e.loops.size(); ++l) {
          const EmbeddedLoop& c = e.loops[l];
          const bool named = ws.loops->embedding->named[l] != 0;
          EXPECT_TRUE(c.by_own) << c.loop;
          EXPECT_FALSE(named && stretched && spec.loops[static_cast<std::size_t>(c.loop)].name == "leg1");
          by_own += named && c.own == c.rank, more += named && c.own > c.rank, by_any += !named;
        }
      }
  EXPECT_GE(std::min({by_own, more, by_any}), 10) << by_own << " " << more << " " << by_any;
}

// Legs that are alike, each with numbers of its own. Where all loops go by rates, rows of all but the first, with which the platform is
// found, are found side by side.
TEST(Loops, RowsOfLegsThatAreAlikeAreFoundSideBySide) {
  std::map<int, int> found;
  for (int legs = 2; legs <= 7; ++legs)
    for (std::uint64_t seed = 1; seed <= 8; ++seed)
      for (const bool apart : {false, true}) {
        const SystemSpec spec = platform_on_legs(seed, apart, false, legs + !apart);
        const auto model = compiled(spec);
        const Embedding& e = *model->loops.embedding;
        int aside = 0;
        for (const AlikeRows& rows : e.alike_rows)
          if (!rows.half) ++found[rows.n], aside += rows.n;
        if (seed % 2 == 0 && std::ranges::all_of(e.loops, &EmbeddedLoop::by_rates)) {
          EXPECT_EQ(aside, (legs - 1) / 2 * 2) << legs << " " << seed << apart;
        }
        EXPECT_LE(forms_apart(spec), 1e-12) << legs << " " << seed << apart;
      }
  EXPECT_GE(found[2], 5);
  EXPECT_GE(found[4], 5);
}

TEST(Loops, OfLinksThatBendAgreeWithTheDenseTwin) {
  EXPECT_LE(forms_apart(bending_four_bars(4)), 1e-12);
  EXPECT_LE(forms_apart(bending_four_bars(4, true)), 1e-12);
  EXPECT_LE(forms_apart(bending_tower(4)), 1e-12);
}

// Two loops of which the second adds one row where the first has taken two: a platform on three cranks, one of which bends out of the plane
// only.
SystemSpec platform_on_three_cranks(bool straight) {
  SystemSpec spec = touching_four_bars(2, 0.9, 0.7);
  std::erase_if(spec.bodies, [](const BodySpec& b) { return b.name == "rod1"; });
  spec.loops[1].from.body = "rod0", spec.loops[1].from.position = {2, 0, 0};
  if (straight) return spec;
  BodySpec& crank = spec.bodies[0];
  std::vector<MassNode> masses(3);
  for (int i = 0; i < 3; ++i) {
    MassNode& n = masses[static_cast<std::size_t>(i)];
    n.mass = 0.5, n.position = {0.4 * i, 0.1 * i, 0.0};
    n.Phi = Eigen::Vector3d(0, 0, n.position.x());
  }
  BodySpec b;
  b.name = crank.name, b.type = "modal_flexible", b.level = 1, b.hinge = crank.hinge, b.eta = {0.0}, b.etadot = {0.0};
  const ModalNode tip{"tip", {1, 0, 0}, Eigen::Matrix3d::Identity(), Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0, -0.5, 0)};
  b.modal = std::make_shared<const ModalData>(lumped_modal_data(masses, Eigen::MatrixXd::Constant(1, 1, 20.0), {}, {tip}));
  crank = b;
  for (BodySpec& rod : spec.bodies)
    if (rod.name == "rod0") rod.hinge.inboard_node = "tip", rod.hinge.onode_position.setZero();
  return spec;
}

TEST(Loops, RowsThatFollowFromThoseOfOtherLoopsAreLeftOutWithModesOnTheWay) {
  const auto bends = compiled(platform_on_three_cranks(false));
  ASSERT_TRUE(bends->loops.embedding);
  EXPECT_TRUE(bends->loops.embedding->chosen);
  EXPECT_EQ(bends->loops.rank, 3);
  EXPECT_LE(forms_apart(platform_on_three_cranks(false)), 1e-12);
  EXPECT_LE(forms_apart(platform_on_three_cranks(true)), 1e-12);
}

TEST(Loops, EmbeddedTakeGivenMotionsOnTheirWay) {
  for (const int which : {0, 1, 2}) {
    SystemSpec rigid_bars = touching_four_bars(3, 0.9, 0.4), bends = bending_four_bars(3);
    for (SystemSpec* spec : {&rigid_bars, &bends}) {
      spec->bodies[static_cast<std::size_t>(which)].hinge.prescribed = {0};
      VectorXd given = VectorXd::Zero(compiled(*spec)->nv);
      const auto model = compiled(*spec);
      given[model->user[idx(model->find_body(spec->bodies[static_cast<std::size_t>(which)].name))].v] = 0.7;
      EXPECT_LE(forms_apart(*spec, given), 1e-12) << which;
    }
  }
}

// A wheel that something hangs on is none: a loop that ends on its rim takes it as a body.
TEST(Loops, MayEndOnAWheel) {
  SystemSpec spec = four_bar();
  for (BodySpec& b : spec.bodies)
    if (b.name == "rocker") b.com = {0, 0, 0.03}, b.inertia_com = diagonal({0.02, 0.02, 0.03});
  const auto model = compiled(spec);
  EXPECT_TRUE(model->rotors.empty());
  EXPECT_TRUE(model->loops.embedding);
  EXPECT_LE(forms_apart(spec), 1e-12);
  SystemSpec open = spec;
  open.loops.clear();
  EXPECT_EQ(compiled(open)->rotors.size(), 1U);
}

// Three legs of equal length hold a plate as five do: the rows of two are implied, and the program of the start goes on without them.
TEST(Loops, EmbeddedTakeLoopsOfWhichNoRowCounts) {
  BodySpec plate = on(rigid("plate", 3.0, {0, 0, 0}, diagonal({0.3, 0.4, 0.6})), "", "free");
  plate.hinge.q = {1, 0, 0, 0, 0.3, 0.1, 0.0};
  plate.hinge.v = {0, 0, 0, 0.2, -0.6, 0};
  SystemSpec spec = system({plate}, uniform_gravity({0, 0, -9.81}));
  for (const Eigen::Vector2d& at : {Eigen::Vector2d(0.5, 0), Eigen::Vector2d(-0.3, 0.4), Eigen::Vector2d(-0.3, -0.4),
                                    Eigen::Vector2d(0.1, 0.6), Eigen::Vector2d(0.2, -0.5)}) {
    LoopSpec leg;
    leg.name = "leg" + std::to_string(spec.loops.size()), leg.type = "distance", leg.length = 2.0;
    leg.from.position = {at.x(), at.y(), std::sqrt(4.0 - 0.1)};
    leg.to.body = "plate", leg.to.position = {at.x(), at.y(), 0.0};
    spec.loops.push_back(leg);
  }
  const auto model = compiled(spec);
  ASSERT_TRUE(model->loops.embedding);
  EXPECT_EQ(model->loops.rank, 3);
  const auto by_multipliers = embedded_by(*model, std::vector<std::uint8_t>(spec.loops.size(), 0));
  for (const auto& m : {model, by_multipliers}) {
    Workspace ws(*m);
    const State at = m->initial_state();
    VectorXd vdot(m->nv);
    ASSERT_TRUE(forward_dynamics(*m, ws, {.q = at.q.data(), .v = at.v.data()}, vdot.data()));
    EXPECT_TRUE(ws.loops->unsettled) << "by the program of the start";
  }
  EXPECT_LE(forms_apart(spec), 1e-12);
}

/// All forms agree, at the nearest closed states too, where the couplings `first` and `second` are to be something.
void expect_forms_to_agree_where_driven(const SystemSpec& spec, std::size_t first, std::size_t second) {
  EXPECT_LE(forms_apart(spec), 1e-12);
  std::vector<VectorXd> moved;
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers}) {
    SystemSpec driven = spec;
    driven.loops[first].prescribed = driven.loops[second].prescribed = true, driven.loop_form = form;
    const auto m = compiled(driven);
    State open = m->initial_state();
    for (Eigen::Index i = 0; i < open.v.size(); ++i) open.v[i] += 0.01 * std::sin(3.0 * static_cast<double>(i));
    const LoopDrive drives[] = {{.more = 0.01, .rate = 0.3, .acceleration = 1.7}, {.more = -0.02, .rate = 0.1, .acceleration = -0.4}};
    LoopProjection projection(*m);
    ASSERT_TRUE(projection.close(open.q.data(), open.v.data(), drives));
    Workspace ws(*m);
    VectorXd out(m->nv);
    ASSERT_TRUE(forward_dynamics(*m, ws, {.q = open.q.data(), .v = open.v.data(), .drives = drives}, out.data()));
    VectorXd both(open.q.size() + open.v.size() + out.size());
    both << open.q, open.v, out;
    moved.push_back(both);
  }
  EXPECT_LE(error_of(moved[0], moved[1]), 1e-12);
}

/// A free base, arms on it whose hinges turn wheels on the inboard bodies, one way or the other, faster or slower or as fast. `bevel`: the
/// axis of one wheel is across that of its hinge. `cable`: two hinges of the arm are coupled, and one between them is not.
SystemSpec geared_arms(std::uint64_t seed, int arms, bool bevel = false, bool cable = false) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  const auto vector = [&] { return Eigen::Vector3d(number(random), number(random), number(random)); };
  BodySpec base = on(rigid("base", 10.0, {0.1, 0, 0}, diagonal({2, 3, 4})), "", "free");
  base.hinge.v = {0.3, -0.2, 0.1, 0, 0, 0};
  SystemSpec spec = system({base}, uniform_gravity({0.5, -0.3, -9.81}));
  std::vector<Eigen::Vector3d> axes;
  for (int i = 0; i < 3; ++i) {
    axes.push_back(vector().normalized());
    if (seed % 3 == 0) axes[static_cast<std::size_t>(i)] = Eigen::Vector3d::Unit((i + static_cast<int>(seed)) % 3);
  }
  axes.emplace_back(0, 1, 0);
  for (int j = 0; j < arms; ++j) {
    const std::string of_arm = j == 0 ? "" : " of arm " + std::to_string(j);
    std::string inboard = "base";
    for (int i = 0; i < 4; ++i) {
      const std::string link = "link" + std::to_string(i) + of_arm, wheel = "wheel" + std::to_string(i) + of_arm;
      const Eigen::Vector3d& axis = axes[static_cast<std::size_t>(i)];
      const double ratio = i == 2 && seed % 4 == 0 ? 1.0 : 6.0 * number(random) + (seed % 2 ? 8.0 : -8.0);
      const double sense = number(random) > 0.0 ? 1.0 : -1.0;
      BodySpec arm = on(rigid(link, 2.0 + number(random), vector(), diagonal({0.4, 0.5, 0.6})), inboard, "revolute", {axis}, vector());
      const bool across = bevel && i == 2;
      const Eigen::Vector3d along_wheel = across ? Eigen::Vector3d(axis.unitOrthogonal()) : Eigen::Vector3d(sense * axis);
      const double Ja = 0.02 + 0.01 * number(random), across_it = 0.6 * Ja;
      const Eigen::Matrix3d J = across_it * Eigen::Matrix3d::Identity() + (Ja - across_it) * along_wheel * along_wheel.transpose();
      BodySpec turns = on(rigid(wheel, 0.5, Eigen::Vector3d::Zero(), J), inboard, "revolute", {along_wheel}, vector());
      arm.hinge.q = {number(random)}, arm.hinge.v = {number(random)};
      if (cable && i == 2) arm.hinge.q = {0.5 * spec.bodies[1].hinge.q[0]}, arm.hinge.v = {0.5 * spec.bodies[1].hinge.v[0]};
      turns.hinge.q = {ratio * arm.hinge.q[0]}, turns.hinge.v = {ratio * arm.hinge.v[0]};
      LoopSpec gear;
      gear.name = "gear" + std::to_string(i) + of_arm, gear.type = "coupling";
      gear.terms = {{link, -2.0 * ratio, {}}, {wheel, 2.0, {}}};
      if (i % 2) std::swap(gear.terms[0], gear.terms[1]), std::swap(arm, turns);
      spec.bodies.push_back(arm), spec.bodies.push_back(turns);
      spec.loops.push_back(gear);
      inboard = link;
    }
  }
  if (cable) {
    LoopSpec tie;
    tie.name = "cable", tie.type = "coupling";
    tie.terms = {{"link0", 0.5, {}}, {"link2", -1.0, {}}};
    spec.loops.push_back(tie);
  }
  return spec;
}

TEST(Loops, AWheelGearedToAHingeBesideItIsMoreInertiaOfThatHinge) {
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    const SystemSpec spec = geared_arms(seed, 1);
    const auto model = compiled(spec);
    ASSERT_EQ(model->rotors.size(), 4U);
    EXPECT_EQ(model->loops.embedding->gears.size(), 4U);
    EXPECT_EQ(model->loops.embedding->width, 0);
    EXPECT_LE(forms_apart(spec), 1e-12) << seed;
  }
  // Across its hinge a wheel is a body of a loop; so is one whose hinge coordinates of another loop cross.
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    EXPECT_EQ(compiled(geared_arms(seed, 1, true))->loops.embedding->gears.size(), 3U);
    EXPECT_LE(forms_apart(geared_arms(seed, 1, true)), 1e-12) << seed;
    EXPECT_LT(compiled(geared_arms(seed, 1, false, true))->loops.embedding->gears.size(), 3U);
    EXPECT_LE(forms_apart(geared_arms(seed, 1, false, true)), 1e-12) << seed;
  }
}

// Arms that are alike: their hinges of one level go side by side, four, two and one at a time.
TEST(Loops, GearsThatAreAlikeGoSideBySide) {
  for (const auto& [arms, sides] : std::map<int, std::vector<int>>{{2, {2}}, {3, {2, 1}}, {4, {4}}, {7, {4, 2, 1}}})
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
      SCOPED_TRACE(seed);
      const SystemSpec spec = geared_arms(seed, arms);
      const auto model = compiled(spec);
      std::vector<int> found;
      for (const AlikeGears& gears : model->loops.embedding->alike_gears)
        if (!gears.half) found.push_back(gears.n);
      std::vector<int> wanted;
      for (int level = 0; level < 4; ++level) wanted.insert(wanted.end(), sides.begin(), sides.end());
      if (seed % 3 == 0)
        EXPECT_EQ(found, wanted);
      else  // axes in any direction: kernels of one level differ by how the bodies beyond stand
        EXPECT_EQ(std::accumulate(found.begin(), found.end(), 0), 4 * arms);
      expect_forms_to_agree_where_driven(spec, 1, 4 * static_cast<std::size_t>(arms) - 3);
    }
}

/// What arms with wheels are made of, from numbers drawn one after the other.
struct ArmBuilder {
  std::mt19937_64 random;
  std::uniform_real_distribution<double> number{-1.0, 1.0};
  SystemSpec spec = system({}, uniform_gravity({0.5, -0.3, -9.81}));
  std::string base;

  ArmBuilder(std::uint64_t seed, bool on_ground) : random(seed) {
    if (on_ground) return;
    BodySpec body = on(rigid("base", 10.0, {0.1, 0, 0}, diagonal({2, 3, 4})), "", "free");
    body.hinge.v = {0.3, -0.2, 0.1, 0, 0, 0};
    spec.bodies.push_back(body);
    base = "base";
  }
  Eigen::Vector3d vector() { return {number(random), number(random), number(random)}; }
  void wheel(const std::string& name, const std::string& carrier) {
    const Eigen::Vector3d u = vector().normalized();
    const double Ja = 0.02 + 0.01 * number(random), across = 0.6 * Ja;
    spec.bodies.push_back(
        on(rigid(name, 0.5, Eigen::Vector3d::Zero(), across * Eigen::Matrix3d::Identity() + (Ja - across) * u * u.transpose()), carrier,
           "revolute", {u}, vector()));
  }
  void link(const std::string& name, const std::string& inboard) {
    BodySpec link =
        on(rigid(name, 2.0 + number(random), vector(), diagonal({0.4, 0.5, 0.6})), inboard, "revolute", {vector().normalized()}, vector());
    link.hinge.q = {number(random)}, link.hinge.v = {number(random)};
    spec.bodies.push_back(link);
  }
  LoopSpec& couple(const std::string& name, std::vector<LoopSpec::Term> terms) {
    LoopSpec loop;
    loop.name = name, loop.type = "coupling", loop.terms = std::move(terms);
    spec.loops.push_back(loop);
    return spec.loops.back();
  }
};

/// Chains of a few links whose hinges turn three wheels that stand inboard of them: one by a belt to its first and last hinge, two by a
/// differential with sines, of which some have one argument. Bodies hang on its first and last link.
SystemSpec geared_chains(std::uint64_t seed, int chains, int hinges, bool on_ground) {
  ArmBuilder arm(seed, on_ground);
  const auto number = [&] { return arm.number(arm.random); };
  for (int chain = 0; chain < chains; ++chain) {
    const std::string of = chain == 0 ? "" : " of chain " + std::to_string(chain);
    const auto link = [&](int i) { return "link" + std::to_string(i) + of; };
    const std::string first = link(0), last = link(hinges - 1), left = "left" + of, right = "right" + of;
    arm.wheel("belt" + of, arm.base), arm.wheel(left, arm.base), arm.wheel(right, arm.base);
    for (int i = 0; i < hinges; ++i) arm.link(link(i), i == 0 ? arm.base : link(i - 1));
    arm.link("side" + of, first), arm.link("tool" + of, last);
    std::vector<LoopSpec::Term> belt{{"belt" + of, 0.5, {}}, {first, 2.0 + number(), {}}};
    if (hinges > 1) belt.push_back({last, -1.5 + 0.5 * number(), {}});
    arm.couple("of belt" + of, belt);
    arm.couple("sum" + of, {{left, 0.5, {}}, {right, 0.5, {}}, {last, -2.0 + number(), {}}});
    LoopSpec& difference = arm.couple("difference" + of, {{left, 0.4, {}}, {right, -0.5, {}}});
    for (int i = 0; i < 9; ++i) {
      LoopSpec::Function f;
      f.kind = i % 3 ? "sine" : "cosine", f.numbers = {0.1 * number()}, f.phase = number();
      const double turned = i % 2 ? -0.7 : 0.7;
      if (i < 4)
        f.of = {{last, 1.3 * turned, {}}, {left, turned, {}}};
      else
        f.of = {{last, number(), {}}, {i % 2 && hinges > 1 ? first : left, number(), {}}};
      difference.functions.push_back(f);
    }
  }
  return arm.spec;
}

/// An arm of four links whose hinges turn wheels that stand further inboard: a gear beside the first hinge; a belt to the third that leaves
/// out the second; one wheel across its hinge; and a differential of two wheels on the second link, a sum and a function of sines and a
/// square.
SystemSpec belted_arm(std::uint64_t seed, bool on_ground) {
  ArmBuilder arm(seed, on_ground);
  const auto number = [&](std::mt19937_64& random) { return arm.number(random); };
  std::mt19937_64& random = arm.random;
  arm.wheel("gear", arm.base), arm.wheel("belt", arm.base);
  for (int i = 0; i < 4; ++i) arm.link("link" + std::to_string(i), i == 0 ? arm.base : "link" + std::to_string(i - 1));
  arm.wheel("bevel", "link0"), arm.wheel("left", "link1"), arm.wheel("right", "link1");
  arm.couple("of gear", {{"link0", 4.0 + number(random), {}}, {"gear", -1.0, {}}});
  arm.couple("of belt", {{"belt", 0.5, {}}, {"link0", 2.0 + number(random), {}}, {"link2", -1.5, {}}});
  arm.couple("of bevel", {{"link1", -3.0 + number(random), {}}, {"bevel", 1.0, {}}});
  arm.couple("sum", {{"left", 0.5, {}}, {"right", 0.5, {}}, {"link2", -2.0 + number(random), {}}});
  LoopSpec& difference = arm.couple("difference", {{"left", 0.4, {}}, {"right", -0.5, {}}});
  for (int i = 0; i < 10; ++i) {
    LoopSpec::Function f;
    f.kind = i % 3 ? "sine" : "cosine", f.numbers = {0.1 * number(random)}, f.phase = number(random);
    f.of = {{"link3", 1.0 + number(random), {}}, {i % 2 ? "link2" : "left", number(random), {}}};
    difference.functions.push_back(f);
  }
  LoopSpec::Function square;
  square.kind = "polynomial", square.numbers = {0.1, 0.9, 0.3}, square.of = {{"link3", 1.0, {}}};
  difference.functions.push_back(square);
  return arm.spec;
}

TEST(Loops, WheelsMayTurnWithHingesFurtherOut) {
  for (const bool on_ground : {false, true})
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      SCOPED_TRACE(seed);
      const SystemSpec spec = belted_arm(seed, on_ground);
      const auto model = compiled(spec);
      EXPECT_EQ(model->loops.embedding->transmissions.size(), 4U);
      EXPECT_EQ(model->loops.embedding->wheels.size(), 5U);
      EXPECT_EQ(model->loops.embedding->geared.size(), 4U);
      EXPECT_TRUE(model->loops.embedding->loops.empty());
      expect_forms_to_agree_where_driven(spec, 1, 4);
    }
}

TEST(Loops, WheelsOfOneCarrierMayTurnWithAFewHinges) {
  for (const bool on_ground : {false, true})
    for (const int hinges : {1, 2, 3})
      for (std::uint64_t seed = 1; seed <= 12; ++seed) {
        SCOPED_TRACE(seed);
        const SystemSpec spec = geared_chains(seed, 1, hinges, on_ground);
        const auto model = compiled(spec);
        const Embedding& e = *model->loops.embedding;
        EXPECT_EQ(e.transmissions.size(), 2U);
        ASSERT_EQ(e.chains.size(), 1U);
        EXPECT_EQ(std::ssize(e.chains[0].hinges), hinges);
        EXPECT_TRUE(e.loops.empty() && e.geared.empty());
        expect_forms_to_agree_where_driven(spec, 0, 2);
      }
}
TEST(Loops, ChainsWithWheelsThatAreAlikeGoSideBySide) {
  for (const bool on_ground : {false, true})
    for (const int hinges : {1, 2, 3})
      for (const auto& [chains, sides] : std::map<int, std::vector<int>>{{2, {2}}, {4, {4}}, {7, {4, 2, 1}}})
        for (std::uint64_t seed = 1; seed <= 4; ++seed) {
          SCOPED_TRACE(seed);
          const SystemSpec spec = geared_chains(seed, chains, hinges, on_ground);
          const auto model = compiled(spec);
          std::vector<int> found;
          for (const AlikeChains& side : model->loops.embedding->alike_chains)
            if (!side.half) found.push_back(side.n);
          EXPECT_EQ(found, sides);
          expect_forms_to_agree_where_driven(spec, 3, 5);
        }
}

// A crank turns a slide by a sine: near its dead centre the crank does not follow the slide, and the slide follows the crank.
TEST(Loops, AWheelMayPassADeadCentreOfItsHinge) {
  for (const double angle : {0.3, 1.3, 1.5707, 1.58, 2.0}) {
    BodySpec base = on(rigid("base", 5.0, {0.1, 0, 0}, diagonal({2, 3, 4})), "", "revolute", {{0, 0, 1}});
    base.hinge.q = {0.2}, base.hinge.v = {0.4};
    BodySpec arm = on(rigid("arm", 2.0, {0.5, 0.1, 0}, diagonal({0.1, 0.2, 0.3})), "base", "revolute", {{0, 1, 0}});
    BodySpec crank = on(rigid("crank", 0.5, {0, 0, 0}, diagonal({0.05, 0.05, 0.1})), "base", "revolute", {{0, 0, 1}}, {0.3, 0, 0});
    SystemSpec spec = system({base, arm, crank}, uniform_gravity({0.5, -0.3, -9.81}));
    LoopSpec loop;
    loop.name = "crank and arm", loop.type = "coupling", loop.terms = {{"arm", 1.0, {}}};
    LoopSpec::Function sine;
    sine.kind = "sine", sine.numbers = {-0.8}, sine.of = {{"crank", 1.0, {}}};
    loop.functions = {sine};
    spec.loops = {loop};
    spec.bodies[2].hinge.q = {0.3};  // where wheels follow
    spec.bodies[2].hinge.v = {2.0};
    spec.bodies[1].hinge.q = {0.8 * std::sin(0.3)};
    std::vector<VectorXd> vdot;
    for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers}) {
      spec.loop_form = form;
      const auto model = compiled(spec);
      EXPECT_TRUE(form == LoopForm::multipliers || model->loops.embedding->wheels.size() == 1);
      VectorXd q(3), v(3), out(3);
      for (const UserBody& b : model->user) {
        q[b.q] = b.name == "base" ? 0.2 : b.name == "arm" ? 0.8 * std::sin(angle) : angle;
        v[b.v] = b.name == "base" ? 0.4 : b.name == "arm" ? 1.6 * std::cos(angle) : 2.0;
      }
      Workspace ws(*model);
      ASSERT_TRUE(forward_dynamics(*model, ws, {.q = q.data(), .v = v.data()}, out.data()));
      vdot.push_back(out);
    }
    EXPECT_LE(error_of(vdot[0], vdot[1]), 1e-12) << angle;
  }
}

// sin a = sin b holds nothing where both are upright: the ratio of a wheel and its hinge is 1 all the way there.
TEST(Loops, AWheelTellsOfASingularPostureAsOtherLoopsDo) {
  BodySpec base = on(rigid("base", 5.0, {0.1, 0, 0}, diagonal({2, 3, 4})), "", "revolute", {{0, 0, 1}});
  BodySpec arm = on(rigid("arm", 2.0, {0.0, 0.1, 0}, diagonal({0.1, 0.2, 0.3})), "base", "revolute", {{0, 1, 0}});
  BodySpec crank = on(rigid("crank", 0.5, {0, 0, 0}, diagonal({0.05, 0.05, 0.1})), "base", "revolute", {{0, 0, 1}}, {0.3, 0, 0});
  arm.hinge.q = crank.hinge.q = {1.2}, arm.hinge.v = crank.hinge.v = {0.5};
  SystemSpec spec = system({base, arm, crank});
  LoopSpec loop;
  loop.name = "both", loop.type = "coupling";
  LoopSpec::Function sine;
  sine.kind = "sine", sine.numbers = {1.0}, sine.of = {{"arm", 1.0, {}}};
  loop.functions.push_back(sine);
  sine.numbers = {-1.0}, sine.of = {{"crank", 1.0, {}}};
  loop.functions.push_back(sine);
  spec.loops = {loop};
  for (const LoopForm form : {LoopForm::multipliers, LoopForm::embedding}) {
    spec.loop_form = form;
    SimulationOptions steps;  // which end near it: one step over it sees nothing
    steps.integrator.method = "rk4", steps.integrator.fixed_step = 1e-3;
    Simulation sim(compiled(spec), steps);
    EXPECT_TRUE(form == LoopForm::multipliers || !sim.model().loops.embedding->transmissions.empty());
    sim.run(1.0);
    ASSERT_EQ(sim.warnings().all().size(), 1u) << static_cast<int>(form) << render(sim.warnings());
    EXPECT_EQ(sim.warnings().all()[0].what.code, Code::near_singular);
    EXPECT_NEAR(sim.state().q[1], sim.state().q[2], 1e-7) << "in its own branch";
  }
}

TEST(Loops, AGearMayBeDriven) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SystemSpec spec = geared_arms(seed, 1);
    spec.loops[1].prescribed = true;
    std::vector<VectorXd> vdot, lambda, moved;
    for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers}) {
      spec.loop_form = form;
      const auto model = compiled(spec);
      Workspace ws(*model);
      const State at = model->initial_state();
      const LoopDrive drive{.more = 0.0, .rate = 0.0, .acceleration = 1.7};
      VectorXd out(model->nv), tau = VectorXd::LinSpaced(model->nv, -0.5, 1.5);
      const Inputs in{.q = at.q.data(), .v = at.v.data(), .tau = tau.data(), .drives = &drive};
      ASSERT_TRUE(forward_dynamics(*model, ws, in, out.data()));
      vdot.push_back(out), lambda.push_back(multipliers(*model, ws, in));
      const VectorXd missing = loop_matrix(*model, ws, at.q.data()) * out;
      EXPECT_NEAR(missing[1], 1.7, 1e-12);
      // The nearest closed state in the metric of the mass matrix.
      State open = at;
      for (Eigen::Index i = 0; i < open.v.size(); ++i) open.v[i] += 0.01 * std::sin(3.0 * static_cast<double>(i));
      for (const UserBody& b : model->user)
        if (b.nq == 1) open.q[b.q] += 0.01 * std::cos(5.0 * b.q);
      LoopProjection projection(*model);
      ASSERT_TRUE(projection.close(open.q.data(), open.v.data(), &drive));
      VectorXd both(open.q.size() + open.v.size());
      both << open.q, open.v;
      moved.push_back(both);
    }
    EXPECT_LE(error_of(vdot[0], vdot[1]), 1e-12) << seed;
    EXPECT_LE(error_of(lambda[0], lambda[1]), 1e-12) << seed;
    EXPECT_LE(error_of(moved[0], moved[1]), 1e-12) << seed;
  }
}

// What bends elsewhere, or where a loop has its home, does not take its rates from it.
TEST(Loops, BodiesThatBendElsewhereLeaveThemTheirForm) {
  SystemSpec spec = bench_model("fourbar_chain_4");
  const auto plain = compiled(spec);
  BodySpec wing = on(bending("wing"), spec.bodies.front().name, "revolute", {{0, 1, 0}});
  wing.hinge.q = {0.3};
  spec.bodies.push_back(wing);
  BodySpec mast = on(bending("mast"), "", "ball");
  for (BodySpec& b : spec.bodies)
    if (b.hinge.inboard_body.empty()) b.hinge.inboard_body = "mast";  // on its frame, which no mode moves
  for (LoopSpec& loop : spec.loops)
    for (PlaceSpec* place : {&loop.from, &loop.to})
      if (place->body.empty()) place->body = "mast";
  spec.bodies.insert(spec.bodies.begin(), mast);
  const auto model = compiled(spec);
  ASSERT_EQ(model->loops.sets.size(), plain->loops.sets.size());
  for (std::size_t i = 0; i < model->loops.sets.size(); ++i) EXPECT_EQ(model->loops.sets[i].form, plain->loops.sets[i].form);
  EXPECT_TRUE(model->loops.embedding->factored.empty());
  EXPECT_LE(forms_apart(spec), 1e-12);
}

// The order in which bodies are described, parents after their children too, changes neither errors nor the count.
TEST(Loops, EmbeddedBodiesMayStandInAnyOrder) {
  std::mt19937 random(3);
  for (const char* name :
       {"four_bar", "andrews", "bricard", "hexapod_free", "mini_cheetah", "fourbar_chain_8", "lattice_4", "n_fourbar_40"}) {
    const bench_loops::Model bench = bench_loops::read(std::string(CARDAN_SOURCE_DIR "/tests/reference/bench_loops/") + name + ".json");
    const auto plain = compiled(bench.spec);
    for (int shuffle = 0; shuffle < 3; ++shuffle) {
      SystemSpec spec = bench.spec;
      std::ranges::shuffle(spec.bodies, random);
      std::ranges::shuffle(spec.loops, random);
      const auto model = compiled(spec);
      EXPECT_EQ(model->loops.embedding->width, plain->loops.embedding->width) << name;
      Workspace ws(*model);
      for (const bench_loops::State& s : bench.states) {
        VectorXd q(model->nq), v(model->nv), tau(model->nv), vdot(model->nv), found(model->nv);
        const auto each = [&](const auto& take) {
          for (const UserBody& u : plain->user) take(u, model->user[idx(model->find_body(u.name))]);
        };
        each([&](const UserBody& a, const UserBody& b) {
          q.segment(b.q, b.nq) = s.q.segment(a.q, a.nq);
          v.segment(b.v, b.nv) = s.v.segment(a.v, a.nv), tau.segment(b.v, b.nv) = s.tau.segment(a.v, a.nv);
        });
        ASSERT_TRUE(forward_dynamics(*model, ws, {.q = q.data(), .v = v.data(), .tau = tau.data()}, vdot.data()));
        each([&](const UserBody& a, const UserBody& b) { found.segment(a.v, a.nv) = vdot.segment(b.v, b.nv); });
        EXPECT_LE(error_of(found, s.vdot), worse(1e-13, 100.0 * s.floor)) << name;
      }
    }
  }
}

// Parallelogram, nearly flat: rows that are weak, not dependent. Below 1e-10 the row is left out by both forms.
TEST(Loops, EmbeddedNearASingularPostureLosesNoMoreThanThePosture) {
  for (const double e : {1e-1, 1e-3, 1e-5, 1e-7}) {
    SystemSpec spec = touching_four_bars(1, e, 0.7);
    const auto model = compiled(spec);
    ASSERT_TRUE(model->loops.embedding);
    Workspace ws(*model);
    const State at = model->initial_state();
    VectorXd vdot(model->nv), tau(model->nv);
    tau << 0.3, -0.2, 0.5;
    ASSERT_TRUE(forward_dynamics(*model, ws, {.q = at.q.data(), .v = at.v.data(), .tau = tau.data()}, vdot.data()));
    const DenseTwin<Quad> twin(spec);
    const auto exact = twin.at(at.q.cast<Quad>(), at.v.cast<Quad>()).closed(tau.cast<Quad>()).vdot;
    VectorXd want(model->nv);
    for (Eigen::Index i = 0; i < model->nv; ++i) want[i] = static_cast<double>(exact[i]);
    EXPECT_LE(error_of(vdot, want), 1e-14 / e) << e;
    // By multipliers in the sweep, whose compliance has the square of what is weak; as long as that leaves more than 1e-3 of it.
    const auto by_multipliers = embedded_by(*model, {0});
    Workspace other(*by_multipliers);
    ASSERT_TRUE(forward_dynamics(*by_multipliers, other, {.q = at.q.data(), .v = at.v.data(), .tau = tau.data()}, vdot.data()));
    EXPECT_LE(error_of(vdot, want), worse(1e-14 / e, 1e-11)) << e;
  }
}

TEST(Loops, RunsOfBothFormsAreTheSameMotion) {
  // Upright cranks, which do not fall as far as their flat posture: it is singular, and what comes after it is a matter of rounding.
  for (const SystemSpec& given :
       {four_bar("point"), touching_four_bars(5, 1.2), bench_model("fourbar_chain_4"), bench_model("mini_cheetah")}) {
    std::vector<VectorXd> q;
    for (const LoopForm form : {LoopForm::multipliers, LoopForm::embedding}) {
      SystemSpec spec = given;
      spec.loop_form = form;
      SimulationOptions options;
      options.integrator.relative_tolerance = 1e-11;
      Simulation sim(compiled(spec), options);
      sim.run(0.5);
      q.push_back(sim.state().q);
      if (given.bodies[0].name == "crank0") {
        EXPECT_GT(sim.state().q[0], 0.1);
      }
      for (const double c : sim.loop_forces().residual) EXPECT_LE(std::abs(c), 1e-13) << given.name;
      EXPECT_TRUE(sim.ledger().pass) << given.name << render(sim.warnings());
    }
    EXPECT_LE(error_of(q[1], q[0]), 1e-8) << given.name;
  }
}

// ---- runs ----

TEST(Loops, RunKeepsThemClosedAndEnergyHonest) {
  for (const std::string method : {"dopri5", "dop853", "cvode_adams", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit"}) {
    SimulationOptions options;
    options.integrator.method = method;
    options.integrator.relative_tolerance = 1e-10;
    Simulation sim(compiled(four_bar()), options);
    const double before = sim.energy().total();
    double open = 0.0;
    sim.every({1, 10}, [&] {
      for (const double c : sim.loop_forces().residual) open = worse(open, std::abs(c));
      for (const double c : sim.loop_forces().rate) open = worse(open, std::abs(c));
    });
    sim.run(20.0);
    EXPECT_LE(open, 1e-13) << method;
    EXPECT_LE(std::abs(sim.energy().total() - before), 1e-6) << method;
    EXPECT_TRUE(sim.ledger().pass) << method << render(sim.warnings());
  }
}

TEST(Loops, OfLinksThatBendKeepTheirEnergy) {
  for (const SystemSpec& given : {bending_four_bars(2), bending_tower(2)}) {
    std::vector<VectorXd> q;
    for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers}) {
      SystemSpec spec = given;
      spec.loop_form = form;
      SimulationOptions options;
      options.integrator.relative_tolerance = 1e-11;
      Simulation sim(compiled(spec), options);
      const double before = sim.energy().total();
      sim.run(0.1);
      EXPECT_LE(std::abs(sim.energy().total() - before), 1e-8 * std::abs(before));
      for (const double c : sim.loop_forces().residual) EXPECT_LE(std::abs(c), 1e-13);
      EXPECT_TRUE(sim.ledger().pass) << render(sim.warnings());
      q.push_back(sim.state().q);
    }
    EXPECT_LE(error_of(q[1], q[0]), 1e-8);
  }
}

// A point mass on a ball turns about the line to it without inertia, so nothing of the open tree tells its v'. Where loops do, they are
// closed by rates, however many are free.
TEST(Loops, MoveWhatHasNoInertiaInTheOpenTree) {
  BodySpec a = on(rigid("a", 3.0, {0.3, 0.1, 0.05}, diagonal({1, 2, 2.5})), "", "ball");
  a.hinge.v = {0.3, -0.2, 0.5};
  const BodySpec p = on(particle("p", 2.0, {0.3, 0.1, 0.05}), "a", "ball", {}, {0.3, 0.2, 0.1});
  BodySpec b = on(rigid("b", 1.0, {0.1, 0.1, 0.05}, diagonal({1, 2, 2.5})), "a", "free");
  for (const char* closing : {"point", "line", "universal", "revolute"}) {
    SystemSpec spec = system({a, p, b}, uniform_gravity({0.3, -0.4, -9.81}));
    LoopSpec loop;
    loop.name = "loop", loop.type = closing;
    if (loop.type == "universal") loop.params = test::along({{1, 0.2, 0}, {0, 1, 0.3}});
    if (loop.type == "revolute") loop.params = test::along({{0, 1, 1}});
    loop.from.body = "p", loop.from.position = {0.1, 0.2, 0.3}, loop.to.body = "b", loop.to.position = {0.4, 0.4, 0.4};
    spec.loops = {loop};
    EXPECT_EQ(compiled(spec)->loops.sets[0].form, "rates") << closing;
    spec.loop_form = LoopForm::multipliers;
    const auto model = compiled(spec);
    EXPECT_LE(forms_apart(spec, {}, {LoopForm::embedding, LoopForm::dae}), 1e-12) << closing;
    Workspace ws(*model);
    const State at = model->initial_state();
    VectorXd vdot(model->nv);
    ASSERT_FALSE(forward_dynamics(*model, ws, {.q = at.q.data(), .v = at.v.data()}, vdot.data())) << closing;
    const RunFailure failure = describe_breakdown(*model, ws.breakdown, 0.0);
    EXPECT_EQ(failure.code, Code::singular_hinge);
    EXPECT_NE(failure.hint.find("loop_form: auto"), std::string::npos) << failure.hint;
  }
}

// What a hinge that turns about one axis lets through: five wrenches of length one, at right angles to each other and to the axis.
TEST(Loops, RowsOfATurningHingeAreAcrossItsAxis) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> number;
  for (int i = 0; i < 60; ++i) {
    Vec3<double> a{i % 7 == 1 ? 0.0 : number(random), i % 5 == 1 ? 0.0 : number(random), number(random)};
    if (i % 4 == 0) a = i % 3 == 0 ? Vec3<double>{0, 1, 0} : i % 3 == 1 ? Vec3<double>{1, 1, 0} : Vec3<double>{1, -1, 1};
    a = (1.0 / std::sqrt(dot(a, a))) * a;
    Force<double> W[5], again[5];
    soa::rows_across(a, W);
    soa::rows_across({a.x + 1e-15 * number(random), a.y + 1e-15 * number(random), a.z + 1e-15 * number(random)}, again);
    for (int r = 0; r < 5; ++r) {
      EXPECT_NEAR(dot(W[r].n, a), 0.0, 4e-16);
      const Vec3<double> d = again[r].n - W[r].n;
      EXPECT_LE(std::sqrt(dot(d, d)), 1e-13);
      for (int s = 0; s < 5; ++s) EXPECT_NEAR(dot(W[r].n, W[s].n) + dot(W[r].f, W[s].f), r == s, 1e-15);
    }
  }
}

// The same mechanism cut elsewhere and closed by other rows moves alike.
TEST(Loops, ClosedByAPointByALineAndByAHingeMoveAlike) {
  std::vector<double> crank;
  for (const char* closing : {"point", "line", "revolute"}) {
    SimulationOptions options;
    options.integrator.relative_tolerance = 1e-11;
    Simulation sim(compiled(four_bar(closing)), options);
    sim.run(5.0);
    crank.push_back(sim.state().q[0]);
  }
  EXPECT_NEAR(crank[1], crank[0], 1e-8);
  EXPECT_NEAR(crank[2], crank[0], 1e-8);
}

// ---- what does not honour them says so, before it does anything ----

TEST(Loops, AreRefusedByNameWhereTheyAreNotHonoured) {
  const auto model = compiled(four_bar());
  const VectorXd q = model->initial_state().q, v = model->initial_state().v;
  Workspace ws(*model);
  VectorXd out(model->nv);
  const auto refused = [](const std::string& what, const auto& work) {
    try {
      work();
      ADD_FAILURE() << what << " took a vehicle with loops";
    } catch (const InputError& e) {
      EXPECT_EQ(e.diagnostics().front().code, Code::unsupported) << what;
      EXPECT_EQ(e.diagnostics().front().got, "loops: pivot") << what;
      EXPECT_NE(e.diagnostics().front().expected.find("an open tree: " + what), std::string::npos) << e.what();
    }
  };
  const Inputs in{.q = q.data(), .v = v.data()};
  refused("spatial operators", [&] { operators::TreeOperators tree(model); });
  refused("sensitivities", [&] { operators::Sensitivities s(model); });
  refused("batches of states", [&] { Batch batch(*model); });
  refused("inverse dynamics", [&] { inverse_dynamics(*model, ws, in, out.data()); });
  refused("mass matrices", [&] { mass_matrix(*model, ws, q.data()); });
  refused("inverse mass matrices", [&] { mass_matrix_inverse(*model, ws, q.data(), MatrixXd(3, 3).data()); });
  SimulationOptions krylov;
  krylov.integrator.method = "cvode_bdf", krylov.integrator.linear_solver = "krylov";
  refused("Newton's equations by linear_solver krylov", [&] { Simulation(model, krylov).run(0.1); });
}

template <class Work>
std::string told(const Work& work) {
  try {
    work();
  } catch (const std::exception& e) {
    return e.what();
  }
  return "nothing";
}

TEST(Loops, AnOpenStartIsToldRowByRow) {
  SystemSpec open = four_bar();
  open.loops[0].from.position = {0.5, 0.01, 0};
  EXPECT_EQ(
      told([&] { compiled(open); }),
      "error[C1103]: a loop is not closed at the start\n"
      "  at: loops.pivot\n"
      "  expected: initial coordinates that close it\n"
      "  got:      pivot: row 2, along y -0.01 m\n"
      "  hint:     give `initial` of the hinges between its ends the values that bring them together, or none: they are found then\n\n"
      "1 error. Nothing was run.\n");
  SystemSpec moving = four_bar();
  moving.bodies[0].hinge.v = {2.5};
  EXPECT_EQ(told([&] { compiled(moving); }),
            "error[C1103]: a loop is not closed at the start\n"
            "  at: loops.pivot\n"
            "  expected: initial rates that keep it closed\n"
            "  got:      pivot: row 2, along y 0.25 m/s\n"
            "  hint:     give `initial` of the hinges rates that move both ends alike, or none: they are found then\n\n"
            "1 error. Nothing was run.\n");
}

// A parallelogram loses a row where its links are in line: there pivots and singular values go to zero with the angle.
TEST(Loops, NearASingularPostureIsTold) {
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers}) {
    const auto at = [&](double angle, double rate) {
      SystemSpec spec = touching_four_bars(1, angle, rate);
      spec.gravity = {};
      spec.loop_form = form;
      return compiled(spec);
    };
    const auto distance_at = [&](double angle) {
      const auto model = at(angle, 0.0);
      Workspace ws(*model);
      return loop_rank(*model, ws, model->initial_state().q.data()).distance;
    };
    EXPECT_NEAR(distance_at(1e-3) / distance_at(1e-4), 10.0, 1e-3);
    EXPECT_GT(distance_at(0.6), 0.05);
    Simulation good(at(0.6, -0.04), {}), near(at(3e-3, -0.1), {});
    good.run(0.02), near.run(0.028);  // to 2e-4
    EXPECT_TRUE(good.warnings().all().empty()) << render(good.warnings());
    near.run(0.029);
    ASSERT_EQ(near.warnings().all().size(), 1u) << render(near.warnings());
    const Diagnostic& d = near.warnings().all()[0].what;
    EXPECT_EQ(d.code, Code::near_singular);
    EXPECT_EQ(d.at.key_path, "loops.pin0");
  }
}

/// A scissor of n bays in the plane, stretched by a slide in which its second bar stands: bars a and b of 1 m are pinned at their middles
/// and at their ends to those of the next bay. In line all of its loops lose a row at once.
SystemSpec scissor(int n, double angle, LoopForm form) {
  std::vector<BodySpec> bodies{on(rigid("slide", 0.2, {0, 0, 0}, diagonal({0.01, 0.01, 0.01})), "", "prismatic", {{0, 1, 0}})};
  bodies[0].hinge.q = {std::sin(angle)};
  SpringDamper spring;
  spring.stiffness = 30.0, spring.damping = 2.0, spring.rest = 0.1;
  bodies[0].hinge.springs = {spring};
  SystemSpec spec;
  for (int i = 0; i < n; ++i) {
    const auto bar = [&](const std::string& name, const std::string& inboard, double mass, double turn) {
      BodySpec b = on(rigid(fmt::format("{}{}", name, i), mass, {0.5, 0, 0}, diagonal({0.001, 0.1, 0.1})), inboard, "revolute", {{0, 0, 1}},
                      {i > 0 ? 1.0 : 0.0, 0, 0});
      b.hinge.q = {turn};
      bodies.push_back(b);
    };
    bar("a", i > 0 ? fmt::format("b{}", i - 1) : "", 1.03 + 0.1 * i, i > 0 ? 2.0 * angle : angle);
    bar("b", i > 0 ? fmt::format("a{}", i - 1) : "slide", 0.97 + 0.1 * i, i > 0 ? -2.0 * angle : -angle);
    LoopSpec pin;
    pin.name = fmt::format("pin{}", i), pin.type = "revolute", pin.params = test::along({{0, 0, 1}});
    pin.from.body = fmt::format("a{}", i), pin.to.body = fmt::format("b{}", i);
    pin.from.position = pin.to.position = {0.5, 0, 0};
    spec.loops.push_back(pin);
  }
  const std::vector<LoopSpec> loops = spec.loops;
  spec = system(bodies, {});
  spec.loops = loops;
  spec.loop_form = form;
  return spec;
}

/// The angle of its bars by the equation of its one degree of freedom, one bay: (d/dt)(J w) = 1/2 J' w^2 + tau, J = 2 I + (m_a + m_b) / 4 +
/// m_s cos^2.
double scissor_angle(double angle, double t_end) {
  double w = 0.0;
  const auto slope = [](double x, double rate) {
    const double c = std::cos(x), J = 0.2 + 2.0 * 0.25 + 0.2 * c * c, dJ = -0.4 * c * std::sin(x);
    return (-(30.0 * (std::sin(x) - 0.1) + 2.0 * c * rate) * c - 0.5 * dJ * rate * rate) / J;
  };
  const int n = 20000;
  const double h = t_end / n;
  for (int i = 0; i < n; ++i) {
    const double k1 = w, l1 = slope(angle, w), k2 = w + 0.5 * h * l1, l2 = slope(angle + 0.5 * h * k1, k2), k3 = w + 0.5 * h * l2,
                 l3 = slope(angle + 0.5 * h * k2, k3), k4 = w + h * l3, l4 = slope(angle + h * k3, k4);
    angle += h / 6.0 * (k1 + 2 * k2 + 2 * k3 + k4), w += h / 6.0 * (l1 + 2 * l2 + 2 * l3 + l4);
  }
  return angle;
}

// Steps whose errors are tested end ever nearer to the posture in line, down to where rounding alone tells its branches apart: there the
// bars went on turning as one, 1.5e-8 rad from it. In the branch of the motion it bends to both sides and comes to rest beside the rest of
// its spring.
TEST(Loops, GoOnInTheirOwnBranchPastPosturesInLine) {
  const double start = 25.0 * std::numbers::pi / 180.0;
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers})
    for (const auto& [method, relative, near] : {std::tuple{"dopri5", 1e-9, 1e-8},
                                                 {"dop853", 1e-9, 1e-8},
                                                 {"dop853", 1e-12, 2e-11},
                                                 {"cvode_adams", 1e-10, 1e-8},
                                                 {"rk4", 1e-9, 1e-7}})
      for (const int n : {1, 2, 3}) {
        SimulationOptions options;
        options.integrator.method = method, options.integrator.relative_tolerance = relative;
        if (options.integrator.method == "rk4") options.integrator.fixed_step = 0.005;
        Simulation sim(compiled(scissor(n, start, form)), options);
        const auto at = [&](const char* body, int i) {
          return sim.state().q[sim.model().user[idx(sim.model().find_body(fmt::format("{}{}", body, i)))].q];
        };
        const std::string of = fmt::format("{} at {:g}, {} bays, form {}", method, relative, n, static_cast<int>(form));
        double least = start;
        for (int k = 1; k <= 40; ++k) {
          sim.run(0.1 * k);
          // Adams' history is off the loops of many bays by some thousand tolerances there, and that may be told.
          EXPECT_TRUE(sim.ledger().pass || (n > 1 && options.integrator.method == "cvode_adams")) << of;
          const double angle = at("a", 0);
          least = std::min(least, angle);
          ASSERT_NEAR(at("b", 0), -angle, near) << of;
          for (int i = 1; i < n; ++i)
            ASSERT_TRUE(std::abs(at("a", i) - 2 * angle) <= near && std::abs(at("b", i) + 2 * angle) <= near) << of;
          if (n == 1 && k % 10 == 0) {
            EXPECT_NEAR(angle, scissor_angle(start, 0.1 * k), near) << of;
          }
        }
        EXPECT_LT(least, -0.05) << of;
        ASSERT_FALSE(sim.warnings().all().empty()) << of;
        EXPECT_EQ(sim.warnings().all()[0].what.code, Code::near_singular) << render(sim.warnings());
      }
}

TEST(Loops, ThatContradictGivenMotionEndTheRun) {
  SystemSpec spec = four_bar("point", 0.0);
  spec.bodies[0].hinge.prescribed = {0};
  spec.bodies[1].hinge.prescribed = {0};
  Simulation sim(compiled(spec), {});
  for (const int i : {0, 1}) sim.prescribe(i, MotionProfile::sine(0.1, 0.7, 0.0));
  EXPECT_THROW(sim.run(1.0), NumericsError);
  SystemSpec one = four_bar("point", 0.0);
  one.bodies[0].hinge.prescribed = {0};
  Simulation good(compiled(one), {});
  good.prescribe(0, MotionProfile::sine(0.5, 0.7, 0.0));
  good.run(5.0);
  for (const double c : good.loop_forces().residual) EXPECT_LE(std::abs(c), 1e-14);
  EXPECT_TRUE(good.ledger().pass) << render(good.warnings());
}

TEST(Loops, AStateThatIsFarFromThemIsNotTaken) {
  Simulation sim(compiled(four_bar()), {});
  sim.q(0) += 0.1;
  EXPECT_EQ(told([&] { sim.run(1.0); }),
            "failure[N0601]: a loop cannot be kept closed\n"
            "  t = 0 s   body: pivot\n"
            "  row 2 of loop pivot: residual 0.0927, limit 1e-06\n"
            "  hint:     it contradicts other loops or given motions, or its ends are out of reach of each other; see docs/errors.md\n");
}

/// Crank, coupler and rocker of a parallelogram, at this angle of the crank.
SystemSpec parallelogram(double angle) {
  const auto link = [](const char* name, double length, double q, const char* inboard, const Vector3d& at) {
    BodySpec b = on(rigid(name, 1.0, {0.5 * length, 0, 0}, diagonal({0.01, 0.1, 0.1})), inboard, "revolute", {{0, 0, 1}}, at);
    b.hinge.q = {q};
    return b;
  };
  SystemSpec spec = system({link("crank", 1.0, angle, "", {0, 0, 0}), link("coupler", 2.0, -angle, "crank", {1, 0, 0}),
                            link("rocker", 1.0, angle + std::numbers::pi, "coupler", {2, 0, 0})},
                           uniform_gravity({0, -9.81, 0}));
  LoopSpec pin;
  pin.name = "pin", pin.type = "point";
  pin.from.position = {2, 0, 0}, pin.to.body = "rocker", pin.to.position = {1, 0, 0};
  spec.loops = {pin};
  return spec;
}

// Turned by half a turn about itself the rocker has the axis of its pin the other way round: moments across it are nothing there, as on
// closed loops, and its ends meet.
TEST(Loops, AHingeTurnedByHalfATurnIsNotClosed) {
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers, LoopForm::dae}) {
    SystemSpec spec = parallelogram(0.6);
    spec.loop_form = form;
    HingeSpec& hinge = spec.bodies[2].hinge;
    hinge.type = "universal", hinge.params = test::along({{0, 0, 1}, {1, 0, 0}}), hinge.q = {0.6 + std::numbers::pi, 0.0};
    LoopSpec& pin = spec.loops[0];
    pin.type = "revolute", pin.params = test::along({{0, 0, 1}});
    for (const double turn : {0.0, std::numbers::pi, std::numbers::pi - 1e-9, -std::numbers::pi}) {
      SimulationOptions options;
      if (form == LoopForm::dae) options.integrator.method = "ida", options.integrator.relative_tolerance = 1e-7;
      Simulation sim(compiled(spec), options);
      sim.q(3) = turn;
      const std::string why = told([&] { sim.run(0.1); });
      EXPECT_EQ(why.starts_with("failure[N0601]"), turn != 0.0) << turn << ": " << why;
    }
  }
}

/// In line after 0.5 s, at rates that nothing changes.
SystemSpec turning_parallelogram(LoopForm form) {
  SystemSpec spec = parallelogram(-0.5);
  spec.gravity = {};
  spec.loop_form = form;
  for (std::size_t i = 0; i < 3; ++i) spec.bodies[i].hinge.v = {i == 1 ? -1.0 : 1.0};
  return spec;
}

// The state at which it failed is none that was accepted; what is told of it is what leads there, and no contradiction.
TEST(Loops, AFailureAtASingularPostureTellsWhereItIs) {
  SimulationOptions options;
  options.integrator.method = "dopri5", options.integrator.relative_tolerance = 1e-8;
  Simulation sim(compiled(turning_parallelogram(LoopForm::multipliers)), options);
  sim.every({1, 3}, [] {});
  sim.add_event({"in line", [](double, const double* q, const double*) { return q[0]; }, 0, [] {}});
  const std::string why = told([&] { sim.run(1.0); });
  for (const char* part : {"failure[N0601]: a loop cannot be kept closed\n  t = 0.333333 s   body: pin\n  row 1 of loop pin: residual ",
                           ", at a singular posture: a scaled pivot of ", " at t = 0.5 s, crank.angle = ", ", coupler.angle = ",
                           ", rocker.angle = 3.14159 rad\n", "  hint:     a row of the loops holds nothing there, and a step ended there"})
    EXPECT_NE(why.find(part), std::string::npos) << part << "\n" << why;
}

// No plugin is blamed where there is none.
TEST(Loops, ABalanceThatASingularPostureOpensIsToldAsThat) {
  SimulationOptions options;
  options.integrator.method = "dopri5", options.integrator.relative_tolerance = 1e-8;
  Simulation sim(compiled(turning_parallelogram(LoopForm::embedding)), options);
  sim.every({1, 2}, [&] { sim.ledger(); });
  sim.run(0.49);
  sim.run(0.6);
  for (const int i : {0, 1, 2}) sim.v(i) *= 1.001;
  sim.run(0.7);
  sim.ledger();
  const std::string warnings = render(sim.warnings());
  EXPECT_NE(warnings.find("W0402"), std::string::npos) << warnings;
  EXPECT_NE(warnings.find("closed loops came near a singular posture (a scaled pivot of "), std::string::npos) << warnings;
  EXPECT_EQ(warnings.find("plugin"), std::string::npos) << warnings;
}

// Flat it may go on as a parallelogram or crossed: two motions to first order, of which no mixture goes on.
TEST(Loops, WhatIsLinearIsRefusedAtASingularPosture) {
  for (const LoopForm form : {LoopForm::automatic, LoopForm::multipliers}) {
    for (const double angle : {0.0, 1e-3}) {
      SystemSpec spec = parallelogram(angle);
      spec.loop_form = form;
      const auto model = compiled(spec);
      const State s = model->initial_state();
      const auto linear = [&] { operators::linearize(*model, {.q = s.q.data(), .v = s.v.data()}); };
      const auto inverse = [&] { operators::ClosedSystem(model, s.q.data()); };
      if (angle != 0.0) {
        EXPECT_NO_THROW(linear());
        EXPECT_NO_THROW(inverse());
        continue;
      }
      const std::string why = told(inverse);
      EXPECT_NE(why.find("failure[N0601]: a loop cannot be kept closed\n  t = 0 s   body: pin\n  row 1 of loop pin: residual "),
                std::string::npos)
          << why;
      EXPECT_NE(why.find("  hint:     a singular posture: loops leave motions free that cannot all go on. Ask beside it\n"),
                std::string::npos)
          << why;
      EXPECT_EQ(told(linear), why);
    }
  }
}

// What is common to both ends is in no row: an orbit costs no digits.
TEST(Loops, CostNoDigitsAtOrbitalSpeed) {
  const auto vdot_of = [](double far) {
    SystemSpec spec = four_bar();
    BodySpec bus = on(rigid("bus", 50.0, {0.1, 0.2, 0}, diagonal({5, 6, 7})), "", "free");
    bus.hinge.q = {1, 0, 0, 0, far * 7e6, 0, 0}, bus.hinge.v = {0.3, -0.2, 0.1, 0, far * 7.5e3, 0};
    spec.bodies.insert(spec.bodies.begin(), bus);
    spec.bodies[1].hinge.inboard_body = "bus";
    spec.loops[0].from.body = "bus";
    spec.gravity = {};
    const auto model = compiled(spec);
    Workspace ws(*model);
    const State at = model->initial_state();
    VectorXd vdot(model->nv);
    EXPECT_TRUE(forward_dynamics(*model, ws, {.q = at.q.data(), .v = at.v.data()}, vdot.data()));
    return vdot;
  };
  EXPECT_LE(error_of(vdot_of(1.0), vdot_of(0.0)), 1e-15);
}

}  // namespace
}  // namespace cardan::test
