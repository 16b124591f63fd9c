/* frozen/slide: a slide along x by gain q, as a plugin of contract 2.0. Built against the header beside it, which never changes. */
#include <stdlib.h>
#include <string.h>

#include "cardan_abi.h"

static const char* const senses[] = {"forward", "backward"};
static const cardan_param_desc schema[] = {
    {.name = "gain", .kind = CARDAN_NUMBER, .flags = CARDAN_ABOVE, .unit = "m", .upper = 10, .fallback = {1}, .meaning = "metres per unit"},
    {.name = "sense", .kind = CARDAN_CHOICE, .names = senses, .count = 2, .meaning = "which way"},
    {.name = "gears", .kind = CARDAN_INTEGER, .unit = "1", .lower = 1, .upper = 5, .fallback = {1}, .meaning = "how often the gain"},
    {.name = "gain_file", .kind = CARDAN_FILE, .meaning = "a text that is the gain, in place of `gain`"}};
static const char *const q_names[] = {"s"}, *const q_units[] = {"1"}, *const v_names[] = {"rate"}, *const v_units[] = {"1/s"};

static int pack(const cardan_param_values* values, void* packed) {
  uint64_t size = 0;
  const char* content = values->bytes(values, "gain_file", &size);
  char text[32] = "";
  if (content && size < sizeof text) memcpy(text, content, size);
  if (content && atof(text) <= 0) {
    values->fail(values, "gain_file", "a file with a number > 0", 0, 0);
    return 1;
  }
  const double gain = (content ? atof(text) : *values->numbers(values, "gain", 0)) * *values->numbers(values, "gears", 0);
  const double signed_gain = strcmp(values->text(values, "sense"), "backward") == 0 ? -gain : gain;
  memcpy(packed, &signed_gain, sizeof signed_gain);
  return 0;
}
static void kinematics(const void* packed, uint32_t n, const uint32_t* iq, const uint32_t* iv, const double* q, const double* v,
                       cardan_hinge_out* out) {
  for (uint32_t j = 0; j < n; ++j) {
    const double gain = ((const double*)packed)[j];
    memset(&out[j], 0, sizeof out[j]);
    out[j].R_OP[0] = out[j].R_OP[4] = out[j].R_OP[8] = 1;
    out[j].p_OP[0] = gain * q[iq[j]];
    out[j].Ht[3] = gain;
  }
  (void)iv, (void)v;
}
static void qdot(const void* packed, const double* q, const double* v, double* out) { (void)packed, (void)q, out[0] = v[0]; }

static const cardan_hinge_family slide = {.struct_size = sizeof slide,
                                          .type = "frozen/slide",
                                          .summary = "a slide of contract 2.0",
                                          .nq = 1,
                                          .nv = 1,
                                          .shape = CARDAN_SHAPE_DENSE,
                                          .params_size = sizeof(double),
                                          .params = schema,
                                          .n_params = 4,
                                          .param_size = sizeof schema[0],
                                          .q_names = q_names,
                                          .q_units = q_units,
                                          .v_names = v_names,
                                          .v_units = v_units,
                                          .pack = pack,
                                          .kinematics = kinematics,
                                          .qdot = qdot};
static const void* family(const char* kind, uint32_t i) { return strcmp(kind, CARDAN_KIND_HINGE) == 0 && i == 0 ? &slide : 0; }
static const cardan_plugin plugin = {sizeof plugin, CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "frozen", "2.0", "Apache-2.0", family};

CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host* host) {
  const cardan_log* log = host->service(host, CARDAN_SERVICE_LOG);
  log->say(log, CARDAN_LOG_INFO, "contract 2.0");
  return &plugin;
}
