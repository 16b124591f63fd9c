#pragma once
// Devices: DeviceSpec + Registry -> Model::devices.
#include "core/base/warnings.hpp"
#include "core/model/model.hpp"

namespace cardan {

/// Parameters packed, mounts and connections found, the order of evaluation by data flow alone. Faults go to the sink: C1001 for an
/// unknown type, C1002 for a connection that does not fit, C1003 for outputs that need each other in one evaluation.
Devices compile_devices(const SystemSpec& spec, const Registry& registry, const Model& model, DiagnosticSink& sink);

/// W0309: devices that take an output which may be invalid, and do not ask whether it is.
Warnings unheeded_validity(const Model& model);

}  // namespace cardan
