/* A device and a field as a plugin of contract 2.1, in C11. Built against the headers beside it, which never change.
 * frozen/paddle: a paddle at a node that turns in a viscous liquid, moment -c w; it counts its samples, and adds up the angular
 * acceleration of another node along x. frozen/coil: the magnetic field of a long coil along z that fades away over time. */
#include <math.h>
#include <string.h>

#include "cardan_device.h"
#include "cardan_field.h"

static const cardan_param_desc paddle_params[] = {{.name = "drag",
                                                   .kind = CARDAN_NUMBER,
                                                   .flags = CARDAN_ABOVE,
                                                   .unit = "N m s/rad",
                                                   .upper = 10,
                                                   .fallback = {1},
                                                   .meaning = "moment over rate"}};
static const cardan_mount_desc paddle_mounts[] = {
    {"at", CARDAN_MOUNT_NODE, CARDAN_USE_VELOCITY | CARDAN_USE_LOAD, "the node that carries it"},
    {"sense", CARDAN_MOUNT_NODE, CARDAN_USE_ACCELERATION, "the node whose acceleration is added up"}};
static const cardan_port_desc paddle_ports[] = {
    {.name = "load", .kind = CARDAN_PORT_IN, .unit = "1", .meaning = "factor of the drag less 1", .flags = CARDAN_PORT_REQUIRED},
    {.name = "moment", .kind = CARDAN_PORT_OUT, .unit = "N m", .direct = 1, .meaning = "along x", .frame = "at"}};
static const cardan_state_desc paddle_states[] = {{"turned", "rad/s", 0, 1, "alpha along x, added up"}};
static const cardan_state_desc paddle_marks[] = {{"samples", "1", 0, 1, "taken so far"}};

static int pack_paddle(const cardan_param_values* values, void* packed) {
  const double drag = *values->numbers(values, "drag", 0);
  memcpy(packed, &drag, sizeof drag);
  return 0;
}
static int turn_paddle(const cardan_device_args* a, cardan_device_out* out) {
  const double c = *(const double*)a->packed * (1 + a->in[0] * a->in[0]);
  for (int i = 0; i < 3; ++i) out->load[0].moment[i] = -c * a->mount[0].omega[i];
  out->out[0] = out->load[0].moment[0];
  return 0;
}
static int follow_paddle(const cardan_device_args* a, double* zdot) { return zdot[0] = a->mount[1].alpha[0], 0; }
static int tick_paddle(const cardan_device_args* a, double period, const double* noise, double* z, double* d) {
  (void)a, (void)noise, (void)z;
  if (period > 1e6) return 7;
  d[0] += 1;
  return 0;
}
static const char* explain_paddle(const void* packed, int code) { return (void)packed, code == 7 ? "a period beyond 1e6 s" : 0; }
static const cardan_device_family paddle = {.struct_size = sizeof paddle,
                                            .type = "frozen/paddle",
                                            .summary = "a paddle in a liquid",
                                            .params_size = sizeof(double),
                                            .params = paddle_params,
                                            .n_params = 1,
                                            .param_size = sizeof paddle_params[0],
                                            .mounts = paddle_mounts,
                                            .n_mounts = 2,
                                            .mount_size = sizeof paddle_mounts[0],
                                            .ports = paddle_ports,
                                            .n_ports = 2,
                                            .port_size = sizeof paddle_ports[0],
                                            .states = paddle_states,
                                            .n_states = 1,
                                            .state_size = sizeof paddle_states[0],
                                            .marks = paddle_marks,
                                            .n_marks = 1,
                                            .mark_size = sizeof paddle_marks[0],
                                            .pack = pack_paddle,
                                            .evaluate = turn_paddle,
                                            .tick = tick_paddle,
                                            .follow = follow_paddle,
                                            .explain = explain_paddle,
                                            .role = CARDAN_ROLE_FORCE};

static const cardan_param_desc coil_params[] = {
    {.name = "flux", .kind = CARDAN_NUMBER, .unit = "T", .lower = -1, .upper = 1, .fallback = {1}, .meaning = "at the start"}};
static const cardan_limit_desc coil_limits[] = {{"end", 1, "10 s"}};
static int pack_coil(const cardan_param_values* values, void* packed) {
  const double flux = *values->numbers(values, "flux", 0);
  memcpy(packed, &flux, sizeof flux);
  return 0;
}
static int fade(double t, const void* packed, void* prepared) {
  *(double*)prepared = *(const double*)packed * exp(-0.1 * (t < 10 ? t : 10));
  return t > 10;
}
static int coil_at(const cardan_field_args* a, uint32_t n, const double* points, double* values, double* gradients) {
  for (uint32_t i = 0; i < n; ++i) {
    values[3 * i] = values[3 * i + 1] = 0;
    values[3 * i + 2] = *(const double*)a->prepared;
  }
  if (gradients) memset(gradients, 0, 9 * n * sizeof *gradients);
  return (void)points, 0;
}
static const cardan_field_family coil = {.struct_size = sizeof coil,
                                         .type = "frozen/coil",
                                         .summary = "the field inside of a long coil",
                                         .quantity = CARDAN_MAGNETIC,
                                         .facts = CARDAN_FIELD_GRADIENT | CARDAN_FIELD_SOURCE_FREE | CARDAN_FIELD_CURL_FREE,
                                         .params_size = sizeof(double),
                                         .params = coil_params,
                                         .n_params = 1,
                                         .param_size = sizeof coil_params[0],
                                         .limits = coil_limits,
                                         .n_limits = 1,
                                         .limit_size = sizeof coil_limits[0],
                                         .pack = pack_coil,
                                         .evaluate = coil_at,
                                         .prepared_size = sizeof(double),
                                         .prepare = fade};

static const void* family(const char* kind, uint32_t i) {
  if (i == 0 && strcmp(kind, CARDAN_KIND_DEVICE) == 0) return &paddle;
  return i == 0 && strcmp(kind, CARDAN_KIND_FIELD) == 0 ? &coil : 0;
}
static const cardan_plugin plugin = {sizeof plugin, CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "frozen", "2.1", "Apache-2.0", family};
CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host* host) { return (void)host, &plugin; }
