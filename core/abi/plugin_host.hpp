#pragma once
// What plugins find here: cardan_host and its services.
#include <functional>
#include <string>
#include <string_view>

#include "core/abi/cardan_abi.h"

namespace cardan {

/// What a plugin says: its file, one of cardan_log_severity, one line.
using PluginMessages = std::function<void(const std::string& file, std::uint32_t severity, const std::string& text)>;

/// Where messages of plugins go from now on; without it, nowhere. Calls come one at a time.
void on_plugin_message(PluginMessages sink);

/// The host that the plugin of one file sees; lives until the process ends.
struct PluginHost : cardan_host {
  explicit PluginHost(std::string of_file);
  PluginHost(const PluginHost&) = delete;
  PluginHost& operator=(const PluginHost&) = delete;

  /// Of the plugin of that file, always the same.
  static PluginHost& of(const std::string& file);

  std::string file, last_error;
  bool muted = false;  // while laws try its functions

 private:
  struct Log : cardan_log {
    PluginHost* owner;
  } log_;
};

}  // namespace cardan
