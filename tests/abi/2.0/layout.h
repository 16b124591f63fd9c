/* Where contract 2.0 has its members, as a C compiler sees its header. */
#ifndef CARDAN_TESTS_ABI_LAYOUT_H
#define CARDAN_TESTS_ABI_LAYOUT_H
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif
struct frozen_field {
  const char* name;
  size_t offset, size;
};
struct frozen_constant {
  const char* name;
  long value;
};
extern const struct frozen_field frozen_fields[];
extern const struct frozen_constant frozen_constants[];
extern const size_t n_frozen_fields, n_frozen_constants;
#ifdef __cplusplus
}
#endif
#endif
