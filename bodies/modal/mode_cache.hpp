#pragma once
// Modes that were computed before, in a folder: found by the content of their source, never by the place of a file.
#include <cstdint>
#include <filesystem>
#include <string>

#include "bodies/modal/modal_source.hpp"

namespace cardan {

/// One file for each source of finite elements (beams, plates), named by the SHA-256 of all that the modes depend on: every
/// number of the source, the sources of this program that solve it, its compiler, the kind of processor. A file holds its own
/// SHA-256; what is damaged, foreign or cannot be read is passed over, what cannot be written is not kept: no error comes
/// from a cache. Files are replaced whole, so that processes may share a folder. The least recently used go first.
class ModeCache {
 public:
  static constexpr std::uintmax_t kLimit = 256u << 20;  // [bytes] of all files; one of them may take a quarter

  ModeCache() = default;  ///< finds nothing and keeps nothing
  explicit ModeCache(std::filesystem::path folder, std::uintmax_t limit = kLimit) : folder_(std::move(folder)), limit_(limit) {}

  /// That of the user: the environment variable CARDAN_CACHE, `off` or a folder; else cardan/modes in XDG_CACHE_HOME or
  /// ~/.cache. None where none of them is set.
  static ModeCache of_user();

  struct Modes {
    ModalData data;
    bool from_cache = false;
  };
  /// make_modal_data(), or what it gave for the same source before: the same bits and the same warnings. Throws what it throws.
  Modes make(const ModalSource& source, Warnings* warnings = nullptr) const;

  const std::filesystem::path& folder() const { return folder_; }  ///< empty: none
  /// The name of the file of a source of finite elements; empty for others, which are not kept.
  static std::string name_of(const ModalSource& source);

 private:
  bool find(const std::string& name, const ModalSource& source, ModalData& data, Warnings& warnings) const;
  void keep(const std::string& name, const ModalSource& source, const ModalData& data, const Warnings& warnings) const;
  void make_room() const;

  std::filesystem::path folder_;
  std::uintmax_t limit_ = 0;
};

}  // namespace cardan
