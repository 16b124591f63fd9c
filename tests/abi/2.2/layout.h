/* Where contract 2.2 has what it added to devices, as a C compiler sees its headers. */
#ifndef CARDAN_TESTS_ABI_IMPULSE_LAYOUT_H
#define CARDAN_TESTS_ABI_IMPULSE_LAYOUT_H
#include "tests/abi/2.0/layout.h"

#ifdef __cplusplus
extern "C" {
#endif
extern const struct frozen_field frozen_fields_2_2[];
extern const struct frozen_constant frozen_constants_2_2[];
extern const size_t n_frozen_fields_2_2, n_frozen_constants_2_2;
#ifdef __cplusplus
}
#endif
#endif
