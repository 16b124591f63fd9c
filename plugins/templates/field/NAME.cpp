// @TYPE@: gravity of an oblate planet at the origin of the world, whose axis is z: U = -mu / r (1 - J2 (R / r)^2 (3 s^2 - 1) / 2),
// s = z / r (zonal harmonic of degree 2).
#include <cmath>

#include "core/abi/field_family.hpp"

namespace {

using namespace cardan;

struct Oblate {
  static constexpr const char* type = "@TYPE@";
  static constexpr const char* summary = "gravity of an oblate planet";
  static constexpr std::uint32_t quantity = CARDAN_GRAVITY;
  // Proven when the plugin is loaded.
  static constexpr unsigned facts = CARDAN_FIELD_POTENTIAL | CARDAN_FIELD_STEADY | CARDAN_FIELD_SOURCE_FREE | CARDAN_FIELD_CURL_FREE;
  static constexpr double distance = 2.0;  // [m] where the laws try it, with parameters of order one

  // The host converts units, checks ranges, and shows all of this by `cardan types`.
  static constexpr cardan_param_desc schema[] = {
      param::in_range(param::required("mu", CARDAN_NUMBER, "m^3/s^2", "gravitational parameter"), 0.0, INFINITY, CARDAN_ABOVE),
      param::optional("J2", CARDAN_NUMBER, "1", "oblateness", 1.08262668e-3),
      param::in_range(param::required("radius", CARDAN_NUMBER, "m", "that J2 belongs to, at the equator"), 0.0, INFINITY, CARDAN_ABOVE)};
  // Beyond them it gives no number that may be believed.
  static constexpr cardan_limit_desc limits[] = {{"inside", 0, "deeper than half of the radius"}};

  struct Packed {
    double mu, J2, radius;
  };
  static bool pack(const Params& params, Packed& p) {
    p = {params.number("mu"), params.number("J2"), params.number("radius")};
    return true;
  }

  static int beyond(const Packed& p, const FieldPoint<Oblate, double>& at) noexcept {
    return dot(at.x, at.x) < 0.25 * p.radius * p.radius ? 1 : 0;
  }

  // Runs inside a right-hand side, from any thread: no allocation, no state, no exception. T is double, or a number with its derivative:
  // da/dr follows by itself.
  template <class T>
  static void evaluate(const Packed& p, const FieldPoint<Oblate, T>& at, T* out) noexcept {
    using std::sqrt;
    const T r2 = dot(at.x, at.x), r = sqrt(r2), s2 = at.x.z * at.x.z / r2, k = T(p.J2 * p.radius * p.radius) / r2;
    const T pull = T(-p.mu) / (r2 * r), ring = T(1.5) * k * (T(1.0) - T(5.0) * s2);
    out[0] = pull * (T(1.0) + ring) * at.x.x;
    out[1] = pull * (T(1.0) + ring) * at.x.y;
    out[2] = pull * (T(1.0) + ring + T(3.0) * k) * at.x.z;
    out[3] = T(-p.mu) / r * (T(1.0) - T(0.5) * k * (T(3.0) * s2 - T(1.0)));
  }
};

const void* family(const char* kind, std::uint32_t index) {
  return std::string_view(kind) == CARDAN_KIND_FIELD && index == 0 ? &field_table<Oblate>() : nullptr;
}
const cardan_plugin kPlugin{sizeof(cardan_plugin), CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "@NAME@", "0.1", "", family};

}  // namespace

extern "C" CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host* host) {
  return host->abi_major == CARDAN_ABI_MAJOR ? &kPlugin : nullptr;
}
