#pragma once
// Which terms of nodal rotary inertia a flexible body keeps: a step of compile(). docs/mathematics/flexible.md, section 2.
#include <memory>

#include "core/base/diagnostic.hpp"
#include "core/model/spec.hpp"

namespace cardan {

/// The spec with the modal data of each body as its `rotary_tolerance` asks for: itself where nothing is left out. What is kept is one mass
/// matrix for all, the dense twin included.
std::shared_ptr<const SystemSpec> with_kept_rotary_terms(std::shared_ptr<const SystemSpec> spec);

/// Reports (C0321) a body at level 2 whose data have rotary terms of first order alone, where more was asked for.
void expect_rotary_terms(const BodySpec& body, DiagnosticSink& sink);

}  // namespace cardan
