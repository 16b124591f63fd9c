#pragma once
// From a C++ field (a struct of static functions, checked by a concept) to the C table of cardan_field.h. Its law is a template on the
// scalar: on Tangent numbers it is its own derivative, exact to round-off.
#include <cstring>

#include "core/abi/cardan_field.h"
#include "core/abi/family.hpp"
#include "core/spatial/tangent.hpp"
#include "core/spatial/vec3.hpp"

namespace cardan {

/// How many numbers a quantity has; 0 for what is none.
constexpr std::uint32_t field_size(std::uint32_t quantity) {
  constexpr std::uint32_t kSizes[] = {4, 3, 1, 3, 3, 3, 4, 1};
  return quantity <= CARDAN_TIME ? kSizes[quantity] : 0;
}
/// It depends on time alone.
constexpr bool is_of_time(std::uint32_t quantity) { return quantity >= CARDAN_POSITION; }
/// Its first three numbers are a vector that a device reads in the axes of its node.
constexpr bool is_field_vector(std::uint32_t quantity) {
  return quantity == CARDAN_GRAVITY || quantity == CARDAN_MAGNETIC || quantity == CARDAN_WIND || quantity == CARDAN_LIGHT;
}

/// Derivatives along x, y and z.
struct Slopes {
  double x, y, z;

  Slopes() = default;
  [[gnu::always_inline]] constexpr Slopes(double all) : Slopes(all, all, all) {}  // NOLINT: a constant
  [[gnu::always_inline]] constexpr Slopes(double along_x, double along_y, double along_z) : x(along_x), y(along_y), z(along_z) {}
  [[gnu::always_inline]] friend Slopes operator-(const Slopes& a) { return {-a.x, -a.y, -a.z}; }
  [[gnu::always_inline]] friend Slopes operator+(const Slopes& a, const Slopes& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  [[gnu::always_inline]] friend Slopes operator-(const Slopes& a, const Slopes& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  [[gnu::always_inline]] friend Slopes operator*(const Slopes& a, const Slopes& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
  [[gnu::always_inline]] friend Slopes operator/(const Slopes& a, const Slopes& b) { return {a.x / b.x, a.y / b.y, a.z / b.z}; }
};

/// Where a field is asked: `x` [m] in world axes, `t` [s]; `prepared` is what F::prepare made of t.
template <class F, class T>
struct FieldPoint {
  static auto prepared_of() {
    if constexpr (requires { typename F::Prepared; })
      return static_cast<const typename F::Prepared*>(nullptr);
    else
      return static_cast<const void*>(nullptr);
  }
  double t;
  Vec3<T> x;
  decltype(prepared_of()) prepared;
};

/// It gives gradients by formulas of its own.
template <class F>
concept GivesGradients = requires(const typename F::Packed& p, const FieldPoint<F, double>& at, double* x, double* gradients) {
  { F::evaluate(p, at, x, gradients) }
  noexcept;
};
/// Or its law is a template on the scalar.
template <class F>
concept FollowsTangents = requires(const typename F::Packed& p, const FieldPoint<F, double>& at, const FieldPoint<F, Tangent>& along,
                                   double* x, Tangent* dx) {
  { F::evaluate(p, at, x) }
  noexcept;
  { F::evaluate(p, along, dx) }
  noexcept;
};

/// `schema`, `limits`, `distance`, `Prepared` with `prepare(packed, t, prepared)`, `beyond(packed, point)` (bits of limits),
/// `n_edges(packed)` with `edges(packed, point, g)` may be left out. With `gradient_at_once` its law is evaluated once with derivatives
/// along x, y and z (TangentOf<Slopes>) and not three times with one (Tangent): the same bits. With `packed_size(params)`, in bytes,
/// pack(params, packed) may write behind the Packed that it is handed.
template <class F>
concept FieldFamily = requires {
  { F::type } -> std::convertible_to<std::string_view>;
  { F::summary } -> std::convertible_to<std::string_view>;
  { F::quantity } -> std::convertible_to<std::uint32_t>;
  { F::facts } -> std::convertible_to<unsigned>;
  requires std::is_trivially_copyable_v<typename F::Packed>;
  requires GivesGradients<F> || FollowsTangents<F>;
};

namespace detail {

template <class F>
int evaluate_field(const cardan_field_args* a, std::uint32_t n, const double* points, double* values, double* gradients) {
  constexpr std::uint32_t size = field_size(F::quantity);
  const auto& packed = *static_cast<const typename F::Packed*>(a->packed);
  const auto prepared = static_cast<decltype(FieldPoint<F, double>::prepared)>(a->prepared);
  int beyond = 0;
  for (std::uint32_t i = 0; i < n; ++i) {
    FieldPoint<F, double> at{a->t, {}, prepared};
    if constexpr (!is_of_time(F::quantity)) at.x = {points[3 * i], points[3 * i + 1], points[3 * i + 2]};
    if constexpr (requires { F::beyond(packed, at); }) beyond |= F::beyond(packed, at);
    if constexpr (GivesGradients<F>) {
      F::evaluate(packed, at, values + size * i, gradients ? gradients + 3 * size * i : nullptr);
    } else {
      if constexpr (requires { F::gradient_at_once; }) {
        if (gradients) {
          using T = TangentOf<Slopes>;
          const FieldPoint<F, T> there{a->t, {{at.x.x, {1.0, 0.0, 0.0}}, {at.x.y, {0.0, 1.0, 0.0}}, {at.x.z, {0.0, 0.0, 1.0}}}, prepared};
          T value[size];
          F::evaluate(packed, there, value);
          for (std::uint32_t k = 0; k < size; ++k) {
            values[size * i + k] = value[k].x;
            std::memcpy(gradients + 3 * (size * i + k), &value[k].d, sizeof value[k].d);
          }
          continue;
        }
      }
      F::evaluate(packed, at, values + size * i);
      for (int j = 0; gradients && j < 3; ++j) {
        const FieldPoint<F, Tangent> along{
            a->t, {{at.x.x, j == 0 ? 1.0 : 0.0}, {at.x.y, j == 1 ? 1.0 : 0.0}, {at.x.z, j == 2 ? 1.0 : 0.0}}, prepared};
        Tangent value[size];
        F::evaluate(packed, along, value);
        for (std::uint32_t k = 0; k < size; ++k) gradients[3 * (size * i + k) + static_cast<std::uint32_t>(j)] = value[k].d;
      }
    }
  }
  return beyond;
}

}  // namespace detail

/// The C table of F; lives for the whole program.
template <FieldFamily F>
const cardan_field_family& field_table() {
  using P = typename F::Packed;
  static const cardan_field_family table = [] {
    cardan_field_family t{};
    t.struct_size = sizeof t;
    t.type = F::type, t.summary = F::summary;
    t.quantity = F::quantity;
    t.facts = F::facts | (is_of_time(F::quantity) ? 0u : static_cast<unsigned>(CARDAN_FIELD_GRADIENT));
    t.params_size = sizeof(P);
    t.param_size = sizeof(cardan_param_desc), t.limit_size = sizeof(cardan_limit_desc);
    if constexpr (requires { F::distance; }) t.distance = F::distance;
    if constexpr (requires { F::schema; }) t.params = F::schema, t.n_params = sizeof(F::schema) / sizeof(F::schema[0]);
    if constexpr (requires { F::limits; }) t.limits = F::limits, t.n_limits = sizeof(F::limits) / sizeof(F::limits[0]);
    t.pack = &detail::pack<F>;
    if constexpr (requires(const Params& params) { F::packed_size(params); }) {
      t.packed_size = [](const cardan_param_values* values) -> std::uint64_t { return F::packed_size(Params(values)); };
      t.pack = [](const cardan_param_values* values, void* packed) { return F::pack(Params(values), *new (packed) P{}) ? 0 : 1; };
    }
    t.evaluate = &detail::evaluate_field<F>;
    if constexpr (requires(const P& p) { F::n_edges(p); })
      t.edges = [](const cardan_field_args* a, const double* point, double* g) -> std::uint32_t {
        const P& p = *static_cast<const P*>(a->packed);
        if (g)
          F::edges(p,
                   FieldPoint<F, double>{
                       a->t, {point[0], point[1], point[2]}, static_cast<decltype(FieldPoint<F, double>::prepared)>(a->prepared)},
                   g);
        return F::n_edges(p);
      };
    if constexpr (requires { typename F::Prepared; }) {
      t.prepared_size = sizeof(typename F::Prepared);
      t.prepare = [](double time, const void* packed, void* prepared) {
        typename F::Prepared p{};
        const int beyond = F::prepare(*static_cast<const P*>(packed), time, p);
        std::memcpy(prepared, &p, sizeof p);
        return beyond;
      };
    }
    return t;
  }();
  return table;
}

}  // namespace cardan
