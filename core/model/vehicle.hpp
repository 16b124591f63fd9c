#pragma once
// The vehicle schema: a document (as written in YAML) to a SystemSpec. The grammar is described in docs/scenario.md.
#include "core/abi/registry.hpp"
#include "core/model/doc_node.hpp"
#include "core/model/schema.hpp"
#include "core/model/spec.hpp"

namespace cardan {

/// Reads and validates. Faults go to the sink; the result is of use only if there are none. The sources of modes are
/// handed on as written (BodySpec::modal_source), for bodies/vehicle to turn into modal data. `described`: of whose hinges the units of
/// devices are, if not of those that are read.
SystemSpec vehicle_from_doc(const DocNode& root, const Registry& registry, DiagnosticSink& sink, const SystemSpec* described = nullptr);

/// Inertia about the mass centre from `[xx, yy, zz]` or `{xx, yy, zz, xy, xz, yz, about}`, for a body or a point mass.
Eigen::Matrix3d read_inertia(const DocRef& value, double mass, const Eigen::Vector3d& com, ReadContext& context);

}  // namespace cardan
