#pragma once
// A frozen header against the present one: members where they were, constants what they were.
#include <gtest/gtest.h>

#include <cstddef>
#include <map>
#include <span>
#include <string>

#include "tests/abi/2.0/layout.h"

namespace cardan {

struct Place {
  std::size_t offset, size;
};

inline void expect_where_they_were(std::span<const frozen_field> frozen, const std::map<std::string, Place>& present) {
  ASSERT_EQ(frozen.size(), present.size());
  for (const frozen_field& f : frozen) {
    EXPECT_EQ(present.at(f.name).offset, f.offset) << f.name;
    EXPECT_EQ(present.at(f.name).size, f.size) << f.name;
  }
}
inline void expect_what_they_were(std::span<const frozen_constant> frozen, const std::map<std::string, long>& present) {
  ASSERT_EQ(frozen.size(), present.size());
  for (const frozen_constant& c : frozen) EXPECT_EQ(present.at(c.name), c.value) << c.name;
}

}  // namespace cardan
