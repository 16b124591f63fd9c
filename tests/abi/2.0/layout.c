#include "layout.h"

#include "cardan_abi.h"

#define CONSTANT(name)
#define FIELD(type, member) {#type "." #member, offsetof(type, member), sizeof(((type*)0)->member)},
const struct frozen_field frozen_fields[] = {
#include "fields.inc"
};
#undef FIELD
#undef CONSTANT
#define FIELD(type, member)
#define CONSTANT(name) {#name, (long)name},
const struct frozen_constant frozen_constants[] = {
#include "fields.inc"
};
const size_t n_frozen_fields = sizeof frozen_fields / sizeof frozen_fields[0];
const size_t n_frozen_constants = sizeof frozen_constants / sizeof frozen_constants[0];
