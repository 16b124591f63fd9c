#include "core/model/fields.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/units.hpp"
#include "core/model/params.hpp"
#include "core/model/sum_of_fields.hpp"

namespace cardan {

namespace {
constexpr std::uint32_t kMostLimits = 31;  // bits of a code
}

const char* quantity_text(std::uint32_t quantity) {
  static constexpr const char* kTexts[] = {
      "gravity", "magnetic field", "density of the air", "wind", "light", "position of a celestial body", "attitude of a celestial body",
      "time"};
  return quantity <= CARDAN_TIME ? kTexts[quantity] : "?";
}

std::vector<Field> compile_fields(const SystemSpec& spec, const Registry& registry, DiagnosticSink& sink) {
  std::vector<Field> all;
  for (const FieldSpec& given : spec.fields) {
    const std::string path = "fields." + given.name;
    const auto* entry = registry.fields.entry(given.type);
    if (!entry) {
      const std::vector<std::string> types = registry.fields.types();
      sink.report(Code::unknown_field_type, spec.locate(path + ".type"),
                  fmt::format("a field type: {}, or one from a loaded plugin", fmt::join(types, ", ")), in_quotes(given.type),
                  did_you_mean(given.type, types));
      continue;
    }
    const cardan_field_family& f = *entry->family;
    auto source = std::make_shared<FieldSource>();
    source->family = &f;
    source->packed = pack_params(spec, {path, fmt::format("field type {}", f.type), given.params},
                                 {{f.params, f.n_params}, f.params_size, f.pack, f.packed_size}, sink);
    for (std::uint32_t i = 0; given.hold && i < f.n_limits; ++i)
      if (f.limits[i].holds != 0) source->held |= 1 << i;
    if (given.hold && source->held == 0)
      sink.report(Code::out_of_range, spec.locate(path + ".outside"), "refuse", "hold",
                  f.n_limits == 0 ? "this field has no limits" : "this field knows no value to hold beyond its limits");
    if (f.prepare && (f.params_size == 0 || !source->packed.empty())) {
      source->prepared.assign((f.prepared_size + sizeof(double) - 1) / sizeof(double), 0.0);
      f.prepare(0.0, source->packed.data(), source->prepared.data());  // of limits a run tells, which knows its times
    }
    all.push_back({given.name, entry->origin, std::move(source)});
  }
  return all;
}

int field_named(const SystemSpec& spec, const std::vector<Field>& fields, std::uint32_t quantity, const std::string& name,
                const std::string& key, DiagnosticSink& sink) {
  std::vector<std::string> legal;
  for (std::size_t i = 0; i < fields.size(); ++i) {
    if (fields[i].source->family->quantity != quantity) continue;
    if (fields[i].name == name) return static_cast<int>(i);
    legal.push_back(fields[i].name);
  }
  const auto other = std::ranges::find(fields, name, &Field::name);
  sink.report(Code::wrong_field, spec.locate(key),
              legal.empty() ? fmt::format("a field of the quantity {}, of which there is none", quantity_text(quantity))
                            : fmt::format("a field of the quantity {}: {}", quantity_text(quantity), one_of(legal)),
              other == fields.end()
                  ? in_quotes(name)
                  : fmt::format("{}, which is of the quantity {}", in_quotes(name), quantity_text(other->source->family->quantity)),
              other == fields.end() ? did_you_mean(name, legal) : "");
  return -1;
}

int compile_gravity(const SystemSpec& spec, std::vector<Field>& fields, DiagnosticSink& sink) {
  const std::vector<std::string>& names = spec.gravity.fields;
  std::vector<Field> parts;
  std::uint32_t limits = 0;
  int last = -1;
  for (std::size_t k = 0; k < names.size(); ++k) {
    const std::string key = names.size() == 1 ? "gravity.field" : fmt::format("gravity.field[{}]", k);
    if (std::ranges::count(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(k), names[k]) > 0) {
      sink.report(Code::wrong_field, spec.locate(key), "each field once", fmt::format("{} again", in_quotes(names[k])));
      return -1;
    }
    last = field_named(spec, fields, CARDAN_GRAVITY, names[k], key, sink);
    if (last < 0) return -1;
    parts.push_back(fields[static_cast<std::size_t>(last)]);
    limits += parts.back().source->family->n_limits;
  }
  if (parts.empty() || limits > kMostLimits) {
    sink.report(Code::wrong_field, spec.locate("gravity.field"),
                parts.empty() ? "the name of a field, or a list of some" : fmt::format("fields of at most {} limits in all", kMostLimits),
                parts.empty() ? "none" : fmt::format("{} limits", limits));
    return -1;
  }
  if (parts.size() == 1) return last;
  fields.push_back(sum_of_fields(parts));
  return static_cast<int>(fields.size()) - 1;
}

}  // namespace cardan
