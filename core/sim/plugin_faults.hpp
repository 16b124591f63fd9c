#pragma once
// Which plugin went wrong in a run: asked when v' is no number or something was thrown, and at every row of the results.
#include <string>

#include "core/model/model.hpp"

namespace cardan {

class DeviceForces;
struct FieldMoment;

/// Whether a hinge, body, device or field that moves or is read is of a plugin.
bool has_plugins(const Model& model);

/// Asks the functions of hinges and bodies that come from plugins once more, twice, at q and v (user order), with words around all that
/// they may write. The first that throws, gives a number that is not finite, writes beyond what it is handed, or gives other numbers at the
/// second call: `kinematics of hinge "acme/arc" (acme.so) of bodies.a gives ...`; empty if none does, or where q or v are not finite
/// themselves. Of bodies with modes at rest of their frame: their angular velocity is not known here.
std::string plugin_at_fault(const Model& model, const double* q, const double* v);

/// The same of devices and of the fields that they read, at what they were asked last, where that is told by their answers.
std::string plugin_at_fault(const Model& model, DeviceForces& devices);
/// The same of a field at a point; "" also where it is not of a plugin.
std::string plugin_at_fault(const Field& field, const FieldMoment& when, int n, const double* points);

/// "device wheel (acme/wheel, ./acme.so)": the file where it is of a plugin.
std::string told_device(const Device& device);

}  // namespace cardan
