#include "scripts/precision/settings.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

#include "core/base/diagnostic.hpp"
#include "core/base/units.hpp"

namespace cardan {
namespace {

constexpr double kTightest = 1e-14;  // of make_integrator
constexpr std::size_t kMostRungs = 100;
constexpr double kMostSteps = 5e6;
constexpr std::size_t kUsualSteps = 6;

[[noreturn]] void wrong_ladder(const char* option, std::string expected, std::string got) {
  refuse(Code::command_line, {option}, std::move(expected), std::move(got), "docs/precision.md");
}

std::vector<std::string> parts(const std::string& text, char between) {
  std::vector<std::string> out;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, between);) out.push_back(part);
  if (!text.empty() && text.back() == between) out.emplace_back();
  return out;
}

/// Of `text` from the largest to the smallest. `factor`: between two rungs where their number is not given.
std::vector<double> ladder(const char* option, const std::string& text, double factor, const char* form, const char* range, double least,
                           double most) {
  const auto number = [&](const std::string& part) {
    const auto x = parse_number(part);
    if (!x) wrong_ladder(option, form, in_quotes(text));
    if (!(*x >= least && *x < most)) wrong_ladder(option, range, part);
    return *x;
  };
  std::vector<double> out;
  if (text.find(':') == std::string::npos) {
    for (const std::string& part : parts(text, ',')) out.push_back(number(part));
    if (out.empty()) wrong_ladder(option, form, in_quotes(text));
  } else {
    const std::vector<std::string> ends = parts(text, ':');
    if (ends.size() > 3 || ends.size() < 2) wrong_ladder(option, form, in_quotes(text));
    double from = number(ends[0]), to = number(ends[1]);
    if (from < to) std::swap(from, to);
    if (ends.size() == 3) {
      const auto n = parse_number(ends[2]);
      if (!n || !(*n >= 2.0 && *n <= kMostRungs) || *n != std::floor(*n))
        wrong_ladder(option, fmt::format("a number of rungs from 2 to {}", kMostRungs), in_quotes(ends[2]));
      for (double i = 0.0; i < *n; i += 1.0) out.push_back(from * std::pow(to / from, i / (*n - 1.0)));
      out.back() = to;
    } else {
      for (double x = from; x > to * 1.0001 && out.size() <= kMostRungs; x /= factor) {
        // the nearest short decimal: 1e-5 and not 1.0000000000000001e-05
        out.push_back(parse_number(fmt::format("{:.12g}", x)).value_or(x));
      }
      out.push_back(to);
    }
  }
  std::ranges::sort(out, std::greater<>());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  if (out.size() > kMostRungs) wrong_ladder(option, fmt::format("at most {} rungs", kMostRungs), in_quotes(text));
  return out;
}

}  // namespace

std::string PrecisionSetting::solver() const { return linear_solver.empty() ? method : method + "/" + linear_solver; }

std::string PrecisionSetting::name() const {
  return formulation.name == Formulation::kStandard ? solver() : solver() + "+" + formulation.name;
}

std::string PrecisionSetting::rung() const { return adaptive ? fmt::format("{:g}", relative) : fmt::format("{:.4g} s", step); }

Sets PrecisionSetting::sets(const PrecisionSetting& own) const {
  const auto number = [](double x) { return fmt::format("{}", x); };  // gives the same bits back
  Sets out = {{"method", method}};
  if (!linear_solver.empty() || !own.linear_solver.empty()) out.emplace_back("linear_solver", linear_solver);
  if (adaptive) {
    out.emplace_back("relative", number(relative));
    out.emplace_back("absolute", number(absolute));
    for (const auto& [kind, value] : by_kind) out.emplace_back("tolerances." + kind, number(value));
    if (!own.adaptive) out.emplace_back("step", "0");
  } else {
    out.emplace_back("step", number(step));
    if (own.adaptive) out.insert(out.end(), {{"max_step", "0"}, {"initial_step", "0"}});
  }
  for (auto& [key, value] : out) key = "mission.integrator." + key;
  for (const Sets* more : {&formulation.sets, &model}) out.insert(out.end(), more->begin(), more->end());
  return out;
}

PrecisionSetting own_setting(const IntegratorOptions& own, double absolute, std::vector<std::pair<std::string, double>> by_kind) {
  PrecisionSetting out;
  out.method = own.method;
  for (const MethodKind& kind : integration_methods())
    if (kind.name == own.method) {
      out.adaptive = kind.adaptive;
      if (!kind.linear_solvers.empty() && !kind.automatic)
        out.linear_solver = own.linear_solver.empty() ? kind.linear_solvers.front() : own.linear_solver;
    }
  if (out.adaptive)
    out.relative = own.relative_tolerance, out.absolute = absolute > 0.0 ? absolute : own.relative_tolerance,
    out.by_kind = std::move(by_kind);
  else
    out.step = own.fixed_step;
  return out;
}

std::vector<PrecisionSetting> precision_methods(const std::vector<std::string>& names) {
  std::vector<PrecisionSetting> all;
  for (const MethodKind& kind : integration_methods()) {
    if (kind.linear_solvers.empty() || kind.automatic) {
      all.push_back({.method = kind.name, .linear_solver = "", .adaptive = kind.adaptive});
      continue;
    }
    for (const std::string& solver : kind.linear_solvers)
      all.push_back({.method = kind.name, .linear_solver = solver, .adaptive = kind.adaptive});
  }
  if (names.empty()) {
    std::erase_if(all, [](const PrecisionSetting& s) {
      return std::ranges::any_of(integration_methods(), [&](const MethodKind& kind) { return kind.extended && kind.name == s.method; });
    });
    return all;
  }
  std::vector<std::string> legal;
  for (const PrecisionSetting& s : all) legal.push_back(s.name());
  std::vector<PrecisionSetting> out;
  for (const std::string& name : names) {
    const std::size_t before = out.size();
    for (const PrecisionSetting& s : all)
      if (s.name() == name || s.method == name) out.push_back(s);
    if (out.size() == before)
      refuse(Code::command_line, {"--methods"}, fmt::format("a method: {}", fmt::join(legal, ", ")), in_quotes(name),
             did_you_mean(name, legal));
    for (std::size_t i = 0; i < before; ++i)
      for (std::size_t j = before; j < out.size(); ++j)
        if (out[i] == out[j]) refuse(Code::command_line, {"--methods"}, "each method once", in_quotes(out[i].name()));
  }
  return out;
}

std::vector<Formulation> formulations_named(const std::vector<std::string>& names, const std::vector<Formulation>& there) {
  std::vector<Formulation> out;
  std::vector<std::string> legal;
  for (const Formulation& f : there) legal.push_back(f.name);
  for (const std::string& name : names) {
    if (name == "all") {
      if (names.size() > 1) refuse(Code::command_line, {"--formulations"}, "each formulation once", "\"all\" beside others");
      return there;
    }
    const auto found = std::ranges::find(there, name, &Formulation::name);
    if (found == there.end())
      refuse(Code::command_line, {"--formulations"}, fmt::format("all, or a formulation that the scene has: {}", fmt::join(legal, ", ")),
             in_quotes(name), did_you_mean(name, legal));
    if (std::ranges::find(out, name, &Formulation::name) != out.end())
      refuse(Code::command_line, {"--formulations"}, "each formulation once", in_quotes(name));
    out.push_back(*found);
  }
  return out;
}

std::vector<double> tolerance_ladder(const std::string& text) {
  return ladder("--tolerances", text, 10.0, "tolerances: 1e-4:1e-12, 1e-4:1e-12:17 or 1e-4,1e-7", "numbers from 1e-14 to 1", kTightest,
                1.0);
}

std::vector<double> step_ladder(const std::string& text) {
  return ladder("--steps", text, 2.0, "steps in s: 0.1:0.001, 0.1:0.001:5 or 0.1,0.02", "times > 0 s, below 1e9 s", 1e-12, 1e9);
}

std::vector<double> usual_steps(double rate, double period, double duration) {
  double step = std::min(period, duration);
  if (rate > 0.0) step = std::min(step, 2.0 / rate);
  step = parse_number(fmt::format("{:.2g}", step)).value_or(step);
  std::vector<double> out;
  for (std::size_t i = 0; i < kUsualSteps && (i == 0 || duration / step <= kMostSteps); ++i, step /= 2.0) out.push_back(step);
  return out;
}

PrecisionSetting with_tolerance(PrecisionSetting setting, double relative, const PrecisionSetting& own) {
  setting.relative = relative;
  const double ratio = own.adaptive && own.relative > 0.0 ? own.absolute / own.relative : 1.0;
  setting.absolute = std::min(1.0, ratio == 1.0 ? relative : ratio * relative);
  setting.by_kind = own.by_kind;
  if (relative != own.relative)
    for (auto& [kind, value] : setting.by_kind) value *= relative / own.relative;
  return setting;
}

std::vector<PrecisionSetting> precision_grid(const std::vector<PrecisionSetting>& methods, const std::vector<double>& tolerances,
                                             const std::vector<double>& steps, const PrecisionSetting& own) {
  std::vector<PrecisionSetting> out;
  for (const PrecisionSetting& m : methods)
    if (m.adaptive) {
      for (const double relative : tolerances) out.push_back(with_tolerance(m, relative, own));
    } else {
      for (const double step : steps) {
        out.push_back(m);
        out.back().step = step;
      }
    }
  return out;
}

}  // namespace cardan
