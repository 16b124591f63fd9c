// Where a result comes from, and what the model holds, as text.
#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "core/base/version.hpp"
#include "core/sim/mode_pictures.hpp"
#include "core/soa/cost.hpp"
#include "core/soa/kernels.hpp"
#include "scripts/mission/mission_run.hpp"

namespace cardan {
namespace {

std::string text_of(const Vec3<double>& a) { return fmt::format("[{:.10g}, {:.10g}, {:.10g}]", a.x, a.y, a.z); }

std::string text_of(const Eigen::Vector3d& a) { return text_of(from_eigen(a)); }

std::string text_of(const ParamValue& p) {
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

std::string text_of(const Eigen::Matrix3d& R) {
  return fmt::format("[{}, {}, {}]", text_of(Eigen::Vector3d(R.row(0))), text_of(Eigen::Vector3d(R.row(1))), text_of(Eigen::Vector3d(R.row(2))));
}

std::string seconds(const Rational& period) {
  return period.denominator == 1 ? fmt::format("{} s", period.numerator) : fmt::format("{}/{} s", period.numerator, period.denominator);
}

/// Value and unit as one text: "0.5 rad/s"; "1" is no unit.
std::string quantity(double x, const std::string& unit) { return unit.empty() || unit == "1" ? fmt::format("{}", x) : fmt::format("{} {}", x, unit); }

/// In the words of the schema of its family.
std::string parameter_unit(const cardan_hinge_family& family, const std::string& name) {
  for (std::uint32_t i = 0; i < family.n_params; ++i)
    if (name == family.params[i].name) return family.params[i].unit && *family.params[i].unit && family.params[i].unit != std::string_view("1") ? std::string(" ") + family.params[i].unit : std::string();
  return {};
}

std::string integrator_text(const SimulationOptions& options) {
  const IntegratorOptions& i = options.integrator;
  if (i.fixed_step > 0) return fmt::format("{}, step {:g} s", i.method, i.fixed_step);
  std::string text = i.method;
  if (!i.linear_solver.empty()) text += fmt::format(", {} linear solver", i.linear_solver);
  text += fmt::format(", relative tolerance {:g}", i.relative_tolerance);
  if (options.absolute_tolerance > 0) text += fmt::format(", absolute tolerance {:g}", options.absolute_tolerance);
  if (i.max_step > 0) text += fmt::format(", largest step {:g} s", i.max_step);
  return text;
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
  for (std::size_t i = 0; i < m.user.size(); ++i) {
    const UserBody& u = m.user[i];
    const BodySpec& b = m.spec->bodies[i];
    const std::string path = "bodies." + u.name + ".";
    add(path + "type", u.type);
    add(path + "mass", fmt::format("{:.10g} kg", u.mass));
    if (!b.modal && u.mass > 0) {
      const RigidInertia<double>& M = u.M;
      const Eigen::Vector3d c = to_eigen(M.h) / M.m;
      const Eigen::Matrix3d J =
          to_eigen(M.J) - M.m * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
      add(path + "com", text_of(c) + " m");
      add(path + "inertia", fmt::format("xx {:.10g}, yy {:.10g}, zz {:.10g}, xy {:.10g}, xz {:.10g}, yz {:.10g} kg m^2",
                                        J(0, 0), J(1, 1), J(2, 2), J(0, 1), J(0, 2), J(1, 2)));
    }
    if (b.modal) {
      add(path + "level", std::to_string(b.level));
      add(path + "modal", b.modal->source);
      add(path + "modal_content", b.modal->content_hash);
      for (int j = 0; j < u.n_modes; ++j) {
        const double w = std::sqrt(b.modal->K(j, j) / b.modal->integrals.I6(j, j));
        add(fmt::format("{}modes[{}]", path, j),
            fmt::format("{:.8g} Hz, damping {:.4g}", w / (2 * std::numbers::pi),
                        w > 0 ? b.modal->C(j, j) / (2 * w * b.modal->integrals.I6(j, j)) : 0.0));
      }
    }
    const std::string hinge = path + "hinge.";
    add(hinge + "type", b.hinge.locked ? u.hinge_type + ", locked" : u.hinge_type);
    add(hinge + "to", u.parent < 0 ? "world" : m.user[static_cast<std::size_t>(u.parent)].name);
    add(hinge + "onode", text_of(u.onode.p) + " m");
    add(hinge + "pnode", text_of(u.pnode.p) + " m");
    for (const auto& [name, value] : b.hinge.params) add(hinge + name, text_of(value) + (u.hinge ? parameter_unit(*u.hinge, name) : ""));
    for (const int c : b.hinge.prescribed) add(hinge + "prescribed", u.v_names[static_cast<std::size_t>(c)]);
    for (const Spring& s : m.springs)
      if (s.v >= u.v && s.v < u.v + u.nv) {
        const auto component = static_cast<std::size_t>(s.v - u.v);
        const bool slides = u.v_units[component] == "m/s";
        add(fmt::format("{}spring.{}", hinge, u.v_names[component]),
            fmt::format("stiffness {:.10g} {}, rest {:.10g} {}, damping {:.10g} {}", s.stiffness, slides ? "N/m" : "N m/rad", s.rest,
                        slides ? "m" : "rad", s.damping, slides ? "N s/m" : "N m s/rad"));
      }
    for (const NodeSpec& n : b.nodes) {
      add(fmt::format("{}nodes.{}.position", path, n.name), text_of(n.position) + " m");
      if (n.R_BN != Eigen::Matrix3d::Identity()) add(fmt::format("{}nodes.{}.orientation", path, n.name), "rows " + text_of(n.R_BN));
    }
  }
  return all;
}

std::string sweep_program(const Model& m, const State& state, bool measured) {
  std::vector<soa::OpCost> costs = soa::op_costs(m, state);
  if (measured) soa::measure(m, state, costs);
  const auto time = [&](double ns) { return measured ? fmt::format("{:>8.0f}", ns) : std::string(); };
  std::string text = fmt::format("{:<52}{:>8}{:>8}{:>8}{:>9}{}  bodies\n", "", "bodies", "flops", "sin/cos", "bytes", measured ? "      ns" : "");
  soa::OpCost sum;
  sum.ns = 0.0;
  for (std::size_t i = 0; i < costs.size(); ++i) {
    const soa::OpCost& cost = costs[i];
    std::string bodies = m.program[i].kernel == Kernel::refine ? m.refinement : std::string();
    if (const int r = m.program[i].run; r >= 0)
      for (const UserBody& u : m.user)
        if (!u.merged && u.sweep >= m.runs[static_cast<std::size_t>(r)].begin &&
            u.sweep < m.runs[static_cast<std::size_t>(r)].end)
          bodies += (bodies.empty() ? "" : ", ") + u.name;
    text += fmt::format("{:<52}{:>8}{:>8}{:>8}{:>9}{}  {}\n", cost.name, cost.bodies, cost.flops, cost.functions, cost.bytes, time(cost.ns), bodies);
    sum.flops += cost.flops, sum.functions += cost.functions, sum.ns += cost.ns;
  }
  return text + fmt::format("{:<60}{:>8}{:>8}{:>9}{}  (bytes: all working memory)\n", "one evaluation of v'", sum.flops, sum.functions,
                            soa::workspace_bytes(m), time(sum.ns));
}

std::vector<std::pair<std::string, std::string>> initial_values(const Model& m, const State& state) {
  std::vector<std::pair<std::string, std::string>> all;
  const auto add = [&](const UserBody& u, const std::string& name, double x, const std::string& unit) {
    all.emplace_back(fmt::format("initial.{}.{}", u.name, name), quantity(x, unit));
  };
  for (const UserBody& u : m.user) {
    for (int i = 0; i < u.nq; ++i) add(u, u.q_names[static_cast<std::size_t>(i)], state.q[u.q + i], u.q_units[static_cast<std::size_t>(i)]);
    for (int i = 0; i < u.nv; ++i) add(u, u.v_names[static_cast<std::size_t>(i)], state.v[u.v + i], u.v_units[static_cast<std::size_t>(i)]);
    for (int i = 0; i < u.n_modes; ++i) add(u, fmt::format("eta[{}]", i), state.q[u.eta + i], "");
    for (int i = 0; i < u.n_modes; ++i) add(u, fmt::format("etadot[{}]", i), state.v[u.etadot + i], "1/s");
  }
  return all;
}

std::vector<std::pair<std::string, std::string>> mission_values(const Scenario& s) {
  const MissionSpec& m = s.mission;
  const IntegratorOptions& i = m.simulation.integrator;
  std::vector<std::pair<std::string, std::string>> all;
  const auto add = [&](const char* key, std::string value) { all.emplace_back(fmt::format("mission.{}", key), std::move(value)); };
  const auto names = [](const std::vector<int>& which, const auto& of) {
    std::string text;
    for (const int k : which) text += (text.empty() ? "" : ", ") + of[static_cast<std::size_t>(k)].name;
    return text;
  };
  add("duration", quantity(m.duration, "s"));
  add("integrator.method", i.method);
  if (i.method != "rk4") add("integrator.relative", fmt::format("{}", i.relative_tolerance));
  if (m.simulation.absolute_tolerance > 0) add("integrator.absolute", fmt::format("{}", m.simulation.absolute_tolerance));
  if (!i.linear_solver.empty()) add("integrator.linear_solver", i.linear_solver);
  if (i.initial_step > 0) add("integrator.initial_step", quantity(i.initial_step, "s"));
  if (i.max_step > 0) add("integrator.max_step", quantity(i.max_step, "s"));
  if (i.fixed_step > 0) add("integrator.step", quantity(i.fixed_step, "s"));
  add("output.period", seconds(m.output_period));
  if (!m.reactions.empty()) add("output.reactions", names(m.reactions, s.model->user));
  if (!m.nodes.empty()) add("output.nodes", names(m.nodes, s.model->nodes));
  add("ledger", m.simulation.ledger ? "true" : "false");
  for (const Controller& c : s.controllers) add(("controller." + c.name + ".period").c_str(), seconds(c.period));
  return all;
}

std::string sweeps_name() { return std::string("x86-64-") + soa::kernels().name; }

RunHeader run_header(const Scenario& s) {
  RunHeader h;
  h.scenario = s.file.filename().string();
  h.folder = std::filesystem::absolute(s.file).lexically_normal().parent_path().string();
  h.title = s.mission.title;
  h.program_version = version::kNumber;
  h.commit = version::kCommit;
  h.compiler = version::kCompiler;
  h.flags = version::kFlags;
  h.sweeps = sweeps_name();
  h.sweep_flags = fmt::format("{} -march={} {}", version::kFlags, h.sweeps, version::kSweepFlags);
  h.seed = s.seed;
  for (const Setting& set : s.settings) h.settings.emplace_back(set.key, set.value);
  h.inputs = s.inputs, h.plugins = s.plugins, h.modal_files = s.modal_files;
  h.effective_parameters = effective_parameters(*s.model);
  for (const auto& more : {initial_values(*s.model, s.sim->state()), mission_values(s), s.parameters})
    h.effective_parameters.insert(h.effective_parameters.end(), more.begin(), more.end());
  h.defaults_used = s.model->spec->defaults_used;
  h.defaults_used.insert(h.defaults_used.end(), s.mission.defaults_used.begin(), s.mission.defaults_used.end());
  h.sweep_program = sweep_program(*s.model, s.sim->state());
  h.mode_pictures = mode_pictures(*s.model->spec);
  h.integrator = integrator_text(s.mission.simulation);
  return h;
}

}  // namespace cardan
