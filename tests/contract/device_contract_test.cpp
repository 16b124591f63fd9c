// The laws of devices over everything that comes with Cardan; and for each law a device that breaks it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <thread>

#include "core/abi/device_family.hpp"
#include "core/abi/device_laws.hpp"
#include "plugins/devices/register.hpp"

namespace cardan {
namespace {

const Registry& registry() {
  static const Registry all = [] {
    Registry r;
    register_devices(r);
    return r;
  }();
  return all;
}
std::vector<std::string> types() { return registry().devices.types(); }

class DeviceContract : public testing::TestWithParam<std::string> {};
TEST_P(DeviceContract, ObeysEveryLaw) {
  for (const auto& v : device_law_violations(*registry().device(GetParam()), 60, 7)) ADD_FAILURE() << GetParam() << ": " << v;
}
INSTANTIATE_TEST_SUITE_P(Registry, DeviceContract, testing::ValuesIn(types()), [](const auto& tested) { return tested.param; });

/// A spring between two nodes with a bent state and an input, in plain C: what a mutant changes.
using Table = cardan_device_family;
using Args = const cardan_device_args*;
using Out = cardan_device_out*;

constexpr unsigned kUse = CARDAN_USE_POSE | CARDAN_USE_VELOCITY | CARDAN_USE_LOAD;
const cardan_mount_desc kMounts[] = {{"from", CARDAN_MOUNT_NODE, kUse, "a node"},
                                     {"to", CARDAN_MOUNT_NODE, kUse, "a node"},
                                     {"at", CARDAN_MOUNT_HINGE, CARDAN_USE_LOAD, "a component"},
                                     {"by", CARDAN_MOUNT_NODE, 0, "a node that nobody reads"}};
const cardan_port_desc kPorts[] = {{"x", CARDAN_PORT_IN, "1", 0.0, 0, "input"},
                                   {"y", CARDAN_PORT_OUT, "1", 0.0, 1, "follows from x"},
                                   {"s", CARDAN_PORT_OUT, "1", 0.0, 0, "does not"}};
const cardan_state_desc kStates[] = {{"s", "1", 0.0, 1.0, "state"}};
const cardan_state_desc kMarks[] = {{"on", "1", 1.0, 1.0, "mark"}};

/// World force k (p_to - p_from) on `from`; a spring q / 2 with damping at the hinge; s' = -s.
int good(Args a, Out o) {
  for (int i = 0; i < 3; ++i) {
    const double pull = a->mount[1].position[i] - a->mount[0].position[i];
    for (int j = 0; j < 3; ++j)
      for (int m = 0; m < 2; ++m) o->load[m].force[j] += (m == 0 ? pull : -pull) * a->mount[m].R_WN[3 * i + j];
  }
  o->load[2].tau = -0.5 * a->mount[2].q - 0.3 * a->mount[2].v;
  o->zdot[0] = -a->z[0];
  o->out[0] = 2.0 * a->in[0] + a->z[0];
  o->out[1] = a->d[0] * a->z[0];
  o->lost = 0.3 * a->mount[2].v * a->mount[2].v + a->z[0] * a->z[0];
  return 0;
}
double energy(Args a) {
  double sum = 0.25 * a->mount[2].q * a->mount[2].q + 0.5 * a->z[0] * a->z[0];
  for (int i = 0; i < 3; ++i) sum += 0.5 * std::pow(a->mount[1].position[i] - a->mount[0].position[i], 2);
  return sum;
}
Table table() {
  Table t{};
  t.struct_size = sizeof t;
  t.type = "test/spring", t.summary = "";
  t.facts = CARDAN_FACT_INTERNAL | CARDAN_FACT_ENERGY | CARDAN_FACT_PASSIVE;
  t.mounts = kMounts, t.n_mounts = 4;
  t.ports = kPorts, t.n_ports = 3;
  t.states = kStates, t.n_states = 1;
  t.marks = kMarks, t.n_marks = 1;
  t.evaluate = good;
  t.energy = energy;
  return t;
}
std::string violations(const Table& t) {
  std::string all;
  for (const std::string& v : device_law_violations(t, 20)) all += v + "\n";
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
#define CHANGED(...)                 \
  changed([](Table& t) {             \
    t.evaluate = [](Args a, Out o) { \
      const int code = good(a, o);   \
      __VA_ARGS__;                   \
      return code;                   \
    };                               \
  })

TEST(DeviceMutants, TheOneTheyComeFromObeys) { EXPECT_EQ(violations(table()), ""); }

/// Rounding of what is stored, beside powers of a microwatt: it was compared as if it were a part of them.
TEST(DeviceMutants, OneThatStoresMuchAndPushesWeaklyObeys) {
  const Table weak = changed([](Table& t) {
    t.evaluate = [](Args a, Out o) {
      good(a, o);
      for (int m = 0; m < 3; ++m) {
        for (double& f : o->load[m].force) f *= 1e-6;
        o->load[m].tau *= 1e-6;
      }
      o->lost *= 1e-6;
      return 0;
    };
    t.energy = [](Args a) { return 1e5 + 1e-6 * energy(a); };
  });
  EXPECT_EQ(violations(weak), "");
}

TEST(DeviceMutants, AreCaughtByTheirLaw) {
  expect(CHANGED(static double before = 0.0; o->out[0] += before; before = 1.0 + a->in[0]), "function of its arguments: other numbers");
  expect(CHANGED(thread_local int calls = 0; o->out[0] += 1.0 / ++calls), "function of its arguments");
  expect(CHANGED(const_cast<double*>(a->z)[0] = 3.0), "changes its arguments");
  expect(CHANGED(o->zdot[1] = 3.0), "beyond its arrays");
  expect(CHANGED(o->load[4].tau = 3.0), "beyond its arrays");
  expect(CHANGED(o->out[0] = std::sqrt(-1.0 - a->in[0] * a->in[0])), "nan for finite arguments (output y");
  expect(CHANGED(const double v = a->mount[2].v; o->load[2].tau *= v / v), "nan where nothing moves (tau of mount at)");
  expect(CHANGED(const double x = a->in[0]; o->out[0] = 2.0 * x * x / x + a->z[0]), "nan where nothing moves (output y)");
  expect(CHANGED(o->out[0] += a->mount[3].omega[1]), "mount by reads pose or velocity");
  expect(CHANGED(o->out[0] += a->mount[0].q), "mount from is a node");
  expect(CHANGED(o->out[0] += a->mount[2].position[0]), "mount at is a hinge component");
  expect(CHANGED(o->out[1] += 0.1 * a->in[0]), "output s depends on input no. 0");
  expect(CHANGED(o->load[2].force[0] = 1.0), "force of mount at and does not say so");
  expect(CHANGED(o->load[0].tau = 1.0), "tau of mount from and does not say so");
  expect(CHANGED(o->load[0].moment[0] += 0.01), "sum to zero");
  expect(CHANGED(o->load[2].tau *= 1.01), "energy' = delivered - lost");
  expect(changed([](Table& t) {  // as long as it has not ticked it pushes with nothing
           t.tick = [](Args, double, const double*, double*, double* d) { return d[0] += 1.0, 0; };
           t.evaluate = [](Args a, Out o) { return good(a, o), o->load[2].tau += a->d[0] - 1.0, 0; };
         }),
         "energy' = delivered - lost");
  expect(CHANGED(o->load[0].force[1] *= 1.01), "sum to zero");
  expect(CHANGED(o->out[0] += a->mount[1].position[2]), "reads what lies between its nodes");
  expect(CHANGED(for (int i = 0; i < 3; ++i) o->out[0] += a->mount[0].R_WN[3 + i] * a->mount[0].velocity[i]),
         "reads what lies between its nodes");
  expect(CHANGED(o->delivered = 0.1; o->lost += 0.1), "delivers nothing");
  expect(CHANGED(o->load[2].tau += 0.6 * a->mount[2].v; o->lost -= 0.6 * a->mount[2].v * a->mount[2].v + 5.0 * a->z[0] * a->z[0];
                 o->zdot[0] += 5.0 * a->z[0]),
         "a passive device loses");
  expect(changed([](Table& t) { t.tangent = [](Args, Args d, Out o) { return o->out[0] = 2.1 * d->in[0], 0; }; }),
         "tangent is the derivative");
  expect(changed([](Table& t) {
           t.n_roots = 1;
           t.roots = [](Args, double* g) { g[0] = std::nan(""); };
         }),
         "root no. 0 is nan");
  expect(changed([](Table& t) {
           t.n_roots = 1;
           t.roots = [](Args, double* g) { g[0] = 1.0, g[1] = 2.0; };
         }),
         "roots writes beyond");
  expect(changed([](Table& t) { t.evaluate = [](Args, Out) { return 1; }; }), "refuses every random point");
  expect(changed([](Table& t) {
           t.pack = [](const cardan_param_values*, void* p) { return std::fill_n(static_cast<char*>(p), 9, 'x'), 0; };
           t.params_size = 8;
         }),
         "pack writes 9 bytes, 8");
  expect(changed([](Table& t) { t.nominal = [](const void*, double* sizes) { sizes[0] = -1.0; }; }), "nominal gives -1");
  expect(changed([](Table& t) { t.nominal = [](const void*, double* sizes) { sizes[1] = 1.0; }; }), "nominal writes beyond its array");
  expect(CHANGED(o->out[0] += a->mount[0].alpha[1]), "evaluate reads an acceleration at mount from");
  expect(CHANGED(o->out[0] += a->mount[0].specific_force[2]), "evaluate reads an acceleration at mount from");
  expect(CHANGED(o->out[0] += a->mount[1].field[0]), "mount to is no field");
  expect(CHANGED(o->out[0] += a->mount[2].field[3]), "mount at is no field");
  expect(changed([](Table& t) { t.tangent = [](Args, Args, Out o) { return o->zdot[1] = 3.0, 1; }; }), "tangent writes beyond its arrays");
  expect(changed([](Table& t) {
           t.pack = [](const cardan_param_values*, void* p) { return *static_cast<double*>(p) = 2.0, 0; };
           t.params_size = 8;
           t.evaluate = [](Args a, Out o) { return *static_cast<double*>(const_cast<void*>(a->packed)) += 1.0, good(a, o); };
         }),
         "evaluate changes its arguments");
  const std::string there = violations(
      CHANGED(static const std::thread::id first = std::this_thread::get_id(); if (std::this_thread::get_id() != first) o->out[0] += 1.0));
  EXPECT_NE(there.find("evaluate is a function of its arguments: other numbers on another thread"), std::string::npos) << there;
  EXPECT_EQ(there.find("at the second call"), std::string::npos) << there;
}

/// A damper by three numbers that are not negative, or by a table in their place, not both; what it loses is `lost` of it.
template <int lost>
struct Damper {
  static constexpr const char* type = "test/damper";
  static constexpr const char* summary = "";
  static constexpr unsigned facts = CARDAN_FACT_ENERGY | CARDAN_FACT_PASSIVE;
  static constexpr unsigned role = CARDAN_ROLE_FORCE;
  struct Packed {
    double c;
  };
  static constexpr const char* columns[] = {"c"};
  static constexpr cardan_param_desc schema[] = {param::not_negative(param::optional("damping", CARDAN_VECTOR, "1", "")),
                                                 param::named(param::optional("table", CARDAN_TABLE, "1", ""), columns)};
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_HINGE, CARDAN_USE_LOAD, "a component"}};
  static bool pack(const Params& params, Packed& p) {
    const Eigen::Vector3d damping = params.vector("damping");
    p.c = damping.x();
    return params.table("table", 1).cols() == 0 || (damping.isZero(0.0) ? params.fail("table", "none") : params.fail("table", "not both"));
  }
  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.load[0].tau = T(-p.c) * in.at[0].v;
    out.lost = T(lost * p.c) * in.at[0].v * in.at[0].v;
  }
  static double energy(const Packed&, const DeviceIn<double>&) noexcept { return 0.0; }
};

/// What a table excludes is tried without it, and a vector within its range alone.
TEST(DeviceMutants, AreTriedWithEveryParameterOfTheirs) {
  EXPECT_EQ(violations(device_table<Damper<1>>()), "");
  expect(device_table<Damper<2>>(), "energy' = delivered - lost - power of the loads");
}

/// Of a field: the numbers of its quantity, and nothing of the motion, which is that of the node before it.
TEST(DeviceMutants, ThatReadAFieldWronglyAreCaught) {
  static const cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_LOAD, "a node"},
                                             {"earth", CARDAN_MOUNT_FIELD, CARDAN_MAGNETIC, "a magnetic field"}};
  Table t{};
  t.struct_size = sizeof t;
  t.type = "test/needle", t.summary = "";
  t.mounts = mounts, t.n_mounts = 2;
  t.evaluate = [](Args a, Out o) { return o->load[0].moment[0] = a->mount[1].field[1], 0; };
  EXPECT_EQ(violations(t), "");
  t.evaluate = [](Args a, Out o) { return o->load[0].moment[0] = a->mount[1].position[1], 0; };
  expect(t, "mount earth is a field: it has the numbers of its quantity alone");
  t.evaluate = [](Args a, Out o) { return o->load[1].moment[0] = a->mount[1].field[1], 0; };
  expect(t, "moment of mount earth and does not say so");
}

/// What a function gives that remembers its calls, that looks at its thread, or that writes where it reads.
template <class Put>
void expect_pure(const char* name, const Put& put) {
  Table t = table();
  t.n_roots = 1, t.roots = [](Args, double* g) { g[0] = 1.0; };
  t.momentum = [](Args, double(*)[3]) {};
  t.event = [](Args, std::uint32_t, int, double*, double*) {};
  t.tick = [](Args, double, const double*, double*, double*) { return 0; };
  t.facts = CARDAN_FACT_ENERGY;
  put(t, [](Args) { return 0.0; });
  const std::string wrong = fmt::format("{} is a function of its arguments: other numbers ", name);
  EXPECT_EQ(violations(t).find(wrong), std::string::npos) << violations(t);
  EXPECT_EQ(violations(t).find(fmt::format("{} changes its arguments", name)), std::string::npos) << violations(t);
  put(t, [](Args) {
    static double calls = 0.0;
    return calls += 1e-6;
  });
  expect(t, wrong + "at the second call");
  put(t, [](Args) {
    static const std::thread::id first = std::this_thread::get_id();
    return std::this_thread::get_id() == first ? 0.0 : 1e-6;
  });
  expect(t, wrong + "on another thread");
  EXPECT_EQ(violations(t).find("at the second call"), std::string::npos) << name << ":\n" << violations(t);
  put(t, [](Args a) { return const_cast<double*>(a->z)[0] = 3.0, 0.0; });
  expect(t, fmt::format("{} changes its arguments", name));
}

/// A C function around `added`, which captures nothing.
#define PUTS(member, ...) [](Table& t, auto added) { t.member = __VA_ARGS__; }

TEST(DeviceMutants, ThatRememberAreCaughtInEveryFunction) {
  expect_pure("energy", PUTS(energy, [](Args a) { return energy(a) + decltype(added){}(a); }));
  expect_pure("momentum", PUTS(momentum, [](Args a, double(*h)[3]) { h[0][1] = decltype(added){}(a); }));
  expect_pure("roots", PUTS(roots, [](Args a, double* g) { g[0] = 1.0 + decltype(added){}(a); }));
  expect_pure("event", PUTS(event, [](Args a, std::uint32_t, int, double*, double* d) { d[0] += decltype(added){}(a); }));
  expect_pure("impulse", [](Table& t, auto added) {
    t.momentum = nullptr;
    t.impulse = [](Args a, std::uint32_t, int, cardan_mount_load* l) { return l[2].tau = 1.0 + decltype(added){}(a), 0; };
  });
  expect_pure("tick", PUTS(tick, [](Args a, double, const double*, double* z, double*) { return z[0] += decltype(added){}(a), 0; }));
}

TEST(DeviceMutants, ThatWriteBeyondWhatTheyAreGivenAtAnInstantAreCaught) {
  expect(changed([](Table& t) { t.tick = [](Args, double, const double*, double* z, double*) { return z[1] = 1.0, 0; }; }),
         "tick writes beyond its arrays");
  expect(changed([](Table& t) { t.tick = [](Args, double, const double*, double*, double* d) { return d[0] = std::nan(""), 0; }; }),
         "tick sets a number that is not finite");
  expect(changed([](Table& t) { t.event = [](Args, std::uint32_t, int, double*, double* d) { d[1] = 1.0; }; }),
         "event writes beyond its arrays");
  expect(changed([](Table& t) { t.event = [](Args, std::uint32_t, int, double* z, double*) { z[0] = HUGE_VAL; }; }),
         "event sets a number that is not finite");
  expect(changed([](Table& t) { t.momentum = [](Args, double(*h)[3]) { h[4][0] = 1.0; }; }), "momentum writes beyond its array");
}

TEST(DeviceMutants, ThatStrikeWronglyAreCaught) {
  const auto with = [](auto impulse) {
    return changed([&](Table& t) {
      t.tick = [](Args, double, const double*, double*, double*) { return 0; };
      t.impulse = impulse;
    });
  };
  EXPECT_EQ(violations(with([](Args a, std::uint32_t, int, cardan_mount_load* l) { return l[2].tau = a->mount[2].v, 0; })), "");
  expect(with([](Args, std::uint32_t, int, cardan_mount_load* l) { return l[4].tau = 1.0, 0; }), "impulse writes beyond its array");
  expect(with([](Args, std::uint32_t, int, cardan_mount_load* l) { return l[2].tau = std::nan(""), 0; }),
         "impulse gives nan for finite arguments (tau of mount at)");
  expect(with([](Args, std::uint32_t, int, cardan_mount_load* l) { return l[3].force[0] = 1.0, 0; }),
         "force of mount by and does not say so");
  expect(with([](Args, std::uint32_t, int, cardan_mount_load* l) { return l[0].force[0] = 1.0, 0; }), "sum to zero");
  Table never = with([](Args, std::uint32_t, int, cardan_mount_load*) { return 0; });
  never.tick = nullptr;
  expect(never, "impulse: given, and there is neither a tick nor an event at a root");
  expect(changed([](Table& t) {
           static const cardan_mount_desc none[] = {{"at", CARDAN_MOUNT_HINGE, 0, "a component"}};
           t.mounts = none, t.n_mounts = 1;
           t.tick = [](Args, double, const double*, double*, double*) { return 0; };
           t.impulse = [](Args, std::uint32_t, int, cardan_mount_load*) { return 0; };
         }),
         "impulse: given, and no mount has CARDAN_USE_IMPULSE or CARDAN_USE_LOAD");
  static const cardan_mount_desc at_once[] = {{"at", CARDAN_MOUNT_HINGE, CARDAN_USE_IMPULSE, "a component"}};
  expect(changed([](Table& t) { t.mounts = at_once, t.n_mounts = 1; }), "impulse: null, and a mount has CARDAN_USE_IMPULSE");
}

TEST(DeviceMutants, ThatSayWronglyWhetherTheirOutputsHoldAreCaught) {
  const auto with = [](std::initializer_list<cardan_port_desc> ports, double says) {
    static std::vector<std::vector<cardan_port_desc>> all;  // a table keeps pointers
    all.emplace_back(ports);
    Table t{};
    t.struct_size = sizeof t;
    t.type = "test/gauge", t.summary = "";
    t.ports = all.back().data(), t.n_ports = static_cast<std::uint32_t>(ports.size());
    t.states = kStates, t.n_states = 1;
    if (says == 1.0) t.evaluate = [](Args a, Out o) { return o->out[0] = a->z[0], o->out[1] = 1.0, 0; };
    if (says != 1.0) t.evaluate = [](Args a, Out o) { return o->out[0] = a->z[0], o->out[1] = 0.5, 0; };
    return t;
  };
  const cardan_port_desc x{"x", CARDAN_PORT_OUT, "m", 0.0, 0, "a number", nullptr, 0, "good"};
  const cardan_port_desc good{"good", CARDAN_PORT_OUT, "1", 0.0, 0, "whether it holds"};
  EXPECT_EQ(violations(with({x, good}, 1.0)), "");
  expect(with({x, good}, 0.5), "output good is 0.5");
  const auto but = [](cardan_port_desc p, const auto& change) {
    change(p);
    return p;
  };
  const std::string another = "expected another port of its kind, in unit 1, always valid itself";
  expect(with({x, but(good, [](auto& p) { p.name = "other"; })}, 1.0), "ports[0].valid: \"good\", " + another);
  expect(with({x, but(good, [](auto& p) { p.unit = "m"; })}, 1.0), another);
  expect(with({x, but(good, [](auto& p) { p.kind = CARDAN_PORT_IN; })}, 1.0), another);
  expect(with({x, but(good, [](auto& p) { p.valid = "x"; })}, 1.0), another);
  const auto in = [](cardan_port_desc& p) { p.kind = CARDAN_PORT_IN; };
  expect(
      with({but(x, in), but(good, in), but(x, [](auto& p) { p.name = "y", p.valid = nullptr; }), but(good, [](auto& p) { p.name = "z"; })},
           1.0),
      "\"good\" has the fallback 0, expected 1: what is not connected holds");
}

const cardan_mount_desc kBody[] = {{"at", CARDAN_MOUNT_MASS, CARDAN_USE_VELOCITY | CARDAN_USE_LOAD, "a body"}};
const cardan_port_desc kDrawn[] = {{"flow", CARDAN_PORT_IN, "kg/s", 0.0, 0, "drawn"}, {"noise", CARDAN_PORT_IN, "1", 0.0, 0, "not"}};

/// A mass 2 s at (1, s, 0) that falls as it is drawn, and a spin of 3 N m s along x of the node.
Table carrier() {
  Table t{};
  t.struct_size = sizeof t;
  t.type = "test/carrier", t.summary = "";
  t.mounts = kBody, t.n_mounts = 1;
  t.ports = kDrawn, t.n_ports = 2;
  t.states = kStates, t.n_states = 1;
  t.evaluate = [](Args a, Out o) {
    const double* w = a->mount[0].omega;
    o->zdot[0] = -0.5 * a->in[0];
    o->load[0].moment[1] = -3.0 * w[2], o->load[0].moment[2] = 3.0 * w[1];
    return 0;
  };
  t.mass = [](Args a, cardan_mass* m) { return *m = {2.0 * a->z[0], {1.0, a->z[0], 0.0}, {a->z[0], 1, 1, 0, 0, 0}}, 0; };
  t.mass_tangent = [](Args, const double* dz, cardan_mass* m) { return *m = {2.0 * dz[0], {0.0, dz[0], 0.0}, {dz[0], 0, 0, 0, 0, 0}}, 0; };
  t.momentum = [](Args, double(*h)[3]) { h[0][0] = 3.0, h[0][1] = h[0][2] = 0.0; };
  return t;
}

TEST(DeviceMutants, ThatCarryMassOrStoreMomentumAreCaught) {
  EXPECT_EQ(violations(carrier()), "");
  const auto with = [](const auto& change) {
    Table t = carrier();
    change(t);
    return t;
  };
  expect(with([](Table& t) { t.evaluate = [](Args a, Out o) { return o->zdot[0] = -0.6 * a->in[0], 0; }; }),
         "mass falls by its inputs in kg/s");
  expect(with([](Table& t) {
           t.mass = [](Args a, cardan_mass* m) { return *m = {2.1 * a->z[0], {1.0, a->z[0], 0.0}, {a->z[0], 1, 1, 0, 0, 0}}, 0; };
         }),
         "mass_tangent is the derivative");
  expect(with([](Table& t) { t.mass = [](Args a, cardan_mass* m) {
                               return *m = {2.0 * a->z[0], {std::nan(""), 0.0, 0.0}, {}}, 0;
                             }; }),
         "mass gives a number that is not finite");
  expect(with([](Table& t) {
           t.mass = [](Args a, cardan_mass* m) {
             static double calls = 0.0;
             return *m = {2.0 * a->z[0] + 1e-9 * ++calls, {1.0, a->z[0], 0.0}, {a->z[0], 1, 1, 0, 0, 0}}, 0;
           };
         }),
         "mass is a function of its arguments");
  expect(with([](Table& t) { t.momentum = [](Args, double(*h)[3]) { h[0][0] = 2.9; }; }), "stored momentum changes by minus the moments");
  expect(with([](Table& t) { t.mass = nullptr; }), "mass: null, and a mount is of kind");
  static const cardan_mount_desc twice[] = {kBody[0], {"too", CARDAN_MOUNT_MASS, 0, "a body"}};
  expect(with([](Table& t) { t.mounts = twice, t.n_mounts = 2; }), "more than one mass or outlet");
  static const cardan_mount_desc dry[] = {kBody[0], {"jet", CARDAN_MOUNT_NODE, CARDAN_USE_OUTLET, "a node"}};
  expect(with([](Table& t) { t.mounts = dry, t.n_mounts = 2; }), "CARDAN_USE_OUTLET is of a node, with CARDAN_USE_LOAD");
}

TEST(DeviceMutants, ThatFollowTheMotionAreCaught) {
  const auto with = [](const auto& change) {
    static const cardan_mount_desc node[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_ACCELERATION, "a node"}};
    Table t{};
    t.struct_size = sizeof t;
    t.type = "test/counter", t.summary = "";
    t.mounts = node, t.n_mounts = 1;
    t.states = kStates, t.n_states = 1;
    t.evaluate = [](Args, Out) { return 0; };
    t.follow = [](Args a, double* zdot) { return zdot[0] = a->mount[0].alpha[1] * a->z[0], 0; };
    t.follow_tangent = [](Args a, Args d, double* zdot) {
      return zdot[0] = a->mount[0].alpha[1] * d->z[0] + d->mount[0].alpha[1] * a->z[0], 0;
    };
    change(t);
    return t;
  };
  EXPECT_EQ(violations(with([](Table&) {})), "");
  expect(
      with([](Table& t) { t.follow_tangent = [](Args a, Args d, double* zdot) { return zdot[0] = a->mount[0].alpha[1] * d->z[0], 0; }; }),
      "follow_tangent is the derivative of follow (rate of s)");
  expect(with([](Table& t) { t.follow_tangent = [](Args, Args, double* zdot) { return zdot[0] = 0.0, zdot[1] = 1.0, 0; }; }),
         "follow_tangent writes beyond its array");
  expect(with([](Table& t) { t.follow = [](Args, double* zdot) { return zdot[0] = 0.0, zdot[1] = 1.0, 0; }; }),
         "follow writes beyond its array");
  expect(with([](Table& t) { t.follow = [](Args, double*) { return 0; }; }), "follow gives nan for finite arguments (rate of s");
  expect(with([](Table& t) {
           t.follow = [](Args, double* zdot) {
             static double calls = 0.0;
             return zdot[0] = ++calls, 0;
           };
         }),
         "follow is a function of its arguments");
  expect(with([](Table& t) { t.evaluate = [](Args a, Out o) { return o->zdot[0] = a->z[0], 0; }; }),
         "evaluate gives rates of states, which follow gives");
  static const cardan_mount_desc in_a_field[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_ACCELERATION, "a node"},
                                                 {"field", CARDAN_MOUNT_FIELD, CARDAN_MAGNETIC, "a field"}};
  expect(with([](Table& t) {
           t.mounts = in_a_field, t.n_mounts = 2, t.follow_tangent = nullptr;
           t.follow = [](Args a, double* zdot) { return zdot[0] = a->mount[1].field[0], 0; };
         }),
         "follow reads mount field, a field, of which it has nothing");
  expect(with([](Table& t) { t.n_states = 0; }), "follow: given, and there are no states");
  expect(with([](Table& t) { t.facts = CARDAN_FACT_ENERGY, t.energy = [](Args) { return 0.0; }; }), "follow: given, with energy");
}

TEST(DeviceMutants, ThatHoldAHingeAreCaught) {
  const auto with = [](const auto& change) {
    static const cardan_mount_desc held[] = {{"at", CARDAN_MOUNT_HINGE, CARDAN_USE_LOAD | CARDAN_USE_HOLD, "a component"}};
    Table t{};
    t.struct_size = sizeof t;
    t.type = "test/brake", t.summary = "";
    t.mounts = held, t.n_mounts = 1;
    t.marks = kMarks, t.n_marks = 1;
    t.evaluate = [](Args, Out) { return 0; };
    t.event = [](Args, std::uint32_t, int, double*, double*) {};
    t.holds = [](Args) { return 2.0; };
    change(t);
    return t;
  };
  EXPECT_EQ(violations(with([](Table&) {})), "");
  expect(with([](Table& t) { t.holds = [](Args) { return -1.0; }; }), "holds gives -1");
  expect(with([](Table& t) {
           t.holds = [](Args) {
             static double calls = 0.0;
             return ++calls;
           };
         }),
         "holds is a function of its arguments: other numbers at the second call");
  expect(with([](Table& t) { t.holds = nullptr; }), "holds: null, and a mount has CARDAN_USE_HOLD");
  expect(with([](Table& t) { t.n_marks = 0; }), "CARDAN_USE_HOLD needs `event`, and a mark");
}

TEST(DeviceMutants, TablesThatCannotBeReadAreToldMemberByMember) {
  expect(changed([](Table& t) { t.type = nullptr; }), "type: null");
  expect(changed([](Table& t) { t.evaluate = nullptr; }), "evaluate: null");
  expect(changed([](Table& t) { t.n_ports = 4'000'000'000U; }), "n_ports: 4000000000");
  expect(changed([](Table& t) { t.ports = nullptr; }), "ports: null");
  expect(changed([](Table& t) { t.energy = nullptr; }), "energy: null");
  expect(changed([](Table& t) { t.facts = CARDAN_FACT_PASSIVE; }), "facts: CARDAN_FACT_PASSIVE without");
  expect(changed([](Table& t) { t.n_roots = 1; }), "roots: null");
  static const cardan_mount_desc turning_node[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_POSE | CARDAN_USE_TURN, "a node"}};
  expect(changed([](Table& t) { t.mounts = turning_node, t.n_mounts = 1; }),
         "mounts[0].use: CARDAN_USE_TURN and CARDAN_USE_COORDINATE are of a hinge component");
  static const cardan_state_desc none[] = {{"s", "1", 0.0, 0.0, "state"}};
  expect(changed([](Table& t) { t.states = none; }), "states[0].nominal: 0, expected > 0");
  static const cardan_port_desc twice[] = {
      {"x", CARDAN_PORT_IN, "1", 0.0, 0, ""}, {"x", CARDAN_PORT_OUT, "1", 0.0, 0, ""}, {"", 0, "1", 0.0, 0, ""}};
  expect(changed([](Table& t) { t.ports = twice; }), "ports[1].name: \"x\" twice");
  expect(changed([](Table& t) { t.ports = twice; }), "ports[2].name: a name without spaces");
}

}  // namespace
}  // namespace cardan
