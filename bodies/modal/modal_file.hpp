#pragma once
// Modal data in an HDF5 file: every member of ModalData under its own name, lists of structures as numbered groups.
#include <string>

#include "core/spatial/modal_data.hpp"

namespace cardan {

/// 16 hexadecimal digits over every number and text of `data` but content_hash itself (FNV-1a, 64 bits): equal for
/// equal data.
std::string content_hash(const ModalData& data);

/// Replaces the file. Throws InputError C0701 when it cannot be written.
void write_modal_file(const std::string& path, const ModalData& data);

/// Throws InputError C0702 when the file is not there, is not a modal file of this version, or its content hash does
/// not fit.
ModalData read_modal_file(const std::string& path);

}  // namespace cardan
