#include "core/abi/param_values.hpp"

namespace cardan {

cardan_param_values ParamTable::view() {
  cardan_param_values v{};
  v.struct_size = sizeof v;
  v.host = this;
  v.numbers = [](const cardan_param_values* self, const char* name, std::uint32_t* count) -> const double* {
    const auto& table = *static_cast<const ParamTable*>(self->host);
    const auto it = table.numbers.find(name);
    if (count) *count = it == table.numbers.end() ? 0u : static_cast<std::uint32_t>(it->second.size());
    return it == table.numbers.end() ? nullptr : it->second.data();
  };
  v.text = [](const cardan_param_values* self, const char* name) -> const char* {
    const auto& table = *static_cast<const ParamTable*>(self->host);
    const auto it = table.texts.find(name);
    return it == table.texts.end() ? nullptr : it->second.c_str();
  };
  v.fail = [](const cardan_param_values* self, const char* name, const char* expected) {
    auto& table = *static_cast<ParamTable*>(const_cast<void*>(self->host));
    table.failures.emplace_back(name, expected);
  };
  return v;
}

std::vector<double> pack(std::size_t bytes, int (*pack)(const cardan_param_values*, void*), ParamTable& values) {
  std::vector<double> packed((bytes + sizeof(double) - 1) / sizeof(double) + 1, 0.0);
  const cardan_param_values view = values.view();
  if (pack && pack(&view, packed.data()) != 0) {
    if (values.failures.empty()) values.failures.emplace_back("", "parameters that the type accepts");
    return {};
  }
  return packed;
}

}  // namespace cardan
