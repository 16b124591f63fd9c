/* What contract 2.6 added to parameters and fields, as a C compiler sees its headers. */
#ifndef CARDAN_TESTS_ABI_EDGES_LAYOUT_H
#define CARDAN_TESTS_ABI_EDGES_LAYOUT_H
#include "tests/abi/2.0/layout.h"

#ifdef __cplusplus
extern "C" {
#endif
extern const struct frozen_field frozen_fields_2_6[];
extern const struct frozen_constant frozen_constants_2_6[];
extern const size_t n_frozen_fields_2_6, n_frozen_constants_2_6;
#ifdef __cplusplus
}
#endif
#endif
