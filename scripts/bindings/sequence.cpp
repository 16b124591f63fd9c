// Plans written from top to bottom: sequence { ... }, and what its function waits by: wait, at, wait_until.
#include <fmt/format.h>

#include <cmath>

#include "scripts/bindings/handle.hpp"
#include "scripts/lua/table.hpp"

namespace cardan {
namespace {

using Wait = Sequences::Wait;

int sequence(lua_State* L, Scenario& s) {
  expect_setup(L, s, "sequence", true);
  DiagnosticSink sink;
  LuaTable t(L, 1, "sequence", sink);
  const std::string name = t.text("name").value_or("");
  if (name.empty())
    t.reject("name", "a name");
  else if (s.names.contains({"sequence", name}))
    t.reject("name", "a name that no other sequence has");
  auto run = t.function("run");
  t.require({"run"});
  const bool starts = t.flag("start").value_or(true);
  t.finish();
  sink.throw_if_any();
  s.names.insert({"sequence", name});
  push_handle(L, Kind::sequence, s.sequences.declare(name, std::move(*run), starts, LuaHost::caller(L)), s);
  return 1;
}

/// wait(duration)
int wait(lua_State* L, Scenario& s) {
  Sequences& all = s.sequences;
  Sequences::Sequence& me = all.asking(L, "wait");
  const double duration = seconds_at(L, 1, "wait");
  if (!(duration >= 0.0))
    refuse(L, Code::lua_argument, "wait", "a time >= 0 s", describe_value(L, 1), "at(t) waits for a time of the mission");
  lua_settop(L, 1);
  const Sequences::Moment& now = all.now(me);
  Wait wait;
  wait.kind = Sequences::Kind::instant;
  wait.until = Sequences::after(now, duration);
  wait.told = fmt::format("{:g} s", duration);
  if (all.at_once(me, [&] { return !(wait.until.t > now.t); })) return 0;
  return all.pause(L, me, std::move(wait));
}

/// at(time)
int at(lua_State* L, Scenario& s) {
  Sequences& all = s.sequences;
  Sequences::Sequence& me = all.asking(L, "at");
  const double t = seconds_at(L, 1, "at");
  const double now = all.now(me).t;
  lua_settop(L, 1);
  Wait wait;
  wait.kind = Sequences::Kind::instant;
  wait.until = Sequences::moment(t);
  wait.told = fmt::format("t = {:g} s", t);
  const auto is_now = [&] {
    if (t < now)
      refuse(L, Code::lua_argument, fmt::format("at({:g} s)", t), fmt::format("a time from now on, {:g} s", now), fmt::format("{:g} s", t),
             "the plan is late: mission.time() tells by how much, wait(duration) counts from now");
    return t == now;
  };
  if (all.at_once(me, is_now)) return 0;
  return all.pause(L, me, std::move(wait));
}

/// wait_until(condition, {rate or period, direction, timeout, otherwise}) -> whether it holds
int wait_until(lua_State* L, Scenario& s) {
  Sequences& all = s.sequences;
  Sequences::Sequence& me = all.asking(L, "wait_until");
  if (lua_type(L, 1) != LUA_TFUNCTION)
    refuse(L, Code::lua_argument, "wait_until", "the function of a condition", describe_value(L, 1),
           "wait_until(function() return panel:angle() - 1.57 end)");
  lua_settop(L, 2);
  if (lua_isnil(L, 2)) lua_newtable(L), lua_replace(L, 2);
  const Sequences::Moment now = all.now(me);
  Wait wait;
  {
    DiagnosticSink sink;
    LuaTable t(L, 2, "wait_until", sink);
    const Located here{"wait_until", LuaHost::caller(L)};
    const auto rate = t.number("rate", "Hz"), period = t.number("period", "s"), timeout = t.number("timeout", "s");
    const auto direction = t.choice("direction", {"rising", "falling", "both"});
    const bool looked = t.has("rate") || t.has("period");
    if (t.has("rate") && t.has("period")) t.reject("period", "rate or period, not both");
    if (looked && direction) t.reject("direction", "no rate beside it: what is looked at is true or false");
    if (timeout && !(*timeout > 0.0)) t.reject("timeout", "a time > 0");
    t.function("otherwise");
    if (t.has("otherwise") && !t.has("timeout")) t.reject("otherwise", "a timeout beside it, after which it follows");
    t.finish();
    sink.throw_if_any();
    wait.kind = looked ? Sequences::Kind::looked : Sequences::Kind::located;
    if (looked) {
      wait.period = rate ? period_from_hertz(*rate, here) : period_from_seconds(*period, here);
      const Instant next = next_tick(wait.period, now.t);
      wait.look = {next.seconds(), next};
    }
    wait.side = direction == "rising" ? 1 : direction == "falling" ? -1 : 0;
    wait.told = looked ? fmt::format("a condition that is looked at every {:g} s", wait.period.value()) : "a zero that is located";
    if (timeout) wait.until = Sequences::after(now, *timeout), wait.late = fmt::format("timeout of {:g} s", *timeout);
  }
  lua_getfield(L, 2, "otherwise");  // at 3
  const bool located = wait.kind == Sequences::Kind::located;
  const auto holds = [&] {
    const double x = all.look(L, 1, located);
    return located ? all.has_passed(me, wait, x) : x != 0.0;
  };
  if (all.at_once(me, holds)) {
    lua_pushboolean(L, 1);
    return 1;
  }
  return all.pause(L, me, std::move(wait), true);
}

Sequences& sequences(const Handle& h) { return h.scenario->sequences; }

int sequence_start(lua_State* L) {
  const Handle& h = self<Kind::sequence>(L);
  sequences(h).start(L, h.index, h.scenario->stage == Scenario::Stage::setup);
  return 0;
}
int sequence_stop(lua_State* L) {
  const Handle& h = self<Kind::sequence>(L);
  return sequences(h).stop(L, h.index);
}
int sequence_state(lua_State* L) {
  const Handle& h = self<Kind::sequence>(L);
  lua_pushstring(L, Sequences::name_of(h.sequence().state));
  return 1;
}
int sequence_waits_for(lua_State* L) {
  const Sequences::Sequence& me = self<Kind::sequence>(L).sequence();
  lua_pushstring(L, me.state == Sequences::State::waiting ? me.wait.text().c_str() : "");
  return 1;
}

}  // namespace

const std::vector<luaL_Reg>& sequence_methods() {
  static const std::vector<luaL_Reg> all = {{"start", method<sequence_start, 0>},
                                            {"stop", method<sequence_stop, 0>},
                                            {"state", method<sequence_state, 0>},
                                            {"waits_for", method<sequence_waits_for, 0>}};
  return all;
}

void bind_sequences(Scenario& s) {
  s.sequences.know_handles(is_handle);
  s.lua.bind("sequence", [&s](lua_State* L) { return sequence(L, s); });
  const auto bind = [&s](const char* name, int (*f)(lua_State*, Scenario&), int arguments) {
    s.lua.bind(name, limited(arguments, [&s, f](lua_State* L) { return f(L, s); }), false);  // what they answer is in the journal
  };
  bind("wait", wait, 1);
  bind("at", at, 1);
  bind("wait_until", wait_until, 2);
}

}  // namespace cardan
