/* A device as a plugin of contract 2.2, in C11. Built against the headers beside it, which never change.
 * frozen/striker: strikes a node once, along x, and reads its rate, which holds until then. */
#include <string.h>

#include "cardan_device.h"

static const cardan_param_desc striker_params[] = {
    {.name = "blow", .kind = CARDAN_NUMBER, .unit = "N s", .lower = -10, .upper = 10, .fallback = {1}, .meaning = "what it gives at 1 s"}};
static const cardan_mount_desc striker_mounts[] = {
    {"at", CARDAN_MOUNT_NODE, CARDAN_USE_VELOCITY | CARDAN_USE_LOAD, "the node that it strikes"}};
static const cardan_port_desc striker_ports[] = {
    {.name = "rate", .kind = CARDAN_PORT_OUT, .unit = "rad/s", .meaning = "about x", .frame = "at", .valid = "whole"},
    {.name = "whole", .kind = CARDAN_PORT_OUT, .unit = "1", .meaning = "1 until it has struck"}};
static const cardan_state_desc striker_marks[] = {{"struck", "1", 0, 1, "1 from then on"}};

static int pack_striker(const cardan_param_values* values, void* packed) {
  const double blow = *values->numbers(values, "blow", 0);
  memcpy(packed, &blow, sizeof blow);
  return 0;
}
static int read_rate(const cardan_device_args* a, cardan_device_out* out) {
  out->out[0] = a->mount[0].omega[0];
  out->out[1] = a->d[0] == 0 ? 1 : 0;
  return 0;
}
static void at_one_second(const cardan_device_args* a, double* g) { g[0] = a->t - 1; }
static int strike(const cardan_device_args* a, uint32_t cause, int direction, cardan_mount_load* impulse) {
  if (cause == 0 && direction > 0) impulse[0].force[0] = *(const double*)a->packed;
  return 0;
}
static void note(const cardan_device_args* a, uint32_t root, int direction, double* z, double* d) {
  (void)a, (void)z;
  if (root == 0 && direction > 0) d[0] = 1;
}
static const cardan_device_family striker = {.struct_size = sizeof striker,
                                             .type = "frozen/striker",
                                             .summary = "strikes a node once",
                                             .params_size = sizeof(double),
                                             .params = striker_params,
                                             .n_params = 1,
                                             .param_size = sizeof striker_params[0],
                                             .mounts = striker_mounts,
                                             .n_mounts = 1,
                                             .mount_size = sizeof striker_mounts[0],
                                             .ports = striker_ports,
                                             .n_ports = 2,
                                             .port_size = sizeof striker_ports[0],
                                             .marks = striker_marks,
                                             .n_marks = 1,
                                             .mark_size = sizeof striker_marks[0],
                                             .n_roots = 1,
                                             .pack = pack_striker,
                                             .evaluate = read_rate,
                                             .roots = at_one_second,
                                             .event = note,
                                             .impulse = strike};

static const void* family(const char* kind, uint32_t i) { return i == 0 && strcmp(kind, CARDAN_KIND_DEVICE) == 0 ? &striker : 0; }
static const cardan_plugin plugin = {sizeof plugin, CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "frozen", "2.2", "Apache-2.0", family};
CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host* host) { return (void)host, &plugin; }
