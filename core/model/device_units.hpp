#pragma once
// What follows from the tables of devices: their units at hinges ("N m|N" is N m where the component turns, N where it slides), and when
// they tick.
#include <string>
#include <string_view>
#include <vector>

#include "core/model/model.hpp"

namespace cardan {

/// Whether a component with a rate in this unit turns; else it slides.
bool is_turn(std::string_view rate);
/// Which of the two units holds for a device: true where the first hinge component that it is mounted at turns, or there is none.
bool turns(const Model& model, const Device& device);
bool turns(const SystemSpec& spec, const Registry& registry, const DeviceSpec& device, const cardan_device_family& family);

/// The unit that holds; one without '|' as it is.
std::string unit_where(bool turns, std::string_view unit);
/// The same for each parameter; the texts live as long as the process.
std::vector<cardan_param_desc> schema_where(bool turns, const cardan_device_family& family);

/// Whether a device ticks after the controllers, which command it, or before them, which read it.
bool ticks_late(const Device& device);

/// "sensor", "actuator"; "device" where its table does not say.
const char* role_text(const cardan_device_family&);

}  // namespace cardan
