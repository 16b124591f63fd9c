#include "plugins/astronomy/planets.hpp"

#include <cmath>
#include <numbers>
#include <span>

#include "plugins/astronomy/daily.hpp"

namespace cardan {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0, kCentury = 36525.0;

/// Angle a + b T in centuries; what its sine adds to right ascension and W, its cosine to declination. [deg]
struct Wave {
  double a, b, ascension, declination, W;
};
/// Right ascension, declination a + b T, W = a + b d + c d^2, T in centuries, d in days from J2000. [deg]
struct Rotation {
  double ascension[2], declination[2], W[3];
  std::span<const Wave> waves;
};

constexpr Wave kMercury[] = {{174.7910857, 149472.53587500003, 0.0, 0.0, 0.01067257},
                             {349.5821714, 298945.07175000006, 0.0, 0.0, -0.00112309},
                             {164.3732571, 448417.60762500006, 0.0, 0.0, -0.0001104},
                             {339.1643429, 597890.1435000001, 0.0, 0.0, -2.539e-05},
                             {153.9554286, 747362.679375, 0.0, 0.0, -5.71e-06}};
constexpr Wave kMoon[] = {{125.045, -1935.5364525, -3.8787, 1.5419, 3.561},
                          {250.089, -3871.072905, -0.1204, 0.0239, 0.1208},
                          {260.008, 475263.3328725, 0.07, -0.0278, -0.0642},
                          {176.625, 487269.629985, -0.0172, 0.0068, 0.0158},
                          {357.529, 35999.0509575, 0.0, 0.0, 0.0252},
                          {311.589, 964468.49931, 0.0072, -0.0029, -0.0066},
                          {134.963, 477198.869325, 0.0, 0.0009, -0.0047},
                          {276.617, 12006.300765, 0.0, 0.0, -0.0046},
                          {34.226, 63863.5132425, 0.0, 0.0, 0.0028},
                          {15.134, -5806.6093575, -0.0052, 0.0008, 0.0052},
                          {119.743, 131.84064, 0.0, 0.0, 0.004},
                          {239.961, 6003.1503825, 0.0, 0.0, 0.0019},
                          {25.053, 473327.79642, 0.0043, -0.0009, -0.0044}};
constexpr Wave kMars[] = {{198.991226, 19139.4819985, 6.8e-05, 0.0, 0.0},  {226.292679, 38280.8511281, 0.000238, 0.0, 0.0},
                          {249.663391, 57420.7251593, 5.2e-05, 0.0, 0.0},  {266.18351, 76560.636795, 9e-06, 0.0, 0.0},
                          {79.398797, 0.5042615, 0.419057, 0.0, 0.0},      {122.433576, 19139.9407476, 0.0, 5.1e-05, 0.0},
                          {43.058401, 38280.8753272, 0.0, 0.000141, 0.0},  {57.663379, 57420.7517205, 0.0, 3.1e-05, 0.0},
                          {79.476401, 76560.6495004, 0.0, 5e-06, 0.0},     {166.325722, 0.5042615, 0.0, 1.591274, 0.0},
                          {129.071773, 19140.0328244, 0.0, 0.0, 0.000145}, {36.352167, 38281.0473591, 0.0, 0.0, 0.000157},
                          {56.668646, 57420.929536, 0.0, 0.0, 4e-05},      {67.364003, 76560.2552215, 0.0, 0.0, 1e-06},
                          {104.79268, 95700.4387578, 0.0, 0.0, 1e-06},     {95.391654, 0.5042615, 0.0, 0.0, 0.584542}};
constexpr Wave kJupiter[] = {{99.360714, 4850.4046, 0.000117, 5e-05, 0.0},
                             {175.895369, 1191.9605, 0.000938, 0.000404, 0.0},
                             {300.323162, 262.5475, 0.001432, 0.000617, 0.0},
                             {114.012305, 6070.2476, 3e-05, -1.3e-05, 0.0},
                             {49.511251, 64.3, 0.00215, 0.000926, 0.0}};
constexpr Wave kNeptune[] = {{357.85, 52.316, 0.7, -0.51, -0.48}};

const Rotation& rotation_of(Celestial body) {
  static constexpr Rotation kAll[] = {{{286.13, 0.0}, {63.87, 0.0}, {84.176, 14.1844, 0.0}, {}},
                                      {{269.9949, 0.0031}, {66.5392, 0.013}, {38.3213, 13.17635815, -1.4e-12}, kMoon},
                                      {{281.0103, -0.0328}, {61.4155, -0.0049}, {329.5988, 6.1385108, 0.0}, kMercury},
                                      {{272.76, 0.0}, {67.16, 0.0}, {160.2, -1.4813688, 0.0}, {}},
                                      {{0.0, -0.641}, {90.0, -0.557}, {190.147, 360.9856235, 0.0}, {}},
                                      {{317.269202, -0.10927547}, {54.432516, -0.05827105}, {176.049863, 350.891982443297, 0.0}, kMars},
                                      {{268.056595, -0.006499}, {64.495303, 0.002413}, {284.95, 870.536, 0.0}, kJupiter},
                                      {{40.589, -0.036}, {83.537, -0.004}, {38.9, 810.7939024, 0.0}, {}},
                                      {{257.311, 0.0}, {-15.175, 0.0}, {203.81, -501.1600928, 0.0}, {}},
                                      {{299.36, 0.0}, {43.46, 0.0}, {249.978, 541.1397757, 0.0}, kNeptune}};
  return kAll[static_cast<int>(body)];
}

/// What changes slowly: right ascension, declination, W less its steady turn. [rad]
void slow(int which, const Days& tt, double* out) {
  const Rotation& r = rotation_of(static_cast<Celestial>(which));
  const double d = tt.whole + tt.part, T = d / kCentury;
  out[0] = r.ascension[0] + r.ascension[1] * T, out[1] = r.declination[0] + r.declination[1] * T, out[2] = r.W[2] * d * d;
  for (const Wave& w : r.waves) {
    const double angle = kDegree * (w.a + w.b * T), sine = std::sin(angle);
    out[0] += w.ascension * sine, out[1] += w.declination * std::cos(angle), out[2] += w.W * sine;
  }
  for (int i = 0; i < 3; ++i) out[i] *= kDegree;
}
/// W of the steady turn [rad], from 0 to 2 pi or so: whole turns fall away from whole days without rounding.
double steady(Celestial body, const Days& tt) {
  const Rotation& r = rotation_of(body);
  const double turned = r.W[1] * tt.whole, rest = std::fma(r.W[1], tt.whole, -turned);
  return kDegree * std::remainder(std::fmod(turned, 360.0) + rest + r.W[0] + r.W[1] * tt.part, 360.0);
}

std::array<double, 9> axes_of(const std::array<double, 3>& pole) {
  const auto [a, d, w] = pole;
  const double ca = std::cos(a), sa = std::sin(a), cd = std::cos(d), sd = std::sin(d), cw = std::cos(w), sw = std::sin(w);
  const double z[] = {cd * ca, cd * sa, sd}, node[] = {-sa, ca, 0.0}, up[] = {-sd * ca, -sd * sa, cd};  // up = z x node
  std::array<double, 9> out{};
  for (std::size_t i = 0; i < 3; ++i) out[i] = cw * node[i] + sw * up[i], out[3 + i] = cw * up[i] - sw * node[i], out[6 + i] = z[i];
  return out;
}

}  // namespace

std::array<double, 3> pole_and_meridian(Celestial body, const Days& tt) {
  std::array<double, 3> out{};
  slow(static_cast<int>(body), tt, out.data());
  out[2] += steady(body, tt);
  return out;
}

std::array<double, 9> planet_axes(Celestial body, const Days& tt) {
  std::array<double, 3> pole{};
  daily<3, slow>(static_cast<int>(body), tt, pole.data());
  pole[2] += steady(body, tt);
  return axes_of(pole);
}

std::array<double, 9> principal_axes_of_moon(const Days& tt) {
  constexpr double kArcsecond = kDegree / 3600.0, kTurns[] = {67.8526 * kArcsecond, 78.6944 * kArcsecond, 0.2785 * kArcsecond};
  std::array<double, 9> axes = planet_axes(Celestial::moon, tt);
  for (int k = 0; k < 3; ++k) {  // about the axes 1, 2, 3 of what has been turned so far
    const std::size_t i = static_cast<std::size_t>((k + 1) % 3), j = static_cast<std::size_t>((k + 2) % 3);
    const double c = std::cos(kTurns[2 - k]), s = std::sin(kTurns[2 - k]);
    for (std::size_t r = 0; r < 3; ++r) {
      const double a = axes[3 * i + r], b = axes[3 * j + r];
      axes[3 * i + r] = c * a + s * b, axes[3 * j + r] = c * b - s * a;
    }
  }
  return axes;
}

double rotation_rate(Celestial body) { return kDegree * rotation_of(body).W[1] / 86400.0; }

}  // namespace cardan
