#pragma once
// Modal data in an HDF5 file: every member of ModalData under its own name, lists of structures as numbered groups. The
// layout, for those who write one: docs/modal_files.md.
#include <string>

#include "core/io/bounded_child.hpp"
#include "core/spatial/modal_data.hpp"

namespace cardan {

class Hdf5File;

/// 16 hexadecimal digits over every number and text of `data` but content_hash itself (FNV-1a, 64 bits): equal for
/// equal data.
std::string content_hash(const ModalData& data);

/// Replaces the file. Throws InputError C0701 when it cannot be written.
void write_modal_file(const std::string& path, const ModalData& data);

/// Read in a child process, so that a damaged file harms nobody. Throws InputError C0702 when the file is not there, is not
/// a modal file of this version, a part is missing or has another shape than it must have, or its content hash, if it has
/// one, does not fit; what modal_check.hpp throws when the numbers are not those of a body.
ModalData read_modal_file(const std::string& path);
ModalData read_modal_file(const std::string& path, const ChildLimits& limits);

/// The same from an open file, in this process: for a file whose bytes are sound.
ModalData modal_data_of(const Hdf5File& file);

/// The members as bytes for this build alone, and back; the content hash is not among them. modal_data_of_bytes() throws
/// std::out_of_range or InputError where the bytes are others.
std::string modal_bytes(const ModalData& data);
ModalData modal_data_of_bytes(const std::string& bytes);

}  // namespace cardan
