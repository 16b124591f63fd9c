/* Where contract 2.4 has what it added to bodies, as a C compiler sees its headers. */
#ifndef CARDAN_TESTS_ABI_STATES_LAYOUT_H
#define CARDAN_TESTS_ABI_STATES_LAYOUT_H
#include "tests/abi/2.0/layout.h"

#ifdef __cplusplus
extern "C" {
#endif
extern const struct frozen_field frozen_fields_2_4[];
extern const struct frozen_constant frozen_constants_2_4[];
extern const size_t n_frozen_fields_2_4, n_frozen_constants_2_4;
#ifdef __cplusplus
}
#endif
#endif
