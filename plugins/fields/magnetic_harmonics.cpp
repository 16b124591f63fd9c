// magnetic_harmonics: the magnetic field of a planet that turns, as IGRF and WMM give it: B = -grad V, V = a sum (a/r)^(n+1) (g cos(m l) +
// h sin(m l)) P_nm, P_nm in the half normalisation of Schmidt: those of plugins/fields/harmonics.hpp over the root of 2 n + 1.
#include "plugins/fields/harmonics.hpp"

namespace cardan {
namespace {

struct MagneticHarmonics : HarmonicFamily<MagneticHarmonics> {
  static constexpr const char* type = "magnetic_harmonics";
  static constexpr const char* summary = "the magnetic field of a planet that turns, by the coefficients of IGRF or WMM";
  static constexpr std::uint32_t quantity = CARDAN_MAGNETIC;
  static constexpr unsigned facts = CARDAN_FIELD_SOURCE_FREE | CARDAN_FIELD_CURL_FREE;
  static constexpr double distance = 9e6;  // [m] of the laws, outside of most spheres of their radii
  static constexpr double kMost = 1.0;     // [T] of a coefficient; larger ones are numbers in nT without their unit
  static constexpr const char* columns[] = {"n", "m", "g", "h", "g_dot", "h_dot"};
  static constexpr const char* units[] = {"1", "1", "T", "T", "T/s", "T/s"};
  static constexpr cardan_param_desc schema[] = {
      [] {
        cardan_param_desc table =
            param::named(param::required("coefficients", CARDAN_TABLE, "T",
                                         "degree, order, g and h, half normalised (Schmidt), and their changes in time"),
                         columns);
        table.units = units;
        return table;
      }(),
      param::optional("since_epoch", CARDAN_NUMBER, "s", "from the epoch of the coefficients to the start of the run"),
      param::in_range(param::optional("degree", CARDAN_INTEGER, "1", "the highest that counts", Harmonics::kMostDegree), 1.0,
                      Harmonics::kMostDegree),
      param::in_range(
          param::optional("radius", CARDAN_NUMBER, "m", "that the coefficients refer to; the default is that of IGRF and WMM", 6371.2e3),
          1e6, 1e8),
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
    auto all = Harmonics::read(params, 6, 1, params.integer("degree"));
    if (!all) return all;
    for (Coefficient& c : *all) {
      if (std::abs(c.C) > kMost || std::abs(c.S) > kMost) {
        params.fail("coefficients", "g and h of at most 1 T", nullptr, "give their unit in the head of the columns: g [nT]");
        return {};
      }
      const double full = 1.0 / std::sqrt(2.0 * c.n + 1.0);
      c.C *= full, c.S *= full, c.C_rate *= full, c.S_rate *= full;
    }
    return all;
  }
  static void set(const Params& params, Packed& p) {
    const double a = params.number("radius");
    p.scale = -a * a, p.since = params.number("since_epoch"), p.harmonics.radius = a;
  }

  static void evaluate(const Packed& p, const FieldPoint<MagneticHarmonics, double>& at, double* B, double* gradient) noexcept {
    double V = 0.0;
    p.evaluate(*at.prepared, at.x, at.t, V, B, gradient);
  }
};

}  // namespace
const cardan_field_family& magnetic_harmonics_family() { return field_table<MagneticHarmonics>(); }
}  // namespace cardan
