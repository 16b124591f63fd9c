// Published cases of what is around a vehicle: gravity by harmonics, the magnetic field, the air; and falls through it.
#include <cmath>
#include <fstream>
#include <functional>
#include <numbers>

#include "plugins/astronomy/dates.hpp"
#include "plugins/astronomy/earth.hpp"
#include "plugins/fields/nrlmsise00.hpp"
#include "tests/cases/published.hpp"
#include "tests/support/field_values.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
constexpr double kFoot = 0.3048;

TEST(GravityField, OfGGM03SPullsAsItsPotentialSays) {
  const Published ref("env-ggm03s-acceleration");
  const YAML::Node places = ref.initial()["positions_body_fixed_m"];
  for (std::size_t i = 0; i < 3; ++i) {
    const int N = std::array{4, 8, 12}[i];
    const AskedField field("spherical_harmonics", {{"mu", {ref.model()["mu_m3s2"].as<double>()}},
                                                   {"radius", {ref.model()["radius_m"].as<double>()}},
                                                   {"coefficients", coefficients_of("gravity/ggm03s_12x12.csv")},
                                                   {"degree", {1.0 * N}},
                                                   {"rate", {0.0}}});
    const auto there = field.at(Published::as_vector(places[i]));
    const Vector3d wanted = ref.vector(fmt::format("N={} at", N));
    expect_vector(fmt::format("acceleration, degree {}", N), there.value.head<3>(), wanted, ref.tolerance("rel"), largest(wanted));
    expect_relative(fmt::format("potential, degree {}", N), -there.value[3], ref.number(fmt::format("potential N={}", N)),
                    ref.tolerance("rel"));
  }
}

/// Against Basilisk, in axes that turn: there v = dx/dt, and from outside v + w x r.
TEST(Polyhedron, CarriesADayAboutErosAsBasiliskHasIt) {
  const Published ref("orbit-eros-polyhedron");
  const double w = 2.0 * std::numbers::pi / (3600.0 * ref.model()["period_h"].as<double>());
  std::vector<std::vector<std::string>> texts;  // there is no line of names
  const auto rows = rows_of("gravity/eros_polyhedron_check.csv", &texts);
  const auto vector = [&](const std::vector<double>& row, std::size_t i) { return Vector3d(row[i], row[i + 1], row[i + 2]); };
  const Vector3d r = vector(rows[0], 1), v = vector(rows[0], 4) + w * Z.cross(r);
  BodySpec body = on(particle("probe", 100.0, Vector3d::Zero()), "", "translational");
  body.hinge.q = {r.x(), r.y(), r.z()}, body.hinge.v = {v.x(), v.y(), v.z()};
  GravitySpec pull;
  pull.kind = GravitySpec::Kind::field, pull.fields = {"eros"}, pull.gradient = false;
  SystemSpec spec = system({body}, pull);
  FieldSpec eros;
  eros.name = "eros", eros.type = "polyhedron";
  eros.params["mu"].value = ref.model()["mu_m3s2"].as<double>(), eros.params["rate"].value = w, eros.params["unit"].value = 1000.0;
  eros.params["shape"].value = std::string(CARDAN_SOURCE_DIR "/tests/reference/data/gravity/eros_shape_856.txt");
  spec.fields = {eros};
  const auto sim = run_of(spec, "dop853", 1e-12);
  double worst = 0.0;
  for (const auto& row : rows) {
    if (row[0] > 0.0) sim->run(row[0]);
    const Vector3d there = Eigen::AngleAxisd(-w * row[0], Z) * Vector3d(sim->state().q.head<3>());
    worst = worse(worst, (there - vector(row, 1)).norm());
  }
  EXPECT_EQ(rows.size(), 289U);
  expect_within("position [m]", worst, ref.tolerance("m"));
}

TEST(EarthFrames, AreThoseOfTheIau) {
  const Published ref("env-erfa-frames");
  const auto mjd = [](double day, double part = 0.0) { return Days{day - 51544.5, part}; };
  const auto near = [&](const std::string& quantity, double found, double tolerance) {
    expect_within(quantity, std::abs(found - ref.number(quantity)), tolerance);
  };
  const Days day = mjd(53736.0);
  near("Era00(2400000.5,54388.0)", earth_rotation_angle(mjd(54388.0)), 1e-12);
  near("Gmst06(UT1=TT=53736.0)", mean_sidereal_time(day, day), 1e-12);
  near("Gst06a(UT1=TT=53736.0)", apparent_sidereal_time(day, day), 1e-12);
  near("Nut06a(53736.0) dpsi", nutation(day)[0], 1e-13);
  near("Nut06a deps", nutation(day)[1], 1e-13);
  near("Obl06(54388.0)", mean_obliquity(mjd(54388.0)), 1e-14);
  near("Xys06a(53736.0) X", intermediate_pole(day)[0], 1e-14);
  near("Xys06a Y", intermediate_pole(day)[1], 1e-15);
  near("Xys06a s", intermediate_pole(day)[2], 1e-18);
  near("Sp00(52541.0)", tio_locator(mjd(52541.0)), 1e-12);
  near("Utctai(2453750.5,0.892100694) fraction", read_date("JD 2453750.5 + 0.892100694 UTC", TimeScale::tai, 0.0)->part, 1e-12);
  near("Taitt(2453750.5,0.892482639) fraction", read_date("JD 2453750.5 + 0.892482639 TAI", TimeScale::tt, 0.0)->part, 1e-12);
  near("Utcut1", read_date("JD 2453750.5 + 0.892100694 UTC", TimeScale::ut1, 0.3341)->part, 1e-12);
  const Eigen::VectorXd leaps = ref.vector("leap seconds");
  expect_vector("leap seconds", Vector3d(*leap_seconds(2003, 6, 1), *leap_seconds(2008, 1, 17), *leap_seconds(2017, 9, 1)), leaps, 0.0);
  const auto place = place_of_geodetic(3.1, -0.5, 2500.0), back = geodetic({2e6, 3e6, 5.244e6});
  expect_vector("Gd2gc WGS84", Vector3d(place.data()), ref.vector("Gd2gc WGS84"), 1e-7);
  const Eigen::VectorXd coordinates = ref.vector("Gc2gd WGS84");
  expect_vector("Gc2gd WGS84, longitude and latitude", Eigen::Vector2d(back[0], back[1]), coordinates.head<2>(), 1e-14);
  expect_within("Gc2gd WGS84, height [m]", std::abs(back[2] - coordinates[2]), 1e-8);
  const auto rows = bias_precession_nutation(mjd(50123.0, 0.9999));
  expect_vector("Pnm06a(50123.9999) row 1", Vector3d(rows.data()), ref.vector("Pnm06a(50123.9999) row 1"), 1e-12);
}

TEST(StandardAtmosphere, HasTheDensitiesOfItsTable) {
  const Published ref("env-us-standard-1976");
  const AskedField air("standard_atmosphere", {{"radius", {6356766.0}}});
  for (const double base : {0.0, 11e3, 20e3, 32e3, 47e3, 51e3, 71e3}) {
    const double height = 6356766.0 * base / (6356766.0 - base);  // geometric
    const double density = ref.vector(fmt::format("h={:g} m", base))[2];
    expect_relative(fmt::format("density at {:g} m", base), air.at({6356766.0 + height, 0, 0}).value[0], density, ref.tolerance("rel"));
  }
}

/// Angles are rounded as the model rounds them. Numbers are printed to seven digits, half a unit of which is the tolerance.
TEST(Nrlmsise00, HasTheSeventeenRowsOfItsTestOutput) {
  using namespace msis;
  const Published ref("env-nrlmsise00-table");
  const YAML::Node standard = ref.model()["standard_input"];
  const auto given = [&](const char* name) { return standard[name].as<double>(); };
  struct Input {
    Conditions at;
    double altitude, latitude, longitude, hour;
  };
  const Input usual{{static_cast<int>(given("doy")), given("seconds"), given("f107"), given("f107a"), {given("ap")}, false},
                    given("altitude_km"),
                    given("lat_deg"),
                    given("lon_deg"),
                    given("local_solar_time_h")};
  const auto stormy = [](Input& in) {
    in.at.history = true;
    for (double& ap : in.at.ap) ap = 100.0;
  };
  const std::function<void(Input&)> changes[] = {[](Input&) {},
                                                 [](Input& in) { in.at.day = 81; },
                                                 [](Input& in) { in.at.seconds = 75000.0, in.altitude = 1000.0; },
                                                 [](Input& in) { in.altitude = 100.0; },
                                                 [](Input& in) { in.latitude = 0.0; },
                                                 [](Input& in) { in.longitude = 0.0; },
                                                 [](Input& in) { in.hour = 4.0; },
                                                 [](Input& in) { in.at.average = 70.0; },
                                                 [](Input& in) { in.at.f107 = 180.0; },
                                                 [](Input& in) { in.at.ap[0] = 40.0; },
                                                 [](Input& in) { in.altitude = 0.0; },
                                                 [](Input& in) { in.altitude = 10.0; },
                                                 [](Input& in) { in.altitude = 30.0; },
                                                 [](Input& in) { in.altitude = 50.0; },
                                                 [](Input& in) { in.altitude = 70.0; },
                                                 stormy,
                                                 [&](Input& in) { stormy(in), in.altitude = 100.0; }};
  std::ifstream table(CARDAN_SOURCE_DIR "/tests/reference/data/atmosphere/nrlmsise00_test_output.txt");
  for (int row = 0; row < 17; ++row) {
    Input in = usual;
    changes[row](in);
    Moment moment;
    prepare(in.at, moment);
    const double N = msis::kDegree * in.latitude, E = msis::kDegree * in.longitude, h = kHour * in.hour;
    const auto got = air(moment, Place<double>{in.altitude, std::cos(N), std::sin(N), std::cos(E), std::sin(E), std::cos(h), std::sin(h)});
    const double* n = got.number;
    // The density of the table is that without anomalous oxygen.
    const double all[] = {n[0], n[1], n[2], n[3], n[4], got.density(7), n[5], n[6], n[7], got.exosphere, got.temperature};
    double worst = 0.0, density = 0.0;
    for (int i = 0; i < 11; ++i) {
      double wanted = 0.0;
      ASSERT_TRUE(table >> wanted);
      worst = worse(worst, wanted == 0.0 ? std::abs(all[i]) : std::abs(all[i] / wanted - 1.0));
      if (i == 5) density = wanted;
    }
    expect_relative(fmt::format("row {}, density", row + 1), all[5], density, ref.tolerance("rel"));
    expect_within(fmt::format("row {}, all eleven", row + 1), worst, ref.tolerance("rel"));
  }
}

/// Numbers of the year are those of Julian years: the model changes by 40 nT a year, and a calendar year is 2e-3 of one beside it.
TEST(MagneticField, OfWMM2025HasItsTestValues) {
  const Published ref("env-wmm2025-test-values");
  constexpr double kYear = 365.25 * 86400.0;
  std::vector<double> coefficients;
  for (const auto& row : rows_of("magnetic/wmm2025.csv"))
    for (std::size_t i = 0; i < 6; ++i) coefficients.push_back(row[i] * (i < 2 ? 1.0 : i < 4 ? 1e-9 : 1e-9 / kYear));
  for (int i = 1; i <= 12; ++i) {
    const Eigen::VectorXd row = ref.vector(fmt::format("row {}", i));
    const GeodeticPlace place(row[2] * kDegree, row[3] * kDegree, 1e3 * row[1], 6378137.0, 1.0 / 298.257223563);
    const AskedField field("magnetic_harmonics",
                           {{"coefficients", coefficients}, {"since_epoch", {(row[0] - 2025.0) * kYear}}, {"rate", {0.0}}});
    const Vector3d B = 1e9 * place.ned.transpose() * field.at(place.x).value.head<3>();
    expect_vector(fmt::format("row {} [nT]", i), B, row.tail<3>(), ref.tolerance("nT"));
  }
}

FieldSpec field_of(const std::string& name, const std::string& type, const std::vector<std::pair<const char*, double>>& numbers) {
  FieldSpec out;
  out.name = name, out.type = type;
  for (const auto& [key, x] : numbers) out.params[key].value = x;
  return out;
}

/// A sphere with drag over an Earth that turns and takes its air with it, from the equator; body axes north, east, down at the start.
std::unique_ptr<Simulation> thrown(const Published& ref) {
  const YAML::Node earth = ref.model()["earth"], sphere = ref.model()["body"];
  const auto of = [](const YAML::Node& from, const char* name) { return from[name].as<double>(); };
  const double rate = of(earth, "rate_rads"), radius = of(earth, "radius_m"), J = of(sphere, "inertia_kgm2");
  const double flattening = earth["inv_flattening"] ? 1.0 / of(earth, "inv_flattening") : 0.0;
  BodySpec body = on(rigid("body", of(sphere, "mass_kg"), Vector3d::Zero(), J * Matrix3d::Identity()), "", "free");
  Matrix3d ned;
  ned << Z, Y, -X;
  const Vector3d angles = kDegree * Published::as_vector(ref.initial()["euler_yaw_pitch_roll_deg"]);
  const Eigen::Quaterniond q(ned * Eigen::AngleAxisd(angles[0], Z) * Eigen::AngleAxisd(angles[1], Y) * Eigen::AngleAxisd(angles[2], X));
  const Vector3d r = (radius + ref.initial()["altitude_m"].as<double>()) * X;
  const Vector3d v = rate * Z.cross(r) + ned * Published::as_vector(ref.initial()["velocity_NED_ms"]);
  const Vector3d omega = kDegree * Published::as_vector(ref.initial()["omega_body_wrt_inertial_degs"]);
  body.hinge.q = {q.w(), q.x(), q.y(), q.z(), r.x(), r.y(), r.z()};
  body.hinge.v = {omega.x(), omega.y(), omega.z(), v.x(), v.y(), v.z()};
  GravitySpec pull;
  pull.kind = GravitySpec::Kind::field, pull.fields = {"earth"}, pull.gradient = false;
  SystemSpec spec = system({body}, pull);
  const double J2 = earth["J2"] ? of(earth, "J2") : 0.0;
  spec.fields = {field_of("earth", "zonal_harmonics", {{"mu", of(earth, "mu_m3s2")}, {"radius", radius}, {"J2", J2}}),
                 field_of("air", "standard_atmosphere", {{"radius", radius}, {"flattening", flattening}}),
                 field_of("wind", "co_rotating_wind", {{"rate", rate}})};
  DeviceSpec drag;
  drag.name = "drag", drag.type = "drag", drag.mounts["at"] = {"body", {}}, drag.mounts["wind"] = {"wind", {}};
  drag.params["area"].value = of(sphere, "ref_area_m2"), drag.params["coefficient"].value = of(sphere, "drag_coefficient");
  spec.devices = {drag};
  auto sim = run_of(spec, "dop853");
  sim->run(30.0);
  return sim;
}
/// All three stay within 1e-7 of the equator, where the height is that over its radius.
double height(const Published& ref, const Simulation& sim) {
  return sim.state().q.tail<3>().norm() - ref.model()["earth"]["radius_m"].as<double>();
}
double longitude(const Published& ref, const Simulation& sim) {
  return (std::atan2(sim.state().q[5], sim.state().q[4]) - 30.0 * ref.model()["earth"]["rate_rads"].as<double>()) / kDegree;
}

TEST(SphereWithDrag, FallsOverARoundEarthThatTurns) {
  const Published ref("orbit-nesc-atmos05-round-rotating");
  const auto sim = thrown(ref);
  const Eigen::VectorXd altitude = kFoot * ref.vector("altitude at 30 s");
  for (int tool = 0; tool < 3; ++tool)
    expect_absolute(fmt::format("altitude, tool 0{} [m]", tool + 4), height(ref, *sim), altitude[tool], ref.tolerance("altitude_m"));
  // Tool 05 takes an Earth that is 0.67 ft smaller: its position, less its altitude.
  const Vector3d theirs = ref.vector("inertial position at 30 s"), wanted = theirs.normalized() * sim->state().q.tail<3>().norm();
  expect_vector("position at its height [m]", sim->state().q.tail<3>(), wanted, ref.tolerance("altitude_m"));
  // Yaw, pitch and roll of the body against north, east, down where it is.
  const Vector3d up = sim->state().q.tail<3>().normalized();
  Matrix3d ned;
  ned << Z, Z.cross(up), -up;
  const Matrix3d R = ned.transpose() * quaternion(sim->state().q.data()).toRotationMatrix();
  const Vector3d angles(std::atan2(R(1, 0), R(0, 0)), std::asin(-R(2, 0)), std::atan2(R(2, 1), R(2, 2)));
  expect_vector("yaw, pitch, roll [deg]", angles / kDegree, ref.vector("yaw,pitch,roll"), ref.tolerance("euler_deg"));
  expect_vector("rates [deg/s]", sim->state().v.head<3>() / kDegree, ref.vector("body rates"), 1e-12);
}

TEST(SphereWithDrag, FallsOverTheEllipsoid) {
  const Published ref("orbit-nesc-atmos06-sphere-drag");
  const auto sim = thrown(ref);
  const Eigen::VectorXd altitude = kFoot * ref.vector("altitude at 30 s");
  for (const int tool : {4, 5, 6})
    expect_absolute(fmt::format("altitude, tool 0{} [m]", tool), height(ref, *sim), altitude[tool - 1], ref.tolerance("altitude_m"));
  expect_vector("position [m]", sim->state().q.tail<3>(), kFoot * ref.vector("inertial position at 30 s"), ref.tolerance("altitude_m"));
  expect_absolute("longitude [deg]", longitude(ref, *sim), ref.number("longitude at 30 s"), 1e-8);  // a millimetre
}

TEST(SphereWithDrag, IsThrownToTheEast) {
  const Published ref("orbit-nesc-atmos09-eastward-cannonball");
  const auto sim = thrown(ref);
  const Eigen::VectorXd altitude = kFoot * ref.vector("altitude at 30 s");
  for (const int tool : {4, 5, 6})
    expect_absolute(fmt::format("altitude, tool 0{} [m]", tool), height(ref, *sim), altitude[tool - 1], ref.tolerance("altitude_m"));
  expect_vector("position [m]", sim->state().q.tail<3>(), kFoot * ref.vector("inertial position at 30 s"), ref.tolerance("altitude_m"));
  expect_absolute("longitude [deg]", longitude(ref, *sim), ref.number("longitude at 30 s"), ref.tolerance("longitude_deg"));
}

}  // namespace
}  // namespace cardan::test
