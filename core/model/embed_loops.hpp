#pragma once
// Writes the program that closes loops inside of the sweeps, and chooses between its forms.
#include "core/model/embedding.hpp"

namespace cardan {

struct Model;

/// rows x nv scaled rows of the start, of which ranks are taken. `without_inertia`: the open tree has none in some direction there.
Embedding embed_loops(const Model& model, const std::vector<double>& scaled_rows, bool without_inertia, std::vector<LoopSet>& sets);
/// The same by rates (1) or by multipliers in the sweep (0), per loop; loops that share hinges or modes alike, by rates only where no modes
/// are on their way.
Embedding embed_loops(const Model& model, const std::vector<double>& scaled_rows, const std::vector<std::uint8_t>& by_rates);

}  // namespace cardan
