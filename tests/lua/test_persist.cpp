// What a script remembers: tables of persist{} as a checkpoint holds them, and what it names of the rest.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "scripts/lua/matrix.hpp"
#include "scripts/lua/persist.hpp"

namespace cardan {
namespace {

/// A host with persist{}, after its set-up.
struct Script {
  explicit Script(const std::string& setup, LuaOptions options = {}) : host(with_print(std::move(options))), persistent(host) {
    open_matrices(host);
    host.bind("persist", [this](lua_State* L) {
      persistent.declare(L, 1);
      return 1;
    });
    host.run_text("scenario.lua", setup);
    persistent.seal();
  }
  LuaOptions with_print(LuaOptions o) {
    o.print = [this](std::string_view line) { printed.append(line) += '\n'; };
    return o;
  }
  Checkpoint checkpoint() {
    Archive all;
    persistent.remember(all.block("script"));
    return all.checkpoint();
  }
  void resume(const Checkpoint& from) {
    Archive all(from);
    persistent.remember(all.block("script"));
    all.finish();
  }
  std::string run(const std::string& text) {
    printed.clear();
    host.run_text("run.lua", text);
    return printed;
  }
  std::string printed;
  LuaHost host;
  Persistent persistent;
};

/// What `show` prints after `change` in one script, and in another one that is resumed from it.
void expect_kept(const std::string& setup, const std::string& change, const std::string& show) {
  Script first(setup);
  first.run(change);
  EXPECT_EQ(first.persistent.elsewhere(), std::vector<std::string>{}) << change;
  const Checkpoint checkpoint = first.checkpoint();
  Script second(setup);
  second.resume(checkpoint);
  EXPECT_TRUE(second.checkpoint() == checkpoint) << change;
  EXPECT_EQ(second.run(show), first.run(show)) << change;
}

TEST(Persist, KeepsValuesOfEachKind) {
  expect_kept("m = persist { n = 0, gone = 1 }",
              "m.n = 0.1; m.i = 3; m.big = math.maxinteger; m.inf = 1/0; m.tiny = 5e-324; m.s = 'a\\n\\0\\xff'; m.u = 'ä'; m.t = true; m.f "
              "= false; "
              "m.gone = nil; m[1] = 'one'; m[2.5] = 2; m[true] = 'yes'; m[-1] = -0.0",
              "for k, v in pairs(m) do print(k, math.type(v), v, v == v and v) end print(#m.s, m.s:byte(3, 4), 1 / m[-1])");
}

TEST(Persist, KeepsTablesThatAreSharedOrHoldThemselves) {
  expect_kept(
      "m = persist { list = { 1, 2 } } local inner = m.list; function sum() local s = 0 for _, x in ipairs(inner) do s = s + x end return "
      "s end",
      "m.list[3] = 7; m.self = m; m.a = { x = 1 }; m.b = m.a; m.list[1] = nil; m.list[1] = 5",
      "print(sum(), m.self == m, m.a == m.b, m.a.x) m.a.x = 2 print(m.b.x)");
}

TEST(Persist, KeepsVectorsAndMatrices) {
  expect_kept("m = persist { v = vector { 1, 2, 3 } } local v = m.v; function first() return v[1] end",
              "m.v[1] = 0.1; m.w = vector { 4, 5 }; m.A = matrix { { 1, 2, 3 }, { 4, 5, 6 } }; m.A:set(2, 3, 1)",
              "print(first(), m.v, m.w, m.A, m.w:norm())");
}

TEST(Persist, KeepsFunctionsOfSetUpAndTheRandomNumbers) {
  expect_kept("m = persist { f = function() return 3 end, n = 1 }", "m.n = m.f() for i = 1, 17 do math.random() end",
              "print(m.n, m.f(), math.random(), math.random(1000))");
}

TEST(Persist, NamesWhatItDoesNotHold) {
  const auto elsewhere = [](const std::string& setup, const std::string& change) {
    Script script(setup);
    script.run(change);
    std::string all;
    for (const std::string& name : script.persistent.elsewhere()) all += name + "\n";
    return all;
  };
  const std::string setup =
      "local n = 0\nlocal log = { last = 0 }\nlocal v = vector { 1, 2 }\n"
      "m = persist { t = {} }\n"
      "function count() n = n + 1 end\nfunction note(x) log.last = x end\nfunction set(x) v[1] = x end\n"
      "function read() return n, log, v end";
  EXPECT_EQ(elsewhere(setup, "read() math.random()"), "");
  EXPECT_EQ(elsewhere(setup, "count()"), "n (scenario.lua:5)\n");
  EXPECT_EQ(elsewhere(setup, "note(2) note(0)"), "");
  EXPECT_EQ(elsewhere(setup, "note(2)"), "log.last\n");
  EXPECT_EQ(elsewhere(setup, "set(5)"), "v (scenario.lua:7)\n");
  EXPECT_EQ(elsewhere(setup, "total = 1"), "total\n");
  EXPECT_EQ(elsewhere(setup, "count = nil"), "count\n");
  EXPECT_EQ(elsewhere(setup, "m.f = print"), "m.f\n");
  EXPECT_EQ(elsewhere(setup, "m.t.inner = { f = print }"), "persist.t.inner.f\n");
  EXPECT_EQ(elsewhere(setup, "m.t.x = setmetatable({}, { __index = m })"), "persist.t.x (its metatable)\n");
  EXPECT_EQ(elsewhere(setup, "setmetatable(m, { __index = print })"), "m (its metatable)\n");
  EXPECT_EQ(elsewhere("c = coroutine.wrap(function() while true do coroutine.yield() end end)", "c()"), "c\n");
}

TEST(Persist, NamesWhatChangesInsideOfALargeTable) {  // of more than a thousand fields it was told of its own alone
  Script script("log = {} for i = 1, 1500 do log[i] = { n = 0 } end names = {} for i = 1, 1500 do names['k' .. i] = { { 1 } } end");
  script.run("log[7].n = 1");
  EXPECT_EQ(script.persistent.elsewhere(), std::vector<std::string>{"log.7.n"});
  script.run("log[7].n = 0 names.k1500[1][1] = 2");
  EXPECT_EQ(script.persistent.elsewhere(), std::vector<std::string>{"names.k1500.1.1"});
}

TEST(Persist, RefusesTextsThatAreNoTablesOfThisScript) {
  const std::string setup = "m = persist { a = { 1 }, v = vector { 1, 2 }, A = matrix { { 1, 2 }, { 3, 4 } }, n = 1 }";
  Script script(setup);
  const Checkpoint good = script.checkpoint();
  // table 1, sA, matrix 2 2 2, four numbers, four counts of labels, sa, table 3, i1, i1, end, sn, i1, sv, vector 4 2 1, ...
  const auto refused = [&](const std::string& what, const std::string& with, int skip = 0) {
    Checkpoint damaged = good;
    std::vector<std::string>& texts = damaged["script"].texts;
    auto at = std::find(texts.begin(), texts.end(), what);
    while (skip-- > 0) at = std::find(at + 1, texts.end(), what);
    if (at == texts.end()) return "no " + what;
    *at = with;
    try {
      Script(setup).resume(damaged);
    } catch (const CheckpointFault& fault) {
      return std::string(fault.what());
    }
    return std::string("taken");
  };
  EXPECT_EQ(refused("table 1", "i5"), "block script: another table of persist{}");
  EXPECT_EQ(refused("table 1", "table 3"), "block script: another table of persist{}");
  EXPECT_EQ(refused("table 1", "as set up"), "block script: another table of persist{}");
  EXPECT_EQ(refused("vector 4 2 1", "vector 3 2 1"), "block script: of another kind than at set-up: \"vector 3 2 1\"");
  EXPECT_EQ(refused("vector 4 2 1", "vector 2 2 1"), "block script: of another kind than at set-up: \"vector 2 2 1\"");
  EXPECT_EQ(refused("vector 4 2 1", "vector new 1 2"), "block script: not a matrix: \"vector new 1 2\"");
  EXPECT_EQ(refused("i0", ""), "block script: one label each, or none: \"\"");
  EXPECT_EQ(refused("i0", "i1"), "block script: one label each, or none: \"i1\"");
  EXPECT_EQ(refused("i0", "i2"), "block script: not a label: \"i0\"");
  EXPECT_EQ(refused("i0", "i18446744073709551615"), "block script: one label each, or none: \"i18446744073709551615\"");
  EXPECT_EQ(refused("sn", std::string(100'000, 'q')).size(), std::string("block script: not a key: \"...\"").size() + 60);
}

TEST(Persist, RefusesACheckpointOfAnotherScript) {
  Script one("m = persist { a = { 1 } }");
  const Checkpoint good = one.checkpoint();
  EXPECT_THROW(Script("m = persist {} n = persist {}").resume(good), CheckpointFault);
  EXPECT_THROW(Script("m = persist {}").resume(good), CheckpointFault);
  for (const char* bad : {"table 9", "table x", "vector new 3 1", "vector 1 1 1", "again 7", "q", "f1.5.2", "end", ""})
    for (std::size_t i = 0; i < good.at("script").texts.size(); ++i) {
      Checkpoint damaged = good;
      damaged["script"].texts[i] = bad;
      try {
        Script("m = persist { a = { 1 } }").resume(damaged);  // a text of the random numbers may be any
      } catch (const CheckpointFault&) {
      }
    }
}

}  // namespace
}  // namespace cardan
