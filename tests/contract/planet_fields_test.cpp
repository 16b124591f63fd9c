// Fields of planets: harmonics and atmospheres against other formulations.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "plugins/fields/planet.hpp"
#include "tests/support/field_values.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::AngleAxisd, Eigen::Matrix3d, Eigen::Vector3d;
using Numbers = std::map<std::string, std::vector<double>>;

std::vector<double> numbers(const Vector3d& x) { return {x.x(), x.y(), x.z()}; }

/// mu and radius as the head of a file says.
Numbers of_head(const std::string& file) {
  std::ifstream in(std::string(CARDAN_SOURCE_DIR "/tests/reference/data/gravity/") + file);
  Numbers out;
  for (std::string line; std::getline(in, line) && line[0] == '#';)
    for (const char* name : {"mu", "radius"})
      if (line.starts_with(std::string("# ") + name + ": ")) out[name] = {std::stod(line.substr(line.find(':') + 1))};
  return out;
}

// Positions of the file are rounded to a millimetre, and accelerations are those of the rounded ones.
TEST(SphericalHarmonics, GiveTheAccelerationsOfOtherFormulations) {
  std::vector<std::vector<std::string>> texts;
  const auto rows = rows_of("gravity/check_accelerations.csv", &texts);
  double worst = 0.0;
  int checked = 0;
  for (std::size_t i = 1; i < rows.size(); ++i, ++checked) {
    Numbers given = of_head(texts[i][0]);
    given["coefficients"] = coefficients_of("gravity/" + texts[i][0]);
    given["degree"] = {rows[i][1]}, given["rate"] = {0.0};
    const Vector3d x(rows[i][2], rows[i][3], rows[i][4]), a(rows[i][5], rows[i][6], rows[i][7]);
    const auto out = AskedField("spherical_harmonics", given).at(x);
    worst = worse(worse(worst, (out.value.head<3>() - a).norm() / a.norm()), std::abs(-out.value[3] / rows[i][8] - 1.0));
  }
  EXPECT_GE(checked, 19);
  EXPECT_LE(worst, 1e-14);
}

TEST(SphericalHarmonics, OfOrderZeroAreZonalOnes) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  const auto any = [&] { return Vector3d(normal(random), normal(random), normal(random)); };
  for (int trial = 0; trial < 20; ++trial) {
    const Vector3d axis = any().normalized(), centre = 1e6 * any(),
                   x = centre + (7e6 + 1e6 * std::abs(normal(random))) * any().normalized();
    const double J[] = {1e-3, -2e-6, 3e-5, 4e-4, -5e-4};
    Numbers zonal{{"mu", {4e14}}, {"radius", {6.4e6}}, {"axis", numbers(axis)}, {"centre", numbers(centre)}}, spherical = zonal;
    for (int n = 2; n <= 6; ++n) {
      zonal["J" + std::to_string(n)] = {J[n - 2]};
      for (const double c : {1.0 * n, 0.0, -J[n - 2] / std::sqrt(2.0 * n + 1.0), 0.0}) spherical["coefficients"].push_back(c);
    }
    spherical["rate"] = {0.3}, spherical["meridian"] = numbers(any().normalized());
    const auto a = AskedField("zonal_harmonics", zonal).at(x, 5.0), b = AskedField("spherical_harmonics", spherical).at(x, 5.0);
    EXPECT_LE(largest((a.value - b.value).cwiseQuotient(a.value)), 1e-13) << trial;
    EXPECT_LE((a.gradient.topRows<3>() - b.gradient.topRows<3>()).norm() / a.gradient.topRows<3>().norm(), 1e-14) << trial;
  }
}

/// At a pole, where a longitude is none, C_21 and S_21 pull aside; and what a gradient is there.
TEST(SphericalHarmonics, KnowNoSingularPole) {
  const double mu = 2.0, a = 0.5, r = 3.0, C = 0.01, S = -0.02;
  const AskedField f("spherical_harmonics", {{"mu", {mu}}, {"radius", {a}}, {"coefficients", {2, 1, C, S}}, {"rate", {0.0}}});
  const auto pole = f.at({0.0, 0.0, r});
  // U = -mu/r (1 + (a/r)^2 sqrt(15) z (C x + S y)/r^2).
  const Vector3d aside = mu * a * a * std::sqrt(15.0) / std::pow(r, 4) * Vector3d(C, S, 0.0);
  EXPECT_LE((pole.value.head<3>() - (aside - Vector3d(0, 0, mu / (r * r)))).norm(), 1e-16);
  const double h = 1e-4;
  for (int j = 0; j < 3; ++j) {
    const Vector3d d = h * Vector3d::Unit(j);
    const Eigen::Vector4d slope = (8.0 * (f.at(Vector3d(0, 0, r) + d).value - f.at(Vector3d(0, 0, r) - d).value) -
                                   (f.at(Vector3d(0, 0, r) + 2 * d).value - f.at(Vector3d(0, 0, r) - 2 * d).value)) /
                                  (12.0 * h);
    EXPECT_LE((slope - pole.gradient.col(j)).norm(), 1e-11) << j;
  }
}

TEST(SphericalHarmonics, TurnWithTheirPlanet) {
  const Vector3d axis = Vector3d(0.2, -0.5, 0.8).normalized(), meridian(0.3, 1.0, 0.4), centre(1e5, 2e5, -3e5), x(3e5, -5e5, 4e5);
  Numbers given = of_head("vesta_vesta20h_20.csv");
  given["coefficients"] = coefficients_of("gravity/vesta_vesta20h_20.csv");
  given["rate"] = {0.0};
  const AskedField still("spherical_harmonics", given);
  given["rate"] = {3.27e-4}, given["axis"] = numbers(axis), given["meridian"] = numbers(meridian.normalized()),
  given["centre"] = numbers(centre);
  const AskedField turning("spherical_harmonics", given);
  Matrix3d R;
  R.col(2) = axis, R.col(0) = (meridian - meridian.dot(axis) * axis).normalized(), R.col(1) = axis.cross(R.col(0));
  for (const double t : {0.0, 1234.5}) {
    const Matrix3d at = AngleAxisd(3.27e-4 * t, axis).toRotationMatrix() * R;
    const auto a = turning.at(x, t), b = still.at(at.transpose() * (x - centre));
    EXPECT_LE((a.value.head<3>() - at * b.value.head<3>()).norm() / a.value.head<3>().norm(), 1e-14);
    EXPECT_LE((a.gradient.topRows<3>() - at * b.gradient.topRows<3>() * at.transpose()).norm() / a.gradient.topRows<3>().norm(), 1e-13);
    EXPECT_NEAR(a.value[3] / b.value[3], 1.0, 1e-14);
  }
}

/// Check values of ERFA (t_erfa_c.c: era00) at two dates, and the day that both begin with.
TEST(TurningPlanet, StandsWhereTheEarthDoes) {
  const auto angle = [](const char* text) { return earth_rotation_angle(*read_date(text, TimeScale::ut1, 0.0)); };
  EXPECT_NEAR(angle("2007-10-15T00:00:00"), 0.4022837240028158, 1e-12);
  EXPECT_NEAR(angle("2000-01-01T12:00:00Z"), 2.0 * M_PI * 0.7790572732640, 1e-12);
  EXPECT_NEAR(angle("2007-10-15T06:30:36.5"),
              std::fmod(0.4022837240028158 + 2.0 * M_PI * 1.00273781191135448 * 23436.5 / 86400.0, 2.0 * M_PI), 1e-12);
}

/// Its attitude is the quaternion of its axes with w >= 0, after more than half a turn too.
TEST(TurningPlanet, TellsTheNearerOfBothQuaternions) {
  const double rate = 1e-3;
  const AskedField field("planet_attitude", {{"rate", {rate}}});
  for (const double angle : {0.4, 2.0, 3.0, 3.5, 4.4, 6.0}) {
    const double half = angle < M_PI ? 0.5 * angle : 0.5 * angle - M_PI;
    EXPECT_LT((field.at(Vector3d::Zero(), angle / rate).value - Eigen::Vector4d(std::cos(half), 0, 0, std::sin(half))).norm(), 1e-14)
        << angle;
  }
}

/// A box against its masses, by Gauss' points in each of 6 x 6 x 6 parts; beyond its surface there is no more to know.
TEST(Polyhedron, PullsAsItsMassesDo) {
  const Vector3d edges(2.0, 3.0, 1.2), axis = Vector3d(1.0, 2.0, -0.5).normalized(), meridian(0.4, 0.2, 1.0), centre(3.0, -1.0, 2.0);
  const double mu = 5.0, rate = 0.3, t = 2.7;
  const AskedField box("polyhedron", {{"mu", {mu}},
                                      {"box", numbers(edges)},
                                      {"rate", {rate}},
                                      {"axis", numbers(axis)},
                                      {"meridian", numbers(meridian)},
                                      {"centre", numbers(centre)}});
  Matrix3d R;
  R.col(2) = axis, R.col(0) = (meridian - meridian.dot(axis) * axis).normalized(), R.col(1) = axis.cross(R.col(0));
  R = AngleAxisd(rate * t, axis) * R;
  constexpr double kNodes[] = {-0.906179845938664, -0.538469310105683, 0.0, 0.538469310105683, 0.906179845938664};
  constexpr double kWeights[] = {0.236926885056189, 0.478628670499366, 0.568888888888889, 0.478628670499366, 0.236926885056189};
  constexpr int kParts = 6;
  std::vector<std::pair<double, double>> line;  // on (-1/2, 1/2)
  for (int k = 0; k < kParts; ++k)
    for (int i = 0; i < 5; ++i) line.emplace_back((k + 0.5 + 0.5 * kNodes[i]) / kParts - 0.5, 0.5 * kWeights[i] / kParts);
  for (const Vector3d& x : {Vector3d(4.0, 1.0, 0.5), Vector3d(-0.3, 0.2, 3.0), Vector3d(1.2, -2.4, 1.3), Vector3d(30.0, -20.0, 10.0)}) {
    Vector3d a = Vector3d::Zero();
    double U = 0.0;
    for (const auto& [u, wu] : line)
      for (const auto& [v, wv] : line)
        for (const auto& [w, ww] : line) {
          const Vector3d d = x - edges.cwiseProduct(Vector3d(u, v, w));
          a -= mu * wu * wv * ww / std::pow(d.norm(), 3) * d, U -= mu * wu * wv * ww / d.norm();
        }
    const auto found = box.at(centre + R * x, t);
    EXPECT_LE((found.value.head<3>() - R * a).norm() / a.norm(), 1e-10) << x.transpose();
    EXPECT_NEAR(found.value[3] / U, 1.0, 1e-10);
    EXPECT_EQ(found.beyond, 0);
  }
  EXPECT_EQ(box.at(centre + R * Vector3d(0.9, -1.4, 0.5), t).beyond, 1);
  EXPECT_EQ(box.at(centre + R * Vector3d(0.9, -1.6, 0.5), t).beyond, 0);
}
/// Against the same sums in 50 digits: rounding grows with the cube of the distance, to where harmonics take over, which have none of that.
TEST(Polyhedron, OfErosHasTheDigitsOfItsSums) {
  std::ifstream file(CARDAN_SOURCE_DIR "/tests/reference/data/gravity/eros_shape_856.txt");
  const std::string shape{std::istreambuf_iterator<char>(file), {}};
  const AskedField eros("polyhedron", {{"mu", {446275.472004}}, {"unit", {1000.0}}, {"rate", {0.0}}}, {}, {{"shape", shape}});
  const std::pair<double, Vector3d> wanted[] = {{1.5, {-0.00032704270668591492, -0.00032240951514115370, -0.00041647664886365180}},
                                                {3.0, {-9.2290676968947135e-5, -7.8243772003439124e-5, -1.0327731795241928e-4}},
                                                {10.0, {-8.6160195535407996e-6, -6.9297593292053806e-6, -9.2288119420404585e-6}},
                                                {30.0, {-9.60241404565147751e-7, -7.68611416867203609e-7, -1.02460860104321863e-6}},
                                                {1e3, {-8.64432686009195122e-10, -6.91544766768295871e-10, -9.22056680437016291e-10}},
                                                {1e5, {-8.64428260874059805e-14, -6.91542590977064172e-14, -9.22056758669834029e-14}}};
  for (const auto& [radii, a] : wanted) {
    const Vector3d found = eros.at(17600.0 * radii * Vector3d(0.6, 0.48, 0.64)).value.head<3>();
    EXPECT_LE((found - a).norm() / a.norm(), 1e-14 * (radii > 10.0 ? 1.0 : std::pow(radii, 3))) << radii;
  }
  // Where harmonics take over, along the longest arm, of which they leave out most: (n + 1) C_n / 10^n of a, n = 13, C_n below 0.01.
  const auto edge = eros.at({-175956.781, -14719.705, -5511.23573});
  const Vector3d a(1.43184623316539819e-5, 1.21690790522097013e-6, 4.54906813337744309e-7);
  const Matrix3d G = (Matrix3d() << 1.61620863564558e-10, 2.07880241614075e-11, 7.75047628805425e-12, 2.07880241614075e-11,
                      -8.00308875565665e-11, 6.65471636192533e-13, 7.75047628805425e-12, 6.65471636192533e-13, -8.1589976007991e-11)
                         .finished();
  EXPECT_LE((edge.value.head<3>() - a).norm() / a.norm(), 1e-14);
  EXPECT_LE((edge.gradient.topRows<3>() - G).norm() / G.norm(), 1e-13);
}
TEST(Polyhedron, IsAClosedSurface) {
  const std::string corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n", faces = "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
  const auto told = [](const std::string& text) {
    const AskedField f("polyhedron", {{"mu", {1.0}}, {"rate", {0.0}}}, {}, {{"shape", text}});
    return f.refusal() + " / " + f.got();
  };
  EXPECT_EQ(told(corners + faces), " / ");
  EXPECT_EQ(told("# counted\n4 4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 3 2\n1 2 4\n2 3 4\n1 4 3\n"), " / ");
  EXPECT_EQ(told(corners + "f 0 2 1\nf 0 1 3\nf 1 2 3\nf 0 3 2\n"), " / ");  // from 0
  const std::string closed = "a closed surface of triangles, counter-clockwise from outside / ",
                    lines = "lines `v x y z` and `f i j k` of three numbers each / ";
  EXPECT_EQ(told(corners + "f 1 3 2\nf 1 2 4\nf 2 3 4\n"), closed + "a side of one triangle alone, of triangle 1");
  EXPECT_EQ(told(corners + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 3 4\n"),
            closed + "two triangles that go the same way along a side, of triangle 4");
  EXPECT_EQ(told(corners + "f 1 2 3\nf 1 4 2\nf 2 4 3\nf 1 3 4\n"),
            "triangles that go counter-clockwise, seen from outside / a body turned inside out");
  EXPECT_EQ(told("v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 0 1\n" + faces), closed + "a triangle without an area, of triangle 1");
  EXPECT_EQ(told(corners + "f 1 3 5\n"), lines + "a triangle with the corner 5, of 4");
  EXPECT_EQ(told(corners + "f 1 3\n"), lines + "line 5: f 1 3");
  EXPECT_EQ(told("v 0 0 x\n"), lines + "\"x\" in line 1");
}

TEST(SphericalHarmonics, RefuseRowsThatAreNone) {
  const auto refusal = [](std::vector<double> rows) {
    return AskedField("spherical_harmonics", {{"mu", {1.0}}, {"radius", {1.0}}, {"coefficients", std::move(rows)}, {"rate", {0.0}}})
        .refusal();
  };
  EXPECT_EQ(refusal({2, 0, 1e-3, 0}), "");
  for (const std::vector<double>& rows : {std::vector<double>{2.5, 0, 1, 0}, {2, 3, 1, 0}, {2, -1, 1, 0}, {361, 0, 1, 0}})
    EXPECT_EQ(refusal(rows), "rows of a degree n from 0 to 360 and an order m from 0 to n");
  EXPECT_EQ(refusal({2, 1, 1, 0, 2, 0, 1, 0, 2, 1, 1, 0}), "each degree and order once");
}

/// Each of the two epochs about a year, as IGRF is meant.
TEST(MagneticHarmonics, GiveTheValuesOfTheRoutineOfIgrf) {
  std::vector<std::vector<std::string>> texts;
  const auto model = rows_of("magnetic/igrf14.csv", &texts);
  constexpr double kYear = 365.25 * 86400.0;
  double worst = 0.0;
  int checked = 0;
  for (const auto& row : rows_of("magnetic/igrf14_check_geocentric.csv")) {
    const double year = row[0];
    std::size_t column = 3;  // of the epoch before
    while (column + 2 < model[0].size() && model[0][column + 1] <= year) ++column;
    const double epoch = model[0][column], span = model[0][column + 1] - epoch;
    std::map<std::pair<int, int>, std::array<double, 4>> all;
    for (std::size_t i = 1; i < model.size(); ++i) {
      auto& entry = all[{static_cast<int>(model[i][0]), static_cast<int>(model[i][1])}];
      const bool h = texts[i][2] == "h";
      entry[h] = 1e-9 * model[i][column], entry[2 + h] = 1e-9 * (model[i][column + 1] - model[i][column]) / (span * kYear);
    }
    Numbers given{{"rate", {0.0}}, {"since_epoch", {(year - epoch) * kYear}}};
    for (const auto& [nm, values] : all) {
      for (const int index : {nm.first, nm.second}) given["coefficients"].push_back(index);
      given["coefficients"].insert(given["coefficients"].end(), values.begin(), values.end());
    }
    const double r = 1e3 * row[1], colatitude = row[2] * M_PI / 180.0, longitude = row[3] * M_PI / 180.0;
    const GeodeticPlace place(M_PI / 2 - colatitude, longitude, r - 6371.2e3, 6371.2e3, 0.0);
    const Vector3d B = 1e9 * place.ned.transpose() * AskedField("magnetic_harmonics", given).at(place.x).value.head<3>();
    worst = worse(worst, largest(B - Vector3d(row[4], row[5], row[6])));
    ++checked;
  }
  EXPECT_EQ(checked, 120);
  EXPECT_LE(worst, 0.1) << "nT, the last digit of the coefficients that the routine has";
}

TEST(MagneticHarmonics, OfDegreeOneAreADipole) {
  const double g = -3e-5, h = 4e-6, a = 6371.2e3;
  const AskedField f("magnetic_harmonics",
                     {{"coefficients", {1, 0, g, 0, 0, 0, 1, 1, 0, h, 0, 0}}, {"rate", {0.0}}, {"degree", {13.0}}, {"radius", {a}}});
  const Vector3d moment(0.0, h, g), x(5e6, -6e6, 3e6);
  const double r = x.norm();
  const Vector3d wanted = std::pow(a / r, 3) * (3.0 * moment.dot(x) / (r * r) * x - moment);
  EXPECT_LE((f.at(x).value.head<3>() - wanted).norm() / wanted.norm(), 1e-15);
}

TEST(MagneticHarmonics, RefuseNanoteslaWithoutTheirUnit) {
  EXPECT_EQ(AskedField("magnetic_harmonics", {{"coefficients", {1, 0, -29351.8, 0, 12, 0}}, {"rate", {0.0}}, {"degree", {13.0}}}).refusal(),
            "g and h of at most 1 T");
  EXPECT_EQ(AskedField("magnetic_harmonics", {{"coefficients", {0, 0, 1e-5, 0, 0, 0}}, {"rate", {0.0}}, {"degree", {13.0}}}).refusal(),
            "rows of a degree n from 1 to 360 and an order m from 0 to n");
}

/// From far below to far above, on the axis too: heights that were put in come out.
TEST(StandardAtmosphere, KnowsTheHeightAboveAnEllipsoid) {
  constexpr double kRadius = 6378137.0, kFlattening = 1.0 / 298.257223563;
  const AskedField round("standard_atmosphere", {{"radius", {kRadius}}}),
      flat("standard_atmosphere", {{"radius", {kRadius}}, {"flattening", {kFlattening}}});
  for (const double latitude : {0.0, 1e-9, 0.3, 0.8, 1.2, 1.57, M_PI / 2, -M_PI / 2, -0.7})
    for (const double height : {-4900.0, 0.0, 5e3, 30e3, 60e3, 85e3}) {
      const auto wanted = round.at({kRadius + height, 0.0, 0.0}),
                 got = flat.at(GeodeticPlace(latitude, 1.1, height, kRadius, kFlattening).x);
      EXPECT_EQ(got.beyond, 0);
      EXPECT_NEAR(got.value[0] / wanted.value[0], 1.0, 1e-12) << latitude << " " << height;  // 1e-9 m over a fall of 6 km
      const Vector3d along = got.gradient.row(0), up = -GeodeticPlace(latitude, 1.1, height, kRadius, kFlattening).ned.col(2);
      EXPECT_LE((along - wanted.gradient(0, 0) * up).norm() / along.norm(), 1e-9) << latitude << " " << height;
    }
  EXPECT_EQ(flat.at({0, 0, kRadius * (1.0 - kFlattening) - 5.1e3}).beyond, 1);
  EXPECT_EQ(flat.at({kRadius + 86.1e3, 0, 0}).beyond, 2);
}

// Densities are printed to six digits; places are rounded to a millimetre.
TEST(HarrisPriester, GivesTheDensitiesOfAnotherRoutine) {
  const Vector3d sun(24622331959.580, -133060326832.922, -57688711921.833);
  const AskedField f("harris_priester",
                     {{"direction", numbers(sun.normalized())}, {"exponent", {6.0}}, {"flattening", {1.0 / 298.257223563}}});
  const auto rows = rows_of("atmosphere/harris_priester_check.csv");
  EXPECT_EQ(rows.size(), 23u);
  for (const auto& row : rows) EXPECT_NEAR(f.at({row[0], row[1], row[2]}).value[0] / row[3], 1.0, 5e-6) << row[2];
}

/// The bulge is 30 degrees east of the Sun, at its declination, on the side to which the Earth turns.
TEST(HarrisPriester, BulgesBehindTheSun) {
  const Vector3d axis = Vector3d(0.2, -0.5, 0.8).normalized(), sun = Vector3d(0.5, 0.4, 0.2).normalized(), centre(1e5, 2e5, -3e5);
  const AskedField f("harris_priester",
                     {{"direction", numbers(sun)}, {"exponent", {2.0}}, {"axis", numbers(axis)}, {"centre", numbers(centre)}});
  const double R = 6378137.0, least = 2.249e-12, most = 7.492e-12;  // at 400 km
  const Vector3d bulge = AngleAxisd(M_PI / 6, axis) * sun, side = bulge.cross(axis).normalized();
  const auto at = [&](const Vector3d& u, double h) { return f.at(centre + (R + h) * u); };
  EXPECT_NEAR(at(bulge, 400e3).value[0] / most, 1.0, 1e-12);
  EXPECT_NEAR(at(-bulge, 400e3).value[0] / least, 1.0, 1e-12);
  EXPECT_NEAR(at(side, 400e3).value[0] / (0.5 * (least + most)), 1.0, 1e-12);
  EXPECT_NEAR(at(-bulge, 410e3).value[0] / std::sqrt(least * 1.558e-12), 1.0, 1e-10);
  EXPECT_EQ(at(sun, 99e3).beyond, 1);
  EXPECT_EQ(at(sun, 1001e3).beyond, 2);
  EXPECT_NEAR(at(bulge, 1100e3).value[0] / 1.81e-14, 1.0, 1e-12);
  EXPECT_EQ(f.at(centre).beyond, 1);
  EXPECT_NEAR(f.at(centre).value[0] / 4.974e-7, 1.0, 1e-12);
  const Vector3d u = Vector3d(0.1, 0.7, -0.3).normalized();
  const auto here = at(u, 507e3);
  for (int j = 0; j < 3; ++j) {
    const double h = 50.0;
    const auto there = [&](double by) { return f.at(centre + (R + 507e3) * u + by * Vector3d::Unit(j)).value[0]; };
    const double slope = (8.0 * (there(h) - there(-h)) - (there(2 * h) - there(-2 * h))) / (12.0 * h);
    EXPECT_NEAR(here.gradient(0, j), slope, 1e-8 * here.gradient.row(0).norm());
  }
}

TEST(TabulatedAtmosphere, FallsExponentiallyFromRowToRow) {
  const double R = 6378.137e3;
  const std::vector<double> rows{100e3, 5e-7, 150e3, 2e-9, 200e3, 2.5e-10, 300e3, 2e-11};
  const AskedField f("tabulated_atmosphere", {{"table", rows}, {"radius", {R}}});
  for (std::size_t i = 0; i < rows.size(); i += 2) EXPECT_NEAR(f.at({0, R + rows[i], 0}).value[0] / rows[i + 1], 1.0, 1e-11);
  const auto between = f.at({0, 0, R + 240e3});
  EXPECT_NEAR(between.value[0] / (2.5e-10 * std::pow(0.08, 0.4)), 1.0, 1e-12);
  EXPECT_NEAR(between.gradient(0, 2) / (between.value[0] * std::log(0.08) / 100e3), 1.0, 1e-12);
  EXPECT_EQ(between.beyond, 0);
  EXPECT_EQ(f.at({R + 99e3, 0, 0}).beyond, 1);
  EXPECT_EQ(f.at({R + 301e3, 0, 0}).beyond, 2);
  EXPECT_EQ(f.at({R + 301e3, 0, 0}).value[0], f.at({R + 300e3, 0, 0}).value[0]);
  const auto refusal = [](std::vector<double> table) {
    return AskedField("tabulated_atmosphere", {{"table", std::move(table)}}).refusal();
  };
  EXPECT_EQ(refusal({1, 1}), "at least two rows");
  EXPECT_EQ(refusal({1, 1, 1, 0.5}), "heights that increase from row to row");
  EXPECT_EQ(refusal({1, 1, 2, 0}), "densities above 0");
}

}  // namespace
}  // namespace cardan::test
