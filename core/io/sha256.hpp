#pragma once
// Fingerprints of inputs and plugins, recorded with each result.
#include <string>
#include <string_view>

namespace cardan {

/// SHA-256 (FIPS 180-4) as 64 hexadecimal digits.
std::string sha256(std::string_view bytes);
/// The same of a file's content. Throws InputError C0102 when it cannot be read.
std::string sha256_of_file(const std::string& path);

}  // namespace cardan
