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
  struct Prepared {
    double place[3];
  };
  static constexpr cardan_param_desc schema[] = {CelestialPlace::body_desc, CelestialPlace::epoch_desc, CelestialPlace::origin_desc};
  static constexpr cardan_limit_desc limits[] = {CelestialPlace::dates_limit};
  static bool pack(const Params& params, Packed& p) { return p.pack(params); }
  static int prepare(const Packed& p, double t, Prepared& out) noexcept {
    const Vec3<double> x = p.at(t);
    out = {{x.x, x.y, x.z}};
    return p.is_known(t) ? 0 : 1;
  }
  template <class T>  // of time alone
  static void evaluate(const Packed&, const FieldPoint<CelestialBody, T>& at, T* out) noexcept {
    for (int i = 0; i < 3; ++i) out[i] = T(at.prepared->place[i]);
  }
};

}  // namespace
const cardan_field_family& celestial_body_family() { return field_table<CelestialBody>(); }
}  // namespace cardan
