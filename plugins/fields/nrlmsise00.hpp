#pragma once
// NRLMSISE-00 (Picone, Hedin, Drob and Aikin 2002): temperature and composition of the air from the ground to the exosphere.
// Above 123 km the temperature T is that of Bates; below, 1/T is a cubic spline in the geopotential height. With n_b of a species at 120
// km, where T is T_b, in diffusive equilibrium n = n_b (T_b / T)^(1 + alpha) exp(m W), W the integral of -g / (R T) over the height; below
// their turbopause species are mixed. Temperatures and n_b are sums over functions of latitude, longitude and local time, whose amplitudes
// follow from the day, the time of the day, the flux F10.7 of the Sun and the magnetic activity ap: `Moment` has these, made once for all
// places. Lengths in km, masses in g/mol, densities in 1/cm^3 and g/cm^3, and constants as rounded as the model has them.
#include <cmath>
#include <initializer_list>
#include <utility>

#include "core/spatial/tangent.hpp"
#include "plugins/fields/nrlmsise00_coefficients.hpp"

namespace cardan {

inline Tangent log(const Tangent& a) { return {std::log(a.x), a.d / a.x}; }

namespace msis {

inline constexpr double kDegree = 1.74533e-2, kHour = 0.2618, kSecond = 7.2722e-5, kDay = 1.72142e-2;  // [rad]

/// When, and what the Sun does then.
struct Conditions {
  int day;         // of the year, from 1
  double seconds;  // of that day, UT
  double f107;     // of the day before [1e-22 W/(m^2 Hz)]
  double average;  // over 81 days about the day
  double ap[7];    // of the day; with `history` also of these 3 h, of 3, 6, 9 h before, means of 12 to 33 and of 36 to 57 h before
  bool history;
};

/// Functions of a place: P_nm are Legendre functions of the latitude, l the longitude, h the local time. Triples are of n = 1, 3, 5 or of
/// 2, 4, 6 unless said; those with cosines, then those with sines. The magnetic activity has the first kActive.
enum Function {
  kZonal = 0,            // P_0 to P_5
  kHourly = 6,           // P_n1 cos h, P_n1 sin h
  kEven = kHourly + 6,   // P_n1 cos l, n = 1, 3, 5
  kOdd = kEven + 6,      // P_n1 cos l, n = 2, 4, 6
  kOddNorth = kOdd + 6,  // P_1 times that
  kActive = kOddNorth + 6,
  kSixth = kActive,                  // P_6
  kHourlySeason = kSixth + 1,        // P_21 cos h, P_21 sin h
  kTwiceHourly = kHourlySeason + 2,  // P_22, P_42, P_32, P_52 times cos 2h, then sin 2h
  kThriceHourly = kTwiceHourly + 8,  // P_33, P_43, P_63 times cos 3h, then sin 3h
  kTwice = kThriceHourly + 6,        // P_32, P_52, P_72 times cos 2l, then sin 2l
  kNorth = kTwice + 6,               // P_1 P_n
  kNorthTwice = kNorth + 3,          // P_1^2 P_n
  kEvenNorth = kNorthTwice + 3,      // P_1 P_n1 cos l, n = 1, 3, 5
  kFunctions = kEvenNorth + 6
};

/// Rows of kUpper and kLower.
enum Upper { kExosphere, kSlope, kBase, kN2, kHe, kO, kO2, kAr, kH, kN, kHotO, kUppers };
enum Lower {
  kAt110,
  kAt100,
  kAt90,
  kAt72,
  kSlope72,
  kThermospheric,
  kAt55 = kThermospheric,
  kAt45,
  kAt32,
  kSlope32,
  kAt20,
  kAt15,
  kAt10,
  kGround,
  kSlopeGround,
  kLowers
};

inline constexpr int kRows = static_cast<int>(kUppers) + static_cast<int>(kLowers);

/// What a moment makes of the amplitudes.
struct Moment {
  double upper[kFunctions][kUppers], thermospheric[kFunctions][kThermospheric], lower[kFunctions][kLowers - kThermospheric];
  /// Magnetic activity of the last days that fades at a rate which depends on the latitude: of the exosphere and of He.
  struct Fading {
    double functions[kActive], response[6], rate, latitude;
  } fading[2];
  double history;
  double turbopause, flux;  // the part of its height that changes with the latitude; F10.7, averaged, over 150
};

/// Response to ap: linear where it is small, with a smaller slope where it is large.
inline double response(double ap, double rate, double share) {
  const double a = ap - 4.0;
  return a + (share - 1.0) * (a + std::expm1(-rate * a) / rate);
}
/// The sum of responses, of which those e^(i / 3 h) old are left.
template <class T>
T faded(const double (&g)[6], const T& e) {
  using std::sqrt;
  const T e2 = e * e, e4 = e2 * e2, e8 = e4 * e4, row = (T(1.0) - e8) / (T(1.0) - e);
  const T all = T(1.0) + (T(1.0) - e8 * e8 * e2 * e) / (T(1.0) - e) * sqrt(e);
  return (T(g[0]) + e * T(g[1]) + e2 * T(g[2]) + e2 * e * T(g[3]) + (e4 * T(g[4]) + e8 * e4 * T(g[5])) * row) / all;
}
/// What is left after 3 h at a latitude [rad].
template <class T>
T left(double rate, double by_latitude, const T& latitude) {
  using std::abs, std::exp;
  return exp(T(-10800.0 * rate) / (T(1.0) + T(by_latitude) * (T(45.0) - abs(latitude) / T(kDegree))));
}

/// Of an angle.
struct Turn {
  double cosine, sine;
  static Turn of(double angle) { return {std::cos(angle), std::sin(angle)}; }
  double cosine_from(const Turn& b) const { return cosine * b.cosine + sine * b.sine; }  ///< of the angle from b to this
};
/// Of the phases among the coefficients of a row, those of kLower behind those of kUpper.
inline const Turn (&phases(int of_row))[150] {
  struct Table {
    Turn of[kRows][150];
  };
  static const Table all = [] {
    Table out{};
    const auto fill = [](auto& to, const double* p, std::initializer_list<int> which, double rate) {
      for (const int i : which) to[i] = Turn::of(rate * p[i]);
    };
    for (int row = 0; row < kRows; ++row) {
      const bool upper = row < kUppers;
      const double* p = upper ? kUpper[row] : kLower[row - kUppers];
      fill(out.of[row], p, {13, 31}, kDay), fill(out.of[row], p, {17, 38}, 2.0 * kDay);
      if (upper)
        fill(out.of[row], p, {58, 71, 75, 79}, kSecond), fill(out.of[row], p, {63, 97, 118, 136}, kDegree),
            fill(out.of[row], p, {124, 131}, kHour);
      else
        fill(out.of[row], p, {81, 84}, kDay), fill(out.of[row], p, {86, 88}, 2.0 * kDay);
    }
    return out;
  }();
  return all.of[of_row];
}

struct Now {
  const Conditions& at;
  Turn year = Turn::of(kDay * at.day), half_year = Turn::of(2.0 * kDay * at.day), day = Turn::of(kSecond * at.seconds);
};

/// Amplitudes of one row.
class Amplitudes {
 public:
  double of[kFunctions] = {}, active[kActive] = {};

  Amplitudes(const double* p, const Turn (&phases)[150], const Now& now)
      : p_(p), phases_(phases), now_(now), at_(now.at), flux_(now.at.average - 150.0) {
    annual_ = annual(31), semiannual_ = semiannual(17), tilted_ = annual(13), semitilted_ = semiannual(38);
  }
  void upper() {
    const double* p = p_;
    const double d = at_.f107 - at_.average, F = flux_, sun = p[19] * d + p[20] * d * d;
    const double f1 = 1.0 + p[47] * F + sun, f2 = 1.0 + p[49] * F + sun;
    of[0] = p[30] + p[19] * d * (1.0 + p[59] * F) + p[20] * d * d + p[21] * F + p[29] * F * F + p[18] * annual_ + p[15] * semiannual_;
    of[1] = p[26] + f1 * p[9] * tilted_ + p[37] * semitilted_;
    of[2] = p[1] + p[14] * F + p[16] * semiannual_;
    of[3] = f1 * p[10] * tilted_;
    of[4] = p[2], of[kSixth] = p[22];
    add(kHourly, {3, 4, 27}, f2, 0.0), add(kHourly, {6, 7, 28}, 0.0, f2);
    tides(f2);
    for (int i = 1; i < 3; ++i) {  // the first stands in tides
      of[kThriceHourly + i] = f2 * tilted_ * p[i == 1 ? 94 : 48], of[kThriceHourly + 3 + i] = f2 * tilted_ * p[i == 1 ? 93 : 46];
    }
    const double along = 1.0 + p[80] * F, tilted_along = along * tilted_;
    add(kOdd, {64, 65, 66}, along, 0.0), add(kOdd, {90, 91, 92}, 0.0, along);
    add(kEven, {103, 104, 105}, along, 0.0), add(kEven, {106, 107, 108}, 0.0, along);
    add(kEven, {109, 110, 111}, tilted_along, 0.0), add(kEven, {112, 113, 114}, 0.0, tilted_along);
    const double universal = (1.0 + p[81] * F) * of_time(71), a = p[95], b = p[119] * tilted_;
    for (int i = 0; i < 3; ++i) {
      const double x = universal * p[68 + i];
      of[1 + 2 * i] += x, of[kNorth + i] += (a + b) * x, of[kNorthTwice + i] += a * b * x;
    }
    const double both = 1.0 + p[137] * F;
    const Turn &from = phases_[79], &day = now_.day;
    add(kTwice, {76, 77, 78}, both * day.cosine_from(from), both * (day.cosine * from.sine - day.sine * from.cosine));
    if (at_.history)
      activity(50, 96, 54, {125, 126, 127}, {128, 129, 130}, 131, 132, {52, 98, 67}, 97, {133, 134, 135}, 136, {55, 56, 57}, 58);
    else
      activity(32, 45, 34, {100, 101, 102}, {121, 122, 123}, 124, 120, {60, 61, 62}, 63, {115, 116, 117}, 118, {83, 84, 85}, 75);
  }
  void lower() {
    const double* p = p_;
    of[0] = p[21] * flux_ + p[18] * annual_ + p[15] * semiannual_;
    of[1] = p[26] + p[9] * tilted_ + p[37] * semitilted_;
    of[2] = p[1] + p[47] * annual_ + p[16] * semiannual_;
    of[3] = p[14] + p[10] * tilted_;
    of[4] = p[2] + p[29] * annual_ + p[30] * semiannual_;
    of[5] = p[59] + p[20] * tilted_;
    of[kSixth] = p[22];
    for (int i = 0; i < 2; ++i) of[kHourly + i] = p[3 + i], of[kHourly + 3 + i] = p[6 + i];
    tides(1.0);
    const double whole = 1.0 + p[83] * annual(84) + p[87] * semiannual(88), north = p[80] * annual(81) + p[85] * semiannual(86);
    add(kOdd, {64, 65, 66}, whole, 0.0), add(kOdd, {90, 91, 92}, 0.0, whole);
    add(kEven, {74, 75, 76}, whole, 0.0), add(kEven, {77, 78, 79}, 0.0, whole);
    add(kOddNorth, {64, 65, 66}, north, 0.0), add(kOddNorth, {90, 91, 92}, 0.0, north);
    add(kEvenNorth, {74, 75, 76}, north, 0.0), add(kEvenNorth, {77, 78, 79}, 0.0, north);
    active[0] = p[at_.history ? 50 : 32], active[2] = p[at_.history ? 96 : 45];
  }
  /// The activity stands at `level`.
  void settle(double level) {
    for (int i = 0; i < kActive; ++i) of[i] += level * active[i];
  }

 private:
  using Three = int[3];
  double annual(int phase) const { return now_.year.cosine_from(phases_[phase]); }
  double semiannual(int phase) const { return now_.half_year.cosine_from(phases_[phase]); }
  double of_time(int phase) const { return now_.day.cosine_from(phases_[phase]); }
  static void add(double* to, const double* p, const Three& rows, double cosine, double sine) {
    for (int i = 0; i < 3; ++i) to[i] += cosine * p[rows[i]], to[3 + i] += sine * p[rows[i]];
  }
  void add(int to, const Three& rows, double cosine, double sine) { add(of + to, p_, rows, cosine, sine); }
  /// What changes twice and three times a day; once, by the season.
  void tides(double f) {
    const double* p = p_;
    const double tilted = f * tilted_;
    of[kHourlySeason] = tilted * p[11], of[kHourlySeason + 1] = tilted * p[12];
    const double twice[] = {f * p[5], f * p[41], tilted * p[23], tilted * p[35], f * p[8], f * p[42], tilted * p[33], tilted * p[36]};
    for (int i = 0; i < 8; ++i) of[kTwiceHourly + i] = twice[i];
    of[kThriceHourly] = f * p[40], of[kThriceHourly + 3] = f * p[39];
  }
  void activity(int zero, int two, int four, const Three& tilted, const Three& hourly, int hour, int north, const Three& along,
                int longitude, const Three& tilted_along, int tilted_longitude, const Three& timed, int time) {
    const double* p = p_;
    const double universal = of_time(time);
    active[0] = p[zero], active[2] = p[two], active[4] = p[four];
    for (int i = 0; i < 3; ++i) active[1 + 2 * i] = tilted_ * p[tilted[i]] + universal * p[timed[i]];
    const auto shifted = [&](int to, const Three& rows, double size, int phase) {
      add(active + to, p, rows, size * phases_[phase].cosine, size * phases_[phase].sine);
    };
    shifted(kHourly, hourly, 1.0, hour);
    shifted(kOdd, along, 1.0, longitude), shifted(kOddNorth, along, p[north], longitude);
    shifted(kEven, tilted_along, tilted_, tilted_longitude);
  }

  const double* p_;
  const Turn (&phases_)[150];
  const Now& now_;
  const Conditions& at_;
  double flux_, annual_, semiannual_, tilted_, semitilted_;
};

inline void prepare(const Conditions& at, Moment& out) noexcept {
  out = {};
  out.history = at.history, out.flux = at.average - 150.0;
  const Now now{at};
  out.turbopause = 0.118339 * now.year.cosine_from(phases(kExosphere)[13]);
  /// Of the row of the thermosphere by which the model responds.
  const auto level = [&](const double* p) {
    if (!at.history) return response(at.ap[0], p[43], p[44]);
    if (p[51] == 0.0) return 0.0;
    double g[6];
    for (int i = 0; i < 6; ++i) g[i] = response(at.ap[i + 1], p[24], p[25]);
    return faded(g, left(p[51], 0.0, 0.0));
  };
  int fades = 0;
  for (int row = 0; row < kUppers; ++row) {
    const double* p = kUpper[row];
    Amplitudes a(p, phases(row), now);
    a.upper();
    if (at.history && p[138] != 0.0) {
      Moment::Fading& fading = out.fading[fades++];
      for (int i = 0; i < kActive; ++i) fading.functions[i] = a.active[i];
      for (int i = 0; i < 6; ++i) fading.response[i] = response(at.ap[i + 1], p[24], p[25]);
      fading.rate = p[51], fading.latitude = p[138];
    } else {
      a.settle(level(p));
    }
    for (int i = 0; i < kFunctions; ++i) out.upper[i][row] = a.of[i];
  }
  // The lower rows have the response of the row of the thermosphere that the model asks before them.
  const double thermospheric = level(kUpper[kBase]), lower = level(kUpper[kN]);
  for (int row = 0; row < kLowers; ++row) {
    Amplitudes a(kLower[row], phases(static_cast<int>(kUppers) + row), now);
    a.lower();
    a.settle(row < kThermospheric ? thermospheric : lower);
    for (int i = 0; i < kFunctions; ++i) (row < kThermospheric ? out.thermospheric[i][row] : out.lower[i][row - kThermospheric]) = a.of[i];
  }
}

/// Altitude, and sines and cosines of the geodetic latitude, the longitude and the local time, a day being a turn.
template <class T>
struct Place {
  T altitude, cos_latitude, sin_latitude, cos_longitude, sin_longitude, cos_hour, sin_hour;
};
inline double angle(double sine, double cosine) { return std::atan2(sine, cosine); }
inline Tangent angle(const Tangent& sine, const Tangent& cosine) {
  return {std::atan2(sine.x, cosine.x), cosine.x * sine.d - sine.x * cosine.d};
}

template <class T>
void functions(const Place<T>& at, T (&f)[kFunctions]) {
  const T c = at.sin_latitude, s = at.cos_latitude, c2 = c * c, c4 = c2 * c2, s2 = s * s, s3 = s2 * s;
  const auto n = [](double x) { return T(x); };
  T P[7], P1[7], P2[8], P3[7];
  P[0] = n(1), P[1] = c, P[2] = n(0.5) * (n(3) * c2 - n(1)), P[3] = n(0.5) * c * (n(5) * c2 - n(3));
  P[4] = (n(35) * c4 - n(30) * c2 + n(3)) / n(8), P[5] = c * (n(63) * c4 - n(70) * c2 + n(15)) / n(8);
  P[6] = (n(11) * c * P[5] - n(5) * P[4]) / n(6);
  P1[1] = s, P1[2] = n(3) * c * s, P1[3] = n(1.5) * (n(5) * c2 - n(1)) * s, P1[4] = n(2.5) * c * (n(7) * c2 - n(3)) * s;
  P1[5] = n(1.875) * (n(21) * c4 - n(14) * c2 + n(1)) * s, P1[6] = (n(11) * c * P1[5] - n(6) * P1[4]) / n(5);
  P2[2] = n(3) * s2, P2[3] = n(15) * s2 * c, P2[4] = n(7.5) * (n(7) * c2 - n(1)) * s2, P2[5] = n(3) * c * P2[4] - n(2) * P2[3];
  P2[6] = (n(11) * c * P2[5] - n(7) * P2[4]) / n(4), P2[7] = (n(13) * c * P2[6] - n(8) * P2[5]) / n(5);
  P3[3] = n(15) * s3, P3[4] = n(105) * s3 * c, P3[5] = (n(9) * c * P3[4] - n(7) * P3[3]) / n(2);
  P3[6] = (n(11) * c * P3[5] - n(8) * P3[4]) / n(3);
  const T ch = at.cos_hour, sh = at.sin_hour, c2h = ch * ch - sh * sh, s2h = n(2) * sh * ch, c3h = c2h * ch - s2h * sh,
          s3h = s2h * ch + c2h * sh, cl = at.cos_longitude, sl = at.sin_longitude, c2l = cl * cl - sl * sl, s2l = n(2) * sl * cl;
  for (int i = 0; i < 6; ++i) f[kZonal + i] = P[i];
  f[kSixth] = P[6];
  for (int i = 0; i < 3; ++i) {
    const T even = P1[1 + 2 * i], odd = P1[2 + 2 * i], twice = P2[3 + 2 * i];
    f[kHourly + i] = even * ch, f[kHourly + 3 + i] = even * sh;
    f[kEven + i] = even * cl, f[kEven + 3 + i] = even * sl;
    f[kOdd + i] = odd * cl, f[kOdd + 3 + i] = odd * sl;
    f[kTwice + i] = twice * c2l, f[kTwice + 3 + i] = twice * s2l;
    f[kNorth + i] = c * P[1 + 2 * i], f[kNorthTwice + i] = c2 * P[1 + 2 * i];
  }
  for (int i = 0; i < 6; ++i) f[kOddNorth + i] = c * f[kOdd + i], f[kEvenNorth + i] = c * f[kEven + i];
  f[kHourlySeason] = P1[2] * ch, f[kHourlySeason + 1] = P1[2] * sh;
  const T twice[] = {P2[2], P2[4], P2[3], P2[5]}, thrice[] = {P3[3], P3[4], P3[6]};
  for (int i = 0; i < 4; ++i) f[kTwiceHourly + i] = twice[i] * c2h, f[kTwiceHourly + 4 + i] = twice[i] * s2h;
  for (int i = 0; i < 3; ++i) f[kThriceHourly + i] = thrice[i] * c3h, f[kThriceHourly + 3 + i] = thrice[i] * s3h;
}

template <class T, int N>
void sum(const T (&f)[kFunctions], const double (&amplitudes)[kFunctions][N], T (&out)[N]) {
  for (T& x : out) x = T(0.0);
  for (int i = 0; i < kFunctions; ++i)
    for (int row = 0; row < N; ++row) out[row] = out[row] + f[i] * T(amplitudes[i][row]);
}

/// Of a latitude.
template <class T>
struct Gravity {
  T surface, radius;  // [cm/s^2], [km]

  explicit Gravity(const T& sin_latitude) {
    const T twice = T(1.0) - T(2.0) * sin_latitude * sin_latitude;  // the cosine of twice the latitude
    surface = T(980.616) * (T(1.0) - T(0.0026373) * twice);
    radius = T(2e-5) * surface / (T(3.085462e-6) + T(2.27e-9) * twice);
  }
  /// Over the gas constant; integrated from a height to another it is m / (R T) times `drop` for 1 T.
  T at(double z) const {
    const T r = T(1.0) + T(z) / radius;
    return surface / (T(831.4) * r * r);
  }
  /// The geopotential height of z above `from`, with the gravity there.
  T rise(const T& z, double from) const { return (z - T(from)) * (radius + T(from)) / (radius + z); }
};

/// Temperature at a height, L = log(T_b / T), and W.
template <class T>
struct Level {
  T temperature, L, W;
};

/// From one height down to another: 1/T is a cubic spline in the geopotential height, with given slopes of T [K/km] at its ends.
template <class T, int N>
class Layer {
 public:
  Layer(const Gravity<T>& g, const double (&z)[N], const T (&temperature)[N], const T& slope_above, const T& slope_below)
      : g_(g), top_(z[0]), top_temperature_(temperature[0]) {
    span_ = g.rise(T(z[N - 1]), top_);
    for (int i = 0; i < N; ++i) x_[i] = g.rise(T(z[i]), top_) / span_, y_[i] = T(1.0) / temperature[i];
    const T r = (g.radius + T(z[N - 1])) / (g.radius + T(top_));
    const T first = -slope_above * span_ * y_[0] * y_[0], last = -slope_below * span_ * r * r * y_[N - 1] * y_[N - 1];
    // Second derivatives: rows of three, eliminated from above.
    T upper[N], right[N], step = x_[1] - x_[0], slope = (y_[1] - y_[0]) / step;
    upper[0] = T(0.5), right[0] = T(3.0) / step * (slope - first);
    for (int i = 1; i < N; ++i) {
      const bool end = i == N - 1;
      const T next = end ? T(0.0) : x_[i + 1] - x_[i], next_slope = end ? last : (y_[i + 1] - y_[i]) / next;
      const T pivot = T(1.0) / (T(2.0) * (step + next) - step * upper[i - 1]);
      upper[i] = next * pivot, right[i] = (T(6.0) * (next_slope - slope) - step * right[i - 1]) * pivot;
      step = next, slope = next_slope;
    }
    second_[N - 1] = right[N - 1];
    for (int i = N - 2; i >= 0; --i) second_[i] = right[i] - upper[i] * second_[i + 1];
  }

  /// Against its top.
  Level<T> at(const T& z) const {
    using std::log;
    const T x = g_.rise(z, top_) / span_;
    T integral(0.0);
    for (int i = 0;; ++i) {
      const T h = x_[i + 1] - x_[i];
      const bool here = i == N - 2 || x < x_[i + 1];
      const T b = here ? (x - x_[i]) / h : T(1.0), a = T(1.0) - b, a2 = a * a, b2 = b * b, h2 = h * h / T(12.0);
      const T from = T(0.5) * (T(1.0) - a2), to = T(0.5) * b2;
      integral = integral + h * (from * y_[i] + to * y_[i + 1] -
                                 h2 * ((T(0.5) * (T(1.0) + a2 * a2) - a2) * second_[i] + to * (T(2.0) - b2) * second_[i + 1]));
      if (!here) continue;
      const T y = a * y_[i] + b * y_[i + 1] + T(2.0) * h2 * (a * (a2 - T(1.0)) * second_[i] + b * (b2 - T(1.0)) * second_[i + 1]);
      return {T(1.0) / y, log(top_temperature_ * y), -g_.at(top_) * span_ * integral};
    }
  }

 private:
  Gravity<T> g_;
  double top_;
  T top_temperature_, span_, x_[N], y_[N], second_[N];
};

/// The temperature of Bates, T_e - (T_e - T_b) exp(-s h), h the geopotential height above 120 km.
template <class T>
struct Bates {
  static constexpr double kBase = 120.0, kJoint = 123.435;  // [km]; the layer stands below the latter
  Gravity<T> g;
  T exosphere, base, s;

  Level<T> at(const T& z) const {
    using std::exp, std::log;
    const T h = g.rise(z, kBase), temperature = exosphere - (exosphere - base) * exp(-s * h), L = log(base / temperature);
    return {temperature, L, g.at(kBase) / exosphere * (L / s - h)};
  }
};

/// Bates above, a layer below.
template <class T>
class Thermosphere {
 public:
  Thermosphere(const Bates<T>& bates, const T (&nodes)[4], const T& slope_below)
      : bates_(bates), joint_(bates.at(T(Bates<T>::kJoint))), layer_(below(nodes, slope_below)) {}
  Level<T> at(const T& z) const {
    if (!(z < T(Bates<T>::kJoint))) return bates_.at(z);
    const Level<T> in = layer_.at(z);
    return {in.temperature, joint_.L + in.L, joint_.W + in.W};
  }

 private:
  Layer<T, 5> below(const T (&nodes)[4], const T& slope_below) const {
    const T all[] = {joint_.temperature, nodes[0], nodes[1], nodes[2], nodes[3]};
    const T r = (bates_.g.radius + T(Bates<T>::kBase)) / (bates_.g.radius + T(Bates<T>::kJoint));
    return {bates_.g,
            {Bates<T>::kJoint, 110.0, 100.0, 90.0, 72.5},
            all,
            (bates_.exosphere - joint_.temperature) * bates_.s * r * r,
            slope_below};
  }
  Bates<T> bates_;
  Level<T> joint_;
  Layer<T, 5> layer_;
};

/// log n where species part: `apart` in diffusive equilibrium and `mixed`, by masses.
template <class T>
T parting(const T& apart, const T& mixed, double mass) {
  using std::exp, std::log;
  const double a = 28.0 / (28.95 - mass);
  const T x = T(a) * (mixed - apart);
  if (x < T(-10.0)) return apart;
  if (x > T(10.0)) return mixed;
  return apart + log(T(1.0) + exp(x)) / T(a);
}

/// log n is corrected by `strength` below a height, over a scale.
struct Correction {
  double height, scale, other_scale;
  template <class T>
  T at(const T& z, const T& strength) const {
    using std::exp;
    const T e = z - T(height);
    const T first = exp(e / T(scale)), step = other_scale == scale ? first : T(0.5) * (first + exp(e / T(other_scale)));
    return strength / (T(1.0) + step);
  }
};

struct Species {
  Upper row;
  double mass, thermal, density;  // [g/mol]; exponent alpha of thermal diffusion; at 120 km, times the first of its row
  int turbopause;                 // 0: 105 km, 1: 100 km, 2: 95 km
  double top, ratio;              // below which it mixes [km]; to N2 near the ground, 0: none
  Correction mixing;
  double chemistry;  // 0: none
  Correction chemical;
};
inline constexpr Species kSpecies[] = {
    {kHe, 4.0, -0.38, 2.456e7, 1, 200.0, 6.71072e-6, {110.0, 7.0, 7.0}, 0.0, {}},
    {kO, 16.0, 0.0, 8.594e10, 0, 300.0, 0.0, {110.0 * 1.1502, 34.4689, 12.884}, -8.0 * 4.47749, {90.0 * 0.795046, 8.03224, 8.03224}},
    {kO2, 32.0, 0.0, 3.3e10, 0, 250.0, 0.26827, {110.0 * 1.08738, 12.2947, 12.2947}, 0.0, {}},
    {kAr, 40.0, 0.17, 1.33e9, 0, 240.0, 0.0119615, {110.0 * 1.10016, 7.34129, 7.34129}, 0.0, {}},
    {kH,
     1.0,
     -0.38,
     1.761e5,
     2,
     320.0,
     1.68986e-6,
     {110.0 * 1.15241, 22.2784, 22.2784},
     -8.0 * 172.783,
     {90.0 * 0.744294, 2.07208, 2.07208}},
    {kN, 14.0, 0.0, 1e7, 0, 450.0, 3.07165, {110.0 * 1.0993, 39.0631, 39.0631}, -8.0 * 4.6383, {90.0 * 0.986161, 32.7072, 32.7072}}};
inline constexpr double kMixed = 28.95;  // [g/mol]

/// Numbers [1/cm^3] of He, O, N2, O2, Ar, H, N and anomalous oxygen, temperatures [K].
template <class T>
struct Air {
  static constexpr double kMasses[] = {4.0, 16.0, 28.0, 32.0, 40.0, 1.0, 14.0, 16.0};
  T number[8], exosphere, temperature;
  /// [g/cm^3], of the first so many.
  T density(int species = 8) const {
    T all(0.0);
    for (int i = 0; i < species; ++i) all = all + T(1.66e-24 * kMasses[i]) * number[i];
    return all;
  }
};

template <class T>
Air<T> air(const Moment& moment, const Place<T>& at) noexcept {
  using std::exp, std::log;
  constexpr double kMesosphere = 72.5, kMixing = 62.5, kStratosphere = 32.5;  // [km]
  constexpr double kExosphereMean = 1041.3 * kUpper[kExosphere][0], kSlopeMean = 16.6728 * kUpper[kSlope][0];
  T f[kFunctions], G[kUppers], low[kThermospheric];
  functions(at, f);
  sum(f, moment.upper, G);
  for (const Upper row : {kExosphere, kHe}) {
    if (moment.history == 0.0) break;
    const Moment::Fading& fading = moment.fading[row == kHe];
    T active(0.0);
    for (int i = 0; i < kActive; ++i) active = active + f[i] * T(fading.functions[i]);
    G[row] = G[row] + active * faded(fading.response, left(fading.rate, fading.latitude, angle(at.sin_latitude, at.cos_latitude)));
  }
  const bool below = at.altitude < T(kMesosphere);
  const T z = below ? T(kMesosphere) : at.altitude;
  // Heights below which the model leaves these out.
  if (!(z > T(Bates<T>::kJoint))) G[kExosphere] = T(0.0);
  if (!(z > T(kMesosphere))) G[kSlope] = T(0.0);
  if (z < T(300.0))
    sum(f, moment.thermospheric, low);
  else
    for (T& x : low) x = T(0.0);

  const Gravity<T> g(at.sin_latitude);
  const T exosphere = T(kExosphereMean) * (T(1.0) + G[kExosphere]), base = T(386.0 * kUpper[kBase][0]) * (T(1.0) + G[kBase]);
  const Bates<T> bates{g, exosphere, base, T(kSlopeMean) * (T(1.0) + G[kSlope]) / (exosphere - base)};
  constexpr double kNodes[] = {240.0, 195.0, 187.0, 213.0};
  T nodes[4];
  for (int i = 0; i < 4; ++i) nodes[i] = T(kNodes[i] * kLower[i][0]) / (T(1.0) - low[i]);
  /// A slope whose ratio to the square of the temperature is given.
  const auto slope_at = [](double mean, const T& variation, const T& temperature, double mean_temperature) {
    const T ratio = temperature / T(mean_temperature);
    return T(mean) * (T(1.0) + variation) * ratio * ratio;
  };
  const T slope_below = slope_at(-2.0 * kLower[kSlope72][0], low[kSlope72], nodes[3], kNodes[3] * kLower[kAt72][0]);
  const Thermosphere<T> thermosphere(bates, nodes, slope_below);

  Air<T> out;
  out.exosphere = exosphere;
  const Level<T> here = thermosphere.at(z), pauses[] = {thermosphere.at(T(105.0)), thermosphere.at(T(100.0)), thermosphere.at(T(95.0))};
  out.temperature = here.temperature;
  // A species of density n_b at 120 km; mixed from its turbopause on.
  const auto apart = [&](const T& base_log, double mass, double thermal) {
    return base_log + T(1.0 + thermal) * here.L + T(mass) * here.W;
  };
  const auto at_pause = [](const T& base_log, double mass, double thermal, const Level<T>& pause) {
    return base_log + T(thermal) * pause.L + T(mass - kMixed) * pause.W;
  };
  const auto mixed = [&](const T& b) { return b + here.L + T(kMixed) * here.W; };

  T base_log = T(std::log(2.81e11 * kUpper[kN2][0])) + G[kN2], log_n = apart(base_log, 28.0, 0.0);
  const T pause = T(105.0 * 0.949154) * (T(1.0) + T(moment.turbopause) * at.sin_latitude);
  const T b_N2 = at_pause(base_log, 28.0, 0.0, thermosphere.at(pause)), mixed_N2 = mixed(b_N2);
  if (!(z > T(160.0))) log_n = parting(log_n, mixed_N2, 28.0);
  out.number[2] = exp(log_n);
  constexpr int kTo[] = {0, 1, 3, 4, 5, 6};
  for (int i = 0; i < 6; ++i) {
    const Species& s = kSpecies[i];
    base_log = T(std::log(s.density * kUpper[s.row][0])) + G[s.row];
    log_n = apart(base_log, s.mass, s.thermal);
    const T sunlit(1.0 + 0.0310302 * moment.flux);
    if (!(z > T(s.top))) {
      const T b = at_pause(base_log, s.mass, s.thermal, pauses[s.turbopause]);
      log_n = parting(log_n, mixed(b), s.mass);
      log_n = log_n + s.mixing.at(z, s.ratio == 0.0 ? T(-0.0760535) * sunlit : b_N2 - b + T(std::log(s.ratio)));
      if (s.chemistry != 0.0) log_n = log_n + s.chemical.at(z, T(s.chemistry));
    }
    if (s.row == kO2) log_n = log_n + Correction{110.0 * 1.1502, -34.4689, -12.884}.at(z, T(-0.74623) * sunlit);
    out.number[kTo[i]] = exp(log_n);
  }
  const Bates<T> hot{g, T(4000.0), T(4000.0), bates.s};
  const Level<T> there = z < T(Bates<T>::kJoint) ? Thermosphere<T>(hot, nodes, slope_below).at(z) : hot.at(z);
  const T scale = T(4000.0 / 16.0) / g.at(550.0);
  out.number[7] = exp(T(std::log(1e6 * kUpper[kHotO][0])) + G[kHotO] + there.L + T(16.0) * there.W -
                      T(76.0) / scale * (exp(-(z - T(550.0)) / T(76.0)) - T(1.0)));
  if (!below) return out;

  // Mesosphere, stratosphere and troposphere: mixed as at 62.5 km, from 72.5 km on linearly.
  T lower[kLowers - kThermospheric];
  sum(f, moment.lower, lower);
  const auto variation = [&](int row) { return lower[row - kThermospheric]; };
  const auto node = [&](double mean, int row) { return T(mean * kLower[row][0]) / (T(1.0) - variation(row)); };
  const T middle[] = {nodes[3], node(261.0, kAt55), node(264.0, kAt45), node(229.0, kAt32)};
  const T slope32 = slope_at(2.5 * kLower[kSlope32][0], variation(kSlope32), middle[3], 229.0 * kLower[kAt32][0]);
  const Layer<T, 4> mesosphere(g, {kMesosphere, 55.0, 45.0, kStratosphere}, middle, slope_below, slope32);
  const bool low_down = !(at.altitude > T(kStratosphere));
  Level<T> level = mesosphere.at(low_down ? T(kStratosphere) : at.altitude);
  if (low_down) {
    const T near[] = {middle[3], node(217.0, kAt20), node(217.0, kAt15), node(223.0, kAt10), node(286.76, kGround)};
    const T slope = slope_at(-2.9394 * kLower[kSlopeGround][0], variation(kSlopeGround), near[4], 286.76 * kLower[kGround][0]);
    const Level<T> in = Layer<T, 5>(g, {kStratosphere, 20.0, 15.0, 10.0, 0.0}, near, slope32, slope).at(at.altitude);
    level = {in.temperature, level.L + in.L, level.W + in.W};
  }
  out.temperature = level.temperature;
  const T share = at.altitude > T(kMixing) ? T(1.0) - (T(kMesosphere) - at.altitude) / T(kMesosphere - kMixing) : T(0.0);
  const T n72 = out.number[2], n = exp(mixed_N2 + level.L + T(kMixed) * level.W);
  const auto blend = [&](const T& ratio_above, double ratio) { return T(ratio) * (T(1.0) + share * (ratio_above / T(ratio) - T(1.0))); };
  out.number[2] = n * blend(n72 / exp(mixed_N2), 1.0);
  for (const auto& [i, ratio] : {std::pair(0, 6.71072e-6), std::pair(3, 0.26827), std::pair(4, 0.0119615)})
    out.number[i] = out.number[2] * blend(out.number[i] / n72, ratio);
  for (const int i : {1, 5, 6, 7}) out.number[i] = T(0.0);
  return out;
}

}  // namespace msis
}  // namespace cardan
