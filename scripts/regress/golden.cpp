#include "scripts/regress/golden.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "core/base/units.hpp"
#include "core/io/result_folder.hpp"
#include "core/io/yaml_reader.hpp"
#include "core/model/schema.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
using Kind = DocNode::Kind;

constexpr std::size_t kMostReferenceBytes = 200'000;  // of all files of a golden file: they live in a repository

const std::vector<std::string> kClasses{"same bits", "round-off", "integration", "truth", "statistical"};

/// "2 GiB", "512 MiB", in bytes.
std::optional<double> parse_size(const std::string& text) {
  for (const auto& [ending, bytes] : {std::pair{" MiB", 0x1p20}, {" GiB", 0x1p30}})
    if (text.ends_with(ending))
      if (const auto number = parse_number(text.substr(0, text.size() - 4))) return *number * bytes;
  return {};
}

class GoldenReader {
 public:
  GoldenReader(Golden& golden, Recorded recorded) : golden_(golden), recorded_(recorded) {}

  void read() {
    golden_.text = text_of(written(golden_.file));
    const DocNode root = parse_yaml(golden_.text, golden_.file.string());
    if (root.kind != Kind::map)
      refuse(Code::wrong_type, {"", {golden_.file.string()}}, "a map that begins with `cardan_golden: 1`", describe(root));
    MapReader map({&root, ""}, context_);
    if (const auto version = map.require("cardan_golden", "the version of the format: 1", "begin the file with `cardan_golden: 1`"))
      if (version->node->text != "1")
        sink_.report(Code::unsupported, version->at(), "1, the only version", describe(*version->node),
                     "`cardan_golden: 1` is all there has been so far; what says otherwise was written for a later Cardan");
    golden_.truth = reason(map, "truth", "where the references come from: a formula, a publication, another program");
    golden_.scenario =
        golden_.folder() / map.text("scenario", "a Lua file, a folder with scenario.lua, or a vehicle beside `script`", "scenario.lua");
    if (std::error_code none; !fs::is_regular_file(golden_.scenario, none) && !fs::is_directory(golden_.scenario, none)) {
      const auto given = map.find("scenario");
      sink_.report(Code::file_not_found, given ? given->at() : Located{"scenario", {golden_.file.string()}},
                   "a Lua file, or a folder with scenario.lua", in_quotes(golden_.scenario.string()));
    }
    if (const auto script = map.find("script")) {
      golden_.script = golden_.folder() / read_text(*script, "a Lua file for the workbench", context_);
      if (std::error_code none; !fs::is_regular_file(golden_.script, none))
        sink_.report(Code::file_not_found, script->at(), "a Lua file for the workbench", in_quotes(golden_.script.string()));
      if (const auto prints = map.require("prints", "what the script prints: {file, class, relative, why}")) read_prints(*prints);
      for (const char* key : {"channels", "figures", "checks", "ledger", "until"})
        if (const auto other = map.find(key))
          sink_.report(Code::unsupported, other->at(), "`prints` alone beside `script`: the workbench writes no results",
                       fmt::format("`{}`", key));
    }
    if (const auto settings = map.find("settings")) {
      if (settings->node->kind != Kind::map)
        sink_.report(Code::wrong_type, settings->at(), "a map: key of --set to its value", describe(*settings->node));
      for (std::size_t i = 0; i < settings->node->keys.size(); ++i)
        golden_.settings.push_back(
            {settings->item(i).at(), settings->node->keys[i].name, read_text(settings->item(i), "a value as --set takes it", context_)});
    }
    if (const auto seed = map.find("seed")) {
      golden_.seed = read_text(*seed, "a whole number", context_);
      if (!parse_seed(golden_.seed))
        sink_.report(Code::out_of_range, seed->at(), "a whole number from 0 to 18446744073709551615", describe(*seed->node));
    }
    if (const auto until = map.find("until")) golden_.until = fmt::format("{}", positive(*until, "s"));
    if (const auto kernels = map.find("kernels"))
      if (const int i = read_choice(*kernels, {"v2", "v3", "v4"}, "an instruction set", Code::unknown_name, context_); i >= 0)
        golden_.kernels = kernels->node->text;
    if (const auto limits = map.find("limits")) read_limits(*limits);
    read_list(map, "channels", [&](const DocRef& item) { read_channel(item); });
    read_list(map, "figures", [&](const DocRef& item) { read_figure(item); });
    read_list(map, "checks", [&](const DocRef& item) {
      golden_.checks.emplace_back(item.at(), read_text(item, "the name of a check of the scenario", context_));
    });
    if (const auto ledger = map.find("ledger")) read_ledger(*ledger);
    read_list(map, "updates", [&](const DocRef& item) {  // what --update noted
      MapReader update(item, context_);
      if (!update.is_map()) return;
      update.text("program", "the program that recorded");
      reason(update, "why", "why the references were recorded anew");
      update.finish();
    });
    if (golden_.script.empty() && golden_.channels.empty() && golden_.figures.empty() && golden_.checks.empty() && sink_.empty())
      sink_.report(Code::missing_key, {"channels", {golden_.file.string()}}, "channels, figures or checks: something that is claimed",
                   "none of them");
    map.finish();
    sink_.throw_if_any();
  }

 private:
  /// A text that says something.
  std::string reason(MapReader& map, const char* key, const char* expected) {
    const auto value = map.require(key, expected);
    if (!value) return {};
    const std::string text = read_text(*value, expected, context_);
    if (value->node->kind == Kind::scalar && text.find_first_not_of(" \n\t") == std::string::npos)
      sink_.report(Code::missing_key, value->at(), expected, "an empty text");
    return text;
  }

  double positive(const DocRef& value, const char* unit) {
    const double number = read_number(value, unit, context_);
    if (number <= 0.0)
      sink_.report(Code::out_of_range, value.at(), fmt::format("more than 0{}", *unit == '1' ? "" : fmt::format(" {}", unit)),
                   describe(*value.node));
    return number;
  }

  template <class Read>
  void read_list(MapReader& map, const char* key, const Read& read) {
    const auto list = map.find(key);
    if (!list) return;
    if (list->node->kind != Kind::list) return sink_.report(Code::wrong_type, list->at(), "a list", describe(*list->node));
    for (std::size_t i = 0; i < list->node->items.size(); ++i) read(list->item(i));
  }

  /// Names of components or columns; none where the key is not there.
  std::vector<std::string> read_names(MapReader& map, const char* key) {
    std::vector<std::string> names;
    read_list(map, key, [&](const DocRef& item) { names.push_back(read_text(item, "a name", context_)); });
    if (const auto list = map.find(key); list && names.empty())
      sink_.report(Code::wrong_type, list->at(), "a list of names: [x, y]", describe(*list->node));
    return names;
  }

  void read_limits(const DocRef& value) {
    MapReader map(value, context_);
    if (!map.is_map()) return;
    for (const auto& [key, seconds] : {std::pair{"time", &golden_.cpu_s}, {"clock", &golden_.clock_s}})
      if (const auto limit = map.find(key))
        if (*seconds = positive(*limit, "s"); *seconds > 1e6)
          sink_.report(Code::out_of_range, limit->at(), "at most 1e6 s", describe(*limit->node));
    golden_.memory = read_size(map, "memory", 64, golden_.memory);
    golden_.file_size = read_size(map, "file", 1, golden_.file_size);
    map.finish();
  }

  /// [bytes]
  std::size_t read_size(MapReader& map, const char* key, int least_mib, std::size_t fallback) {
    const auto value = map.find(key);
    if (!value) return fallback;
    const auto bytes = parse_size(value->node->text);
    if (!bytes)
      sink_.report(Code::wrong_unit, value->at(), "a size: \"2 GiB\" or \"512 MiB\"", describe(*value->node));
    else if (!(*bytes >= least_mib * 0x1p20 && *bytes <= 0x1p40))
      sink_.report(Code::out_of_range, value->at(), fmt::format("from {} MiB to 1024 GiB", least_mib), describe(*value->node));
    else
      return static_cast<std::size_t>(*bytes);
    return fallback;
  }

  /// class, absolute, relative, why. The unit is known; empty: that of each component of a recorded reference.
  void read_claim(MapReader& map, Claim& claim) {
    claim.at = map.ref().at();
    claim.why = reason(map, "why", "why the tolerance is what it is: what the difference may come from");
    int choice = -1;
    if (const auto given = map.require("class", "how near the numbers must be: " + one_of(kClasses)))
      choice = read_choice(*given, kClasses, "a class", Code::unknown_name, context_);
    const auto absolute = map.find("absolute"), relative = map.find("relative");
    if (absolute) claim.tolerance.absolute = read_absolute(*absolute, claim.unit);
    if (relative) claim.tolerance.relative = positive(*relative, "1");
    if (choice < 0) return;
    claim.agreement = static_cast<Agreement>(choice);
    const bool takes_none = claim.agreement == Agreement::same_bits || claim.agreement == Agreement::statistical;
    if (takes_none && (absolute || relative))
      sink_.report(Code::wrong_type, (absolute ? *absolute : *relative).at(),
                   fmt::format("no tolerance beside `class: {}`", name_of(claim.agreement)),
                   describe(*(absolute ? *absolute : *relative).node));
    if (!takes_none && !absolute && !relative)
      sink_.report(Code::missing_key, {claim.at.key_path + ".absolute", claim.at.mark},
                   "absolute, relative or both: how large a difference may be", "neither");
  }

  /// In `unit`: a number with its unit, without one only where the numbers have none either or the unit is that of SI.
  double read_absolute(const DocRef& value, const std::string& unit) {
    if (value.node->kind != Kind::scalar) return read_number(value, unit, context_);
    if (unit.empty()) {  // of a recorded reference that is not there yet, or of several units
      if (recorded_ != Recorded::unread)
        sink_.report(Code::wrong_unit, value.at(), "components of one unit (`components` chooses them), or `relative`", "several units");
      return 1.0;
    }
    const auto known = parse_unit(unit);
    const std::string& text = value.node->text;
    double number = std::nan("");
    if (!known && text.ends_with(" " + unit)) {  // a unit of the script's own
      number = parse_number(text.substr(0, text.size() - unit.size() - 1)).value_or(number);
      if (std::isnan(number)) sink_.report(Code::bad_number, value.at(), fmt::format("a number in {}", unit), describe(*value.node));
    } else if (parse_number(text) && unit != "1") {
      sink_.report(Code::wrong_unit, value.at(), fmt::format("a difference with its unit: \"{} {}\"", text, unit), describe(*value.node));
    } else {
      number = read_number(value, known ? unit : "1", context_) / known.value_or(Unit{}).factor;
    }
    if (number <= 0.0) sink_.report(Code::out_of_range, value.at(), "more than 0", describe(*value.node));
    return number;
  }

  void read_channel(const DocRef& item) {
    MapReader map(item, context_);
    if (!map.is_map()) return;
    GoldenChannel c;
    c.at = item.at();
    c.channel = map.text("channel", "a channel as run.h5 names it below /channels: bodies/bus/rate");
    c.components = read_names(map, "components");
    if (const auto from = map.find("from")) c.from = read_number(*from, "s", context_);
    if (const auto to = map.find("to")) c.to = read_number(*to, "s", context_);
    const std::size_t faults = sink_.all().size();
    const auto reference =
        map.require("reference", "a reference: {times, values, unit}, {final, unit}, {always, unit}, {file} or {recorded}");
    if (reference) read_reference(*reference, c);
    const bool is_known = sink_.all().size() == faults;
    if (is_known && c.width > 0 && !c.components.empty() && c.width != c.components.size())
      sink_.report(Code::wrong_type, reference->at(),
                   fmt::format("rows of {} numbers, one for each of the components", c.components.size()),
                   fmt::format("rows of {}", c.width));
    if (is_known)
      read_claim(map, c);
    else
      for (const char* key : {"class", "absolute", "relative", "why"}) map.find(key);
    if (c.agreement == Agreement::statistical || c.kind == GoldenChannel::Kind::statistics) {
      if (is_known && (c.agreement != Agreement::statistical || c.kind != GoldenChannel::Kind::statistics))
        sink_.report(Code::wrong_type, c.at, "`class: statistical` and a reference {mean, deviation, unit}, both or neither",
                     "one of them");
      c.confidence = map.number("confidence", "1");
      c.independent = map.number("independent", "1");
      if (!(c.confidence > 0.0 && c.confidence < 1.0) && !std::isnan(c.confidence))
        sink_.report(Code::out_of_range, {item.path + ".confidence", c.at.mark}, "a probability between 0 and 1: 0.999",
                     fmt::format("{}", c.confidence));
      const double least = c.deviations.empty() ? 30.0 : 5.0;
      if (c.independent < least)
        sink_.report(Code::out_of_range, {item.path + ".independent", c.at.mark}, fmt::format("at least {:g} independent values", least),
                     fmt::format("{}", c.independent));
    }
    map.finish();
    golden_.channels.push_back(std::move(c));
  }

  void read_reference(const DocRef& value, GoldenChannel& c) {
    MapReader map(value, context_);
    if (!map.is_map()) return;
    const auto kind = map.one({"values", "always", "final", "mean", "file", "recorded"});
    if (!kind) return;
    const auto& [which, numbers] = *kind;
    const bool inline_numbers = which < 4;
    if (inline_numbers) c.unit = map.text("unit", "the unit of the numbers; 1 for none");
    constexpr GoldenChannel::Kind kKinds[] = {GoldenChannel::Kind::rows, GoldenChannel::Kind::always, GoldenChannel::Kind::final,
                                              GoldenChannel::Kind::statistics};
    if (inline_numbers) c.kind = kKinds[which];
    if (which == 0) {
      if (const auto times = map.require("times", "the times of the values: [0, 10, 20] in s")) {
        c.times = read_numbers(*times, "s", 0, context_);
        expect_ascending(*times, c);
      }
      read_rows(numbers, c);
    } else if (inline_numbers) {
      c.values = read_row(numbers);
      c.width = c.values.size();
      if (which == 3)
        if (const auto deviation = map.find("deviation")) {
          c.deviations = read_row(*deviation);
          if (c.deviations.size() != c.width)
            sink_.report(Code::wrong_type, deviation->at(), fmt::format("{} numbers, as of the mean", c.width), describe(*deviation->node));
          if (!std::ranges::all_of(c.deviations, [](double one) { return one > 0.0; }))
            sink_.report(Code::out_of_range, deviation->at(), "deviations of more than 0", describe(*deviation->node));
        }
    } else if (which == 4) {
      read_file(map, numbers, c);
    } else {
      read_recorded(map, numbers, c);
    }
    map.finish();
  }

  /// A number, or a list of them.
  std::vector<double> read_row(const DocRef& value) {
    if (value.node->kind == Kind::scalar) return {read_number(value, "1", context_)};
    return read_numbers(value, "1", 0, context_);
  }

  void read_rows(const DocRef& value, GoldenChannel& c) {
    if (value.node->kind != Kind::list)
      return sink_.report(Code::wrong_type, value.at(), "a list with a row for each time", describe(*value.node));
    if (value.node->items.size() != c.times.size() || c.times.empty())
      sink_.report(Code::wrong_type, value.at(), fmt::format("{} rows, one for each time", c.times.size()), describe(*value.node));
    for (std::size_t i = 0; i < value.node->items.size(); ++i) {
      const std::vector<double> row = read_row(value.item(i));
      if (i == 0) c.width = row.size();
      if (row.size() != c.width)
        sink_.report(Code::wrong_type, value.item(i).at(), fmt::format("{} numbers, as in the first row", c.width),
                     describe(value.node->items[i]));
      c.values.insert(c.values.end(), row.begin(), row.end());
    }
  }

  void expect_ascending(const DocRef& value, const GoldenChannel& c) {
    if (std::ranges::adjacent_find(c.times, [](double a, double b) { return !(a < b); }) != c.times.end())
      sink_.report(Code::out_of_range, value.at(), "times that ascend", "times that do not");
  }

  /// Each further file of a golden file counts once.
  fs::path counted(const fs::path& path) {
    std::error_code none;
    if (files_.insert(path.lexically_normal().string()).second) bytes_ += fs::file_size(path, none);
    if (!none && bytes_ > kMostReferenceBytes)
      refuse(Code::out_of_range, {"", {path.string()}},
             fmt::format("at most {} kB in the references of one golden file", kMostReferenceBytes / 1000),
             fmt::format("{} kB", bytes_ / 1000), "fewer times: a recorded reference keeps every n-th row with `every: n`");
    return path;
  }

  void guarded(const DocRef& value, const std::function<void()>& read) {
    try {
      read();
    } catch (const InputError& e) {
      for (Diagnostic d : e.diagnostics()) {
        if (d.at.mark.line == 0) {
          d.got = d.at.mark.file + (d.at.key_path.empty() ? "" : ":" + d.at.key_path) + ": " + d.got;
          d.at = value.at();
        }
        sink_.report(std::move(d));
      }
    }
  }

  /// A truth in a file: a table, or an HDF5 file in the layout of run.h5.
  void read_file(MapReader& map, const DocRef& value, GoldenChannel& c) {
    const std::string name = read_text(value, "a file: truth.csv or truth.h5", context_);
    const auto given = map.find("columns");
    std::vector<std::string> columns = given ? read_names(map, "columns") : c.components;
    if (name.empty()) return;
    if (name.ends_with(".h5")) {
      const std::string path = map.text("channel", "a channel of that file", c.channel);
      return guarded(value, [&] {
        take(read_run_columns(counted(golden_.folder() / name).string(), [&](const std::string& p) { return p == path; }), path, value, c);
      });
    }
    guarded(value, [&] {
      const Table table = read_table(counted(golden_.folder() / name));
      if (table.names.size() < 2 || table.names[0] != "t")
        refuse(Code::wrong_type, {"", {(golden_.folder() / name).string(), 1}}, "t [s] as the first column, and at least one more",
               table.names[0]);
      const auto unit_of_t = parse_unit(table.units[0]);
      if (!unit_of_t || unit_of_t->dimension != parse_unit("s")->dimension)
        refuse(Code::wrong_unit, {"t", {(golden_.folder() / name).string(), 1}}, "a time: t [s]", in_quotes(table.units[0]));
      if (columns.empty()) columns.assign(table.names.begin() + 1, table.names.end());
      std::vector<std::size_t> indices;
      for (const std::string& column : columns) {
        const auto found = std::ranges::find(table.names, column);
        if (found == table.names.end())
          return sink_.report(Code::unknown_name, (given ? *given : value).at(), "a column of " + name + ": " + one_of(table.names),
                              in_quotes(column), did_you_mean(column, table.names));
        indices.push_back(static_cast<std::size_t>(found - table.names.begin()));
        c.units.push_back(table.units[indices.back()]);
      }
      c.width = columns.size();
      for (std::size_t i = 0; i < table.values.size(); i += table.names.size()) {
        c.times.push_back(table.values[i] * unit_of_t->factor);
        for (const std::size_t k : indices) c.values.push_back(table.values[i + k]);
      }
      if (c.times.empty()) refuse(Code::wrong_type, {"", {(golden_.folder() / name).string()}}, "rows of numbers", "none");
      one_unit(c);
      expect_ascending(value, c);
    });
  }

  fs::path written(const fs::path& file) const { return recorded_ == Recorded::waiting ? name_before(file) : file; }

  void read_recorded(MapReader& map, const DocRef& value, GoldenChannel& c) {
    c.recorded = read_text(value, "a file: reference.h5", context_);
    if (!c.recorded.ends_with(".h5") || c.recorded.find('/') != std::string::npos)
      return sink_.report(Code::wrong_type, value.at(), "a file beside this one: reference.h5", describe(*value.node));
    c.every = map.integer("every", 1, 1);
    if (const int every = every_.emplace(c.recorded, c.every).first->second; every != c.every)
      sink_.report(Code::wrong_type, value.at(), fmt::format("the same `every` for all channels in {}", c.recorded),
                   fmt::format("{} and {}", every, c.every));
    if (recorded_ == Recorded::unread) return;
    const fs::path path = written(golden_.folder() / c.recorded);
    if (std::error_code none; !fs::exists(path, none))
      return sink_.report(Code::file_not_found, value.at(), "the recorded reference", "no such file: " + in_quotes(path.string()),
                          fmt::format("cardan regress DIR --update {} --why \"...\" records it", golden_.name));
    guarded(value, [&] {
      const RunColumns file = read_run_columns(counted(path).string(), [&](const std::string& p) { return p == c.channel; });
      c.compared_sweeps = file.sweeps;
      take(file, c.channel, value, c);
    });
  }

  /// The reference out of a file in the layout of run.h5.
  void take(const RunColumns& file, const std::string& path, const DocRef& value, GoldenChannel& c) {
    const Column* column = file.find(path);
    if (!column) refuse(Code::unknown_name, value.at(), fmt::format("a channel \"{}\" in {}", path, file.file), "none of this name");
    std::vector<std::size_t> indices;
    for (const std::string& name : c.components.empty() ? column->components : c.components) {
      const auto found = std::ranges::find(column->components, name);
      if (found == column->components.end())
        refuse(Code::unknown_name, value.at(), fmt::format("a component of {} in {}: {}", path, file.file, one_of(column->components)),
               in_quotes(name));
      indices.push_back(static_cast<std::size_t>(found - column->components.begin()));
      c.units.push_back(column->units[indices.back()]);
    }
    c.width = indices.size();
    if (c.components.empty()) c.named = column->components;
    c.times = file.times;
    for (std::size_t row = 0; row < file.times.size(); ++row)
      for (const std::size_t k : indices) {
        const double number = column->values[row * column->components.size() + k];
        if (!std::isfinite(number))
          refuse(Code::bad_number, value.at(), "finite numbers",
                 fmt::format("{} in {}, {}, at t = {:g} s", number, file.file, path, file.times[row]), "NaN equals nothing");
        c.values.push_back(number);
      }
    if (c.times.empty()) refuse(Code::wrong_type, value.at(), "rows in " + file.file, "none");
    one_unit(c);
  }

  static void one_unit(GoldenChannel& c) {
    const bool one = std::ranges::all_of(c.units, [&](const std::string& unit) { return unit == c.units.front(); });
    if (one) c.unit = c.units.front();
  }

  void read_figure(const DocRef& item) {
    MapReader map(item, context_);
    if (!map.is_map()) return;
    GoldenFigure f;
    f.name = map.text("figure", "the name of a figure or a check of the scenario");
    f.unit = map.text("unit", "the unit of the value; 1 for none", "1");
    f.value = map.number("value", "1");
    read_claim(map, f);
    if (f.agreement == Agreement::statistical)
      sink_.report(Code::unsupported, f.at, "a class for one number: same bits, round-off, integration or truth", "statistical",
                   "the statistics of a channel: `channels:`");
    map.finish();
    golden_.figures.push_back(std::move(f));
  }

  void read_prints(const DocRef& value) {
    MapReader map(value, context_);
    if (!map.is_map()) return;
    GoldenPrint print;
    print.unit = "1";
    const auto file = map.require("file", "a text: what the script prints");
    if (file) {
      print.file = golden_.folder() / read_text(*file, "a text: what the script prints", context_);
      guarded(*file, [&] { print.text = text_of(counted(print.file)); });
      if (print.text.find_first_not_of(" \t\r\n") == std::string::npos)
        sink_.report(Code::wrong_type, file->at(), "a text: what the script prints", "nothing");
    }
    read_claim(map, print);
    if (print.agreement == Agreement::statistical) sink_.report(Code::unsupported, print.at, "another class for a text", "statistical");
    map.finish();
    golden_.prints = std::move(print);
  }

  void read_ledger(const DocRef& value) {
    MapReader map(value, context_);
    if (!map.is_map()) return;
    GoldenLedger ledger;
    ledger.at = value.at();
    if (const auto bound = map.find("linear_momentum")) ledger.linear_momentum = positive(*bound, "1");
    if (const auto bound = map.find("angular_momentum")) ledger.angular_momentum = positive(*bound, "1");
    if (const auto bound = map.find("energy")) ledger.energy = positive(*bound, "1");
    if (!ledger.linear_momentum && !ledger.angular_momentum && !ledger.energy)
      sink_.report(Code::missing_key, value.at(), "linear_momentum, angular_momentum or energy: a bound", "none of them");
    ledger.why = reason(map, "why", "why the bounds are what they are");
    map.finish();
    golden_.ledger = ledger;
  }

  Golden& golden_;
  Recorded recorded_;
  DiagnosticSink sink_;
  std::vector<std::pair<std::string, std::string>> defaults_;
  ReadContext context_{sink_, defaults_};
  std::set<std::string> files_;
  std::map<std::string, int> every_;  // of recorded references
  std::size_t bytes_ = 0;
};

}  // namespace

std::string text_of(const fs::path& file) {
  std::error_code none;
  if (const fs::file_status is = fs::status(file, none); fs::exists(is) && !fs::is_regular_file(is))
    refuse(Code::file_not_found, {"", {file.string()}}, "a file", "a folder, a pipe or a device");
  return read_text_file(file.string());
}

Golden read_golden(const fs::path& file, const std::string& name, Recorded recorded) {
  Golden golden;
  golden.file = file.lexically_normal();
  golden.name = name;
  GoldenReader(golden, recorded).read();
  return golden;
}

std::vector<std::pair<std::string, fs::path>> find_goldens(const fs::path& folder) {
  std::error_code error;
  std::vector<std::pair<std::string, fs::path>> out;
  constexpr std::string_view kName = "golden.yaml", kEnding = ".golden.yaml";
  const auto name_of_folder = [&](const fs::path& in) {
    const fs::path relative = in.lexically_relative(folder);
    if (relative != "." && !relative.empty()) return relative.generic_string();
    const fs::path whole = fs::absolute(folder).lexically_normal();
    return (whole.has_filename() ? whole : whole.parent_path()).filename().string();
  };
  const auto add = [&](const fs::path& file) {
    const std::string name = file.filename().string();
    if (name.starts_with('.')) return;
    if (name == kName)
      out.emplace_back(name_of_folder(file.parent_path()), file);
    else if (name.ends_with(kEnding))
      out.emplace_back(name_of_folder(file.parent_path()) + "/" + name.substr(0, name.size() - kEnding.size()), file);
  };
  fs::path last = folder;
  for (fs::recursive_directory_iterator i(folder, error), end; i != end; i.increment(error)) {
    last = i->path();
    const std::string name = last.filename().string();
    const bool skipped = name.starts_with('.') || name == "out" || name.starts_with("build");
    if (std::error_code unknown; !i->is_directory(unknown))
      add(last);
    else if (skipped)
      i.disable_recursion_pending();
  }
  if (error) refuse(Code::file_not_found, {"", {last.string()}}, "a folder with scenarios and their golden.yaml", error.message());
  std::ranges::sort(out);
  if (const auto same = std::ranges::adjacent_find(out, {}, [](const auto& one) { return one.first; }); same != out.end())
    refuse(Code::duplicate_name, {"", {(same + 1)->second.string()}}, "a name of its own for each scenario",
           fmt::format("{}, as {} is called", in_quotes(same->first), same->second.string()),
           "the results of one would take the place of the other's");
  return out;
}

}  // namespace cardan
