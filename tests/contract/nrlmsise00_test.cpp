// The field nrlmsise00: where and when it asks its model, its weather, its gradients and its refusals. Its model has its published table
// (tests/cases/environment_test.cpp).
#include "plugins/fields/nrlmsise00.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>
#include <random>

#include "plugins/fields/planet.hpp"
#include "plugins/fields/upper_air.hpp"
#include "tests/support/field_values.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::AngleAxisd, Eigen::Matrix3d, Eigen::Vector3d;
using Numbers = std::map<std::string, std::vector<double>>;
using Texts = AskedField::Texts;
constexpr double kRate = 7.292115e-5, kRadius = 6378137.0, kFlattening = 1.0 / 298.257223563, kPi = std::numbers::pi;

/// [kg/m^3], of angles in rad; the local time is that of the mean Sun.
double of_model(const msis::Conditions& at, double height, double latitude, double longitude) {
  msis::Moment moment;
  msis::prepare(at, moment);
  const double hours = at.seconds / 3600.0 + longitude * 12.0 / kPi, turn = hours * kPi / 12.0;
  return 1e3 * msis::air(moment, msis::Place<double>{1e-3 * height, std::cos(latitude), std::sin(latitude), std::cos(longitude),
                                                     std::sin(longitude), std::cos(turn), std::sin(turn)})
                   .density();
}
/// In axes that do not turn, of a planet whose longitude 0 is ahead of x by an angle.
Vector3d place(double height, double latitude, double longitude, double ahead) {
  return AngleAxisd(ahead, Vector3d::UnitZ()) * GeodeticPlace(latitude, longitude, height, kRadius, kFlattening).x;
}

const Numbers kUsual{{"f107", {150.0}}, {"f107_average", {130.0}}, {"ap", {12.0}}};

// 08:03:20 is second 29000. After 20 h it is the next day; the Earth has turned by 1.4 degrees more than the Sun.
TEST(Nrlmsise00Field, AsksForTheLatitudeLongitudeDateAndTime) {
  const AskedField f("nrlmsise00", kUsual, {{"epoch", "2026-06-21T08:03:20"}});
  const double ahead = earth_rotation_angle(*read_date("2026-06-21T08:03:20 UT1", TimeScale::ut1, 0.0));
  for (const double hours : {0.0, 4.0, 20.0, 24.0 * 193})
    for (const double latitude : {-1.2, 0.0, 0.9})
      for (const double longitude : {-2.0, 0.4, 3.0})
        for (const double height : {20e3, 60e3, 95e3, 115e3, 180e3, 400e3, 900e3}) {
          const double seconds = std::fmod(29000.0 + 3600.0 * hours, 86400.0);
          const int day = hours < 10.0 ? 172 : hours < 30.0 ? 173 : 365;  // 172 + 193
          const msis::Conditions at{day, seconds, 150.0, 130.0, {12.0}, false};
          const auto got = f.at(place(height, latitude, longitude, ahead + kRate * 3600.0 * hours), 3600.0 * hours);
          EXPECT_EQ(got.beyond, 0);
          EXPECT_NEAR(got.value[0] / of_model(at, height, latitude, longitude), 1.0, 1e-10) << hours << " " << height;
        }
  // The day after the last is the first of the next year.
  const auto in_2027 = f.at(place(400e3, 0.9, 0.4, ahead + kRate * 86400.0 * 194), 86400.0 * 194);
  const msis::Conditions new_year{1, 29000.0, 150.0, 130.0, {12.0}, false};
  EXPECT_NEAR(in_2027.value[0] / of_model(new_year, 400e3, 0.9, 0.4), 1.0, 1e-10);
}

// `astro.nrlmsise00` is the same model at the same angles.
TEST(Nrlmsise00Field, IsWhatIsAskedByHand) {
  const AskedField f("nrlmsise00", kUsual, {{"epoch", "2026-06-21T08:03:20"}});
  const double ahead = earth_rotation_angle(*read_date("2026-06-21T08:03:20 UT1", TimeScale::ut1, 0.0));
  for (const double latitude : {-1.2, 0.9})
    for (const double longitude : {-2.0, 3.0}) {
      UpperAirAsked asked;
      asked.day = 172, asked.seconds = 29000.0, asked.solar_time = 29000.0 + longitude * 43200.0 / kPi;
      asked.altitude = 400e3, asked.latitude = latitude, asked.longitude = longitude;
      asked.f107 = 150.0, asked.f107_average = 130.0, asked.ap.fill(12.0);
      EXPECT_NEAR(f.at(place(400e3, latitude, longitude, ahead)).value[0] / upper_air(asked).drag_density, 1.0, 1e-10) << latitude;
    }
}

// Printed to four digits; anomalous oxygen is 2 % of the density at 1000 km.
TEST(Nrlmsise00Field, HasTheProfileOfAnotherProgram) {
  const AskedField f("nrlmsise00", {{"f107", {121.0}}, {"f107_average", {80.0}}, {"ap", {7.0}}}, {{"epoch", "1986-06-19T21:30:00"}});
  const double ahead = earth_rotation_angle(*read_date("1986-06-19T21:30:00 UT1", TimeScale::ut1, 0.0));
  const auto rows = rows_of("atmosphere/nrlmsise00_profile_1986.csv");
  EXPECT_EQ(rows.size(), 11u);
  for (const auto& row : rows) {
    const double height = std::min(std::max(1e3 * row[0], 1e-3), 1000e3 - 1e-3);
    const double wanted = 1e3 * (row[1] + 16.0 * 1.66e-24 * row[2]);
    const auto got = f.at(place(height, -16.0 * kPi / 180.0, 312.0 * kPi / 180.0, ahead));
    EXPECT_EQ(got.beyond, 0);
    EXPECT_NEAR(got.value[0] / wanted, 1.0, 6e-4) << row[0];
  }
}

TEST(Nrlmsise00Field, StandsAndTurnsAsItsPlanet) {
  const Vector3d axis = Vector3d(0.2, -0.5, 0.8).normalized(), meridian = Vector3d(0.3, 1.0, 0.4).normalized(), centre(1e5, 2e5, -3e5);
  Numbers given = kUsual;
  given["day"] = {172.0 + 29000.0 / 86400.0};
  const AskedField plain("nrlmsise00", given);
  given["axis"] = {axis.x(), axis.y(), axis.z()}, given["meridian"] = {meridian.x(), meridian.y(), meridian.z()};
  given["centre"] = {centre.x(), centre.y(), centre.z()};
  const AskedField moved("nrlmsise00", given);
  Matrix3d R;
  R.col(2) = axis, R.col(0) = (meridian - meridian.dot(axis) * axis).normalized(), R.col(1) = axis.cross(R.col(0));
  for (const double t : {0.0, 5000.0}) {
    const Vector3d x = place(310e3, 0.8, -1.1, kRate * t);
    const auto a = plain.at(x, t), b = moved.at(R * x + centre, t);
    const msis::Conditions at{172, 29000.0 + t, 150.0, 130.0, {12.0}, false};
    EXPECT_NEAR(a.value[0] / of_model(at, 310e3, 0.8, -1.1), 1.0, 1e-10);
    EXPECT_NEAR(b.value[0] / a.value[0], 1.0, 1e-11);
    EXPECT_LE((b.gradient.row(0).transpose() - R * a.gradient.row(0).transpose()).norm() / a.gradient.row(0).norm(), 1e-9);
  }
}

// Differences of sixth order over 300 m: truncated at (300 m / scale height)^6, rounded at 1e-16 of the density over 300 m.
TEST(Nrlmsise00Field, GivesItsGradient) {
  const Texts epoch{{"epoch", "2026-03-02T21:10:00"}};
  Numbers storm = kUsual;
  storm["activity"] = {1.0}, storm["ap"] = {90.0};
  double worst = 0.0, sideways = 0.0;
  const Numbers cases[] = {kUsual, storm};
  for (const Numbers& given : cases) {
    const AskedField f("nrlmsise00", given, epoch);
    for (const double height : {5e3, 25e3, 47e3, 66e3, 80e3, 97e3, 112e3, 140e3, 220e3, 420e3, 800e3})
      for (const double latitude : {-1.4, -0.3, 0.7, kPi / 2}) {
        if (latitude > 1.5 && &given == &cases[1]) continue;  // activity fades by the distance from the pole: a corner there
        const Vector3d x = latitude > 1.5 ? Vector3d(0, 0, (1.0 - kFlattening) * kRadius + height) : place(height, latitude, 1.9, 0.0);
        const auto here = f.at(x, 1000.0);
        const Vector3d slope = here.gradient.row(0);
        constexpr double kStep = 100.0;
        Vector3d differences = Vector3d::Zero();
        for (int j = 0; j < 3; ++j)
          for (const auto& [steps, weight] : {std::pair(1, 45.0), std::pair(2, -9.0), std::pair(3, 1.0)})
            for (const int side : {1, -1})
              differences[j] += side * weight * f.at(x + side * steps * kStep * Vector3d::Unit(j), 1000.0).value[0] / (60.0 * kStep);
        worst = worse(worst, (slope - differences).norm() / slope.norm());
        const Vector3d up = -GeodeticPlace(latitude, 1.9, height, kRadius, kFlattening).ned.col(2);
        sideways = std::max(sideways, (slope - slope.dot(up) * up).norm() / slope.norm());
      }
  }
  EXPECT_LE(worst, 1e-9);
  EXPECT_GE(sideways, 1e-3);  // what the differences tell of is there
}

std::string storm_of_2003() {
  std::ifstream in(CARDAN_SOURCE_DIR "/tests/reference/data/atmosphere/space_weather_2003.csv");
  return {std::istreambuf_iterator<char>(in), {}};
}

// October 29, 2003: the flux of the 28th, the mean and ap of the 29th; 20:00 is in the seventh part of it. Back from there: 300, 179, 179,
// 207; eight parts: 400, 27, 39 of the 29th, 27, 18, 27, 12, 39 of the 28th; eight more: 22, 39, 15 and 4, 5, 9, 7, 7 of the 27th.
TEST(Nrlmsise00Field, TakesTheWeatherOfItsDays) {
  const Texts epoch{{"epoch", "2003-10-29T14:00:00Z"}}, file{{"weather", storm_of_2003()}};
  const double ahead = earth_rotation_angle(*read_date("2003-10-29T14:00:00 UT1", TimeScale::ut1, 0.0));
  const AskedField daily("nrlmsise00", {}, epoch, file), history("nrlmsise00", {{"activity", {1.0}}}, epoch, file);
  const double t = 6.0 * 3600.0 + 60.0;
  const Vector3d x = place(420e3, 0.6, -1.7, ahead + kRate * t);
  msis::Conditions at{302, 72060.0, 274.4, 146.8, {204.0}, false};
  EXPECT_NEAR(daily.at(x, t).value[0] / of_model(at, 420e3, 0.6, -1.7), 1.0, 1e-10);
  const double back[] = {
      204.0, 300.0, 179.0, 179.0, 207.0, (400 + 27 + 39 + 27 + 18 + 27 + 12 + 39) / 8.0, (22 + 39 + 15 + 4 + 5 + 9 + 7 + 7) / 8.0};
  std::copy(std::begin(back), std::end(back), at.ap);
  at.history = true;
  EXPECT_NEAR(history.at(x, t).value[0] / of_model(at, 420e3, 0.6, -1.7), 1.0, 1e-10);
  EXPECT_EQ(history.at(x, t).beyond, 0);
  const AskedField marked("nrlmsise00", {}, epoch, {{"weather", "\xEF\xBB\xBF" + storm_of_2003()}});  // as some editors write it
  EXPECT_EQ(marked.at(x, t).value[0], daily.at(x, t).value[0]);
}

TEST(Nrlmsise00Field, HoldsTheWeatherOfItsEnds) {
  const Texts epoch{{"epoch", "2003-10-27T00:00:00"}}, file{{"weather", storm_of_2003()}};
  const AskedField daily("nrlmsise00", {}, epoch, file), history("nrlmsise00", {{"activity", {1.0}}}, epoch, file);
  const double ahead = earth_rotation_angle(*read_date("2003-10-27T00:00:00 UT1", TimeScale::ut1, 0.0));
  const auto at = [&](const AskedField& f, double t) { return f.at(place(420e3, 0.6, -1.7, ahead + kRate * t), t); };
  constexpr double kDay = 86400.0;
  EXPECT_EQ(at(daily, 0.0).beyond, 0);
  EXPECT_EQ(at(daily, -1.0).beyond, 4);
  EXPECT_EQ(at(daily, 8 * kDay - 1.0).beyond, 0);
  EXPECT_EQ(at(daily, 8 * kDay).beyond, 8);
  EXPECT_EQ(at(history, 2 * kDay - 1.0).beyond, 4);
  EXPECT_EQ(at(history, 2 * kDay).beyond, 0);
  EXPECT_EQ(at(history, 8 * kDay).beyond, 8);
  const msis::Conditions before{299, 43200.0, 298.3, 147.1, {11.0}, false}, after{309, 43200.0, 190.4, 144.9, {13.0}, false};
  EXPECT_NEAR(at(daily, -0.5 * kDay).value[0] / of_model(before, 420e3, 0.6, -1.7), 1.0, 1e-10);
  EXPECT_NEAR(at(daily, 9.5 * kDay).value[0] / of_model(after, 420e3, 0.6, -1.7), 1.0, 1e-10);
  EXPECT_TRUE(std::isfinite(at(history, 1e300).value[0]));
}

TEST(Nrlmsise00Field, KnowsTheGroundAndAThousandKilometres) {
  const AskedField f("nrlmsise00", kUsual, {{"epoch", "2026-06-21T08:03:20"}});
  const auto at = [&](double height) { return f.at(place(height, 0.7, 0.1, 0.0)); };
  EXPECT_EQ(at(-1.0).beyond, 1);
  EXPECT_EQ(at(1.0).beyond, 0);
  EXPECT_EQ(at(1000e3 - 1.0).beyond, 0);
  EXPECT_EQ(at(1000e3 + 1.0).beyond, 2);
  EXPECT_NEAR(at(-50e3).value[0] / at(0.0).value[0], 1.0, 1e-9);
  EXPECT_NEAR(at(1200e3).value[0] / at(1000e3).value[0], 1.0, 1e-3);  // the place is that above, not that at the same time
  EXPECT_NEAR(at(0.0).value[0], 1.2, 0.1);
  const auto pole = f.at({0, 0, 6757e3}), centre = f.at({0, 0, 0});
  EXPECT_TRUE(pole.value.allFinite() && pole.gradient.allFinite() && pole.value[0] > 0.0);
  EXPECT_NEAR(pole.value[0] / f.at({1.0, -2.0, 6757e3}).value[0], 1.0, 1e-6);
  EXPECT_EQ(centre.beyond, 1);
  EXPECT_TRUE(centre.value.allFinite());
}

// With a quiet Sun on a day amid an active rotation, and a storm, 1/T of the model passes zero above the pole.
TEST(Nrlmsise00Field, TellsWhereItsModelFails) {
  const AskedField f("nrlmsise00", {{"day", {187.955}}, {"f107", {60.0}}, {"f107_average", {300.0}}, {"ap", {300.0}}});
  int told = 0;
  for (double height = 105e3; height < 125e3; height += 50.0) {
    const auto there = f.at(place(height, kPi / 2, 0.0, 0.0));
    told += there.beyond == 16;
    if (there.beyond == 0) {
      EXPECT_TRUE(std::isfinite(there.value[0]) && there.value[0] > 0.0) << height;
    }
  }
  EXPECT_GE(told, 10);
  EXPECT_LE(told, 390);
  // A flare while F10.7 was measured counts from the next midnight on.
  std::string flare = storm_of_2003();
  flare.replace(flare.find("291.7"), 5, "707.6");
  const AskedField g("nrlmsise00", {}, {{"epoch", "2003-10-29T12:00:00"}}, {{"weather", flare}});
  const Vector3d x = place(420e3, 0.3, 0.0, 0.0);
  EXPECT_EQ(g.at(x, 43199.0).beyond, 0);
  EXPECT_EQ(g.at(x, 43201.0).beyond, 16);
}

TEST(Nrlmsise00Field, RefusesWhatDoesNotFit) {
  const Texts epoch{{"epoch", "2003-10-29T14:00:00"}};
  const auto told = [](const Numbers& numbers, const Texts& texts, const Texts& files = {}) {
    const AskedField f("nrlmsise00", numbers, texts, files);
    return f.refusal() + " / " + f.got();
  };
  const auto changed = [](std::string text, const std::string& what, const std::string& with) {
    EXPECT_NE(text.find(what), std::string::npos);
    return Texts{{"weather", text.replace(text.find(what), what.size(), with)}};
  };
  const std::string all = storm_of_2003();
  const Texts file{{"weather", all}};
  EXPECT_EQ(told(kUsual, epoch), " / ");
  EXPECT_EQ(told(kUsual, {}), "the date of t = 0, 2026-11-26T12:00:00 UTC: the air follows the seasons and the Sun / no such key");
  EXPECT_EQ(told({{"f107", {150.0}}, {"day", {0.5}}}, {}), "a day of the year, 1 to 366 / ");
  EXPECT_EQ(told({{"f107", {150.0}}, {"day", {3.5}}}, epoch), "no day beside `epoch` / ");
  EXPECT_EQ(told(kUsual, {{"epoch", "yesterday"}}), "a date of UTC, UT1, TT or TAI from 1960 to 2200: 2026-11-26T12:00:00 UTC / ");
  EXPECT_EQ(told({}, epoch),
            "the flux F10.7 of the Sun, some 70 where it is quiet, 150 on the mean, 250 where it is active / neither it nor `weather`");
  EXPECT_EQ(told(kUsual, epoch, file), "no constants beside `weather` / ");
  EXPECT_EQ(told({{"ap", {15.0}}}, epoch, file), "no constants beside `weather` / ");
  EXPECT_EQ(told({{"day", {3.5}}}, {}, file), "the date of t = 0: `weather` has dates / no such key");
  EXPECT_EQ(told({}, epoch, changed(all, "f107_obs_c81", "mean")),
            "a CSV file whose first line names the columns year, month, day, ap1 to ap8, ap_avg, f107_obs, f107_obs_c81 / no column "
            "f107_obs_c81");
  EXPECT_EQ(told({}, epoch, changed(all, "2003,10,29", "2003,10,30")),
            "days one after the other, each once / 2003,10,30,47,40,90,80,77,77,87,87,39,27 in line 8");
  EXPECT_EQ(told({}, epoch, changed(all, "2003,10,31", "2003,10,32")),
            "days one after the other, each once / 2003,10,32,83,77,73,67,73,47,40,43,236,1 in line 10");
  EXPECT_EQ(told({}, epoch, changed(all, "291.7,146.8", ",146.8")), "a number in each column that is read / \"\" for f107_obs in line 8");
  EXPECT_EQ(told({}, epoch, changed(all, "291.7,146.8", "0.0,146.8")),
            "F10.7 above 0 and to 1000, ap from 0 to 400 / 0.0 for f107_obs in line 8");
  EXPECT_EQ(told({}, epoch, {{"weather", ""}}), "days one after the other, at least four / 0 days");
  EXPECT_EQ(told({}, epoch, changed(all, "\n", "\r\n")), " / ");  // of another system
}

}  // namespace
}  // namespace cardan::test
