// @TYPE@: an eddy-current brake at a node, whose coils warm up: moment = -c(T) w, c = c_0 exp(-a T). The warmth T of the coils
// follows what they take: C T' = c w^2 - k T.
#include <cmath>

#include "core/abi/device_family.hpp"

namespace {

using namespace cardan;

struct Brake {
  static constexpr const char* type = "@TYPE@";
  static constexpr const char* summary = "a brake on the rotation of a node, weaker as its coils warm up";
  static constexpr unsigned facts = CARDAN_FACT_ENERGY | CARDAN_FACT_PASSIVE;  // proven when the plugin is loaded

  // The host converts units, checks ranges, and shows all of this by `cardan types`.
  static constexpr cardan_param_desc schema[] = {
      param::not_negative(param::required("braking", CARDAN_NUMBER, "N m s/rad", "moment over rate of the cold coils")),
      param::not_negative(param::optional("softening", CARDAN_NUMBER, "1/K", "of the braking with the warmth", 0.004)),
      param::positive(param::required("capacity", CARDAN_NUMBER, "J/K", "heat capacity of the coils")),
      param::not_negative(param::optional("conductance", CARDAN_NUMBER, "W/K", "by which they cool"))};
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_NODE, CARDAN_USE_VELOCITY | CARDAN_USE_LOAD, "the node that is braked"}};
  static constexpr cardan_port_desc ports[] = {{"power", CARDAN_PORT_OUT, "W", 0.0, 0, "that it takes"}};
  static constexpr cardan_state_desc states[] = {{"warmth", "K", 0.0, 10.0, "of the coils above their surroundings"}};

  struct Packed {
    double braking, softening, capacity, conductance;
  };
  static bool pack(const Params& params, Packed& p) {
    p = {params.number("braking"), params.number("softening"), params.number("capacity"), params.number("conductance")};
    return true;
  }

  // Runs inside a right-hand side, from any thread: no allocation, no state, no exception. T is double, or a number with its derivative.
  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    using std::exp;
    const Vec3<T>& w = in.at[0].omega;
    const T c = T(p.braking) * exp(-(T(p.softening) * in.z[0])), power = c * dot(w, w);
    out.load[0].moment = -(c * w);
    out.zdot[0] = (power - T(p.conductance) * in.z[0]) / T(p.capacity);
    out.out[0] = power;
    out.lost = power;  // heat is no part of the ledger
  }
  static double energy(const Packed&, const DeviceIn<double>&) noexcept { return 0.0; }
};

const void* family(const char* kind, std::uint32_t index) {
  return std::string_view(kind) == CARDAN_KIND_DEVICE && index == 0 ? &device_table<Brake>() : nullptr;
}
const cardan_plugin kPlugin{sizeof(cardan_plugin), CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "@NAME@", "0.1", "", family};

}  // namespace

extern "C" CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host* host) {
  return host->abi_major == CARDAN_ABI_MAJOR ? &kPlugin : nullptr;
}
