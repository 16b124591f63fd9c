// Dates, the orientation of the Earth, celestial bodies; fields that go by them.
#include "plugins/astronomy/earth.hpp"

#include <algorithm>
#include <clocale>
#include <cmath>
#include <numbers>
#include <thread>

#include "plugins/astronomy/celestial.hpp"
#include "plugins/astronomy/dates.hpp"
#include "tests/support/field_values.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kArcsec = std::numbers::pi / 648000.0;

Vector3d vector_of(const std::array<double, 3>& a) { return {a[0], a[1], a[2]}; }
double seconds_between(const Days& a, const Days& b) { return 86400.0 * ((b.whole - a.whole) + (b.part - a.part)); }

/// t of a run is TT: a leap second passes in it (37 s from 2017 on, 36 before), and UT1 does not jump.
TEST(Dates, CountSecondsThroughALeapSecond) {
  const auto before = Epoch::of("2016-12-31T23:59:59 UTC", -0.4), leap = Epoch::of("2016-12-31T23:59:60.5", -0.4),
             after = Epoch::of("2017-01-01T00:00:01Z", 0.6);
  ASSERT_TRUE(before && leap && after);
  EXPECT_NEAR(seconds_between(before->tt, leap->tt), 1.5, 1e-9);
  EXPECT_NEAR(seconds_between(before->tt, after->tt), 3.0, 1e-9);
  EXPECT_NEAR(seconds_between(before->ut1, after->ut1), 3.0, 1e-9);
  EXPECT_NEAR(seconds_between(before->ut1, before->tt), 32.184 + 36.0 + 0.4, 1e-9);
  EXPECT_NEAR(seconds_between(after->ut1, after->tt), 32.184 + 37.0 - 0.6, 1e-9);
}

/// A program that links Cardan may have set a locale in which numbers have commas.
TEST(Dates, HavePointsInAnyLocale) {
  const auto in_scales = [] {
    std::vector<double> all;
    for (const char* text : {"2016-12-31T23:59:60.5", "JD 2457754.25 + 0.125 TT", "MJD 59001.5 UTC"})
      if (const auto epoch = Epoch::of(text, 0.0)) all.push_back(epoch->tt.whole + epoch->tt.part);
    return all;
  };
  const auto shape = [] {
    const AskedField f("polyhedron", {{"mu", {1.0}}, {"rate", {0.0}}}, {},
                       {{"shape", "v 0 0 0\nv +1.5 0 0\nv 0 .5 0\nv 0 0 1e-1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"}});
    return f.refusal();
  };
  const std::vector<double> plain = in_scales();
  EXPECT_EQ(plain.size(), 3u);
  EXPECT_EQ(shape(), "");
  bool any = false;
  for (const char* name : {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "fr_FR.utf8"}) any = any || std::setlocale(LC_NUMERIC, name);
  const std::vector<double> with_commas = in_scales();
  const std::string refused = shape();
  std::setlocale(LC_NUMERIC, "C");
  if (!any) GTEST_SKIP() << "no locale with commas is installed here";
  EXPECT_EQ(with_commas, plain);
  EXPECT_EQ(refused, "");
}

TEST(Dates, AreTheSameInEveryScale) {
  const std::string day = "2020-06-01T";
  const auto utc = Epoch::of((day + "12:00:00").c_str(), -0.25);
  for (const char* same : {"12:00:37 TAI", "12:01:09.184 TT", "11:59:59.75 UT1"}) {
    const auto epoch = Epoch::of((day + same).c_str(), -0.25);
    ASSERT_TRUE(epoch) << same;
    EXPECT_NEAR(seconds_between(utc->tt, epoch->tt), 0.0, 2e-9) << same;
    EXPECT_NEAR(seconds_between(utc->ut1, epoch->ut1), 0.0, 2e-9) << same;
  }
  EXPECT_NEAR(seconds_between(utc->tt, *read_date("MJD 59001.5 UTC", TimeScale::tt, 0.0)), 0.0, 2e-9);
  EXPECT_NEAR(seconds_between(utc->tt, *read_date("JD 2459001.5 + 0.5 UTC", TimeScale::tt, 0.0)), 0.0, 2e-9);
}

TEST(Dates, ThatAreNoneAreRefused) {
  for (const char* none : {"",
                           "noon",
                           "2023-02-29T00:00:00",
                           "2026-11-26",
                           "2026-11-26T12:00:00 EST",
                           "2026-11-26T12:00:60",
                           "2026-11-26T12:00:00 tt",
                           "JD",
                           "JD nan TT",
                           "MJD 60000 + TT",
                           "1950-01-01T00:00:00 UTC",
                           "2026-13-01T00:00:00",
                           "2026-11-26T24:00:00",
                           "2026-11-26T12:60:00",
                           "2026-11-26T12:00:-1",
                           "2026-11-26T12:00:nan",
                           "2026-11-26T12:00:00+1",
                           "2016-12-31T23:59:60 TT",
                           "2201-01-01T00:00:00",
                           "JD 2524958.5",
                           "JD 2524950 + 20",
                           "JD 2451545 + inf",
                           "MJD 1e300"})
    EXPECT_FALSE(Epoch::of(none, 0.0)) << none;
}

/// Its days are counted whole, so that a number of 5 digits before the point keeps 11 after it.
TEST(Dates, OfModifiedJulianDaysKeepTheirDigits) {
  const auto tt = read_date("MJD 59001.123456789 TT", TimeScale::tt, 0.0);
  EXPECT_EQ(tt->whole, 59001.0 + 2400000.5 - Days::kJ2000);
  EXPECT_NEAR(tt->part, 0.123456789, 4e-12);
}

/// Over a day by its polynomial: as by the series, at its ends and across; in another thread and after other days the same bits.
TEST(IntermediatePole, OfADayIsThatOfTheSeries) {
  double worst = 0.0;
  for (int i = 0; i < 400; ++i) {
    const Days tt{9000.5 + 37.0 * i, 0.25 * (i % 5)};
    const auto exact = intermediate_pole(tt), quick = intermediate_pole_of_day(tt);
    for (int k = 0; k < 3; ++k) worst = worse(worst, std::abs(exact[k] - quick[k]));
  }
  EXPECT_LE(worst, 1e-15);  // 2e-10 arcsec; X is 1e-3
  const Days when{9123.5, 0.3721};
  const auto first = intermediate_pole_of_day(when);
  std::array<double, 3> elsewhere{};
  std::thread([&] { elsewhere = intermediate_pole_of_day(when); }).join();
  for (int i = 0; i < 100; ++i) intermediate_pole_of_day({9123.5 + i, 0.1});
  EXPECT_EQ(intermediate_pole_of_day(when), first);
  EXPECT_EQ(elsewhere, first);
}

/// By the equinox in place of the origin: bias, precession and nutation, apparent sidereal time. Two ways of the IAU through different
/// series, which agree to some microseconds of arc.
TEST(EarthAxes, AreThoseByTheEquinox) {
  for (const char* date : {"2003-05-06T07:08:09.5", "2026-11-26T12:00:00", "1999-12-31T23:00:00"}) {
    const auto e = Epoch::of(date, 0.321);
    const double x = 0.2 * kArcsec, y = -0.35 * kArcsec, theta = apparent_sidereal_time(e->ut1, e->tt), s = tio_locator(e->tt);
    const auto rows = bias_precession_nutation(e->tt);
    const auto turn = [](double angle, const Vector3d& axis) { return Eigen::AngleAxisd(-angle, axis).toRotationMatrix(); };  // of axes
    const Matrix3d date_of = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rows.data());
    const Matrix3d wanted =
        turn(-y, Vector3d::UnitX()) * turn(-x, Vector3d::UnitY()) * turn(s, Vector3d::UnitZ()) * turn(theta, Vector3d::UnitZ()) * date_of;
    const auto axes = earth_axes(e->tt, e->ut1, x, y);
    const Matrix3d found = Eigen::Map<const Matrix3d>(axes.data()).transpose();
    EXPECT_LE((found - wanted).norm(), 1e-5 * kArcsec) << date;
    EXPECT_LE((found * found.transpose() - Matrix3d::Identity()).norm(), 1e-15) << date;
  }
}

/// A thousand years from J2000 are what the series of the planets are made for; of a Sun that stands still there is no end.
TEST(CelestialPosition, IsRefusedBeyondTheYearsOfItsSeries) {
  constexpr double kYear = 365.25 * 86400.0;
  const AskedField::Texts epoch{{"epoch", "2000-01-01T12:00:00 TT"}};
  const double mars = static_cast<double>(Celestial::mars);
  for (const auto& [field, end] :
       {std::pair(AskedField("third_body", {{"body", {mars}}}, epoch), 1),
        std::pair(AskedField("celestial_body", {{"body", {mars}}}, epoch), 1), std::pair(AskedField("sunlight", {}, epoch), 1),
        std::pair(AskedField("harris_priester", {}, epoch), 4), std::pair(AskedField("sunlight", {{"direction", {1.0, 0.0, 0.0}}}), 0)}) {
    EXPECT_EQ(field.at({0.0, 0.0, 6.9e6}, 999.0 * kYear).beyond, 0);
    EXPECT_EQ(field.at({0.0, 0.0, 6.9e6}, 1001.0 * kYear).beyond, end);
    EXPECT_EQ(field.at({0.0, 0.0, 6.9e6}, -1001.0 * kYear).beyond, end);
  }
}

/// Geocentric or heliocentric, against DE440, within the errors that the series are known to have [km].
TEST(CelestialPosition, IsThatOfDE440) {
  struct Known {
    Celestial body;
    const char* name;
    double error;
  };
  constexpr Known kKnown[] = {{Celestial::mercury, "mercury", 950.0},  {Celestial::venus, "venus", 1850.0},
                              {Celestial::earth, "earth", 7.0},        {Celestial::mars, "mars", 8300.0},
                              {Celestial::jupiter, "jupiter", 1.26e5}, {Celestial::saturn, "saturn", 3.6e5},
                              {Celestial::uranus, "uranus", 2.6e5},    {Celestial::neptune, "neptune", 9.3e4}};
  std::vector<std::vector<std::string>> texts;
  const auto rows = rows_of("ephemerides/check_positions.csv", &texts);
  std::map<std::pair<double, std::string>, Vector3d> all;
  for (std::size_t i = 1; i < rows.size(); ++i) all[{rows[i][1], texts[i][2]}] = Vector3d(rows[i][4], rows[i][5], rows[i][6]);
  int checked = 0;
  for (const auto& [key, sun] : all) {
    if (key.second != "sun") continue;
    const Days tt{key.first - Days::kJ2000, 0.0};
    const auto found = [&](Celestial body, Celestial from) { return (1e-3 * vector_of(celestial_position_of_day(body, from, tt))).eval(); };
    for (const Known& k : kKnown) {
      const Vector3d wanted = all.at({key.first, k.name}) - sun;
      EXPECT_LE((found(k.body, Celestial::sun) - wanted).norm(), k.error) << k.name << " " << key.first;
      EXPECT_LE((found(Celestial::sun, k.body) + wanted).norm(), k.error) << k.name;
      ++checked;
    }
    EXPECT_LE((found(Celestial::moon, Celestial::earth) - all.at({key.first, "moon_geocentric"})).norm(), 31.0) << key.first;
    EXPECT_LE(
        (found(Celestial::sun, Celestial::moon) - (sun - all.at({key.first, "earth"}) - all.at({key.first, "moon_geocentric"}))).norm(),
        38.0);
  }
  EXPECT_EQ(checked, 7 * 8);
}

TEST(CelestialPosition, OfADayIsThatOfTheSeries) {
  double worst = 0.0;
  for (int i = 0; i < 60; ++i)
    for (int body = 0; body < 10; ++body)
      for (const Celestial origin : {Celestial::earth, Celestial::moon, Celestial::mars}) {
        const Days tt{8000.5 + 61.0 * i, 0.2 * (i % 6)};
        const Vector3d exact = vector_of(celestial_position(static_cast<Celestial>(body), origin, tt));
        const Vector3d quick = vector_of(celestial_position_of_day(static_cast<Celestial>(body), origin, tt));
        if (exact.norm() > 0.0) worst = worse(worst, (quick - exact).norm() / exact.norm());
      }
  EXPECT_LE(worst, 2e-12);  // to which ERFA solves Kepler's equation of planets
}

/// Against the difference of two pulls in 113 bits; 10 km and 2,000 km from the body too, where x + f d loses the digits of d over that.
TEST(ThirdBody, PullsAsTheDifferenceOfTwoPulls) {
  using Wide = Eigen::Matrix<__float128, 3, 1>;
  const auto root = [](__float128 a) {
    __float128 x = std::sqrt(static_cast<double>(a));
    for (int i = 0; i < 3; ++i) x = (x + a / x) / 2;
    return x;
  };
  const std::string date = "2026-03-21T14:00:00 UTC";
  for (const auto& [name, body] : {std::pair("sun", Celestial::sun), std::pair("moon", Celestial::moon)}) {
    const AskedField field("third_body", {{"body", {static_cast<double>(body)}}}, {{"epoch", date}});
    for (const double t : {0.0, 123456.7}) {
      const Vector3d p = vector_of(celestial_position_of_day(body, Celestial::earth, Epoch::of(date.c_str(), 0.0)->tt.after(t)));
      const Vector3d aside(0.48, -0.6, 0.64);
      for (const Vector3d& x : {Vector3d(7e6, 1e5, -3e5), Vector3d(-1e7, 3e7, 2e7), Vector3d(1.0, -2.0, 0.5), (p + 1e4 * aside).eval(),
                                (p - 2e6 * aside).eval()}) {
        Wide d, to, a;
        for (int k = 0; k < 3; ++k) d[k] = p[k], to[k] = d[k] - x[k];
        const __float128 mu = gravitational_parameter(body), r = root(to.dot(to)), R = root(d.dot(d));
        a = mu * (to / (r * r * r) - d / (R * R * R));
        const __float128 along = x.x() * d[0] + x.y() * d[1] + x.z() * d[2];
        const auto U = static_cast<double>(-mu * (1 / r - 1 / R - along / (R * R * R)));
        const Vector3d wanted(static_cast<double>(a[0]), static_cast<double>(a[1]), static_cast<double>(a[2]));
        const auto found = field.at(x, t);
        EXPECT_LE((found.value.head<3>() - wanted).norm() / wanted.norm(), 1e-14 + 4e-16 * p.norm() / (p - x).norm()) << name;
        const auto size = static_cast<double>(mu / (R * R * R)) * x.squaredNorm();
        EXPECT_LE(std::abs(found.value[3] - U), 1e-14 * (size + std::abs(U)) + 1e-33 * static_cast<double>(mu / R)) << name;
      }
    }
  }
}
TEST(ThirdBody, IsNotTheOriginAndHasADate) {
  const auto refusal = [](double body, const char* epoch) {
    return AskedField("third_body", {{"body", {body}}}, {{"epoch", epoch}}).refusal();
  };
  EXPECT_EQ(refusal(1.0, "2026-03-21T14:00:00 UTC"), "");
  EXPECT_EQ(refusal(1.0, "soon"), "a date of UTC, UT1, TT or TAI from 1960 to 2200: 2026-11-26T12:00:00 UTC");
  EXPECT_EQ(refusal(4.0, "2026-03-21T14:00:00 UTC"), "another than the origin of world axes");
}

/// Harmonics in the axes of the Earth: those of a planet at rest that stands so. Polar motion alone, about a mean axis, the same.
TEST(TurningPlanet, HasTheAxesOfTheEarth) {
  std::map<std::string, std::vector<double>> given = {{"mu", {4e14}},
                                                      {"radius", {6.4e6}},
                                                      {"coefficients", {2, 0, -5e-4, 0, 2, 2, 2e-6, -1e-6, 3, 1, 2e-6, 3e-7}},
                                                      {"rate", {7.292115e-5}}};
  const std::string date = "2026-03-21T14:00:00 UTC";
  const double x = 0.15 * kArcsec, y = 0.4 * kArcsec;
  given["pole_x"] = {x}, given["pole_y"] = {y};
  const AskedField mean("spherical_harmonics", given);
  given["orientation"] = {1.0}, given["dut1"] = {0.07};
  const AskedField iau("spherical_harmonics", given, {{"epoch", date}});
  given["rate"] = {0.0};
  EXPECT_EQ(AskedField("spherical_harmonics", given, {{"epoch", date}}).refusal(),
            "7.292115e-05 rad/s, that of Earth, whose orientation is iau2006");
  given.erase("pole_x"), given.erase("pole_y"), given.erase("orientation"), given.erase("dut1");
  const AskedField still("spherical_harmonics", given);
  const auto e = Epoch::of(date.c_str(), 0.07);
  const Vector3d place(7e6, -1e6, 3e6);
  for (const double t : {0.0, 4000.0}) {
    const auto axes = earth_axes(e->tt.after(t), e->ut1.after(t), x, y);
    const Matrix3d R = Eigen::Map<const Matrix3d>(axes.data());
    const auto a = iau.at(place, t), b = still.at(R.transpose() * place);
    EXPECT_LE((a.value.head<3>() - R * b.value.head<3>()).norm() / a.value.head<3>().norm(), 1e-15);
    const Matrix3d W = (Eigen::AngleAxisd(y, Vector3d::UnitX()) * Eigen::AngleAxisd(x, Vector3d::UnitY())).toRotationMatrix();
    const Matrix3d tilted = Eigen::AngleAxisd(7.292115e-5 * t, Vector3d::UnitZ()) * W.transpose();
    const auto c = mean.at(place, t), d = still.at(tilted.transpose() * place);
    EXPECT_LE((c.value.head<3>() - tilted * d.value.head<3>()).norm() / c.value.head<3>().norm(), 1e-15);
  }
}

/// Either coordinate of the pole moves it by itself.
TEST(TurningPlanet, HasItsPoleWhereEitherCoordinateSays) {
  const std::map<std::string, std::vector<double>> given = {
      {"mu", {4e14}}, {"radius", {6.4e6}}, {"coefficients", {2, 0, -5e-4, 0, 2, 2, 2e-6, -1e-6, 3, 1, 2e-6, 3e-7}}, {"rate", {0.0}}};
  const AskedField still("spherical_harmonics", given);
  const Vector3d place(7e6, -1e6, 3e6);
  for (const auto& [key, axis] : {std::pair<std::string, Vector3d>("pole_x", Vector3d::UnitY()), {"pole_y", Vector3d::UnitX()}}) {
    auto moved = given;
    moved[key] = {8e-5};
    const Matrix3d R = Eigen::AngleAxisd(-8e-5, axis).toRotationMatrix();
    const auto a = AskedField("spherical_harmonics", moved).at(place), b = still.at(R.transpose() * place);
    EXPECT_LE((a.value.head<3>() - R * b.value.head<3>()).norm() / a.value.head<3>().norm(), 1e-15) << key;
    EXPECT_GT((a.value.head<3>() - still.at(place).value.head<3>()).norm() / a.value.head<3>().norm(), 1e-8) << key;
  }
}

/// Light comes from where the Sun is, by the square of its distance; half of it where its centre is at the edge of the shadow.
TEST(Sunlight, ComesFromTheSunOfItsDate) {
  const std::string date = "2026-01-03T17:00:00 UTC";  // near the perihelion
  const AskedField light("sunlight", {{"irradiance", {1361.0}}}, {{"epoch", date}});
  const Vector3d sun = vector_of(celestial_position(Celestial::sun, Celestial::earth, Epoch::of(date.c_str(), 0.0)->tt));
  EXPECT_NEAR(sun.norm(), 0.9833 * 149597870700.0, 1e-4 * 149597870700.0);
  const Vector3d across = sun.unitOrthogonal(), up = sun.normalized();
  const Vector3d day = 7e6 * up, night = -7e6 * up;
  EXPECT_LE((light.at(day).value.head<3>() + 1361.0 * std::pow(149597870700.0 / (sun - day).norm(), 2) * (sun - day).normalized()).norm(),
            1e-9);
  EXPECT_EQ(light.at(night).value.norm(), 0.0);
  const Vector3d edge = -std::sqrt(7e6 * 7e6 - 6378.137e3 * 6378.137e3) * up + 6378.137e3 * across;  // seen from the Sun 4e-5 rad inside
  const double seen = light.at(edge).value.norm() / light.at(day).value.norm();
  EXPECT_NEAR(seen, 0.5, 0.01);
  // The disc is the one seen from the place: far from the origin a sphere before its middle leaves a ring of it.
  const Vector3d far = 1e10 * up, before = far + 4e8 * up;
  const AskedField ring("sunlight", {{"irradiance", {1361.0}}, {"radius", {1e6}}, {"centre", {before.x(), before.y(), before.z()}}},
                        {{"epoch", date}});
  const double disc = std::asin(695700e3 / (sun - far).norm()), sphere = std::asin(1e6 / 4e8);
  EXPECT_NEAR(ring.at(far).value.norm() / light.at(far).value.norm(), 1.0 - std::pow(sphere / disc, 2), 1e-12);
  EXPECT_GT(light.at(edge, 86400.0)
                .value.head<3>()
                .normalized()
                .dot(-vector_of(celestial_position(Celestial::sun, Celestial::earth, Epoch::of(date.c_str(), 0.0)->tt.after(86400.0)))
                          .normalized()),
            1.0 - 1e-8);
}

/// Of a disc of 0.05 rad what a sphere four times as large leaves: ring by ring, each by the arc of it that is covered.
TEST(Sunlight, IsWhatTheSphereLeavesOfTheDisc) {
  const double a = 0.05, b = 0.21, r = 1e7;
  const AskedField light("sunlight", {{"irradiance", {1.0}}, {"direction", {1.0, 0.0, 0.0}}, {"disc", {a}}, {"radius", {r * std::sin(b)}}});
  for (const double c : {0.165, 0.19, 0.21, 0.24, 0.255}) {
    constexpr int kRings = 20000;
    double seen = 1.0;
    for (int i = 0; i < kRings; ++i) {
      const double ring = a * (i + 0.5) / kRings, cosine = (ring * ring + c * c - b * b) / (2.0 * ring * c);
      seen -= 2.0 * ring / a / kRings * std::acos(std::clamp(cosine, -1.0, 1.0)) / std::numbers::pi;
    }
    EXPECT_NEAR(light.at(r * Vector3d(-std::cos(c), std::sin(c), 0.0)).value.norm(), seen, 3e-7) << c;  // (1 / kRings)^1.5 at the edges
  }
}

/// A sphere that is seen within the disc of the Sun leaves a ring of it, and has its edges where it goes in and comes out; a larger one
/// hides the disc between such edges. Inside of the sphere it is night, on the side of the Sun too.
TEST(Sunlight, HasEdgesWhereTheDiscsTouch) {
  const double a = 0.05, r = 1e7;
  const Vector3d centre(2e6, -3e6, 5e6);
  for (const double b : {0.02, 0.21}) {
    const AskedField light("sunlight", {{"irradiance", {1.0}},
                                        {"direction", {1.0, 0.0, 0.0}},
                                        {"disc", {a}},
                                        {"radius", {r * std::sin(b)}},
                                        {"centre", {centre[0], centre[1], centre[2]}}});
    const auto place = [&](double c) { return Vector3d(centre + r * Vector3d(-std::cos(c), std::sin(c), 0.0)); };
    for (const double c : {0.01, 0.029, 0.031, 0.07, 0.15, 0.17, 0.27}) {
      const std::vector<double> g = light.edges(place(c));
      ASSERT_EQ(g.size(), 2u);
      EXPECT_NEAR(g[0], c - (a + b), 1e-13);
      EXPECT_NEAR(g[1], c - std::abs(a - b), 1e-13);
    }
    EXPECT_NEAR(light.at(place(0.01)).value.norm(), b < a ? 1.0 - b * b / (a * a) : 0.0, 1e-14);
    for (const Vector3d& u : {Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(-1, 0, 0)})
      EXPECT_EQ(light.at(centre + 0.5 * r * std::sin(b) * u).value.norm(), 0.0);
  }
}

/// About the Sun it comes from the origin.
TEST(Sunlight, GoesOutFromTheSunAtTheOrigin) {
  const AskedField light("sunlight", {{"origin", {0.0}}, {"radius", {0.0}}}, {{"epoch", "2026-01-03T17:00:00 UTC"}});
  const Vector3d place(1e11, -2e11, 5e10);
  const Vector3d wanted = 1361.0 * std::pow(149597870700.0 / place.norm(), 2) * place.normalized();
  EXPECT_LE((light.at(place, 5e6).value.head<3>() - wanted).norm(), 1e-15 * wanted.norm());
}

/// The bulge follows the Sun of the date as it does one that stands there.
TEST(HarrisPriester, HasItsBulgeBehindTheSunOfItsDate) {
  const std::string date = "2026-04-03T17:00:00 UTC";
  const double t = 40.0 * 86400.0;
  const Vector3d sun =
      vector_of(celestial_position(Celestial::sun, Celestial::earth, Epoch::of(date.c_str(), 0.0)->tt.after(t))).normalized();
  const AskedField moving("harris_priester", {{"exponent", {2.0}}}, {{"epoch", date}});
  const AskedField still("harris_priester", {{"exponent", {2.0}}, {"direction", {sun.x(), sun.y(), sun.z()}}});
  for (const Vector3d& x : {Vector3d(6.9e6, 1e5, 2e5), Vector3d(-3e6, 5e6, 4e6)})
    EXPECT_NEAR(moving.at(x, t).value[0] / still.at(x, 7.0).value[0], 1.0, 1e-11);
}

TEST(HarrisPriester, IsAirOfAPlanet) {
  EXPECT_EQ(AskedField("harris_priester", {{"origin", {0.0}}}, {{"epoch", "2026-04-03T17:00:00 UTC"}}).refusal(),
            "another than the Sun, which heats the air");
}

TEST(Ellipsoid, HasAHeightAtItsCentre) {
  const AskedField table("tabulated_atmosphere", {{"table", {0.0, 1.0, 1e5, 1e-6}}, {"flattening", {0.003}}});
  EXPECT_TRUE(std::isfinite(table.at(Vector3d::Zero()).value[0]));
}

/// About any centre and any axis the height is that of the place which is moved and turned with them.
TEST(Ellipsoid, StandsAboutItsAxis) {
  const std::map<std::string, std::vector<double>> given = {{"table", {0.0, 1.0, 1e6, 1e-6}}, {"flattening", {0.05}}};
  auto turned = given;
  const Vector3d axis(0.36, -0.48, 0.8), centre(1e5, -3e5, 2e5);
  turned["axis"] = {axis[0], axis[1], axis[2]}, turned["centre"] = {centre[0], centre[1], centre[2]};
  const AskedField home("tabulated_atmosphere", given), there("tabulated_atmosphere", turned);
  const Matrix3d R = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), axis).toRotationMatrix();
  for (const Vector3d& u : {Vector3d(1, 0, 0), Vector3d(0.6, 0, 0.8), Vector3d(0.36, 0.48, -0.8)}) {
    const Vector3d place = 6.7e6 * u;
    EXPECT_NEAR(there.at(centre + R * place).value[0] / home.at(place).value[0], 1.0, 1e-12);  // 1e-9 m of a scale height of 72 km
  }
}

/// Around another body there is no shadow of the Earth's size; what does not go together is refused.
TEST(Sunlight, KnowsWhatItsShadowIsOf) {
  const AskedField::Texts at = {{"epoch", "2026-01-03T17:00:00 UTC"}};
  const auto refusal = [](const std::map<std::string, std::vector<double>>& given, const AskedField::Texts& texts) {
    return AskedField("sunlight", given, texts).refusal();
  };
  EXPECT_EQ(refusal({{"origin", {1.0}}}, at), "that of the body at the origin, 1737.4 km of the Moon; 0: no shadow");
  EXPECT_EQ(refusal({{"origin", {1.0}}, {"radius", {1737.4e3}}}, at), "");
  EXPECT_EQ(refusal({{"origin", {1.0}}, {"radius", {0.0}}}, at), "");
  EXPECT_EQ(refusal({{"origin", {1.0}}, {"centre", {3.8e8, 0.0, 0.0}}}, at), "");  // of the Earth, where it is then
  EXPECT_EQ(refusal({{"origin", {0.0}}}, at), "0, for no shadow: the Sun is at the origin");
  EXPECT_EQ(refusal({{"origin", {0.0}}, {"radius", {0.0}}}, at), "");
  EXPECT_EQ(refusal({{"disc", {5e-3}}}, at), "none: that of the Sun goes by its distance, from `epoch` on");
  EXPECT_EQ(refusal({{"direction", {1.0, 0.0, 0.0}}, {"disc", {5e-3}}}, {}), "");
}

TEST(CelestialBody, IsWhereTheEphemeridesHaveIt) {
  const std::string date = "2026-01-03T17:00:00 TT";
  const AskedField moon("celestial_body", {{"body", {1.0}}, {"origin", {0.0}}}, {{"epoch", date}});
  const Vector3d wanted = vector_of(celestial_position(Celestial::moon, Celestial::sun, Epoch::of(date.c_str(), 0.0)->tt.after(5000.0)));
  EXPECT_LE((moon.at({}, 5000.0).value.head<3>() - wanted).norm() / wanted.norm(), 2e-12);
}

}  // namespace
}  // namespace cardan::test
