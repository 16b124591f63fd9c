// The laws of the body concept over everything in the registry, and for each law a body that breaks it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <thread>

#include "bodies/register.hpp"
#include "core/abi/body_laws.hpp"
#include "core/abi/family.hpp"
#include "core/abi/registry.hpp"

namespace cardan {
namespace {

using Table = cardan_body_family;

const Registry& registry() {
  static const Registry all = [] {
    Registry r;
    register_bodies(r);
    return r;
  }();
  return all;
}
const Table& modal() { return *registry().body("modal_flexible"); }

/// The type of docs/extending/body.md whose nodes move along curves.
const Table& swing() {
  static const Registry all = [] {
    Registry r;
    load_plugin(CARDAN_BINARY_DIR "/plugins/acme_swing.so", r);
    return r;
  }();
  return *all.body("acme/swing");
}
TEST(BodyLaws, LetABodyWhoseNodesMoveAlongCurvesPass) {
  LawRecord record;
  for (const auto& v : body_law_violations(
           swing(), 240, 3, [](std::string_view) {}, &record))
    ADD_FAILURE() << v;
  for (const TriedLaw& law : record)
    if (law.law.starts_with("S is") || law.law.starts_with("a is")) {
      EXPECT_GT(law.trials, 100u) << law.law;
    }
}

class BodyContract : public testing::TestWithParam<std::string> {};

TEST_P(BodyContract, ObeysEveryLaw) {
  for (const auto& v : body_law_violations(*registry().body(GetParam()), 120, 7)) ADD_FAILURE() << GetParam() << ": " << v;
}
INSTANTIATE_TEST_SUITE_P(Registry, BodyContract, testing::ValuesIn(registry().bodies.types()),
                         [](const auto& tested) { return tested.param; });

/// A cuboid: its mass is computed.
int cuboid(const cardan_param_values* values, double* mass, double com[3], double inertia[6]) {
  const double* s = values->numbers(values, "size", nullptr);
  *mass = 2700.0 * s[0] * s[1] * s[2];
  std::fill_n(com, 3, 0.0), std::fill_n(inertia, 6, 0.0);
  for (int i = 0; i < 3; ++i) inertia[i] = *mass / 12.0 * (s[0] * s[0] + s[1] * s[1] + s[2] * s[2] - s[i] * s[i]);
  return 0;
}
Table box() {
  static constexpr cardan_param_desc schema[] = {
      param::in_range(param::required("size", CARDAN_VECTOR, "m", "edges"), 0, INFINITY, CARDAN_ABOVE)};
  Table t{};
  t.struct_size = sizeof t, t.type = "test/box", t.summary = "cuboid", t.mass_source = CARDAN_MASS_COMPUTED;
  t.n_params = 1, t.param_size = sizeof schema[0], t.params = schema;
  t.rigid = cuboid;
  return t;
}

TEST(BodyLaws, LetABodyWithAComputedMassPass) {
  for (const auto& v : body_law_violations(box(), 100)) ADD_FAILURE() << v;
}

struct Mutant {
  std::string name, law;         // the law that must be named
  std::function<Table()> table;  // made in its own test: each is a process, and a plugin is tried as it is loaded
  bool alone = false;            // and no other
};

// A function of C that does what modal_flexible does, then changes the result. `m` is the number of modes: the first word of its packed
// parameters.
#define CHANGED_MASS(...)                                                                           \
  [](const void* p, [[maybe_unused]] const double* eta, double* M_rr, double* M_re, double* M_ee) { \
    modal().mass(p, eta, M_rr, M_re, M_ee);                                                         \
    [[maybe_unused]] const std::uint32_t m = *static_cast<const std::uint32_t*>(p);                 \
    __VA_ARGS__                                                                                     \
  }
#define CHANGED_BIAS(...)                                                                      \
  [](const void* p, const double* eta, const double* etadot, const double* omega, double* b) { \
    modal().bias(p, eta, etadot, omega, b);                                                    \
    [[maybe_unused]] const std::uint32_t m = *static_cast<const std::uint32_t*>(p);            \
    __VA_ARGS__                                                                                \
  }

template <class Base, class Change>
Mutant mutant(const std::string& name, const std::string& law, Base* base, const Change& change, bool alone = false) {
  const auto table = [base, change] {
    Table out = base();
    change(out);
    return out;
  };
  return {name, law, table, alone};
}

std::vector<Mutant> mutants() {
  std::vector<Mutant> all;
  const auto add = [&](auto&&... arguments) { all.push_back(mutant(arguments...)); };
  const auto of_mass = [&](const char* name, const char* law, auto mass, bool alone = false) {
    all.push_back(mutant(
        name, law, modal, [=](Table& t) { t.mass = mass, t.states = nullptr; }, alone));
  };
  const auto of_bias = [&](const char* name, const char* law, auto bias, bool alone = true) {
    all.push_back(mutant(
        name, law, modal, [=](Table& t) { t.bias = bias, t.states = nullptr; }, alone));
  };
  of_mass("NoNumberInTheMass", "mass and bias are finite", CHANGED_MASS(if (M_ee && eta[0] > 0.5) M_ee[0] = NAN;));
  of_bias("NoNumberInTheBias", "mass and bias are finite", CHANGED_BIAS(if (eta[0] > 0.5) b[2] = NAN;));
  of_mass("AMassThatRemembers", "mass is the same again, and in another thread",
          CHANGED_MASS(static int calls = 0; if (M_rr) M_rr[4] += 1e-15 * ++calls;));
  of_bias("ABiasThatRemembers", "bias is the same again, and in another thread",
          CHANGED_BIAS(static int calls = 0; b[0] += 1e-14 * ++calls;), false);
  of_bias(
      "ABiasOfItsThread", "bias is the same again, and in another thread",
      CHANGED_BIAS(static const std::thread::id here = std::this_thread::get_id(); if (here != std::this_thread::get_id()) b[0] += 1e-12;));
  of_bias("ABiasThatKnowsAPlace", "mass and bias do not depend on where the packed parameters stand",
          CHANGED_BIAS(b[0] += 1e-13 * static_cast<double>(reinterpret_cast<std::uintptr_t>(p) / 16 % 1024);));
  of_mass("APartThatIsAnotherAlone", "mass gives the same part by part", CHANGED_MASS(if (!M_rr && M_re) M_re[0] += 1e-9;), true);
  of_mass("AnotherMass", "the mass is that of the modal data", CHANGED_MASS(if (M_rr) M_rr[0] *= 1 + 1e-9;));
  of_mass("ASkewMassOfTheModes", "M_ee is symmetric", CHANGED_MASS(if (M_ee && m > 1) M_ee[1] += 1e-9;));
  of_mass("ANegativeMassOfAMode", "the mass matrix is positive definite", CHANGED_MASS(if (M_ee) M_ee[0] -= 1e3;), true);
  of_mass("ADriftOfTheMassCentre", "M_ve is the derivative of m c along eta", CHANGED_MASS(if (M_rr) M_rr[1] += 1e-6 * eta[0];));
  of_bias("AMomentTooMuch", "b_w is what the kinetic energy gives", CHANGED_BIAS(b[1] += 1e-6 * omega[0] * omega[0];));
  of_bias("AForceTooMuch", "b_v is what the kinetic energy gives", CHANGED_BIAS(b[4] += 1e-6 * etadot[0];));
  of_bias("HalfTheCentrifugalForceOfAMode", "b_e is what the kinetic energy gives", CHANGED_BIAS(b[5 + m] *= 0.5;));
#define CHANGED_STATES(...)                                                                                                    \
  [](const void* p, std::uint32_t n, const double* eta, const double* etadot, const double* omega, double* M_rr, double* M_re, \
     double* M_ee, double* b) {                                                                                                \
    modal().states(p, n, eta, etadot, omega, M_rr, M_re, M_ee, b);                                                             \
    [[maybe_unused]] const std::uint32_t m = *static_cast<const std::uint32_t*>(p);                                            \
    __VA_ARGS__                                                                                                                \
  }
  const auto of_states = [&](const char* name, const char* law, auto states) {
    all.push_back(mutant(
        name, law, modal, [=](Table& t) { t.states = states; }, true));
  };
  const char* const each = "states gives each state what mass and bias give it";
  of_states("AStateBesideItsPlace", each, CHANGED_STATES(std::swap(b[n * (5 + m)], b[n * (5 + m) + 1]);));
  of_states("TheLastStateOfAnother", each, CHANGED_STATES(M_rr[9 * n + n - 1] = M_rr[9 * n];));
  of_states("CouplingsOfTheFirstStateAlone", each, CHANGED_STATES(for (std::uint32_t l = 1; l < n; ++l) M_re[l] = M_re[0];));
  of_states("AStateTooMany", "states writes beyond what it is handed", CHANGED_STATES(M_ee[m * m * n] = 0;));
  const auto says = [](auto fact) { return [fact](Table& t) { t.facts = fact; }; };
  add("AFactOfTheModes", "the fact is true: m_ee_constant", modal, says([](const void*, cardan_body_facts* f) { f->m_ee_constant = 1; }),
      true);
  add("AFactOfTheCoupling", "the fact is true: m_re_constant", modal, says([](const void*, cardan_body_facts* f) { f->m_re_constant = 1; }),
      true);
  add("AFactOfTheInertia", "the fact is true: j_constant", modal, says([](const void*, cardan_body_facts* f) { f->j_constant = 1; }), true);
  of_mass("ANumberTooMany", "mass writes beyond what it is handed", CHANGED_MASS(if (M_ee) M_ee[m * m] = 0;), true);
  of_bias("ABiasTooLong", "bias writes beyond what it is handed", CHANGED_BIAS(b[6 + m] = 0;));
  add("APackThatWritesTooMuch", "pack writes", modal, [](Table& t) {
    t.packed_size = [](const cardan_param_values* p, const cardan_modal_view* v) { return modal().packed_size(p, v) - 8; };
  });
  add("ASizeWithoutMeasure", "packed_size is", modal,
      [](Table& t) { t.packed_size = [](const cardan_param_values*, const cardan_modal_view*) { return ~std::uint64_t{0}; }; });
  add(
      "NoModesWillDo", "pack refuses every set of random parameters and modes", modal,
      [](Table& t) { t.pack = [](const cardan_param_values*, const cardan_modal_view*, void*) { return 1; }; }, true);

#define CHANGED_NODE(...)                                                                                                             \
  [](const void* p, std::uint32_t i, const double* eta, const double* etadot, [[maybe_unused]] double* x, [[maybe_unused]] double* S, \
     [[maybe_unused]] double* a) {                                                                                                    \
    swing().node(p, i, eta, etadot, x, S, a);                                                                                         \
    __VA_ARGS__                                                                                                                       \
  }
  const auto of_node = [&](const char* name, const char* law, auto node, bool alone = true) {
    all.push_back(mutant(
        name, law, swing, [=](Table& t) { t.node = node; }, alone));
  };
  of_node("NoNumberInTheMotion", "the motion of nodes is finite", CHANGED_NODE(if (x && eta[0] > 0.5) x[0] = NAN;));
  of_node("ANodeThatRemembers", "node is the same again, and in another thread",
          CHANGED_NODE(static int calls = 0; if (a) a[3] += 1e-14 * ++calls;), false);
  of_node("ANodeOfItsThread", "node is the same again, and in another thread",
          CHANGED_NODE(static const std::thread::id here = std::this_thread::get_id();
                       if (a && here != std::this_thread::get_id()) a[0] += 1e-12;));
  of_node("ANodeThatKnowsAPlace", "node does not depend on where the packed parameters stand",
          CHANGED_NODE(if (a) a[0] += 1e-13 * static_cast<double>(reinterpret_cast<std::uintptr_t>(p) / 16 % 1024);), false);
  of_node("APartOfTheMotionThatIsAnotherAlone", "node gives the same part by part", CHANGED_NODE(if (!x && S) S[0] += 1e-9;));
  of_node("ANodeThatStartsElsewhere", "nodes have not moved at eta = 0", CHANGED_NODE(if (x) x[4] += 1e-9;));
  of_node("ShapesOfTheOtherSign", "S is the derivative of x along eta", CHANGED_NODE(for (int r = 3; S && r < 6; ++r) S[r] *= -1;), false);
  of_node("ShapesThatAreHalf", "S is the derivative of x along eta", CHANGED_NODE(for (int r = 0; S && r < 3; ++r) S[r] *= 0.5;));
  of_node("NoCurvature", "a is the derivative of S along eta'", CHANGED_NODE(for (int r = 0; a && r < 6; ++r) a[r] = 0;));
  of_node("HalfACurvature", "a is the derivative of S along eta'", CHANGED_NODE(for (int r = 0; a && r < 6; ++r) a[r] *= 0.5;));
  of_node("AMotionTooLong", "node writes beyond what it is handed", CHANGED_NODE(if (S) S[6] = 0;));

  const auto of_rigid = [&](const char* name, const char* law, auto rigid, bool alone = true) {
    all.push_back(mutant(
        name, law, box, [=](Table& t) { t.rigid = rigid; }, alone));
  };
#define CHANGED_RIGID(...)                                                                                 \
  [](const cardan_param_values* values, double* mass, [[maybe_unused]] double com[3], double inertia[6]) { \
    const int done = cuboid(values, mass, com, inertia);                                                   \
    __VA_ARGS__                                                                                            \
    return done;                                                                                           \
  }
  of_rigid("AMassThatIsNone", "the mass is a number > 0", CHANGED_RIGID(*mass = -*mass;));
  of_rigid("ACentreThatIsNoNumber", "mass centre and inertia are finite", CHANGED_RIGID(com[0] = NAN;));
  of_rigid("AnInertiaOfNoBody", "principal moments are > 0 and satisfy the triangle inequality", CHANGED_RIGID(inertia[0] *= 9;));
  of_rigid("AMassThatGrows", "rigid is a function of its arguments", CHANGED_RIGID(static int calls = 0; *mass *= 1 + 1e-6 * ++calls;));
  of_rigid("NoParameterWillDo", "rigid refuses every set of random parameters",
           [](const cardan_param_values*, double*, double*, double*) { return 1; });
  of_rigid("AnInertiaTooLong", "rigid writes beyond what it is handed", CHANGED_RIGID(inertia[6] = 0;));
  return all;
}

class BodyMutant : public testing::TestWithParam<Mutant> {};

TEST_P(BodyMutant, IsRefusedByItsLaw) {
  const auto violations = body_law_violations(GetParam().table());
  const auto of_law = std::count_if(violations.begin(), violations.end(), [](const std::string& v) { return v.find(GetParam().law) == 0; });
  EXPECT_GT(of_law, 0) << (violations.empty() ? "nothing" : violations.front());
  for (const std::string& v : violations) EXPECT_TRUE(!GetParam().alone || v.find(GetParam().law) == 0) << v;
}
INSTANTIATE_TEST_SUITE_P(Laws, BodyMutant, testing::ValuesIn(mutants()), [](const auto& m) { return m.param.name; });

TEST(BodyTables, AreLookedAtBeforeTheyAreUsed) {
  const auto starts = [](const std::string& expected, Table t, const auto& change) {
    change(t);
    const auto found = body_law_violations(t);
    const std::string first = found.empty() ? "nothing" : found.front();
    EXPECT_EQ(first.substr(0, expected.size()), expected) << first;
  };
  starts("type: null", modal(), [](Table& t) { t.type = nullptr; });
  starts("summary: null", modal(), [](Table& t) { t.summary = nullptr; });
  starts("mass_source: 4,", modal(), [](Table& t) { t.mass_source = 4; });
  starts("packed_size: null", modal(), [](Table& t) { t.packed_size = nullptr; });
  starts("pack: null", modal(), [](Table& t) { t.pack = nullptr; });
  starts("mass: null", modal(), [](Table& t) { t.mass = nullptr; });
  starts("bias: null", modal(), [](Table& t) { t.bias = nullptr; });
  starts("rigid: null", box(), [](Table& t) { t.rigid = nullptr; });
  starts("params: null", box(), [](Table& t) { t.params = nullptr; });
}

}  // namespace
}  // namespace cardan
