// The laws are worth what they refuse: for each law, and for each shape that may be declared, a hinge that breaks it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <thread>

#include "core/abi/family.hpp"
#include "core/abi/laws.hpp"
#include "core/abi/registry.hpp"
#include "hinges/register.hpp"

namespace cardan {
namespace {

using Eigen::Map;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Table = cardan_hinge_family;

const Table& built_in(const char* type) {
  static const Registry registry = [] {
    Registry all;
    register_hinges(all);
    return all;
  }();
  return *registry.hinge(type);
}

/// A hinge with everything that one coordinate can have: R = exp(z~ q), l = (q^2, 0, sin q).
struct Curve {
  static constexpr const char* type = "test/curve";
  static constexpr const char* summary = "turns about z and runs along a curve";
  static constexpr int nq = 1, nv = 1;
  static constexpr auto shape = CARDAN_SHAPE_DENSE;
  struct Packed {};
  static constexpr const char* q_names[] = {"angle"};
  static constexpr const char* q_units[] = {"rad"};
  static constexpr const char* v_names[] = {"rate"};
  static constexpr const char* v_units[] = {"rad/s"};
  static bool pack(const Params&, Packed&) { return true; }
  static Matrix3d rotation(double q) { return Eigen::AngleAxisd(q, Vector3d::UnitZ()).toRotationMatrix(); }
  static void kinematics(const Packed&, const double* q, const double* v, HingeOut<1>& out) noexcept {
    out.R_OP = rotation(*q);
    out.p_OP = Vector3d(*q * *q, 0, std::sin(*q));
    out.Ht << 0, 0, 1, out.R_OP.transpose() * Vector3d(2 * *q, 0, std::cos(*q));
    const Matrix3d R_PO = out.R_OP.transpose();
    const Vector3d rate = R_PO * Vector3d(2, 0, -std::sin(*q)) - Vector3d::UnitZ().cross(R_PO * Vector3d(2 * *q, 0, std::cos(*q)));
    out.Hdot_v << Vector3d::Zero(), *v * *v * rate;
  }
};
const Table& curve() { return hinge_table<Curve>(); }

/// A function of C that does what the family's does, then changes the record of hinge j at coordinate q and rate v.
#define CHANGED_RECORD(base, ...)                                                                                                \
  [](const void* p, std::uint32_t n, const std::uint32_t* iq, const std::uint32_t* iv, const double* all_q, const double* all_v, \
     cardan_hinge_out* out) {                                                                                                    \
    (base).kinematics(p, n, iq, iv, all_q, all_v, out);                                                                          \
    for (std::uint32_t j = 0; j < n; ++j) {                                                                                      \
      [[maybe_unused]] const double q = all_q[iq[j]], v = all_v[iv[j]];                                                          \
      [[maybe_unused]] cardan_hinge_out& o = out[j];                                                                             \
      __VA_ARGS__                                                                                                                \
    }                                                                                                                            \
  }

struct Mutant {
  std::string name, law;  // the law that must be named
  Table table;
  bool alone = false;  // and no other
};

template <class Change>
Mutant mutant(const std::string& name, const std::string& law, const Table& base, const Change& change, bool alone = false) {
  Mutant m{name, law, base, alone};
  change(m.table);
  return m;
}

/// q of the tables below: the quaternion as (x, y, z, w), consistently, so that every law holds but that of the shape.
void permuted(const double* q, double* wxyz, int nq) {
  std::copy(q, q + nq, wxyz);
  wxyz[0] = q[3], wxyz[1] = q[0], wxyz[2] = q[1], wxyz[3] = q[2];
}
void back(const double* wxyz, double* q, int nq) {
  std::copy(wxyz, wxyz + nq, q);
  q[3] = wxyz[0], q[0] = wxyz[1], q[1] = wxyz[2], q[2] = wxyz[3];
}
struct BallName {
  static const Table& base() { return built_in("ball"); }
};
struct FreeName {
  static const Table& base() { return built_in("free"); }
};
struct FreeBodyName {
  static const Table& base() { return built_in("free_body"); }
};
template <class Name>
void scalar_last(Table& t) {
  static constexpr int kMost = 7;
  t.zero = [](const void* p, double* q) {
    double a[kMost]{};
    Name::base().zero(p, a), back(a, q, static_cast<int>(Name::base().nq));
  };
  t.kinematics = [](const void* p, std::uint32_t n, const std::uint32_t* iq, const std::uint32_t* iv, const double* q, const double* v,
                    cardan_hinge_out* out) {
    for (std::uint32_t j = 0; j < n; ++j) {
      double a[kMost]{};
      permuted(q + iq[j], a, static_cast<int>(Name::base().nq));
      const std::uint32_t zero = 0;
      Name::base().kinematics(p, 1, &zero, iv + j, a, v, out + j);
    }
  };
  t.qdot = [](const void* p, const double* q, const double* v, double* qdot) {
    double a[kMost]{}, d[kMost]{};
    permuted(q, a, static_cast<int>(Name::base().nq)), Name::base().qdot(p, a, v, d), back(d, qdot, static_cast<int>(Name::base().nq));
  };
  t.normalise = [](const void* p, double* q) {
    double a[kMost]{};
    permuted(q, a, static_cast<int>(Name::base().nq)), Name::base().normalise(p, a), back(a, q, static_cast<int>(Name::base().nq));
  };
  t.retract = [](const void* p, const double* q, const double* d, double* out) {
    double a[kMost]{}, b[kMost]{};
    permuted(q, a, static_cast<int>(Name::base().nq)), Name::base().retract(p, a, d, b), back(b, out, static_cast<int>(Name::base().nq));
  };
  t.difference = [](const void* p, const double* q1, const double* q2, double* d) {
    double a[kMost]{}, b[kMost]{};
    permuted(q1, a, static_cast<int>(Name::base().nq)), permuted(q2, b, static_cast<int>(Name::base().nq)),
        Name::base().difference(p, a, b, d);
  };
}

std::vector<Mutant> mutants() {
  const Table& ball = built_in("ball");
  std::vector<Mutant> all;
  const auto add = [&](auto&&... arguments) { all.push_back(mutant(arguments...)); };

  add("AScaledRotation", "R is a rotation", curve(), [](Table& t) {
    t.kinematics = CHANGED_RECORD(curve(), for (double& r : o.R_OP) r *= 1 + 1e-12;);
  });
  add("ATurnTheOtherWay", "angular part of Ht v", curve(), [](Table& t) { t.kinematics = CHANGED_RECORD(curve(), o.Ht[2] = -1;); });
  add("ADriftTheOtherWay", "linear part of Ht v", curve(), [](Table& t) { t.kinematics = CHANGED_RECORD(curve(), o.Ht[5] = -o.Ht[5];); });
  add("ADoubledRateOfTheMap", "Hdot_v = (d/dt Ht) v", curve(), [](Table& t) {
    t.kinematics = CHANGED_RECORD(curve(), for (double& h : o.Hdot_v) h *= 2;);
  });
  add("RatesThatAreNotLinear", "qdot is linear in v", curve(),
      [](Table& t) { t.qdot = [](const void*, const double*, const double* v, double* qdot) { *qdot = *v + 1e-11 * *v * *v; }; });
  add(
      "RatesOfAnotherMeasure", "where nq = nv, qdot is v", curve(),
      [](Table& t) {
        t.qdot = [](const void*, const double*, const double* v, double* qdot) { *qdot = 2 * *v; };
        t.zero = [](const void*, double* q) { *q = 0; };
        t.normalise = [](const void*, double*) {};
        t.retract = [](const void*, const double* q, const double* d, double* out) { *out = *q + 2 * *d; };
        t.difference = [](const void*, const double* a, const double* b, double* d) { *d = (*b - *a) / 2; };
        t.kinematics = CHANGED_RECORD(curve(), for (double& h : o.Ht) h *= 2; for (double& h : o.Hdot_v) h *= 4;);
      },
      true);
  add(
      "AMapThatKnowsTheRate", "R, l and Ht do not depend on v", curve(),
      [](Table& t) { t.kinematics = CHANGED_RECORD(curve(), o.Ht[5] += 1e-13 * v;); }, true);
  add("AMemory", "kinematics is a function of its arguments", curve(),
      [](Table& t) { t.kinematics = CHANGED_RECORD(curve(), static int calls = 0; o.Hdot_v[5] += 1e-13 * ++calls;); });
  add(
      "ABatchThatReadsTheFirstHinge", "kinematics of many hinges is that of each", curve(),
      [](Table& t) {
        t.kinematics = [](const void* p, std::uint32_t n, const std::uint32_t* iq, const std::uint32_t* iv, const double* q,
                          const double* v, cardan_hinge_out* out) {
          for (std::uint32_t j = 0; j < n; ++j) curve().kinematics(p, 1, iq, iv + j, q, v, out + j);
        };
      },
      true);
  add("ANormaliseThatGoesOn", "normalise leaves what is normalised", ball, [](Table& t) {
    t.normalise = [](const void* p, double* q) {
      built_in("ball").normalise(p, q);
      q[1] += 1e-13;
    };
  });
  add(
      "ADoubledDifference", "difference(q, retract(q, d)) = d", ball,
      [](Table& t) {
        t.difference = [](const void* p, const double* a, const double* b, double* d) {
          built_in("ball").difference(p, a, b, d);
          for (int i = 0; i < 3; ++i) d[i] *= 2;
        };
      },
      true);
  add(
      "ARetractOfTwiceTheWay", "retract(q, e v) moves along qdot", ball,
      [](Table& t) {
        t.retract = [](const void* p, const double* q, const double* d, double* out) {
          const double half[3] = {d[0] / 2, d[1] / 2, d[2] / 2};
          built_in("ball").retract(p, q, half, out);
        };
        t.difference = [](const void* p, const double* a, const double* b, double* d) {
          built_in("ball").difference(p, a, b, d);
          for (int i = 0; i < 3; ++i) d[i] *= 2;
        };
      },
      true);
  add("AKinkBeyondOneRadian", "linear part of Ht v", curve(),
      [](Table& t) { t.kinematics = CHANGED_RECORD(curve(), if (q > 1) o.Ht[5] *= 1.5;); });
  add("AKinkThreeTurnsAway", "linear part of Ht v", curve(),
      [](Table& t) { t.kinematics = CHANGED_RECORD(curve(), if (q > 18) o.Ht[5] *= 1.5;); });
  add("AKinkOnTheNegativeSide", "linear part of Ht v", curve(),
      [](Table& t) { t.kinematics = CHANGED_RECORD(curve(), if (q < -5) o.Ht[5] *= 1.5;); });
  add("ARateThatSaturates", "qdot is linear in v", curve(),
      [](Table& t) { t.qdot = [](const void*, const double*, const double* v, double* qdot) { *qdot = std::min(*v, 5.0); }; });
  add(
      "AnotherAnswerInAnotherThread", "kinematics is the same in another thread", curve(),
      [](Table& t) {
        static const std::thread::id here = std::this_thread::get_id();
        t.kinematics = CHANGED_RECORD(curve(), if (std::this_thread::get_id() != here) o.Hdot_v[5] += 1e-12;);
      },
      true);
  add("ARecordTooMany", "kinematics writes beyond what it is handed", curve(), [](Table& t) {
    t.kinematics = [](const void* p, std::uint32_t n, const std::uint32_t* iq, const std::uint32_t* iv, const double* q, const double* v,
                      cardan_hinge_out* out) {
      curve().kinematics(p, n, iq, iv, q, v, out);
      out[n].R_OP[0] = 0;
    };
  });
  add("ARateTooMany", "qdot writes beyond what it is handed", curve(),
      [](Table& t) { t.qdot = [](const void*, const double*, const double* v, double* qdot) { qdot[0] = qdot[1] = *v; }; });
  add("ARateThatIsNotWritten", "qdot is linear in v", curve(),
      [](Table& t) { t.qdot = [](const void*, const double*, const double*, double*) {}; });
  add("NoNumberAtZero", "linear part of Ht v", curve(),
      [](Table& t) { t.kinematics = CHANGED_RECORD(curve(), o.p_OP[2] = q == 0 ? NAN : o.p_OP[2];); });

  // Shapes. Each is a good hinge, but for what it says it is.
  const auto says = [](std::uint32_t shape) { return [shape](Table& t) { t.shape = shape; }; };
  add("AScrewThatSaysRotation", "the declared shape is true: l", built_in("helical"), says(CARDAN_SHAPE_ROTATION));
  add(
      "ARotationThatStartsTurned", "the declared shape is true: R", built_in("revolute"),
      [](Table& t) {
        t.kinematics = [](const void* p, std::uint32_t n, const std::uint32_t* iq, const std::uint32_t* iv, const double* q,
                          const double* v, cardan_hinge_out* out) {
          for (std::uint32_t j = 0; j < n; ++j) {
            const double turned = q[iq[j]] + 0.1;
            const std::uint32_t zero = 0;
            built_in("revolute")
                .kinematics(static_cast<const char*>(p) + j * built_in("revolute").params_size, 1, &zero, iv + j, &turned, v, out + j);
          }
        };
      },
      true);
  add("ASlideThatSaysRotation", "the declared shape is true: R", built_in("prismatic"), says(CARDAN_SHAPE_ROTATION));
  add("ASlideAlongTheOtherAxis", "the declared shape is true: l", built_in("prismatic"), [](Table& t) {
    t.axis = [](const void* p, double u[3], double* pitch) {
      built_in("prismatic").axis(p, u, pitch);
      for (int i = 0; i < 3; ++i) u[i] = -u[i];
    };
  });
  add("AScrewOfAnotherPitch", "the declared shape is true: l", built_in("helical"), [](Table& t) {
    t.axis = [](const void* p, double u[3], double* pitch) {
      built_in("helical").axis(p, u, pitch);
      *pitch *= 1 + 1e-9;
    };
  });
  add("AnAxisOfLengthTwo", "the declared shape is true: length of the axis", built_in("prismatic"), [](Table& t) {
    t.axis = [](const void* p, double u[3], double* pitch) {
      built_in("prismatic").axis(p, u, pitch);
      for (int i = 0; i < 3; ++i) u[i] *= 2;
    };
  });
  add(
      "AFixedHingeThatIsTurned", "the declared shape is true: R", built_in("locked"),
      [](Table& t) {
        t.kinematics = [](const void*, std::uint32_t n, const std::uint32_t*, const std::uint32_t*, const double*, const double*,
                          cardan_hinge_out* out) {
          for (std::uint32_t j = 0; j < n; ++j) out[j] = {{0, -1, 0, 1, 0, 0, 0, 0, 1}, {}, {}, {}};
        };
      },
      true);
  add("ABallWithTheScalarLast", "the declared shape is true: R", ball, scalar_last<BallName>);
  add("AFreeHingeWithTheScalarLast", "the declared shape is true: R", built_in("free"), scalar_last<FreeName>);
  add("AFreeBodyWithTheScalarLast", "the declared shape is true: R", built_in("free_body"), scalar_last<FreeBodyName>);
  add("AFreeHingeThatSaysFreeBody", "the declared shape is true: Ht", built_in("free"), says(CARDAN_SHAPE_FREE_BODY));
  add("AFreeBodyThatSaysFree", "the declared shape is true: Ht", built_in("free_body"), says(CARDAN_SHAPE_FREE));
  return all;
}

class HingeMutant : public testing::TestWithParam<Mutant> {};

TEST_P(HingeMutant, IsRefusedByItsLaw) {
  const auto violations = hinge_law_violations(GetParam().table);
  const auto of_law = std::count_if(violations.begin(), violations.end(), [](const std::string& v) { return v.find(GetParam().law) == 0; });
  EXPECT_GT(of_law, 0) << (violations.empty() ? "nothing" : violations.front());
  for (const std::string& v : violations) EXPECT_TRUE(!GetParam().alone || v.find(GetParam().law) == 0) << v;
}
INSTANTIATE_TEST_SUITE_P(Laws, HingeMutant, testing::ValuesIn(mutants()), [](const auto& m) { return m.param.name; });

// What holds for the mutants of shape is that every other law lets them pass.
TEST(HingeLaws, OfShapeAreNeededBesideTheOthers) {
  for (const Mutant& m : mutants()) {
    if (m.law.find("shape") == std::string::npos) continue;
    Table honest = m.table;
    if (honest.shape == CARDAN_SHAPE_FIXED) continue;  // no velocity: nobody computes such a hinge but as fixed
    honest.shape = CARDAN_SHAPE_DENSE;
    for (const std::string& v : hinge_law_violations(honest)) ADD_FAILURE() << m.name << ": " << v;
  }
}

TEST(HingeLaws, LetAGoodHingePass) {
  for (const std::string& v : hinge_law_violations(curve(), 1000)) ADD_FAILURE() << v;
}

// sqrt(4 - q^2) has no value beyond 2 rad; nothing is asked of a hinge there, but within one radian of zero it must
// have one.
TEST(HingeLaws, AskNothingOutsideOfADomain) {
  Table circle = curve();
  circle.kinematics = [](const void*, std::uint32_t n, const std::uint32_t* iq, const std::uint32_t* iv, const double* q, const double* v,
                         cardan_hinge_out* out) {
    for (std::uint32_t j = 0; j < n; ++j) {
      const double x = q[iq[j]], z = std::sqrt(4 - x * x), rate = v[iv[j]];
      out[j] = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {x, 0, z}, {0, 0, 0, 1, 0, -x / z}, {0, 0, 0, 0, 0, -4 / (z * z * z) * rate * rate}};
    }
  };
  for (const std::string& v : hinge_law_violations(circle)) ADD_FAILURE() << v;
}

TEST(HingeTables, TellAParameterThatPackAsksForInVain) {
  Table t = curve();
  t.pack = [](const cardan_param_values* values, void*) { return Params(values).number("radius") > 0.0 ? 0 : 1; };
  try {
    hinge_law_violations(t);
    FAIL();
  } catch (const std::invalid_argument& e) {
    EXPECT_STREQ(e.what(), "pack asks for the parameter \"radius\", which has no numbers");
  }
}

TEST(HingeTables, AreLookedAtBeforeTheyAreUsed) {
  const auto fault = [](const Table& base, const auto& change) {
    Table t = base;
    change(t);
    const auto found = hinge_law_violations(t);
    return found.empty() ? std::string("nothing") : found.front();
  };
  static constexpr cardan_param_desc kTwice[] = {param::required("a", CARDAN_NUMBER, "1", "x"),
                                                 param::optional("a", CARDAN_NUMBER, "m", "y")};
  static constexpr cardan_param_desc kNoChoices[] = {param::required("a", CARDAN_CHOICE, "1", "x")};
  static constexpr cardan_param_desc kNoNames[] = {param::required("a", CARDAN_TABLE, "1", "x", 2)};
  static constexpr cardan_param_desc kTurnedRange[] = {param::in_range(param::required("a", CARDAN_NUMBER, "1", "x"), 2, 1)};
  static constexpr cardan_param_desc kFlags[] = {param::in_range(param::required("a", CARDAN_NUMBER, "1", "x"), 1, 2, 64)};
  static const char* const kOneNull[] = {nullptr};
  static const char* const kNoUnit[] = {"parsec"};
  static constexpr cardan_param_desc kNoName[] = {param::required(nullptr, CARDAN_NUMBER, "m", "x")};
  static constexpr cardan_param_desc kNoUnitOfParameter[] = {param::required("a", CARDAN_NUMBER, nullptr, "x")};
  static constexpr cardan_param_desc kKind[] = {[] {
    cardan_param_desc d = param::required("a", CARDAN_NUMBER, "m", "x");
    d.kind = 17;
    return d;
  }()};
  const auto starts = [&](const std::string& expected, const Table& base, const auto& change) {
    const std::string found = fault(base, change);
    EXPECT_EQ(found.substr(0, expected.size()), expected) << found;
  };
  starts("type: null", curve(), [](Table& t) { t.type = nullptr; });
  starts("type: a name", curve(), [](Table& t) { t.type = ""; });
  starts("type: no text of one line", curve(), [](Table& t) { t.type = "a\033[31m"; });
  starts("summary: null", curve(), [](Table& t) { t.summary = nullptr; });
  starts("kinematics: null", curve(), [](Table& t) { t.kinematics = nullptr; });
  starts("nq, nv: nq = 7, nv = 7", curve(), [](Table& t) { t.nq = t.nv = 7; });
  starts("nq, nv: nq = 4000000000", curve(), [](Table& t) { t.nq = 4'000'000'000; });
  starts("zero, normalise, retract, difference: null", curve(), [](Table& t) { t.nq = 2; });
  starts("shape: 99", curve(), [](Table& t) { t.shape = 99; });
  starts("shape: 0 has nq = 0, nv = 0, not nq = 1, nv = 1", curve(), [](Table& t) { t.shape = CARDAN_SHAPE_FIXED; });
  starts("shape: 6 has nq = 7, nv = 6", curve(), [](Table& t) { t.shape = CARDAN_SHAPE_FREE_BODY; });
  starts("axis: null", curve(), [](Table& t) { t.shape = CARDAN_SHAPE_ROTATION; });
  starts("q_names: null", curve(), [](Table& t) { t.q_names = nullptr; });
  starts("v_names[0]: null", curve(), [](Table& t) { t.v_names = kOneNull; });
  starts("q_units[0]: null", curve(), [](Table& t) { t.q_units = kOneNull; });
  starts("v_units[0]: no unit", curve(), [](Table& t) { t.v_units = kNoUnit; });
  starts("params: null", curve(), [](Table& t) { t.n_params = 1; });
  starts("n_params: 1000000,", curve(), [](Table& t) { t.n_params = 1'000'000; });
  starts("params_size: 2000000000,", curve(), [](Table& t) { t.params_size = 2'000'000'000; });
  starts("params[0].name: null", curve(), [](Table& t) { t.n_params = 1, t.params = kNoName; });
  starts("params[0].unit: null", curve(), [](Table& t) { t.n_params = 1, t.params = kNoUnitOfParameter; });
  starts("params[0].count: 0, and a choice", curve(), [](Table& t) { t.n_params = 1, t.params = kNoChoices; });
  starts("params[0].names: null", curve(), [](Table& t) { t.n_params = 1, t.params = kNoNames; });
  starts("params[0].lower, upper: 2, 1,", curve(), [](Table& t) { t.n_params = 1, t.params = kTurnedRange; });
  starts("params[0].flags: 65,", curve(), [](Table& t) { t.n_params = 1, t.params = kFlags; });
  starts("params[0].kind: 17", curve(), [](Table& t) { t.n_params = 1, t.params = kKind; });
  starts("params[1].name: \"a\" twice", curve(), [](Table& t) { t.n_params = 2, t.params = kTwice; });
  starts("pack writes 32 bytes, 7 are its own", built_in("revolute"), [](Table& t) { t.params_size = 7; });
  starts("pack refuses every set of random parameters", curve(),
         [](Table& t) { t.pack = [](const cardan_param_values*, void*) { return 1; }; });
}

}  // namespace
}  // namespace cardan
