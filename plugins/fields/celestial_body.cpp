// celestial_body: where the Sun, the Moon or a planet is.
#include "plugins/fields/celestial_place.hpp"

namespace cardan {
namespace {

struct CelestialBody {
  static constexpr const char* type = "celestial_body";
  static constexpr const char* summary = "where the Sun, the Moon or a planet is";
  static constexpr std::uint32_t quantity = CARDAN_POSITION;
  static constexpr unsigned facts = 0;
  using Packed = CelestialPlace;
  static constexpr cardan_param_desc schema[] = {CelestialPlace::body_desc, CelestialPlace::epoch_desc, CelestialPlace::origin_desc};
  static bool pack(const Params& params, Packed& p) { return p.pack(params); }
  static void evaluate(const Packed& p, const FieldPoint<CelestialBody, double>& at, double* out) noexcept {
    const Vec3<double> x = p.at(at.t);
    out[0] = x.x, out[1] = x.y, out[2] = x.z;
  }
  static void evaluate(const Packed& p, const FieldPoint<CelestialBody, Tangent>& at, Tangent* out) noexcept {  // of time alone
    const Vec3<double> x = p.at(at.t);
    out[0] = Tangent(x.x), out[1] = Tangent(x.y), out[2] = Tangent(x.z);
  }
};

}  // namespace
const cardan_field_family& celestial_body_family() { return field_table<CelestialBody>(); }
}  // namespace cardan
