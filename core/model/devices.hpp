#pragma once
// Devices: DeviceSpec + Registry -> Model::devices.
#include "core/base/warnings.hpp"
#include "core/model/model.hpp"

namespace cardan {

/// Parameters packed, mounts and connections found, the order of evaluation by data flow alone. Faults go to the sink: C1001 for an
/// unknown type, C1002 for a connection that does not fit, C1003 for outputs that need each other in one evaluation.
/// from_home: CompileOptions::from_home.
Devices compile_devices(const SystemSpec& spec, const Registry& registry, const Model& model, bool from_home, DiagnosticSink& sink);

/// Whether what stands on the world is so far from its origin in this state (10 km), or flies there so fast (100 m/s), that places are
/// rounded (CompileOptions::from_home).
bool is_far(const Model& model, const double* q, const double* v);

/// W0309: devices that take an output which may be invalid, and do not ask whether it is.
Warnings unheeded_validity(const Model& model);

}  // namespace cardan
