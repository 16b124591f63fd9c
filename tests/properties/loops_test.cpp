// Closed loops: published models with their exact results; a hinge that closes a loop against the same hinge in the tree; the dense twin
// with its multipliers; runs.
#include "core/dynamics/loops.hpp"

#include <Eigen/Core>
#include <random>

#include "core/dynamics/hinge_laws.hpp"
#include "core/dynamics/loop_pass.hpp"
#include "core/dynamics/observe.hpp"
#include "core/linalg/dense.hpp"
#include "core/model/embedding.hpp"
#include "core/operators/closed_system.hpp"
#include "core/operators/linear_model.hpp"
#include "core/reference/dense_dynamics.hpp"
#include "core/reference/quad.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/closed_mechanisms.hpp"
#include "tests/properties/forms_of_loops.hpp"
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
      EXPECT_EQ(rank.rank, bench.rank);
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
    const VectorXd M = symmetric_eigenvalues(mass_matrix(*tree, ws, q.data()));
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

// A body of 3 kg held by a clamp and a screw of pitch p along its weight F. The screw takes x of it and brings the moment p x with it,
// which the clamp undoes: (F - x)^2 + (p x)^2 + x^2 is least.
TEST(Loops, AScrewBesideAClampTakesItsShare) {
  const double pitch = 0.7, weight = 3.0 * 9.0;
  const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, 2) / 3.0;
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers, LoopForm::dae}) {
    BodySpec nut = rigid("nut", 3.0, Eigen::Vector3d::Zero(), diagonal({2, 3, 4}));
    nut.hinge.type = "free";
    LoopSpec clamp, screw;
    clamp.name = "clamp", clamp.type = "weld", clamp.to.body = "nut";
    screw.name = "screw", screw.type = "helical", screw.to.body = "nut";
    screw.params = along({axis}), screw.params["pitch"].value = pitch;
    SystemSpec spec = system({nut}, uniform_gravity(9.0 * axis));
    spec.loops = {clamp, screw}, spec.loop_form = form;
    const auto model = compiled(spec);
    Workspace ws(*model);
    const State at = model->initial_state();
    const Inputs in{.q = at.q.data(), .v = at.v.data()};
    VectorXd vdot(model->nv);
    ASSERT_TRUE(forward_dynamics(*model, ws, in, vdot.data()));
    settle_loops(*model, ws, in);
    const Force<double> f = loop_wrench(*model, ws, 1);
    const double share = weight / (2.0 + pitch * pitch);
    EXPECT_LE(distance(to_eigen(f.f), -share * axis), 1e-13 * weight) << static_cast<int>(form);
    EXPECT_LE(distance(to_eigen(f.n), pitch * share * axis), 1e-13 * weight) << static_cast<int>(form);
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
  for (const UserBody& u : tree.model->user) size = worse(size, u.M.m * given.spec.gravity.g.norm());  // what falls transmits its rounding
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
  TreeOptions orbiting = {.bodies = 4, .gravity = GravitySpec::Kind::central};
  std::erase(orbiting.hinges, "locked");  // a body that is locked in the tree is one with its inboard body, and so is its gravity
  for_all_trees(orbiting, 1e-11, bare, 20);
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
  return worst *
         std::min(1.0, 50.0 * loop_rank(*closed->model, closed->ws, closed->state.q.data()).distance);  // less near a singular posture
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

}  // namespace
}  // namespace cardan::test
