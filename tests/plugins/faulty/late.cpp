// A plugin whose every type obeys the laws, until its slide has come to 0.75 m: then it has the fault that CARDAN_FAULT names.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

#include "core/abi/cardan_body.h"
#include "core/abi/cardan_device.h"
#include "core/abi/cardan_field.h"
#include "tests/plugins/told_modal.hpp"

namespace {

bool late = false;  // no sample of the laws is there, a run is

bool fault(const char* name) {
  const char* asked = std::getenv("CARDAN_FAULT");
  return late && asked && std::strcmp(asked, name) == 0;
}
/// What is added to a number by a fault of these.
double fault_in(const char* thrown, const char* nan, const char* hidden) {
  if (fault(thrown)) throw std::runtime_error("no luck today");
  static int calls = 0;
  return fault(nan) ? std::nan("") : fault(hidden) ? 1e-9 * ++calls : 0.0;
}

// ---- a slide along x ----

const char *const q_names[] = {"s"}, *const q_units[] = {"m"}, *const v_names[] = {"rate"}, *const v_units[] = {"m/s"};
int pack(const cardan_param_values*, void*) { return 0; }
void kinematics(const void*, std::uint32_t n, const std::uint32_t* iq, const std::uint32_t*, const double* q, const double*,
                cardan_hinge_out* out) {
  late = late || std::abs(q[iq[0]] - 0.75) < 1e-7;
  const double wrong = fault_in("throw_hinge", "nan_hinge", "hidden_hinge");
  for (std::uint32_t j = 0; j < n; ++j) out[j] = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {q[iq[j]], 0, 0}, {0, 0, 0, 1}, {0, 0, 0, wrong, 0, 0}};
}
void qdot(const void*, const double*, const double* v, double* out) { *out = *v; }

// ---- a body with modes, that of Cardan, that tells how its nodes move ----

void mass(const void* packed, const double* eta, double* M_rr, double* M_re, double* M_ee) {
  const double wrong = fault_in("throw_body", "nan_body", "hidden_body");
  cardan::test::told_modal().mass(packed, eta, M_rr, M_re, M_ee);
  if (M_rr) M_rr[0] += wrong;
}
void node(const void* packed, std::uint32_t i, const double* eta, const double* etadot, double* x, double* S, double* a) {
  const double wrong = fault_in("throw_node", "nan_node", "hidden_node");
  cardan::test::told_modal().node(packed, i, eta, etadot, x, S, a);
  if (x) x[3] += wrong;
}

// ---- a force of 2 N against the rate of the slide, and what flows by ----

const cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_POSE | CARDAN_USE_LOAD, "a node"},
                                    {"air", CARDAN_MOUNT_FIELD, CARDAN_DENSITY, "a field"}};
const cardan_port_desc ports[] = {{"density", CARDAN_PORT_OUT, "kg/m^3", 0.0, 0, "of the air", nullptr, 0, nullptr}};
const cardan_state_desc states[] = {{"sum", "s", 0.0, 1.0, "grows with time"}};
int push(const cardan_device_args* a, cardan_device_out* o) {
  if (fault("code_device")) return 7;
  if (fault("stuck_device")) {
    std::fputs("stuck\n", stderr);
    for (volatile bool on = true; on;) {
    }
  }
  if (fault("overrun_device")) o->zdot[1] = 3.0;
  o->load[0].force[1] = 1e-3 + fault_in("throw_device", "nan_device", "hidden_device");
  o->zdot[0] = 1.0, o->out[0] = a->mount[1].field[0];
  return 0;
}
void at_root(const cardan_device_args* a, double* g) { g[0] = a->t - 0.76; }
void pass(const cardan_device_args*, std::uint32_t, int, double*, double*) {}
int impulse(const cardan_device_args*, std::uint32_t, int, cardan_mount_load* load) {
  if (fault("code_impulse")) return 7;
  load[0].force[1] = 1e-3 + fault_in("throw_impulse", "nan_impulse", "");
  return 0;
}
const char* explain(const void*, int code) { return code == 7 ? "it has had enough" : nullptr; }

// ---- air that is the same everywhere ----

int air(const cardan_field_args*, std::uint32_t n, const double*, double* values, double*) {
  const double wrong = fault_in("throw_field", "nan_field", "hidden_field");
  for (std::uint32_t i = 0; i < n; ++i) values[i] = 1.0 + wrong;
  if (fault("overrun_field")) values[n] = 3.0;
  return fault("code_field") ? -1 : 0;
}

const void* family(const char* kind, std::uint32_t i) {
  static cardan_hinge_family slide{};
  slide.struct_size = sizeof slide, slide.type = "late/slide", slide.summary = "a slide along x";
  slide.nq = slide.nv = 1, slide.shape = CARDAN_SHAPE_DENSE;
  slide.q_names = q_names, slide.q_units = q_units, slide.v_names = v_names, slide.v_units = v_units;
  slide.pack = pack, slide.kinematics = kinematics, slide.qdot = qdot;
  static cardan_body_family wing = cardan::test::told_modal();
  wing.type = "late/wing", wing.mass = mass, wing.node = node;
  static cardan_device_family pusher{};
  pusher.struct_size = sizeof pusher, pusher.type = "late/push", pusher.summary = "pushes";
  pusher.mounts = mounts, pusher.n_mounts = 2, pusher.mount_size = sizeof mounts[0];
  pusher.ports = ports, pusher.n_ports = 1, pusher.port_size = sizeof ports[0];
  pusher.states = states, pusher.n_states = 1, pusher.state_size = sizeof states[0];
  pusher.evaluate = push, pusher.explain = explain;
  pusher.n_roots = 1, pusher.roots = at_root, pusher.event = pass, pusher.impulse = impulse;
  static cardan_field_family even{};
  even.struct_size = sizeof even, even.type = "late/air", even.summary = "even", even.quantity = CARDAN_DENSITY;
  even.facts = CARDAN_FIELD_STEADY, even.evaluate = air;
  if (i > 0) return nullptr;
  if (std::strcmp(kind, CARDAN_KIND_HINGE) == 0) return &slide;
  if (std::strcmp(kind, CARDAN_KIND_BODY) == 0) return &wing;
  if (std::strcmp(kind, CARDAN_KIND_DEVICE) == 0) return &pusher;
  return std::strcmp(kind, CARDAN_KIND_FIELD) == 0 ? &even : nullptr;
}
const cardan_plugin plugin{sizeof plugin, CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "late", "1", "Apache-2.0", family};

}  // namespace

extern "C" CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host*) { return &plugin; }
