#pragma once
// What a flexible body brings to the sweeps: the constants of its inertia, its elasticity, its nodes. Steps of assemble().
#include "core/base/diagnostic.hpp"
#include "core/model/model.hpp"

namespace cardan {

/// Shapes of node i of the modal data, in the frame of the body.
NodeShapes shapes_of(const ModalData& modal, std::size_t i, const cardan_body_family& family);

/// A node of a body as the spec gives it, in the user's body frame. A rigid body needs no family.
NodeShapes node_of(const BodySpec& body, const std::string& node, const cardan_body_family* family = nullptr);

/// The constants of body, whose family is given. A body that the family cannot take is reported.
FlexibleBody flexible_of(const SystemSpec& spec, const BodySpec& body, const cardan_body_family& family, DiagnosticSink& sink);

/// dJ/d eta_k = I8_k + I8_k* (+ rotary), and at level 2 d^2 J / d eta_k d eta_l = I9 + I9*: for the gradient of gravity.
/// Where the velocity terms of the family say otherwise of the modes at rest, b_e(omega) = -1/2 omega* dJ_k omega, it is left to them.
void add_inertia_derivatives(FlexibleBody& body);

/// Which flexible bodies are eliminated through their outboard nodes (flexible.md, 7), and the constants for it.
void prepare_nodes(Model& model);

}  // namespace cardan
