/* Bodies as a plugin of contract 2.3, in C11. Built against the headers beside it, which never change.
 * frozen/slab: a square slab of one material. frozen/hanger: half of the mass of the modal data stands at the origin, on a frame with
 * moments of inertia 3, 4 and 5 kg m^2, the other half hangs 2 m below on a rod that turns about y by the one coordinate; so do nodes. */
#include <math.h>
#include <string.h>

#include "cardan_body.h"

static const cardan_param_desc slab_params[] = {
    {.name = "edge", .kind = CARDAN_NUMBER, .flags = CARDAN_ABOVE, .unit = "m", .upper = 100, .fallback = {2}, .meaning = "of the square"},
    {.name = "areal",
     .kind = CARDAN_NUMBER,
     .flags = CARDAN_ABOVE,
     .unit = "kg/m^2",
     .upper = 1e4,
     .fallback = {3},
     .meaning = "mass per area"}};
static int slab_rigid(const cardan_param_values* values, double* mass, double com[3], double inertia[6]) {
  const double a = *values->numbers(values, "edge", 0);
  *mass = a * a * *values->numbers(values, "areal", 0);
  for (int i = 0; i < 3; ++i) com[i] = 0, inertia[i] = *mass * a * a / (i < 2 ? 12 : 6), inertia[3 + i] = 0;
  return 0;
}
static const cardan_body_family slab = {.struct_size = sizeof slab,
                                        .type = "frozen/slab",
                                        .summary = "a square slab",
                                        .mass_source = CARDAN_MASS_COMPUTED,
                                        .n_params = 2,
                                        .param_size = sizeof slab_params[0],
                                        .params = slab_params,
                                        .rigid = slab_rigid};

static const double rod = 2, frame[3] = {3, 4, 5};
static uint64_t hanger_size(const cardan_param_values* values, const cardan_modal_view* view) {
  return (void)values, (void)view, sizeof(double);
}
static int hanger_pack(const cardan_param_values* values, const cardan_modal_view* view, void* packed) {
  const double half = view->I1 / 2;
  memcpy(packed, &half, sizeof half);
  if (view->n_modes == 1) return 0;
  values->fail(values, 0, "one coordinate", "others", 0);
  return 1;
}
static void hanger_facts(const void* packed, cardan_body_facts* facts) { (void)packed, facts->m_ee_constant = 1; }
/* Of the mass that hangs: its place and how that changes with the angle. */
static void hang(double angle, double r[3], double dr[3]) {
  r[0] = -rod * sin(angle), r[1] = 0, r[2] = -rod * cos(angle);
  dr[0] = r[2], dr[1] = 0, dr[2] = -r[0];
}
static void hanger_mass(const void* packed, const double* eta, double* M_rr, double* M_re, double* M_ee) {
  const double m = *(const double*)packed;
  double r[3], dr[3];
  hang(eta[0], r, dr);
  if (M_ee) M_ee[0] = m * rod * rod;
  if (M_re) {
    M_re[0] = M_re[2] = 0, M_re[1] = m * rod * rod;
    for (int i = 0; i < 3; ++i) M_re[3 + i] = m * dr[i];
  }
  if (!M_rr) return;
  M_rr[0] = 2 * m;
  for (int i = 0; i < 3; ++i) M_rr[1 + i] = m * r[i], M_rr[4 + i] = frame[i] + m * (rod * rod - r[i] * r[i]);
  M_rr[7] = -m * r[0] * r[1], M_rr[8] = -m * r[0] * r[2], M_rr[9] = -m * r[1] * r[2];
}
static void cross(const double a[3], const double b[3], double out[3]) {
  out[0] = a[1] * b[2] - a[2] * b[1], out[1] = a[2] * b[0] - a[0] * b[2], out[2] = a[0] * b[1] - a[1] * b[0];
}
static void hanger_bias(const void* packed, const double* eta, const double* etadot, const double* omega, double* b) {
  const double m = *(const double*)packed;
  double r[3], dr[3], spin[3], wr[3], wwr[3], wdr[3], f[3];
  hang(eta[0], r, dr);
  cross(omega, r, wr), cross(omega, wr, wwr), cross(omega, dr, wdr);
  for (int i = 0; i < 3; ++i) f[i] = m * (wwr[i] + 2 * etadot[0] * wdr[i] - etadot[0] * etadot[0] * r[i]), spin[i] = frame[i] * omega[i];
  cross(omega, spin, b), cross(r, f, spin);
  for (int i = 0; i < 3; ++i) b[i] += spin[i], b[3 + i] = f[i];
  b[6] = dr[0] * f[0] + dr[1] * f[1] + dr[2] * f[2];
}
/* All nodes turn about y by the angle, and stand on the rod's end. */
static void hanger_node(const void* packed, uint32_t node, const double* eta, const double* etadot, double* x, double* S, double* a) {
  double r[3], dr[3];
  (void)packed, (void)node;
  hang(eta[0], r, dr);
  for (int i = 0; i < 3; ++i) {
    if (x) x[i] = i == 1 ? eta[0] : 0, x[3 + i] = r[i] + (i == 2 ? rod : 0);
    if (S) S[i] = i == 1, S[3 + i] = dr[i];
    if (a) a[i] = 0, a[3 + i] = -etadot[0] * etadot[0] * r[i];
  }
}
static const cardan_body_family hanger = {.struct_size = sizeof hanger,
                                          .type = "frozen/hanger",
                                          .summary = "a mass that hangs on a rod",
                                          .mass_source = CARDAN_MASS_MODES,
                                          .packed_size = hanger_size,
                                          .pack = hanger_pack,
                                          .facts = hanger_facts,
                                          .mass = hanger_mass,
                                          .bias = hanger_bias,
                                          .node = hanger_node};

static const void* family(const char* kind, uint32_t i) {
  if (strcmp(kind, CARDAN_KIND_BODY) != 0) return 0;
  return i == 0 ? &slab : i == 1 ? &hanger : 0;
}
static const cardan_plugin plugin = {sizeof plugin, CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "frozen", "2.3", "Apache-2.0", family};
CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host* host) { return (void)host, &plugin; }
