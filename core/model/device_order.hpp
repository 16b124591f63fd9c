#pragma once
// Which device is evaluated before which: by data flow alone.
#include <utility>

#include "core/base/diagnostic.hpp"
#include "core/model/model.hpp"

namespace cardan {

/// Fills Devices::order and ::first of devices that are connected. Who gives comes before who takes wherever that can be; an output that
/// waits for nothing may be taken earlier, its device is then evaluated once before all. False: C1003 went to the sink, as outputs need
/// each other in one evaluation, or devices that sample at the same instants take from each other: which of them has what the other one
/// gave a tick ago would follow from their names.
bool order_devices(const SystemSpec& spec, Devices& devices, DiagnosticSink& sink);

/// The device that gives output `out` of all, and which of its outputs that is.
std::pair<int, int> owner_of_output(const Devices& devices, int out);

}  // namespace cardan
