#pragma once
// Fields: FieldSpec + Registry -> Model::fields.
#include "core/model/model.hpp"

namespace cardan {

/// Parameters packed, and prepared for t = 0. Faults go to the sink: C1004 for an unknown type.
std::vector<Field> compile_fields(const SystemSpec& spec, const Registry& registry, DiagnosticSink& sink);

/// The field of a quantity that `name` (at key path `key`) means; -1 after a fault (C1005: none of that name, or of another quantity).
int field_named(const SystemSpec& spec, const std::vector<Field>& fields, std::uint32_t quantity, const std::string& name,
                const std::string& key, DiagnosticSink& sink);

/// The field of gravity.fields; of several their sum, put behind `fields`. -1 after a fault.
int compile_gravity(const SystemSpec& spec, std::vector<Field>& fields, DiagnosticSink& sink);

/// "gravity", "magnetic field", "density of the air" ...
const char* quantity_text(std::uint32_t quantity);

}  // namespace cardan
