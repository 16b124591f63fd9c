/* A device as a plugin of contract 2.5, in C11. Built against the headers beside it, which never change.
 * frozen/return: brings a hinge component that turns, and has a coordinate, back to zero. */
#include <string.h>

#include "cardan_device.h"

static const cardan_param_desc return_params[] = {{.name = "stiffness",
                                                   .kind = CARDAN_NUMBER,
                                                   .unit = "N m/rad",
                                                   .lower = 0,
                                                   .upper = 10,
                                                   .fallback = {1},
                                                   .meaning = "moment over angle"}};
static const cardan_mount_desc return_mounts[] = {
    {"at", CARDAN_MOUNT_HINGE, CARDAN_USE_LOAD | CARDAN_USE_TURN | CARDAN_USE_COORDINATE, "the component"}};

static int pack_return(const cardan_param_values* values, void* packed) {
  const double stiffness = *values->numbers(values, "stiffness", 0);
  memcpy(packed, &stiffness, sizeof stiffness);
  return 0;
}
static int pull(const cardan_device_args* a, cardan_device_out* out) {
  out->load[0].tau = -*(const double*)a->packed * a->mount[0].q;
  return 0;
}
static const cardan_device_family back = {.struct_size = sizeof back,
                                          .type = "frozen/return",
                                          .summary = "brings a hinge back",
                                          .params_size = sizeof(double),
                                          .params = return_params,
                                          .n_params = 1,
                                          .param_size = sizeof return_params[0],
                                          .mounts = return_mounts,
                                          .n_mounts = 1,
                                          .mount_size = sizeof return_mounts[0],
                                          .pack = pack_return,
                                          .evaluate = pull};

static const void* family(const char* kind, uint32_t i) { return i == 0 && strcmp(kind, CARDAN_KIND_DEVICE) == 0 ? &back : 0; }
static const cardan_plugin plugin = {sizeof plugin, CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "frozen", "2.5", "Apache-2.0", family};
CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host* host) { return (void)host, &plugin; }
