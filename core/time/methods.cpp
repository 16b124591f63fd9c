#include "core/time/methods.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

namespace cardan {
namespace {

struct Method {
  std::unique_ptr<Integrator> (*make)(OdeProblem, const IntegratorOptions&);
  std::string name;
  bool adaptive;
  std::vector<std::string> linear_solvers = {};  // the first is taken when none is asked for
};

const std::vector<Method>& methods() {
  static const std::vector<Method> all = {{make_arkode, "ark_explicit", true},
                                          {make_arkode, "ark_imex", true, {"dense"}},
                                          {make_arkode, "ark_implicit", true, {"dense", "krylov"}},
                                          {nullptr, "auto", true, {"dense", "krylov"}},  // Simulation chooses
                                          {make_cvode, "cvode_adams", true},
                                          {make_cvode, "cvode_bdf", true, {"dense", "krylov"}},
                                          {make_dop853, "dop853", true},
                                          {make_dopri5, "dopri5", true},
                                          {make_exponential, "exponential", true},
                                          {make_extended, "extended", true},
                                          {make_ida, "ida", true, {"sparse"}},
                                          {make_multirate, "multirate", true},
                                          {make_rk4, "rk4", false},
                                          {make_variational, "variational", false},
                                          {make_variational, "variational4", false}};
  return all;
}

[[noreturn]] void refuse(Code code, std::string key, std::string expected, std::string got, std::string hint = {}) {
  cardan::refuse(code, {"integrator." + key}, std::move(expected), std::move(got), std::move(hint));
}

const Method& find_method(const std::string& name) {
  std::vector<std::string> legal;
  for (const Method& m : methods()) {
    if (m.name == name) return m;
    legal.push_back(m.name);
  }
  refuse(Code::unsupported, "method", fmt::format("a method: {}", fmt::join(legal, ", ")), fmt::format("\"{}\"", name),
         did_you_mean(name, legal));
}

/// A time of the options: 0 stands for "not given".
void check_time(const Method& m, const char* key, double value, bool fits) {
  if (value == 0.0) return;
  if (!fits)
    refuse(Code::unsupported, key,
           m.adaptive ? fmt::format("no {}: {} chooses its steps", key, m.name) : fmt::format("no {}: {} takes equal steps", key, m.name),
           fmt::format("{:g} s", value), m.adaptive ? "set relative or max_step, or use rk4" : "set step, or use dopri5");
  if (!(value > 0.0)) refuse(Code::out_of_range, key, "a time > 0 s", fmt::format("{:g} s", value));
}

void check_linear_solver(const Method& m, const std::string& name) {
  const auto& legal = m.linear_solvers;
  if (name.empty() || std::find(legal.begin(), legal.end(), name) != legal.end()) return;
  const std::string got = fmt::format("\"{}\"", name);
  if (legal.empty())
    refuse(Code::unsupported, "linear_solver", fmt::format("no linear_solver: {} solves no linear equations", m.name), got,
           "use cvode_bdf");
  refuse(Code::unsupported, "linear_solver", fmt::format("a linear solver: {}", fmt::join(legal, ", ")), got, did_you_mean(name, legal));
}

}  // namespace

std::vector<double> group_weights(const std::vector<int>& group) {
  std::map<int, double> sizes;
  for (const int g : group) sizes[g] += 1.0;
  if (sizes.size() < 2) return {};
  std::vector<double> weights;
  for (const int g : group)
    weights.push_back(std::sqrt(static_cast<double>(group.size()) / (static_cast<double>(sizes.size()) * sizes[g])));
  return weights;
}

std::vector<MethodKind> integration_methods() {
  std::vector<MethodKind> all;
  for (const Method& m : methods()) all.push_back({m.name, m.adaptive, m.make == nullptr, m.make == make_extended, m.linear_solvers});
  return all;
}

bool is_implicit(const std::string& method) {
  return std::ranges::any_of(methods(),
                             [&](const Method& m) { return m.name == method && m.make != nullptr && !m.linear_solvers.empty(); });
}

bool advances_linear_part(const std::string& method) {
  return std::ranges::any_of(methods(),
                             [&](const Method& m) { return m.name == method && (m.make == make_exponential || m.make == make_multirate); });
}

void check_options(const IntegratorOptions& options) {
  const Method& method = find_method(options.method);
  check_time(method, "max_step", options.max_step, method.adaptive);
  check_time(method, "initial_step", options.initial_step, method.adaptive);
  check_time(method, "step", options.fixed_step, !method.adaptive || !method.make);
  check_linear_solver(method, options.linear_solver);
  if (!method.adaptive && options.fixed_step == 0.0)
    refuse(Code::unsupported, "step", fmt::format("a step in seconds, which {} needs", method.name), "nothing");
  const double relative = options.relative_tolerance, least = method.make == make_extended ? 1e-30 : 1e-14;
  if (method.adaptive && !(relative >= least && relative < 1.0))
    refuse(Code::out_of_range, "relative", fmt::format("a number from {:g} on, below 1", least), fmt::format("{:g}", relative));
}

std::unique_ptr<Integrator> make_integrator(OdeProblem problem, const IntegratorOptions& options) {
  check_options(options);
  const Method& method = find_method(options.method);
  if (!method.make) refuse(Code::unsupported, "method", "a method that was chosen (choose_method)", "\"auto\"");
  if (advances_linear_part(method.name) && !problem.linear)
    refuse(Code::unsupported, "method", "a problem that tells its linear part", fmt::format("\"{}\" for one that does not", method.name));
  if (method.make == make_variational && !problem.momenta)
    refuse(Code::unsupported, "method", "a problem that tells its momenta", fmt::format("\"{}\" for one that does not", method.name));
  if (method.make == make_extended && !problem.extended)
    refuse(Code::unsupported, "method", "a problem that tells its motion in more digits", "\"extended\" for one that does not");
  if (method.make == make_ida && !problem.implicit)
    refuse(Code::unsupported, "method", "a problem that tells its implicit form", "\"ida\" for one that does not");
  const auto& absolute = problem.absolute_tolerance;
  if (absolute.size() != static_cast<std::size_t>(problem.n))
    throw std::logic_error("make_integrator: one absolute tolerance per state is needed");
  if (!std::all_of(absolute.begin(), absolute.end(), [](double a) { return a > 0.0; }))
    refuse(Code::out_of_range, "absolute", "positive numbers", fmt::format("{:g}", *std::min_element(absolute.begin(), absolute.end())));
  return (options.rivals.empty() ? method.make : make_alternating)(std::move(problem), options);
}

}  // namespace cardan
