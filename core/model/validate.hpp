#pragma once
// The checks that a description must pass whoever wrote it (YAML, Lua, C++): structure, masses, hinges.
#include <optional>
#include <vector>

#include "core/abi/param_values.hpp"
#include "core/abi/registry.hpp"
#include "core/model/spec.hpp"

namespace cardan {

/// What needs no family: names, references, cycles, gravity. Nodes of a flexible body are checked once its modal data are there.
void validate(const SystemSpec& spec, DiagnosticSink& sink);

/// What the checks found of the hinge of a body.
struct CheckedHinge {
  int inboard_body = -1;                        // index; -1: the world, or no such body
  const cardan_hinge_family* family = nullptr;  // null: no such type
  std::vector<double> packed;                   // pack_hinge()
};
/// The same, and bodies and hinges against their families: types, masses, inertias, parameters, initial values, prescribed components,
/// springs.
/// Returns the hinges of spec.bodies; complete if nothing was wrong.
std::vector<CheckedHinge> validate(const SystemSpec& spec, const Registry& registry, DiagnosticSink& sink);

/// The parameters of a hinge checked against the schema of its family, defaults filled in, unit vectors normalised, and
/// packed for its kinematics (core/abi/param_values.hpp). Faults go to the sink; then empty.
std::vector<double> pack_hinge(const SystemSpec& spec, const BodySpec& body, const cardan_hinge_family& family, DiagnosticSink& sink);

/// HingeFactor by number, as the vehicle file calls them.
const std::vector<std::string>& hinge_factors();
/// Hinges of this family have a square-root form: from two velocities on, where D is formed. With `free` and `free_body` it is not: the
/// inertia itself is factored.
bool takes_square_root(const cardan_hinge_family& family);

/// The parameters of a body checked in the same way; empty after a fault.
std::optional<ParamTable> body_params(const SystemSpec& spec, const BodySpec& body, const cardan_body_family& family, DiagnosticSink& sink);

/// What the family refused of them; `whole`: the code of what is said of the body as such.
void report_refused(const SystemSpec& spec, const BodySpec& body, const cardan_body_family& family, const ParamTable& values, Code whole,
                    DiagnosticSink& sink);

/// Fills mass, com and inertia_com of a body whose family computes them from its parameters (CARDAN_MASS_COMPUTED); others stay as they
/// are. Faults go to the sink.
void compute_mass(const SystemSpec& spec, BodySpec& body, const cardan_body_family& family, DiagnosticSink& sink);

/// Why no body has this tensor about its mass centre; empty texts: one can.
struct InertiaFault {
  std::string expected, got, hint;  // the hint is empty where nothing is known
};
/// `point`: of a mass at a point, which may have no extent in a direction, or none at all.
InertiaFault inertia_fault(const Eigen::Matrix3d& I, bool point);

/// "bodies.<name>", the key path of a body.
std::string body_path(const BodySpec& body);

/// True if nothing holds the frame of these modes to a point of the body: mean axes, sum m phi = 0 and sum m r x phi = 0 (I3 = I4 =
/// 0). A hinge on such a frame moves no mode and is moved by none.
bool has_mean_axes(const ModalData& modal);

}  // namespace cardan
