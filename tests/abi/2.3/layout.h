/* Where contract 2.3 has the members of bodies, as a C compiler sees its headers. */
#ifndef CARDAN_TESTS_ABI_BODY_LAYOUT_H
#define CARDAN_TESTS_ABI_BODY_LAYOUT_H
#include "tests/abi/2.0/layout.h"

#ifdef __cplusplus
extern "C" {
#endif
extern const struct frozen_field frozen_fields_2_3[];
extern const struct frozen_constant frozen_constants_2_3[];
extern const size_t n_frozen_fields_2_3, n_frozen_constants_2_3;
#ifdef __cplusplus
}
#endif
#endif
