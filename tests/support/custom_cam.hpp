#pragma once
// The registry of everything built in and of the plugin custom_cam; a test that includes this depends on its target.
#include "tests/support/builders.hpp"

namespace cardan::test {

inline const Registry& registry_with_cam() {
  static const Registry all = [] {
    Registry r = registry();
    load_plugin(CARDAN_BINARY_DIR "/plugins/custom_cam.so", r);
    return r;
  }();
  return all;
}

}  // namespace cardan::test
