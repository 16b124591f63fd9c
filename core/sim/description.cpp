#include "core/sim/description.hpp"
#include "core/model/device_units.hpp"
#include "core/model/fields.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/dynamics/devices.hpp"
#include "core/dynamics/loops.hpp"
#include "core/linalg/linear_operator.hpp"
#include "core/model/loops.hpp"
#include "core/model/validate.hpp"
#include "core/operators/system_modes.hpp"
#include "core/sim/flexible_limits.hpp"
#include "core/soa/cost.hpp"

namespace cardan {
namespace {

Json vector(const Eigen::Vector3d& a) { return {a.x(), a.y(), a.z()}; }

std::string node_name(const std::string& body, const std::string& node) { return node.empty() ? body : body + "." + node; }

Json bodies(const Model& m) {
  Json all = Json::array();
  for (std::size_t i = 0; i < m.user.size(); ++i) {
    const UserBody& u = m.user[i];
    const BodySpec& b = m.spec->bodies[i];
    std::vector<std::string> prescribed;
    for (const int c : b.hinge.prescribed) prescribed.push_back(u.v_names[static_cast<std::size_t>(c)]);
    const std::string to = u.parent < 0 ? "world" : m.user[static_cast<std::size_t>(u.parent)].name;
    all.push_back({{"name", u.name},
                   {"type", u.type},
                   {"level", b.modal ? Json(b.level) : Json()},
                   {"hinge", u.hinge_type},
                   {"to", node_name(to, b.hinge.inboard_node)},
                   {"velocities", u.v_names},
                   {"modes", u.n_modes},
                   {"locked", b.hinge.locked},
                   {"merged", u.merged},
                   {"prescribed", prescribed},
                   {"factor", hinge_factors()[static_cast<std::size_t>(b.hinge.factor)]}});
  }
  return all;
}

/// Mass, mass centre and inertia of each body and of all; flexible bodies undeformed.
Json masses(Simulation& sim) {
  const Model& m = sim.model();
  const Observer& observer = sim.observe();
  struct Part {
    double mass;
    Eigen::Vector3d com;
    Eigen::Matrix3d J_origin, R_WB;
    Eigen::Vector3d com_W;
  };
  std::vector<Part> parts;
  double total = 0.0;
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < m.user.size(); ++i) {
    const UserBody& u = m.user[i];
    const auto& modal = m.spec->bodies[i].modal;
    Part p;
    p.mass = u.mass;
    const Eigen::Vector3d first = modal ? modal->integrals.I2 : to_eigen(u.M.h);
    p.com = p.mass > 0 ? Eigen::Vector3d(first / p.mass) : Eigen::Vector3d::Zero();
    p.J_origin = modal ? modal->integrals.I7 : to_eigen(u.M.J);
    const Pose<double> pose = observer.body_pose(static_cast<int>(i));
    p.R_WB = to_eigen(pose.R);
    p.com_W = to_eigen(pose.p) + p.R_WB * p.com;
    total += p.mass;
    moment += p.mass * p.com_W;
    parts.push_back(p);
  }
  const Eigen::Vector3d com = total > 0 ? Eigen::Vector3d(moment / total) : Eigen::Vector3d::Zero();
  const auto about = [](double mass, const Eigen::Vector3d& r) -> Eigen::Matrix3d {
    return mass * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
  };
  Json rows = Json::array();
  Eigen::Matrix3d J = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const Part& p = parts[i];
    J += p.R_WB * (p.J_origin - about(p.mass, p.com)) * p.R_WB.transpose() + about(p.mass, p.com_W - com);
    rows.push_back({{"name", m.user[i].name}, {"mass", p.mass}, {"com_body", vector(p.com)}, {"com_world", vector(p.com_W)}});
  }
  Json inertia = Json::array();
  for (int r = 0; r < 3; ++r) inertia.push_back(vector(J.row(r)));
  return {{"bodies", rows}, {"total", total}, {"com_world", vector(com)}, {"inertia_world_about_com", inertia}};
}

Json modes(const Model& m) {
  Json all = Json::array();
  for (std::size_t i = 0; i < m.user.size(); ++i) {
    const BodySpec& b = m.spec->bodies[i];
    if (!b.modal) continue;
    Json audit = Json::array();
    for (const ModeRecord& r : b.modal->audit)
      audit.push_back({{"frequency_hz", r.frequency},
                       {"kind", r.kind},
                       {"effective_mass", std::vector<double>(r.effective_mass.begin(), r.effective_mass.end())},
                       {"kept", r.kept},
                       {"reason", r.reason}});
    const ModalIntegrals& I = b.modal->integrals;  // about the origin of the body, as effective masses are
    all.push_back({{"body", b.name},
                   {"source", b.modal->source},
                   {"kept", b.modal->n_modes},
                   {"audit", audit},
                   {"rigid_mass", {I.I7(0, 0), I.I7(1, 1), I.I7(2, 2), I.I1, I.I1, I.I1}}});
  }
  return all;
}

Json ops(const Model& m, const std::vector<soa::OpCost>& costs, bool measured) {
  Json all = Json::array();
  for (const soa::OpCost& op : costs) {
    all.push_back({{"name", op.name}, {"bodies", op.bodies}, {"bytes", op.bytes}});
    if (op.flops >= 0) all.back()["flops"] = op.flops, all.back()["functions"] = op.functions;
    if (measured) all.back()["ns"] = op.ns;
  }
  for (std::size_t i = 0; i < all.size(); ++i)
    if (m.program[i].code == OpCode::refine) all[i]["reason"] = m.refinement;
  return all;
}

/// "a.y + b.y, 1 tick ago", "0.1, 0 after 0.2 s of silence".
std::string input_text(const DeviceSpec::Input& input) {
  const auto* source = std::get_if<std::string>(&input.value);
  std::string text = source ? *source : fmt::format("{:.10g}", std::get<double>(input.value));
  if (input.delay > 0) text += fmt::format(", {} tick{} ago", input.delay, input.delay > 1 ? "s" : "");
  if (input.latency > 0.0) text += fmt::format(", {:.10g} s ago", input.latency);
  if (input.safe) text += fmt::format(", {:.10g} after {:.10g} s of silence", *input.safe, input.timeout);
  return text;
}

std::string text_of(const ParamValue& p) {
  if (!p.file.empty()) return p.file;
  return std::visit(
      [](const auto& x) -> std::string {
        using T = std::decay_t<decltype(x)>;
        if constexpr (std::is_same_v<T, std::vector<double>>)
          return fmt::format("[{:.10g}]", fmt::join(x, ", "));
        else if constexpr (std::is_same_v<T, double>)
          return fmt::format("{:.10g}", x);
        else
          return fmt::format("{}", x);
      },
      p.value);
}

/// In the words of the schema of its family.
std::string parameter_unit(std::span<const cardan_param_desc> schema, const std::string& name) {
  for (const cardan_param_desc& p : schema)
    if (name == p.name) return p.unit && *p.unit && p.unit != std::string_view("1") && !p.units ? std::string(" ") + p.unit : std::string();
  return {};
}

constexpr std::size_t kLongList = 24;  // numbers: of a longer one it is told how many

std::string place_text(const std::string& body, const Eigen::Vector3d& p, const Eigen::Matrix3d& R) {
  std::string text = p.isZero() ? body : fmt::format("{} at [{:.10g}, {:.10g}, {:.10g}]", body, p.x(), p.y(), p.z());
  const Eigen::AngleAxisd turn(R);
  const Eigen::Vector3d u = turn.axis();
  if (turn.angle() != 0.0)
    text += fmt::format(", turned by {:.10g} rad about [{:.10g}, {:.10g}, {:.10g}]", turn.angle(), u.x(), u.y(), u.z());
  return text;
}
std::string place_text(const PlaceSpec& place) {
  if (!place.node.empty()) return place.body + "." + place.node;
  return place_text(place.body.empty() ? "world" : place.body, place.position, place.R);
}

/// In the order of evaluation; what each is given, reads and gives.
Json devices(const Model& m) {
  Json all = Json::array();
  const Devices& devices = m.devices;
  for (const int i : devices.order) {
    const Device& d = devices.all[static_cast<std::size_t>(i)];
    const DeviceSpec& spec = m.spec->devices[static_cast<std::size_t>(d.spec)];
    Json mounts = Json::array(), given_values = Json::array(), inputs = Json::array(), outputs = Json::array(), states = Json::array();
    const std::vector<cardan_param_desc> schema = schema_where(turns(m, d), *d.family);
    for (const cardan_param_desc& p : schema)
      if (const auto value = spec.params.find(p.name); value != spec.params.end()) {
        const auto* list = std::get_if<std::vector<double>>(&value->second.value);
        const bool table = list && list->size() > kLongList && value->second.file.empty();
        const std::string text = table ? fmt::format("{} numbers", list->size()) : text_of(value->second);
        given_values.push_back({{"name", p.name}, {"value", text + parameter_unit(schema, p.name)}});
      }
    for (std::uint32_t k = 0; k < d.family->n_mounts; ++k) {
      const cardan_mount_desc& mount = d.family->mounts[k];
      const auto given = spec.mounts.find(mount.name);
      if (mount.kind != CARDAN_MOUNT_FIELD)
        mounts.push_back({{"mount", mount.name}, {"at", place_text(given->second.target, given->second.position, given->second.R)}});
      else
        mounts.push_back(
            {{"mount", mount.name}, {"at", d.mounts[k].field < 0 ? "none" : m.fields[static_cast<std::size_t>(d.mounts[k].field)].name}});
    }
    for (std::uint32_t k = 0; k < d.family->n_ports; ++k) {
      const cardan_port_desc& port = d.family->ports[k];
      if (port.kind == CARDAN_PORT_OUT) {
        outputs.push_back({{"name", port.name}, {"unit", unit_where(turns(m, d), port.unit)}});
        continue;
      }
      const auto given = spec.inputs.find(port.name);
      std::string from = "commanded";
      if (given != spec.inputs.end()) {
        from = input_text(given->second);
        if (std::holds_alternative<double>(given->second.value)) from = "commanded" + from.substr(std::min(from.size(), from.find(',')));
      }
      inputs.push_back({{"name", port.name}, {"unit", unit_where(turns(m, d), port.unit)}, {"from", from}});
    }
    for (std::uint32_t k = 0; k < d.family->n_states; ++k)
      states.push_back({{"name", d.family->states[k].name},
                        {"unit", unit_where(turns(m, d), d.family->states[k].unit)},
                        {"nominal", devices.nominal[static_cast<std::size_t>(d.z) + k]}});
    all.push_back({{"name", d.name},
                   {"type", d.family->type},
                   {"role", role_text(*d.family)},
                   {"mounts", mounts},
                   {"parameters", given_values},
                   {"inputs", inputs},
                   {"outputs", outputs},
                   {"states", states},
                   {"roots", d.family->n_roots},
                   {"tangent", d.family->tangent ? "exact" : "by differences"}});
  }
  return all;
}

/// Of ports, which the mission has declared.
Json faults(const Simulation& sim) {
  Json all = Json::array();
  for (const RunningFault& f : sim.faults()) {
    all.push_back({{"port", sim.told_port(f)}, {"fault", sim.told_fault(f)}, {"from", f.from}});
    if (std::isfinite(f.until)) all.back()["until"] = f.until;
  }
  return all;
}

/// "2 arm + 0.5 wheel"
std::string sum_text(const std::vector<LoopSpec::Term>& terms) {
  std::string text;
  for (const LoopSpec::Term& term : terms) text += fmt::format("{}{:g} {}", text.empty() ? "" : " + ", term.coefficient, term.target);
  return text;
}
/// "0.02 sine(1 cam + 0.3)", "table of 12 rows, repeating (1 cam)"
std::string function_text(const LoopSpec::Function& f) {
  const std::string scale = f.scale == 1.0 ? "" : fmt::format("{:g} ", f.scale);
  const std::string argument = fmt::format("({}{})", sum_text(f.of), f.phase == 0.0 ? "" : fmt::format(" + {:g}", f.phase));
  if (f.kind == "table")
    return fmt::format("{}table of {} rows{} {}", scale, f.numbers.size() / 2, f.periodic ? ", repeating" : "", argument);
  if (f.kind == "polynomial") return fmt::format("{}polynomial [{:g}] {}", scale, fmt::join(f.numbers, ", "), argument);
  return fmt::format("{:g} {}{}", f.scale * f.numbers[0], f.kind, argument);
}

/// What closes the loops of the tree: rows, those that others imply, and how far the vehicle can still move.
Json loops(const Simulation& sim) {
  const Model& m = sim.model();
  if (m.spec->loops.empty()) return {};
  Json open = Json::array();
  for (const LoopSpec& l : m.spec->loops)
    if (l.open) open.push_back({{"name", l.name}, {"type", l.type}});
  if (m.loops.empty()) return {{"all", Json::array()}, {"open", open}};
  Workspace ws(m);
  const LoopRank rank = loop_rank(m, ws, sim.state().q.data(), sim.drives().data());
  Json all = Json::array(), redundant = Json::array();
  for (const int row : rank.redundant) redundant.push_back(name_of_row(m, ws, row));
  for (std::size_t i = 0; i < m.loops.all.size(); ++i) {
    const Loop& l = m.loops.all[i];
    const LoopSpec& spec = m.spec->loops[static_cast<std::size_t>(l.spec)];
    std::string text = fmt::format("from {} to {}", place_text(spec.from), place_text(spec.to));
    if (l.closing == Closing::coupling) {
      text = sum_text(spec.terms);
      for (const LoopSpec::Function& f : spec.functions) text += fmt::format("{}{}", text.empty() ? "" : " + ", function_text(f));
      text += fmt::format(" = {:g}", spec.offset);
    }
    if (spec.prescribed) text += l.closing == Closing::coupling ? ", by the mission more" : ", of a length that the mission gives";
    all.push_back({{"name", l.name}, {"type", l.type}, {"rows", l.rows}, {"rates", l.rates.size()}, {"between", text}});
  }
  const auto given = std::ranges::count(m.prescribed, 1);
  Json sets = Json::array();
  for (const LoopSet& set : m.loops.sets) {
    Json names = Json::array();
    for (const int l : set.loops) names.push_back(m.loops.all[static_cast<std::size_t>(l)].name);
    sets.push_back({{"loops", names}, {"form", set.form}, {"why", set.why}});
  }
  return {{"all", all},
          {"open", open},
          {"form", loop_forms()[static_cast<std::size_t>(m.spec->loop_form)]},
          {"embedded", m.loops.embedding != nullptr},
          {"sets", sets},
          {"rows", rank.rows},
          {"rank", rank.rank},
          {"redundant", redundant},
          {"moved", moved_at_start(m.loops.moved)},
          {"mobility", m.nv - given - rank.rank},
          {"by_counting", m.nv - given - rank.rows},
          {"smallest_pivot", rank.smallest},
          {"from_singular", rank.distance}};
}

Json fields(const Model& m) {
  Json all = Json::array();
  for (const Field& field : m.fields) {
    const FieldSource& s = *field.source;
    const cardan_field_family& f = *s.family;
    Json limits = Json::array(), readers = Json::array();
    for (std::uint32_t i = 0; i < f.n_limits; ++i)
      limits.push_back({{"name", f.limits[i].name}, {"outside", (s.held >> i & 1) != 0 ? "hold" : "refuse"}});
    if (m.field.source == &s || std::ranges::count(m.gravity.fields, field.name) > 0) readers.push_back("gravity of bodies");
    for (const Device& d : m.devices.all)
      for (const DeviceMount& mount : d.mounts)
        if (mount.field >= 0 && &m.fields[static_cast<std::size_t>(mount.field)] == &field) readers.push_back(d.name);
    all.push_back({{"name", field.name},
                   {"type", f.type},
                   {"quantity", quantity_text(f.quantity)},
                   {"limits", limits},
                   {"gradient", f.facts & CARDAN_FIELD_GRADIENT ? "exact" : "by differences"},
                   {"read_by", readers}});
  }
  return all;
}

Json not_modelled(const Model& m) {
  std::vector<std::string> all;
  if (m.gravity.kind == GravitySpec::Kind::none) all.emplace_back("gravity: none");
  if (m.gravity.kind == GravitySpec::Kind::uniform) all.emplace_back("gravity: uniform, no gradient");
  if (m.field.pulls() && !m.gravity.gradient) all.emplace_back("gravity gradient: none, the force acts at the mass centres");
  for (std::size_t i = 0; i < m.user.size(); ++i) {
    const BodySpec& b = m.spec->bodies[i];
    const SweepBody& swept = m.bodies[static_cast<std::size_t>(m.user[i].sweep)];
    if (m.user[i].n_modes == 0 || m.flexible[static_cast<std::size_t>(swept.flexible)].curved)
      continue;  // what its type has, whatever the level
    if (b.level == 0) all.push_back(b.name + ": deformation does not change its inertia (level 0)");
    if (!b.modal->integrals.of_change && m.gravity.gradient)
      all.push_back(b.name + ": the gradient of gravity on its modes, which do not tell where their masses are");
    if (b.level == 1) all.push_back(b.name + ": inertia to first order in the deformation (level 1)");
    if (b.modal->whole)
      all.push_back(
          fmt::format("{}: changes of its inertia by {} rotary inertia of its mass points, at most {:.1e} of a modal mass while the "
                      "rotations of its modes sum to 0.1 rad (rotary_inertia: exact keeps them)",
                      b.name, b.modal->integrals.rotary_ee.empty() ? "the" : "a part of the", b.modal->left_out));
    if (const double w = first_frequency(*b.modal); !has_stiffening(b))
      all.push_back(fmt::format(
          "{}: centrifugal stiffening, of the order of (Omega/omega_1)^2 of the stiffness of its first mode ({:.4g} Hz): 1 % at "
          "{:.3g} rad/s, all of it at {:.3g} rad/s",
          b.name, w / (2 * std::numbers::pi), 0.1 * w, w));
  }
  std::string rigid;
  for (const BodySpec& b : m.spec->bodies)
    if (!b.modal) rigid += (rigid.empty() ? "" : ", ") + b.name;
  if (!rigid.empty()) all.push_back("flexibility of " + rigid);
  all.emplace_back("friction and stops at hinges, contact between bodies, beyond what springs, loads and devices say");
  std::string left_out;
  for (const Device& d : m.devices.all)
    if (!operators::may_be_stiff(d) &&
        std::ranges::any_of(d.mounts, [](const DeviceMount& mount) { return (mount.use & CARDAN_USE_LOAD) != 0; }))
      left_out += (left_out.empty() ? "" : ", ") + d.name;
  if (!left_out.empty())
    all.push_back(
        fmt::format("in the modes of the whole, devices that have states or declare no energy: {} (linearize has them)", left_out));
  if (!m.varies.empty())
    all.emplace_back("propellant that moves in its tank, and what it takes to start and stop its flow (slosh: pendulums on hinges)");
  all.emplace_back(m.fields.empty() ? "forces of the environment: atmosphere, sunlight, magnetic field"
                                    : "forces of the environment, beyond what fields and devices say");
  return all;
}

/// Small vibrations of the assembled system about the initial state, and who takes part most in each.
Json system_modes(Simulation& sim, int elastic) {
  const bool closed = !sim.model().loops.empty();
  operators::TreeOperators tree(open_tree(sim.shared_model()));
  tree.at(sim.state().q.data());
  const auto largest = [](const Eigen::VectorXd& shares, const std::vector<std::string>& names) {
    Eigen::Index i = 0;
    const double share = shares.maxCoeff(&i);
    return Json{{"name", names[static_cast<std::size_t>(i)]}, {"share", share}};
  };
  try {
    Workspace ws(sim.model());
    const operators::SystemModesOptions options{elastic, 0, sim.devices(), &sim.model(), sim.drives()};
    const operators::SystemModes found =
        closed ? operators::closed_system_modes(tree, loop_freedom(sim.model(), ws, sim.state().q.data(), sim.drives().data()).X, options)
               : operators::system_modes(tree, options);
    Json rows = Json::array();
    for (Eigen::Index j = found.first_elastic; j < found.frequency.size(); ++j)
      rows.push_back({{"frequency_hz", found.frequency(j)},
                      {"damping", found.damping(j)},
                      {"kinetic", largest(found.kinetic.col(j), found.bodies)},
                      {"strain", largest(found.strain.col(j), found.labels.names)}});
    return {{"rigid", found.n_rigid}, {"modes", rows}};
  } catch (const InputError& e) {
    return {{"why_not", e.diagnostics().front().got}};
  } catch (const NumericsError& e) {
    return {{"why_not", e.failure().what}};
  } catch (const LinalgError& e) {
    return {{"why_not", e.what()}};
  }
}

/// Not asked for: of systems where it takes no time to notice, if there is any stiffness.
Json modes_worth_telling(Simulation& sim, int asked) {
  constexpr int kDefault = 10, kSmall = 400;
  if (asked >= 0) return asked > 0 ? system_modes(sim, asked) : Json();
  const Model& m = sim.model();
  const bool springs =
      std::any_of(m.loads.begin(), m.loads.end(), [](const HingeLoad& s) { return s.law == HingeLaw::spring && s.p[0] != 0.0; });
  if (!springs && m.n_modes == 0 && std::ranges::none_of(m.devices.all, operators::may_be_stiff)) return {};
  if (m.nv > kSmall)
    return {{"why_not", fmt::format("of more than {} velocities, here {}, where they are asked for: `cardan describe --modes {}`", kSmall,
                                    m.nv, kDefault)}};
  return system_modes(sim, kDefault);
}

/// What a load is called, and its parameters.
std::pair<std::string, std::string> load_text(const HingeLoad& s, bool slides) {
  const char *length = slides ? "m" : "rad", *force = slides ? "N" : "N m", *per_rate = slides ? "N s/m" : "N m s/rad";
  switch (s.law) {
    case HingeLaw::spring:
      return {"spring", fmt::format("stiffness {:.10g} {}, rest {:.10g} {}, damping {:.10g} {}", s.p[0], slides ? "N/m" : "N m/rad", s.p[1],
                                    length, s.p[2], per_rate)};
    case HingeLaw::stop:
      if (std::isfinite(s.bounce.speed))
        return {"hard_stop",
                fmt::format("lower {:.10g} {}, upper {:.10g} {}, restitution {:.10g} above {:.10g} {}/s, else stiffness {:.10g} {}/{}, "
                            "dissipation {:.10g} s/{}",
                            s.p[0], length, s.p[1], length, s.bounce.restitution, s.bounce.speed, length, s.p[2], force, length, s.p[4],
                            length)};
      return {"stop", fmt::format("lower {:.10g} {}, upper {:.10g} {}, stiffness {:.10g} {}/{}^{:g}, dissipation {:.10g} s/{}", s.p[0],
                                  length, s.p[1], length, s.p[2], force, length, s.p[3], s.p[4], length)};
    case HingeLaw::friction:
      break;
  }
  return {"friction",
          fmt::format("coulomb {:.10g} {}, breakaway {:.10g} {}, stribeck_rate {:.10g} {}/s, viscous {:.10g} {}, width {:.10g} {}/s",
                      s.p[0], force, s.p[1], force, s.p[2], length, s.p[3], per_rate, s.p[4], length)};
}

std::string sum_of(const std::vector<std::string>& fields) { return fmt::format("{}", fmt::join(fields, " + ")); }

std::string gravity_text(const GravitySpec& g) {
  if (g.kind == GravitySpec::Kind::none) return "none";
  if (g.kind == GravitySpec::Kind::uniform) return fmt::format("uniform [{:g}, {:g}, {:g}] m/s^2", g.g.x(), g.g.y(), g.g.z());
  if (g.kind == GravitySpec::Kind::field) return fmt::format("field {}, gradient {}", sum_of(g.fields), g.gradient ? "on" : "off");
  return fmt::format("central, mu = {:.10g} m^3/s^2, gradient {}", g.mu, g.gradient ? "on" : "off");
}

std::string text_of(const Vec3<double>& a) { return fmt::format("[{:.10g}, {:.10g}, {:.10g}]", a.x, a.y, a.z); }

std::string text_of(const Eigen::Vector3d& a) { return text_of(from_eigen(a)); }

std::string text_of(const Eigen::Matrix3d& R) {
  return fmt::format("[{}, {}, {}]", text_of(Eigen::Vector3d(R.row(0))), text_of(Eigen::Vector3d(R.row(1))),
                     text_of(Eigen::Vector3d(R.row(2))));
}

template <class Family>
std::span<const cardan_param_desc> schema_of(const Family* family) {
  return family ? std::span(family->params, family->n_params) : std::span<const cardan_param_desc>();
}

void measure(Simulation& sim, std::vector<soa::OpCost>& costs) {
  const Model& m = sim.model();
  const auto nv = static_cast<std::size_t>(m.nv);
  std::vector<double> tau(nv);
  const std::vector<double> vdot(nv);
  std::vector<NodeWrench> wrenches(sim.wrenches().begin(), sim.wrenches().end());
  const State& at = sim.state();
  Inputs in{.q = at.q.data(), .v = at.v.data(), .tau = tau.data(), .vdot = vdot.data(), .wrenches = wrenches};
  const DeviceForces* devices = sim.devices();
  in.moment = sim.gravity_moment();
  if (!devices) return soa::measure(m, in, costs);
  DeviceForces own(*devices);
  own.set({at.t, at.z.data(), at.marks.data(), tau.data(), wrenches.data()});
  soa::measure(m, in, costs, [&](Workspace& ws) {
    std::ranges::fill(tau, 0.0);
    own.act(ws, in);
  });
}

std::string program_text(const Model& m, const std::vector<soa::OpCost>& costs, bool measured) {
  const auto time = [&](double ns) { return measured ? fmt::format("{:>8.0f}", ns) : std::string(); };
  std::string text =
      fmt::format("{:<52}{:>8}{:>8}{:>8}{:>9}{}  bodies\n", "", "bodies", "flops", "sin/cos", "bytes", measured ? "      ns" : "");
  soa::OpCost sum;
  sum.ns = 0.0;
  for (std::size_t i = 0; i < costs.size(); ++i) {
    const soa::OpCost& cost = costs[i];
    std::string bodies = m.program[i].code == OpCode::refine ? m.refinement : std::string();
    if (const int r = m.program[i].run; r >= 0)
      for (const UserBody& u : m.user)
        if (!u.merged && u.sweep >= m.runs[static_cast<std::size_t>(r)].begin && u.sweep < m.runs[static_cast<std::size_t>(r)].end)
          bodies += (bodies.empty() ? "" : ", ") + u.name;
    const bool counted = cost.flops >= 0;
    text += fmt::format("{:<52}{:>8}{:>8}{:>8}{:>9}{}  {}\n", cost.name, cost.bodies, counted ? std::to_string(cost.flops) : "-",
                        counted ? std::to_string(cost.functions) : "-", cost.bytes, time(cost.ns), bodies);
    sum.flops += std::max(0L, cost.flops), sum.functions += cost.functions, sum.ns += cost.ns;
  }
  return text + fmt::format("{:<60}{:>8}{:>8}{:>9}{}  (bytes: all working memory)\n", "one evaluation of v'", sum.flops, sum.functions,
                            soa::workspace_bytes(m), time(sum.ns));
}

}  // namespace

std::vector<std::pair<std::string, std::string>> effective_parameters(const Model& m) {
  std::vector<std::pair<std::string, std::string>> all;
  const auto add = [&](std::string key, std::string value) { all.emplace_back(std::move(key), std::move(value)); };
  const GravitySpec& g = m.gravity;
  if (g.kind == GravitySpec::Kind::none) add("gravity", "none");
  if (g.kind == GravitySpec::Kind::uniform) add("gravity.uniform", text_of(g.g) + " m/s^2");
  if (g.kind == GravitySpec::Kind::central) {
    add("gravity.central.mu", fmt::format("{:.10g} m^3/s^2", g.mu));
    add("gravity.central.centre", text_of(g.centre) + " m");
    add("gravity.central.gradient", g.gradient ? "true" : "false");
  }
  if (g.kind == GravitySpec::Kind::field) {
    add("gravity.field", sum_of(g.fields));
    add("gravity.gradient", g.gradient ? "true" : "false");
  }
  for (std::size_t i = 0; i < m.spec->fields.size(); ++i) {
    const FieldSpec& f = m.spec->fields[i];
    const std::string path = "fields." + f.name + ".";
    add(path + "type", f.type);
    add(path + "outside", f.hold ? "hold" : "refuse");
    for (const auto& [name, value] : f.params)
      add(path + name, text_of(value) + parameter_unit(schema_of(m.fields[i].source->family), name));
  }
  for (std::size_t i = 0; i < m.user.size(); ++i) {
    const UserBody& u = m.user[i];
    const BodySpec& b = m.spec->bodies[i];
    const std::string path = "bodies." + u.name + ".";
    add(path + "type", u.type);
    add(path + "mass", fmt::format("{:.10g} kg", u.mass));
    if (!b.modal && u.mass > 0) {
      const RigidInertia<double>& M = u.M;
      const Eigen::Vector3d c = to_eigen(M.h) / M.m;
      const Eigen::Matrix3d J = to_eigen(M.J) - M.m * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
      add(path + "com", text_of(c) + " m");
      add(path + "inertia", fmt::format("xx {:.10g}, yy {:.10g}, zz {:.10g}, xy {:.10g}, xz {:.10g}, yz {:.10g} kg m^2", J(0, 0), J(1, 1),
                                        J(2, 2), J(0, 1), J(0, 2), J(1, 2)));
    }
    if (b.modal) {
      add(path + "level", std::to_string(b.level));
      add(path + "rotary_inertia", b.rotary_tolerance > 0.0 ? fmt::format("{:g}", b.rotary_tolerance) : "exact");
      add(path + "modal", b.modal->source);
      add(path + "modal_content", b.modal->content_hash);
      for (int j = 0; j < u.n_modes; ++j) {
        const double w = std::sqrt(b.modal->K(j, j) / b.modal->integrals.I6(j, j));
        add(fmt::format("{}modes[{}]", path, j), fmt::format("{:.8g} Hz, damping {:.4g}", w / (2 * std::numbers::pi),
                                                             w > 0 ? b.modal->C(j, j) / (2 * w * b.modal->integrals.I6(j, j)) : 0.0));
      }
    }
    for (const auto& [name, value] : b.params) add(path + name, text_of(value) + parameter_unit(schema_of(u.family), name));
    const std::string hinge = path + "hinge.";
    add(hinge + "type", b.hinge.locked ? u.hinge_type + ", locked" : u.hinge_type);
    add(hinge + "to", u.parent < 0 ? "world" : m.user[static_cast<std::size_t>(u.parent)].name);
    for (const auto& [node, pose] : {std::pair{"onode", u.onode}, {"pnode", u.pnode}}) {
      add(hinge + node, text_of(pose.p) + " m");
      if (const Eigen::Matrix3d R = to_eigen(pose.R); R != Eigen::Matrix3d::Identity())
        add(fmt::format("{}{}.orientation", hinge, node), "rows " + text_of(R));
    }
    for (const auto& [name, value] : b.hinge.params) add(hinge + name, text_of(value) + parameter_unit(schema_of(u.hinge), name));
    if (b.hinge.factor != HingeFactor::cholesky) add(hinge + "factor", hinge_factors()[static_cast<std::size_t>(b.hinge.factor)]);
    for (const int c : b.hinge.prescribed) add(hinge + "prescribed", u.v_names[static_cast<std::size_t>(c)]);
    for (const HingeLoad& s : m.loads)
      if (s.v >= u.v && s.v < u.v + u.nv) {
        const auto component = static_cast<std::size_t>(s.v - u.v);
        const auto [name, text] = load_text(s, u.v_units[component] == "m/s");
        add(fmt::format("{}{}.{}", hinge, name, u.v_names[component]), text);
      }
    for (const NodeSpec& n : b.nodes) {
      add(fmt::format("{}nodes.{}.position", path, n.name), text_of(n.position) + " m");
      if (n.R_BN != Eigen::Matrix3d::Identity()) add(fmt::format("{}nodes.{}.orientation", path, n.name), "rows " + text_of(n.R_BN));
    }
  }
  for (std::size_t i = 0; i < m.loops.all.size(); ++i) {
    const Loop& l = m.loops.all[i];
    const LoopSpec& spec = m.spec->loops[static_cast<std::size_t>(l.spec)];
    const std::string path = "loops." + l.name + ".";
    add(path + "type", l.type);
    if (spec.prescribed) add(path + "prescribed", "true");
    if (l.closing == Closing::coupling) {
      for (const LoopSpec::Term& term : spec.terms) add(path + "terms." + term.target, fmt::format("{:.10g}", term.coefficient));
      for (std::size_t k = 0; k < spec.functions.size(); ++k)
        add(fmt::format("{}functions[{}]", path, k), function_text(spec.functions[k]));
      add(path + "offset", fmt::format("{:.10g}", spec.offset));
      continue;
    }
    add(path + "from", place_text(spec.from));
    add(path + "to", place_text(spec.to));
    if (l.closing == Closing::distance) add(path + "length", fmt::format("{:.10g} m", spec.length));
    for (const auto& [name, value] : spec.params) add(path + name, text_of(value) + parameter_unit(schema_of(l.hinge), name));
  }
  for (const Device& d : m.devices.all) {
    const DeviceSpec& spec = m.spec->devices[static_cast<std::size_t>(d.spec)];
    const std::string path = fmt::format("devices.{}.", d.name);
    const std::vector<cardan_param_desc> schema = schema_where(turns(m, d), *d.family);
    add(path + "type", d.family->type);
    for (const auto& [name, mount] : spec.mounts) add(path + name, place_text(mount.target, mount.position, mount.R));
    for (const auto& [name, value] : spec.params) add(path + name, text_of(value) + parameter_unit(schema, name));
    if (spec.rate > 0.0) add(path + "rate", fmt::format("{:.10g} Hz", spec.rate));
    if (spec.period > 0.0) add(path + "period", fmt::format("{:.10g} s", spec.period));
    if (spec.offset != 0.0) add(path + "offset", fmt::format("{:.10g} s", spec.offset));
    for (const auto& [name, input] : spec.inputs) add(path + "inputs." + name, input_text(input));
    for (const auto& [name, value] : spec.initial) add(path + "initial." + name, text_of(value));
  }
  return all;
}

std::string integrator_text(const SimulationOptions& options) {
  const IntegratorOptions& i = options.integrator;
  const std::string velocities =
      options.dynamics == Dynamics::standard ? std::string() : fmt::format(", {} dynamics", name_of(options.dynamics));
  if (i.fixed_step > 0) return fmt::format("{}, step {:g} s{}", i.method, i.fixed_step, velocities);
  std::string text = i.method;
  if (!i.linear_solver.empty()) text += fmt::format(", {} linear solver", i.linear_solver);
  text += fmt::format(", relative tolerance {:g}", i.relative_tolerance);
  if (options.absolute_tolerance > 0) text += fmt::format(", absolute tolerance {:g}", options.absolute_tolerance);
  if (i.max_step > 0) text += fmt::format(", largest step {:g} s", i.max_step);
  return text + velocities;
}

std::string sweep_program(const Model& m, const State& state) { return program_text(m, soa::op_costs(m, state), false); }

Json moved_at_start(const std::vector<MovedAtStart>& moved) {
  Json out = Json::array();
  for (const MovedAtStart& x : moved) out.push_back({{"name", x.name}, {"unit", x.unit}, {"given", x.given}, {"found", x.found}});
  return out;
}

Json describe(Simulation& sim, bool measured, int n_modes) {
  const Model& m = sim.model();
  std::vector<soa::OpCost> costs = soa::op_costs(m, sim.state());
  if (measured) measure(sim, costs);
  return {{"vehicle", m.name},
          {"integrator", integrator_text(sim.options())},
          {"n_q", m.nq},
          {"n_v", m.nv},
          {"bodies", bodies(m)},
          {"masses", masses(sim)},
          {"modes", modes(m)},
          {"system_modes", modes_worth_telling(sim, n_modes)},
          {"gravity", gravity_text(m.gravity)},
          {"fields", fields(m)},
          {"devices", devices(m)},
          {"faults", faults(sim)},
          {"loops", loops(sim)},
          {"program", program_text(m, costs, measured)},
          {"workspace_bytes", soa::workspace_bytes(m)},
          {"ops", ops(m, costs, measured)},
          {"not_modelled", not_modelled(m)}};
}

}  // namespace cardan
