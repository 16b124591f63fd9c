#include "scripts/precision/kinds.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "core/io/compare_runs.hpp"

namespace cardan {
namespace {

constexpr PrecisionKind kKinds[] = {
    {"attitude", "rad", "angle of the rotation between the attitudes of a body", false},
    {"position", "m", "distance between the places of a body or node, or of a sliding hinge", false},
    {"angle", "rad", "angle of a hinge", false},
    {"rate", "rad/s", "angular velocity of a body, rate of a hinge", false},
    {"velocity", "m/s", "velocity of a body or node, of a sliding hinge", false},
    {"modes", "1", "modal coordinates of a body, over their largest", false},
    {"forces", "1", "reactions, forces of hinges and of loops, over their largest", false},
    {"signals", "1", "signals of the script, states and ports of devices, over their largest", false},
    {"end", "s", "time at which the run ends", false},
    {"momentum", "1", "residual of the balances of linear and angular momentum", true},
    {"energy", "1", "residual of the balance of energy", true},
    {"constraint", "1", "residual of closed loops, over their size", true},
};

constexpr double kStill = 1e-12;  // of the largest of its kind: what is smaller is zero but for round-off

/// How the error of a channel comes about.
enum class Form { rotation, vector, relative, residual };
struct Part {
  std::size_t kind;
  Form form;
  std::size_t first, count;  // components
};

std::size_t kind(std::string_view name) { return index_of_kind(name); }

/// Parts of a channel that count, by its path and units.
std::vector<Part> parts_of(const Column& c) {
  const std::string_view path = c.path;
  const std::string_view folder = path.substr(0, path.find('/'));
  const std::size_t n = c.components.size();
  const auto ends = [&](std::string_view with) { return path.ends_with(with); };
  const auto unit = [&](const char* text) { return std::ranges::all_of(c.units, [&](const std::string& u) { return u == text; }); };
  if (folder == "bodies" || folder == "nodes") {
    if (ends("/attitude") && n == 4) return {{kind("attitude"), Form::rotation, 0, 4}};
    if (ends("/position")) return {{kind("position"), Form::vector, 0, n}};
    if (ends("/velocity")) return {{kind("velocity"), Form::vector, 0, n}};
    if (ends("/rate")) return {{kind("rate"), Form::vector, 0, n}};
    return {};  // accelerations: jumps of commands are between two instants
  }
  if (folder == "hinges" && !ends("/force")) {
    for (const auto& [text, name] : {std::pair{"rad", "angle"}, {"m", "position"}, {"rad/s", "rate"}, {"m/s", "velocity"}})
      if (unit(text)) return {{kind(name), Form::vector, 0, n}};
    return {{kind("signals"), Form::relative, 0, n}};  // coordinates without unit
  }
  if (folder == "modes") return ends("/eta") ? std::vector<Part>{{kind("modes"), Form::relative, 0, n}} : std::vector<Part>{};
  if (folder == "ledger") return {{kind(ends("/energy") ? "energy" : "momentum"), Form::residual, 0, n}};
  if (path == "loops/residual") return {{kind("constraint"), Form::residual, 0, n}};
  if (path == "loops/power") return {};
  if (folder == "hinges" || folder == "loops" || folder == "reactions") {  // a part for each unit: moments, forces
    std::vector<Part> parts;
    for (std::size_t i = 0; i < n; ++i)
      if (i > 0 && c.units[i] == c.units[i - 1])
        ++parts.back().count;
      else
        parts.push_back({kind("forces"), Form::relative, i, 1});
    return parts;
  }
  std::vector<Part> parts;
  for (std::size_t i = 0; i < n; ++i)
    if (i > 0 && c.units[i] == c.units[i - 1])
      ++parts.back().count;
    else
      parts.push_back({kind("signals"), Form::relative, i, 1});
  if (n == 4 && c.components == std::vector<std::string>{"w", "x", "y", "z"}) parts = {{kind("attitude"), Form::rotation, 0, 4}};
  return parts;
}

const double kInfinite = std::numeric_limits<double>::infinity();

double norm(const double* x, std::size_t n) {
  double sum = 0.0;
  for (std::size_t i = 0; i < n; ++i) sum += x[i] * x[i];
  return std::sqrt(sum);
}

/// Of a - b. What both do not have is no error.
double distance(const double* a, const double* b, std::size_t n) {
  double sum = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    if (std::isnan(a[i]) && std::isnan(b[i])) continue;
    const double d = a[i] == b[i] ? 0.0 : a[i] - b[i];
    sum += d * d;
  }
  return std::isfinite(sum) ? std::sqrt(sum) : kInfinite;
}

/// Angle of the rotation from quaternion b to a, w x y z of any length [rad].
double turn(const double* a, const double* b) {
  bool none_of_a = true, none_of_b = true;
  for (int i = 0; i < 4; ++i) none_of_a &= std::isnan(a[i]), none_of_b &= std::isnan(b[i]);
  if (none_of_a && none_of_b) return 0.0;
  const double w = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  const double v[3] = {b[0] * a[1] - a[0] * b[1] - (b[2] * a[3] - b[3] * a[2]), b[0] * a[2] - a[0] * b[2] - (b[3] * a[1] - b[1] * a[3]),
                       b[0] * a[3] - a[0] * b[3] - (b[1] * a[2] - b[2] * a[1])};
  const double angle = 2.0 * std::atan2(norm(v, 3), std::abs(w));
  return std::isfinite(angle) ? angle : kInfinite;
}

/// The largest finite magnitude of a part of a channel.
double size_of(const Column& c, const Part& part) {
  const std::size_t width = c.components.size();
  double size = 0.0;
  for (std::size_t row = 0; row * width < c.values.size(); ++row) {
    const double x = norm(&c.values[row * width + part.first], part.count);
    if (std::isfinite(x)) size = std::max(size, x);
  }
  return size;
}

/// Error of each instant, the largest of what was added.
struct Sum {
  std::vector<double> of_instant;
  KindError error;
  bool any = false;

  void add(const std::string& channel, std::span<const double> e, double size) {
    if (of_instant.empty()) of_instant.assign(e.size(), 0.0);
    any = true;
    error.size = std::max(error.size, size);
    if (error.channel.empty()) error.channel = channel;
    for (std::size_t i = 0; i < e.size(); ++i) {
      of_instant[i] = std::max(of_instant[i], e[i]);
      if (e[i] > error.largest) error.largest = e[i], error.channel = channel;
    }
  }
  KindError result() {
    double sum = 0.0;  // of squares, over that of the largest: tiny errors do not vanish
    if (error.largest > 0.0 && std::isfinite(error.largest))
      for (const double e : of_instant) sum += (e / error.largest) * (e / error.largest);
    error.l2 = std::isfinite(error.largest)
                   ? error.largest * std::sqrt(sum / static_cast<double>(std::max<std::size_t>(of_instant.size(), 1)))
                   : kInfinite;
    error.final = of_instant.empty() ? 0.0 : of_instant.back();
    return error;
  }
};

}  // namespace

std::span<const PrecisionKind> precision_kinds() { return kKinds; }

std::size_t index_of_kind(std::string_view name) {
  return static_cast<std::size_t>(std::ranges::find_if(kKinds, [&](const PrecisionKind& k) { return name == k.name; }) -
                                  std::begin(kKinds));
}

namespace {
/// The modal coordinates of a run whose body keeps fewer modes than that of the reference: those that are left out are zero.
std::optional<Column> as_wide_as(const Column& truth, const Column& is) {
  const std::size_t n = is.components.size(), width = truth.components.size();
  if (!truth.path.starts_with("modes/") || n >= width || !std::equal(is.components.begin(), is.components.end(), truth.components.begin()))
    return std::nullopt;
  Column out = truth;
  out.values.assign(is.values.size() / n * width, 0.0);
  for (std::size_t i = 0; i < is.values.size(); ++i) out.values[i / n * width + i % n] = is.values[i];
  return out;
}
}  // namespace

std::string_view name_of(ErrorMeasure m) {
  constexpr std::string_view kNames[] = {"final", "l2", "largest"};
  return kNames[static_cast<int>(m)];
}

double value_of(const KindError& e, ErrorMeasure m) {
  return m == ErrorMeasure::final ? e.final : m == ErrorMeasure::l2 ? e.l2 : e.largest;
}

KindErrors errors_of_run(const RunColumns& run, const RunColumns& reference) {
  const CommonRows rows = common_rows(run.times, reference.times);
  std::vector<Sum> sums(std::size(kKinds));
  std::vector<double> largest(std::size(kKinds), 0.0);  // of what is relative, in SI
  for (const Column& truth : reference.columns)
    for (const Part& part : parts_of(truth))
      if (part.form == Form::relative) largest[part.kind] = std::max(largest[part.kind], size_of(truth, part));
  std::vector<double> e(rows.first.size());
  for (const Column& truth : reference.columns) {
    const Column* is = run.find(truth.path);
    if (is == nullptr) continue;
    const auto wider = as_wide_as(truth, *is);
    if (wider) is = &*wider;
    if (is->components != truth.components) continue;
    const std::size_t width = truth.components.size();
    for (const Part& part : parts_of(truth)) {
      const double size = part.form == Form::rotation || part.form == Form::residual ? 1.0 : size_of(truth, part);
      // A moment that symmetry makes zero, a mode that nothing drives: round-off has no digits.
      if (part.form == Form::relative && (size == 0.0 || (part.kind != kind("signals") && size < kStill * largest[part.kind]))) continue;
      for (std::size_t i = 0; i < e.size(); ++i) {
        const double* a = &is->values[rows.first[i] * width + part.first];
        const double* b = &truth.values[rows.second[i] * width + part.first];
        switch (part.form) {
          case Form::rotation:
            e[i] = turn(a, b);
            break;
          case Form::vector:
            e[i] = distance(a, b, part.count);
            break;
          case Form::relative:
            e[i] = distance(a, b, part.count) / size;
            break;
          case Form::residual:
            e[i] = std::isfinite(norm(a, part.count)) ? norm(a, part.count) : kInfinite;
        }
      }
      sums[part.kind].add(truth.path, e, part.form == Form::relative ? 1.0 : size);
    }
  }
  KindErrors out(std::size(kKinds));
  for (std::size_t k = 0; k < out.size(); ++k)
    if (sums[k].any) out[k] = sums[k].result();
  if (!run.times.empty() && !reference.times.empty()) {
    const double off = std::abs(run.times.back() - reference.times.back());
    out[index_of_kind("end")] = KindError{off, off, off, std::max(reference.times.back(), 1e-300), "time"};
  }
  return out;
}

}  // namespace cardan
