#pragma once
// Finite-element models whose matrices another program made (docs/mathematics/modes.md, section 1).
#include <vector>

#include "bodies/modal/fe_model.hpp"
#include "bodies/modal/modal_source.hpp"

namespace cardan {

/// Reads the files, adds lumped masses, and sees that M is the mass matrix of a body with these nodes and that rigid motions take no
/// elastic and no damping force. Throws InputError: C0102, C0321 with the file and the line, C0323.
FeModel matrix_mesh(const MatrixModel&, const std::vector<PointMass>&, const Located& at);

}  // namespace cardan
