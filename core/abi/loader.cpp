#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "core/abi/kinds.hpp"
#include "core/abi/plugin_host.hpp"
#include "core/abi/plugin_record.hpp"
#include "core/base/units.hpp"

namespace cardan {
namespace {

constexpr int kSamples = 40;  // of the laws, when a plugin is loaded
constexpr std::uint32_t kMostFamilies = 1000;
constexpr const char* kLoading = "the loading of the library";  // its constructors; a file cut short crashes here as well

/// A plugin being looked at: where its faults are told, and what is told before each call of its code.
class Plugin {
 public:
  Plugin(const std::string& path, const Located& at, const TellPhase& phase) : path_(path), at_(at), phase_(phase) {
    if (at_.mark.file.empty()) at_.mark.file = path;
  }

  [[noreturn]] void refuse(Code code, std::string expected, std::string got, std::string hint) const {
    cardan::refuse(code, at_, std::move(expected), std::move(got), std::move(hint));
  }

  /// Foreign code throws nothing; where it does, that is its fault and told as such.
  template <class Call>
  auto guarded(const std::string& what, const Call& call) const {
    phase_(what);
    try {
      return call();
    } catch (const InputError&) {
      throw;
    } catch (const std::exception& e) {
      refuse(Code::plugin_law, "functions that throw nothing", fmt::format("an exception in {}: {}", what, e.what()), "");
    } catch (...) {
      refuse(Code::plugin_law, "functions that throw nothing", fmt::format("an exception in {}", what), "");
    }
  }

  void expect_file() const {
    std::error_code error;
    const auto status = std::filesystem::status(path_, error);
    if (!std::filesystem::is_regular_file(status))
      refuse(Code::plugin_not_loaded, "a shared library",
             std::filesystem::exists(status) ? "no regular file" : in_quotes(path_) + ": no such file",
             "give the path of the .so file, relative to the scenario");
  }

  struct Found {
    const FamilyKind* kind;
    const void* table;  // as the plugin has it
  };
  /// The families of the library, of every kind; whose it is goes to `record`.
  std::vector<Found> families(PluginRecord& record) const {
    const std::string file = path_.find('/') == std::string::npos ? "./" + path_ : path_;  // the folders of the system are not searched
    void* library = guarded(kLoading, [&] { return dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL); });
    if (!library) {
      const char* why = dlerror();
      refuse(Code::plugin_not_loaded, "a shared library that can be opened", why ? why : path_,
             "give the path of the .so file, relative to the scenario");
    }
    const auto entry = reinterpret_cast<cardan_plugin_entry_fn>(dlsym(library, "cardan_plugin_entry"));
    if (!entry) refuse(Code::plugin_not_a_plugin, "a library that exports cardan_plugin_entry", path_, "see docs/plugins.md");
    const cardan_plugin* plugin = guarded("cardan_plugin_entry", [&] { return entry(&host_); });
    expect_version(plugin);
    record = {plugin->name, plugin->version, plugin->licence, plugin->abi_major, plugin->abi_minor, {}};
    std::vector<Found> all;
    for (const FamilyKind& kind : family_kinds())
      for (std::uint32_t i = 0;; ++i) {
        const void* table = guarded(fmt::format("family(\"{}\", {})", kind.kind, i), [&] { return plugin->family(kind.kind, i); });
        if (!table) break;
        if (i == kMostFamilies || std::ranges::any_of(all, [&](const Found& f) { return f.table == table; }))
          refuse(Code::plugin_not_a_plugin, fmt::format("family(\"{}\", index) to return each table once, then null", kind.kind),
                 fmt::format("a table again at index {}", i), "see docs/plugins.md");
        all.push_back({&kind, table});
      }
    for (const DeclaredKind& kind : declared_kinds())
      if (guarded(fmt::format("family(\"{}\", 0)", kind.kind), [&] { return plugin->family(kind.kind, 0); })) {
        std::vector<std::string> words;
        for (const FamilyKind& honoured : family_kinds()) words.emplace_back(honoured.word);
        refuse(Code::plugin_kind, fmt::format("families of the kinds that this version honours: {}", fmt::join(words, ", ")),
               fmt::format("a {} (\"{}\")", kind.word, kind.kind),
               "its header says what it will be: a run without it would not be the run that was asked for");
      }
    if (all.empty()) {
      std::vector<std::string> kinds;
      for (const FamilyKind& kind : family_kinds()) kinds.push_back(in_quotes(kind.kind));
      refuse(Code::plugin_not_a_plugin, fmt::format("families of one of the kinds {}", fmt::join(kinds, ", ")), "none",
             "one that was built against another draft of a kind has none of this one: rebuild it");
    }
    return all;
  }

  PluginHost& host() const { return host_; }

 private:
  void expect_version(const cardan_plugin* plugin) const {
    const char* hint = "rebuild it against core/abi/cardan_abi.h of this version";
    if (!plugin)
      refuse(Code::plugin_version, "a plugin that accepts this Cardan",
             host_.last_error.empty() ? "it refused" : "it refused: " + host_.last_error, hint);
    // The first three members stand at the same place in every version; what another major means by the rest is
    // unknown.
    if (plugin->abi_major != CARDAN_ABI_MAJOR || plugin->abi_minor > CARDAN_ABI_MINOR)
      refuse(Code::plugin_version, fmt::format("ABI {}.0 to {}.{}", CARDAN_ABI_MAJOR, CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR),
             fmt::format("ABI {}.{}", plugin->abi_major, plugin->abi_minor), hint);
    if (plugin->struct_size < sizeof(cardan_plugin))
      refuse(Code::plugin_not_a_plugin, fmt::format("a cardan_plugin of {} bytes", sizeof(cardan_plugin)),
             fmt::format("struct_size = {}", plugin->struct_size), "struct_size is sizeof(cardan_plugin)");
    if (!plugin->name || !plugin->version || !plugin->licence || !plugin->family)
      refuse(Code::plugin_not_a_plugin, "a name, a version, a licence and the function family", "a null pointer", "see docs/plugins.md");
  }

  std::string path_;
  Located at_;
  const TellPhase& phase_;
  PluginHost& host_ = PluginHost::of(path_);
};

struct Trial {
  int samples;
  std::uint64_t seed = 1;
};

PluginFamily examined(const Plugin& plugin, const Plugin::Found& found, std::size_t index, const TellPhase& phase, const Trial& trial,
                      LawRecord& record) {
  const FamilyKind& kind = *found.kind;
  const std::string unnamed = fmt::format("no. {}", index);
  const KeptTable kept = kind.keep(found.table);
  if (!kept.table) return {&kind, nullptr, unnamed, {}, {kept.fault}};
  return plugin.guarded(fmt::format("{} {}", kind.word, unnamed), [&]() -> PluginFamily {
    if (auto faults = kind.faults(kept.table); !faults.empty()) return {&kind, kept.table, unnamed, {}, std::move(faults)};
    const std::string type = kind.type(kept.table);
    auto violations = plugin.guarded(fmt::format("{} \"{}\"", kind.word, type), [&] {
      const auto before = [&](std::string_view call) { phase(fmt::format("{} of {} \"{}\"", call, kind.word, type)); };
      return kind.violations(kept.table, trial.samples, trial.seed, before, &record);
    });
    return {&kind, kept.table, type, kind.summary(kept.table), std::move(violations)};
  });
}

std::vector<PluginFamily> families(const Plugin& plugin, const TellPhase& phase, const Trial& trial, PluginRecord& record) {
  plugin.host().muted = false;  // what it says while it is loaded is heard
  const std::vector<Plugin::Found> found = plugin.families(record);
  std::vector<PluginFamily> all;
  plugin.host().muted = true;
  for (const Plugin::Found& f : found) all.push_back(examined(plugin, f, all.size(), phase, trial, record.laws.emplace_back()));
  plugin.host().muted = false;
  return all;
}

std::vector<PluginFamily> examine(const std::string& path, const Trial& trial, const Located& at, PluginRecord& record) {
  const TellPhase silent = [](std::string_view) {};
  const Plugin here(path, at, silent);
  here.expect_file();
  const auto tried = [&](int samples, const ChildLimits& limits) {
    const auto work = [&](const TellPhase& phase) { families(Plugin(path, at, phase), phase, {samples, trial.seed}, record); };
    if (const auto end = end_in_child(work, limits))
      here.refuse(end->ends_with(kLoading) ? Code::plugin_not_loaded : Code::plugin_law, "functions that return", *end,
                  "it was tried in a process of its own; nothing else was touched");
  };
  tried(std::min(trial.samples, kSamples), kTrialLimits);                                 // what never returns is found here, and soon
  if (trial.samples > kSamples) tried(trial.samples, {.cpu_s = 120.0, .wall_s = 600.0});  // of many families
  return families(here, silent, trial, record);
}

}  // namespace

std::vector<PluginFamily> examine_plugin(const std::string& path, int samples, const Located& at) {
  PluginRecord record;
  return examine(path, {samples}, at, record);
}

std::vector<PluginFamily> examine_plugin(const std::string& path, int samples, std::uint64_t seed, PluginRecord& record) {
  return examine(path, {samples, seed}, {}, record);
}

void load_plugin(const std::string& path, Registry& registry, const Located& at) {
  const TellPhase silent = [](std::string_view) {};
  const Plugin here(path, at, silent);
  for (const PluginFamily& f : examine_plugin(path, kSamples, at)) {
    if (f.family && f.kind->known(registry, f.family)) continue;  // a plugin named twice is no error
    if (!f.violations.empty())
      here.refuse(Code::plugin_law, fmt::format("{} \"{}\" to obey the laws of its kind", f.kind->word, f.type), f.violations.front(),
                  fmt::format("the whole list: cardan check-plugin {}", path));
    f.kind->add(registry, f.family, path, at);
  }
}

}  // namespace cardan
