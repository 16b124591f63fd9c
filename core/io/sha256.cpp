#include "core/io/sha256.hpp"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "core/base/diagnostic.hpp"

namespace cardan {

std::string sha256(std::string_view bytes) {
  std::array<unsigned char, 32> digest{};
  EVP_Digest(bytes.data(), bytes.size(), digest.data(), nullptr, EVP_sha256(), nullptr);
  return fmt::format("{:02x}", fmt::join(digest, ""));
}

std::string sha256_of_file(const std::string& path) {
  std::error_code none;
  std::ifstream in;
  if (std::filesystem::is_regular_file(path, none)) in.open(path, std::ios::binary);  // a device may never end
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  if (!in.is_open() || !in) refuse(Code::file_not_found, {"", {path}}, "a file that can be read");
  return sha256(bytes);
}

struct Sha256::Impl {
  EVP_MD_CTX* context = EVP_MD_CTX_new();
  Impl() { EVP_DigestInit_ex(context, EVP_sha256(), nullptr); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() { EVP_MD_CTX_free(context); }
};

Sha256::Sha256() : impl_(std::make_unique<Impl>()) {}
Sha256::~Sha256() = default;
Sha256::Sha256(Sha256&&) noexcept = default;
Sha256& Sha256::operator=(Sha256&&) noexcept = default;
void Sha256::add(const void* bytes, std::size_t size) { EVP_DigestUpdate(impl_->context, bytes, size); }

std::string Sha256::digest() const {
  const Impl copy;
  EVP_MD_CTX_copy_ex(copy.context, impl_->context);
  std::array<unsigned char, 32> digest{};
  EVP_DigestFinal_ex(copy.context, digest.data(), nullptr);
  return fmt::format("{:02x}", fmt::join(digest, ""));
}

}  // namespace cardan
