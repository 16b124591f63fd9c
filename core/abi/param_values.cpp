#include "core/abi/param_values.hpp"

namespace cardan {
namespace {

const ParamTable& self(const cardan_param_values* values) { return *static_cast<const ParamTable*>(values->host); }

/// The value of that name; null where there is none.
template <class Map>
const auto* find(const Map& map, const char* name) {
  const auto it = name ? map.find(name) : map.end();
  return it == map.end() ? nullptr : &it->second;
}

}  // namespace

cardan_param_values ParamTable::view() {
  cardan_param_values v{};
  v.struct_size = sizeof v;
  v.host = this;
  v.numbers = [](const cardan_param_values* values, const char* name, std::uint32_t* count) -> const double* {
    const auto* found = find(self(values).numbers, name);
    if (count) *count = found ? static_cast<std::uint32_t>(found->size()) : 0u;
    return found ? found->data() : nullptr;
  };
  v.text = [](const cardan_param_values* values, const char* name) -> const char* {
    const auto* found = find(self(values).texts, name);
    return found ? found->c_str() : nullptr;
  };
  v.bytes = [](const cardan_param_values* values, const char* name, std::uint64_t* size) -> const void* {
    const auto* found = find(self(values).bytes, name);
    if (size) *size = found ? found->size() : 0u;
    return found ? found->data() : nullptr;
  };
  v.fail = [](const cardan_param_values* values, const char* name, const char* expected, const char* got, const char* hint) {
    const auto text = [](const char* t) { return std::string(t ? t : ""); };
    const_cast<ParamTable&>(self(values)).failures.push_back({text(name), text(expected), text(got), text(hint)});
  };
  return v;
}

std::vector<double> pack(std::size_t bytes, int (*pack)(const cardan_param_values*, void* packed), ParamTable& values) {
  std::vector<double> packed((bytes + sizeof(double) - 1) / sizeof(double) + 1, 0.0);
  const cardan_param_values view = values.view();
  if (pack && pack(&view, packed.data()) != 0) {
    if (values.failures.empty()) values.failures.push_back({"", "parameters that the type accepts", "", ""});
    return {};
  }
  return packed;
}

}  // namespace cardan
