// Runs cardan-bench and the peers that are built, in turn on the same models (A B A B), and puts their figures side by side.
//   cardan-bench-report [--models DIR] [--only SUBSTRING] [--rounds R] [--seconds S] [--out FILE.json] [--table FILE.md]
//                       [--into DOCUMENT.md]  also between the marks of a document
//                       [--analyses]  cardan-bench-analyses in place of cardan-bench, and what the peers offer of it
//                       [--against BUILD]  instead: the cardan-bench of another build and ours, in turn; ends with 1 where ours is slower
// All on one core. Hard models are for their errors: one round, forward dynamics. Ends with 1 where a result is wrong.
#include <fmt/format.h>
#include <sched.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string_view>
#include <tuple>

#include "bench/command_line.hpp"
#include "bench/pairs.hpp"

namespace cardan::bench {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// Limits of the relative error: ours on any model; of anybody on an ordinary one, where more means that conventions differ.
constexpr double kOurLimit = 1e-12, kLimit = 1e-6;

struct Program {
  std::string name;  // as in its rows
  fs::path file;
};

/// One way to compute one operation on one model, over the rounds.
struct Figure {
  std::string model, op, program, call, reason;  // reason: why there is nothing, or why the result is none
  int bodies = 0;
  double error = -1.0, bytes = -1.0;      // negative: not measured
  std::vector<double> min_ns, median_ns;  // per round; empty: the model was refused
  json row;

  bool ours() const { return program == "cardan"; }
  bool hard() const { return model.rfind("hard_", 0) == 0; }
  double best() const { return *std::min_element(min_ns.begin(), min_ns.end()); }
  double median() const {
    std::vector<double> sorted = median_ns;
    std::sort(sorted.begin(), sorted.end());
    return sorted[sorted.size() / 2];
  }
  std::string name() const { return call == op ? program : program + " " + call; }
};

std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

bool call(const fs::path& program, const std::vector<std::string>& arguments) {
  std::string line = quoted(program.string());
  for (const std::string& a : arguments) line += " " + quoted(a);
  return std::system((line + " >/dev/null").c_str()) == 0;
}

/// The .json files of a folder whose name contains `only`.
std::vector<fs::path> models_of(const fs::path& folder, const std::string& only) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().extension() == ".json" && entry.path().stem().string().find(only) != std::string::npos) files.push_back(entry.path());
  const auto key = [](const fs::path& file) {  // chain_7 before chain_30
    const std::string name = file.stem().string();
    const std::size_t bar = std::min(name.rfind('_'), name.size() - 1);
    return std::make_pair(name.substr(0, bar), std::atoi(name.c_str() + bar + 1));
  };
  std::sort(files.begin(), files.end(), [&](const fs::path& a, const fs::path& b) { return key(a) < key(b); });
  return files;
}

/// A folder of no models: cardan-bench then takes only those that it makes itself.
fs::path nothing_in(const fs::path& scratch) {
  fs::create_directories(scratch / "none");
  return scratch / "none";
}

class Report {
 public:
  Report(fs::path models, std::string only, bool analyses, double seconds, fs::path scratch)
      : models_(std::move(models)), only_(std::move(only)), analyses_(analyses), seconds_(seconds), scratch_(std::move(scratch)) {
    const fs::path here = fs::canonical("/proc/self/exe").parent_path();
    programs_.push_back({"cardan", here / (analyses ? "cardan-bench-analyses" : "cardan-bench")});
    if (fs::is_directory(here / "peers"))
      for (const auto& entry : fs::directory_iterator(here / "peers"))
        if (const std::string name = entry.path().filename().string(); name.rfind("peer-", 0) == 0)
          programs_.push_back({name.substr(5), entry.path()});
    std::sort(programs_.begin() + 1, programs_.end(), [](const Program& a, const Program& b) { return a.name < b.name; });
    files_ = models_of(models_, only_);
    if (files_.empty()) throw std::runtime_error("no model whose name contains \"" + only_ + "\" in " + models_.string());
    fs::create_directories(scratch_);
    if (!call(programs_[0].file, {"--models", models_.string(), "--only", only_, "--exact", scratch_.string()}))
      throw std::runtime_error("cardan-bench gave no exact results");
  }

  void round(int number) {
    for (const fs::path& file : files_) {
      const bool hard = file.stem().string().rfind("hard_", 0) == 0;
      if (hard && number > 0) continue;
      for (const Program& p : programs_) {
        std::vector<std::string> arguments{p.name == "cardan" ? "--models" : "--model", file.string(), "--seconds",
                                           fmt::format("{}", hard ? 0 : seconds_)};
        if (p.name != "cardan" && number == 0) arguments.insert(arguments.end(), {"--exact", (scratch_ / file.filename()).string()});
        if (p.name != "cardan" && analyses_) arguments.emplace_back("--analyses");
        if (p.name != "cardan" && hard) arguments.insert(arguments.end(), {"--op", "forward_dynamics"});
        gather(p, arguments, file.stem().string());
      }
    }
    if (number == 0 && only_.empty() && !analyses_)
      for (const char* made : {"flexible_", "hub_", "wings_", "step_"})
        gather(programs_[0], {"--models", nothing_in(scratch_).string(), "--only", made, "--seconds", fmt::format("{}", seconds_)}, made);
  }

  /// What is wrong, one line each.
  std::string faults() const {
    std::string out;
    for (const Figure& f : figures_) {
      if (!f.ours() && analyses_) continue;  // differences
      const double limit = f.ours() ? kOurLimit : kLimit;
      if (f.error > limit && (f.ours() || !f.hard())) out += fmt::format("{}, {}, {}: error {:.1e}\n", f.model, f.op, f.name(), f.error);
      if (!f.reason.empty() && (f.ours() || (!f.hard() && !f.min_ns.empty())))
        out += fmt::format("{}, {}, {}: {}\n", f.model, f.op, f.name(), f.reason);
    }
    return out;
  }

  json rows() const {
    json list = json::array();
    for (const Figure& f : figures_) {
      json row = f.row;
      if (!f.min_ns.empty()) row.update({{"ns_min", f.best()}, {"ns_median", f.median()}, {"ns_rounds", f.min_ns}});
      list.push_back(row);
    }
    return list;
  }

  std::string markdown() const {
    std::string out = "| program | version | build |\n|---|---|---|\n";
    for (const Program& p : programs_)
      if (const auto f = std::find_if(figures_.begin(), figures_.end(), [&](const Figure& x) { return x.program == p.name; });
          f != figures_.end())
        out += fmt::format("| {} | {} | {} |\n", p.name, f->row.value("version", ""), f->row.value("build", ""));
    out +=
        "\nTimes: ns per call, the minimum. Ratio: theirs over ours, of the minima; in brackets the least and the largest over the "
        "rounds.\n"
        "Error: relative, 2-norm, against 113 bits on the same doubles. B/body: what model and first call took from the heap, over "
        "bodies;\n"
        "of a `Batch` its own memory for each state.\n";
    for (const std::string& op : ops())
      if (!is_step(op)) out += table(op);
    return out + steps() + hard_models() + growth() + refusals();
  }

 private:
  void gather(const Program& program, std::vector<std::string> arguments, const std::string& model) {
    const fs::path out = scratch_ / "rows.out";
    fs::remove(out);
    arguments.insert(arguments.end(), {"--out", out.string()});
    json list;
    if (call(program.file, arguments))
      std::ifstream(out) >> list;
    else
      list = {{{"program", program.name}, {"model", model}, {"reason", "ended with an error"}}};
    for (const json& row : list) {
      const std::string op = row.value("op", ""), name = row.value("call", op);
      auto f = std::find_if(figures_.begin(), figures_.end(), [&](const Figure& x) {
        return x.model == row["model"] && x.op == op && x.program == program.name && x.call == name;
      });
      if (f == figures_.end()) {
        Figure fresh{row["model"], op, program.name, name, row.value("reason", ""), row.value("bodies", 0), -1.0, -1.0, {}, {}, row};
        if (row.contains("forward_error") && row["forward_error"].is_number()) fresh.error = row["forward_error"];
        if (row.contains("bytes_per_body") && row["bytes_per_body"].is_number()) fresh.bytes = row["bytes_per_body"];
        f = figures_.insert(figures_.end(), std::move(fresh));
      }
      if (!row.contains("ns_min")) continue;
      f->min_ns.push_back(row["ns_min"]);
      f->median_ns.push_back(row["ns_median"]);
    }
  }

  std::vector<std::string> ops() const {
    std::vector<std::string> list;
    for (const Figure& f : figures_)
      if (!f.op.empty() && std::find(list.begin(), list.end(), f.op) == list.end()) list.push_back(f.op);
    return list;
  }
  /// Our first figure of the same model and operation: what the others are divided by.
  const Figure* base(const Figure& f) const {
    for (const Figure& x : figures_)
      if (x.ours() && x.model == f.model && x.op == f.op && !x.min_ns.empty()) return &x;
    return nullptr;
  }
  static std::string number(double x) {
    return x < 10 ? fmt::format("{:.2f}", x) : x < 100 ? fmt::format("{:.1f}", x) : fmt::format("{:.0f}", x);
  }
  /// "ratio (least to largest)"
  std::string ratio(const Figure& f) const {
    const Figure* ours = base(f);
    if (!ours || ours == &f) return "-";
    double least = INFINITY, largest = 0.0;
    for (std::size_t r = 0; r < std::min(f.min_ns.size(), ours->min_ns.size()); ++r) {
      least = std::min(least, f.min_ns[r] / ours->min_ns[r]);
      largest = std::max(largest, f.min_ns[r] / ours->min_ns[r]);
    }
    return fmt::format("{} ({} to {})", number(f.best() / ours->best()), number(least), number(largest));
  }
  static std::string error(const Figure& f) { return f.error >= 0 ? fmt::format("{:.1e}", f.error) : f.reason.empty() ? "-" : f.reason; }

  /// One row a model; for each of our calls, and for the fastest of each other program: time (of others as a ratio), error, memory.
  std::string table(const std::string& op) const {
    std::vector<std::string> columns, models;                            // columns: our calls, then programs
    std::map<std::pair<std::string, std::string>, const Figure*> cells;  // model, column
    const auto once = [](std::vector<std::string>& list, const std::string& x) {
      if (std::ranges::find(list, x) == list.end()) list.push_back(x);
    };
    for (const bool ours : {true, false})
      for (const Figure& f : figures_) {
        if (f.op != op || f.hard() || f.min_ns.empty() || f.ours() != ours) continue;
        const std::string column = ours ? f.call : f.program;
        once(columns, column), once(models, f.model);
        const Figure*& cell = cells[{f.model, column}];
        if (!cell || f.best() < cell->best()) cell = &f;
      }
    if (models.empty()) return "";
    std::string head, rule, rows;
    for (const std::string& c : columns) {
      const bool ours = std::ranges::any_of(cells, [&](const auto& x) { return x.first.second == c && x.second->ours(); });
      head += fmt::format(" {}, {} | error | B/body |", c == op ? "ours" : c, ours ? "ns" : "ratio"), rule += "---:|---:|---:|";
    }
    for (const std::string& model : models) {
      rows += "\n| " + model + " |";
      for (const std::string& column : columns) {
        const auto at = cells.find({model, column});
        const Figure* f = at == cells.end() ? nullptr : at->second;
        rows += !f ? " - | - | - |"
                   : fmt::format(" {} | {} | {} |", f->ours() ? number(f->best()) : ratio(*f), error(*f),
                                 f->bytes > 0 ? fmt::format("{:.0f}", f->bytes) : "-");
      }
    }
    return "\n### " + words(op) + "\n\n| model |" + head + "\n|---|" + rule + rows + "\n";
  }
  static bool is_step(const std::string& op) { return op.starts_with("step_"); }
  std::string steps() const {
    std::string rows;
    for (const Figure& f : figures_)
      if (is_step(f.op) && !f.min_ns.empty()) rows += fmt::format("| {} | {} | {} |\n", words(f.op), f.model, number(f.median()));
    return rows.empty() ? "" : "\n### Steps\n\n| | model | ns, median |\n|---|---|---:|\n" + rows;
  }
  static std::string words(std::string op) {
    std::ranges::replace(op, '_', ' ');
    op[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(op[0])));
    return op;
  }

  std::string hard_models() const {
    std::vector<std::string> models, columns;
    std::map<std::pair<std::string, std::string>, std::string> cells;
    std::map<std::string, std::string> refused;  // of model and program
    const auto once = [](std::vector<std::string>& list, const std::string& x) {
      if (std::find(list.begin(), list.end(), x) == list.end()) list.push_back(x);
    };
    for (const Figure& f : figures_) {
      if (!f.hard() || (f.op != "forward_dynamics" && !f.op.empty())) continue;
      once(models, f.model);
      if (f.op.empty()) continue;
      once(columns, f.name());
      cells[{f.model, f.name()}] = error(f);
    }
    if (models.empty()) return "";
    std::string out = "\n### Errors of forward dynamics on hard models\n\n| model |";
    for (const std::string& c : columns) out += " " + c + " |";
    out += "\n|---|";
    for (std::size_t i = 0; i < columns.size(); ++i) out += "---:|";
    for (const std::string& m : models) {
      out += "\n| " + m + " |";
      for (const std::string& c : columns) out += " " + (cells.contains({m, c}) ? cells[{m, c}] : "-") + " |";
    }
    return out + "\n\n\"-\": the model was refused (last section), \"fails\": a result that is not a number.\n";
  }

  /// Exponent of time in the number of bodies between neighbours of a family: chain, tree, flexible chains of equal modes.
  std::string growth() const {
    const auto family = [](const std::string& model) {
      const auto is = [&](const char* prefix) { return model.rfind(prefix, 0) == 0; };
      if (is("flexible_chain_")) return "flexible_chain" + model.substr(model.find("_modes"));
      return is("chain_") || is("tree_") ? model.substr(0, model.rfind('_')) : model;
    };
    std::map<std::string, std::map<int, std::string>> members;  // family, bodies -> model
    for (const Figure& f : figures_)
      if (!f.hard() && f.bodies > 0) members[family(f.model)][f.bodies] = f.model;
    std::string out;
    for (const auto& [name, list] : members) {
      if (list.size() < 2) continue;
      out += out.empty() ? "\n### Growth\n\nExponent of time in the number of bodies; 1 is linear.\n" : "";
      out += "\n| " + name + " |";
      std::string rule = "\n|---|";
      for (auto b = std::next(list.begin()); b != list.end(); ++b)
        out += fmt::format(" {} to {} |", std::prev(b)->first, b->first), rule += "---:|";
      out += rule + "\n";
      std::set<std::pair<std::string, std::string>> seen;
      for (const Figure& row : figures_) {
        if (row.min_ns.empty() || row.hard() || family(row.model) != name || !seen.insert({row.op, row.name()}).second) continue;
        const auto time = [&](const std::string& model) {
          for (const Figure& f : figures_)
            if (f.model == model && f.op == row.op && f.name() == row.name() && !f.min_ns.empty()) return f.best();
          return 0.0;
        };
        out += fmt::format("| {}, {} |", row.op, row.name());
        for (auto b = std::next(list.begin()); b != list.end(); ++b) {
          const auto a = std::prev(b);
          const double from = time(a->second), to = time(b->second);
          out += from > 0 && to > 0 ? fmt::format(" {:.2f} |", std::log(to / from) / std::log(static_cast<double>(b->first) / a->first))
                                    : " - |";
        }
        out += "\n";
      }
    }
    return out;
  }

  std::string refusals() const {
    std::map<std::string, std::vector<std::string>> why;
    for (const Figure& f : figures_)
      if (f.min_ns.empty() && !f.reason.empty()) why[f.program + ": " + f.reason].push_back(f.model);
    std::string out = why.empty() ? "" : "\n### Refused\n\n";
    for (const auto& [reason, models] : why) out += fmt::format("- {} ({})\n", reason, fmt::join(models, ", "));
    return out;
  }

  fs::path models_;
  std::string only_;
  bool analyses_;
  double seconds_;
  fs::path scratch_;
  std::vector<Program> programs_;
  std::vector<fs::path> files_;
  std::vector<Figure> figures_;
};

/// Made by the program itself: what it does with modes, a spacecraft with wings of plates among them, and steps.
constexpr const char* kMade[] = {
    "flexible_chain_10_modes_5", "flexible_chain_10_modes_40", "hub_2x10", "hub_8x10", "flexible_spacecraft", "step_overhead"};

/// The cardan-bench of a build, as it is and with its code laid elsewhere (target bench-placed).
std::vector<fs::path> places_of(const fs::path& build) {
  std::vector<fs::path> programs{build / "cardan-bench"};
  if (!fs::exists(programs[0])) throw std::runtime_error(programs[0].string() + " is not there: build its target cardan-bench first");
  for (int place = 1; fs::exists(build / fmt::format("cardan-bench-placed-{}", place)); ++place)
    programs.push_back(build / fmt::format("cardan-bench-placed-{}", place));
  if (programs.size() == 1)
    fmt::print(stderr, "{} has its code in one place: build its target bench-placed, or some percent may be of where the code lies\n",
               build.string());
  return programs;
}

/// The cardan-bench of `before` and ours in turn, A B A B, each round in another place, on models (--models, --only): a table, 1 where
/// something became slower.
int against(const fs::path& before, const std::vector<std::array<std::string, 2>>& models, int rounds, double seconds,
            const fs::path& scratch) {
  const std::vector<fs::path> programs[] = {places_of(before), places_of(fs::canonical("/proc/self/exe").parent_path())};
  using Key = std::tuple<std::string, std::string, std::string>;  // model, op, call
  std::vector<Key> order;
  std::map<Key, std::array<std::vector<double>, 2>> times;
  fs::create_directories(scratch);
  const fs::path out = scratch / "rows.out";
  for (int r = 0; r < rounds; ++r) {
    fmt::print(stderr, "round {} of {}\n", r + 1, rounds);
    for (const auto& [model, only] : models)
      for (std::size_t p = 0; p < 2; ++p) {
        const fs::path& program = programs[p][static_cast<std::size_t>(r) % programs[p].size()];
        fs::remove(out);
        if (!call(program, {"--models", model, "--only", only, "--seconds", fmt::format("{}", seconds), "--out", out.string()}))
          throw std::runtime_error(program.string() + " ended with an error on " + model + " " + only);
        json list;
        std::ifstream(out) >> list;
        for (const json& row : list) {
          if (!row.contains("ns_min") || row["ns_min"] <= 0.0) continue;  // a difference of times may be nothing
          const Key key{row["model"], row["op"], row.value("call", "")};
          if (!times.contains(key)) order.push_back(key);
          times[key][p].push_back(row["ns_min"]);
        }
      }
  }
  fmt::print("| model | operation | before, ns | after, ns | ratio | spread | |\n|---|---|---:|---:|---:|---:|---|\n");
  int slower = 0;
  for (const Key& key : order) {
    const auto& [a, b] = times[key];
    if (a.size() != b.size()) continue;  // one of the two does not have it
    const Verdict v = judge(a, b);
    const auto& [model, op, variant] = key;
    slower += v.slower;
    fmt::print("| {} | {} | {:.0f} | {:.0f} | {:.3f} | {:.3f} | {} |\n", model, variant.empty() ? op : op + ", " + variant,
               *std::ranges::min_element(a), *std::ranges::min_element(b), v.ratio, v.spread, v.slower ? "slower" : "");
  }
  fmt::print(stderr, "{} of {} figures are more than {:.0f} % slower beyond the spread of their pairs\n", slower, order.size(),
             100 * kAllowed);
  return slower > 0 ? 1 : 0;
}

int run(int argc, char** argv) {
  CommandLine line("Compares Cardan with the peers that are built.");
  std::string models = CARDAN_SOURCE_DIR "/tests/reference/bench", only, out = "bench.json", table = "bench.md", before;
  int rounds = 5;
  double seconds = 0.1;
  bool analyses = false;
  line.option("--models", models, "folder of models in the schema cardan-bench/1");
  line.option("--only", only, "models whose name contains this");
  line.option("--analyses", analyses, "cardan-bench-analyses and what the peers offer of it, in place of dynamics");
  line.option("--rounds", rounds, "how often all programs run in turn");
  line.option("--seconds", seconds, "time spent on each figure and round");
  line.option("--out", out, "the rows");
  line.option("--table", table, "the same for reading");
  line.option("--against", before, "folder of another build: its cardan-bench and ours in turn, ends with 1 where ours is slower");
  if (const auto code = line.parse(argc, argv)) return *code;
  cpu_set_t one;  // the programs inherit it
  CPU_ZERO(&one);
  CPU_SET(sched_getcpu(), &one);
  sched_setaffinity(0, sizeof one, &one);

  if (!before.empty()) {
    const fs::path scratch = fs::canonical("/proc/self/exe").parent_path() / "against";  // nothing is kept
    std::vector<std::array<std::string, 2>> all;
    for (const fs::path& file : models_of(models, only))
      if (file.stem().string().rfind("hard_", 0) != 0) all.push_back({file.string(), ""});
    for (const std::string made : kMade)
      if (made.find(only) != std::string::npos) all.push_back({nothing_in(scratch).string(), made});
    return against(before, all, rounds, seconds, scratch);
  }
  Report report(models, only, analyses, seconds, fs::absolute(out).parent_path() / (fs::path(out).stem().string() + "_exact"));
  for (int r = 0; r < rounds; ++r) {
    fmt::print(stderr, "round {} of {}\n", r + 1, rounds);
    report.round(r);
  }
  std::ofstream(out) << report.rows().dump(1) << "\n";
  std::ofstream(table) << report.markdown();
  fmt::print("{}", report.markdown());
  const std::string faults = report.faults();
  fmt::print(stderr, "{}", faults);
  return faults.empty() ? 0 : 1;
}

}  // namespace
}  // namespace cardan::bench

int main(int argc, char** argv) {
  try {
    return cardan::bench::run(argc, argv);
  } catch (const std::exception& e) {
    fmt::print(stderr, "{}\n", e.what());
    return 2;
  }
}
