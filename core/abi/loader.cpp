#include <dlfcn.h>
#include <fmt/format.h>

#include "core/abi/laws.hpp"
#include "core/abi/registry.hpp"

namespace cardan {

void load_plugin(const std::string& path, Registry& registry, const Located& at) {
  const auto refuse = [&](Code code, std::string expected, std::string got, std::string hint) {
    Located where = at;
    if (where.mark.file.empty()) where.mark.file = path;
    throw InputError(Diagnostic{code, where, std::move(expected), std::move(got), std::move(hint), "", "", 0});
  };
  const std::string file = path.find('/') == std::string::npos ? "./" + path : path;  // the folders of the system are not searched
  void* library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!library) {
    const char* why = dlerror();
    refuse(Code::plugin_not_loaded, "a shared library that can be opened", why ? why : path, "give the path of the .so file, relative to the scenario");
  }
  const auto entry = reinterpret_cast<cardan_plugin_entry_fn>(dlsym(library, "cardan_plugin_entry"));
  if (!entry)
    refuse(Code::plugin_not_a_plugin, "a library that exports cardan_plugin_entry", path, "see docs/plugins.md");
  const cardan_host host{sizeof(cardan_host), CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR};
  const cardan_plugin* plugin = entry(&host);
  if (!plugin) refuse(Code::plugin_version, "a plugin that accepts this Cardan", "it refused", "rebuild it against core/abi/cardan_abi.h of this version");
  if (plugin->abi_major != CARDAN_ABI_MAJOR || plugin->abi_minor > CARDAN_ABI_MINOR)
    refuse(Code::plugin_version, fmt::format("ABI {}.0 to {}.{}", CARDAN_ABI_MAJOR, CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR),
           fmt::format("ABI {}.{} (plugin \"{}\", version {})", plugin->abi_major, plugin->abi_minor, plugin->name, plugin->version),
           "rebuild it against core/abi/cardan_abi.h of this version");
  for (std::uint32_t i = 0;; ++i) {
    const auto* family = static_cast<const cardan_hinge_family*>(plugin->family("hinge", i));
    if (!family) break;
    if (registry.hinge(family->type)) {  // the same plugin named twice is no error
      const auto& known = registry.hinges();
      bool same = false;
      for (const auto& e : known) same = same || e.family == family;
      if (same) continue;
    }
    const auto violations = hinge_law_violations(*family);
    if (!violations.empty())
      refuse(Code::plugin_law, fmt::format("hinge \"{}\" to obey the laws of a hinge", family->type), violations.front(),
             "run `cardan check-plugin` for the whole list");
    registry.add(*family, path);
  }
}

}  // namespace cardan
