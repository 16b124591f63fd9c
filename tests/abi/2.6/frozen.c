/* A field as a plugin of contract 2.6, in C11. Built against the headers beside it, which never change.
 * frozen/band: light between two planes across x alone. */
#include <string.h>

#include "cardan_field.h"

static const cardan_param_desc band_params[] = {{.name = "edges",
                                                 .kind = CARDAN_VECTOR,
                                                 .flags = CARDAN_EACH,
                                                 .unit = "m",
                                                 .fallback = {1, 1, 1},
                                                 .meaning = "the first and the second place from the middle; the third is not read"}};

static int pack_band(const cardan_param_values* values, void* packed) {
  memcpy(packed, values->numbers(values, "edges", 0), 3 * sizeof(double));
  return 0;
}
static int shine(const cardan_field_args* a, uint32_t n, const double* points, double* values, double* gradients) {
  const double* edges = (const double*)a->packed;
  (void)gradients;
  for (uint32_t i = 0; i < n; ++i) {
    values[3 * i] = points[3 * i] > -edges[0] && points[3 * i] < edges[1] ? 1361.0 : 0.0;
    values[3 * i + 1] = values[3 * i + 2] = 0.0;
  }
  return 0;
}
static uint32_t sides(const cardan_field_args* a, const double* point, double* g) {
  const double* edges = (const double*)a->packed;
  if (g) g[0] = point[0] + edges[0], g[1] = point[0] - edges[1];
  return 2;
}
static const cardan_field_family band = {.struct_size = sizeof band,
                                         .type = "frozen/band",
                                         .summary = "light in a band",
                                         .quantity = CARDAN_LIGHT,
                                         .params_size = 3 * sizeof(double),
                                         .params = band_params,
                                         .n_params = 1,
                                         .param_size = sizeof band_params[0],
                                         .pack = pack_band,
                                         .evaluate = shine,
                                         .edges = sides};

static const void* family(const char* kind, uint32_t i) { return i == 0 && strcmp(kind, CARDAN_KIND_FIELD) == 0 ? &band : 0; }
static const cardan_plugin plugin = {sizeof plugin, CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "frozen", "2.6", "Apache-2.0", family};
CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host* host) { return (void)host, &plugin; }
