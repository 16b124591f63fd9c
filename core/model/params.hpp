#pragma once
// The parameters of an instance (hinge, device) against the schema of its family.
#include <span>
#include <string>
#include <vector>

#include "core/abi/cardan_abi.h"
#include "core/model/spec.hpp"

namespace cardan {

/// What a description says of one instance.
struct GivenParams {
  std::string path;  // "bodies.boom.hinge"
  std::string what;  // "hinge type revolute"
  const ParamValues& values;
};

/// What its family wants.
struct ParamsOfFamily {
  std::span<const cardan_param_desc> schema;
  std::size_t bytes;  // of the packed parameters
  int (*pack)(const cardan_param_values*, void* packed);
};

/// Checked against the schema, defaults filled in, unit vectors normalised, and packed for the functions of the family
/// (core/abi/param_values.hpp). Faults go to the sink; then empty.
std::vector<double> pack_params(const SystemSpec& spec, const GivenParams& given, const ParamsOfFamily& family, DiagnosticSink& sink);

}  // namespace cardan
