/* What contract 2.5 added to devices, as a C compiler sees its headers. */
#ifndef CARDAN_TESTS_ABI_HINGE_USES_LAYOUT_H
#define CARDAN_TESTS_ABI_HINGE_USES_LAYOUT_H
#include "tests/abi/2.0/layout.h"

#ifdef __cplusplus
extern "C" {
#endif
extern const struct frozen_constant frozen_constants_2_5[];
extern const size_t n_frozen_constants_2_5;
#ifdef __cplusplus
}
#endif
#endif
