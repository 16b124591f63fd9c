// astro in scripts: ERFA's check values by way of texts, and what is refused.
#include <gtest/gtest.h>

#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

/// What `check` says of a scenario with `script` behind its vehicle.
Finished checked(const TemporaryFolder& dir, const std::string& script) {
  write(dir / "vehicle.yaml", "cardan: 1\nbodies:\n  bus: {mass: 10, inertia: [2, 2, 2], hinge: {type: free, to: world}}\n");
  write(dir / "scenario.lua", "local sat = vehicle 'vehicle.yaml'\nmission { duration = 1 }\n" + script);
  return run_program({"check", "."}, dir.path());
}

/// t_erfa_c.c: era00, nut06a, obl06, xys06a, gd2gc; leap seconds of the IERS; the poles of WGS 84.
TEST(Astro, GivesCheckValuesOfErfa) {
  const TemporaryFolder dir;
  const Finished run = checked(dir, R"(
local function near(x, wanted, tolerance) assert(math.abs(x - wanted) <= tolerance, x .. " is not " .. wanted) end
near(astro.earth_rotation_angle("MJD 54388 UT1"), 0.4022837240028158, 1e-12)
near(astro.earth_rotation_angle("MJD 54387.5 UT1", 43200), 0.4022837240028158, 1e-12)
local psi, eps = astro.nutation "MJD 53736 TT"
near(psi, -9.63091202582031e-06, 1e-13)
near(eps, 4.06323849688725e-05, 1e-13)
near(select(3, astro.nutation "MJD 54388 TT"), 0.4090749229387258, 1e-14)
near(astro.intermediate_pole "MJD 53736 TT", 0.0005791308482835292, 1e-14)
assert(astro.leap_seconds(2016, 12, 31) == 36 and astro.leap_seconds(2017, 1, 1) == 37)
local there = astro.from_geodetic(3.1, -0.5, 2500)
near(there[1], -5599000.5577049947, 1e-7)
near(there[2], 233011.67223479203, 1e-7)
near(there[3], -3040909.4706983363, 1e-7)
local longitude, latitude, height = astro.geodetic(there)
near(longitude, 3.1, 1e-14)
near(latitude, -0.5, 1e-14)
near(height, 2500, 1e-8)
near(astro.from_geodetic(0, math.pi / 2, 0)[3], 6356752.314245, 1e-6)
local day, part = astro.julian_date("2016-12-31T23:59:60 UTC", "TAI")
near((day - 2457754.5) + part, 36 / 86400, 1e-12)
local a, b = astro.position("moon", "2026-11-26T12:00:00 TT"), astro.position("earth", "2026-11-26T12:00:00 TT", 0, "moon")
for i = 1, 3 do assert(a[i] == -b[i]) end
-- The pole of Mars by NAIF's kernel, as tests/contract/planets_test.cpp has it; offsets of the Earth's pole tilt its third axis.
local mars, ra, dec = astro.axes("mars", "2026-06-06T18:00:00 TT"), math.rad(317.652080782716), math.rad(52.8700418683211)
near(mars[1][3], math.cos(dec) * math.cos(ra), 1e-13)
near(mars[2][3], math.cos(dec) * math.sin(ra), 1e-13)
local day_later = astro.axes("mars", "2026-06-06T18:00:00 TT", 86400):column(1):dot(mars:column(1))
near(day_later, math.cos(math.rad(350.891982)), 1e-7)
assert((astro.axes("moon_principal", "2026-06-06T18:00:00 TT") - astro.axes("moon", "2026-06-06T18:00:00 TT")):norm() > 5e-4)
local plain, moved = astro.earth_axes "2026-11-26T12:00:00", astro.earth_axes("2026-11-26T12:00:00", 0, 0, 0, 0, 2e-9, -1e-9)
assert((plain - astro.axes("earth", "2026-11-26T12:00:00")):norm() == 0)
near(moved[1][3] - plain[1][3], 2e-9, 1e-14)
near(moved[2][3] - plain[2][3], -1e-9, 1e-14)
)");
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
}

TEST(Astro, RefusesWhatHasNoMeaning) {
  struct {
    const char *call, *expected;
  } constexpr kRefused[] = {
      {"astro.leap_seconds(1959, 12, 31)", "a day of UTC, which began in 1960"},
      {"astro.leap_seconds(2017, 13, 1)", "a day of UTC, which began in 1960"},
      {"astro.leap_seconds(2017.5, 1, 1)", "year, month and day, whole numbers"},
      {"astro.leap_seconds(1e300, 1, 1)", "year, month and day, whole numbers"},
      {"astro.position('moon', '2026-11-26T12:00:00', 1e30)", "seconds after the date, a number of at most 1e10"},
      {"astro.position('moon', '2026-11-26')", "a date from 1960 to 2200"},
      {"astro.earth_rotation_angle('2026-11-26T12:00:00', 0, 5)", "UT1 - UTC, a number from -1 to 1 [s]"},
      {"astro.julian_date('2026-11-26T12:00:00', 'UT1', 5)", "UT1 - UTC, a number from -1 to 1 [s]"},
      {"astro.earth_axes('2026-11-26T12:00:00', 0, 0, 0.2)", "polar motion x, a number from -1e-4 to 1e-4 [rad]"},
      {"astro.earth_axes('2026-11-26T12:00:00', 0, 0, 0, 0, 1e-3)", "what adds to the pole X, Y, a number from -1e-6 to 1e-6 [rad]"},
      {"astro.axes('pluto', '2026-11-26T12:00:00')", "a celestial body: sun, moon"},
      {"astro.from_geodetic(0, 1.6, 0)", "latitude from -pi/2 to pi/2 [rad]"},
      {"astro.geodetic { 1 / 0, 0, 0 }", "a place [m], finite numbers"},
  };
  const TemporaryFolder dir;
  for (const auto& [call, expected] : kRefused) {
    const Finished run = checked(dir, call);
    EXPECT_EQ(run.exit_code, 2) << call << run.out;
    EXPECT_NE(run.err.find(expected), std::string::npos) << call << "\n" << run.err;
  }
}

/// Rows 1 and 16 of the published test output, whose program rounds a degree and an hour to six and four digits.
TEST(Astro, AsksNrlmsise00ByHand) {
  const TemporaryFolder dir;
  const Finished run = checked(dir, R"(
local function near(x, wanted) assert(math.abs(x / wanted - 1) <= 1e-6, x .. " is not " .. wanted) end
local asked = { day = 172, seconds = 29000, altitude = "400 km", latitude = 60 * 1.74533e-2, longitude = -70 * 1.74533e-2, solar_time = 16 * 0.2618 * 43200 / math.pi, f107 = 150, f107_average = 150, ap = 4 }
local air = astro.nrlmsise00(asked)
near(air.He, 6.665177e11) near(air.O, 1.138806e14) near(air.N2, 1.998211e13) near(air.O2, 4.022764e11) near(air.Ar, 3.557465e9)
near(air.density, 4.074714e-12) near(air.H, 3.475312e10) near(air.N, 4.095913e12) near(air.hot_O, 2.667273e10)
near(air.exosphere, 1250.540) near(air.temperature, 1241.416)
near(air.drag_density - air.density, 1.66e-27 * 16 * air.hot_O)
asked.ap = { 100, 100, 100, 100, 100, 100, 100 }
near(astro.nrlmsise00(asked).density, 5.88194e-12)
asked.solar_time = asked.seconds + asked.longitude * 43200 / math.pi
local density = astro.nrlmsise00(asked).density
asked.solar_time = nil
near(astro.nrlmsise00(asked).density, density)
asked.altitude = "1500 km"
local good, told = pcall(astro.nrlmsise00, asked)
assert(not good and tostring(told):find("astro.nrlmsise00.altitude", 1, true), told)
assert(not pcall(astro.nrlmsise00, { day = 3.5, altitude = 0, latitude = 0, longitude = 0, f107 = 150 }))
assert(not pcall(astro.nrlmsise00, {}))
good, told = pcall(astro.nrlmsise00, { day = 172, altitude = 0, latitude = -1.5, longitude = 1, f107 = 50, f107_average = 300, ap = 400 })
assert(not good and tostring(told):find("for which the model has a density", 1, true), told)  -- its series have no number there
)");
  EXPECT_EQ(run.exit_code, 0) << run.err;
}

}  // namespace
}  // namespace cardan
