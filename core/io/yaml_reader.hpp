#pragma once
// Vehicles in YAML. Text -> document (with places, duplicate keys refused) -> SystemSpec.
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/abi/registry.hpp"
#include "core/model/doc_node.hpp"
#include "core/model/spec.hpp"

namespace cardan {

/// The document of a YAML text; `file` names it in errors. Throws InputError: C0101 for what is not one YAML document
/// of maps, lists and scalars in UTF-8 (tags and merge keys are refused, anchors are resolved), C0103 for duplicate
/// keys.
DocNode parse_yaml(std::string_view text, const std::string& file);

/// The whole file, or as much of it as is too much for parse_yaml. Throws InputError (C0102).
std::string read_text_file(const std::string& path);

/// `--set bodies.bus.mass="1700 kg"`: sets one value of the document. The value is YAML ("[0, 0, 1]"); objects that
/// users name (bodies, nodes) must exist; other keys may be new and are checked by the schema. Throws InputError.
void apply_override(DocNode& root, std::string_view key_path, std::string_view value);

/// Where errors in such a value are.
SourceMark setting_mark(std::string_view key_path, std::string_view value);

using Overrides = std::vector<std::pair<std::string, std::string>>;  // key path, value

/// Reads, overrides, checks. Throws InputError with everything that is wrong, in the order of the file. `described`: the vehicle that the
/// text is of, where overrides give hinges that units of the text do not know.
SystemSpec vehicle_from_text(std::string_view text, const std::string& file, const Registry& registry, const Overrides& overrides = {},
                             const SystemSpec* described = nullptr);
/// The same from a file; SystemSpec::source_text holds its bytes.
SystemSpec read_vehicle(const std::string& path, const Registry& registry, const Overrides& overrides = {});

}  // namespace cardan
