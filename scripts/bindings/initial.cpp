// initial { ... }: the state that a mission begins with, in the grammar of the vehicle's `initial`.
#include <fmt/format.h>

#include <algorithm>

#include "core/model/devices.hpp"
#include "core/model/doubts.hpp"
#include "core/model/initial.hpp"
#include "scripts/bindings/bind.hpp"
#include "scripts/lua/function.hpp"
#include "scripts/lua/sandbox.hpp"

namespace cardan {
namespace {

constexpr int kDeepest = 10;

/// The value at `index` as a document: numbers and texts, arrays, tables with names. What is none of these is empty.
DocNode document(lua_State* L, int index, const SourceMark& mark, int depth = 0) {
  DocNode node;
  node.mark = mark;
  index = lua_absindex(L, index);
  luaL_checkstack(L, 8, nullptr);
  const int type = lua_type(L, index);
  if (type == LUA_TNUMBER || type == LUA_TSTRING) {
    node.kind = DocNode::Kind::scalar;
    node.text = type == LUA_TNUMBER ? fmt::format("{}", lua_tonumber(L, index)) : lua_tostring(L, index);
  } else if (type == LUA_TTABLE && depth < kDeepest) {
    const lua_Integer n = push_keys(L, index), entries = static_cast<lua_Integer>(lua_rawlen(L, index));
    if (entries > 0 && entries != n) return lua_pop(L, 1), node;  // a list that has names too
    node.kind = entries > 0 ? DocNode::Kind::list : DocNode::Kind::map;
    for (lua_Integer i = 1; i <= n; ++i) {
      lua_rawgeti(L, -1, i);
      if (node.kind == DocNode::Kind::map)
        node.keys.push_back({lua_type(L, -1) == LUA_TSTRING ? lua_tostring(L, -1) : describe_value(L, -1), mark});
      lua_rawget(L, index);
      node.items.push_back(document(L, -1, mark, depth + 1));
      lua_pop(L, 1);
    }
    lua_pop(L, 1);
  }
  return node;
}

void read_modes(MapReader& map, const char* key, const char* unit, int n, double* x) {
  if (n == 0) return;
  if (const auto given = map.find(key)) {
    const std::vector<double> values = read_numbers(*given, unit, static_cast<std::size_t>(n), map.context());
    std::copy(values.begin(), values.end(), x);
  }
}

/// What the vehicle gives, and initial{} before, without what the assembler found: components of a hinge that is given in part are as
/// there.
void forget_what_was_found(const Scenario& s, State& state) {
  const State start =
      compile(with_open_loops(s.beginning ? *s.beginning : *s.changes.described()), s.registry, s.compile_options())->initial_state();
  state.q = start.q, state.v = start.v;
}

/// The state that closes the loops of the vehicle, as if the vehicle's file gave these values: hinges that nothing is given for follow.
void close_start(lua_State* L, Scenario& s, const std::vector<InitialGiven>& given, State& state) {
  auto spec = std::make_shared<SystemSpec>(s.beginning ? *s.beginning : *s.changes.described());
  for (const UserBody& u : s.model->user) {
    const auto i = static_cast<std::size_t>(&u - s.model->user.data());
    BodySpec& b = spec->bodies[i];
    if (given[i].coordinates) b.hinge.q.assign(state.q.data() + u.q, state.q.data() + u.q + u.nq);
    if (given[i].velocities) b.hinge.v.assign(state.v.data() + u.v, state.v.data() + u.v + u.nv);
    b.eta.assign(state.q.data() + u.eta, state.q.data() + u.eta + u.n_modes);
    b.etadot.assign(state.v.data() + u.etadot, state.v.data() + u.etadot + u.n_modes);
  }
  try {
    const std::shared_ptr<const Model> closed = compile(spec, s.registry, s.compile_options());
    const State start = closed->initial_state();
    state.q = start.q, state.v = start.v;
    if (!s.open_start.empty()) {  // now that it closes it is what this mission's vehicle begins with
      s.sim->set_state(state);
      s.changes.begin_at(spec);
      s.open_start.clear();
      s.use_model(closed);
    }
    s.beginning = std::move(spec), s.moved_by_beginning = closed->loops.moved;
    s.warnings.add(fast_found_rates(*s.model, s.moved_by_beginning, state.v.data()));
  } catch (const InputError& e) {
    std::vector<Diagnostic> all = e.diagnostics();
    for (Diagnostic& d : all) d.stack = LuaHost::traceback(L);
    throw InputError(std::move(all));
  }
}

/// The coordinates of a hinge that is locked are in its model, as the vehicle's file gives them.
void refuse_locked(MapReader& map, const BodySpec& body, const cardan_hinge_family& family, DiagnosticSink& sink) {
  std::vector<double> q(family.nq), v(family.nv);
  const InitialGiven given = read_initial(map, family, q.data(), v.data());
  if (given.coordinates || given.velocities)
    sink.report(Code::bad_initial_state, map.ref().at(), "values of a hinge that moves",
                fmt::format("those of {}, which is locked", body.name),
                fmt::format("it is held where `initial` of bodies.{}.hinge in the vehicle's file says", body.name));
}

int initial(lua_State* L, Scenario& s) {
  expect_setup(L, s, "initial", true);
  const DocNode given = document(L, 1, LuaHost::caller(L));
  DiagnosticSink sink;
  std::vector<std::pair<std::string, std::string>> no_defaults;
  ReadContext context{sink, no_defaults, &s.warnings};
  MapReader bodies({&given, "initial"}, context);
  State state = s.sim->state();
  const bool loops = !s.model->loops.empty() || !s.open_start.empty();
  if (loops) forget_what_was_found(s, state);
  std::vector<InitialGiven> by_mission(s.model->user.size());
  for (const UserBody& u : s.model->user) {
    const auto value = bodies.find(u.name);
    if (!value) continue;
    MapReader map(*value, context);
    if (u.nq > 0) {
      double* q = state.q.data() + u.q;
      InitialGiven& of_hinge = by_mission[static_cast<std::size_t>(&u - s.model->user.data())];
      of_hinge = read_initial(map, *u.hinge, q, state.v.data() + u.v);
      if (of_hinge.coordinates) settle_coordinates(*u.hinge, u.hinge_packed.data(), q, map.ref().at(), sink);
    } else if (const BodySpec& body = *s.model->spec->find(u.name); body.hinge.locked)
      refuse_locked(map, body, *s.registry.hinge(body.hinge.type), sink);
    read_modes(map, "eta", "1", u.n_modes, state.q.data() + u.eta);
    read_modes(map, "etadot", "1/s", u.n_modes, state.v.data() + u.etadot);
    map.finish();
  }
  for (const DeviceSpec& device : s.model->spec->devices)
    if (const auto value = s.model->spec->find(device.name) ? std::nullopt : bodies.find(device.name))
      sink.report(Code::unknown_key, value->at(), "a body", fmt::format("the device {}", device.name),
                  fmt::format("its states begin as the vehicle says: devices.{}.initial", device.name));
  bodies.finish();
  if (!sink.empty()) {
    std::vector<Diagnostic> all = sink.all();
    for (Diagnostic& d : all) d.stack = LuaHost::traceback(L);
    throw InputError(std::move(all));
  }
  if (const Devices& d = s.model->devices; !d.all.empty() && !d.from_home && is_far(*s.model, state.q.data(), state.v.data())) {
    s.begins_far = true;
    s.use_model(compile(s.described(), s.registry, s.compile_options()));
  }
  if (loops) close_start(L, s, by_mission, state);
  s.sim->set_state(state);
  s.look_at_state();
  return 0;
}

}  // namespace

void bind_initial(Scenario& s) {
  s.lua.bind("initial", [&s](lua_State* L) { return initial(L, s); });
}

}  // namespace cardan
