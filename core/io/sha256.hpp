#pragma once
// Fingerprints of inputs and plugins, recorded with each result.
#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

namespace cardan {

/// SHA-256 (FIPS 180-4) as 64 hexadecimal digits.
std::string sha256(std::string_view bytes);
/// The same of a file's content. Throws InputError C0102 when it cannot be read.
std::string sha256_of_file(const std::string& path);

/// The same of bytes that come one after the other.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;
  void add(const void* bytes, std::size_t size);
  /// Of all so far; more may follow.
  std::string digest() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cardan
