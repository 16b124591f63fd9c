// vibration, recorded_load: force and moment at a node as functions of time: a sum of tones, and rows of a record with a curve between
// them.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "plugins/devices/rows.hpp"

namespace cardan {
namespace {

constexpr cardan_mount_desc kPushed[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_LOAD, "the node that is pushed; loads in its axes"}};

template <class T>
void give_six(const double (&x)[6], DeviceOut<T>& out) noexcept {
  give_wrench(Vec3<T>{T(x[0]), T(x[1]), T(x[2])}, Vec3<T>{T(x[3]), T(x[4]), T(x[5])}, out);
}

struct Vibration {
  static constexpr const char* type = "vibration";
  static constexpr const char* summary = "tones at a node: cryocoolers, pumps, shakers";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_FORCE;
  static constexpr int row_size = 8;
  struct Packed {
    PackedRows rows;
  };
  static constexpr const char* columns[] = {"frequency", "phase", "force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z"};
  static constexpr const char* units[] = {"Hz", "rad", "N", "N", "N", "N m", "N m", "N m"};
  static constexpr cardan_param_desc schema[] = {[] {
    cardan_param_desc table =
        param::named(param::required("tones", CARDAN_TABLE, "1", "amplitude times sin(2 pi frequency t + phase), node axes"), columns);
    table.units = units;
    return table;
  }()};
  static constexpr const auto& mounts = kPushed;
  static constexpr const auto& ports = kWrenchPorts<0>;

  static std::uint64_t rows(const Params& params) { return static_cast<std::uint64_t>(params.table("tones", row_size).cols()); }
  static bool pack(const Params& params, Packed&, double* row) {
    const auto table = params.table("tones", row_size);
    if (table.cols() == 0) return params.fail("tones", "at least one row");
    for (Eigen::Index k = 0; k < table.cols(); ++k)
      if (table(0, k) < 0.0) return params.fail("tones", "frequencies of at least 0");
    std::copy_n(table.data(), table.size(), row);
    return true;
  }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    double sum[6] = {};
    const double* row = rows_of<Vibration>(p);
    for (std::int64_t k = 0; k < p.rows.n; ++k, row += row_size) {
      const double s = std::sin(2.0 * std::numbers::pi * row[0] * in.t + row[1]);
      for (int i = 0; i < 6; ++i) sum[i] += row[2 + i] * s;
    }
    give_six(sum, out);
  }
};

/// Each row is an instant at which a step ends, so that no step passes one unseen and within a step the load is a polynomial.
struct RecordedLoad {
  static constexpr const char* type = "recorded_load";
  static constexpr const char* summary = "force and moment at a node by a record of them";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_FORCE;
  static constexpr int row_size = 13;         // time, six loads, their slopes
  static constexpr double kMostTurns = 1e12;  // beyond, its phase has lost four digits of sixteen and more
  enum Between { kCubic, kLinear, kSteps };
  enum Outside { kZero, kHold, kRepeat };
  struct Packed {
    PackedRows rows;
    std::int64_t between, outside;
    double start;  // rows keep the times of the record: added to them it would round each row by itself, and so the period
    const double* row(std::int64_t i) const noexcept { return rows_of<RecordedLoad>(*this) + row_size * i; }
    double period() const noexcept { return row(rows.n - 1)[0] - row(0)[0]; }
    /// The time of a row in the record, of one that repeats of any whole number.
    double time(std::int64_t k) const noexcept {
      if (outside != kRepeat) return row(k)[0];
      const auto [turn, i] = place(k);
      return row(i)[0] + static_cast<double>(turn) * period();
    }
    struct Place {
      std::int64_t turn, row;
    };
    Place place(std::int64_t k) const noexcept {
      const std::int64_t m = rows.n - 1, turn = k >= 0 ? k / m : -((m - 1 - k) / m);
      return {turn, k - turn * m};
    }
  };
  static constexpr const char* columns[] = {"time", "force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z"};
  static constexpr const char* units[] = {"s", "N", "N", "N", "N m", "N m", "N m"};
  static constexpr const char* betweens[] = {"cubic", "linear", "steps"};
  static constexpr const char* outsides[] = {"zero", "hold", "repeat"};
  static constexpr cardan_param_desc schema[] = {
      [] {
        cardan_param_desc table =
            param::named(param::required("record", CARDAN_TABLE, "1", "times, which increase, and loads, node axes"), columns);
        table.units = units;
        return table;
      }(),
      param::named(
          param::optional("between", CARDAN_CHOICE, "", "its rows: a cubic with slopes by five rows, a line, or the last row held"),
          betweens),
      param::named(param::optional("outside", CARDAN_CHOICE, "", "of its times: no load, its first or last row, or again and again"),
                   outsides),
      param::optional("start", CARDAN_NUMBER, "s", "time of the run at the time 0 of the record")};
  static constexpr const auto& mounts = kPushed;
  static constexpr const auto& ports = kWrenchPorts<0>;
  static constexpr cardan_state_desc marks[] = {{"row", "1", 0.0, 1.0, "the last one before now"},
                                                {"told", "1", 0.0, 1.0, "1: it is known, from the start of the run on"}};
  static constexpr std::uint32_t n_roots = 1;

  static std::uint64_t rows(const Params& params) { return static_cast<std::uint64_t>(params.table("record", 7).cols()); }

  /// Slopes of the polynomial of fourth order through the five rows about row i, at the ends the last five. A record that repeats has as
  /// many rows on either side as are asked for.
  static void find_slopes(const Packed& p, double* all, std::int64_t i) {
    const bool repeats = p.outside == kRepeat;
    const std::int64_t count = repeats ? 5 : std::min<std::int64_t>(5, p.rows.n);
    const std::int64_t first = repeats ? i - 2 : std::clamp<std::int64_t>(i - 2, 0, p.rows.n - count);
    const auto slope = [&](std::int64_t k) {  // its part in the slope
      double w = 1.0;
      if (k == i) {
        w = 0.0;
        for (std::int64_t j = first; j < first + count; ++j)
          if (j != i) w += 1.0 / (p.time(i) - p.time(j));
        return w;
      }
      for (std::int64_t j = first; j < first + count; ++j) {
        if (j == k) continue;
        if (j != i) w *= p.time(i) - p.time(j);
        w /= p.time(k) - p.time(j);
      }
      return w;
    };
    for (std::int64_t k = first; k < first + count; ++k) {
      const double w = slope(k), *x = p.row(repeats ? p.place(k).row : k);
      for (int c = 1; c <= 6; ++c) all[row_size * i + 6 + c] += w * x[c];
    }
  }

  static bool pack(const Params& params, Packed& p, double* all) {
    const auto table = params.table("record", 7);
    p.between = params.choice("between"), p.outside = params.choice("outside"), p.start = params.number("start");
    if (table.cols() < 2) return params.fail("record", "at least two rows");
    for (Eigen::Index k = 0; k < table.cols(); ++k) {
      if (k > 0 && !(table(0, k - 1) < table(0, k))) return params.fail("record", "times that increase from row to row");
      double* row = all + row_size * k;
      row[0] = table(0, k);
      for (int c = 1; c <= 6; ++c) row[c] = table(c, k), row[6 + c] = 0.0;
    }
    if (p.outside == kRepeat)
      for (int c = 1; c <= 6; ++c)
        if (table(c, 0) != table(c, table.cols() - 1))
          return params.fail("record", "a last row with the loads of the first, where it repeats");
    if (p.outside == kRepeat && std::abs(p.start) > kMostTurns * p.period())
      return params.fail("start", "at most 1e12 times the length of a record that repeats");
    for (std::int64_t i = 0; p.between == kCubic && i < p.rows.n; ++i) find_slopes(p, all, i);
    return true;
  }

  /// The last row before t, a time of the record: -1 before the first one, unless it repeats.
  static std::int64_t find(const Packed& p, double t) noexcept {
    std::int64_t turns = 0;
    if (p.outside == kRepeat) {
      turns = static_cast<std::int64_t>(std::floor((t - p.row(0)[0]) / p.period()));
      t -= static_cast<double>(turns) * p.period();
    }
    std::int64_t low = -1, high = p.rows.n;
    while (high - low > 1) {
      const std::int64_t middle = low + (high - low) / 2;
      (t < p.row(middle)[0] ? high : low) = middle;
    }
    return turns * (p.rows.n - 1) + low;
  }
  static std::int64_t now(const Packed& p, const double* d, double t) noexcept {
    return d[1] != 0.0 ? static_cast<std::int64_t>(d[0]) : find(p, t - p.start);
  }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    const std::int64_t k = now(p, in.d, in.t), last = p.rows.n - 1;
    double x[6] = {};
    if (p.outside != kRepeat && (k < 0 || k >= last)) {
      const double* end = p.row(k < 0 ? 0 : last);
      for (int c = 0; c < 6 && p.outside == kHold; ++c) x[c] = end[1 + c];
      return give_six(x, out);
    }
    const std::int64_t i = p.outside == kRepeat ? p.place(k).row : k;
    const double *a = p.row(i), *b = p.row(i + 1), h = b[0] - a[0], s = (in.t - p.start - p.time(k)) / h;
    for (int c = 1; c <= 6; ++c) {
      const double rise = b[c] - a[c];
      x[c - 1] = a[c];
      if (p.between == kLinear) x[c - 1] += s * rise;
      if (p.between == kCubic) {
        const double from = h * a[6 + c] - rise, to = rise - h * b[6 + c];
        x[c - 1] += s * (rise + (1.0 - s) * ((1.0 - s) * from + s * to));
      }
    }
    give_six(x, out);
  }

  static void roots(const Packed& p, const DeviceIn<double>& in, double* g) noexcept {
    const std::int64_t next = now(p, in.d, in.t) + 1;
    g[0] = p.outside == kRepeat || next < p.rows.n ? in.t - p.start - p.time(next) : -1.0;
  }
  static void event(const Packed& p, const DeviceIn<double>& in, std::uint32_t root, int direction, double*, double* d) noexcept {
    if (root == n_roots)
      d[0] = static_cast<double>(find(p, in.t - p.start)), d[1] = 1.0;  // the start
    else if (direction > 0)
      d[0] += 1.0;
  }
};

}  // namespace
const cardan_device_family& vibration_family() { return device_table_with_rows<Vibration>(); }
const cardan_device_family& recorded_load_family() { return device_table_with_rows<RecordedLoad>(); }
}  // namespace cardan
