// tabulated_atmosphere: density of air by rows of height and density, between two of them falling exponentially.
#include <cmath>
#include <cstdint>

#include "plugins/fields/planet.hpp"

namespace cardan {
namespace {

struct TabulatedAtmosphere {
  static constexpr const char* type = "tabulated_atmosphere";
  static constexpr const char* summary = "density of air by a table of heights above an ellipsoid";
  static constexpr std::uint32_t quantity = CARDAN_DENSITY;
  static constexpr unsigned facts = CARDAN_FIELD_STEADY;
  static constexpr double distance = 7e6;  // [m] of the laws
  struct Row {
    double height, density, fall;  // [m], [kg/m^3], [1/m] to the next
  };
  struct Packed {
    Ellipsoid planet;
    std::int64_t rows;  // behind it
    const Row* first() const { return reinterpret_cast<const Row*>(this + 1); }
  };
  static constexpr const char* columns[] = {"height", "density"};
  static constexpr const char* units[] = {"m", "kg/m^3"};
  static constexpr cardan_param_desc schema[] = {
      [] {
        cardan_param_desc table =
            param::named(param::required("table", CARDAN_TABLE, "1", "heights, which increase, and densities"), columns);
        table.units = units;
        return table;
      }(),
      Ellipsoid::radius_desc, Ellipsoid::flattening_desc, TurningPlanet::axis_desc, TurningPlanet::centre_desc};
  static constexpr cardan_limit_desc limits[] = {{"lowest", 1, "below the first height of the table"},
                                                 {"highest", 1, "above the last height of the table"}};

  static std::uint64_t packed_size(const Params& params) {
    return sizeof(Packed) + static_cast<std::uint64_t>(params.table("table", 2).cols()) * sizeof(Row);
  }
  static bool pack(const Params& params, Packed& p) {
    const auto table = params.table("table", 2);
    p.planet.pack(params), p.rows = table.cols();
    if (p.rows < 2) return params.fail("table", "at least two rows");
    Row* row = reinterpret_cast<Row*>(&p + 1);
    for (Eigen::Index i = 0; i < table.cols(); ++i, ++row) {
      if (!(table(1, i) > 0.0)) return params.fail("table", "densities above 0");
      const bool last = i + 1 == table.cols();
      if (!last && !(table(0, i) < table(0, i + 1))) return params.fail("table", "heights that increase from row to row");
      new (row) Row{table(0, i), table(1, i), last ? 0.0 : std::log(table(1, i + 1) / table(1, i)) / (table(0, i + 1) - table(0, i))};
    }
    return true;
  }
  static int beyond(const Packed& p, const FieldPoint<TabulatedAtmosphere, double>& at) noexcept {
    const double h = p.planet.height(at.x);
    return (h < p.first()->height ? 1 : 0) | (h > p.first()[p.rows - 1].height ? 2 : 0);
  }

  template <class T>
  static void evaluate(const Packed& p, const FieldPoint<TabulatedAtmosphere, T>& at, T* density) noexcept {
    using std::exp;
    const Row *low = p.first(), *last = low + p.rows - 1;
    T h = p.planet.height(at.x);
    if (h < T(low->height)) h = T(low->height);
    if (h > T(last->height)) h = T(last->height);
    for (const Row* high = last; high - low > 1;) {  // it lies between them
      const Row* middle = low + (high - low) / 2;
      (h < T(middle->height) ? high : low) = middle;
    }
    density[0] = T(low->density) * exp(T(low->fall) * (h - T(low->height)));
  }
};

}  // namespace
const cardan_field_family& tabulated_atmosphere_family() { return field_table<TabulatedAtmosphere>(); }
}  // namespace cardan
