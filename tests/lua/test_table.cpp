// Tables between scripts and C++: strict reading of arguments, records of numbers, calls of script functions.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "scripts/lua/table.hpp"

namespace cardan {
namespace {

/// Runs `reader` on the table that the script passes to run{...} and gives all diagnostics as text.
template <class Reader>
std::string faults_of(const std::string& script, Reader reader) {
  LuaHost host;
  host.bind("run", [&reader](lua_State* L) {
    DiagnosticSink sink;
    LuaTable table(L, 1, "run", sink);
    reader(table);
    sink.throw_if_any();
    return 0;
  });
  try {
    host.run_text("scenario.lua", script);
  } catch (const InputError& e) {
    std::string text;
    for (const auto& d : e.diagnostics()) text += render(d);
    return text;
  }
  return "none";
}

TEST(LuaTable, ReadsValuesOfAllTypes) {
  EXPECT_EQ(faults_of("run{until_ = '1.5 min', step = 0.5, angle = '90 deg', n = 3, name = 'slew', method = 'rk4', quiet = true, "
                      "axis = {0, 0, '100 cm'}, law = function(x) return 2 * x end, inner = {gain = 4}, phases = {{t = 1}, {t = "
                      "2}}}",
                      [](LuaTable& t) {
                        EXPECT_EQ(t.number("until_", "s"), 90.0);
                        EXPECT_EQ(t.number("step", "s"), 0.5);
                        EXPECT_NEAR(t.number("angle", "rad").value(), 1.5707963267948966, 1e-15);  // round-off of one product
                        EXPECT_EQ(t.integer("n", 3), 3);
                        EXPECT_EQ(t.text("name"), "slew");
                        EXPECT_EQ(t.choice("method", {"rk4", "cvode"}), "rk4");
                        EXPECT_EQ(t.flag("quiet"), true);
                        EXPECT_EQ(t.numbers("axis", 3, "m"), (std::vector<double>{0.0, 0.0, 1.0}));
                        std::array<double, 1> result{};
                        t.function("law")->call(std::array{21.0}, result);
                        EXPECT_EQ(result[0], 42.0);
                        auto inner = t.table("inner");
                        EXPECT_EQ(inner->number("gain"), 4.0);
                        inner->finish();
                        auto phases = t.tables("phases");
                        ASSERT_EQ(phases.size(), 2u);
                        EXPECT_EQ(phases[1].number("t"), 2.0);
                        EXPECT_EQ(phases[1].path(), "run.phases[2]");
                        EXPECT_FALSE(t.has("absent"));
                        EXPECT_FALSE(t.number("absent"));
                        EXPECT_FALSE(t.table("absent"));
                        t.finish();
                      }),
            "none");
}

TEST(LuaTable, NamesTheKeyAndTheLine) {
  EXPECT_EQ(faults_of("local function setup()\n  run{integrator = {tolerance = '1e-9 m'}}\nend\nsetup()",
                      [](LuaTable& t) { t.table("integrator")->reject("tolerance", "number > 0, or { relative = ..., absolute = ... }"); }),
            "error[C0502]: wrong argument\n"
            "  --> scenario.lua:2\n"
            "  at: run.integrator.tolerance\n"
            "  expected: number > 0, or { relative = ..., absolute = ... }\n"
            "  got:      \"1e-9 m\" (string)\n"
            "  stack:    scenario.lua:2 in function 'setup'  <  scenario.lua:4 in main chunk\n");
}

TEST(LuaTable, ReportsUnknownKeysWithAGuess) {
  EXPECT_EQ(faults_of("run{untl = 5, [1] = 7}",
                      [](LuaTable& t) {
                        t.number("until", "s");
                        t.number("step", "s");
                        t.finish();
                      }),
            "error[C0502]: wrong argument\n"
            "  --> scenario.lua:1\n"
            "  at: run.1 (number)\n"
            "  expected: one of the keys: step, until\n"
            "  got:      \"1 (number)\"\n"
            "  stack:    scenario.lua:1 in main chunk\n"
            "error[C0502]: wrong argument\n"
            "  --> scenario.lua:1\n"
            "  at: run.untl\n"
            "  expected: one of the keys: step, until\n"
            "  got:      \"untl\"\n"
            "  hint:     did you mean \"until\"?\n"
            "  stack:    scenario.lua:1 in main chunk\n");
}

TEST(LuaTable, CollectsAllFaults) {
  const std::string faults = faults_of(
      "run{a = 0 / 0, b = true, c = 1.5, d = 7, e = 'rk5', f = 'yes', g = {1, 2}, h = {1, 'x', 3}, i = 3, j = 3, k = "
      "{1, {}}, l = '3 kg', n = 4294967297}",
      [](LuaTable& t) {
        t.number("a");
        t.number("b", "m");
        t.integer("c", 1);
        t.integer("n", 0);
        t.text("d");
        t.choice("e", {"rk4", "cvode"});
        t.flag("f");
        t.numbers("g", 3);
        t.numbers("h", 3);
        t.function("i");
        t.table("j");
        t.tables("k");
        t.number("l", "m");
        t.require({"m"});
      });
  for (const char* expected :
       {"at: run.a\n  expected: a finite number\n  got:      nan (number)",
        "at: run.b\n  expected: a number in m, or a text with a unit\n  got:      true (boolean)",
        "at: run.c\n  expected: an integer from 1 to 2147483647\n  got:      1.5 (number)",
        "at: run.n\n  expected: an integer from 0 to 2147483647\n  got:      4294967297 (number)",
        "at: run.d\n  expected: a string\n  got:      7 (number)",
        "at: run.e\n  expected: one of: rk4, cvode\n  got:      \"rk5\" (string)\n  hint:     did you mean \"rk4\"?",
        "at: run.f\n  expected: true or false\n  got:      \"yes\" (string)",
        "at: run.g\n  expected: an array of 3 numbers\n  got:      2 entries", "at: run.h[2]\n",
        "at: run.i\n  expected: a function\n  got:      3 (number)", "at: run.j\n  expected: a table\n  got:      3 (number)",
        "at: run.k[1]\n  expected: a table\n  got:      1 (number)", "at: run.l\n",
        "at: run.m\n  expected: a value: this key is required\n  got:      nothing"})
    EXPECT_NE(faults.find(expected), std::string::npos) << expected << "\n" << faults;
  EXPECT_NE(faults.find("error[C0107]: wrong unit"), std::string::npos) << faults;
}

TEST(LuaTable, TakesNoArrayWithOtherKeys) {
  const std::string faults = faults_of(
      "run{a = {1, 2, z = 3}, b = {'x', [3] = 'y'}, c = {{}, d = {}}, e = {1, 2}, f = {'x', 'y'}, g = {{}, {}}, h = {}}", [](LuaTable& t) {
        for (const char* key : {"a", "e", "h"}) t.numbers(key, 0);
        for (const char* key : {"b", "f", "h"}) t.texts(key);
        for (const char* key : {"c", "g", "h"}) t.tables(key);
      });
  for (const char* expected :
       {"run.a\n  expected: an array of numbers", "run.b\n  expected: an array of strings", "run.c\n  expected: an array of tables"})
    EXPECT_NE(faults.find(fmt::format("at: {}\n  got:      a table with other keys than 1, 2, ...\n", expected)), std::string::npos)
        << faults;
  for (const char* fine : {"run.e", "run.f", "run.g", "run.h"}) EXPECT_EQ(faults.find(fine), std::string::npos) << faults;
}

TEST(LuaTable, NeedsATable) {
  EXPECT_EQ(faults_of("run(5)", [](LuaTable& t) { EXPECT_FALSE(t.number("until")); }),
            "error[C0502]: wrong argument\n"
            "  --> scenario.lua:1\n"
            "  at: run\n"
            "  expected: a table\n"
            "  got:      5 (number)\n"
            "  stack:    scenario.lua:1 in main chunk\n");
}

TEST(LuaTable, IgnoresMetatables) {
  EXPECT_EQ(
      faults_of("run(setmetatable({}, {__index = function() error('called') end}))", [](LuaTable& t) { EXPECT_FALSE(t.number("until")); }),
      "none");
}

// ---- functions ----

class LuaCall : public ::testing::Test {
 protected:
  /// The function that `text` returns.
  LuaFunction function(const std::string& text) {
    LuaFunction f;
    host_.bind("take", [&f](lua_State* L) {
      lua_settop(L, 1);
      f = LuaFunction(LuaRef::pop(L));
      return 0;
    });
    host_.run_text("scenario.lua", "take(" + text + ")");
    return f;
  }
  LuaHost host_;
};

TEST_F(LuaCall, ThrowsWhatTheScriptRaises) {
  const LuaFunction f = function("\nfunction(t)\n  return t.missing.field\nend");
  std::array<double, 1> out{};
  try {
    f.call(std::array{0.0}, out);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(render(e.diagnostics()[0]),
              "error[C0503]: Lua runtime error: attempt to index a number value (local 't')\n"
              "  --> scenario.lua:3\n"
              "  stack:    scenario.lua:3 in function of line 2\n");
  }
}

TEST_F(LuaCall, SpendsTheBudgetOfCalls) {
  const LuaFunction f = function("function(n) for i = 1, n do end return n end");
  std::array<double, 1> out{};
  host_.set_call_budget({100'000, 60.0});
  EXPECT_THROW(f.call(std::array{1e6}, out), InputError);
  EXPECT_NO_THROW(f.call(std::array{1e4}, out)) << "and the host goes on";
  host_.set_call_budget({10'000'000, 60.0});
  EXPECT_NO_THROW(f.call(std::array{1e6}, out));
}

TEST_F(LuaCall, CallsWithPlainNumbers) {
  const LuaFunction f = function("function(a, b) return a + b, a - b, 'extra' end");
  const LuaFunction two = function("function(a, b) return a + b, a - b end");
  std::array<double, 2> out{};
  two.call(std::array{5.0, 3.0}, out);
  EXPECT_EQ(out, (std::array{8.0, 2.0}));
  const auto fault = [](const LuaFunction& of, std::span<double> results) {
    try {
      of.call(std::array{5.0, 3.0}, results);
    } catch (const InputError& e) {
      return e.diagnostics()[0].at.key_path + " | " + e.diagnostics()[0].got;
    }
    return std::string();
  };
  std::array<double, 3> three{};
  EXPECT_EQ(fault(f, three), "result 3 | \"extra\" (string)");
  EXPECT_EQ(fault(two, three), "result 3 | nil");
  EXPECT_EQ(fault(f, out), "results | 3 values") << "more than are taken";
}

TEST_F(LuaCall, KeepsTheStackOfTheHostEmpty) {
  const LuaFunction f = function("function(t) if t > 5 then error('late') end return t, 0 / (t - 3) end");
  std::array<double, 2> out{};
  for (int i = 0; i < 10; ++i) {
    try {
      f.call(std::array{double(i)}, out);
    } catch (const InputError&) {
    }
  }
  EXPECT_EQ(lua_gettop(host_.state()), 0);
}

}  // namespace
}  // namespace cardan
