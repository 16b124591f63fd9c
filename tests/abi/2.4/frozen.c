/* A body as a plugin of contract 2.4, in C11, which evaluates many states at once. Built against the headers beside it, which never change.
 * frozen/slider: half of the mass of the modal data stands at the origin, on a frame with moments of inertia 3, 4 and 5 kg m^2, the other
 * half slides along z by the one coordinate, 1 m beside the origin along x. */
#include <string.h>

#include "cardan_body.h"

static const double frame[3] = {3, 4, 5};
static uint64_t slider_size(const cardan_param_values* values, const cardan_modal_view* view) {
  return (void)values, (void)view, sizeof(double);
}
static int slider_pack(const cardan_param_values* values, const cardan_modal_view* view, void* packed) {
  const double half = view->I1 / 2;
  memcpy(packed, &half, sizeof half);
  if (view->n_modes == 1) return 0;
  values->fail(values, 0, "one coordinate", "others", 0);
  return 1;
}
static void slider_facts(const void* packed, cardan_body_facts* facts) {
  (void)packed, facts->m_ee_constant = facts->m_re_constant = facts->states = 1;
}
static void slider_mass(const void* packed, const double* eta, double* M_rr, double* M_re, double* M_ee) {
  const double m = *(const double*)packed, r[3] = {1, 0, eta[0]};
  if (M_ee) M_ee[0] = m;
  for (int i = 0; M_re && i < 6; ++i) M_re[i] = i == 1 ? -m : i == 5 ? m : 0;
  if (!M_rr) return;
  M_rr[0] = 2 * m;
  for (int i = 0; i < 3; ++i) M_rr[1 + i] = m * r[i], M_rr[4 + i] = frame[i] + m * (1 + eta[0] * eta[0] - r[i] * r[i]);
  M_rr[7] = 0, M_rr[8] = -m * r[0] * r[2], M_rr[9] = 0;
}
static void cross(const double a[3], const double b[3], double out[3]) {
  out[0] = a[1] * b[2] - a[2] * b[1], out[1] = a[2] * b[0] - a[0] * b[2], out[2] = a[0] * b[1] - a[1] * b[0];
}
static void slider_bias(const void* packed, const double* eta, const double* etadot, const double* omega, double* b) {
  const double m = *(const double*)packed, r[3] = {1, 0, eta[0]}, u[3] = {0, 0, etadot[0]};
  double spin[3], wr[3], wwr[3], wu[3], f[3];
  cross(omega, r, wr), cross(omega, wr, wwr), cross(omega, u, wu);
  for (int i = 0; i < 3; ++i) f[i] = m * (wwr[i] + 2 * wu[i]), spin[i] = frame[i] * omega[i];
  cross(omega, spin, b), cross(r, f, spin);
  for (int i = 0; i < 3; ++i) b[i] += spin[i], b[3 + i] = f[i];
  b[6] = f[2];
}
static void slider_states(const void* packed, uint32_t n, const double* eta, const double* etadot, const double* omega, double* M_rr,
                          double* M_re, double* M_ee, double* b) {
  for (uint32_t l = 0; l < n; ++l) {
    double w[3], rr[10], re[6], all[7];
    slider_mass(packed, eta + l, rr, re, M_ee ? M_ee + l : 0);
    for (uint32_t i = 0; i < 10; ++i) M_rr[i * n + l] = rr[i];
    for (uint32_t i = 0; M_re && i < 6; ++i) M_re[i * n + l] = re[i];
    if (!etadot) continue;
    for (uint32_t i = 0; i < 3; ++i) w[i] = omega[i * n + l];
    slider_bias(packed, eta + l, etadot + l, w, all);
    for (uint32_t i = 0; i < 7; ++i) b[i * n + l] = all[i];
  }
}
static const cardan_body_family slider = {.struct_size = sizeof slider,
                                          .type = "frozen/slider",
                                          .summary = "a mass that slides beside a frame",
                                          .mass_source = CARDAN_MASS_MODES,
                                          .packed_size = slider_size,
                                          .pack = slider_pack,
                                          .facts = slider_facts,
                                          .mass = slider_mass,
                                          .bias = slider_bias,
                                          .states = slider_states};

static const void* family(const char* kind, uint32_t i) { return strcmp(kind, CARDAN_KIND_BODY) == 0 && i == 0 ? &slider : 0; }
static const cardan_plugin plugin = {sizeof plugin, CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "frozen", "2.4", "Apache-2.0", family};
CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host* host) { return (void)host, &plugin; }
