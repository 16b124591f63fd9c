// The laws of fields over everything that comes with Cardan; and for each law a field that breaks it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/abi/field_family.hpp"
#include "core/abi/field_laws.hpp"
#include "core/abi/registry.hpp"
#include "plugins/fields/register.hpp"

namespace cardan {
namespace {

const Registry& registry() {
  static const Registry all = [] {
    Registry r;
    register_fields(r);
    return r;
  }();
  return all;
}

class FieldContract : public testing::TestWithParam<std::string> {};
TEST_P(FieldContract, ObeysEveryLaw) {
  for (const auto& v : field_law_violations(*registry().field(GetParam()), 60, 7)) ADD_FAILURE() << GetParam() << ": " << v;
}
INSTANTIATE_TEST_SUITE_P(Registry, FieldContract, testing::ValuesIn(registry().fields.types()),
                         [](const auto& tested) { return tested.param; });

/// All that a law may do with a number that has derivatives along x, y and z.
template <class F>
struct AnyLaw {
  static constexpr const char *type = "test/any", *summary = "";
  static constexpr std::uint32_t quantity = CARDAN_GRAVITY;
  static constexpr unsigned facts = 0u;
  struct Packed {
    double k;
  };
  static bool pack(const Params&, Packed& p) { return p.k = 0.7, true; }
  template <class T>
  static void evaluate(const Packed& p, const FieldPoint<F, T>& at, T* out) noexcept {
    using std::cos, std::sin, std::sqrt;
    const T r = sqrt(dot(at.x, at.x)), s = sin(T(p.k) * at.x.x) / r;
    out[0] = s - at.x.y * cos(at.x.z), out[1] = at.x.x < T(0.0) ? -at.x.y / r : T(2) * s * s, out[2] = T(p.k) / (r * r), out[3] = -s;
  }
};
struct ThreeTimes : AnyLaw<ThreeTimes> {};
struct AtOnce : AnyLaw<AtOnce> {
  static constexpr bool gradient_at_once = true;
};

TEST(FieldGradients, AtOnceAreThoseOfThreeDirectionsToTheBit) {
  const double points[] = {0.3, -1.7, 0.9, -2.1, 0.4, 1e-3, 7e6, 2e5, -3e6};
  double values[2][12], gradients[2][36], alone[12];
  const AnyLaw<AtOnce>::Packed packed{0.7};
  const cardan_field_args args{sizeof args, 0.0, &packed, nullptr};
  detail::evaluate_field<ThreeTimes>(&args, 3, points, values[0], gradients[0]);
  detail::evaluate_field<AtOnce>(&args, 3, points, values[1], gradients[1]);
  detail::evaluate_field<AtOnce>(&args, 3, points, alone, nullptr);
  for (int i = 0; i < 12; ++i) EXPECT_EQ(values[0][i], values[1][i]) << i;
  for (int i = 0; i < 12; ++i) EXPECT_EQ(values[0][i], alone[i]) << i;
  for (int i = 0; i < 36; ++i) EXPECT_EQ(gradients[0][i], gradients[1][i]) << i;
}

/// Gravity of a point, in plain C: what a mutant changes.
using Table = cardan_field_family;
using Args = const cardan_field_args*;

void at_point(const double* x, double* v, double* G) {
  const double r2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2], r = std::sqrt(r2);
  for (int i = 0; i < 3; ++i) v[i] = -x[i] / (r2 * r);
  v[3] = -1.0 / r;
  for (int i = 0; G && i < 3; ++i)
    for (int j = 0; j < 3; ++j) G[3 * i + j] = (3.0 * x[i] * x[j] / r2 - (i == j ? 1.0 : 0.0)) / (r2 * r);
  for (int j = 0; G && j < 3; ++j) G[9 + j] = -v[j];
}
int good(Args, std::uint32_t n, const double* x, double* v, double* G) {
  for (std::uint32_t i = 0; i < n; ++i) at_point(x + 3 * i, v + 4 * i, G ? G + 12 * i : nullptr);
  return 0;
}
Table table() {
  Table t{};
  t.struct_size = sizeof t;
  t.type = "test/point", t.summary = "";
  t.quantity = CARDAN_GRAVITY;
  t.facts = CARDAN_FIELD_GRADIENT | CARDAN_FIELD_POTENTIAL | CARDAN_FIELD_STEADY | CARDAN_FIELD_SOURCE_FREE | CARDAN_FIELD_CURL_FREE;
  t.evaluate = good;
  return t;
}
std::string violations(const Table& t) {
  std::string all;
  for (const std::string& v : field_law_violations(t, 20)) all += v + "\n";
  return all;
}
void expect(const Table& t, const std::string& law) {
  EXPECT_NE(violations(t).find(law), std::string::npos) << law << ":\n" << violations(t);
}
template <class Change>
Table changed(const Change& change) {
  Table t = table();
  change(t);
  return t;
}
#define CHANGED(...)                                                                         \
  changed([](Table& t) {                                                                     \
    t.evaluate = [](Args a, std::uint32_t n, const double* x, double* v, double* G) -> int { \
      good(a, n, x, v, G);                                                                   \
      (void)a;                                                                               \
      __VA_ARGS__;                                                                           \
      return 0;                                                                              \
    };                                                                                       \
  })
/// A field of another quantity that is what its values say, without gradients.
Table of(std::uint32_t quantity, unsigned facts, int (*evaluate)(Args, std::uint32_t, const double*, double*, double*)) {
  Table t = table();
  t.quantity = quantity, t.facts = facts, t.evaluate = evaluate;
  return t;
}

TEST(FieldMutants, TheOneTheyComeFromObeys) {
  EXPECT_EQ(violations(table()), "");
  Table without = table();
  without.facts &= ~static_cast<unsigned>(CARDAN_FIELD_GRADIENT);
  EXPECT_EQ(violations(without), "");
}

TEST(FieldMutants, AreCaughtByTheirLaw) {
  expect(CHANGED(static double before = 0.0; v[0] += before; before += 1e-3), "function of its arguments: other numbers");
  expect(CHANGED(thread_local int calls = 0; v[3] += 1.0 / ++calls), "function of its arguments");
  expect(CHANGED(const_cast<double*>(x)[0] = 3.0), "changes its arguments");
  expect(CHANGED(v[4 * n] = 1.0), "beyond its arrays");
  expect(CHANGED(if (G) G[12 * n] = 1.0), "beyond its arrays");
  expect(CHANGED(if (n > 1) v[4] *= 1.0 + 1e-15), "a point alone has the numbers that it has among others");
  expect(CHANGED(if (G) v[1] *= 1.0 + 1e-15), "whether gradients are wanted or not");
  expect(CHANGED(v[2] = std::sqrt(-1.0 - v[2] * v[2])), "evaluate gives");
  expect(CHANGED(if (G) for (std::uint32_t i = 0; i < n; ++i) G[12 * i + 1] *= 1.01), "gradients are the derivatives of values");
  expect(CHANGED(for (std::uint32_t i = 0; i < n; ++i) {
           v[4 * i + 3] *= 1.01;
           if (G)
             for (int j = 9; j < 12; ++j) G[12 * i + j] *= 1.01;
         }),
         "a = -grad U");
  expect(CHANGED(for (std::uint32_t i = 0; i < n; ++i) v[4 * i] += 1e-3 * a->t), "a steady field is the same at another time");
  expect(changed([](Table& t) { t.facts = CARDAN_FIELD_STEADY; }), "gravity without CARDAN_FIELD_POTENTIAL has 0");
  // a = r: a potential of its own, and a divergence of 3; a = (y, 0, 0): a curl.
  expect(of(CARDAN_GRAVITY, CARDAN_FIELD_SOURCE_FREE,
            [](Args, std::uint32_t n, const double* x, double* v, double*) {
              for (std::uint32_t i = 0; i < n; ++i)
                v[4 * i] = x[3 * i], v[4 * i + 1] = x[3 * i + 1], v[4 * i + 2] = x[3 * i + 2], v[4 * i + 3] = 0;
              return 0;
            }),
         "div = 0");
  const auto shear = [](Args, std::uint32_t n, const double* x, double* v, double*) {
    for (std::uint32_t i = 0; i < n; ++i) v[3 * i] = x[3 * i + 1], v[3 * i + 1] = 0, v[3 * i + 2] = 0;
    return 0;
  };
  expect(of(CARDAN_WIND, CARDAN_FIELD_CURL_FREE, shear), "curl = 0");
  EXPECT_EQ(violations(of(CARDAN_WIND, CARDAN_FIELD_STEADY, shear)), "");
  EXPECT_EQ(violations(of(CARDAN_MAGNETIC, 0, shear)), "");  // a current in z
  expect(of(CARDAN_MAGNETIC, 0,
            [](Args, std::uint32_t n, const double* x, double* v, double*) {
              std::copy_n(x, 3 * n, v);
              return 0;
            }),
         "div = 0");
  expect(of(CARDAN_DENSITY, 0,
            [](Args, std::uint32_t n, const double* x, double* v, double*) {
              for (std::uint32_t i = 0; i < n; ++i) v[i] = x[3 * i];
              return 0;
            }),
         "a density is not negative");
  expect(of(CARDAN_ATTITUDE, 0,
            [](Args, std::uint32_t, const double*, double* v, double*) { return v[0] = 1.01, v[1] = v[2] = v[3] = 0.0, 0; }),
         "an attitude is a unit quaternion");
  expect(changed([](Table& t) { t.evaluate = [](Args, std::uint32_t, const double*, double*, double*) { return 2; }; }),
         "there are 0 limits");
  static const cardan_limit_desc limits[] = {{"end", 0, "the end"}};
  expect(changed([](Table& t) {
           t.limits = limits, t.n_limits = 1, t.limit_size = sizeof limits[0];
           t.evaluate = [](Args a, std::uint32_t n, const double* x, double* v, double* G) { return good(a, n, x, v, G), 1; };
         }),
         "every random point is beyond its limits");
  expect(changed([](Table& t) {
           t.prepared_size = 8;
           t.prepare = [](double, const void*, void* out) { return std::fill_n(static_cast<char*>(out), 9, 'x'), 0; };
         }),
         "prepare writes beyond prepared_size");
  expect(changed([](Table& t) {
           t.prepared_size = 8;
           t.prepare = [](double time, const void*, void* out) {
             static double sum = 0.0;
             *static_cast<double*>(out) = sum += time;
             return 0;
           };
         }),
         "prepare is a function of time");
  expect(changed([](Table& t) {
           t.pack = [](const cardan_param_values*, void* p) { return *static_cast<double*>(p) = 2.0, 0; };
           t.params_size = t.prepared_size = 8;
           t.prepare = [](double time, const void* packed, void* out) {
             *static_cast<double*>(const_cast<void*>(packed)) += 1.0;
             return *static_cast<double*>(out) = time, 0;
           };
         }),
         "prepare changes its parameters");
  expect(changed([](Table& t) {
           t.prepared_size = 8;
           t.prepare = [](double time, const void*, void* out) { return *static_cast<double*>(out) = time, 2; };
         }),
         "prepare returns 2");
  expect(changed([](Table& t) {
           t.pack = [](const cardan_param_values*, void* p) { return std::fill_n(static_cast<char*>(p), 9, 'x'), 0; };
           t.params_size = 8;
         }),
         "pack writes 9 bytes, 8");
}

TEST(FieldMutants, TablesThatCannotBeReadAreToldMemberByMember) {
  expect(changed([](Table& t) { t.type = nullptr; }), "type: null");
  expect(changed([](Table& t) { t.evaluate = nullptr; }), "evaluate: null");
  expect(changed([](Table& t) { t.quantity = 8; }), "quantity: 8");
  expect(changed([](Table& t) { t.facts = 4096; }), "facts: 4096");
  expect(changed([](Table& t) { t.distance = -1.0; }), "distance: -1");
  expect(changed([](Table& t) { t.n_limits = 40; }), "n_limits: 40");
  expect(changed([](Table& t) { t.n_limits = 1; }), "limits: null");
  expect(changed([](Table& t) { t.prepared_size = 8; }), "prepare: null");
  expect(changed([](Table& t) { t.quantity = CARDAN_DENSITY; }), "facts: CARDAN_FIELD_POTENTIAL, which is of gravity alone");
  expect(changed([](Table& t) { t.quantity = CARDAN_TIME, t.facts = CARDAN_FIELD_GRADIENT; }),
         "CARDAN_FIELD_GRADIENT of what depends on time");
}

}  // namespace
}  // namespace cardan
