#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "bodies/register.hpp"
#include "core/abi/kinds.hpp"
#include "core/abi/plugin_host.hpp"
#include "core/abi/plugin_record.hpp"
#include "core/base/version.hpp"
#include "core/io/json.hpp"
#include "core/io/result_folder.hpp"
#include "core/io/sha256.hpp"
#include "core/soa/kernels.hpp"
#include "hinges/register.hpp"
#include "plugins/devices/register.hpp"
#include "scripts/commands/commands.hpp"
#include "scripts/commands/streams.hpp"

namespace cardan {
namespace {

struct Arguments {
  std::string plugin, out;
  std::uint64_t seed = 1;
  int samples = 1000;
  bool json = false;
};

/// All that a report tells: the same for the same file, program and seed.
struct Examination {
  PluginRecord record;
  std::vector<PluginFamily> families;
  std::string refused;  // why it could not be examined

  bool good() const {
    return refused.empty() && std::ranges::all_of(families, [](const PluginFamily& f) { return f.violations.empty(); });
  }
};

const char* summary_of(const PluginFamily& f) {
  return f.family && f.kind->faults(f.family).empty() ? f.summary.c_str() : "its table is refused";
}

Json to_json(const TriedLaw& t) {
  Json law{{"law", t.law}, {"trials", t.trials}};
  if (t.trials == 0) {
    law["not_tried"] = t.untried;
    return law;
  }
  law["broken"] = t.broken;
  if (t.measured) law["worst_error"] = t.error, law["limit"] = t.limit;
  if (t.measured || t.broken > 0) law["sample"] = t.sample;
  if (!t.where.empty()) law["where"] = t.where;
  return law;
}

Json report(const Arguments& a, const Examination& e) {
  const PluginRecord& r = e.record;
  Json page{{"cardan_plugin_report", 1}, {"file", a.plugin}, {"sha256", sha256_of_file(a.plugin)}};
  if (!r.name.empty()) {
    page["plugin"] = Json{{"name", r.name}, {"version", r.version}, {"licence", r.licence}};
    page["contract"] = fmt::format("{}.{}", r.abi_major, r.abi_minor);
  }
  page["program"] = Json{{"version", version::kNumber},
                         {"commit", version::kCommit},
                         {"contract", fmt::format("{}.{}", CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR)},
                         {"compiler", version::kCompiler},
                         {"instruction_set", fmt::format("x86-64-{}", soa::instruction_set().name)}};
  page["samples"] = a.samples, page["seed"] = a.seed;
  page["families"] = Json::array();
  for (std::size_t i = 0; i < e.families.size(); ++i) {
    const PluginFamily& f = e.families[i];
    Json laws = Json::array();
    for (const TriedLaw& t : r.laws[i]) laws.push_back(to_json(t));
    page["families"].push_back({{"kind", f.kind->word},
                                {"type", f.type},
                                {"summary", summary_of(f)},
                                {"laws", std::move(laws)},
                                {"violations", f.violations},
                                {"obeys", f.violations.empty()}});
  }
  if (!e.refused.empty()) page["refused"] = e.refused;
  page["obeys"] = e.good();
  return page;
}

std::string line_of(const std::string& law, const std::string& trials, const std::string& broken, const std::string& worst,
                    const std::string& where) {
  const std::string line = fmt::format("  {:<64}{:>8}{:>8}  {:<20}{}", law, trials, broken, worst, where);
  return line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
}

std::string text_of(const Json& page) {
  const auto word = [](const Json& value) { return value.get<std::string>(); };
  const Json& program = page["program"];
  std::string text = "Report of cardan check-plugin\n\n";
  const auto row = [&](const char* name, const std::string& value) { text += fmt::format("{:<17}{}\n", name, value); };
  row("file", word(page["file"]));
  row("SHA-256", word(page["sha256"]));
  if (page.contains("plugin")) {
    const Json& plugin = page["plugin"];
    row("plugin", fmt::format("{} {}, licence {}", word(plugin["name"]), word(plugin["version"]), word(plugin["licence"])));
    row("contract", fmt::format("{}, tried by a program of {}", word(page["contract"]), word(program["contract"])));
  }
  row("program", fmt::format("cardan {} ({}), {}", word(program["version"]), word(program["commit"]), word(program["compiler"])));
  row("instruction set", word(program["instruction_set"]));
  row("samples, seed", fmt::format("{}, {}", page["samples"].get<int>(), page["seed"].get<std::uint64_t>()));
  for (const Json& family : page["families"]) {
    text += fmt::format("\n{} {}: {}\n", word(family["kind"]), word(family["type"]), word(family["summary"]));
    std::string tried, others;
    for (const Json& law : family["laws"]) {
      if (law.contains("not_tried")) {
        others += fmt::format("  {:<64}{}\n", word(law["law"]), word(law["not_tried"]));
        continue;
      }
      std::string worst, where;
      if (law.contains("limit")) worst = fmt::format("{:.2e} {:.2e}", law["worst_error"].get<double>(), law["limit"].get<double>());
      if (law.contains("sample")) where = fmt::format("{}", law["sample"].get<int>());
      if (law.contains("where")) where += fmt::format(": {}", word(law["where"]));
      tried += line_of(word(law["law"]), law["trials"].dump(), law["broken"].dump(), worst, where);
    }
    if (!tried.empty()) text += line_of("law", "trials", "broken", "worst error, limit", "at sample") + tried;
    if (!others.empty()) text += "  not tried\n" + others;
    constexpr std::size_t kMost = 20;
    const Json& violations = family["violations"];
    for (std::size_t i = 0; i < std::min(violations.size(), kMost); ++i) text += fmt::format("  broken: {}\n", word(violations[i]));
    if (violations.size() > kMost) text += fmt::format("  and {} more\n", violations.size() - kMost);
    text += family["obeys"].get<bool>() ? "  obeys every law that was tried\n" : "  FAILS\n";
  }
  if (page.contains("refused")) text += fmt::format("\nrefused: {}\n", word(page["refused"]));
  return text + fmt::format("\nverdict          {}\n", page["obeys"].get<bool>() ? "every law that was tried holds" : "FAIL");
}

void write_examination(const Arguments& a, const Examination& e, std::vector<Diagnostic>& unwritten) {
  if (a.out.empty() && !a.json) return;
  const Json page = report(a, e);
  if (a.json) fmt::print("{}", json_text_with_nulls(page));
  if (!a.out.empty()) write_result(a.out, a.out.ends_with(".json") ? json_text_with_nulls(page) : text_of(page), unwritten);
}

/// The table of types refuses what is taken, by a type of the program or by one of the same plugin: told here and not by the first run.
void expect_free_types(const std::string& plugin, std::vector<PluginFamily>& families) {
  Registry registry;
  register_hinges(registry), register_bodies(registry), register_devices(registry);
  for (PluginFamily& f : families) {
    if (!f.violations.empty()) continue;
    try {
      f.kind->add(registry, f.family, plugin, {});
    } catch (const InputError& error) {
      const Diagnostic& why = error.diagnostics().front();
      f.violations.push_back(fmt::format("type: expected {}, got {}; {}", why.expected, why.got, why.hint));
    }
  }
}

int check_plugin(const Arguments& a, bool as_json) {
  Examination e;
  std::vector<Diagnostic> unwritten;
  try {
    e.families = examine_plugin(a.plugin, a.samples, a.seed, e.record);
  } catch (const InputError& error) {
    std::error_code none;
    const Diagnostic& why = error.diagnostics().front();
    e.refused = fmt::format("{}: expected {}, got {}", number_of(why.code), why.expected, why.got);
    if (std::filesystem::is_regular_file(a.plugin, none)) write_examination(a, e, unwritten);
    throw;
  }
  expect_free_types(a.plugin, e.families);
  for (const PluginFamily& f : e.families) {
    if (a.json) break;
    fmt::print("{:<6}{} {}: {}\n", f.violations.empty() ? "ok" : "FAIL", f.kind->word, f.type, summary_of(f));
    constexpr std::size_t kMost = 20;
    for (std::size_t i = 0; i < std::min(f.violations.size(), kMost); ++i) fmt::print("      {}\n", f.violations[i]);
    if (f.violations.size() > kMost) fmt::print("      and {} more\n", f.violations.size() - kMost);
  }
  write_examination(a, e, unwritten);
  return report_unwritten(std::move(unwritten), as_json, e.good() ? 0 : 1);
}

}  // namespace

void show_plugin_messages() {
  on_plugin_message([](const std::string& file, std::uint32_t severity, const std::string& text) {
    const char* word = severity >= CARDAN_LOG_ERROR ? "error: " : severity == CARDAN_LOG_WARNING ? "warning: " : "";
    complain(fmt::format("{}: {}{}\n", file, word, text));
  });
}

void add_check_plugin(CommandLine& line) {
  Command& command = line.command("check-plugin", "Check that the families of a plugin obey the laws");
  auto a = std::make_shared<Arguments>();
  command.option("plugin", a->plugin, "The shared library (.so)").required().type_name("PLUGIN");
  command.option("--out", a->out, "A report: the file, the program, every law with its worst error and its limit; .json: as JSON")
      .type_name("FILE");
  command.flag("--json", a->json, "The report as JSON on standard output");
  command.option("--seed", a->seed, "Of the random samples; default 1").type_name("NUMBER");
  command.option("--samples", a->samples, "Of each law; default 1000").type_name("NUMBER").between(1, 1000000);
  command.action([a, &line] { return check_plugin(*a, line.json_errors()); });
}

}  // namespace cardan
