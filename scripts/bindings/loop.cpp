// What closes a loop: sat:loop "strut".
#include <fmt/format.h>

#include "scripts/bindings/handle.hpp"
#include "scripts/bindings/profile.hpp"

namespace cardan {
namespace {

const LoopSpec& spec_of(const Handle& h) { return h.scenario->model->spec->loops[static_cast<std::size_t>(h.index)]; }
/// -1: it is open.
int closed(const Handle& h) { return h.scenario->sim->model().loops.find(spec_of(h).name); }

/// Of what it holds `to` with; zero while it is open.
int loop_reaction(lua_State* L) {
  const Handle& h = self<Kind::loop>(L);
  expect_state(L, *h.scenario, "the reaction of a loop");
  if (spec_of(h).type == "coupling")
    refuse(L, Code::lua_argument, "reaction of " + spec_of(h).name, "a loop that holds one place to another", "a coupling",
           "its multiplier() says what it pushes with");
  const int loop = closed(h);
  const Force<double> f = loop < 0 ? Force<double>{} : h.scenario->sim->loop_wrench(loop);
  for (const double x : {f.n.x, f.n.y, f.n.z, f.f.x, f.f.y, f.f.z}) lua_pushnumber(L, x);
  return 6;
}

/// Of the only row of a distance or coupling.
int loop_multiplier(lua_State* L) {
  const Handle& h = self<Kind::loop>(L);
  expect_state(L, *h.scenario, "the multiplier of a loop");
  const std::string& type = spec_of(h).type;
  if (type != "coupling" && type != "distance")
    refuse(L, Code::lua_argument, "multiplier of " + spec_of(h).name, "a distance or a coupling", type, "its reaction() has six numbers");
  const int loop = closed(h);
  const auto row = [&] { return static_cast<std::size_t>(h.scenario->sim->model().loops.all[static_cast<std::size_t>(loop)].first); };
  lua_pushnumber(L, loop < 0 ? 0.0 : h.scenario->sim->loop_forces().multipliers[row()]);
  return 1;
}

/// The length or offset that it has now, and its rate.
int loop_given(lua_State* L) {
  const Handle& h = self<Kind::loop>(L);
  expect_state(L, *h.scenario, "the length of a loop");
  const LoopSpec& spec = spec_of(h);
  if (spec.type != "coupling" && spec.type != "distance")
    refuse(L, Code::lua_argument, "length of " + spec.name, "a distance or a coupling", spec.type);
  const bool distance = spec.type == "distance";
  LoopDrive drive;
  double length = distance ? spec.length : spec.offset;
  h.scenario->sim->observe();
  if (const int at = closed(h); at >= 0) {
    const Loop& loop = h.scenario->sim->model().loops.all[static_cast<std::size_t>(at)];
    length = distance ? loop.length : loop.coupling.offset;
    if (loop.drive >= 0) drive = h.scenario->sim->drives()[static_cast<std::size_t>(loop.drive)];
  }
  lua_pushnumber(L, length + drive.more);
  lua_pushnumber(L, drive.rate);
  return 2;
}

int loop_profile(lua_State* L) {
  const Handle& h = self<Kind::loop>(L);
  Scenario& s = *h.scenario;
  const LoopSpec& spec = spec_of(h);
  expect_state(L, s, "a profile");
  lua_settop(L, 2);
  DiagnosticSink sink;
  LuaTable t(L, 2, "profile of " + spec.name, sink);
  sink.throw_if_any();
  if (!spec.prescribed || closed(h) < 0)
    refuse(L, Code::lua_argument, "profile of " + spec.name, "a loop that is prescribed, and closed",
           spec.prescribed ? "an open one" : "one that is not prescribed",
           spec.prescribed ? "sat:close(name) closes it" : fmt::format("say so in the vehicle: loops.{}.prescribed: true", spec.name));
  MotionProfile profile = read_profile(L, t, spec.type == "distance" ? "m/s" : "1/s");
  t.finish();
  sink.throw_if_any();
  s.sim->prescribe_loop(spec.name, std::move(profile));
  return 0;
}

}  // namespace

const std::vector<luaL_Reg>& loop_methods() {
  static const std::vector<luaL_Reg> all = {{"reaction", method<loop_reaction, 0>},
                                            {"multiplier", method<loop_multiplier, 0>},
                                            {"length", method<loop_given, 0>},
                                            {"offset", method<loop_given, 0>},
                                            {"profile", method<loop_profile, 1>}};
  return all;
}

}  // namespace cardan
