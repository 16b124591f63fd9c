// Nothing knows the units: a vehicle in other units of length, mass and time moves alike. The units are powers of two, so that every number
// of it is the same but for its exponent, and a constant that has a dimension shows wherever it is.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "bodies/modal/lumped.hpp"
#include "core/base/units.hpp"
#include "core/dynamics/loops.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/closed_mechanisms.hpp"
#include "tests/support/custom_cam.hpp"

namespace cardan::test {
namespace {

struct Units {
  double length, mass, time;  // of one of them how many there are in a metre, a kilogram, a second
  double of(const std::string& unit) const {
    const std::array<int, 6> e = parse_unit(unit)->dimension.exponents;
    return std::pow(length, e[0]) * std::pow(mass, e[1]) * std::pow(time, e[2]);
  }
  double force(const std::string& rate) const { return of(force_unit(rate)); }
};
const Units kUnits[] = {{1024.0, 1.0, 1.0}, {1.0, 0x1p40, 1.0}, {1.0, 1.0, 128.0}, {0x1p-14, 0x1p-30, 0x1p-9}, {0x1p12, 0x1p-20, 0x1p7}};

void scale(ParamValues& values, const cardan_hinge_family& family, const Units& units) {
  for (std::uint32_t i = 0; i < family.n_params; ++i) {
    const cardan_param_desc& p = family.params[i];
    if (const auto at = values.find(p.name); at != values.end() && p.kind == CARDAN_NUMBER)
      std::get<double>(at->second.value) *= units.of(p.unit);
  }
}

SystemSpec in(const Units& units, SystemSpec spec) {
  const double m = units.length, J = units.of("kg m^2"), work = units.of("J");
  for (BodySpec& b : spec.bodies) {
    b.mass *= units.mass, b.com *= m, b.inertia_com *= J;
    for (NodeSpec& n : b.nodes) n.position *= m;
    for (double& rate : b.etadot) rate /= units.time;
    if (b.modal) {
      std::vector<MassNode> masses = b.modal->mass_nodes;
      for (MassNode& n : masses) {
        n.mass *= units.mass, n.position *= m, n.inertia *= J, n.Phi *= m;
        for (MatrixXd& Q : n.Q) Q *= m;
      }
      std::vector<ModalNode> nodes = b.modal->nodes;
      for (ModalNode& n : nodes) n.position *= m, n.Phi *= m;
      b.modal = std::make_shared<const ModalData>(lumped_modal_data(masses, work * b.modal->K, work * units.time * b.modal->C, nodes));
    }
    HingeSpec& h = b.hinge;
    const cardan_hinge_family& family = *registry().hinge(h.type);
    h.onode_position *= m, h.pnode_position *= m;
    scale(h.params, family, units);
    for (std::size_t i = 0; i < h.q.size(); ++i) h.q[i] *= units.of(family.q_units[i]);
    for (std::size_t i = 0; i < h.v.size(); ++i) h.v[i] *= units.of(family.v_units[i]);
    for (SpringDamper& s : h.springs) {
      const double rate = units.of(family.v_units[s.component]), force = units.force(family.v_units[s.component]), way = rate * units.time;
      s.stiffness *= force / way, s.rest *= way, s.damping *= force / rate;
    }
    for (HingeLoadSpec& l : h.loads) {
      const double rate = units.of(family.v_units[l.component]), force = units.force(family.v_units[l.component]), way = rate * units.time;
      HingeLoad::Parameters& p = l.parameters;
      if (l.law == HingeLaw::stop)
        p[0] *= way, p[1] *= way, p[2] *= force / std::pow(way, p[3]), p[4] /= rate, l.bounce.speed *= rate;
      else
        p[0] *= force, p[1] *= force, p[2] *= rate, p[3] *= force / rate, p[4] *= rate;
    }
  }
  for (LoopSpec& l : spec.loops) {
    l.from.position *= m, l.to.position *= m, l.length *= m;
    if (const cardan_hinge_family* family = registry().hinge(l.type)) scale(l.params, *family, units);
  }
  spec.gravity.g *= units.of("m/s^2"), spec.gravity.mu *= units.of("m^3/s^2"), spec.gravity.centre *= m;
  return spec;
}

/// By what velocities of the model are more; 1/s of modes.
VectorXd rates_in(const Units& units, const Model& model) {
  VectorXd out = VectorXd::Constant(model.nv, 1.0 / units.time);
  for (const UserBody& u : model.user)
    for (int i = 0; i < u.nv; ++i) out[u.v + i] = units.of(u.hinge->v_units[i]);
  return out;
}

RandomTree in(const Units& units, RandomTree tree) {
  const auto model = compiled(tree.spec);
  const VectorXd rates = rates_in(units, *model);
  const double power = units.of("W");
  for (const UserBody& u : model->user) {
    const Eigen::Index n = u.nv, modes = u.n_modes;
    VectorXd of(n + modes);
    of << rates.segment(u.v, n), rates.segment(u.etadot, modes);
    tree.tau[u.name].head(n + modes).array() *= power / of.array();
    tree.vdot[u.name].head(n + modes).array() *= of.array() / units.time;
  }
  for (Load& l : tree.loads) l.wrench.head<3>() *= units.of("N m"), l.wrench.tail<3>() *= units.of("N");
  tree.spec = in(units, tree.spec);
  return tree;
}

/// Accelerations in other units beside those in SI.
double accelerations_apart(const RandomTree& tree) {
  Loaded a(tree);
  const VectorXd want = a.forward();
  double worst = 0.0;
  for (const Units& units : kUnits) {
    Loaded b(in(units, tree));
    worst = worse(worst, apart((b.forward().array() * units.time / rates_in(units, *a.model).array()).matrix().eval(), want));
  }
  return worst;
}

TEST(Units, OfAccelerationsAreNotKnown) {
  for (const TreeOptions& options : {TreeOptions{.locked = 0.15, .prescribed = 0.1}, TreeOptions{.gravity = GravitySpec::Kind::central}})
    for_all_trees(options, 0.0, accelerations_apart);
}

TEST(Units, OfClosedLoopsAreNotKnown) {
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers})
    for_all_trees({.bodies = 6, .flexible = 0.2, .wheels = 0.3}, 1e-14, [&](const RandomTree& tree) {
      RandomTree closed = cut(tree).closed;
      closed.spec.loop_form = form;
      return accelerations_apart(closed);
    });
}

/// How near loops are to a singular posture: of rows that modes move too, whose coordinates have scales of their own.
TEST(Units, OfPivotsAreNotKnown) {
  for_all_trees({.bodies = 6, .flexible = 0.5}, 1e-12, [](const RandomTree& tree) {
    const RandomTree closed = cut(tree).closed;
    if (closed.spec.loops.empty()) return 0.0;
    const auto pivots = [](const RandomTree& t) {
      Loaded at(t);
      const LoopRank rank = loop_rank(*at.model, at.ws, at.state.q.data());
      return Eigen::Vector2d(rank.smallest, rank.distance);
    };
    const Eigen::Vector2d want = pivots(closed);
    double worst = 0.0;
    for (const Units& units : kUnits) worst = worse(worst, apart(pivots(in(units, closed)), want));
    return worst;
  });
}

/// A hinge whose only rate turns and shifts at once: a cam of a plugin, along a parabola, between a body on a gimbal and one that flies.
TEST(Units, OfPivotsOfACamAreNotKnown) {
  BodySpec base = on(rigid("base", 4.0, {0.1, 0, 0}, diagonal({1, 2, 3})), "", "gimbal", {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
  BodySpec follower = rigid("follower", 1.5, {0, 0.2, 0.1}, diagonal({0.2, 0.3, 0.4}));
  follower.hinge.type = "free", follower.hinge.q = {1, 0, 0, 0, 0.5, 0.1, 0};
  LoopSpec loop;
  loop.name = "cam", loop.type = "custom_cam", loop.from.body = "base", loop.from.position = {0.5, 0.1, 0}, loop.to.body = "follower";
  loop.params = on(follower, "", "custom_cam", {{1, 2, 2}}).hinge.params;
  const auto pivots = [&](const Units& units) {
    SystemSpec spec = system({base, follower});
    spec.loops = {loop};
    spec = in(units, spec);
    ParamValues& params = spec.loops[0].params;
    params["a"].value = 0.3 / units.length, params["b"].value = 0.0, params["c"].value = 1.2 / units.length;
    const auto model = compile(spec, registry_with_cam());
    Workspace ws(*model);
    const LoopRank rank = loop_rank(*model, ws, model->initial_state().q.data());
    EXPECT_EQ(rank.rank, 5);
    return Eigen::Vector2d(rank.smallest, rank.distance);
  };
  const Eigen::Vector2d want = pivots({1.0, 1.0, 1.0});
  for (const Units& units : kUnits) EXPECT_LE(apart(pivots(units), want), 1e-14) << units.length;
}

/// Springs, stops, friction and bounces.
TEST(Units, OfARunAreNotKnown) {
  for_all_trees({.bodies = 5, .flexible = 0.3, .springs = true, .loads = true}, 1e-13, [](const RandomTree& tree) {
    RandomTree given = tree;
    for (std::size_t i = 0; i < given.spec.bodies.size(); i += 2)
      for (HingeLoadSpec& l : given.spec.bodies[i].hinge.loads)
        if (const double q = given.spec.bodies[i].hinge.q[0]; l.law == HingeLaw::stop)
          l.parameters = {q - 0.01, q + 0.01, 1e3, 1.0, 1.0}, l.bounce = {0.6, 0.05};
    const auto run = [&](const Units& units) {
      const RandomTree t = in(units, given);
      SimulationOptions options;
      options.integrator.method = "rk4", options.integrator.fixed_step = 1e-3 * units.time;
      Simulation sim(compiled(t.spec), options);
      const VectorXd tau = in_user_order(sim.model(), t.tau);
      for (int i = 0; i < tau.size(); ++i) sim.set_force(i, tau[i]);
      sim.run(0.2 * units.time);
      return (sim.state().v.array() / rates_in(units, sim.model()).array()).matrix().eval();
    };
    const VectorXd want = run({1.0, 1.0, 1.0});
    double worst = 0.0;
    for (const Units& units : kUnits) worst = worse(worst, apart(run(units), want));
    return worst;
  });
}

}  // namespace
}  // namespace cardan::test
