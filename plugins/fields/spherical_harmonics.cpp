// spherical_harmonics: gravity of a planet that turns, by harmonics of any degree and order: U = -mu phi, phi of
// plugins/fields/harmonics.hpp with C_00 = 1.
#include "plugins/fields/harmonics.hpp"

namespace cardan {
namespace {

struct SphericalHarmonics : HarmonicFamily<SphericalHarmonics> {
  static constexpr const char* type = "spherical_harmonics";
  static constexpr const char* summary = "gravity of a planet that turns, by harmonics of any degree and order";
  static constexpr std::uint32_t quantity = CARDAN_GRAVITY;
  static constexpr unsigned facts = CARDAN_FIELD_POTENTIAL | CARDAN_FIELD_SOURCE_FREE | CARDAN_FIELD_CURL_FREE;
  static constexpr double distance = 3.0;  // [m] of the laws, whose centres and radii are of order one
  static constexpr const char* columns[] = {"n", "m", "C", "S"};
  static constexpr cardan_param_desc schema[] = {
      param::in_range(param::required("mu", CARDAN_NUMBER, "m^3/s^2", "gravitational parameter"), 0.0,
                      std::numeric_limits<double>::infinity(), CARDAN_ABOVE),
      param::in_range(param::required("radius", CARDAN_NUMBER, "m", "that the coefficients refer to"), 0.0,
                      std::numeric_limits<double>::infinity(), CARDAN_ABOVE),
      param::named(param::required("coefficients", CARDAN_TABLE, "1",
                                   "degree, order, C and S, fully normalised; those that are not there are 0, but for C_00 = 1"),
                   columns),
      param::in_range(param::optional("degree", CARDAN_INTEGER, "1", "the highest that counts", Harmonics::kMostDegree), 0.0,
                      Harmonics::kMostDegree),
      TurningPlanet::rate_desc,
      TurningPlanet::axis_desc,
      TurningPlanet::meridian_desc,
      TurningPlanet::epoch_desc,
      TurningPlanet::dut1_desc,
      TurningPlanet::orientation_desc,
      TurningPlanet::pole_x_desc,
      TurningPlanet::pole_y_desc,
      TurningPlanet::bulletin_desc,
      TurningPlanet::centre_desc};

  static std::optional<std::vector<Coefficient>> coefficients(const Params& params) {
    auto all = Harmonics::read(params, 4, 0, params.integer("degree"));
    if (all && (all->empty() || all->front().n > 0)) all->insert(all->begin(), {.C = 1.0});
    return all;
  }
  static void set(const Params& params, Packed& p) {
    p.scale = params.number("mu"), p.since = 0.0, p.harmonics.radius = params.number("radius");
  }

  static void evaluate(const Packed& p, const FieldPoint<SphericalHarmonics, double>& at, double* out, double* gradient) noexcept {
    double U = 0.0;
    p.evaluate(*at.prepared, at.x, at.t, U, out, gradient);
    out[3] = -U;
    for (int i = 0; gradient && i < 3; ++i) gradient[9 + i] = -out[i];
  }
};

}  // namespace
const cardan_field_family& spherical_harmonics_family() { return field_table<SphericalHarmonics>(); }
}  // namespace cardan
