#pragma once
// Harmonics of what is around a planet, to any degree and order (docs/mathematics/gravity.md 6):
// phi = 1/r sum_n (a/r)^n sum_m P_nm(u) (C_nm cos(m l) + S_nm sin(m l)), P_nm fully normalised (4 pi), without the phase of Condon and
// Shortley, u the sine of the latitude. By columns of one order, on derived Legendre functions, which know no singular pole (Pines 1973).
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "plugins/fields/planet.hpp"

namespace cardan {

/// Of C and S.
using Pair [[gnu::vector_size(16), gnu::aligned(8)]] = double;

struct Coefficient {
  int n = 0, m = 0;
  double C = 0.0, S = 0.0, C_rate = 0.0, S_rate = 0.0;  // rates [1/s]
};

/// One of a column: its recursion P_n = alpha u P_n-1 - beta P_n-2, and its coefficients.
struct Term {
  double alpha, beta;
  Pair CS, rates;
};
/// All terms of an order that are there, from degree m to `last`.
struct Order {
  std::int64_t m, last;
  double sectoral;  // P_mm over the m-th power of the cosine of the latitude
};

/// The head of packed harmonics; orders, each followed by its terms, stand behind the field that has it.
struct Harmonics {
  static constexpr int kMostDegree = 360;  // derived functions of much more overflow
  double radius;                           // a [m]
  std::int64_t orders;

  /// Of rows with n and m in front; null: they are none, and `params` was told so.
  static std::optional<std::vector<Coefficient>> read(const Params& params, int columns, int least, int degree) {
    const auto rows = params.table("coefficients", columns);
    std::vector<Coefficient> all;
    for (Eigen::Index i = 0; i < rows.cols(); ++i) {
      const double n = rows(0, i), m = rows(1, i);
      if (n != std::floor(n) || m != std::floor(m) || n < least || n > kMostDegree || m < 0.0 || m > n) {
        const std::string got = "n = " + told(n) + ", m = " + told(m) + " in row " + std::to_string(i + 1);
        params.fail("coefficients",
                    least == 0 ? "rows of a degree n from 0 to 360 and an order m from 0 to n"
                               : "rows of a degree n from 1 to 360 and an order m from 0 to n",
                    got.c_str());
        return {};
      }
      if (n > degree) continue;
      all.push_back({static_cast<int>(n), static_cast<int>(m), rows(2, i), rows(3, i)});
      if (columns == 6) all.back().C_rate = rows(4, i), all.back().S_rate = rows(5, i);
    }
    std::ranges::sort(all, {}, [](const Coefficient& c) { return std::pair(c.m, c.n); });
    const auto same = [](const Coefficient& a, const Coefficient& b) { return a.n == b.n && a.m == b.m; };
    if (const auto twice = std::ranges::adjacent_find(all, same); twice != all.end()) {
      const std::string got = "n = " + std::to_string(twice->n) + ", m = " + std::to_string(twice->m) + " twice";
      params.fail("coefficients", "each degree and order once", got.c_str());
      return {};
    }
    return all;
  }

  static std::string told(double x) {
    return x == std::floor(x) && std::abs(x) < 1e9 ? std::to_string(std::llround(x)) : std::to_string(x);
  }

  static std::uint64_t bytes(const std::vector<Coefficient>& sorted) {
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < sorted.size(); ++i)
      if (i + 1 == sorted.size() || sorted[i + 1].m != sorted[i].m)
        sum += sizeof(Order) + static_cast<std::uint64_t>(sorted[i].n - sorted[i].m + 1) * sizeof(Term);
    return sum;
  }

  /// To `to`, of bytes(sorted).
  void write(const std::vector<Coefficient>& sorted, void* to) {
    orders = 0;
    auto* at = static_cast<unsigned char*>(to);
    double sectoral = 1.0;
    int reached = 0;
    for (std::size_t begin = 0, end = 0; begin < sorted.size(); begin = end) {
      const int m = sorted[begin].m;
      while (end < sorted.size() && sorted[end].m == m) ++end;
      const int last = sorted[end - 1].n;
      for (; reached < m; ++reached) sectoral *= reached == 0 ? std::sqrt(3.0) : std::sqrt((2.0 * reached + 3.0) / (2.0 * reached + 2.0));
      new (at) Order{m, last, sectoral};
      at += sizeof(Order);
      std::size_t next = begin;
      for (int n = m; n <= last; ++n, at += sizeof(Term)) {
        const double N = n, M = m;
        const bool given = next < end && sorted[next].n == n;
        const Coefficient c = given ? sorted[next++] : Coefficient{};
        const double alpha = n > m ? std::sqrt((2 * N + 1) * (2 * N - 1) / ((N - M) * (N + M))) : 0.0;
        const double beta = n > m + 1 ? std::sqrt((2 * N + 1) * (N + M - 1) * (N - M - 1) / ((2 * N - 3) * (N + M) * (N - M))) : 0.0;
        new (at) Term{alpha, beta, Pair{c.C, c.S}, Pair{c.C_rate, c.S_rate}};
      }
      ++orders;
    }
  }

  /// phi [1/m], its gradient and, by `SECOND`, its second derivatives, by rows, at `place` from the centre, all in the axes of the planet.
  /// `orders` stand at `packed`; coefficients are those `since` their epoch [s].
  template <bool SECOND>
  void evaluate(const void* packed, const Eigen::Vector3d& place, double since, double& phi, Eigen::Vector3d& slope,
                Eigen::Matrix3d& second) const noexcept {
    const double r = place.norm(), near = radius / r;
    const Eigen::Vector3d up = place / r;
    const double u = up[2];
    // (near (s + i t))^m with s, t the other two of `up`, and the two powers before, each near to the same power.
    double re[3] = {1.0, 0.0, 0.0}, im[3] = {0.0, 0.0, 0.0};
    std::int64_t power = 0;
    double value = 0.0, along = 0.0, along_twice = 0.0, along_axis = 0.0, axis_twice = 0.0, plane = 0.0, across = 0.0;
    Eigen::Vector3d moved = Eigen::Vector3d::Zero(), with_up = Eigen::Vector3d::Zero(), with_axis = Eigen::Vector3d::Zero();
    const auto* at = static_cast<const unsigned char*>(packed);
    for (std::int64_t i = 0; i < orders; ++i) {
      const auto& order = *reinterpret_cast<const Order*>(at);
      const auto* terms = reinterpret_cast<const Term*>(at + sizeof(Order));
      at += sizeof(Order) + static_cast<std::size_t>(order.last - order.m + 1) * sizeof(Term);
      for (; power < order.m; ++power) {
        re[2] = near * re[1], im[2] = near * im[1];
        re[1] = near * re[0], im[1] = near * im[0];
        const double x = re[0];
        re[0] = near * (up[0] * x - up[1] * im[0]), im[0] = near * (up[0] * im[0] + up[1] * x);
      }
      const auto m = static_cast<double>(order.m);
      const Sums sums = column<SECOND>(order, terms, near, u, since);
      // What is (re, im)^m here is, by its derivatives, m (re, im)^(m-1) along x and m (-im, re)^(m-1) along y.
      const auto here = [&](const Pair& x) { return x[0] * re[0] + x[1] * im[0]; };
      const auto aside = [&](const Pair& x) -> Eigen::Vector2d {
        return m * Eigen::Vector2d(x[0] * re[1] + x[1] * im[1], x[1] * re[1] - x[0] * im[1]);
      };
      const Pair W = sums.along(m, u);
      value += here(sums.P), along -= here(W);
      moved.head<2>() += aside(sums.P), moved[2] += here(sums.D);
      if constexpr (SECOND) {
        along_twice += here(sums.along_twice(m, u)), along_axis -= here(sums.along_slope(m, u)), axis_twice += here(sums.E);
        with_up.head<2>() -= aside(W), with_axis.head<2>() += aside(sums.D);
        plane += m * (m - 1.0) * (sums.P[0] * re[2] + sums.P[1] * im[2]), across += m * (m - 1.0) * (sums.P[1] * re[2] - sums.P[0] * im[2]);
      }
    }
    phi = value / r;
    slope = (along * up + moved) / (r * r);
    if constexpr (SECOND) {
      with_up[2] = along_axis;
      with_axis[2] = 0.5 * axis_twice;
      const Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
      Eigen::Matrix3d half = with_up * up.transpose() + with_axis * axis.transpose();
      second = along_twice * up * up.transpose() + along * Eigen::Matrix3d::Identity() + half + half.transpose();
      second(0, 0) += plane, second(1, 1) -= plane, second(0, 1) += across, second(1, 0) += across;
      second /= r * r * r;
    }
  }

 private:
  /// Sums over a column, each (a/r)^(n-m) times P, its slope D and its second derivative E along u, with the degree n and its square.
  struct Sums {
    Pair P, nP, D, nnP, nD, E;
    /// -r d/dr of r^-(m+1) times the first sum, u = z/r, z held; its slope along u; what stands with r^ r^*.
    Pair along(double m, double u) const { return (m + 1.0) * P + nP + u * D; }
    Pair along_slope(double m, double u) const { return (m + 2.0) * D + nD + u * E; }
    Pair along_twice(double m, double u) const { return (m + 3.0) * along(m, u) + (m + 1.0) * nP + nnP + u * nD + u * along_slope(m, u); }
  };

  template <bool SECOND>
  static Sums column(const Order& order, const Term* terms, double near, double u, double since) noexcept {
    Sums sums{};
    double P = order.sectoral, D = 0.0, E = 0.0, P_before = 0.0, D_before = 0.0, E_before = 0.0;
    for (std::int64_t n = order.m; n <= order.last; ++n) {
      const Term& term = terms[n - order.m];
      if (n > order.m) {
        // One product and one sum behind another from degree to degree: the rest does not wait.
        const double alpha = near * term.alpha, alpha_u = alpha * u, beta = near * near * term.beta;
        const double P_next = alpha_u * P - beta * P_before, D_next = alpha_u * D + (alpha * P - beta * D_before);
        if constexpr (SECOND) {
          const double E_next = alpha_u * E + (2.0 * alpha * D - beta * E_before);
          E_before = E, E = E_next;
        }
        P_before = P, P = P_next, D_before = D, D = D_next;
      }
      const double degree = static_cast<double>(n), nP = degree * P;
      const Pair CS = term.CS + since * term.rates;
      sums.P += CS * P, sums.nP += CS * nP, sums.D += CS * D;
      if constexpr (SECOND) sums.nnP += CS * (degree * nP), sums.nD += CS * (degree * D), sums.E += CS * E;
    }
    return sums;
  }
};

/// What a field of harmonics packs: `scale` times phi is its potential.
struct HarmonicField {
  Harmonics harmonics;
  TurningPlanet planet;
  double scale;  // of gravity mu [m^3/s^2], of a magnetic field -a^2 [m^2]
  double since;  // [s] from the epoch of the coefficients to the start of the run

  /// scale phi, and along world axes its gradient and, unless null, its second derivatives by rows.
  void evaluate(const PlanetAxes& axes, const Vec3<double>& place, double t, double& potential, double* slope,
                double* second) const noexcept {
    const Eigen::Map<const Eigen::Matrix3d> R(axes.columns);
    const Eigen::Vector3d x =
        R.transpose() * (Eigen::Vector3d(place.x, place.y, place.z) - Eigen::Map<const Eigen::Vector3d>(planet.centre));
    double phi = 0.0;
    Eigen::Vector3d along;
    Eigen::Matrix3d twice;
    if (second)
      harmonics.evaluate<true>(this + 1, x, since + t, phi, along, twice);
    else
      harmonics.evaluate<false>(this + 1, x, since + t, phi, along, twice);
    potential = scale * phi;
    Eigen::Map<Eigen::Vector3d> to(slope);
    to = scale * (R * along);
    if (!second) return;
    Eigen::Map<Eigen::Matrix3d> twice_to(second);
    twice_to = scale * (R * twice * R.transpose());
  }
};

/// What fields of harmonics have in common; F::coefficients(params) are those that it has, null where it has refused some, F::set(params,
/// packed) fills in scale, radius and epoch.
template <class F>
struct HarmonicFamily {
  using Packed = HarmonicField;
  using Prepared = PlanetAxes;
  static constexpr cardan_limit_desc limits[] = {TurningPlanet::bulletin_limit};

  static std::uint64_t packed_size(const Params& params) {
    const auto all = F::coefficients(params);
    return sizeof(Packed) + (all ? Harmonics::bytes(*all) : 0);
  }
  static bool pack(const Params& params, Packed& p) {
    const auto all = F::coefficients(params);
    if (!all || !p.planet.pack(params)) return false;
    F::set(params, p);
    p.harmonics.write(*all, &p + 1);
    return true;
  }
  static int prepare(const Packed& p, double t, Prepared& out) noexcept {
    out = PlanetAxes::at(p.planet, t);
    return p.planet.is_known(t) ? 0 : 1;
  }
};

}  // namespace cardan
