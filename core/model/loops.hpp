#pragma once
// Closed loops of a description: names, places and types become what Model::loops holds (docs/mathematics/loops.md).
#include "core/abi/registry.hpp"
#include "core/model/model.hpp"

namespace cardan {

/// Closures that are no hinge type.
const std::vector<std::string>& closure_types();

/// Words of LoopForm, in its order.
const std::vector<std::string>& loop_forms();

/// Everything but what depends on the start. Places that are no named node become nodes of the model: "loops.<name>.from". Faults go to the
/// sink.
Loops compile_loops(const SystemSpec& spec, const Registry& registry, Model& model, DiagnosticSink& sink);

/// Throws InputError C0401 if the vehicle has closed loops. `what` does not honour them: "linear models".
void require_open_tree(const Model& model, std::string_view what);

/// Its program with the op `embedding`, or `absolute`, in place of `inward`, `acceleration` and `loops`, and back.
void sweep_embedded(Model& model);
void sweep_absolute(Model& model);
void sweep_open_tree(Model& model);

/// The same vehicle without what closes its loops: its poses, velocities and masses are those of the closed one. It takes wrenches on
/// nodes, as those of multipliers.
std::shared_ptr<const Model> open_tree(std::shared_ptr<const Model> model);

}  // namespace cardan
