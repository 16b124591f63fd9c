// How planets stand, by the IAU and by the bulletins of the IERS.
#include "plugins/astronomy/planets.hpp"

#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>

#include "plugins/astronomy/bulletin.hpp"
#include "plugins/astronomy/earth.hpp"
#include "tests/support/field_values.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180.0, kArcsec = kDegree / 3600.0;

Matrix3d matrix_of(const std::array<double, 9>& columns) { return Eigen::Map<const Matrix3d>(columns.data()); }
double turn_between(double a, double b) { return std::abs(std::remainder(a - b, 2.0 * std::numbers::pi)); }

std::string content(const char* file) {
  std::ifstream in(std::string(CARDAN_SOURCE_DIR "/tests/reference/data/time_frames/") + file);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// NAIF's numbers, where the report of 2015 has the constants of that of 2009.
TEST(PlanetAxes, AreThoseOfNaif) {
  struct Known {
    const char* name;
    Celestial body;
    double pole, meridian;  // [rad] 1e-12: as they are printed
  };
  constexpr Known kKnown[] = {{"VENUS", Celestial::venus, 1e-12, 1e-11},     {"MOON", Celestial::moon, 1e-12, 1e-11},
                              {"JUPITER", Celestial::jupiter, 1e-12, 1e-11}, {"SATURN", Celestial::saturn, 1e-12, 1e-11},
                              {"URANUS", Celestial::uranus, 1e-12, 1e-11},   {"NEPTUNE", Celestial::neptune, 1e-12, 10.0},
                              {"MARS", Celestial::mars, 2e-5, 4e-5},         {"MERCURY", Celestial::mercury, 3e-5, 2e-3}};
  std::istringstream in(content("iau_pole_check_naif.txt"));
  int checked = 0;
  for (std::string line; std::getline(in, line);) {
    std::istringstream fields(line);
    std::string date, name;
    double seconds = 0.0, ra = 0.0, dec = 0.0, W = 0.0;
    if (!(fields >> date >> seconds >> name >> ra >> dec >> W)) continue;
    Matrix3d rotation;
    for (int i = 0; i < 9; ++i) fields >> rotation(i / 3, i % 3);
    for (const Known& k : kKnown) {
      if (name != k.name) continue;
      const double days = seconds / 86400.0, whole = std::floor(days - 0.5) + 0.5;
      const Days tt{whole, days - whole};
      const auto found = pole_and_meridian(k.body, tt);
      EXPECT_LE(turn_between(found[0], ra), k.pole) << line;
      EXPECT_LE(turn_between(found[1], dec), k.pole) << line;
      EXPECT_LE(turn_between(found[2], W), k.meridian) << line;
      if (k.meridian < 1e-5) {
        const Matrix3d axes = matrix_of(planet_axes(k.body, tt));
        EXPECT_LE((axes - rotation).norm(), 3e-11) << line;
      }
      ++checked;
    }
  }
  EXPECT_EQ(checked, 4 * 8);
}

/// The formulas of the kernel pck00011.tpc of NAIF, which has the constants of 2015, by a program that reads that file, whose W are rounded
/// as of 1e7 degrees. [deg]
TEST(PlanetAxes, HaveTheConstantsOf2015) {
  struct Known {
    Celestial body;
    double ra, dec, W;
  };
  constexpr Known kKnown[] = {{Celestial::mercury, 281.0016312361396, 61.4142049712526, 186.1883518870},
                              {Celestial::venus, 272.7600000000000, 67.1600000000000, 260.1766314000},
                              {Celestial::moon, 271.7538871711495, 67.9550677429671, 151.3987786215},
                              {Celestial::mars, 317.6520807827160, 52.8700418683211, 184.6614758237},
                              {Celestial::jupiter, 268.0576698008707, 64.4966775120052, 306.5919999983},
                              {Celestial::saturn, 40.5794855030801, 83.5359428336756, 75.1383428006},
                              {Celestial::uranus, 257.3110000000000, -15.1750000000000, 60.1441783998},
                              {Celestial::neptune, 299.5016720873764, 42.9605543113158, 47.4206294501},
                              {Celestial::sun, 286.1300000000000, 63.8700000000000, 209.7353000000}};
  const Days tt = Epoch::of("2026-06-06T18:00:00 TT", 0.0)->tt;
  for (const Known& k : kKnown) {
    const auto found = pole_and_meridian(k.body, tt);
    EXPECT_LE(turn_between(found[0], kDegree * k.ra), 1e-14) << static_cast<int>(k.body);
    EXPECT_LE(turn_between(found[1], kDegree * k.dec), 1e-14) << static_cast<int>(k.body);
    EXPECT_LE(turn_between(found[2], kDegree * k.W), 5e-11) << static_cast<int>(k.body);
    // Its axes are those of its pole and meridian, and turn about the pole at its rate.
    const Matrix3d R = matrix_of(planet_axes(k.body, tt));
    const Matrix3d wanted =
        (Eigen::AngleAxisd(found[0] + 0.5 * std::numbers::pi, Vector3d::UnitZ()) *
         Eigen::AngleAxisd(0.5 * std::numbers::pi - found[1], Vector3d::UnitX()) * Eigen::AngleAxisd(found[2], Vector3d::UnitZ()))
            .toRotationMatrix();
    EXPECT_LE((R - wanted).norm(), 2e-14) << static_cast<int>(k.body);
    const double h = 10.0;
    const Matrix3d rate =
        (matrix_of(planet_axes(k.body, tt.after(h))) - matrix_of(planet_axes(k.body, tt.after(-h)))) / (2.0 * h) * R.transpose();
    EXPECT_NEAR((Vector3d(rate(2, 1), rate(0, 2), rate(1, 0)).dot(R.col(2))) / rotation_rate(k.body), 1.0,
                k.body == Celestial::moon      ? 1e-3
                : k.body == Celestial::mercury ? 2e-4
                                               : 1e-6)
        << static_cast<int>(k.body);
  }
}

/// The librations of the Moon in DE440, Euler angles of its principal axes: the IAU's series are within 160 m at its surface; turned the
/// other way about, they would be 1 km off.
TEST(PlanetAxes, OfTheMoonFollowDE440) {
  struct Known {
    double jd, phi, theta, psi;  // [d], [rad]
  };
  constexpr Known kKnown[] = {{2451513.5, -0.05241821950226612, 0.42532617914659565, 2557.012303594864},
                              {2451545.0, -0.054147058087019556, 0.424855460999069, 2564.258272721513},
                              {2451600.25, -0.05611845318313938, 0.4236904964133835, 2576.966383698657},
                              {2451650.0, -0.05676838444513487, 0.4225557428855911, 2588.4080333580437},
                              {2459960.0, -0.04528843087540544, 0.38870017656795103, 4499.455189415919},
                              {2460000.25, -0.04234217683202606, 0.38772342941358545, 4508.708921728072},
                              {2460040.5, -0.04143946314446393, 0.387316656489154, 4517.964662251831}};
  double worst = 0.0;
  for (const Known& k : kKnown) {
    const Matrix3d de = (Eigen::AngleAxisd(k.phi, Vector3d::UnitZ()) * Eigen::AngleAxisd(k.theta, Vector3d::UnitX()) *
                         Eigen::AngleAxisd(k.psi, Vector3d::UnitZ()))
                            .toRotationMatrix();
    const Matrix3d found = matrix_of(principal_axes_of_moon({k.jd - Days::kJ2000, 0.0}));
    worst = worse(worst, Eigen::AngleAxisd(de.transpose() * found).angle());
  }
  EXPECT_LE(worst * 1737.4e3, 160.0);  // [m]
}

/// A day of the file is what the file has; between them cubics are exact, and a leap second breaks nothing. [TAI - UTC: 36 s, 37 from 2017]
TEST(Bulletin, GoesThroughItsDays) {
  const auto x = [](double d) { return 0.1 + 0.01 * d - 3e-4 * d * d + 1e-5 * d * d * d; };
  const auto ut1_tai = [](double d) { return -36.4 - 1e-3 * d + 2e-5 * d * d * d; };
  std::ostringstream csv;
  csv.precision(17);
  csv << "# days\nmjd,x_arcsec,y [mas],ut1_utc_s,dX_mas,dY_mas\n";
  for (int i = 0; i < 7; ++i) {
    const int mjd = 57750 + i;  // 2016-12-28; 57754 is 2017-01-01
    csv << mjd << ',' << x(i) << ',' << 1e3 * x(2.0 * i) << ',' << ut1_tai(i) + (mjd < 57754 ? 36.0 : 37.0) << ',' << 0.2 << ',' << -0.1 * i
        << '\n';
  }
  std::string fault;
  const Bulletin* b = Bulletin::of(csv.str(), fault);
  ASSERT_TRUE(b) << fault;
  EXPECT_EQ(Bulletin::of(csv.str(), fault), b);
  EXPECT_EQ(b->first(), 57750);
  EXPECT_EQ(b->last(), 57756);
  const Days start = Epoch::of("2016-12-28T00:00:00 UTC", 0.0)->tt;
  for (const double d : {0.0, 0.4, 1.0, 2.75, 3.5, 5.999, 6.0}) {
    const double leap = d >= 4.0 ? 1.0 : 0.0;  // seconds that have passed more
    const auto at = b->at(start.after(86400.0 * d + leap));
    EXPECT_NEAR(at.x / kArcsec, x(d), 1e-9) << d;
    EXPECT_NEAR(at.y / kArcsec, x(2.0 * d), 1e-9) << d;
    EXPECT_NEAR(at.ut1_tai, ut1_tai(d), 1e-9) << d;
    EXPECT_NEAR(at.dX / kArcsec, 2e-4, 1e-15) << d;
    EXPECT_NEAR(at.dY / kArcsec, -1e-4 * d, 1e-12) << d;
    EXPECT_TRUE(b->covers(start.after(86400.0 * d + leap))) << d;
  }
  EXPECT_FALSE(b->covers(start.after(-1.0)));
  EXPECT_FALSE(b->covers(start.after(6.0 * 86400.0 + 3.0)));
  // Across the leap second UT1 goes on evenly; a date of UT1 finds itself.
  const auto before = b->epoch("2016-12-31T23:59:60 UTC"), after = b->epoch("2017-01-01T00:00:00 UTC");
  EXPECT_NEAR(86400.0 * ((after->ut1.whole - before->ut1.whole) + (after->ut1.part - before->ut1.part)), 1.0, 1e-7);
  const auto itself = b->epoch("2017-01-01T06:00:00 UT1"), utc = Epoch::of("2017-01-01T06:00:00 UT1", ut1_tai(4.25) + 37.0);
  EXPECT_NEAR(86400.0 * (itself->tt.whole - utc->tt.whole + itself->tt.part - utc->tt.part), 0.0, 2e-8);
  EXPECT_NEAR(itself->ut1.part, 0.25, 1e-12);
}

/// As the IERS prints it: three lines of finals2000A.all of 2018 that carry the numbers of its columns, and one that has a date alone.
TEST(Bulletin, ReadsWhatTheIersPrints) {
  const auto line = [](const char* date, const char* mjd, const char* x, const char* y, const char* ut1, const char* dX, const char* dY) {
    std::string s(185, ' ');
    const auto put = [&](std::size_t at, const std::string& text) { s.replace(at, text.size(), text); };
    put(0, date), put(7, mjd), put(16, "I"), put(18, x), put(37, y), put(57, "I"), put(58, ut1), put(95, "I"), put(97, dX), put(116, dY);
    return s + "\n";
  };
  const std::string printed = line("18 1 1", "58119.00", " 0.059257", " 0.247609", " 0.2163577", "    0.166", "   -0.157") +
                              line("18 1 2", "58120.00", " 0.057423", " 0.248568", " 0.2155874", "    0.190", "   -0.164") +
                              line("18 1 3", "58121.00", " 0.055769", " 0.249510", " 0.2148609", "    0.221", "   -0.165") +
                              line("18 1 4", "58122.00", " 0.054473", " 0.250446", " 0.2140527", "         ", "         ") +
                              "18 1 5 58123.00\n";
  std::string fault;
  const Bulletin* b = Bulletin::of(printed, fault);
  ASSERT_TRUE(b) << fault;
  EXPECT_EQ(b->last(), 58122);
  const auto at = b->at(Epoch::of("2018-01-02T00:00:00 UTC", 0.0)->tt);
  EXPECT_NEAR(at.x, 0.057423 * kArcsec, 1e-16);
  EXPECT_NEAR(at.y, 0.248568 * kArcsec, 1e-16);
  EXPECT_NEAR(at.ut1_tai, 0.2155874 - 37.0, 1e-12);
  EXPECT_NEAR(at.dX, 0.190e-3 * kArcsec, 1e-19);
  EXPECT_NEAR(at.dY, -0.164e-3 * kArcsec, 1e-19);
  const std::string by_semicolon =
      "MJD;Year;x_pole;sigma_x_pole;y_pole;UT1-UTC;dX;sigma_dX;dY\n58119;2018;0.059257;1;0.247609;0.2163577;0.166;1;-0.157\n"
      "58120;2018;0.057423;1;0.248568;0.2155874;0.190;1;-0.164\n58121;2018;0.055769;1;0.249510;0.2148609;0.221;1;-0.165\n"
      "58122;2018;0.054473;1;0.250446;0.2140527;;;\n58123;2018;;;;;;;\n";
  const auto same = Bulletin::of(by_semicolon, fault)->at(Epoch::of("2018-01-02T00:00:00 UTC", 0.0)->tt);
  EXPECT_EQ(same.x, at.x);
  EXPECT_EQ(same.ut1_tai, at.ut1_tai);
  EXPECT_EQ(same.dY, at.dY);
}

TEST(Bulletin, ThatIsNoneIsRefused) {
  const auto fault = [](const std::string& file) {
    std::string text;
    EXPECT_EQ(Bulletin::of(file, text), nullptr) << file;
    return text;
  };
  const std::string head = "mjd,x,y,ut1_utc\n", days = "58119,0,0,0.1\n58120,0,0,0.1\n58121,0,0,0.1\n";
  EXPECT_EQ(fault(""), "0 days");
  EXPECT_EQ(fault(head + days), "3 days");
  EXPECT_EQ(fault("mjd,x,ut1_utc\n" + days), "no column y in line 1");
  EXPECT_EQ(fault(head + days + "58123,0,0,0.1\n"), "not the day after the one before, at 0 h: in line 5");
  EXPECT_EQ(fault(head + days + "58122.5,0,0,0.1\n"), "not the day after the one before, at 0 h: in line 5");
  EXPECT_EQ(fault(head + days + "58122,0,nan,0.1\n"), "\"nan\" for y in line 5");
  EXPECT_EQ(fault(head + days + "58122,0,0.1s,0.1\n"), "\"0.1s\" for y in line 5");
  EXPECT_EQ(fault(head + "58119,0,0,-37.1\n"), "too much for ut1_utc in line 2");
  EXPECT_EQ(fault("mjd,x [rad],y [rad],ut1_utc [ms]\n58119,0.06,0,216\n"), "too much for x in line 2");
  EXPECT_EQ(fault(head + "1e300,0,0,0.1\n"), "not a day from 1962 to 2100: in line 2");
  // After the days that are predicted dates stand alone; a row that is cut short in their midst is none of these.
  EXPECT_EQ(fault(head + days + "58122,0\n58123,0,0,0.1\n"), "no ut1_utc of the day before, but again in line 6");
  std::string text;
  const Bulletin* marked = Bulletin::of("\xEF\xBB\xBF" + head + days + "58122,0,0,0.1\n58123\n58124\n", text);
  ASSERT_TRUE(marked) << text;
  EXPECT_EQ(marked->last(), 58122);
}

/// The example of the IAU's SOFA tools for Earth attitude (2007 April 5, 12 h UTC, by X, Y of 2006/2000A): its bulletin's numbers as
/// constants.
TEST(Bulletin, TellsHowTheEarthStands) {
  std::ostringstream csv;
  csv << "mjd,x [mas],y [mas],ut1_utc [s],dX [mas],dY [mas]\n";
  for (int mjd = 54193; mjd < 54199; ++mjd) csv << mjd << ",34.9282,483.3163,-0.072073685,0.1750,-0.2259\n";
  Matrix3d wanted;  // from celestial to terrestrial axes
  wanted << +0.973104317697535, +0.230363826239128, -0.000703163482198, -0.230363800456037, +0.973104570632801, +0.000118545366625,
      +0.000711560162668, +0.000046626403995, +0.999999745754024;
  const std::string date = "2007-04-05T12:00:00 UTC";
  std::map<std::string, std::vector<double>> given = {{"rate", {7.292115e-5}}, {"orientation", {1.0}}};
  const AskedField field("planet_attitude", given, {{"epoch", date}}, {{"bulletin", csv.str()}});
  const auto answer = field.at(Vector3d::Zero());
  const Matrix3d found = Eigen::Quaterniond(answer.value[0], answer.value[1], answer.value[2], answer.value[3]).toRotationMatrix();
  EXPECT_LE((found.transpose() - wanted).norm(), 3e-11);
  EXPECT_EQ(answer.beyond, 0);
  EXPECT_EQ(field.at(Vector3d::Zero(), 2.6 * 86400.0).beyond, 1);
  for (const char* told : {"pole_x", "pole_y", "dut1"}) {
    auto twice = given;
    twice[told] = {1e-6};
    const AskedField refused("planet_attitude", twice, {{"epoch", date}}, {{"bulletin", csv.str()}});
    EXPECT_EQ(refused.refusal(), "none: `bulletin` tells it") << told;
    EXPECT_EQ(refused.key(), told);
  }
}

/// A bulletin that goes on: as a field that is given the numbers of that instant.
TEST(Bulletin, TurnsHarmonicsDayAfterDay) {
  std::map<std::string, std::vector<double>> given = {{"mu", {4e14}},
                                                      {"radius", {6.4e6}},
                                                      {"coefficients", {2, 0, -5e-4, 0, 2, 2, 2e-6, -1e-6, 3, 1, 2e-6, 3e-7}},
                                                      {"rate", {7.292115e-5}},
                                                      {"orientation", {1.0}}};
  const std::string file = content("eop_finals2000A_2026.csv"), date = "2026-03-21T14:00:00 UTC";
  const AskedField field("spherical_harmonics", given, {{"epoch", date}}, {{"bulletin", file}});
  given.erase("orientation"), given["rate"] = {0.0};
  const AskedField still("spherical_harmonics", given);
  std::string fault;
  const Bulletin* b = Bulletin::of(file, fault);
  ASSERT_TRUE(b) << fault;
  const Vector3d place(7e6, -1e6, 3e6);
  for (const double t : {0.0, 12.3 * 86400.0}) {
    const auto now = b->at(Epoch::of(date.c_str(), 0.0)->tt.after(t));
    const auto e = Epoch::of(date.c_str(), now.ut1_tai + 37.0);
    const Matrix3d R = matrix_of(earth_axes(e->tt.after(t), e->ut1.after(t), now.x, now.y, now.dX, now.dY));
    const auto a = field.at(place, t), s = still.at(R.transpose() * place);
    EXPECT_LE((a.value.head<3>() - R * s.value.head<3>()).norm() / a.value.head<3>().norm(), 1e-14);
    EXPECT_EQ(a.beyond, 0);
  }
  EXPECT_EQ(field.at(place, 100.0 * 86400.0).beyond, 1);
  given["orientation"] = {1.0}, given["rate"] = {7.292115e-5}, given["dut1"] = {0.1};
  EXPECT_EQ(AskedField("spherical_harmonics", given, {{"epoch", date}}, {{"bulletin", file}}).refusal(), "none: `bulletin` tells it");
  given.erase("dut1"), given["orientation"] = {0.0};
  EXPECT_EQ(AskedField("spherical_harmonics", given, {{"epoch", date}}, {{"bulletin", file}}).refusal(),
            "orientation: iau2006, that of the Earth");
}

/// Of Mars, of the Moon in its principal axes: harmonics of a planet at rest that stands so.
TEST(TurningPlanet, HasTheAxesOfOtherBodies) {
  std::map<std::string, std::vector<double>> given = {
      {"mu", {4e13}}, {"radius", {3.4e6}}, {"coefficients", {2, 0, -8e-4, 0, 2, 2, -8e-5, 5e-5, 3, 1, 4e-6, 3e-5}}, {"rate", {0.0}}};
  const AskedField still("spherical_harmonics", given);
  const std::string date = "2026-06-06T18:00:00 TT";
  const Days tt = Epoch::of(date.c_str(), 0.0)->tt;
  const Vector3d place(3e6, -1e6, 3e6);
  for (const auto& [choice, body] : {std::pair(7.0, Celestial::mars), std::pair(2.0, Celestial::moon), std::pair(3.0, Celestial::sun),
                                     std::pair(11.0, Celestial::neptune)}) {
    given["orientation"] = {choice}, given["rate"] = {rotation_rate(body)};
    const AskedField field("spherical_harmonics", given, {{"epoch", date}});
    for (const double t : {0.0, 40000.0}) {
      const Matrix3d R = matrix_of(choice == 2.0 ? principal_axes_of_moon(tt.after(t)) : planet_axes(body, tt.after(t)));
      const auto a = field.at(place, t), b = still.at(R.transpose() * place);
      EXPECT_LE((a.value.head<3>() - R * b.value.head<3>()).norm() / a.value.head<3>().norm(), 1e-14);
    }
  }
  given["orientation"] = {7.0}, given["rate"] = {7.292115e-5};
  EXPECT_EQ(AskedField("spherical_harmonics", given, {{"epoch", date}}).refusal(),
            "7.088218e-05 rad/s, that of the body, whose orientation is mars");
  given["rate"] = {7.088218e-5};
  EXPECT_EQ(AskedField("spherical_harmonics", given).refusal(), "a date of UTC, UT1, TT or TAI from 1960 to 2200: 2026-11-26T12:00:00 UTC");
  for (const char* earths : {"pole_x", "pole_y", "dut1"}) {
    auto more = given;
    more[earths] = {1e-6};
    const AskedField refused("spherical_harmonics", more, {{"epoch", date}});
    EXPECT_EQ(refused.refusal(), "0: only the Earth has it") << earths;
    EXPECT_EQ(refused.key(), earths);
  }
}

}  // namespace
}  // namespace cardan::test
