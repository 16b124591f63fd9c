#pragma once
// The parameters of an instance (hinge, body, device) against the schema of its family: read from a document, checked, packed.
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/abi/param_values.hpp"
#include "core/model/schema.hpp"
#include "core/model/spec.hpp"

namespace cardan {

using ParamSchema = std::span<const cardan_param_desc>;

/// What a description says of one instance.
struct GivenParams {
  std::string path;  // "bodies.boom.hinge"
  std::string what;  // "hinge type revolute"
  const ParamValues& values;
};

/// What its family wants.
struct ParamsOfFamily {
  ParamSchema schema;
  std::size_t bytes;  // of the packed parameters
  int (*pack)(const cardan_param_values*, void* packed);
  std::uint64_t (*packed_size)(const cardan_param_values*) = nullptr;  // in place of `bytes`
};

/// Those keys of the map that the schema has, in SI. What is required and missing is told by checked_params().
void read_params(MapReader& map, ParamSchema schema, ParamValues& params);

/// Checked against the schema, defaults filled in, unit vectors normalised, files read. Faults go to the sink; then empty.
std::optional<ParamTable> checked_params(const SystemSpec& spec, const GivenParams& given, ParamSchema schema, DiagnosticSink& sink);

/// What a family refused of them; `whole`: the code of what is said of the instance as such.
void report_refused(const SystemSpec& spec, const GivenParams& given, ParamSchema schema, const ParamTable& values, Code whole,
                    DiagnosticSink& sink);

/// Checked, and packed for the functions of the family (core/abi/param_values.hpp). Faults go to the sink; then empty.
std::vector<double> pack_params(const SystemSpec& spec, const GivenParams& given, const ParamsOfFamily& family, DiagnosticSink& sink);

/// Keys of the schema that the family, packing these values, does not ask for: by another one they do not apply.
std::vector<std::string> keys_not_read(const SystemSpec& spec, const GivenParams& given, const ParamsOfFamily& family);

/// "> 0 and <= 1", "from 0 to 1"; empty where there is no range.
std::string range_text(const cardan_param_desc& desc);

/// The path of a file that the input names, relative to the file where the name stands.
std::string beside(const SourceMark& mark, const std::string& file);

/// Rows of numbers, one after the other, from a text of values between commas. A first line may name the columns, in any order and among
/// others, each with a unit in brackets: `time [s], force [mN]`; else the units are those of the schema. Empty lines and what follows a #
/// are left out. Faults go to the sink with the line of the file; then the result is of no use.
std::vector<double> read_table_file(const std::string& path, const cardan_param_desc& table, const Located& at, DiagnosticSink& sink);

}  // namespace cardan
