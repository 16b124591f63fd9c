#pragma once
// Which velocities a run integrates, and what its accelerations are by.
#include <cstdint>
#include <string>
#include <vector>

namespace cardan {

enum class Dynamics : std::uint8_t {
  standard,            ///< v
  diagonalised,        ///< nu, in which the mass matrix is the identity
  diagonalised_rates,  ///< nu in the units of v, in which it is block-diagonal
  dense                ///< v, by the dense twin in place of the sweeps
};
/// As a mission names them, in the order of the enumerators.
inline const std::vector<std::string>& dynamics_names() {
  static const std::vector<std::string> names = {"standard", "diagonalised", "diagonalised_rates", "dense"};
  return names;
}
inline const std::string& name_of(Dynamics dynamics) { return dynamics_names()[static_cast<std::size_t>(dynamics)]; }
inline bool is_diagonalised(Dynamics dynamics) { return dynamics == Dynamics::diagonalised || dynamics == Dynamics::diagonalised_rates; }

}  // namespace cardan
