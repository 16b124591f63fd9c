#include "core/model/loops.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "core/base/units.hpp"
#include "core/model/params.hpp"
#include "core/model/validate.hpp"

namespace cardan {
namespace {

constexpr Closing kClosings[] = {Closing::weld, Closing::point, Closing::line, Closing::plane, Closing::distance, Closing::coupling};

int rows_of(Closing closing, const cardan_hinge_family* hinge) {
  switch (closing) {
    case Closing::weld:
      return 6;
    case Closing::point:
      return 3;
    case Closing::line:
      return 2;
    case Closing::plane:
    case Closing::distance:
    case Closing::coupling:
      return 1;
    case Closing::hinge:
      return 6 - static_cast<int>(hinge->nv);
  }
  return 0;
}

class LoopCompiler {
 public:
  LoopCompiler(const SystemSpec& spec, const Registry& registry, Model& model, DiagnosticSink& sink)
      : spec_(spec), registry_(registry), model_(model), sink_(sink) {}

  Loops run() {
    Loops loops;
    if (std::ranges::any_of(spec_.loops, [](const LoopSpec& l) { return !l.open; })) refuse_what_loops_exclude();
    std::set<std::string_view> names;
    for (std::size_t i = 0; i < spec_.loops.size(); ++i) {
      const LoopSpec& given = spec_.loops[i];
      if (given.name.empty() || given.name.find('.') != std::string::npos)
        report(Code::bad_name, given, "", "a name without a point", in_quotes(given.name));
      if (!names.insert(given.name).second)
        report(Code::duplicate_name, given, "", "a name of its own for each loop", in_quotes(given.name));
      Loop loop;
      loop.name = given.name, loop.type = given.type, loop.spec = static_cast<int>(i);
      if (!find_type(given, loop)) continue;
      loop.rows = rows_of(loop.closing, loop.hinge);
      if (given.prescribed && loop.closing != Closing::distance && loop.closing != Closing::coupling)
        report(Code::bad_loop, given, "prescribed", "a type with a length or an offset: distance, coupling", in_quotes(given.type));
      if (given.as_found && loop.closing == Closing::coupling && (given.prescribed || !given.functions.empty()))
        report(Code::unsupported, given, "as_found", "a coupling of terms alone, whose offset is found when it closes",
               given.prescribed ? "one whose offset is prescribed" : "one with functions");
      if (loop.closing != Closing::coupling)
        join(given, loop);
      else if (!given.open)
        couple(given, loop);
      if (given.open) continue;
      refuse_curved(given, loop);
      if (given.prescribed) loop.drive = loops.n_drives++;
      loop.first = loops.rows;
      loops.rows += loop.rows;
      loops.all.push_back(std::move(loop));
    }
    return loops;
  }

 private:
  void refuse_what_loops_exclude() {
    for (const BodySpec& b : spec_.bodies)
      if (!b.prescribed_modes.empty())
        sink_.report(Code::unsupported, spec_.locate(body_path(b)), "a vehicle without closed loops, or modes that are free",
                     "modes with a given motion");
  }

  /// Bodies whose family tells how their nodes move are neither on the way of a loop nor its home.
  void refuse_curved(const LoopSpec& given, const Loop& loop) {
    if (loop.rates.empty()) return;  // reported
    std::set<int> way;               // what it moves, and inboard of that up to where all of it meets
    for (int k = static_cast<int>(model_.bodies.size()) - 1; k > 0; --k) {
      const SweepBody& b = model_.bodies[static_cast<std::size_t>(k)];
      const auto moves = [&](int v, int n) { return std::ranges::any_of(loop.rates, [&](int rate) { return v <= rate && rate < v + n; }); };
      if (moves(b.v, b.nv)) way.insert({k, b.parent});
      if (moves(b.etadot, b.n_modes)) way.insert(k);
    }
    std::set<int> left = way;
    while (left.size() > 1) {  // inboard bodies have smaller indices
      const int outer = *left.rbegin(), inboard = model_.bodies[static_cast<std::size_t>(outer)].parent;
      left.erase(outer), left.insert(inboard), way.insert(inboard);
    }
    for (const int k : way) {
      const SweepBody& b = model_.bodies[static_cast<std::size_t>(k)];
      if (b.n_modes == 0 || !model_.flexible[static_cast<std::size_t>(b.flexible)].curved) continue;
      const UserBody& u = model_.user[static_cast<std::size_t>(model_.owner[static_cast<std::size_t>(k)])];
      sink_.report(Code::unsupported, spec_.locate("loops." + given.name), "a way of bodies whose nodes move along constant shapes",
                   fmt::format("{}, whose type {} tells how they move", u.name, in_quotes(u.type)));
    }
  }

  void report(Code code, const LoopSpec& loop, const std::string& key, std::string expected, std::string got, std::string hint = {}) {
    sink_.report(code, spec_.locate(fmt::format("loops.{}{}{}", loop.name, key.empty() ? "" : ".", key)), std::move(expected),
                 std::move(got), std::move(hint));
  }

  bool find_type(const LoopSpec& given, Loop& loop) {
    const std::vector<std::string>& own = closure_types();
    if (const auto at = std::ranges::find(own, given.type); at != own.end()) {
      loop.closing = kClosings[at - own.begin()];
      return true;
    }
    loop.closing = Closing::hinge;
    loop.hinge = registry_.hinge(given.type);
    if (!loop.hinge) {
      std::vector<std::string> types = registry_.hinges.types();
      std::erase_if(types, [&](const std::string& type) { return registry_.hinge(type)->nv >= 6; });  // which hold nothing
      std::ranges::sort(types);
      types.insert(types.begin(), own.begin(), own.end());
      report(Code::unknown_loop_type, given, "type",
             fmt::format("a closure or a hinge type: {}, or one from a loaded plugin", fmt::join(types, ", ")), in_quotes(given.type),
             did_you_mean(given.type, types));
      return false;
    }
    if (loop.hinge->nv >= 6) {
      report(Code::bad_loop, given, "type", "a type that holds something",
             fmt::format("{}, which leaves all six motions free", in_quotes(given.type)));
      return false;
    }
    const cardan_hinge_family& f = *loop.hinge;
    loop.packed = pack_params(spec_, {"loops." + given.name, fmt::format("hinge type {}", f.type), given.params},
                              {{f.params, f.n_params}, f.params_size, f.pack, f.packed_size}, sink_);
    return !loop.packed.empty() || (f.params_size == 0 && !f.packed_size);
  }

  // Two places on bodies that can move against each other.
  void join(const LoopSpec& given, Loop& loop) {
    if (loop.closing == Closing::distance && !(given.length > 0.0 && std::isfinite(given.length)))
      report(Code::out_of_range, given, "length", "a length > 0", fmt::format("{:g} m", given.length),
             given.length == 0.0 ? "two points that coincide are held by `type: point`" : "");
    loop.length = given.length;
    const bool found = find_end(given, given.from, "from", loop.from);
    if (!find_end(given, given.to, "to", loop.to) || !found || given.open) return;
    if (loop.from.sweep == loop.to.sweep) {
      const bool same = given.from.body == given.to.body;
      return report(Code::bad_loop, given, "to", "a place on a body that moves against that of `from`",
                    same ? fmt::format("{} twice", given.to.body.empty() ? "the world" : in_quotes(given.to.body))
                         : fmt::format("{} and {}, which are fixed to each other", name_of(given.from), name_of(given.to)),
                    same ? "" : "while hinges are locked that fix them, the loop may be open (`open: true`; sat:open in a mission)");
    }
    find_paths(loop);
    if (loop.rates.empty())
      report(Code::bad_loop, given, "", "hinges or modes between `from` and `to` that move", "none of them has a velocity");
  }
  static std::string name_of(const PlaceSpec& place) { return place.body.empty() ? "the world" : in_quotes(place.body); }

  bool find_end(const LoopSpec& given, const PlaceSpec& place, const char* key, LoopEnd& end) {
    if (!place.position.allFinite()) {
      report(Code::out_of_range, given, fmt::format("{}.position", key), "three finite numbers", "a value that is not finite");
      return false;
    }
    const double error = (place.R * place.R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
    if (!(error < 1e-9) || place.R.determinant() < 0.0) {
      report(Code::not_a_rotation, given, fmt::format("{}.orientation", key), "an orthonormal right-handed matrix",
             fmt::format("an entry of R R^T - 1 is {:.3g}", error));
      return false;
    }
    const Pose<double> in_place{from_eigen(place.R), from_eigen(place.position)};
    if (place.body.empty()) {
      if (!place.node.empty()) {
        report(Code::unknown_node, given, key, "world without a node name", in_quotes("world." + place.node),
               fmt::format("give the place instead: {}: {{body: world, position: [x, y, z]}}", key));
        return false;
      }
      end.pose = in_place;
      return true;
    }
    const int user = model_.find_body(place.body);
    if (user < 0) {
      std::vector<std::string> legal;
      for (const UserBody& u : model_.user) legal.push_back(u.name);
      legal.emplace_back("world");
      report(Code::unknown_body, given, key, "a body: " + one_of(legal), in_quotes(place.body), did_you_mean(place.body, legal));
      return false;
    }
    const UserBody& u = model_.user[static_cast<std::size_t>(user)];
    const BodySpec& body = spec_.bodies[static_cast<std::size_t>(user)];
    end.sweep = u.sweep;
    if (place.node.empty()) {
      if (body.modal && has_mean_axes(*body.modal)) {
        report(Code::no_attachment, given, key, fmt::format("a node of {}", place.body), "its floating frame",
               "modes of `boundary: free` leave the frame at rest, so that a closure on it neither moves them nor is moved");
        return false;
      }
      end.node = static_cast<int>(model_.nodes.size());
      model_.nodes.push_back({fmt::format("loops.{}.{}", given.name, key), user, u.sweep, {u.pose * in_place, 0, {}}});
      return true;
    }
    end.node = model_.find_node(place.body + "." + place.node);
    if (end.node >= 0) return true;
    std::vector<std::string> legal;
    for (const UserNode& n : model_.nodes)
      if (n.body == user && n.name.starts_with(place.body + ".")) legal.push_back(n.name.substr(place.body.size() + 1));
    report(Code::unknown_node, given, key,
           legal.empty() ? fmt::format("no node name: body {} has no nodes", place.body)
                         : fmt::format("a node of body {}: {}", place.body, one_of(legal)),
           in_quotes(place.node), did_you_mean(place.node, legal));
    return false;
  }

  void find_paths(Loop& loop) const {
    int a = loop.from.sweep, b = loop.to.sweep;
    while (a != b) {  // inboard bodies have smaller indices
      int& outer = a > b ? a : b;
      (a > b ? loop.from_path : loop.to_path).push_back(outer);
      outer = model_.bodies[static_cast<std::size_t>(outer)].parent;
    }
    loop.home = a;
    const auto modes = [&](const SweepBody& body) {
      for (int j = 0; j < body.n_modes; ++j) loop.rates.push_back(body.etadot + j);
    };
    for (std::vector<int>* path : {&loop.from_path, &loop.to_path}) {
      std::ranges::reverse(*path);
      for (const int k : *path) {
        const SweepBody& body = model_.bodies[static_cast<std::size_t>(k)];
        for (int j = 0; j < body.nv; ++j) loop.rates.push_back(body.v + j);
        modes(body);
      }
    }
    modes(model_.bodies[static_cast<std::size_t>(a)]);  // they move the places of both ends on it
    std::ranges::sort(loop.rates);
  }

  void couple(const LoopSpec& given, Loop& loop) {
    loop.coupling.offset = given.offset;
    if (!std::isfinite(given.offset)) report(Code::out_of_range, given, "offset", "a finite number", fmt::format("{:g}", given.offset));
    if (given.terms.empty() && given.functions.empty())
      report(Code::missing_key, given, "terms", "terms or functions: hinges and their coefficients", "none");
    for (const LoopSpec::Term& term : given.terms)
      if (const int i = find_term(given, "terms." + term.target, term, loop); i >= 0) {
        double& coefficient = loop.coupling.terms[static_cast<std::size_t>(i)].coefficient;
        if (coefficient != 0.0) report(Code::duplicate_name, given, "terms." + term.target, "each coordinate once", in_quotes(term.target));
        coefficient = term.coefficient;
      }
    for (std::size_t i = 0; i < given.functions.size(); ++i) add_function(given, i, loop);
    std::ranges::sort(loop.rates);
  }

  /// Index into Coupling::terms, where it is added; -1: it is no coordinate, or its coefficient no number. "motor" of a hinge with one
  /// component, "arm.angle" of others.
  int find_term(const LoopSpec& given, const std::string& key, const LoopSpec::Term& term, Loop& loop) {
    std::vector<std::string> legal;
    CoupledRate found{-1, -1, 0.0};
    for (const UserBody& u : model_.user)
      for (int i = 0; i < u.nv && u.nq == u.nv; ++i) {
        const auto at = static_cast<std::size_t>(i);
        legal.push_back(u.nv == 1 ? u.name : u.name + "." + u.q_names[at]);
        if (term.target == legal.back() || term.target == u.name + "." + u.q_names[at] || term.target == u.name + "." + u.v_names[at])
          found.q = u.q + i, found.v = u.v + i;
      }
    if (found.v < 0) {
      const BodySpec* body = spec_.find(term.target.substr(0, term.target.find('.')));
      const bool locked = body && body->hinge.locked, loose = body && flies(body->hinge);
      report(locked || loose ? Code::bad_loop : Code::unknown_name, given, key,
             legal.empty() ? std::string("a coordinate of a hinge, of which there is none that moves")
                           : "a coordinate of a hinge: " + one_of(legal),
             fmt::format("{}{}", in_quotes(term.target),
                         locked  ? ", whose hinge is locked"
                         : loose ? ", which flies freely"
                                 : ""),
             locked || loose ? "meanwhile the loop may be open (`open: true`; sat:open in a mission)" : did_you_mean(term.target, legal));
      return -1;
    }
    if (!std::isfinite(term.coefficient) || term.coefficient == 0.0) {
      report(Code::out_of_range, given, key, "a finite number other than 0", fmt::format("{:g}", term.coefficient));
      return -1;
    }
    std::vector<CoupledRate>& terms = loop.coupling.terms;
    const auto known = std::ranges::find(terms, found.v, &CoupledRate::v);
    const auto index = static_cast<int>(known - terms.begin());
    if (known == terms.end()) terms.push_back(found), loop.rates.push_back(found.v);
    return index;
  }

  void add_function(const LoopSpec& given, std::size_t i, Loop& loop) {
    const LoopSpec::Function& function = given.functions[i];
    const std::string key = fmt::format("functions[{}]", i);
    const auto kind = std::ranges::find(function_kinds(), function.kind);
    const std::vector<double>& x = function.numbers;
    const bool finite = std::ranges::all_of(x, [](double number) { return std::isfinite(number); });
    if (kind == function_kinds().end() || x.empty() || !finite || !std::isfinite(function.scale) || !std::isfinite(function.phase) ||
        function.of.empty())
      return report(Code::out_of_range, given, key,
                    fmt::format("{}, with finite numbers, of at least one coordinate", one_of(function_kinds())),
                    fmt::format("{} with {} numbers", in_quotes(function.kind), x.size()));
    Coupling::Function out;
    out.F.kind = static_cast<SmoothFunction::Kind>(kind - function_kinds().begin());
    out.phase = function.phase;
    if (out.F.kind == SmoothFunction::Kind::table) {
      std::vector<double> points, values;
      for (std::size_t k = 0; k + 1 < x.size(); k += 2) points.push_back(x[k]), values.push_back(function.scale * x[k + 1]);
      const std::size_t least = function.periodic ? 3 : 2;
      const bool rises = std::ranges::adjacent_find(points, std::greater_equal<>()) == points.end();
      if (points.size() < least || x.size() % 2 != 0 || !rises)
        return report(Code::out_of_range, given, key + ".table",
                      fmt::format("at least {} rows of two numbers, the first of which rises", least),
                      rises ? fmt::format("{} numbers", x.size()) : "one that does not rise");
      if (function.periodic && values.front() != values.back())
        return report(Code::out_of_range, given, key + ".table", "the same value in the last row as in the first, where it repeats",
                      fmt::format("{:g} and {:g}", x[1], x.back()));
      out.F = SmoothFunction::through(points, values, function.periodic);
    } else {
      out.F.numbers = x;
      for (double& number : out.F.numbers) number *= function.scale;
    }
    for (const LoopSpec::Term& term : function.of) {
      const int at = find_term(given, fmt::format("{}.of.{}", key, term.target), term, loop);
      if (at < 0) return;
      if (std::ranges::count(out.of, at, &Coupling::Function::Argument::term) > 0)
        return report(Code::duplicate_name, given, fmt::format("{}.of.{}", key, term.target), "each coordinate once",
                      in_quotes(term.target));
      out.of.push_back({at, term.coefficient});
    }
    loop.coupling.functions.push_back(std::move(out));
  }

  const SystemSpec& spec_;
  const Registry& registry_;
  Model& model_;
  DiagnosticSink& sink_;
};

}  // namespace

const std::vector<std::string>& closure_types() {
  static const std::vector<std::string> all = {"weld", "point", "line", "plane", "distance", "coupling"};
  return all;
}

const std::vector<std::string>& loop_forms() {
  static const std::vector<std::string> all = {"auto", "multipliers", "embedding", "dae"};
  return all;
}

int Loops::find(std::string_view name) const {
  const auto found = std::ranges::find(all, name, &Loop::name);
  return found == all.end() ? -1 : static_cast<int>(found - all.begin());
}

Loops compile_loops(const SystemSpec& spec, const Registry& registry, Model& model, DiagnosticSink& sink) {
  return LoopCompiler(spec, registry, model, sink).run();
}

void require_open_tree(const Model& model, std::string_view what) {
  if (model.loops.empty()) return;
  std::vector<std::string> names;
  for (const Loop& loop : model.loops.all) names.push_back(loop.name);
  refuse(Code::unsupported, model.spec ? model.spec->locate("loops") : Located{"loops"},
         fmt::format("an open tree: {} do not honour closed loops", what), fmt::format("loops: {}", fmt::join(names, ", ")));
}

void sweep_open_tree(Model& model) {
  const auto at =
      std::ranges::find_if(model.program, [](const Op& op) { return op.code == OpCode::embedding || op.code == OpCode::absolute; });
  if (at == model.program.end()) return;
  const int n = static_cast<int>(model.runs.size());
  std::vector<Op> ops;
  for (int r = n - 1; r >= 0; --r) ops.push_back({OpCode::inward, r});
  for (int r = 0; r < n; ++r) ops.push_back({OpCode::acceleration, r});
  ops.push_back({OpCode::loops});
  model.program.insert(model.program.erase(at), ops.begin(), ops.end());
}

namespace {
void close_in_one(Model& model, OpCode code) {
  std::erase_if(model.program, [](const Op& op) { return op.code == OpCode::inward || op.code == OpCode::acceleration; });
  std::ranges::find(model.program, OpCode::loops, &Op::code)->code = code;
}
}  // namespace

void sweep_embedded(Model& model) { close_in_one(model, OpCode::embedding); }
void sweep_absolute(Model& model) { close_in_one(model, OpCode::absolute); }

std::shared_ptr<const Model> open_tree(std::shared_ptr<const Model> model) {
  if (model->loops.empty()) return model;
  auto open = std::make_shared<Model>(*model);
  open->loops = {};
  sweep_open_tree(*open);
  if (!open->has(OpCode::node_wrenches)) std::ranges::find(open->program, OpCode::keep, &Op::code)->code = OpCode::node_wrenches;
  std::erase_if(open->program, [](const Op& op) { return op.code == OpCode::keep || op.code == OpCode::loops; });
  return open;
}

}  // namespace cardan
