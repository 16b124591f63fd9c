// nrlmsise00: density of the air by NRLMSISE-00, plugins/fields/nrlmsise00.hpp, over the ellipsoid of WGS 84: all species, with the
// anomalous oxygen, as it is meant for drag.
#include "plugins/fields/nrlmsise00.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdint>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "plugins/fields/geodetic.hpp"
#include "plugins/fields/planet.hpp"
#include "plugins/fields/upper_air.hpp"

namespace cardan {
namespace {

using std::chrono::days, std::chrono::sys_days;
constexpr sys_days kDayZero = sys_days(std::chrono::year(2000) / 1 / 1);

/// What the Sun and the Earth's field did on a day.
struct Weather {
  double f107, average, ap_day, ap[8];  // observed [1e-22 W/(m^2 Hz)], over 81 days about the day; of the day, of three hours each
};

/// Of days one after the other.
struct WeatherFile {
  std::int64_t first = 0;  // days from kDayZero
  std::vector<Weather> rows;

  /// Null: it is none, and `params` was told so.
  static std::optional<WeatherFile> read(const Params& params) {
    constexpr std::string_view kNames[] = {"year", "month", "day", "f107_obs", "f107_obs_c81", "ap_avg", "ap1",
                                           "ap2",  "ap3",   "ap4", "ap5",      "ap6",          "ap7",    "ap8"};
    constexpr std::size_t kCount = std::size(kNames), kNone = std::string_view::npos;
    std::size_t place[kCount] = {};
    WeatherFile out;
    const auto refuse = [&](const char* expected, const std::string& got, const char* hint = nullptr) {
      params.fail("weather", expected, got.c_str(), hint);
      return std::nullopt;
    };
    int number = 0;
    bool named = false;
    std::string_view all = params.bytes("weather");
    if (all.starts_with("\xEF\xBB\xBF")) all.remove_prefix(3);
    while (!all.empty()) {
      const std::size_t end = std::min(all.find('\n'), all.size());
      std::string_view line = all.substr(0, all.substr(0, end).find('#'));
      line = line.substr(0, std::min(line.size(), end));
      all.remove_prefix(std::min(end + 1, all.size()));
      ++number;
      std::vector<std::string_view> fields;
      for (std::size_t from = 0; from <= line.size();) {
        const std::size_t to = std::min(line.find(',', from), line.size());
        const std::string_view field = line.substr(from, to - from);
        const std::size_t begin = field.find_first_not_of(" \t\r");
        fields.push_back(begin == kNone ? "" : field.substr(begin, field.find_last_not_of(" \t\r") + 1 - begin));
        from = to + 1;
      }
      if (fields.size() == 1 && fields[0].empty()) continue;
      const std::string where = "line " + std::to_string(number);
      if (!std::exchange(named, true)) {
        for (std::size_t i = 0; i < kCount; ++i) {
          place[i] = static_cast<std::size_t>(std::ranges::find(fields, kNames[i]) - fields.begin());
          if (place[i] == fields.size())
            return refuse("a CSV file whose first line names the columns year, month, day, ap1 to ap8, ap_avg, f107_obs, f107_obs_c81",
                          "no column " + std::string(kNames[i]));
        }
        continue;
      }
      double x[kCount];
      for (std::size_t i = 0; i < kCount; ++i) {
        const std::string_view text = place[i] < fields.size() ? fields[place[i]] : "";
        const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), x[i]);
        if (error != std::errc() || rest != text.data() + text.size())
          return refuse("a number in each column that is read",
                        "\"" + std::string(text) + "\" for " + std::string(kNames[i]) + " in " + where);
        const bool fits = i < 3 ? x[i] >= 1.0 && x[i] <= 9999.0 : i < 5 ? x[i] > 0.0 && x[i] <= 1000.0 : x[i] >= 0.0 && x[i] <= 400.0;
        if (!fits)
          return refuse("F10.7 above 0 and to 1000, ap from 0 to 400",
                        std::string(text) + " for " + std::string(kNames[i]) + " in " + where,
                        "leave out days of which there are no values");
      }
      const std::chrono::year_month_day date(std::chrono::year(static_cast<int>(x[0])), std::chrono::month(static_cast<unsigned>(x[1])),
                                             std::chrono::day(static_cast<unsigned>(x[2])));
      const std::int64_t day = (sys_days(date) - kDayZero).count();
      if (!date.ok() || (!out.rows.empty() && day != out.first + static_cast<std::int64_t>(out.rows.size())))
        return refuse("days one after the other, each once", std::string(line.substr(0, 40)) + " in " + where);
      if (out.rows.empty()) out.first = day;
      out.rows.push_back({x[3], x[4], x[5], {x[6], x[7], x[8], x[9], x[10], x[11], x[12], x[13]}});
    }
    if (out.rows.size() < 4) return refuse("days one after the other, at least four", std::to_string(out.rows.size()) + " days");
    return out;
  }
};

/// False where the model fails: 1/T passes zero for extreme F10.7 and ap.
bool is_air(const msis::Air<double>& air) {
  const double density = air.density();
  return air.temperature > 0.0 && air.temperature < 4000.0 && density > 0.0 && std::isfinite(density);
}

struct Nrlmsise00 {
  static constexpr const char* type = "nrlmsise00";
  static constexpr const char* summary =
      "density of the Earth's air to 1000 km by NRLMSISE-00, which follows the Sun and the magnetic activity";
  static constexpr std::uint32_t quantity = CARDAN_DENSITY;
  static constexpr unsigned facts = 0u;
  static constexpr double distance = 6.7e6;                                      // [m] of the laws
  static constexpr double kRadius = 6378137.0, kFlattening = 1 / 298.257223563;  // of WGS 84
  static constexpr double kDay = 86400.0;                                        // [s]
  static constexpr double kMostFlux = 400.0;                                     // F10.7 of no day without a flare was larger
  static constexpr double kQuiet = 4.0;                                          // ap
  static constexpr double kHighest = 1000e3;                                     // [m]
  static constexpr const char* activities[] = {"daily", "history"};
  static constexpr cardan_param_desc schema[] = {
      param::optional("epoch", CARDAN_TEXT, "1", "date of t = 0, 2026-11-26T12:00:00 UTC (or UT1, TT, TAI); or `day`"),
      param::in_range(param::optional("day", CARDAN_NUMBER, "1",
                                      "of the year at t = 0, from 1, the time of the day (UT) as its fraction: in place of `epoch`, with "
                                      "longitude 0 along `meridian`"),
                      0.0, 367.0, CARDAN_BELOW),
      param::in_range(
          param::optional("f107", CARDAN_NUMBER, "1", "flux F10.7 of the Sun, of the day before [1e-22 W/(m^2 Hz)]; or `weather`"), 0.0,
          kMostFlux),
      param::in_range(param::optional("f107_average", CARDAN_NUMBER, "1", "F10.7 over 81 days; 0: as `f107`"), 0.0, kMostFlux),
      param::in_range(param::optional("ap", CARDAN_NUMBER, "1", "magnetic activity; the default is that of quiet days", kQuiet), 0.0,
                      400.0),
      param::optional("weather", CARDAN_FILE, "1",
                      "CSV file of days: columns year, month, day, ap1 to ap8, ap_avg, f107_obs, f107_obs_c81; in place of constants"),
      param::named(param::optional("activity", CARDAN_CHOICE, "1", "ap of the day, or of 3 h and the 57 h before"), activities),
      param::optional("rate", CARDAN_NUMBER, "rad/s", "of the planet about its axis; the default is Earth's", 7.292115e-5),
      TurningPlanet::axis_desc,
      TurningPlanet::meridian_desc,
      TurningPlanet::dut1_desc,
      TurningPlanet::orientation_desc,
      TurningPlanet::pole_x_desc,
      TurningPlanet::pole_y_desc,
      TurningPlanet::bulletin_desc,
      TurningPlanet::centre_desc};
  static constexpr cardan_limit_desc limits[] = {
      {"lowest", 1, "below the ellipsoid"},
      {"highest", 1, "1000 km above the ellipsoid"},
      {"before", 1, "before the second day of `weather`, with `activity: history` the fourth"},
      {"after", 1, "after the last day of `weather`"},
      {"model", 0, "F10.7 above 400, a flare that day, or F10.7 and ap for which the model has no temperature from 0 to 4000 K"},
      TurningPlanet::bulletin_limit};
  struct Packed {
    TurningPlanet planet;
    double seconds;                     // of the day at t = 0
    std::int64_t day, history;          // from kDayZero
    Weather constant;                   // without days of a file:
    std::int64_t first_weather, count;  // they stand behind it
    const Weather* weather() const { return reinterpret_cast<const Weather*>(this + 1); }
  };
  struct Prepared {
    PlanetAxes axes;
    double cosine, sine;  // of the local time at longitude 0
    double extreme;       // F10.7 or ap for which the model may fail: in 3 million trials it never did for others
    msis::Moment moment;
  };

  static std::uint64_t packed_size(const Params& params) {
    if (params.bytes("weather").empty()) return sizeof(Packed);
    const auto file = WeatherFile::read(params);
    return sizeof(Packed) + (file ? file->rows.size() * sizeof(Weather) : 0);
  }
  static bool pack(const Params& params, Packed& p) {
    if (!p.planet.pack(params)) return false;
    if (p.planet.orientation > TurningPlanet::iau2006)
      return params.fail("orientation", "mean or iau2006: it is the air of the Earth", TurningPlanet::kOrientations[p.planet.orientation]);
    const double day = params.number("day"), f107 = params.number("f107"), average = params.number("f107_average"),
                 ap = params.number("ap");
    if (params.text("epoch")) {
      if (day != 0.0) return params.fail("day", "no day beside `epoch`");
      const Days& since = p.planet.epoch.ut1;
      p.day = std::llround(since.whole + 0.5), p.seconds = kDay * since.part;
    } else if (day >= 1.0) {
      const std::int64_t in_2001 = static_cast<std::int64_t>(day) - 1;  // a year of 365 days
      p.day = 366 + in_2001, p.seconds = kDay * (day - std::floor(day));
    } else if (day != 0.0) {
      return params.fail("day", "a day of the year, 1 to 366");
    } else {
      return params.fail("epoch", "the date of t = 0, 2026-11-26T12:00:00 UTC: the air follows the seasons and the Sun", "no such key",
                         "`day` in its place takes a day of any year, 172.5 for noon of June 21");
    }
    p.history = params.choice("activity");
    p.constant = {f107, average == 0.0 ? f107 : average, ap, {ap, ap, ap, ap, ap, ap, ap, ap}};
    p.first_weather = p.count = 0;
    if (!params.text("weather")) {
      if (!(f107 > 0.0))
        return params.fail("f107", "the flux F10.7 of the Sun, some 70 where it is quiet, 150 on the mean, 250 where it is active",
                           "neither it nor `weather`", "`weather` takes it, its mean and ap from a file of days");
      return true;
    }
    for (const auto& [constant, absent] : {std::pair("f107", 0.0), std::pair("f107_average", 0.0), std::pair("ap", kQuiet)})
      if (params.number(constant) != absent) return params.fail(constant, "no constants beside `weather`");
    if (!params.text("epoch")) return params.fail("epoch", "the date of t = 0: `weather` has dates", "no such key");
    const auto file = WeatherFile::read(params);
    if (!file) return false;
    p.first_weather = file->first, p.count = static_cast<std::int64_t>(file->rows.size());
    std::uninitialized_copy(file->rows.begin(), file->rows.end(), reinterpret_cast<Weather*>(&p + 1));
    return true;
  }

  static int prepare(const Packed& p, double t, Prepared& out) noexcept {
    const double since = p.seconds + t, whole = std::floor(std::clamp(since / kDay, -1e6, 1e6));
    const std::int64_t day = p.day + static_cast<std::int64_t>(whole);
    const sys_days date = kDayZero + days(day);
    const sys_days new_year = sys_days(std::chrono::year_month_day(date).year() / 1 / 1);
    msis::Conditions now{
        static_cast<int>((date - new_year).count()) + 1, since - whole * kDay, p.constant.f107, p.constant.average, {}, p.history != 0};
    std::ranges::fill(now.ap, p.constant.ap_day);
    int beyond = 0;
    if (p.count > 0) {
      const std::int64_t first = now.history ? 3 : 1, last = p.count - 1, asked = day - p.first_weather;
      beyond = asked < first ? 4 : asked > last ? 8 : 0;
      const std::int64_t row = std::clamp(asked, first, last);
      const std::int64_t part = asked < first  ? 0
                                : asked > last ? 7
                                               : std::min<std::int64_t>(static_cast<std::int64_t>(now.seconds / 10800.0), 7);
      const Weather* of = p.weather();
      now.f107 = of[row - 1].f107, now.average = of[row].average, now.ap[0] = of[row].ap_day;
      const auto ago = [&](std::int64_t parts) {
        const std::int64_t i = 8 * row + part - parts;
        return of[i / 8].ap[i % 8];
      };
      const auto mean = [&](std::int64_t from) {
        double sum = 0.0;
        for (std::int64_t i = from; i < from + 8; ++i) sum += ago(i);
        return sum / 8.0;
      };
      if (now.history) {
        for (int i = 0; i < 4; ++i) now.ap[1 + i] = ago(i);
        now.ap[5] = mean(4), now.ap[6] = mean(12);
      }
    }
    out.axes = PlanetAxes::at(p.planet, t);
    const double hour = 2.0 * std::numbers::pi * now.seconds / kDay;
    out.cosine = std::cos(hour), out.sine = std::sin(hour);
    const auto [least, most] = std::minmax(now.f107, now.average);
    out.extreme = least < 60.0 || most > 300.0 || now.average > 250.0 || std::ranges::max(now.ap) > 100.0;
    if (now.f107 > kMostFlux) beyond |= 16;
    if (!p.planet.is_known(t)) beyond |= 32;
    msis::prepare(now, out.moment);
    return beyond;
  }

  /// Out of the axis, east of the meridian, along the axis.
  template <class T>
  static Vec3<T> from_centre(const Packed& p, const FieldPoint<Nrlmsise00, T>& at) noexcept {
    const double *c = p.planet.centre, *R = at.prepared->axes.columns;
    const Vec3<T> d = at.x - Vec3<T>{T(c[0]), T(c[1]), T(c[2])};
    const auto along = [&](const double* a) { return T(a[0]) * d.x + T(a[1]) * d.y + T(a[2]) * d.z; };
    return {along(R), along(R + 3), along(R + 6)};
  }
  template <class T>
  static Geodetic<T> place(const Vec3<T>& d) noexcept {
    using std::sqrt;
    return Geodetic<T>::of(sqrt(d.x * d.x + d.y * d.y), d.z, kRadius, kFlattening);
  }
  static int beyond(const Packed& p, const FieldPoint<Nrlmsise00, double>& at) noexcept {
    const double h = place(from_centre(p, at)).height;
    const bool fails = at.prepared->extreme != 0.0 && !is_air(asked(p, at));
    return (h < 0.0 ? 1 : 0) | (h > kHighest ? 2 : 0) | (fails ? 16 : 0);
  }
  template <class T>
  static msis::Air<T> asked(const Packed& p, const FieldPoint<Nrlmsise00, T>& at) noexcept {
    using std::sqrt;
    Vec3<T> d = from_centre(p, at);
    if (!(d.x * d.x + d.y * d.y > T(0.0))) d.x = d.x + T(1e-3);  // at a pole longitudes are none, a millimetre beside it they are
    const Geodetic<T> on = place(d);
    T h = on.height;
    if (h < T(0.0)) h = T(0.0);
    if (h > T(kHighest)) h = T(kHighest);
    const T out = sqrt(d.x * d.x + d.y * d.y);
    const T cosine = d.x / out, sine = d.y / out, c(at.prepared->cosine), s(at.prepared->sine);
    const msis::Place<T> there{T(1e-3) * h, on.cosine, on.sine, cosine, sine, c * cosine - s * sine, s * cosine + c * sine};
    return msis::air(at.prepared->moment, there);
  }
  template <class T>
  static void evaluate(const Packed& p, const FieldPoint<Nrlmsise00, T>& at, T* density) noexcept {
    density[0] = T(1e3) * asked(p, at).density();
  }
};

}  // namespace

UpperAir upper_air(const UpperAirAsked& asked) {
  msis::Conditions now{asked.day, asked.seconds, asked.f107, asked.f107_average, {}, asked.history};
  std::ranges::copy(asked.ap, now.ap);
  msis::Moment moment;
  msis::prepare(now, moment);
  const double N = asked.latitude, E = asked.longitude, h = 2.0 * std::numbers::pi * asked.solar_time / Nrlmsise00::kDay;
  const auto got = msis::air(
      moment, msis::Place<double>{1e-3 * asked.altitude, std::cos(N), std::sin(N), std::cos(E), std::sin(E), std::cos(h), std::sin(h)});
  UpperAir out{{}, 1e3 * got.density(7), 1e3 * got.density(), got.temperature, got.exosphere, is_air(got)};
  for (std::size_t i = 0; i < 8; ++i) out.number[i] = 1e6 * got.number[i];
  return out;
}

const cardan_field_family& nrlmsise00_family() { return field_table<Nrlmsise00>(); }
}  // namespace cardan
