// What straight-line code for one fixed model would save: the program of sweeps is run once on a scalar that writes down what is done with
// it, constants are folded, what occurs twice is taken once, what nobody asks for is left out, and the rest is printed as C, compiled and
// timed in turn with the general program. Sines and cosines, as ours, come from the program's own op in both.
//   cardan-bench-straight [--only chain_7] [--seconds S]
#include <dlfcn.h>
#include <fmt/format.h>
#include <unistd.h>

#include <bit>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <map>
#include <tuple>

#include "bench/bench_model.hpp"
#include "bench/command_line.hpp"
#include "bench/exact.hpp"
#include "bench/time_ring.hpp"
#include "bodies/register.hpp"
#include "core/dynamics/forward.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/soa/kernels.hpp"
#include "core/soa/program.hpp"
#include "core/soa/sweeps_impl.hpp"
#include "core/soa/workspace_layout.hpp"
#include "hinges/register.hpp"

namespace cardan::bench {

/// A double that knows where it came from: entry `at` of the tape.
struct Traced {
  double x = 0.0;
  int at = 0;  // the constant zero

  Traced() = default;
  Traced(double value);                               // NOLINT: a number is a number
  Traced(int value) : Traced(double{1.0} * value) {}  // NOLINT
  explicit operator double() const { return x; }
};

/// What was done, in the order in which it was done.
class Tape {
 public:
  struct Entry {
    char op;   // 'c' constant, 'i' input, '-' with b < 0: the sign; + - * / and 'r', the root
    int a, b;  // entries, or the number of an input
    double value;
  };

  Tape() { constant(0.0); }
  Traced constant(double value) {
    const auto [at, fresh] = constants_.try_emplace(std::bit_cast<std::uint64_t>(value), static_cast<int>(entries_.size()));
    if (fresh) entries_.push_back({'c', 0, 0, value});
    return made(at->second);
  }
  Traced input(double value) {
    entries_.push_back({'i', inputs_++, 0, value});
    return made(static_cast<int>(entries_.size()) - 1);
  }
  /// `value` is what the operation gives.
  Traced done(char op, Traced a, Traced b, double value) {
    const bool ca = is_constant(a), cb = is_constant(b);
    if (ca && cb) return constant(value);
    if (op == '*' && ((ca && a.x == 0.0) || (cb && b.x == 0.0))) return constant(0.0);
    if (op == '/' && ca && a.x == 0.0) return constant(0.0);
    if ((op == '+' && ca && a.x == 0.0) || (op == '*' && ca && a.x == 1.0)) return b;
    if (cb && (((op == '+' || op == '-') && b.x == 0.0) || ((op == '*' || op == '/') && b.x == 1.0))) return a;
    if ((op == '*' && ca && a.x == -1.0) || (op == '-' && ca && a.x == 0.0)) return sign(b);
    if (op == '*' && cb && b.x == -1.0) return sign(a);
    if (op == '+' && entries_[b.at].op == '-' && entries_[b.at].b < 0) return done('-', a, made(entries_[b.at].a), value);
    if ((op == '+' || op == '*') && a.at > b.at) std::swap(a, b);
    return entered(op, a.at, b.at, value);
  }
  Traced sign(Traced a) {
    if (is_constant(a)) return constant(-a.x);
    if (const Entry& e = entries_[a.at]; e.op == '-' && e.b < 0) return made(e.a);
    return entered('-', a.at, -1, -a.x);
  }
  Traced root(Traced a) { return is_constant(a) ? constant(std::sqrt(a.x)) : entered('r', a.at, -1, std::sqrt(a.x)); }

  /// A function of C of the inputs, which fills `out`; `operations`: how many it has.
  std::string code(const std::vector<Traced>& out, int& operations) const {
    std::vector<char> wanted(entries_.size());
    for (const Traced& o : out) wanted[o.at] = 1;
    for (std::size_t i = entries_.size(); i-- > 0;) {
      const Entry& e = entries_[i];
      if (!wanted[i] || e.op == 'c' || e.op == 'i') continue;
      wanted[e.a] = 1;
      if (e.b >= 0) wanted[e.b] = 1;
    }
    const auto name = [&](int at) {
      const Entry& e = entries_[at];
      return e.op == 'c' ? fmt::format("({:a})", e.value) : e.op == 'i' ? fmt::format("in[{}]", e.a) : fmt::format("t{}", at);
    };
    std::string text = "#include <math.h>\nvoid straight(const double* restrict in, double* restrict out) {\n";
    operations = 0;
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const Entry& e = entries_[i];
      if (!wanted[i] || e.op == 'c' || e.op == 'i') continue;
      operations += !(e.op == '-' && e.b < 0);
      if (e.op == 'r')
        text += fmt::format("const double t{} = sqrt({});\n", i, name(e.a));
      else if (e.b < 0)
        text += fmt::format("const double t{} = -{};\n", i, name(e.a));
      else
        text += fmt::format("const double t{} = {} {} {};\n", i, name(e.a), e.op, name(e.b));
    }
    for (std::size_t i = 0; i < out.size(); ++i) text += fmt::format("out[{}] = {};\n", i, name(out[i].at));
    return text + "}\n";
  }

 private:
  bool is_constant(const Traced& a) const { return entries_[a.at].op == 'c'; }
  Traced made(int at) const {
    Traced t;
    t.x = entries_[at].value, t.at = at;
    return t;
  }
  Traced entered(char op, int a, int b, double value) {
    const auto [at, fresh] = known_.try_emplace({op, a, b}, static_cast<int>(entries_.size()));
    if (fresh) entries_.push_back({op, a, b, value});
    return made(at->second);
  }

  std::vector<Entry> entries_;
  std::map<std::uint64_t, int> constants_;
  std::map<std::tuple<char, int, int>, int> known_;
  int inputs_ = 0;
};
Tape* tape = nullptr;

Traced::Traced(double value) : Traced(tape->constant(value)) {}
Traced operator+(Traced a, Traced b) { return tape->done('+', a, b, a.x + b.x); }
Traced operator-(Traced a, Traced b) { return tape->done('-', a, b, a.x - b.x); }
Traced operator*(Traced a, Traced b) { return tape->done('*', a, b, a.x * b.x); }
Traced operator/(Traced a, Traced b) { return tape->done('/', a, b, a.x / b.x); }
Traced operator-(Traced a) { return tape->sign(a); }
bool operator<(Traced a, Traced b) { return a.x < b.x; }
bool operator>(Traced a, Traced b) { return a.x > b.x; }
Traced sqrt(Traced a) { return tape->root(a); }
/// The op of sines and cosines fills the workspace, from where inputs replace them.
Traced sin(Traced a) { return tape->constant(std::sin(a.x)); }
Traced cos(Traced a) { return tape->constant(std::cos(a.x)); }

namespace {

using Straight = void (*)(const double*, double*);

struct Printed {
  std::string code;
  int operations = 0;
};

/// Inputs: sines and cosines of the hinges, v, and tau or v', in this order.
Printed print(const Model& model, const BenchState& state, bool inverse) {
  Tape written;
  tape = &written;
  constexpr soa::Sweeps<Traced> S = soa::make_sweeps<Traced, soa::Wanted::program>();
  soa::Workspace<Traced> ws(model);
  const auto constants = [](const Eigen::VectorXd& x) { return std::vector<Traced>(x.begin(), x.end()); };
  const auto inputs = [&](const Eigen::VectorXd& x) {
    std::vector<Traced> all;
    for (const double number : x) all.push_back(written.input(number));
    return all;
  };
  const std::vector<Traced> q = constants(state.q);
  soa::Inputs<Traced> in;
  in.q = q.data();
  S.ground(model, ws, in);
  S.hinge_records(model, ws, in);
  for (std::vector<Traced>* all : {&ws.sines, &ws.cosines})
    for (Traced& number : *all) number = written.input(number.x);
  const std::vector<Traced> v = inputs(state.v), other = inputs(inverse ? state.vdot : state.tau);
  in.v = v.data(), (inverse ? in.vdot : in.tau) = other.data();
  std::vector<Traced> out(static_cast<std::size_t>(model.nv));
  for (const Run& run : model.runs) S.outward(model, ws, in, run, {.vdot = inverse});
  for (auto run = model.runs.rbegin(); run != model.runs.rend(); ++run)
    if (inverse)
      soa::gather<Traced>(model, ws, in, *run, out.data());
    else
      S.inward(model, ws, in, *run, {});
  for (const Run& run : model.runs)
    if (!inverse) S.acceleration(model, ws, in, run, out.data());
  Printed printed;
  printed.code = written.code(out, printed.operations);
  return printed;
}

Straight compiled(const std::string& code) {
  static int count = 0;  // a library of a name that is loaded is not read again
  const auto folder = std::filesystem::temp_directory_path() / fmt::format("cardan-straight-{}-{}", ::getpid(), ++count);
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "straight.c") << code;
  const std::string library = (folder / "straight.so").string();
  const std::string line = fmt::format("cc -O3 -march=x86-64-{} -ffp-contract=fast -fPIC -shared '{}' -o '{}'", soa::instruction_set().name,
                                       (folder / "straight.c").string(), library);
  Straight f = nullptr;
  if (std::system(line.c_str()) == 0)
    if (void* handle = dlopen(library.c_str(), RTLD_NOW)) f = reinterpret_cast<Straight>(dlsym(handle, "straight"));
  std::filesystem::remove_all(folder);
  if (!f) throw std::runtime_error("the C compiler `cc` could not compile straight-line code");
  return f;
}

void compare(const BenchModel& bm, const Registry& registry, double seconds) {
  const auto model = compile(bm.spec, registry, {.node_wrenches = false, .world_wrenches = false});
  const bool axes = model->angles.size() == static_cast<std::size_t>(model->nv) && model->nq == model->nv;
  if (!axes || !model->graded.swept.empty()) return fmt::print("| {} | | not a tree of revolute hinges alone | | | | | |\n", bm.name);
  const std::vector<Exact> truth = exact(bm, registry);
  const auto& S = soa::instruction_set().one;
  Workspace ws(*model), general(*model);
  Eigen::VectorXd numbers(static_cast<Eigen::Index>(2 * ws.sines.size()) + 2 * model->nv), out(model->nv);
  for (const bool inverse : {false, true}) {
    const Printed printed = print(*model, bm.states.back(), inverse);
    const Straight straight = compiled(printed.code);
    const auto inputs = [&](int k) {
      const BenchState& s = bm.states[static_cast<std::size_t>(k)];
      Inputs in;
      in.q = s.q.data(), in.v = s.v.data(), in.tau = s.tau.data(), in.vdot = s.vdot.data();
      return in;
    };
    const auto run_straight = [&](int k) {
      const Inputs in = inputs(k);
      S.hinge_records(*model, ws, in);
      const auto n = ws.sines.size(), nv = static_cast<std::size_t>(model->nv);
      double* to = numbers.data();
      to = std::copy_n(ws.sines.data(), n, to), to = std::copy_n(ws.cosines.data(), n, to);
      to = std::copy_n(in.v, nv, to), std::copy_n(inverse ? in.vdot : in.tau, nv, to);
      straight(numbers.data(), out.data());
    };
    const auto run_general = [&](int k) {
      const Inputs in = inputs(k);
      inverse ? inverse_dynamics(*model, general, in, out.data()) : static_cast<void>(forward_dynamics(*model, general, in, out.data()));
    };
    const auto worst = [&](const auto& run) {
      double error = 0.0;
      for (std::size_t s = 0; s < truth.size(); ++s) {
        run(static_cast<int>(s));
        error = std::max(error, relative_error(out, inverse ? truth[s].tau : truth[s].vdot));
      }
      return error;
    };
    const double e_general = worst(run_general), e_straight = worst(run_straight);
    const int states = static_cast<int>(bm.states.size());
    double t_general = INFINITY, t_straight = INFINITY;
    for (int round = 0; round < 5; ++round) {
      t_general = std::min(t_general, time_ring(states, seconds / 5.0, run_general).min_ns);
      t_straight = std::min(t_straight, time_ring(states, seconds / 5.0, run_straight).min_ns);
    }
    fmt::print("| {} | {} | {} | {:.4g} | {:.1e} | {:.4g} | {:.1e} | {:.2f} |\n", bm.name,
               inverse ? "inverse dynamics" : "forward dynamics", printed.operations, t_general, e_general, t_straight, e_straight,
               t_straight / t_general);
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace cardan::bench

int main(int argc, char** argv) {
  using namespace cardan::bench;
  std::string models = CARDAN_SOURCE_DIR "/tests/reference/bench", only = "chain_7";
  double seconds = 1.0;
  CommandLine line("What straight-line code for one fixed model would save.");
  line.option("--models", models, "folder of models in the schema cardan-bench/1");
  line.option("--only", only, "models whose name contains this");
  line.option("--seconds", seconds, "time spent on each figure");
  if (const auto code = line.parse(argc, argv)) return *code;
  stay_on_this_core();
  cardan::Registry registry;
  cardan::register_hinges(registry);
  cardan::register_bodies(registry);
  fmt::print(
      "| model | | operations of the straight code | general, ns | error | straight, ns | error | ratio "
      "|\n|---|---|---:|---:|---:|---:|---:|---:|\n");
  for (const auto& file : models_in(models))
    if (file.stem().string().find(only) != std::string::npos) compare(read_model(file), registry, seconds);
  return 0;
}
