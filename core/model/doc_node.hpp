#pragma once
// A description as it was written, before it means anything: scalars, lists and maps with their places. Made by the
// YAML reader (and by anyone who has a table of texts), read by schema.hpp.
#include <string>
#include <string_view>
#include <vector>

#include "core/base/diagnostic.hpp"

namespace cardan {

struct DocKey {
  std::string name;
  SourceMark mark;
};

struct DocNode {
  enum class Kind { empty, scalar, list, map };
  Kind kind = Kind::empty;
  std::string text;            // scalar
  std::vector<DocKey> keys;    // map: keys[i] belongs to items[i]; no key twice
  std::vector<DocNode> items;  // list and map
  SourceMark mark;             // of the value; of its key where the value begins on a later line

  const DocNode* find(std::string_view key) const {
    for (std::size_t i = 0; i < keys.size(); ++i)
      if (keys[i].name == key) return &items[i];
    return nullptr;
  }
};

}  // namespace cardan
