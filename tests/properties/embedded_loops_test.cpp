// Loops closed inside of the sweeps: their cost, legs, links that bend, rows that do not count, near singular postures.
#include "core/dynamics/loops.hpp"

#include <numeric>
#include <random>

#include "core/dynamics/loop_pass.hpp"
#include "core/dynamics/observe.hpp"
#include "core/model/embedding.hpp"
#include "core/reference/dense_dynamics.hpp"
#include "core/reference/quad.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/closed_mechanisms.hpp"
#include "tests/properties/forms_of_loops.hpp"
#include "tests/support/bench_loops.hpp"
#include "tests/support/four_bar.hpp"

namespace cardan::test {
namespace {

using reference::DenseTwin;
using reference::Quad;

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

/// A platform that legs of two turns and a slide carry on a free base: on the first by a ball hinge, or (`apart`) by a free hinge on the
/// base, all others closed. Axes, places and inertias are any. The third slide stands turned on its cylinder, the fourth leg has one turn
/// more, on the last cylinder hangs an arm. `stretched`: the second leg points along its first axis, about which its end hardly moves.
/// `alike`: so many legs, none with any of this, closed by one type; of even seeds about coordinate axes.
SystemSpec platform_on_legs(std::uint64_t seed, bool apart, bool stretched, int alike = 0) {
  std::mt19937_64 random(seed - 1 + first_seed());
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

constexpr double kLegs = 1e-11;  // postures are any: ten times what those below may

TEST(Loops, OfLegsOfAPlatformAgreeWithTheDenseTwin) {
  int by_own = 0, more = 0, by_any = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
    for (const bool apart : {false, true})
      for (const bool stretched : {false, true}) {
        const SystemSpec spec = platform_on_legs(seed, apart, stretched);
        EXPECT_LE(forms_apart(spec), kLegs) << seed << apart << stretched;
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
  EXPECT_GE(std::min({by_own, more, by_any}), 3) << by_own << " " << more << " " << by_any;
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
        EXPECT_LE(forms_apart(spec), kLegs) << legs << " " << seed << apart;
      }
  EXPECT_GE(found[2], 5);
  EXPECT_GE(found[4], 5);
}

TEST(Loops, OfLinksThatBendAgreeWithTheDenseTwin) {
  EXPECT_LE(forms_apart(bending_four_bars(4)), 1e-12);
  EXPECT_LE(forms_apart(bending_four_bars(4, true)), 1e-12);
  EXPECT_LE(forms_apart(bending_tower(4)), 1e-12);
}

// Entries are looked through as if all were, one row after the other: of alike ones, as of loops that are alike, the first counts.
TEST(Loops, RowsThatCountAreThoseOfCompletePivoting) {
  for (const SystemSpec& spec : {touching_four_bars(5, 0.9, 0.4), touching_four_bars(3, 0.0, 0.0), bending_four_bars(3, true),
                                 bending_tower(3), platform_on_legs(2, true, true), platform_on_legs(4, false, false, 5)}) {
    const auto model = compiled(spec);
    Workspace ws(*model);
    const LoopRank rank = loop_rank(*model, ws, model->initial_state().q.data());
    const LoopWork& work = *ws.loops;
    const Inputs none{};
    const LoopPass pass(*model, ws, none);
    const auto n = static_cast<Eigen::Index>(work.columns.size());
    Eigen::MatrixXd A(model->loops.rows, n);
    for (int i = 0; i < model->loops.rows; ++i)
      for (Eigen::Index j = 0; j < n; ++j) {
        const int v = work.columns[idx(static_cast<int>(j))];
        const Loop& loop = pass.loop_of(i);
        A(i, j) = work.G[idx(i * model->nv + v)] * pass.in_metres(loop, i) * model->loops.column_scale[idx(v)] / loop.reference;
      }
    std::vector<int> rows(idx(model->loops.rows)), columns(idx(static_cast<int>(n)));
    std::iota(rows.begin(), rows.end(), 0), std::iota(columns.begin(), columns.end(), 0);
    for (int p = 0; p < rank.rank; ++p) {
      std::size_t row = idx(p), column = idx(p);
      for (std::size_t i = idx(p); i < rows.size(); ++i)
        for (std::size_t j = idx(p); j < columns.size(); ++j)
          if (std::abs(A(rows[i], columns[j])) > std::abs(A(rows[row], columns[column]))) row = i, column = j;
      std::swap(rows[idx(p)], rows[row]), std::swap(columns[idx(p)], columns[column]);
      for (std::size_t i = idx(p) + 1; i < rows.size(); ++i) {
        const double factor = A(rows[i], columns[idx(p)]) / A(rows[idx(p)], columns[idx(p)]);
        for (std::size_t j = idx(p) + 1; j < columns.size(); ++j) A(rows[i], columns[j]) -= factor * A(rows[idx(p)], columns[j]);
      }
    }
    EXPECT_EQ(work.row_at, rows);
    EXPECT_EQ(work.column_at, columns);
    EXPECT_EQ(rank.smallest, std::abs(A(rows[idx(rank.rank - 1)], columns[idx(rank.rank - 1)])));
  }
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

/// Two chains of `links` on a bus that turns on the ground, heavy and light, whose tips meet; the light one is held to the ground too, by
/// the last link but one. Its rates are the better pivots of the first loop, which hands on how they move.
SystemSpec tied_chains(int links) {
  std::mt19937_64 random(first_seed());
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  const auto vector = [&] { return Eigen::Vector3d(number(random), number(random), number(random)); };
  SystemSpec spec = system({on(rigid("bus", 5.0, {0, 0, 0}, diagonal({1, 2, 2.5})), "", "revolute", {vector().normalized()})},
                           uniform_gravity({0.5, -0.3, -9.81}));
  std::vector<Eigen::Vector3d> tips;
  LoopSpec meet, hold;
  meet.name = "meet", meet.type = "point", meet.from.body = "heavy", meet.to.body = "light";
  hold.name = "hold", hold.type = "point", hold.from.body = "light";
  for (const auto& [name, mass] : {std::pair("heavy", 100.0), std::pair("light", 0.1)}) {
    std::string inboard = "bus";
    Eigen::Vector3d at = Eigen::Vector3d::Zero();
    for (int i = 0; i < links; ++i) {
      const std::string link = i + 1 == links ? name : name + std::to_string(i);
      const Eigen::Vector3d to = vector();
      spec.bodies.push_back(on(rigid(link, mass, 0.2 * vector(), diagonal({0.3 * mass, 0.2 * mass, 0.25 * mass})), inboard, "revolute",
                               {vector().normalized()}, to));
      inboard = link, at += to;
      if (i + 2 == links) hold.from.body = link, hold.to.position = at;
    }
    tips.push_back(at);
  }
  meet.to.position = tips[0] - tips[1];
  spec.loops = {meet, hold};
  return spec;
}

TEST(Loops, OfManyFreeRatesHandOnWhatLaterOnesNeed) {
  for (const int links : {6, 30, 40}) {
    SystemSpec spec = tied_chains(links);
    const auto model = compiled(spec), by_rates = embedded_by(*model, {1, 1});
    const EmbeddedLoop& first = by_rates->loops.embedding->loops[0];
    EXPECT_EQ(first.n, 2 * links - 3);
    EXPECT_LT(first.keep, first.n);
    const State at = model->initial_state();
    const VectorXd tau = VectorXd::LinSpaced(model->nv, -0.5, 1.5);
    const DenseTwin<Quad> twin(spec);
    const VectorXd want = twin.at(at.q.cast<Quad>(), at.v.cast<Quad>()).closed(tau.cast<Quad>()).vdot.unaryExpr([](const Quad& x) {
      return static_cast<double>(x);
    });
    Workspace ws(*by_rates);
    VectorXd vdot(model->nv);
    ASSERT_TRUE(forward_dynamics(*by_rates, ws, {.q = at.q.data(), .v = at.v.data(), .tau = tau.data()}, vdot.data()));
    EXPECT_TRUE(ws.loops->unsettled) << "by the program of the start";
    EXPECT_FALSE(ws.loops->embedding->named[0]);
    EXPECT_LE(error_of(vdot, want), 1e-11) << links;
  }
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

/// A wing stands on the bus by its tip, and so does a flap, which a weld holds to the bus as well: the modes move both of its ends alike,
/// and what rounding makes of that are no rows.
TEST(Loops, WhatNoModeOfItsWayMovesIsNotHeld) {
  for (unsigned seed = first_seed(); seed < first_seed() + 20; ++seed) {
    std::mt19937 rng(seed);
    const auto any = [&] { return static_cast<double>(rng()) / 2147483648.0 - 1.0; };
    const auto vector = [&] { return Eigen::Vector3d(any(), any(), any()); };
    const auto turn = [&] { return Eigen::Matrix3d(Eigen::AngleAxisd(2.0 * any(), vector().normalized())); };
    const auto shapes = [&] { return Eigen::MatrixXd(Eigen::MatrixXd::NullaryExpr(3, 2, any)); };
    std::vector<MassNode> masses;
    for (int i = 0; i < 3; ++i) masses.push_back({1.0, vector(), diagonal({0.06, 0.05, 0.04}), shapes(), shapes(), {}});
    const ModalNode tip{"tip", vector(), turn(), shapes(), shapes()};
    BodySpec wing;
    wing.name = "wing", wing.type = "modal_flexible", wing.eta = {0.2, -0.1}, wing.etadot = {0.3, 0.2};
    wing.modal = std::make_shared<const ModalData>(lumped_modal_data(masses, Eigen::Vector2d(30, 50).asDiagonal(), {}, {tip}));
    wing.hinge.inboard_body = "bus", wing.hinge.body_node = "tip", wing.hinge.onode_position = vector(), wing.hinge.onode_R = turn();
    BodySpec flap = rigid("flap", 2.0, vector(), diagonal({0.3, 0.4, 0.5}));
    flap.hinge.inboard_body = "wing", flap.hinge.inboard_node = "tip";
    const BodySpec bus = on(rigid("bus", 5.0, vector(), diagonal({1.0, 2.0, 2.5})), "", "free");
    SystemSpec spec = system({bus, wing, flap}, uniform_gravity({0.0, 0.0, -1.0}));
    const auto accelerations = [&] {
      const auto model = compiled(spec);
      EXPECT_EQ(model->loops.rank, 0) << seed;
      Workspace ws(*model);
      const State at = model->initial_state();
      VectorXd vdot(model->nv);
      EXPECT_TRUE(forward_dynamics(*model, ws, {.q = at.q.data(), .v = at.v.data()}, vdot.data())) << seed;
      return vdot;
    };
    const VectorXd open = accelerations();
    LoopSpec weld;
    weld.name = "weld", weld.type = "weld", weld.from.body = "bus", weld.to.body = "flap", weld.to.position = vector();
    weld.from.position = wing.hinge.onode_position + wing.hinge.onode_R * weld.to.position, weld.from.R = wing.hinge.onode_R;
    spec.loops = {weld};
    for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers, LoopForm::dae}) {
      spec.loop_form = form;
      EXPECT_LE((accelerations() - open).norm(), 1e-12 * open.norm()) << seed;
    }
  }
}

/// All forms agree, at the nearest closed states too, where the couplings `first` and `second` are to be something.

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
    EXPECT_EQ(model->loops.rank, 2) << e;
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

}  // namespace
}  // namespace cardan::test
