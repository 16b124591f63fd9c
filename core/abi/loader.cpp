#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "core/abi/laws.hpp"
#include "core/abi/registry.hpp"
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

  /// The hinges of the library, each with a table that can be read.
  std::vector<const cardan_hinge_family*> hinges() const {
    const std::string file = path_.find('/') == std::string::npos ? "./" + path_ : path_;  // the folders of the system are not searched
    void* library = guarded(kLoading, [&] { return dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL); });
    if (!library) {
      const char* why = dlerror();
      refuse(Code::plugin_not_loaded, "a shared library that can be opened", why ? why : path_,
             "give the path of the .so file, relative to the scenario");
    }
    const auto entry = reinterpret_cast<cardan_plugin_entry_fn>(dlsym(library, "cardan_plugin_entry"));
    if (!entry) refuse(Code::plugin_not_a_plugin, "a library that exports cardan_plugin_entry", path_, "see docs/plugins.md");
    const cardan_host host{sizeof(cardan_host), CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR};
    const cardan_plugin* plugin = guarded("cardan_plugin_entry", [&] { return entry(&host); });
    expect_version(plugin);
    std::vector<const cardan_hinge_family*> all;
    for (std::uint32_t i = 0;; ++i) {
      const void* family = guarded(fmt::format("family(\"hinge\", {})", i), [&] { return plugin->family("hinge", i); });
      if (!family) return all;
      const auto* hinge = static_cast<const cardan_hinge_family*>(family);
      if (i == kMostFamilies || std::find(all.begin(), all.end(), hinge) != all.end())
        refuse(Code::plugin_not_a_plugin, "family(\"hinge\", index) to return each table once, then null",
               fmt::format("a table again at index {}", i), "see docs/plugins.md");
      all.push_back(hinge);
    }
  }

 private:
  void expect_version(const cardan_plugin* plugin) const {
    const char* hint = "rebuild it against core/abi/cardan_abi.h of this version";
    if (!plugin) refuse(Code::plugin_version, "a plugin that accepts this Cardan", "it refused", hint);
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
};

std::string type_of(const cardan_hinge_family& family, std::size_t index) {
  return hinge_table_faults(family).empty() ? family.type : fmt::format("no. {}", index);
}

std::vector<PluginFamily> families(const Plugin& plugin, const TellPhase& phase, int samples) {
  std::vector<PluginFamily> all;
  for (const cardan_hinge_family* hinge : plugin.hinges()) {
    const std::string type = type_of(*hinge, all.size());
    const auto violations = plugin.guarded(fmt::format("hinge \"{}\"", type), [&] {
      return hinge_law_violations(*hinge, samples, 1, [&](std::string_view call) { phase(fmt::format("{} of hinge \"{}\"", call, type)); });
    });
    all.push_back({hinge, type, violations});
  }
  return all;
}

}  // namespace

std::vector<PluginFamily> examine_plugin(const std::string& path, int samples, const Located& at) {
  const TellPhase silent = [](std::string_view) {};
  const Plugin here(path, at, silent);
  here.expect_file();
  if (const auto end = end_in_child([&](const TellPhase& phase) { families(Plugin(path, at, phase), phase, samples); }))
    here.refuse(end->ends_with(kLoading) ? Code::plugin_not_loaded : Code::plugin_law, "functions that return", *end,
                "it was tried in a process of its own; nothing else was touched");
  return families(here, silent, samples);
}

void load_plugin(const std::string& path, Registry& registry, const Located& at) {
  const TellPhase silent = [](std::string_view) {};
  const Plugin here(path, at, silent);
  for (const PluginFamily& f : examine_plugin(path, kSamples, at)) {
    const auto same = [&](const Registry::Entry& e) { return e.family == f.family; };
    if (std::any_of(registry.hinges().begin(), registry.hinges().end(), same)) continue;  // a plugin named twice is no error
    if (!f.violations.empty())
      here.refuse(Code::plugin_law, fmt::format("hinge \"{}\" to obey the laws of a hinge", f.type), f.violations.front(),
                  fmt::format("the whole list: cardan check-plugin {}", path));
    registry.add(*f.family, path);
  }
}

}  // namespace cardan
