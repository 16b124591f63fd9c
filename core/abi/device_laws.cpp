#include "core/abi/device_laws.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <random>
#include <set>
#include <string_view>

#include "core/abi/field_family.hpp"
#include "core/abi/law_tools.hpp"
#include "core/abi/port_vectors.hpp"

namespace cardan {
namespace {

constexpr std::uint32_t kMost = kMostParameters;  // mounts, ports, states, roots
constexpr int kMotion = sizeof(cardan_mount_motion) / sizeof(double), kLoad = sizeof(cardan_mount_load) / sizeof(double);
constexpr int kPose = 12, kVelocity = 18, kHinge = 20, kRates = 27;  // of cardan_mount_motion: where the numbers of
                                                                     // the pose, the velocity, the hinge, the accelerations end
constexpr std::uint32_t kPushing = CARDAN_USE_LOAD | CARDAN_USE_IMPULSE, kOfHinges = CARDAN_USE_TURN | CARDAN_USE_COORDINATE,
                        kUses = 63u | CARDAN_USE_IMPULSE | kOfHinges;  // of nodes and hinges

/// Of a node.
bool is_read(const cardan_mount_desc& m) { return (m.use & (CARDAN_USE_POSE | CARDAN_USE_VELOCITY)) != 0; }

class DeviceTableFaults : public TableChecks {
 public:
  explicit DeviceTableFaults(const cardan_device_family& family) : f_(family) {}

  std::vector<std::string> all() {
    text("type", f_.type, true);
    text("summary", f_.summary, false);
    parameters(f_.params, f_.n_params);
    list("mounts", f_.mounts, f_.n_mounts);
    list("ports", f_.ports, f_.n_ports);
    list("states", f_.states, f_.n_states);
    list("marks", f_.marks, f_.n_marks);
    expect(f_.evaluate, "evaluate", "null");
    expect(f_.n_params == 0 || f_.pack, "pack", "null, and there are parameters");
    expect(f_.n_noise <= kMost, "n_noise", fmt::format("{}, expected at most {}", f_.n_noise, kMost));
    expect(f_.n_roots <= kMost, "n_roots", fmt::format("{}, expected at most {}", f_.n_roots, kMost));
    expect(f_.n_roots == 0 || f_.roots, "roots", "null, and n_roots is not 0");
    expect(f_.params_size <= kMostBytes, "params_size", fmt::format("{}, expected at most {}", f_.params_size, kMostBytes));
    if (good()) details();
    return take();
  }

 private:
  template <class T>
  void list(const char* member, const T* all, std::uint32_t n) {
    expect(n <= kMost, fmt::format("n_{}", member), fmt::format("{}, expected at most {}", n, kMost));
    expect(n == 0 || all, member, "null");
    std::set<std::string_view> names;
    for (std::uint32_t i = 0; all && n <= kMost && i < n; ++i) {
      text(fmt::format("{}[{}].name", member, i), all[i].name, true);
      text(fmt::format("{}[{}].meaning", member, i), all[i].meaning, false);
      if (good()) expect(names.insert(all[i].name).second, fmt::format("{}[{}].name", member, i), fmt::format("\"{}\" twice", all[i].name));
    }
  }
  void details() {
    const bool energy = (f_.facts & CARDAN_FACT_ENERGY) != 0, internal = (f_.facts & CARDAN_FACT_INTERNAL) != 0;
    int masses = 0, outlets = 0, holds = 0;
    for (std::uint32_t i = 0; i < f_.n_mounts; ++i) {
      const cardan_mount_desc& m = f_.mounts[i];
      const std::string at = fmt::format("mounts[{}].", i);
      expect(m.kind <= CARDAN_MOUNT_FIELD, at + "kind", fmt::format("{}, expected one of cardan_mount_kind", m.kind));
      if (m.kind == CARDAN_MOUNT_FIELD) {
        const std::uint32_t quantity = m.use & ~static_cast<unsigned>(CARDAN_USE_OPTIONAL);
        expect(field_size(quantity) > 0, at + "use", fmt::format("{}, expected one of cardan_quantity", m.use));
        const bool placed = std::any_of(f_.mounts, f_.mounts + i, [](const cardan_mount_desc& b) {
          return b.kind == CARDAN_MOUNT_NODE || b.kind == CARDAN_MOUNT_MASS;
        });
        expect(placed || is_of_time(quantity), at + "kind", "a field at no node: one must stand before it");
        continue;
      }
      expect((m.use & ~kUses) == 0, at + "use", fmt::format("{}, expected those of cardan_mount_use", m.use));
      const bool pushes = m.kind != CARDAN_MOUNT_HINGE && (m.use & CARDAN_USE_LOAD) != 0;
      const bool strikes = m.kind != CARDAN_MOUNT_HINGE && (m.use & kPushing) != 0;
      masses += m.kind == CARDAN_MOUNT_MASS, outlets += (m.use & CARDAN_USE_OUTLET) != 0, holds += (m.use & CARDAN_USE_HOLD) != 0;
      expect((m.use & CARDAN_USE_HOLD) == 0 || (m.kind == CARDAN_MOUNT_HINGE && (m.use & CARDAN_USE_LOAD) != 0), at + "use",
             "CARDAN_USE_HOLD is of a hinge component, with CARDAN_USE_LOAD");
      expect((m.use & kOfHinges) == 0 || m.kind == CARDAN_MOUNT_HINGE, at + "use",
             "CARDAN_USE_TURN and CARDAN_USE_COORDINATE are of a hinge component");
      expect((m.use & CARDAN_USE_OUTLET) == 0 || (m.kind == CARDAN_MOUNT_NODE && pushes), at + "use",
             "CARDAN_USE_OUTLET is of a node, with CARDAN_USE_LOAD");
      expect(!pushes || !energy || (m.use & CARDAN_USE_VELOCITY) != 0, at + "use",
             "CARDAN_FACT_ENERGY needs CARDAN_USE_VELOCITY where it pushes");
      expect(!strikes || !internal || (m.use & CARDAN_USE_POSE) != 0, at + "use",
             "CARDAN_FACT_INTERNAL needs CARDAN_USE_POSE where it pushes: forces at two nodes sum to zero in one frame");
      expect(!pushes || !f_.momentum || (m.use & (CARDAN_USE_POSE | CARDAN_USE_VELOCITY)) != 0, at + "use",
             "what stores momentum reads CARDAN_USE_POSE or CARDAN_USE_VELOCITY where it pushes");
    }
    expect(masses <= 1 && outlets <= 1, "mounts", "more than one mass or outlet");
    expect(holds <= 1, "mounts", "more than one with CARDAN_USE_HOLD");
    expect((holds == 1) == (f_.holds != nullptr), "holds",
           f_.holds ? "given, and no mount has CARDAN_USE_HOLD" : "null, and a mount has CARDAN_USE_HOLD");
    expect(holds == 0 || (f_.n_marks > 0 && f_.event), "event", "CARDAN_USE_HOLD needs `event`, and a mark that says when it holds");
    expect((masses == 1) == (f_.mass != nullptr), "mass",
           f_.mass ? "given, and no mount is of kind CARDAN_MOUNT_MASS" : "null, and a mount is of kind CARDAN_MOUNT_MASS");
    for (std::uint32_t i = 0; i < f_.n_ports; ++i) {
      const std::string at = fmt::format("ports[{}].", i);
      expect(f_.ports[i].kind <= CARDAN_PORT_OUT, at + "kind", fmt::format("{}, expected one of cardan_port_kind", f_.ports[i].kind));
      unit(at + "unit", f_.ports[i].unit);
      expect(std::isfinite(f_.ports[i].fallback), at + "fallback", "not finite");
      expect(f_.ports[i].flags <= CARDAN_PORT_REQUIRED, at + "flags",
             fmt::format("{}, expected those of cardan_port_flag", f_.ports[i].flags));
      if (const char* valid = f_.ports[i].valid) {
        const int place = place_of_port(f_, f_.ports[i].kind, valid);
        const cardan_port_desc* says = place < 0 ? nullptr : &port_at(f_, f_.ports[i].kind, place);
        expect(says && says != &f_.ports[i] && !says->valid && std::string_view(says->unit ? says->unit : "") == "1", at + "valid",
               fmt::format("\"{}\", expected another port of its kind, in unit 1, always valid itself", valid));
        expect(!says || says->kind == CARDAN_PORT_OUT || says->fallback == 1.0, at + "valid",
               fmt::format("\"{}\" has the fallback {:g}, expected 1: what is not connected holds", valid, says ? says->fallback : 0.0));
      }
      const char* frame = f_.ports[i].frame;
      expect(!frame || std::any_of(f_.mounts, f_.mounts + f_.n_mounts,
                                   [&](const cardan_mount_desc& m) {
                                     return (m.kind == CARDAN_MOUNT_NODE || m.kind == CARDAN_MOUNT_MASS) && std::strcmp(m.name, frame) == 0;
                                   }),
             at + "frame", fmt::format("\"{}\", expected a mount at a node", frame ? frame : ""));
    }
    for (const auto& [name, all, n] : {std::tuple("states", f_.states, f_.n_states), std::tuple("marks", f_.marks, f_.n_marks)})
      for (std::uint32_t i = 0; i < n; ++i) {
        const std::string at = fmt::format("{}[{}].", name, i);
        unit(at + "unit", all[i].unit);
        expect(std::isfinite(all[i].initial), at + "initial", "not finite");
        expect(all == f_.marks || (all[i].nominal > 0.0 && std::isfinite(all[i].nominal)), at + "nominal",
               fmt::format("{:g}, expected > 0", all[i].nominal));
      }
    expect(f_.role <= CARDAN_ROLE_CONTROLLER, "role", fmt::format("{}, expected one of cardan_device_role", f_.role));
    expect(!f_.follow || f_.n_states > 0, "follow", "given, and there are no states");
    expect(!f_.follow || (!energy && !f_.mass && !f_.momentum), "follow", "given, with energy, mass or momentum, which hang on z'");
    const auto any_mount = [&](std::uint32_t use) {
      return std::any_of(f_.mounts, f_.mounts + f_.n_mounts,
                         [&](const cardan_mount_desc& m) { return m.kind != CARDAN_MOUNT_FIELD && (m.use & use) != 0; });
    };
    expect(!f_.impulse || any_mount(kPushing), "impulse", "given, and no mount has CARDAN_USE_IMPULSE or CARDAN_USE_LOAD");
    expect(f_.impulse || !any_mount(CARDAN_USE_IMPULSE), "impulse", "null, and a mount has CARDAN_USE_IMPULSE");
    expect(!f_.impulse || f_.tick || (f_.event && f_.n_roots > 0), "impulse", "given, and there is neither a tick nor an event at a root");
    expect(!f_.impulse || !f_.momentum, "impulse", "given, with momentum: what is stored takes none");
    expect(!energy || f_.energy, "energy", "null, and CARDAN_FACT_ENERGY is set");
    expect((f_.facts & CARDAN_FACT_PASSIVE) == 0 || energy, "facts", "CARDAN_FACT_PASSIVE without CARDAN_FACT_ENERGY");
  }

  const cardan_device_family& f_;
};

/// All numbers that a device reads, side by side: mounts, inputs, states, marks.
struct Point {
  double t = 0.0;
  std::vector<double> numbers;
};

/// All that it gives: loads, outputs, rates, delivered, lost; and whether it did.
struct Given {
  int code = 0;
  std::vector<double> numbers;
  bool overrun = false;
};

class DeviceLaws {
 public:
  DeviceLaws(const cardan_device_family& family, std::uint64_t seed, const TellPhase& before) : f_(family), rng_(seed), before_(before) {
    for (std::uint32_t i = 0; i < f_.n_ports; ++i) (f_.ports[i].kind == CARDAN_PORT_IN ? n_in_ : n_out_) += 1;
    z_ = f_.n_mounts * kMotion + n_in_;
    out_ = f_.n_mounts * kLoad, zdot_ = out_ + n_out_, power_ = zdot_ + f_.n_states;
    list();
  }

  bool sample(int i) {
    found_.sample = i;
    if (!pack()) return false;
    const Point x = i % 2 == 1 ? ticked(random_point()) : random_point();
    const Point handed = x;
    const Given y = evaluate(handed);
    law(kLeaves, handed.numbers == x.numbers, "evaluate changes its arguments");
    if (y.code != 0) return true;  // outside of its domain
    ++taken_;
    pure(x, y);
    at_rest(x);
    reads_what_it_says(x, y);
    validity(y);
    pushes_where_it_says(y, CARDAN_USE_LOAD);
    if ((f_.facts & CARDAN_FACT_INTERNAL) != 0) internal(x, y);
    if (reads_between_nodes(f_)) between(x, y);
    if ((f_.facts & CARDAN_FACT_ENERGY) != 0) energy(x, y);
    if (f_.tangent) tangent(x);
    if (f_.follow) follow(x, y);
    if (f_.mass) mass(x, y);
    if (f_.momentum) momentum(x, y);
    if (f_.holds) holds(x);
    if (f_.n_roots > 0) roots(x);
    if (f_.event) event(x);
    if (f_.tick) tick(x);
    if (f_.impulse) impulses(x);
    return found_.few();
  }
  std::vector<std::string> take(LawRecord* record) {
    if (found_.none()) law(kAccepts, taken_ > 0, "evaluate refuses every random point");
    return found_.take(record);
  }

 private:
  static constexpr const char *kFinite = "numbers are finite for finite arguments", *kNominal = "nominal sizes are numbers > 0",
                              *kReads = "mounts are read as declared", *kDirect = "outputs depend on inputs as declared",
                              *kPushes = "loads are where they are declared", *kInternal = "loads of an internal device sum to zero",
                              *kBetween = "an internal device reads what lies between its nodes",
                              *kEnergy = "energy' = delivered - lost - power of the loads",
                              *kTangent = "tangent is the derivative of evaluate", *kRatesOnce = "rates of states come from follow alone",
                              *kFollowTangent = "follow_tangent is the derivative of follow", *kFlow = "mass falls by its inputs in kg/s",
                              *kMassTangent = "mass_tangent is the derivative of mass",
                              *kMomentum = "stored momentum changes by minus the moments", *kHolds = "holds gives a number >= 0",
                              *kValid = "what says that an output holds is 1 or 0";
  static constexpr const char* kPassive[] = {"a passive device delivers nothing", "a passive device loses"};

  /// What is tried of this device, and why the rest is not.
  void list() {
    const std::pair<const char*, bool> functions[] = {{"energy", f_.energy}, {"mass", f_.mass},     {"momentum", f_.momentum},
                                                      {"holds", f_.holds},   {"follow", f_.follow}, {"roots", f_.roots},
                                                      {"event", f_.event},   {"tick", f_.tick},     {"impulse", f_.impulse}};
    for (const char* always : {kPack, kAccepts, kWrites, kLeaves, kFinite}) found_.list(always);
    found_.list(pure_law("evaluate"));
    for (const auto& [function, given] : functions)
      found_.list(pure_law(function), given ? "it never answers" : fmt::format("it has no {}", function));
    const auto of = [&](const char* law, bool applies, const char* lacks) { found_.list(law, applies ? "no sample came to it" : lacks); };
    of(kNominal, f_.n_states > 0, "it has no states");
    of(kReads, f_.n_mounts > 0, "it has no mounts");
    found_.list(kDirect, "every output may depend on every input");
    found_.list(kPushes, "every load is declared");
    of(kInternal, (f_.facts & CARDAN_FACT_INTERNAL) != 0, "CARDAN_FACT_INTERNAL is not declared");
    of(kBetween, reads_between_nodes(f_), "it is not internal, or reads another node or a field");
    of(kEnergy, (f_.facts & CARDAN_FACT_ENERGY) != 0, "CARDAN_FACT_ENERGY is not declared");
    for (const char* law : kPassive) of(law, (f_.facts & CARDAN_FACT_PASSIVE) != 0, "CARDAN_FACT_PASSIVE is not declared");
    of(kTangent, f_.tangent, "it has no tangent");
    of(kRatesOnce, f_.follow, "it has no follow");
    of(kFollowTangent, f_.follow_tangent, "it has no follow_tangent");
    of(kFlow, f_.mass, "it has no mass");
    of(kMassTangent, f_.mass_tangent, "it has no mass_tangent");
    of(kMomentum, f_.momentum, "it has no momentum");
    of(kHolds, f_.holds, "it has no holds");
    of(kValid, std::any_of(f_.ports, f_.ports + f_.n_ports, says_of_output), "no output has one");
  }

  template <class... Arguments>
  void law(const Arguments&... arguments) const {
    found_.law(arguments...);
  }
  /// Is it the same again, `where`?
  void pure(const char* what, bool same, const char* where) {
    law(pure_law(what), same, fmt::format("{} is a function of its arguments: other numbers {}", what, where));
  }
  static std::string pure_law(const char* what) { return fmt::format("{} is a function of its arguments", what); }
  template <class Told>
  bool finite(double number, const Told& told) {
    const bool is = std::isfinite(number);
    law(kFinite, is, is ? std::string() : std::string(told()));
    return is;
  }
  double normal() { return std::normal_distribution<double>()(rng_); }
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(rng_); }

  /// f(point): its numbers there; the same again whatever it was asked between, here and in another thread, and what it was given stays.
  template <class F>
  std::vector<double> same_again(const char* what, const Point& x, const F& f) {
    const Point handed = x;
    const std::vector<double> packed = packed_, first = f(handed);
    const auto expect_same = [&](const std::vector<double>& numbers, const char* where) { pure(what, same_bits(numbers, first), where); };
    f(random_point());
    expect_same(f(handed), "at the second call");
    std::vector<double> elsewhere;
    in_another_thread([&] { elsewhere = f(handed); });
    expect_same(elsewhere, "on another thread");
    law(kLeaves, handed.numbers == x.numbers && packed == packed_, fmt::format("{} changes its arguments", what));
    return first;
  }

  bool pack() {
    PackedSample packed = packed_at_random(f_, rng_(), before_);
    law(kPack, packed.fault.empty(), packed.fault);
    if (!packed.fault.empty()) return false;
    packed_ = std::move(packed.block);
    nominal_.clear();
    for (std::uint32_t i = 0; i < f_.n_states; ++i) nominal_.push_back(f_.states[i].nominal);
    before_("nominal");
    if (f_.nominal) {
      Handed sizes(nominal_.size());
      std::ranges::copy(nominal_, sizes.data());
      f_.nominal(packed_.data(), sizes.data());
      law(kWrites, sizes.intact(), "nominal writes beyond its array");
      std::copy_n(sizes.data(), nominal_.size(), nominal_.begin());
    }
    for (const double size : nominal_)
      law(kNominal, size > 0.0 && std::isfinite(size), fmt::format("nominal gives {:g}, not a number > 0", size));
    return found_.none();
  }

  Point random_point() {
    Point x{uniform(0.0, 10.0), {}};
    for (std::uint32_t i = 0; i < f_.n_mounts; ++i) {
      double w = normal(), a = normal(), b = normal(), c = normal();
      const double n = 1.0 / std::sqrt(w * w + a * a + b * b + c * c);
      w *= n, a *= n, b *= n, c *= n;
      const double R[9] = {1 - 2 * (b * b + c * c), 2 * (a * b - w * c),     2 * (a * c + w * b),
                           2 * (a * b + w * c),     1 - 2 * (a * a + c * c), 2 * (b * c - w * a),
                           2 * (a * c - w * b),     2 * (b * c + w * a),     1 - 2 * (a * a + b * b)};
      x.numbers.insert(x.numbers.end(), R, R + 9);
      for (int k = 9; k < kMotion; ++k) x.numbers.push_back((k < kPose ? 2.0 : 1.0) * normal());
    }
    for (std::size_t i = 0; i < n_in_; ++i) x.numbers.push_back(normal());
    for (std::uint32_t i = 0; i < f_.n_states; ++i) x.numbers.push_back(f_.states[i].initial + 0.5 * nominal_[i] * normal());
    for (std::uint32_t i = 0; i < f_.n_marks; ++i) x.numbers.push_back(f_.marks[i].initial);
    return x;
  }

  /// With the marks that up to three ticks elsewhere leave behind.
  Point ticked(Point x) {
    const auto marks = [&](Point& p) { return p.numbers.data() + z_ + f_.n_states; };
    for (double ticks = uniform(0.5, 3.5); f_.tick && ticks > 0.5; ticks -= 1.0) {
      Point there = random_point();
      std::copy_n(marks(x), f_.n_marks, marks(there));
      std::vector<double> noise(f_.n_noise);
      for (double& n : noise) n = normal();
      const std::vector<double> after = changed_by(
          "tick", there, [&](const cardan_device_args& a, double* z, double* d) { return f_.tick(&a, 0.1, noise.data(), z, d) == 0; });
      if (!after.empty()) std::copy_n(after.data() + f_.n_states, f_.n_marks, marks(x));
    }
    return x;
  }

  cardan_device_args args(const Point& x) const {
    const double* n = x.numbers.data();
    return {
        sizeof(cardan_device_args), x.t, packed_.data(), n + f_.n_mounts * kMotion, reinterpret_cast<const cardan_mount_motion*>(n), n + z_,
        n + z_ + f_.n_states};
  }

  template <class Call>
  Given call(const char* what, const Call& function) const {
    before_(what);
    constexpr double kGuard = -7.25e77;
    constexpr std::size_t kMargin = 8;
    // Each array apart, with guard numbers behind it.
    std::vector<double> load(out_ + kMargin, 0.0), out(n_out_ + kMargin, 0.0), zdot(f_.n_states + kMargin, 0.0);
    const auto guard = [&](std::vector<double>& a) { std::fill(a.end() - kMargin, a.end(), kGuard); };
    const auto kept = [&](const std::vector<double>& a) {
      return std::all_of(a.end() - kMargin, a.end(), [&](double g) { return g == kGuard; });
    };
    guard(load), guard(out), guard(zdot);
    cardan_device_out o{zdot.data(), out.data(), reinterpret_cast<cardan_mount_load*>(load.data()), 0.0, 0.0};
    Given y;
    y.code = function(&o);
    y.overrun = !(kept(load) && kept(out) && kept(zdot));
    y.numbers.assign(load.begin(), load.end() - kMargin);
    y.numbers.insert(y.numbers.end(), out.begin(), out.end() - kMargin);
    y.numbers.insert(y.numbers.end(), zdot.begin(), zdot.end() - kMargin);
    y.numbers.push_back(o.delivered), y.numbers.push_back(o.lost);
    return y;
  }
  Given evaluate(const Point& x) const {
    return call("evaluate", [&](cardan_device_out* o) {
      const cardan_device_args a = args(x);
      return f_.evaluate(&a, o);
    });
  }

  static bool same(const Given& a, const Given& b) { return a.code == b.code && same_bits(a.numbers, b.numbers); }

  void pure(const Point& x, const Given& y) {
    Point copy = x;
    const std::vector<double> packed = packed_;
    law(kWrites, !y.overrun, "evaluate writes beyond its arrays");
    for (std::size_t i = 0; i < y.numbers.size(); ++i)
      if (!finite(y.numbers[i], [&] { return fmt::format("evaluate gives {} for finite arguments ({})", y.numbers[i], name_of(i)); }))
        return;
    evaluate(random_point());  // what it may remember
    Given again = evaluate(copy), elsewhere;
    in_another_thread([&] { elsewhere = evaluate(x); });
    pure("evaluate", same(again, y), "at the second call");
    pure("evaluate", same(elsewhere, y), "on another thread");
    law(kLeaves, packed == packed_, "evaluate changes its arguments");
  }

  /// As scenes begin: nothing moves, hinges are at zero, inputs and states are what they are before somebody sets them.
  void at_rest(const Point& x) {
    Point still = x;
    for (std::uint32_t m = 0; m < f_.n_mounts; ++m)
      if (f_.mounts[m].kind != CARDAN_MOUNT_FIELD)
        std::fill_n(still.numbers.begin() + static_cast<std::ptrdiff_t>(m * kMotion + kPose), kRates - kPose, 0.0);
    std::size_t at = f_.n_mounts * kMotion;
    for (std::uint32_t i = 0; i < f_.n_ports; ++i)
      if (f_.ports[i].kind == CARDAN_PORT_IN) still.numbers[at++] = f_.ports[i].fallback;
    for (std::uint32_t i = 0; i < f_.n_states; ++i) still.numbers[at++] = f_.states[i].initial;
    const Given y = evaluate(still);
    if (y.code != 0) return;
    for (std::size_t i = 0; i < y.numbers.size(); ++i)
      if (!finite(y.numbers[i], [&] { return fmt::format("evaluate gives {} where nothing moves ({})", y.numbers[i], name_of(i)); }))
        return;
  }

  std::string name_of(std::size_t i) const {
    if (i < out_)
      return fmt::format("{} of mount {}", i % kLoad < 3 ? "moment" : i % kLoad < 6 ? "force" : "tau", f_.mounts[i / kLoad].name);
    if (i < zdot_) {
      std::size_t k = i - out_;
      for (std::uint32_t p = 0; p < f_.n_ports; ++p)
        if (f_.ports[p].kind == CARDAN_PORT_OUT && k-- == 0) return fmt::format("output {}", f_.ports[p].name);
    }
    if (i < power_) return fmt::format("rate of {}", f_.states[i - zdot_].name);
    return i == power_ ? "delivered" : "lost";
  }

  /// What the host leaves out because nobody reads it, and outputs that say they do not depend on an input.
  void reads_what_it_says(const Point& x, const Given& y) {
    const auto changed = [&](std::size_t first, std::size_t last) {
      Point other = x;
      for (std::size_t i = first; i < last; ++i) other.numbers[i] += 0.7 + 0.3 * normal();
      return evaluate(other);
    };
    for (std::uint32_t m = 0; m < f_.n_mounts; ++m) {
      const std::size_t at = m * kMotion;
      const char* name = f_.mounts[m].name;
      const auto unread = [&](std::size_t first, std::size_t last, const char* told) {
        law(kReads, same(changed(first, last), y), fmt::format(fmt::runtime(told), name));
      };
      if (f_.mounts[m].kind == CARDAN_MOUNT_FIELD) {
        unread(at, at + kRates, "mount {} is a field: it has the numbers of its quantity alone");
        continue;
      }
      unread(at + kRates, at + kMotion, "mount {} is no field");
      const bool node = f_.mounts[m].kind != CARDAN_MOUNT_HINGE;
      const bool poses = (f_.mounts[m].use & CARDAN_USE_POSE) != 0, velocities = (f_.mounts[m].use & CARDAN_USE_VELOCITY) != 0;
      // The host gives both where one is read.
      const bool at_ticks = (f_.mounts[m].use & CARDAN_USE_ACCELERATION) != 0;
      if (node && ((!poses && !velocities) || at_ticks)) unread(at, at + kVelocity, "mount {} reads pose or velocity and does not say so");
      unread(at + kHinge, at + kRates, "evaluate reads an acceleration at mount {}, which it cannot know");
      if (node) unread(at + kVelocity, at + kHinge, "mount {} is a node: it has no q and v");
      if (!node) unread(at, at + kVelocity, "mount {} is a hinge component: it has q and v alone");
    }
    for (std::size_t i = 0; i < n_in_; ++i) {
      const std::size_t at = f_.n_mounts * kMotion + i;
      const Given other = changed(at, at + 1);
      if (other.code != 0) continue;
      std::size_t k = 0;
      for (std::uint32_t p = 0; p < f_.n_ports; ++p) {
        if (f_.ports[p].kind != CARDAN_PORT_OUT) continue;
        const bool direct = i >= 64 || (f_.ports[p].direct >> i & 1U) != 0;
        if (!direct)
          law(kDirect, other.numbers[out_ + k] == y.numbers[out_ + k],
              fmt::format("output {} depends on input no. {} and does not say so", f_.ports[p].name, i));
        ++k;
      }
    }
  }

  static bool says_of_output(const cardan_port_desc& p) { return p.kind == CARDAN_PORT_OUT && p.valid; }
  void validity(const Given& y) {
    for (std::uint32_t p = 0; p < f_.n_ports; ++p) {
      if (!says_of_output(f_.ports[p])) continue;
      const double says = y.numbers[out_ + static_cast<std::size_t>(place_of_port(f_, CARDAN_PORT_OUT, f_.ports[p].valid))];
      law(kValid, says == 0.0 || says == 1.0, fmt::format("output {} is {:g}", f_.ports[p].valid, says));
    }
  }

  void pushes_where_it_says(const Given& y, std::uint32_t use) {
    for (std::uint32_t m = 0; m < f_.n_mounts; ++m) {
      const double* l = y.numbers.data() + m * kLoad;
      const bool node = f_.mounts[m].kind != CARDAN_MOUNT_HINGE, field = f_.mounts[m].kind == CARDAN_MOUNT_FIELD;
      const bool loads = !field && (f_.mounts[m].use & use) != 0;
      for (int i = 0; i < kLoad; ++i)
        if (!loads || (i < 6) != node)
          law(kPushes, l[i] == 0.0, fmt::format("{} and does not say so", name_of(m * kLoad + static_cast<std::size_t>(i))));
    }
  }

  void internal(const Point& x, const Given& y) {
    double force[3] = {}, moment[3] = {}, size = 1e-30;
    for (std::uint32_t m = 0; m < f_.n_mounts; ++m) {
      if (f_.mounts[m].kind == CARDAN_MOUNT_HINGE) continue;
      const double *R = x.numbers.data() + m * kMotion, *p = R + 9, *l = y.numbers.data() + m * kLoad;
      double n[3] = {}, f[3] = {};
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) n[i] += R[3 * i + j] * l[j], f[i] += R[3 * i + j] * l[3 + j];
      for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        force[i] += f[i];
        moment[i] += n[i] + p[j] * f[k] - p[k] * f[j];
        size += std::abs(n[i]) + std::abs(f[i]) * (1.0 + std::abs(p[j]) + std::abs(p[k]));
      }
    }
    law(kInternal, (std::hypot(force[0], force[1], force[2]) + std::hypot(moment[0], moment[1], moment[2])) / size, 1e-13);
  }

  /// The same with all nodes elsewhere, and carried along evenly.
  void between(const Point& x, const Given& y) {
    Point moved = x;
    const double by[3] = {normal(), normal(), normal()}, rate[3] = {normal(), normal(), normal()};
    for (std::uint32_t m = 0; m < f_.n_mounts; ++m) {
      if (f_.mounts[m].kind == CARDAN_MOUNT_HINGE || !is_read(f_.mounts[m])) continue;
      double *R = moved.numbers.data() + m * kMotion, *p = R + 9, *v = R + 15;
      for (int i = 0; i < 3; ++i) {
        p[i] += by[i];
        for (int j = 0; j < 3; ++j) v[i] += R[3 * j + i] * rate[j];
      }
    }
    const Given there = evaluate(moved);
    if (there.code != 0) return law(kBetween, false, "evaluate refuses it elsewhere");
    double size = 1e-30, off = 0.0;
    for (std::size_t i = 0; i < y.numbers.size(); ++i) {
      size = std::max(size, std::abs(y.numbers[i])), off = std::max(off, std::abs(there.numbers[i] - y.numbers[i]));
    }
    law(kBetween, off / size, 1e-9);
  }

  double energy_at(const Point& x) const {
    before_("energy");
    const cardan_device_args a = args(x);
    return f_.energy(&a);
  }

  /// Of all that it reads, along the motion: R' = R omega~, p' = R v, q' = v, z'. And a step that is small along it.
  std::pair<std::vector<double>, double> rates(const Point& x, const Given& y) const {
    std::vector<double> rate(x.numbers.size(), 0.0);
    for (std::uint32_t m = 0; m < f_.n_mounts; ++m) {
      const double *R = x.numbers.data() + m * kMotion, *w = R + 12, *v = R + 15;
      double* d = rate.data() + m * kMotion;
      if (f_.mounts[m].kind == CARDAN_MOUNT_FIELD) continue;
      if (f_.mounts[m].kind == CARDAN_MOUNT_HINGE) {
        d[18] = R[19];
        continue;
      }
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          const int a = (j + 1) % 3, b = (j + 2) % 3;
          d[3 * i + j] = R[3 * i + a] * w[b] - R[3 * i + b] * w[a];
          d[9 + i] += R[3 * i + j] * v[j];
        }
    }
    for (std::uint32_t i = 0; i < f_.n_states; ++i) rate[z_ + i] = y.numbers[zdot_ + i];
    double largest = 1.0;
    for (std::size_t i = 0; i < rate.size(); ++i)
      largest = std::max(largest, std::abs(rate[i]) / (i >= z_ && i < z_ + f_.n_states ? nominal_[i - z_] : 1.0));
    return {std::move(rate), 2e-3 / largest};
  }
  /// d f / ds, of sixth order; f is curved, and R leaves the rotations by h^2.
  template <class F>
  static double slope(const Point& x, const std::pair<std::vector<double>, double>& along, const F& f) {
    const auto& rate = along.first;
    const double h = along.second;
    const auto at = [&](double s) {
      Point moved = x;
      for (std::size_t i = 0; i < moved.numbers.size(); ++i) moved.numbers[i] += s * rate[i];
      return f(moved);
    };
    return (45.0 * (at(h) - at(-h)) - 9.0 * (at(2 * h) - at(-2 * h)) + (at(3 * h) - at(-3 * h))) / (60.0 * h);
  }

  void energy(const Point& x, const Given& y) {
    same_again("energy", x, [&](const Point& p) { return std::vector<double>{energy_at(p)}; });
    double power = 0.0, size = std::abs(y.numbers[power_]) + std::abs(y.numbers[power_ + 1]);
    for (std::uint32_t m = 0; m < f_.n_mounts; ++m) {
      const double *R = x.numbers.data() + m * kMotion, *w = R + 12, *v = R + 15, *l = y.numbers.data() + m * kLoad;
      if (f_.mounts[m].kind == CARDAN_MOUNT_HINGE) {
        power += l[6] * R[19], size += std::abs(l[6] * R[19]);
        continue;
      }
      for (int i = 0; i < 3; ++i) power += l[i] * w[i] + l[3 + i] * v[i], size += std::abs(l[i] * w[i]) + std::abs(l[3 + i] * v[i]);
    }
    auto along = rates(x, y);
    const auto stored_at = [&](const Point& p) { return energy_at(p); };
    const double h = along.second, stored = std::abs(energy_at(x)) / h * 1e-15, change = slope(x, along, stored_at);
    along.second = 2.0 * h;
    const double coarse = slope(x, along, stored_at), scale = 1e-3 + size;
    if (std::abs(change - coarse) <= 1e-7 * scale + stored)  // else a corner
      law(kEnergy, std::abs(change - (y.numbers[power_] - y.numbers[power_ + 1] - power)) / scale, 1e-7 + stored / scale);
    if ((f_.facts & CARDAN_FACT_PASSIVE) == 0) return;
    law(kPassive[0], std::abs(y.numbers[power_]), 0.0);
    law(kPassive[1], -y.numbers[power_ + 1], 1e-15 * size);
  }

  cardan_mass mass_at(const Point& x, const std::vector<double>& z) const {
    cardan_device_args a = args(x);
    a.in = nullptr, a.mount = nullptr, a.z = z.data();
    cardan_mass m{};
    before_("mass");
    return f_.mass(&a, &m) == 0 ? m : cardan_mass{std::nan(""), {}, {}};
  }

  /// A function of z and marks, whose derivative is what it says, and which falls by what is drawn.
  void mass(const Point& x, const Given& y) {
    constexpr std::size_t kMass = sizeof(cardan_mass) / sizeof(double);
    const auto at_z = x.numbers.begin() + static_cast<std::ptrdiff_t>(z_);
    const std::vector<double> z(at_z, at_z + f_.n_states);
    const cardan_mass first = mass_at(x, z);
    if (!std::isfinite(first.mass)) return;  // outside of its domain
    for (std::size_t i = 0; i < kMass; ++i) finite((&first.mass)[i], [] { return "mass gives a number that is not finite"; });
    mass_at(x, std::vector<double>(f_.n_states, 0.3));
    cardan_mass again = mass_at(x, z);
    pure("mass", std::memcmp(&again, &first, sizeof first) == 0, "at the second call");
    const auto slope = [&](const double* dz, double h) {
      std::vector<double> sum(kMass, 0.0);
      for (const auto& [steps, weight] : {std::pair(1, 45.0), std::pair(2, -9.0), std::pair(3, 1.0)})
        for (const int side : {1, -1}) {
          std::vector<double> moved = z;
          for (std::size_t i = 0; i < moved.size(); ++i) moved[i] += side * steps * h * dz[i];
          const cardan_mass m = mass_at(x, moved);
          for (std::size_t i = 0; i < kMass; ++i) sum[i] += side * weight * (&m.mass)[i] / (60.0 * h);
        }
      return sum;
    };
    double drawn = 0.0, size = 1.0;
    std::size_t k = 0;
    for (std::uint32_t p = 0; p < f_.n_ports; ++p) {
      if (f_.ports[p].kind != CARDAN_PORT_IN) continue;
      const double in = x.numbers[f_.n_mounts * kMotion + k++];
      if (std::string_view(f_.ports[p].unit) == "kg/s") drawn += in, size += std::abs(in);
    }
    const double* zdot = y.numbers.data() + zdot_;
    double largest = 1e-30;
    for (std::size_t i = 0; i < z.size(); ++i) largest = std::max(largest, std::abs(zdot[i]) / nominal_[i]);
    if (const double change = slope(zdot, 1e-3 / largest)[0]; std::isfinite(change))  // else beside its domain
      law(kFlow, std::abs(change + drawn) / size, 1e-8);
    if (!f_.mass_tangent) return;
    std::vector<double> dz;
    for (const double n : nominal_) dz.push_back(n * normal());
    cardan_device_args a = args(x);
    a.in = nullptr, a.mount = nullptr;
    cardan_mass given{};
    before_("mass_tangent");
    if (f_.mass_tangent(&a, dz.data(), &given) != 0) return;
    const std::vector<double> fine = slope(dz.data(), 1e-3), coarse = slope(dz.data(), 2e-3);
    for (std::size_t i = 0; i < kMass; ++i) {
      const double scale = 1.0 + std::abs(fine[i]);
      if (!(std::abs(fine[i] - coarse[i]) <= 1e-7 * scale)) continue;  // a corner, or too curved here
      law(kMassTangent, std::abs((&given.mass)[i] - fine[i]) / scale, 1e-6);
    }
  }

  void holds(const Point& x) {
    const auto most_at = [&](const Point& p) {
      before_("holds");
      const cardan_device_args a = args(p);
      return f_.holds(&a);
    };
    const double most = same_again("holds", x, [&](const Point& p) { return std::vector<double>{most_at(p)}; })[0];
    law(kHolds, most >= 0.0 && std::isfinite(most), fmt::format("holds gives {}, not a number >= 0", most));
  }

  /// Of each mount, in the axes of the node.
  std::vector<double> stored_at(const Point& x) {
    before_("momentum");
    Handed h(3 * f_.n_mounts);
    std::fill_n(h.data(), 3 * f_.n_mounts, 0.0);
    const cardan_device_args a = args(x);
    f_.momentum(&a, reinterpret_cast<double(*)[3]>(h.data()));
    law(kWrites, h.intact(), "momentum writes beyond its array");
    return {h.data(), h.data() + 3 * f_.n_mounts};
  }
  /// World axes.
  std::array<double, 3> momentum_at(const Point& x) {
    const std::vector<double> h = stored_at(x);
    std::array<double, 3> sum{};
    for (std::uint32_t m = 0; m < f_.n_mounts; ++m)
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j) sum[i] += x.numbers[m * kMotion + 3 * i + j] * h[3 * m + j];
    return sum;
  }
  /// What its loads take from the bodies is stored: a moment, no force.
  void momentum(const Point& x, const Given& y) {
    same_again("momentum", x, [&](const Point& p) { return stored_at(p); });
    const auto along = rates(x, y);
    for (std::size_t i = 0; i < 3; ++i) {
      double moment = 0.0, force = 0.0, size = 1.0;
      for (std::uint32_t m = 0; m < f_.n_mounts; ++m) {
        const double *R = x.numbers.data() + m * kMotion, *l = y.numbers.data() + m * kLoad;
        for (std::size_t j = 0; j < 3 && f_.mounts[m].kind != CARDAN_MOUNT_HINGE; ++j)
          moment += R[3 * i + j] * l[j], force += std::abs(l[3 + j]), size += std::abs(l[j]);
      }
      law(kMomentum, (std::abs(slope(x, along, [&](const Point& p) { return momentum_at(p)[i]; }) + moment) + force) / size, 1e-7);
    }
  }

  Point direction(const Point& x) {
    Point along = x;
    for (std::size_t i = 0; i < along.numbers.size(); ++i) {
      const bool state = i >= z_ && i < z_ + f_.n_states;
      along.numbers[i] = i >= z_ + f_.n_states ? 0.0 : (state ? nominal_[i - z_] : 1.0) * normal();
    }
    return along;
  }
  /// d f / ds along it, of sixth order, n numbers.
  template <class F>
  static std::vector<double> slopes(const Point& x, const Point& along, double h, std::size_t n, const F& f) {
    std::vector<double> sum(n, 0.0);
    for (const auto& [steps, weight] : {std::pair(1, 45.0), std::pair(2, -9.0), std::pair(3, 1.0)})
      for (const int side : {1, -1}) {
        Point moved = x;
        for (std::size_t i = 0; i < moved.numbers.size(); ++i) moved.numbers[i] += side * steps * h * along.numbers[i];
        const std::vector<double> y = f(moved);
        for (std::size_t i = 0; i < n; ++i) sum[i] += side * weight * y[i] / (60.0 * h);
      }
    return sum;
  }

  /// Empty: refused.
  std::vector<double> followed(const Point& x) {
    before_("follow");
    cardan_device_args a = args(x);
    a.in = a.d = nullptr;
    Handed zdot(f_.n_states);
    const int code = f_.follow(&a, zdot.data());
    law(kWrites, zdot.intact(), "follow writes beyond its array");
    return code != 0 ? std::vector<double>() : std::vector<double>(zdot.data(), zdot.data() + f_.n_states);
  }
  /// z' by `follow` alone, a function of its arguments, whose derivative is what it says.
  void follow(const Point& x, const Given& y) {
    const std::size_t n = f_.n_states;
    law(kRatesOnce,
        std::all_of(y.numbers.begin() + static_cast<std::ptrdiff_t>(zdot_), y.numbers.begin() + static_cast<std::ptrdiff_t>(power_),
                    [](double rate) { return rate == 0.0; }),
        "evaluate gives rates of states, which follow gives");
    const std::vector<double> first = same_again("follow", x, [&](const Point& p) { return followed(p); });
    if (first.empty()) return;  // outside of its domain
    for (std::uint32_t m = 0; m < f_.n_mounts; ++m) {
      if (f_.mounts[m].kind != CARDAN_MOUNT_FIELD) continue;
      Point other = x;
      for (int i = 0; i < kMotion; ++i) other.numbers[m * kMotion + static_cast<std::size_t>(i)] += 0.7;
      law(kReads, followed(other) == first, fmt::format("follow reads mount {}, a field, of which it has nothing", f_.mounts[m].name));
    }
    for (std::size_t i = 0; i < n; ++i)
      finite(first[i], [&] { return fmt::format("follow gives {} for finite arguments (rate of {})", first[i], f_.states[i].name); });
    if (!f_.follow_tangent) return;
    const Point along = direction(x);
    cardan_device_args a = args(x), d = args(along);
    a.in = a.d = d.in = d.d = nullptr;
    Handed given(n);
    before_("follow_tangent");
    if (f_.follow_tangent(&a, &d, given.data()) != 0) return;
    law(kWrites, given.intact(), "follow_tangent writes beyond its array");
    const auto f = [&](const Point& moved) {
      std::vector<double> rates = followed(moved);
      rates.resize(n, std::nan(""));
      return rates;
    };
    const std::vector<double> fine = slopes(x, along, 1e-3, n, f), coarse = slopes(x, along, 2e-3, n, f);
    for (std::size_t i = 0; i < n; ++i) {
      const double size = 1.0 + std::abs(fine[i]);
      if (!(std::abs(fine[i] - coarse[i]) <= 1e-7 * size)) continue;  // a corner, or too curved here
      law(kFollowTangent, std::abs(given.data()[i] - fine[i]) / size, 1e-6, 0.0, fmt::format("rate of {}", f_.states[i].name));
    }
  }

  /// Along a random direction, against differences of sixth order; marks and time stay.
  void tangent(const Point& x) {
    const Point along = direction(x);
    const Given given = call("tangent", [&](cardan_device_out* o) {
      const cardan_device_args a = args(x), d = args(along);
      return f_.tangent(&a, &d, o);
    });
    law(kWrites, !given.overrun, "tangent writes beyond its arrays");
    if (given.code != 0) return;
    const auto f = [&](const Point& moved) { return evaluate(moved).numbers; };
    const std::vector<double> fine = slopes(x, along, 1e-3, power_, f), coarse = slopes(x, along, 2e-3, power_, f);
    for (std::size_t i = 0; i < power_; ++i) {
      const double size = 1.0 + std::abs(fine[i]);
      if (std::abs(fine[i] - coarse[i]) > 1e-7 * size) continue;  // a corner, or too curved here
      law(kTangent, std::abs(given.numbers[i] - fine[i]) / size, 1e-6, 0.0, name_of(i));
    }
  }

  /// States and marks at x, for change(arguments, z, d) to write into; empty where it says no.
  template <class Change>
  std::vector<double> changed_by(const char* what, const Point& x, const Change& change) {
    before_(what);
    Handed z(f_.n_states), d(f_.n_marks);
    std::copy_n(x.numbers.data() + z_, f_.n_states, z.data());
    std::copy_n(x.numbers.data() + z_ + f_.n_states, f_.n_marks, d.data());
    const cardan_device_args a = args(x);
    if (!change(a, z.data(), d.data())) return {};
    law(kWrites, z.intact() && d.intact(), fmt::format("{} writes beyond its arrays", what));
    std::vector<double> all(z.data(), z.data() + f_.n_states);
    all.insert(all.end(), d.data(), d.data() + f_.n_marks);
    return all;
  }
  template <class Change>
  void accepted(const char* what, const Point& x, const Change& change) {
    const std::vector<double> first = same_again(what, x, [&](const Point& p) { return changed_by(what, p, change); });
    for (const double a : first)
      if (!finite(a, [&] { return fmt::format("{} sets a number that is not finite", what); })) return;
  }
  void tick(const Point& x) {
    const std::vector<double> noise(f_.n_noise, 0.3);
    accepted("tick", x, [&](const cardan_device_args& a, double* z, double* d) { return f_.tick(&a, 0.1, noise.data(), z, d) == 0; });
  }
  /// At each root both ways, at the start, and where what it holds breaks away.
  void event(const Point& x) {
    for (std::uint32_t root = 0; root <= f_.n_roots + (f_.holds ? 1 : 0); ++root)
      for (const int direction : {1, -1})
        accepted("event", x, [&](const cardan_device_args& a, double* z, double* d) {
          f_.event(&a, root, root == f_.n_roots ? 0 : direction, z, d);
          return true;
        });
  }

  /// A load of its own at each root both ways, and at a tick.
  void impulses(const Point& x) {
    const auto cause = [&](std::uint32_t what, int direction) {
      const auto at = [&](const Point& p) {
        return call("impulse", [&](cardan_device_out* o) {
          const cardan_device_args a = args(p);
          return f_.impulse(&a, what, direction, o->load);
        });
      };
      const Point handed = x;
      const Given y = at(handed);
      law(kLeaves, handed.numbers == x.numbers, "impulse changes its arguments");
      law(kWrites, !y.overrun, "impulse writes beyond its array");
      if (y.code != 0) return;
      for (std::size_t i = 0; i < y.numbers.size(); ++i)
        if (!finite(y.numbers[i], [&] { return fmt::format("impulse gives {} for finite arguments ({})", y.numbers[i], name_of(i)); }))
          return;
      same_again("impulse", x, [&](const Point& p) { return at(p).numbers; });
      pushes_where_it_says(y, kPushing);
      if ((f_.facts & CARDAN_FACT_INTERNAL) != 0) internal(x, y);
    };
    for (std::uint32_t root = 0; f_.event && root < f_.n_roots; ++root)
      for (const int direction : {1, -1}) cause(root, direction);
    if (f_.tick) cause(CARDAN_CAUSE_TICK, 0);
  }

  std::vector<double> roots_at(const Point& x) {
    before_("roots");
    Handed g(f_.n_roots);
    std::fill_n(g.data(), f_.n_roots, 0.0);
    const cardan_device_args a = args(x);
    f_.roots(&a, g.data());
    law(kWrites, g.intact(), "roots writes beyond n_roots");
    return {g.data(), g.data() + f_.n_roots};
  }
  void roots(const Point& x) {
    const std::vector<double> g = same_again("roots", x, [&](const Point& p) { return roots_at(p); });
    for (std::uint32_t i = 0; i < f_.n_roots; ++i)
      finite(g[i], [&] { return fmt::format("root no. {} is {} for finite arguments", i, g[i]); });
  }

  const cardan_device_family& f_;
  std::mt19937_64 rng_;
  const TellPhase& before_;
  std::size_t n_in_ = 0, n_out_ = 0, z_ = 0, out_ = 0, zdot_ = 0, power_ = 0;  // where they begin
  std::vector<double> packed_, nominal_;
  int taken_ = 0;
  mutable Violations found_;
};

}  // namespace

bool reads_between_nodes(const cardan_device_family& f) {
  return (f.facts & CARDAN_FACT_INTERNAL) != 0 && !f.follow && !f.momentum &&
         std::all_of(f.mounts, f.mounts + f.n_mounts, [](const cardan_mount_desc& m) {
           return m.kind == CARDAN_MOUNT_HINGE || (m.kind == CARDAN_MOUNT_NODE && (!is_read(m) || (m.use & CARDAN_USE_LOAD) != 0));
         });
}

std::vector<std::string> device_table_faults(const cardan_device_family& family) { return DeviceTableFaults(family).all(); }

std::vector<std::string> device_law_violations(const cardan_device_family& family, int samples, std::uint64_t seed, const TellPhase& before,
                                               LawRecord* record) {
  if (auto faults = device_table_faults(family); !faults.empty()) return faults;
  DeviceLaws laws(family, seed, before);
  for (int i = 0; i < samples; ++i)
    if (!laws.sample(i)) break;
  return laws.take(record);
}

}  // namespace cardan
