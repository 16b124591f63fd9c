/* Two hinges that turn about an axis, as an outsider writes them: `twin/revolute` says that it is a rotation, and the sweeps serve it by
 * their own kernels; `twin/dense` says nothing and gives the record of a general hinge, by the formula of Rodrigues. */
#include <math.h>
#include <string.h>

#include "core/abi/cardan_abi.h"

typedef struct {
  double u[3];
} axis_of;

static const cardan_param_desc schema[] = {{.name = "axis",
                                            .kind = CARDAN_UNIT_VECTOR,
                                            .unit = "1",
                                            .flags = CARDAN_REQUIRED,
                                            .meaning = "hinge axis, in the axes of the hinge nodes"}};
static const char *const q_names[] = {"angle"}, *const q_units[] = {"rad"}, *const v_names[] = {"rate"}, *const v_units[] = {"rad/s"};

static int pack(const cardan_param_values* values, void* packed) {
  memcpy(((axis_of*)packed)->u, values->numbers(values, "axis", 0), 3 * sizeof(double));
  return 0;
}
static void axis(const void* packed, double u[3], double* pitch) {
  memcpy(u, ((const axis_of*)packed)->u, 3 * sizeof(double));
  *pitch = 0;
}
/* R = 1 + sin q u~ + (1 - cos q) u~ u~ takes P axes to O axes; the axis is the same in both. */
static void kinematics(const void* packed, uint32_t n, const uint32_t* iq, const uint32_t* iv, const double* q, const double* v,
                       cardan_hinge_out* out) {
  for (uint32_t k = 0; k < n; ++k) {
    const double *u = ((const axis_of*)packed)[k].u, s = sin(q[iq[k]]), c = cos(q[iq[k]]);
    memset(&out[k], 0, sizeof out[k]);
    for (int i = 0; i < 9; ++i) out[k].R_OP[i] = (i % 4 == 0 ? c : 0) + (1 - c) * u[i / 3] * u[i % 3];
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, l = (i + 2) % 3; /* u~: row l, column j is u_i, row j, column l its negative */
      out[k].R_OP[3 * l + j] += s * u[i];
      out[k].R_OP[3 * j + l] -= s * u[i];
      out[k].Ht[i] = u[i];
    }
  }
  (void)iv, (void)v;
}
static void qdot(const void* packed, const double* q, const double* v, double* out) {
  (void)packed, (void)q;
  out[0] = v[0];
}

#define HINGE(name, text, form)                                                                                          \
  {                                                                                                                      \
    .struct_size = sizeof(cardan_hinge_family), .type = name, .summary = text, .nq = 1, .nv = 1, .shape = form,          \
    .params_size = sizeof(axis_of), .params = schema, .n_params = 1, .param_size = sizeof schema[0], .q_names = q_names, \
    .q_units = q_units, .v_names = v_names, .v_units = v_units, .pack = pack, .kinematics = kinematics, .qdot = qdot,    \
    .axis = form == CARDAN_SHAPE_ROTATION ? axis : 0                                                                     \
  }
static const cardan_hinge_family hinges[] = {HINGE("twin/revolute", "a rotation that says so", CARDAN_SHAPE_ROTATION),
                                             HINGE("twin/dense", "a rotation by its record alone", CARDAN_SHAPE_DENSE)};

static const void* family(const char* kind, uint32_t i) { return strcmp(kind, CARDAN_KIND_HINGE) == 0 && i < 2 ? &hinges[i] : 0; }
static const cardan_plugin plugin = {sizeof plugin, CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "twin", "1", "Apache-2.0", family};
CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host* host) {
  return host->abi_major == CARDAN_ABI_MAJOR ? &plugin : 0;
}
