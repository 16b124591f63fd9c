#pragma once
// Changes to an HDF5 file through the interface of its library: what a hostile but sound file may hold.
#include <string>

#include "tests/fuzz/fuzz.hpp"

namespace cardan::fuzz {

/// One to four changes: objects removed, replaced by others, retyped, reshaped, filled with odd numbers; attributes removed or retyped;
/// links that lead in a circle, twice to one group, or to another file.
void mutate_hdf5(const std::string& path, Random& random);

// Single changes, for tests by name.
void link_group_into_itself(const std::string& path, const std::string& group);
void link_softly(const std::string& path, const std::string& from, const std::string& to);
void link_to_file(const std::string& path, const std::string& from, const std::string& file);
void make_huge(const std::string& path, const std::string& dataset, int rank);
void make_external(const std::string& path, const std::string& dataset, const std::string& file);

}  // namespace cardan::fuzz
