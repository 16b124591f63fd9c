#include "core/model/spec.hpp"

namespace cardan {

SystemSpec::SystemSpec() = default;
SystemSpec::SystemSpec(const SystemSpec&) = default;
SystemSpec::SystemSpec(SystemSpec&&) noexcept = default;
SystemSpec& SystemSpec::operator=(const SystemSpec&) = default;
SystemSpec& SystemSpec::operator=(SystemSpec&&) noexcept = default;
SystemSpec::~SystemSpec() = default;

}  // namespace cardan
