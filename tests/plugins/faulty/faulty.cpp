// A plugin with the fault that the environment variable CARDAN_FAULT names; without it a good one: a slide along x.
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

#include "core/abi/cardan_abi.h"

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
}

const struct AtLoad {
  AtLoad() { misbehave("load"); }
} at_load;

const cardan_param_desc schema[] = {{"gain", CARDAN_NUMBER, "1", 0, {1, 0, 0}, 0, "metres per coordinate"}};
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
  if (fault("late_exit") && q[iq[0]] > 0.7499999 && q[iq[0]] < 0.7500001) std::exit(0);  // none of the samples is there, a run can be
}
void qdot(const void*, const double*, const double* v, double* out) {
  misbehave("qdot");
  *out = *v;
}
void map_dot(const void*, const double*, const double*, double* out) { std::memset(out, 0, 6 * sizeof(double)); }

cardan_hinge_family slide;
cardan_plugin plugin;

const void* family(const char* kind, std::uint32_t i) {
  misbehave("family");
  if (std::strcmp(kind, "hinge") != 0) return nullptr;
  return i == 0 || fault("endless_families") ? &slide : nullptr;
}

}  // namespace

extern "C" CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host*) {
  misbehave("entry");
  slide = {};
  slide.struct_size = sizeof slide;
  slide.type = fault("null_type") ? nullptr : "faulty/slide";
  slide.summary = "a slide along x";
  slide.nq = slide.nv = 1;
  slide.shape = CARDAN_SHAPE_DENSE;
  slide.params_size = fault("small_params") ? 0 : sizeof(double);
  slide.params = fault("null_params") ? nullptr : schema;
  slide.n_params = fault("many_params") ? 1'000'000 : 1;
  slide.q_names = names, slide.v_names = v_names, slide.q_units = units;
  slide.v_units = fault("null_units") ? nullptr : v_units;
  slide.pack = pack, slide.kinematics = kinematics, slide.qdot = qdot, slide.map_dot = map_dot;
  plugin = {sizeof plugin, CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "faulty", "1", "Apache-2.0", family};
  if (fault("other_major")) plugin.abi_major = 99, plugin.name = plugin.version = nullptr;
  if (fault("newer_minor")) plugin.abi_minor = 99;
  if (fault("null_name")) plugin.name = nullptr;
  if (fault("null_family")) plugin.family = nullptr;
  if (fault("short_plugin")) plugin.struct_size = 8;
  return fault("refuses") ? nullptr : &plugin;
}
