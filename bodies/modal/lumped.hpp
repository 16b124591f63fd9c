#pragma once
#include <vector>

#include "core/spatial/modal_data.hpp"

namespace cardan {

/// A body given by lumped masses and modes, as it stands. C may be empty (none). Shapes of zero size count as zero.
/// Throws InputError as check_stiffness(), check_mass_node() and check_nodes() do.
ModalData lumped_modal_data(std::vector<MassNode> mass_nodes, Eigen::MatrixXd K, Eigen::MatrixXd C, std::vector<ModalNode> nodes);

}  // namespace cardan
