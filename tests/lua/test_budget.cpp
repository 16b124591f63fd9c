// Every script ends: each of these would run for minutes or for ever, or take all memory.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <string>
#include <thread>

#include "core/base/poll.hpp"
#include "scripts/lua/host.hpp"

namespace cardan {
namespace {

constexpr LuaBudget kSmall{500'000, 60.0};

/// The diagnostic with which a script ends; fails the test if it ends well.
Diagnostic end_of(const std::string& text, const LuaBudget& budget = kSmall, std::size_t memory_bytes = 16 << 20) {
  LuaOptions options;
  options.memory_bytes = memory_bytes;
  LuaHost host(std::move(options));
  try {
    host.run_text("test.lua", text, budget);
  } catch (const InputError& e) {
    host.run_text("after.lua", "assert(#('x'):rep(10) == 10)");  // the host can go on
    return e.diagnostics().at(0);
  }
  ADD_FAILURE() << "came to an end: " << text;
  return {};
}

class LuaEndlessScript : public testing::TestWithParam<const char*> {};

TEST_P(LuaEndlessScript, IsStopped) {
  const Diagnostic d = end_of(GetParam());
  EXPECT_EQ(number_of(d.code), "C0504") << render(d);
  EXPECT_EQ(d.expected, "at most 500000 steps in one call") << render(d);
  EXPECT_EQ(d.at.mark.file, "test.lua");
}

INSTANTIATE_TEST_SUITE_P(
    Loops, LuaEndlessScript,
    testing::Values("while true do end", "local function f() return f() end f()", "repeat until false", "for i = 1, math.huge do end",
                    "coroutine.wrap(function() while true do end end)()",
                    "local c = coroutine.wrap(function() while true do coroutine.yield() end end) while true do c() end",
                    "while true do coroutine.wrap(function() for i = 1, 100 do end end)() end",
                    "while true do coroutine.resume(coroutine.create(function() while true do end end)) end",
                    "local function nest() return coroutine.wrap(function() while true do pcall(nest) end end)() end nest()",
                    // errors that a script catches
                    "while true do pcall(function() while true do end end) end", "while true do pcall(error) end",
                    "local function f() while true do pcall(f) end end f()",
                    "while true do xpcall(function() while true do end end, function() while true do end end) end",
                    "xpcall(error, function() while true do end end)",
                    "coroutine.wrap(pcall)(function() while true do end end) while true do end",
                    "local x <close> = setmetatable({}, {__close = function() while true do end end}) while true do end",
                    "local mt = {} local function f() local a <close> = setmetatable({}, mt) local b <close> = setmetatable({}, "
                    "mt) while true do end end "
                    "mt.__close = f f()",
                    "local f = coroutine.wrap(function() local x <close> = setmetatable({}, {__close = function() while true do end "
                    "end}) while true do end end) f()",
                    "local f = coroutine.wrap(function() local x <close> = setmetatable({}, {__close = function() while true do end "
                    "end}) error('x') end) pcall(f)",
                    "local co = coroutine.create(function() local x <close> = setmetatable({}, {__close = function() while true do "
                    "end end}) "
                    "coroutine.yield() end) coroutine.resume(co) coroutine.close(co)",
                    "setmetatable(_G, {__index = function(t, k) return t[k .. ''] end}) while true do pcall(function() return "
                    "undefined end) end",
                    "local t = setmetatable({}, {__index = function() while true do end end}) return t.x",
                    "local t = setmetatable({}, {__tostring = function() while true do end end}) error(t)",
                    "return ('%s'):format(setmetatable({}, {__tostring = function() while true do end end}))",
                    "while true do load('x = 1')() end"));

INSTANTIATE_TEST_SUITE_P(
    LibraryFunctions, LuaEndlessScript,
    testing::Values("return (('x'):rep(60)):find(('a*'):rep(12) .. 'b'), (('a'):rep(60)):find(('a*'):rep(12) .. 'b')",
                    "return (('a'):rep(60)):match(('a-'):rep(12) .. 'b')", "for _ in (('a'):rep(60)):gmatch(('a?'):rep(40) .. 'b') do end",
                    "return (('a'):rep(60)):gsub(('(a*)'):rep(12) .. 'b', '')", "local s = ('a'):rep(1e6) while true do s:find('b') end",
                    "local s = ('a'):rep(1e5) return s:find(s:sub(1, 5e4) .. 'b', 1, true)", "return ('('):rep(1e6):find('%b()')",
                    "local s = ('a'):rep(2e5) return (s .. s):find('^(.*)' .. '%1%1b')", "return string.rep('', 1 << 62)",
                    "local s = ('x'):rep(1e6) while true do local t = s .. s end", "local s = ('x'):rep(1e6) while true do s:upper() end",
                    "local s = ('x'):rep(1e6) while true do s:byte(-1) end", "local s = ('x'):rep(1e6) while true do utf8.len(s) end",
                    "local s = ('1'):rep(1e6) while true do tonumber(s) end", "table.move({}, 1, 1 << 62, 2)",
                    "table.move({}, math.mininteger, math.maxinteger - 10, 2)",
                    "table.insert(setmetatable({}, {__len = function() return 1 << 62 end}), 1, 0)",
                    "table.insert(setmetatable({}, {__len = function() return 1 << 62 end}), 1.0, 0)",
                    "table.remove(setmetatable({}, {__len = function() return 1 << 62 end}), 1)",
                    // lengths that differ from one question to the next
                    "local n = 0 table.insert(setmetatable({}, {__len = function() n = n + 1 return n == 1 and 1 or 1 << 50 end}), "
                    "1, 5) while true do end",
                    "local n = 0 table.remove(setmetatable({}, {__len = function() n = n + 1 return n == 1 and 1 or 1 << 50 end}), "
                    "1) while true do end",
                    "local n = 0 table.unpack(setmetatable({}, {__len = function() n = n + 1 return n == 1 and 1 or 1 << 50 end})) "
                    "while true do end",
                    "local n = 0 table.concat(setmetatable({''}, {__len = function() n = n + 1 return n == 1 and 1 or 1 << 50 end})) "
                    "while true do end",
                    "table.concat(setmetatable({}, {__index = function() return '' end}), '', 1, 1 << 62)",
                    "table.sort(setmetatable({}, {__len = function() return 1 << 62 end}))",
                    "local t = {} for i = 1, 1000 do t[i] = i end while true do table.sort(t, function() return true end) end",
                    "local t = {} for i = 1, 1000 do t[i] = i end table.sort(t, function() while true do end end)",
                    "local t = {} for i = 1, 1e5 do t[i] = i end while true do table.concat(t) end",
                    "local t = {} for i = 1, 1e4 do t[i] = i end while true do pairs(t) end",
                    "local t = {} for i = 1, 1e4 do t[i] = i end while true do next(t) end",
                    "local t = {} for i = 1, 1e4 do t[i] = i end while true do table.unpack(t) end", "load(('x = 1 '):rep(5e5))"));

TEST(LuaBudget, ReportsWhereTheScriptWas) {
  const Diagnostic d =
      end_of("local function wait()\n  while true do end\nend\nlocal function setup()\n  wait()\n  return 1\nend\nsetup()");
  EXPECT_EQ(render(d),
            "error[C0504]: the script exceeded its budget\n"
            "  --> test.lua:2\n"
            "  expected: at most 500000 steps in one call\n"
            "  got:      a script that is still running\n"
            "  hint:     a loop that does not end?\n"
            "  stack:    test.lua:2 in function 'wait'  <  test.lua:5 in function 'setup'  <  test.lua:8 in main chunk\n");
}

TEST(LuaBudget, EndsByTheClock) {
  const Diagnostic d = end_of("while true do end", {std::int64_t{1} << 60, 0.05});
  EXPECT_EQ(number_of(d.code), "C0504");
  EXPECT_EQ(d.expected, "at most 0.05 s in one call");
}

TEST(LuaBudget, DoesNotCountTheTimeOfBindings) {
  LuaHost host;
  host.bind("simulate", [](lua_State*) {
    std::this_thread::sleep_for(std::chrono::milliseconds(600));
    return 0;
  });
  EXPECT_NO_THROW(host.run_text("test.lua", "simulate() for i = 1, 10000 do end", {1'000'000, 0.5}));
}

TEST(LuaBudget, LongBindingsEndWhereThePersonInterrupts) {
  std::atomic<bool> interrupt = false;
  LuaOptions options;
  options.interrupt = &interrupt;
  LuaHost host(std::move(options));
  int passes = 0;
  host.bind("work", [&](lua_State*) {
    for (;; ++passes) {
      if (passes == 5) interrupt = true;
      Poll::now();
    }
    return 0;
  });
  try {
    host.run_text("test.lua", "\npcall(work)\nwhile true do end");
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(render(e.diagnostics()[0]),
              "error[C0504]: interrupted\n"
              "  --> test.lua:2\n"
              "  stack:    test.lua:2 in main chunk\n");
  }
  EXPECT_EQ(passes, 5);
  interrupt = false;
  EXPECT_NO_THROW(host.run_text("test.lua", "assert(true)")) << "the host goes on";
}

TEST(LuaBudget, LongMethodsEndByTheClock) {
  LuaHost host;
  const auto method = [](lua_State* L) {
    return LuaHost::guarded(L, [](lua_State*) -> int {
      for (;;) Poll::now();
    });
  };
  host.protect([&](lua_State* L) {
    lua_pushcfunction(L, method);
    lua_setglobal(L, "method");
  });
  try {
    host.run_text("test.lua", "pcall(method)", {1'000'000, 0.05});
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(e.diagnostics()[0].expected, "at most 0.05 s in one call");
  }
}

TEST(LuaBudget, IsFreshInEachCall) {
  LuaHost host;
  for (int i = 0; i < 20; ++i) EXPECT_NO_THROW(host.run_text("test.lua", "for i = 1, 100000 do end", kSmall));
}

TEST(LuaBudget, CountsTheOuterScriptAcrossNestedCalls) {
  LuaHost host;
  int calls = 0;
  host.bind("nested", [&](lua_State*) {
    ++calls;
    host.run_text("inner.lua", "return 1");
    return 0;
  });
  EXPECT_THROW(host.run_text("test.lua", "while true do nested() end", kSmall), InputError);
  EXPECT_LE(calls, 1000);  // each begins the outer count anew, and so costs a whole one: 500 steps
  host.bind("endless", [&host](lua_State*) {
    host.run_text("inner.lua", "while true do end", kSmall);
    return 0;
  });
  // What the inner call used up is not the outer call's, which may catch it.
  EXPECT_NO_THROW(host.run_text("test.lua", "assert(not pcall(endless)) for i = 1, 100000 do end", kSmall));
}

class LuaGreedyScript : public testing::TestWithParam<const char*> {};

TEST_P(LuaGreedyScript, IsStopped) {
  const Diagnostic d = end_of(GetParam(), {1'000'000'000, 60.0});
  EXPECT_EQ(render(d),
            "error[C0504]: the script exceeded its budget\n"
            "  --> test.lua:1\n"
            "  expected: at most 16 MiB of memory\n"
            "  got:      a script that asks for more\n"
            "  hint:     a table or a text that grows without end?\n"
            "  stack:    test.lua:1 in main chunk\n");
}

INSTANTIATE_TEST_SUITE_P(Memory, LuaGreedyScript,
                         testing::Values("local t = {} while true do t[#t + 1] = {} end", "local s = 'x' while true do s = s .. s end",
                                         "return ('x'):rep(1e9)", "return ('x'):rep(1e7):rep(1e7)",
                                         "return (('x'):rep(1e6)):gsub('x', ('y'):rep(1e6))",
                                         "local t = {} for i = 1, 1000 do t[i] = ('x'):rep(1e5) end return table.concat(t)",
                                         "table.concat(setmetatable({}, {__index = tostring}), ('x'):rep(100), 1, 1e6)",
                                         "pcall(coroutine.wrap(function() return ('x'):rep(1e9) end)) return ('x'):rep(1e9)"));

TEST(LuaBudget, DeepRecursionIsARuntimeError) {
  const auto end_of_large = [](const std::string& text) { return end_of(text, {50'000'000, 60.0}, 256 << 20); };
  const Diagnostic d = end_of_large("local function f() return 1 + f() end f()");
  EXPECT_EQ(number_of(d.code), "C0503");
  EXPECT_NE(d.about.find("stack overflow"), std::string::npos) << d.about;
  EXPECT_EQ(d.stack.substr(d.stack.size() - 3), "...");
  EXPECT_EQ(number_of(end_of("local function f() return 1 + f() end while true do pcall(f) end").code), "C0504");
  EXPECT_EQ(number_of(end_of_large("local t = setmetatable({}, {}) getmetatable(t).__index = function(t, k) return t[k "
                                   ".. 'x'] end return t.x")
                          .code),
            "C0503");
  EXPECT_EQ(number_of(end_of_large("local s = ('('):rep(1000) .. '1' .. (')'):rep(1000) assert(load('return ' .. s))").code), "C0503");
  EXPECT_EQ(number_of(end_of_large("return ('x'):rep(300):find(('(x?'):rep(30) .. ('x?'):rep(300))").code), "C0503");
}

}  // namespace
}  // namespace cardan
