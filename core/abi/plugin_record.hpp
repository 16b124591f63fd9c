#pragma once
// What a report on a plugin tells beside the violations: whose it is, and what was tried.
#include <cstdint>
#include <string>
#include <vector>

#include "core/abi/law_record.hpp"
#include "core/abi/registry.hpp"

namespace cardan {

struct PluginRecord {
  std::string name, version, licence;
  std::uint32_t abi_major = 0, abi_minor = 0;
  std::vector<LawRecord> laws;  ///< of each family; empty where its table is refused
};

/// examine_plugin with a seed and a record. What was known of a plugin before it was refused is in the record.
std::vector<PluginFamily> examine_plugin(const std::string& path, int samples, std::uint64_t seed, PluginRecord& record);

}  // namespace cardan
