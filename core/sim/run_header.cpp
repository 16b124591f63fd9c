#include "core/sim/run_header.hpp"

#include <fmt/format.h>

#include "core/base/version.hpp"
#include "core/io/sha256.hpp"
#include "core/model/doubts.hpp"
#include "core/sim/description.hpp"
#include "core/sim/mode_pictures.hpp"
#include "core/soa/kernels.hpp"

namespace cardan {
namespace {

std::vector<std::pair<std::string, std::string>> initial_values(const Model& m, const State& state) {
  std::vector<std::pair<std::string, std::string>> all;
  const auto add = [&](const UserBody& u, const std::string& name, double x, const std::string& unit) {
    all.emplace_back(fmt::format("initial.{}.{}", u.name, name), quantity_text(x, unit));
  };
  for (const UserBody& u : m.user) {
    for (int i = 0; i < u.nq; ++i) add(u, u.q_names[static_cast<std::size_t>(i)], state.q[u.q + i], u.q_units[static_cast<std::size_t>(i)]);
    for (int i = 0; i < u.nv; ++i) add(u, u.v_names[static_cast<std::size_t>(i)], state.v[u.v + i], u.v_units[static_cast<std::size_t>(i)]);
    for (int i = 0; i < u.n_modes; ++i) add(u, fmt::format("eta[{}]", i), state.q[u.eta + i], "");
    for (int i = 0; i < u.n_modes; ++i) add(u, fmt::format("etadot[{}]", i), state.v[u.etadot + i], "1/s");
  }
  return all;
}

/// Without those keys of devices that by another one do not apply, as the length of a sphere.
std::vector<std::pair<std::string, std::string>> defaults_used(const Model& m) {
  auto all = m.spec->defaults_used;
  for (const Device& d : m.devices.all)
    for (const std::string& key : keys_not_read(m, d))
      std::erase_if(all, [&](const auto& used) { return used.first == fmt::format("devices.{}.{}", d.name, key); });
  return all;
}

}  // namespace

std::string quantity_text(double x, const std::string& unit) {
  return unit.empty() || unit == "1" ? fmt::format("{}", x) : fmt::format("{} {}", x, unit);
}

std::string sweeps_name() { return std::string("x86-64-") + soa::instruction_set().name; }

RunHeader run_header(const Simulation& sim) {
  const Model& m = sim.model();
  RunHeader h;
  h.program_version = version::kNumber;
  h.commit = version::kCommit;
  h.compiler = version::kCompiler;
  h.flags = version::kFlags;
  h.sweeps = sweeps_name();
  h.sweep_flags = fmt::format("{} -march={} {}", version::kFlags, h.sweeps, version::kSweepFlags);
  if (!m.spec->source_text.empty()) h.inputs = {{m.spec->source_file, sha256(m.spec->source_text), m.spec->source_text}};
  h.effective_parameters = effective_parameters(m);
  const auto values = initial_values(m, sim.state());
  h.effective_parameters.insert(h.effective_parameters.end(), values.begin(), values.end());
  h.defaults_used = defaults_used(m);
  h.sweep_program = sweep_program(m, sim.state());
  h.mode_pictures = mode_pictures(*m.spec);
  h.integrator = integrator_text(sim.options());
  return h;
}

}  // namespace cardan
