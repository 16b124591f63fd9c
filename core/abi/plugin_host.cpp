#include "core/abi/plugin_host.hpp"

#include <cstring>
#include <map>
#include <mutex>

#include "core/base/utf8.hpp"

namespace cardan {
namespace {

std::mutex access;
PluginMessages messages;

}  // namespace

void on_plugin_message(PluginMessages sink) {
  const std::lock_guard lock(access);
  messages = std::move(sink);
}

PluginHost::PluginHost(std::string of_file) : cardan_host{}, file(std::move(of_file)), log_{{}, this} {
  struct_size = sizeof(cardan_host);
  abi_major = CARDAN_ABI_MAJOR;
  abi_minor = CARDAN_ABI_MINOR;
  service = [](const cardan_host* host, const char* id) -> const void* {
    const cardan_log* log = &static_cast<const PluginHost*>(host)->log_;
    return id && std::strcmp(id, CARDAN_SERVICE_LOG) == 0 ? log : nullptr;
  };
  log_.struct_size = sizeof(cardan_log);
  log_.say = [](const cardan_log* log, std::uint32_t severity, const char* text) {
    constexpr std::size_t kLongest = 1000;
    if (!text) return;
    PluginHost& host = *static_cast<const Log*>(log)->owner;
    const std::string shown = printable({text, strnlen(text, kLongest)});
    const std::lock_guard lock(access);
    if (severity >= CARDAN_LOG_ERROR) host.last_error = shown;
    if (messages && !host.muted) messages(host.file, severity, shown);
  };
}

PluginHost& PluginHost::of(const std::string& file) {
  static std::map<std::string, PluginHost> all;
  const std::lock_guard lock(access);
  return all.try_emplace(file, file).first->second;
}

}  // namespace cardan
