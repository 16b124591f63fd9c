#include "tests/abi/2.6/layout.h"

#include "cardan_field.h"

#define CONSTANT(name)
#define FIELD(type, member) {#type "." #member, offsetof(type, member), sizeof(((type*)0)->member)},
const struct frozen_field frozen_fields_2_6[] = {
#include "fields.inc"
};
#undef FIELD
#undef CONSTANT
#define FIELD(type, member)
#define CONSTANT(name) {#name, (long)name},
const struct frozen_constant frozen_constants_2_6[] = {
#include "fields.inc"
};
const size_t n_frozen_fields_2_6 = sizeof frozen_fields_2_6 / sizeof frozen_fields_2_6[0];
const size_t n_frozen_constants_2_6 = sizeof frozen_constants_2_6 / sizeof frozen_constants_2_6[0];
