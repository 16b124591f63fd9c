#include "scripts/mission/describe_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numbers>

#include "core/linalg/linear_operator.hpp"
#include "core/operators/system_modes.hpp"
#include "core/sim/flexible_limits.hpp"
#include "core/soa/cost.hpp"
#include "scripts/mission/mission_run.hpp"

namespace cardan {
namespace {

constexpr double kRoundOff = 1e-12;  // [kg, kg m^2] effective masses below are shown as zero

Json vector(const Eigen::Vector3d& a) { return {a.x(), a.y(), a.z()}; }

std::string node_name(const std::string& body, const std::string& node) {
  return node.empty() ? body : body + "." + node;
}

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
                   {"prescribed", prescribed}});
  }
  return all;
}

/// Mass, mass centre and inertia of each body and of all; flexible bodies undeformed.
Json masses(Scenario& s) {
  const Model& m = *s.model;
  const Observer& observer = s.sim->observe();
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
    rows.push_back(
        {{"name", m.user[i].name}, {"mass", p.mass}, {"com_body", vector(p.com)}, {"com_world", vector(p.com_W)}});
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

Json ops(const Scenario& s, bool measured) {
  Json all = Json::array();
  std::vector<soa::OpCost> costs = soa::op_costs(*s.model, s.sim->state());
  if (measured) soa::measure(*s.model, s.sim->state(), costs);
  for (const soa::OpCost& op : costs) {
    all.push_back({{"name", op.name}, {"bodies", op.bodies}, {"flops", op.flops}, {"functions", op.functions}, {"bytes", op.bytes}});
    if (measured) all.back()["ns"] = op.ns;
  }
  for (std::size_t i = 0; i < all.size(); ++i)
    if (s.model->program[i].kernel == Kernel::refine) all[i]["reason"] = s.model->refinement;
  return all;
}

Json not_modelled(const Model& m) {
  std::vector<std::string> all;
  if (m.gravity.kind == GravitySpec::Kind::none) all.emplace_back("gravity: none");
  if (m.gravity.kind == GravitySpec::Kind::uniform) all.emplace_back("gravity: uniform, no gradient");
  if (m.gravity.kind == GravitySpec::Kind::central && !m.gravity.gradient)
    all.emplace_back("gravity gradient: none, the force acts at the mass centres");
  for (const BodySpec& b : m.spec->bodies) {
    if (!b.modal || b.modal->n_modes == 0) continue;
    if (b.level == 0) all.push_back(b.name + ": deformation does not change its inertia (level 0)");
    if (b.level == 1) all.push_back(b.name + ": inertia to first order in the deformation (level 1)");
    if (const double w = first_frequency(*b.modal); !has_stiffening(b))
      all.push_back(fmt::format("{}: centrifugal stiffening, of the order of (Omega/omega_1)^2 of the stiffness of its first mode ({:.4g} Hz): 1 % at "
                                "{:.3g} rad/s, all of it at {:.3g} rad/s",
                                b.name, w / (2 * std::numbers::pi), 0.1 * w, w));
  }
  std::string rigid;
  for (const BodySpec& b : m.spec->bodies)
    if (!b.modal) rigid += (rigid.empty() ? "" : ", ") + b.name;
  if (!rigid.empty()) all.push_back("flexibility of " + rigid);
  all.emplace_back("friction at hinges, beyond the dampers given");
  all.emplace_back("forces of the environment: atmosphere, sunlight, magnetic field");
  return all;
}

/// Small vibrations of the assembled system about the initial state, and who takes part most in each.
Json system_modes(const Scenario& s, int elastic) {
  soa::TreeOperators tree(s.model);
  tree.at(s.sim->state().q.data());
  const auto largest = [](const Eigen::VectorXd& shares, const std::vector<std::string>& names) {
    Eigen::Index i = 0;
    const double share = shares.maxCoeff(&i);
    return Json{{"name", names[static_cast<std::size_t>(i)]}, {"share", share}};
  };
  try {
    const soa::SystemModes found = soa::system_modes(tree, {elastic, 0});
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
int modes_worth_telling(const Model& m, int asked) {
  constexpr int kDefault = 10, kSmall = 400;
  if (asked >= 0) return asked;
  const bool springs = std::any_of(m.springs.begin(), m.springs.end(), [](const Spring& s) { return s.stiffness != 0.0; });
  return (springs || m.n_modes > 0) && m.nv <= kSmall ? kDefault : 0;
}

Json warnings(const Warnings& all) {
  Json out = Json::array();
  for (const Warning& w : all.all()) out.push_back(to_json(w));
  return out;
}

std::string gravity_text(const GravitySpec& g) {
  if (g.kind == GravitySpec::Kind::none) return "none";
  if (g.kind == GravitySpec::Kind::uniform)
    return fmt::format("uniform [{:g}, {:g}, {:g}] m/s^2", g.g.x(), g.g.y(), g.g.z());
  return fmt::format("central, mu = {:.10g} m^3/s^2, gradient {}", g.mu, g.gradient ? "on" : "off");
}

std::string listed(const Json& names) {
  return fmt::format("{}", fmt::join(names.get<std::vector<std::string>>(), ", "));
}

}  // namespace

Json describe_model(Scenario& s, bool measured, int n_modes) {
  const Model& m = *s.model;
  n_modes = modes_worth_telling(m, n_modes);
  Json controllers = Json::array(), defaults = Json::object();
  for (const Controller& c : s.controllers)
    controllers.push_back(
        {{"name", c.name},
         {"period_s", static_cast<double>(c.period.numerator) / static_cast<double>(c.period.denominator)}});
  const RunHeader header = run_header(s);
  for (const auto& [key, value] : header.defaults_used) defaults[key] = value;
  return {
      {"vehicle", m.name},
      {"mission", {{"title", s.mission.title}, {"duration_s", s.mission.duration}, {"integrator", header.integrator}}},
      {"controllers", controllers},
      {"n_q", m.nq},
      {"n_v", m.nv},
      {"bodies", bodies(m)},
      {"masses", masses(s)},
      {"modes", modes(m)},
      {"system_modes", n_modes > 0 ? system_modes(s, n_modes) : Json()},
      {"gravity", gravity_text(m.gravity)},
      {"program", measured ? sweep_program(m, s.sim->state(), true) : header.sweep_program},
      {"workspace_bytes", soa::workspace_bytes(m)},
      {"ops", ops(s, measured)},
      {"not_modelled", not_modelled(m)},
      {"warnings", warnings(s.warnings)},
      {"defaults", defaults}};
}

std::string description_text(const Json& d) {
  std::string out = fmt::format("{}\n\nbodies: {} coordinates, {} velocities\n", d["vehicle"].get<std::string>(),
                                d["n_q"].get<int>(), d["n_v"].get<int>());
  for (const Json& b : d["bodies"]) {
    std::string notes;
    const auto note = [&](const std::string& text) { notes += (notes.empty() ? "" : "; ") + text; };
    if (!b["level"].is_null()) note(fmt::format("{} modes, level {}", b["modes"].get<int>(), b["level"].get<int>()));
    if (b["locked"].get<bool>()) note("locked");
    if (b["merged"].get<bool>()) note("merged with the body it is fixed to");
    if (!b["prescribed"].empty()) note("prescribed: " + listed(b["prescribed"]));
    out += fmt::format("  {:<18}{:<16}{:<14} to {:<22}{:>2} dof  {}\n", b["name"].get<std::string>(),
                       b["type"].get<std::string>(), b["hinge"].get<std::string>(), b["to"].get<std::string>(),
                       b["velocities"].size(), notes);
  }

  const Json& masses = d["masses"];
  const auto triple = [](const Json& a) {
    return fmt::format("{:>12.5g}{:>12.5g}{:>12.5g}", a[0].get<double>(), a[1].get<double>(), a[2].get<double>());
  };
  out += fmt::format("\nmasses at the initial state, flexible bodies undeformed\n  {:<18}{:>12}{:>36}\n", "",
                     "mass [kg]", "mass centre, world axes [m]");
  for (const Json& row : masses["bodies"])
    out += fmt::format("  {:<18}{:>12.6g}{}\n", row["name"].get<std::string>(), row["mass"].get<double>(),
                       triple(row["com_world"]));
  out += fmt::format("  {:<18}{:>12.6g}{}\n", "total", masses["total"].get<double>(), triple(masses["com_world"]));
  const char* title = "inertia about the mass centre, world axes [kg m^2]";
  for (const Json& row : masses["inertia_world_about_com"])
    out += fmt::format("  {:<52}{}\n", std::exchange(title, ""), triple(row));

  for (const Json& body : d["modes"]) {
    out += fmt::format("\nmodes of {}: {}\n  {:>4}{:>12}  {:<16}{:>54}  kept\n", body["body"].get<std::string>(),
                       body["source"].get<std::string>(), "", "[Hz]", "kind",
                       "effective mass rx ry rz [kg m^2], x y z [kg]");
    int i = 0;
    std::array<double, 6> kept{};
    for (const Json& mode : body["audit"]) {
      for (std::size_t k = 0; k < 6; ++k)
        if (mode["kept"].get<bool>()) kept[k] += mode["effective_mass"][k].get<double>();
      std::string mass;
      for (const Json& x : mode["effective_mass"])
        mass += fmt::format("{:>9.3g}", x.get<double>() > kRoundOff ? x.get<double>() : 0.0);
      out += fmt::format("  {:>4}{:>12.5g}  {:<16}{}  {}{}\n", ++i, mode["frequency_hz"].get<double>(),
                         mode["kind"].get<std::string>(), mass, mode["kept"].get<bool>() ? "yes" : "no",
                         mode["reason"].get<std::string>().empty() ? "" : ": " + mode["reason"].get<std::string>());
    }
    std::string shares;
    for (std::size_t k = 0; k < 6; ++k) shares += fmt::format("{:>9.3g}", kept[k] > 1e-9 * body["rigid_mass"][k].get<double>() ? 100.0 * kept[k] / body["rigid_mass"][k].get<double>() : 0.0);
    if (i > 0) out += fmt::format("  {:<34}{}  kept, % of the whole body\n", "", shares);
  }

  if (const Json& system = d["system_modes"]; !system.is_null()) {
    out += "\nmodes of the whole about the initial state, at rest, without gravity and preload\n";
    if (system.contains("why_not")) out += "  not found: " + system["why_not"].get<std::string>() + "\n";
    int i = system.value("rigid", 0);
    if (i > 0) out += fmt::format("  1 ... {}: without stiffness\n", i);
    const auto part = [](const Json& p) { return fmt::format("{} {:.0f} %", p["name"].get<std::string>(), 100.0 * p["share"].get<double>()); };
    if (!system.value("modes", Json::array()).empty())
      out += fmt::format("  {:>4}{:>12}{:>12}  {:<32}{}\n", "", "[Hz]", "damping [%]", "most of the motion", "most of the strain");
    for (const Json& mode : system.value("modes", Json::array()))
      out += fmt::format("  {:>4}{:>12.5g}{:>12.3g}  {:<32}{}\n", ++i, mode["frequency_hz"].get<double>(), 100.0 * mode["damping"].get<double>(),
                         part(mode["kinetic"]), part(mode["strain"]));
  }

  out += fmt::format("\ngravity: {}\n\nprogram of sweeps, in order\n", d["gravity"].get<std::string>());
  std::string program = d["program"].get<std::string>();
  for (std::size_t from = 0, to; (to = program.find('\n', from)) != std::string::npos; from = to + 1)
    out += "  " + program.substr(from, to - from) + "\n";
  out += fmt::format("\nintegrator: {}\n", d["mission"]["integrator"].get<std::string>());
  out += "\nnot modelled\n";
  for (const Json& item : d["not_modelled"]) out += "  " + item.get<std::string>() + "\n";
  if (!d["warnings"].empty()) out += "\nwarnings\n";
  for (const Json& w : d["warnings"])
    out += fmt::format("  {} {}: {}\n", w["code"].get<std::string>(), w["path"].get<std::string>(), w["about"].get<std::string>());
  out += d["defaults"].empty() ? "" : "\ndefaults used\n";
  for (const auto& [key, value] : d["defaults"].items())
    out += fmt::format("  {} = {}\n", key, value.get<std::string>());
  return out;
}

std::string modes_line(const Scenario& s) {
  return s.modes_from_cache.empty() ? "" : fmt::format("modes of {}: from the cache\n", fmt::join(s.modes_from_cache, ", "));
}

}  // namespace cardan
