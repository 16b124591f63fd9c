// A plugin with the fault that the environment variable CARDAN_FAULT names; without it a good one: a slide along x.
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

#include "core/abi/cardan_constraint.h"

namespace {

bool fault(const char* name) {
  const char* asked = std::getenv("CARDAN_FAULT");
  return asked && std::strcmp(asked, name) == 0;
}

/// What a fault of this kind does where it is called: crash_pack, exit_kinematics ...
void misbehave(const char* place) {
  const char* asked = std::getenv("CARDAN_FAULT");
  const char* at = asked ? std::strchr(asked, '_') : nullptr;
  if (!at || std::strcmp(at + 1, place) != 0) return;
  if (std::strncmp(asked, "crash", 5) == 0) std::raise(SIGSEGV);
  if (std::strncmp(asked, "abort", 5) == 0) std::abort();
  if (std::strncmp(asked, "exit", 4) == 0) std::exit(0);
  if (std::strncmp(asked, "throw", 5) == 0) throw 42;
  if (std::strncmp(asked, "error", 5) == 0) throw std::runtime_error("no luck today");
  if (std::strncmp(asked, "loop", 4) == 0)
    while (std::getenv("CARDAN_FAULT")) {
    }
  if (std::strncmp(asked, "memory", 6) == 0)
    for (;;) std::memset(new char[1 << 20], 1, 1 << 20);
}

const struct AtLoad {
  AtLoad() { misbehave("load"); }
} at_load;

const cardan_param_desc schema[] = {{"gain", CARDAN_NUMBER, 0, "1", "metres per coordinate", {1, 0, 0}, 0, 0, 0, nullptr, nullptr}};
const char *const names[] = {"s"}, *const units[] = {"m"}, *const v_names[] = {"rate"}, *const v_units[] = {"m/s"};

int pack(const cardan_param_values* values, void* out) {
  misbehave("pack");
  std::memcpy(out, values->numbers(values, "gain", nullptr), sizeof(double));
  return 0;
}
void kinematics(const void* p, std::uint32_t n, const std::uint32_t* iq, const std::uint32_t*, const double* q, const double*,
                cardan_hinge_out* out) {
  misbehave("kinematics");
  for (std::uint32_t j = 0; j < n; ++j) {
    double gain;
    std::memcpy(&gain, static_cast<const char*>(p) + j * sizeof gain, sizeof gain);
    if (fault("law")) gain = -gain;
    out[j] = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {fault("law") ? -gain * q[iq[j]] : gain * q[iq[j]], 0, 0}, {0, 0, 0, gain}, {}};
  }
  if (q[iq[0]] > 0.7499999 && q[iq[0]] < 0.7500001) {  // none of the samples is there, a run can be
    misbehave("late");
    if (fault("late_nan")) out[0].Hdot_v[3] = std::nan("");
  }
}
void qdot(const void*, const double*, const double* v, double* out) {
  misbehave("qdot");
  *out = *v;
}

cardan_hinge_family slide;
cardan_plugin plugin;

const void* family(const char* kind, std::uint32_t i) {
  misbehave("family");
  if (fault("constraint") && std::strcmp(kind, CARDAN_KIND_CONSTRAINT) == 0 && i == 0) return &slide;
  if (std::strcmp(kind, CARDAN_KIND_HINGE) != 0 || fault("no_families")) return nullptr;
  return i == 0 || fault("endless_families") ? &slide : nullptr;
}

}  // namespace

extern "C" CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host* host) {
  misbehave("entry");
  const auto* log = static_cast<const cardan_log*>(host->service(host, CARDAN_SERVICE_LOG));
  if (fault("refuses_with_a_reason")) return log->say(log, CARDAN_LOG_ERROR, "no licence on\nthis machine"), nullptr;
  if (fault("talks")) log->say(log, CARDAN_LOG_WARNING, "a trial version");
  if (host->service(host, "no such service") != nullptr) std::abort();
  slide = {};
  slide.struct_size = fault("short_table") ? 40 : sizeof slide;
  slide.type = fault("null_type") ? nullptr : fault("taken_type") ? "prismatic" : "faulty/slide";
  slide.summary = "a slide along x";
  slide.nq = slide.nv = 1;
  if (fault("seven_rates")) slide.nv = 7;
  slide.shape = CARDAN_SHAPE_DENSE;
  slide.params_size = fault("small_params") ? 0 : sizeof(double);
  slide.params = fault("null_params") ? nullptr : schema;
  slide.n_params = fault("many_params") ? 1'000'000 : 1;
  slide.param_size = fault("short_params") ? 8 : sizeof(cardan_param_desc);
  slide.q_names = names, slide.v_names = v_names, slide.q_units = units;
  slide.v_units = fault("null_units") ? nullptr : v_units;
  slide.pack = pack, slide.kinematics = kinematics, slide.qdot = qdot;
  plugin = {sizeof plugin, CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "faulty", "1", "Apache-2.0", family};
  if (fault("other_major")) plugin.abi_major = 99, plugin.name = plugin.version = nullptr;
  if (fault("newer_minor")) plugin.abi_minor = 99;
  if (fault("null_name")) plugin.name = nullptr;
  if (fault("null_family")) plugin.family = nullptr;
  if (fault("short_plugin")) plugin.struct_size = 8;
  return fault("refuses") ? nullptr : &plugin;
}
