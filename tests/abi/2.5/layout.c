#include "tests/abi/2.5/layout.h"

#include "cardan_device.h"

#define CONSTANT(name) {#name, (long)name},
const struct frozen_constant frozen_constants_2_5[] = {
#include "fields.inc"
};
#undef CONSTANT
const size_t n_frozen_constants_2_5 = sizeof frozen_constants_2_5 / sizeof frozen_constants_2_5[0];
