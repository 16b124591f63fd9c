#pragma once
// What a description may say but hardly means: the warnings that need no simulation.
#include "core/model/model.hpp"

namespace cardan {

/// About hinges, springs and where they attach, once the modal data are there.
Warnings doubts(const SystemSpec& spec);

/// Springs and loads of hinges that are locked, which do nothing as long as that is so; but of these bodies.
Warnings held_back(const SystemSpec& spec, const std::vector<std::string>& but = {});
/// Devices at such hinges.
Warnings idle_at_hinges(const Model& model, const std::vector<std::string>& but = {});

/// Keys of the schema of a device that do not apply as its other keys choose it, as the length of a sphere; and those of them that are
/// given, of fields too.
std::vector<std::string> keys_not_read(const Model& model, const Device& device);
Warnings idle_keys(const Model& model);

/// About a vehicle that begins at (q, v): hinges beyond their stops, devices that push one body against itself, rates that closed loops
/// were given by the assembler and that nobody can have meant.
Warnings doubts_at_start(const Model& model, const double* q, const double* v);
/// The last of these alone, of what the assembler has moved.
Warnings fast_found_rates(const Model& model, const std::vector<MovedAtStart>& moved, const double* v);

}  // namespace cardan
