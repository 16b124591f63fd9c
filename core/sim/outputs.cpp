#include "core/sim/outputs.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <set>

#include "core/base/diagnostic.hpp"
#include "core/base/units.hpp"
#include "core/io/run_columns.hpp"
#include "core/model/components.hpp"
#include "core/model/device_units.hpp"

namespace cardan {
namespace {

NodeState node_now(Simulation& sim, int id) { return sim.observe().node(sim.now().node[static_cast<std::size_t>(id)]); }

class Outputs {
 public:
  explicit Outputs(Simulation& sim) : sim_(sim), model_(sim.model()) {}

  std::vector<Output> all(const OutputOptions& wanted) {
    for (std::size_t i = 0; i < model_.user.size(); ++i) {
      const UserBody& u = model_.user[i];
      if (u.has_attitude()) body(u);
      if (u.hinge->nv > 0) hinge(u, static_cast<int>(i));
      if (u.n_modes > 0) modes(u);
    }
    for (const Device& d : model_.devices.all) device(d);
    for (const LoopSpec& l : model_.spec->loops) loop(l);
    if (!model_.spec->loops.empty()) loops();
    for (const int i : wanted.reactions) reaction(i);
    for (const int i : wanted.nodes) node(i);
    if (sim_.options().ledger) ledger();
    return std::move(out_);
  }

 private:
  void add(const std::string& path, std::vector<std::string> components, std::string unit, std::string frame, std::string meaning,
           std::function<void(double*)> fill) {
    out_.push_back({{path, std::move(components), std::move(unit), std::move(frame), std::move(meaning)}, std::move(fill)});
  }
  // Functions outlive this object, and the model: they hold ids (Simulation::now()).
  int body_id(const UserBody& u) const { return id_of(sim_.now().body, static_cast<int>(&u - model_.user.data())); }
  static std::size_t at(int id) { return static_cast<std::size_t>(id); }
  static void put(double* x, const Eigen::Vector3d& a) { Eigen::Map<Eigen::Vector3d>(x, 3) = a; }

  void attitude(const std::string& path, const char* of, int id) {
    add(path + "attitude", {"w", "x", "y", "z"}, "1", "world", fmt::format("orientation of the {0}, quaternion {0} into world", of),
        [=, &sim = sim_](double* x) {
          Eigen::Quaterniond q(node_now(sim, id).R_WN);
          const double along =
              x[0] * q.w() + x[1] * q.x() + x[2] * q.y() + x[3] * q.z();  // with that of the last row: no jumps between q and -q
          if (along < 0.0 || (along == 0.0 && q.w() < 0.0)) q.coeffs() = -q.coeffs();
          x[0] = q.w(), x[1] = q.x(), x[2] = q.y(), x[3] = q.z();
        });
  }

  void body(const UserBody& u) {
    const int id = id_of(sim_.now().node, model_.find_node(u.name));
    const std::string path = "bodies/" + u.name + "/";
    attitude(path, "body", id);
    add(path + "rate", {"x", "y", "z"}, "rad/s", "body " + u.name, "angular velocity",
        [=, &sim = sim_](double* x) { put(x, node_now(sim, id).velocity.head<3>()); });
    if (u.hinge->shape == CARDAN_SHAPE_BALL) return;  // a ball hinge: its place is that of the inboard body
    add(path + "position", {"x", "y", "z"}, "m", "world", "position of the origin of the body",
        [=, &sim = sim_](double* x) { put(x, node_now(sim, id).position); });
    add(path + "velocity", {"x", "y", "z"}, "m/s", "world", "velocity of the origin of the body", [=, &sim = sim_](double* x) {
      const NodeState n = node_now(sim, id);
      put(x, n.R_WN * n.velocity.tail<3>());
    });
  }

  /// What a channel of a hinge has to tell: while it moves, while it is held, and once the body hangs on another one (core/sim/rejoin.hpp).
  template <class Moving, class Held, class Gone>
  static void whatever_it_is(Simulation& sim, int id, const cardan_hinge_family* family, const Moving& moving, const Held& held,
                             const Gone& gone) {
    const UserBody& now = sim.user(id);
    if (now.hinge != family)
      gone();
    else if (now.nv > 0)
      moving(now);
    else
      held(sim.model().spec->bodies[at(sim.now().body[at(id)])].hinge);
  }

  void hinge(const UserBody& u, int index) {
    const std::string path = "hinges/" + u.name + "/";
    const int id = body_id(u);
    const cardan_hinge_family* const family = u.hinge;
    if (!has_quaternion(*family)) {
      for (int j = 0; j < static_cast<int>(family->nq); ++j)
        add(path + family->q_names[j], {family->q_names[j]}, family->q_units[j], "", "coordinate of the hinge",
            [=, &sim = sim_](double* x) {
              whatever_it_is(
                  sim, id, family, [&](const UserBody& now) { *x = sim.state().q[now.q + j]; },
                  [&](const HingeSpec& h) { *x = h.q.empty() ? 0.0 : h.q[at(j)]; }, [] {});
            });
      for (int j = 0; j < static_cast<int>(family->nv); ++j)
        add(path + family->v_names[j], {family->v_names[j]}, family->v_units[j], "", "velocity of the hinge", [=, &sim = sim_](double* x) {
          const auto none = [x](auto&&...) { *x = 0.0; };
          whatever_it_is(
              sim, id, family, [&](const UserBody& now) { *x = sim.state().v[now.v + j]; }, none, none);
        });
    }
    std::vector<std::string> names(family->v_names, family->v_names + family->nv), units;
    for (std::uint32_t j = 0; j < family->nv; ++j) units.push_back(force_unit(family->v_units[j]));
    const bool prescribed = !model_.spec->bodies[at(index)].hinge.prescribed.empty();
    if (has_quaternion(*family) && !prescribed) return;
    add(path + "force", names, unit_of_channel(units), "",
        prescribed
            ? "force that is commanded; of prescribed components, that which their drive gives; springs, loads and devices not included"
            : "force that is commanded; springs, loads and devices not included",
        [&sim = sim_, id, family, prescribed, all = std::vector<double>()](double* x) mutable {
          const auto moving = [&](const UserBody& now) {
            for (int j = 0; j < now.nv; ++j) x[j] = sim.force(now.v + j);
            if (!prescribed || !sim.model().has_prescribed()) return;
            all.resize(at(sim.model().nv));
            sim.drive_forces(all.data());
            for (int j = now.v; j < now.v + now.nv; ++j)
              if (sim.model().prescribed[at(j)]) x[j - now.v] = all[at(j)];
          };
          const auto none = [x, family](auto&&...) { std::fill_n(x, family->nv, 0.0); };
          whatever_it_is(sim, id, family, moving, none, none);
        });
  }

  void modes(const UserBody& u) {
    std::vector<std::string> names;
    for (int j = 1; j <= u.n_modes; ++j) names.push_back(std::to_string(j));
    add("modes/" + u.name + "/eta", names, "1", "", "modal coordinates",
        [&sim = sim_, id = body_id(u)](double* x) { std::copy_n(sim.state().q.data() + sim.user(id).eta, sim.user(id).n_modes, x); });
    add("modes/" + u.name + "/etadot", names, "1/s", "", "rates of the modal coordinates",
        [&sim = sim_, id = body_id(u)](double* x) { std::copy_n(sim.state().v.data() + sim.user(id).etadot, sim.user(id).n_modes, x); });
  }

  void device(const Device& d) {
    const std::string path = "devices/" + d.name + "/";
    const bool turning = turns(model_, d);
    int in = d.in, out = d.out;
    std::vector<std::string> taken;  // an output may have the name of a state: the state is then not told twice
    for (std::uint32_t i = 0; i < d.family->n_ports; ++i) {
      const cardan_port_desc& port = d.family->ports[i];
      taken.emplace_back(port.name);
      if (port.kind == CARDAN_PORT_IN)
        add(path + port.name, {port.name}, unit_where(turning, port.unit), "", fmt::format("input: {}", port.meaning),
            [&sim = sim_, id = id_of(sim_.now().in, in++)](double* x) { *x = (sim.observe(), sim.device_input(sim.now().in[at(id)])); });
      else
        add(path + port.name, {port.name}, unit_where(turning, port.unit), "", port.meaning,
            [&sim = sim_, id = id_of(sim_.now().out, out++)](double* x) { *x = sim.device_output(sim.now().out[at(id)]); });
    }
    const auto states = [&](const cardan_state_desc* all, std::uint32_t n, int first, const Eigen::VectorXd& of,
                            const std::vector<int>& now) {
      for (std::uint32_t i = 0; i < n; ++i)
        if (std::ranges::find(taken, all[i].name) == taken.end())
          add(path + all[i].name, {all[i].name}, unit_where(turning, all[i].unit), "", all[i].meaning,
              [&of, &now, id = id_of(now, first + static_cast<int>(i))](double* x) { *x = of[now[at(id)]]; });
    };
    states(d.family->states, d.family->n_states, d.z, sim_.state().z, sim_.now().z);
    states(d.family->marks, d.family->n_marks, d.mark, sim_.state().marks, sim_.now().mark);
  }

  /// The force on a coordinate whose coefficient is 1 (or -1), else on any: those tell what the sum of the coupling is measured in. "1"
  /// where they are of several kinds, or none.
  std::string unit_of_multiplier(const LoopSpec& coupling) const {
    std::set<std::string> of_ones, of_all;
    for (const LoopSpec::Term& term : coupling.terms)
      for (const int i : components_of(model_, term.target))
        for (const UserBody& u : model_.user) {
          if (i < u.v || i >= u.v + u.nv) continue;
          const std::string unit = force_unit(u.v_units[at(i - u.v)]);
          of_all.insert(unit);
          if (std::abs(term.coefficient) == 1.0) of_ones.insert(unit);
        }
    const std::set<std::string>& kinds = of_ones.empty() ? of_all : of_ones;
    return kinds.size() == 1 ? *kinds.begin() : "1";
  }

  void loop(const LoopSpec& l) {  // while it is open: zero
    const std::string path = "loops/" + l.name + "/";
    if (l.type == "coupling")
      return add(path + "multiplier", {"multiplier"}, unit_of_multiplier(l), "",
                 "force of the coupling, per slope of its sum along each coordinate", [&sim = sim_, name = l.name](double* x) {
                   const int i = sim.model().loops.find(name);
                   *x = i < 0 ? 0.0 : sim.loop_forces().multipliers[at(sim.model().loops.all[at(i)].first)];
                 });
    add(path + "reaction", {"mx", "my", "mz", "fx", "fy", "fz"}, unit_of_channel({"N m", "N m", "N m", "N", "N", "N"}), "from of " + l.name,
        "moment and force that the loop transmits to its end `to`, at that node", [&sim = sim_, name = l.name](double* x) {
          const int i = sim.model().loops.find(name);
          const Force<double> f = i < 0 ? Force<double>{} : sim.loop_wrench(i);
          x[0] = f.n.x, x[1] = f.n.y, x[2] = f.n.z, x[3] = f.f.x, x[4] = f.f.y, x[5] = f.f.z;
        });
  }
  void loops() {
    add("loops/residual", {"residual"}, "1", "", "largest residual of a closed loop, over its size", [&sim = sim_](double* x) {
      *x = 0.0;
      if (sim.model().loops.empty()) return;
      const LoopForces f = sim.loop_forces();
      for (const Loop& l : sim.model().loops.all)
        for (int i = l.first; i < l.first + l.rows; ++i) *x = std::max(*x, std::abs(f.residual[at(i)]) / l.lever);
    });
    add("loops/power", {"power"}, "W", "", "power of all multipliers: that of prescribed loops, but for rounding",
        [&sim = sim_](double* x) { *x = sim.model().loops.empty() ? 0.0 : sim.loop_power(); });
  }

  void reaction(int i) {
    if (i < 0 || i >= static_cast<int>(model_.user.size()))
      refuse(Code::unknown_body, {"reactions to record"}, fmt::format("an index below {}", model_.user.size()), fmt::format("{}", i));
    const std::string& name = model_.user[static_cast<std::size_t>(i)].name;
    add("reactions/" + name, {"mx", "my", "mz", "fx", "fy", "fz"}, unit_of_channel({"N m", "N m", "N m", "N", "N", "N"}),
        "pnode of " + name, "moment and force that the inboard hinge transmits to the body",
        [&sim = sim_, id = id_of(sim_.now().body, i)](double* x) {
          const Force<double> f = sim.observe().hinge_wrench(sim.now().body[at(id)]);
          x[0] = f.n.x, x[1] = f.n.y, x[2] = f.n.z, x[3] = f.f.x, x[4] = f.f.y, x[5] = f.f.z;
        });
  }

  void node(int i) {
    if (i < 0 || i >= static_cast<int>(model_.nodes.size()))
      refuse(Code::unknown_node, {"nodes to record"}, fmt::format("an index below {}", model_.nodes.size()), fmt::format("{}", i));
    const std::string path = "nodes/" + model_.nodes[at(i)].name + "/";
    const int id = id_of(sim_.now().node, i);
    attitude(path, "node", id);
    add(path + "position", {"x", "y", "z"}, "m", "world", "position of the node",
        [&sim = sim_, id](double* x) { put(x, node_now(sim, id).position); });
    add(path + "velocity", {"x", "y", "z"}, "m/s", "world", "velocity of the node", [&sim = sim_, id](double* x) {
      const NodeState n = node_now(sim, id);
      put(x, n.R_WN * n.velocity.tail<3>());
    });
    add(path + "acceleration", {"x", "y", "z"}, "m/s^2", "world", "acceleration of the node", [&sim = sim_, id](double* x) {
      const NodeState n = node_now(sim, id);
      put(x, n.R_WN * n.acceleration.tail<3>());
    });
  }

  void ledger() {
    const auto one = [this](const char* name, double LedgerState::*residual) {
      add(std::string("ledger/") + name, {"residual"}, "1", "", "balance error over the largest sum of magnitudes over bodies",
          [&sim = sim_, residual](double* x) { *x = sim.ledger().*residual; });
    };
    one("linear_momentum", &LedgerState::linear_relative);
    one("angular_momentum", &LedgerState::angular_relative);
    one("energy", &LedgerState::energy_relative);
  }

  Simulation& sim_;
  const Model& model_;
  std::vector<Output> out_;
};

}  // namespace

std::vector<Output> standard_outputs(Simulation& sim, const OutputOptions& wanted) { return Outputs(sim).all(wanted); }

std::vector<Channel> channels_of(const std::vector<Output>& outputs) {
  std::vector<Channel> channels;
  for (const Output& o : outputs) channels.push_back(o.channel);
  return channels;
}

}  // namespace cardan
