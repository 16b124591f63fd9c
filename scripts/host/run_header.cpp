// Where a result comes from, and what the model holds, as text.
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "core/base/version.hpp"
#include "core/soa/cost.hpp"
#include "scripts/host/run_mission.hpp"

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

std::string file_text(const Scenario& s) {
  std::string text;
  for (const InputFile& f : s.inputs)
    text += fmt::format("==> {} <==\n{}{}", f.name, f.text, f.text.ends_with('\n') ? "\n" : "\n\n");
  return text;
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
    for (const auto& [name, value] : b.hinge.params) add(hinge + name, text_of(value));
    for (const int c : b.hinge.prescribed) add(hinge + "prescribed", u.v_names[static_cast<std::size_t>(c)]);
    for (const Spring& s : m.springs)
      if (s.v >= u.v && s.v < u.v + u.nv)
        add(fmt::format("{}spring.{}", hinge, u.v_names[static_cast<std::size_t>(s.v - u.v)]),
            fmt::format("stiffness {:.10g}, rest {:.10g}, damping {:.10g}", s.stiffness, s.rest, s.damping));
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

RunHeader run_header(const Scenario& s) {
  RunHeader h;
  h.scenario = s.file.filename().string();
  h.title = s.mission.title;
  h.program_version = version::kNumber;
  h.commit = version::kCommit;
  h.compiler = version::kCompiler;
  h.flags = version::kFlags;
  h.seed = s.seed;
  for (const InputFile& f : s.inputs) h.input_hashes.emplace_back(f.name, f.sha256);
  for (const InputFile& f : s.plugins) h.plugins.emplace_back(f.name, f.sha256);
  h.effective_parameters = effective_parameters(*s.model);
  h.effective_parameters.insert(h.effective_parameters.end(), s.parameters.begin(), s.parameters.end());
  h.defaults_used = s.model->spec->defaults_used;
  h.defaults_used.insert(h.defaults_used.end(), s.mission.defaults_used.begin(), s.mission.defaults_used.end());
  h.sweep_program = sweep_program(*s.model, s.sim->state());
  h.spec_text = file_text(s);
  h.integrator = integrator_text(s.mission.simulation);
  return h;
}

}  // namespace cardan
