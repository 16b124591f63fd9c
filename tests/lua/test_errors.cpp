// What the user reads when a script is wrong, and what comes out of a C++ function that throws inside a script.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>

#include "scripts/lua/host.hpp"
#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

std::string message_of(LuaHost& host, const std::string& text) {
  try {
    host.run_text("scenario.lua", text);
  } catch (const InputError& e) {
    EXPECT_EQ(e.diagnostics().size(), 1u);
    return render(e.diagnostics()[0]);
  }
  return "no error";
}
std::string message_of(const std::string& text) {
  LuaHost host;
  return message_of(host, text);
}

TEST(LuaErrors, SyntaxErrorNamesTheLine) {
  EXPECT_EQ(message_of("local x = 1\nx = = 2"),
            "error[C0501]: Lua syntax error: unexpected symbol near '='\n"
            "  --> scenario.lua:2\n");
  EXPECT_EQ(message_of("local s = 'never closed"),
            "error[C0501]: Lua syntax error: unfinished string near <eof>\n"
            "  --> scenario.lua:1\n");
}

TEST(LuaErrors, ShowTheSourceLine) {
  const auto folder = std::filesystem::path(test::scratch("lua_errors"));
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "scenario.lua") << "local wheel = {}\nprint(wheel.axis.x)\n";
  LuaOptions options;
  options.folder = folder;
  LuaHost host(std::move(options));
  try {
    host.run_file("scenario.lua");
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(render(e.diagnostics()[0]),
              "error[C0503]: Lua runtime error: attempt to index a nil value (field 'axis')\n"
              "  --> " +
                  (folder / "scenario.lua").string() +
                  ":2\n"
                  "    2 | print(wheel.axis.x)\n"
                  "  stack:    scenario.lua:2 in main chunk\n");
  }
  std::filesystem::remove_all(folder);
}

TEST(LuaErrors, RuntimeErrorHasATraceback) {
  EXPECT_EQ(message_of("function setup()\n  return 1 + nil\nend\nlocal t = {go = setup}\n\nlocal function start() "
                       "t.go() return 1 end\nstart()"),
            "error[C0503]: Lua runtime error: attempt to perform arithmetic on a nil value\n"
            "  --> scenario.lua:2\n"
            "  stack:    scenario.lua:2 in function 'go'  <  scenario.lua:6 in function 'start'  <  scenario.lua:7 in "
            "main chunk\n");
}

TEST(LuaErrors, UnknownGlobalsAreGuessed) {
  EXPECT_EQ(message_of("prnt('x')"),
            "error[C0503]: Lua runtime error: attempt to call a nil value (global 'prnt')\n"
            "  --> scenario.lua:1\n"
            "  hint:     did you mean \"print\"?\n"
            "  stack:    scenario.lua:1 in main chunk\n");
  EXPECT_EQ(message_of("local t = os.time()"),
            "error[C0503]: Lua runtime error: attempt to index a nil value (global 'os')\n"
            "  --> scenario.lua:1\n"
            "  hint:     scripts have no `os`: a run must give the same result everywhere\n"
            "  stack:    scenario.lua:1 in main chunk\n");
}

TEST(LuaErrors, ErrorLevelMovesThePlace) {
  EXPECT_EQ(message_of("local function gain(x)\n  error('gain must be positive', 2)\nend\ngain(-1)\n"),
            "error[C0503]: Lua runtime error: gain must be positive\n"
            "  --> scenario.lua:4\n"
            "  stack:    scenario.lua:2 in function 'gain'  <  scenario.lua:4 in main chunk\n");
  EXPECT_EQ(message_of("error('ratio 3:12: wrong', 0)"),
            "error[C0503]: Lua runtime error: ratio 3:12: wrong\n"
            "  --> scenario.lua:1\n"
            "  stack:    scenario.lua:1 in main chunk\n");
}

TEST(LuaErrors, ErrorObjectsAreShown) {
  const std::string rest = "\n  --> scenario.lua:1\n  stack:    scenario.lua:1 in main chunk\n";
  EXPECT_EQ(message_of("error(setmetatable({}, {__tostring = function() return 'wing stuck' end}))"),
            "error[C0503]: Lua runtime error: wing stuck" + rest);
  EXPECT_EQ(message_of("error({})"), "error[C0503]: Lua runtime error: error object is a table value" + rest);
  EXPECT_EQ(message_of("error()"), "error[C0503]: Lua runtime error: error object is a nil value" + rest);
  EXPECT_EQ(message_of("error(setmetatable({}, {__tostring = function() error('again') end}))").substr(0, 41),
            "error[C0503]: Lua runtime error: again\n  ");
}

TEST(LuaErrors, CoroutinesKeepTheInnerPlace) {
  EXPECT_EQ(message_of("local phase = coroutine.wrap(function()\n  error('stuck')\nend)\nphase()"),
            "error[C0503]: Lua runtime error: stuck\n"
            "  --> scenario.lua:2\n"
            "  stack:    scenario.lua:4 in main chunk\n");
}

TEST(LuaErrors, BuiltInModulesBlameTheCaller) {
  LuaOptions options;
  options.built_in = {{"cardan.law", "return {gain = function(x) if x < 0 then error('gain must be positive') end end}"}};
  LuaHost host(std::move(options));
  EXPECT_EQ(message_of(host, "local law = require 'cardan.law'\nlaw.gain(-1)"),
            "error[C0503]: Lua runtime error: gain must be positive\n"
            "  --> scenario.lua:2\n"
            "  stack:    [cardan.law]:1 in function 'gain'  <  scenario.lua:2 in main chunk\n");
}

// ---- C++ exceptions ----

TEST(LuaExceptions, PassThroughScriptsUnchanged) {
  LuaHost host;
  host.bind("bad_input", [](lua_State*) -> int {
    throw InputError(std::vector<Diagnostic>{{Code::unknown_body, {"body", {}}, "a body", "\"bus\"", {}, {}, {}, 0},
                                             {Code::unknown_node, {"node", {}}, "a node", "\"tip\"", {}, {}, {}, 0}});
  });
  host.bind("run.failing", [](lua_State*) -> int { throw NumericsError({Code::singular_hinge, 12.5, "panel", "root", "D = 0", {}, {}}); });
  host.bind("standard", [](lua_State*) -> int { throw std::out_of_range("index 5"); });

  try {
    host.run_text("scenario.lua", "local function f() bad_input() end f()");
    FAIL();
  } catch (const InputError& e) {
    ASSERT_EQ(e.diagnostics().size(), 2u);
    EXPECT_EQ(e.diagnostics()[1].got, "\"tip\"");
  }
  try {
    host.run_text("scenario.lua", "coroutine.wrap(function() run.failing() end)()");
    FAIL();
  } catch (const NumericsError& e) {
    EXPECT_EQ(e.failure().code, Code::singular_hinge);
    EXPECT_EQ(e.failure().t, 12.5);
  }
  EXPECT_THROW(host.run_text("scenario.lua", "standard()"), std::out_of_range);
  EXPECT_THROW(host.run_text("scenario.lua", "local ok, e = pcall(standard) error(e)"), std::out_of_range);
}

TEST(LuaExceptions, CanBeCaughtByScripts) {
  LuaHost host;
  host.bind("failing", [](lua_State*) -> int { throw NumericsError({Code::singular_hinge, 12.5, {}, {}, "D = 0", {}, {}}); });
  EXPECT_EQ(message_of(host,
                       "local ok, e = pcall(failing) assert(not ok and tostring(e):find('N0107', 1, true)) "
                       "assert(getmetatable(e) == false)"),
            "no error");
}

TEST(LuaExceptions, CrossNestedHosts) {
  LuaHost host;
  host.bind("inner", [&host](lua_State*) -> int {
    host.run_text("inner.lua", "\n\nfail()");
    return 0;
  });
  EXPECT_EQ(message_of(host, "coroutine.wrap(function() inner() end)()"),
            "error[C0503]: Lua runtime error: attempt to call a nil value (global 'fail')\n"
            "  --> inner.lua:3\n"
            "  stack:    inner.lua:3 in main chunk  <  scenario.lua:1 in function of line 1\n");
}

TEST(LuaExceptions, RunDestructors) {
  LuaHost host;
  auto alive = std::make_shared<int>(0);
  host.bind("by_lua", [alive](lua_State* L) -> int {
    const std::shared_ptr<int> local = alive;
    return luaL_error(L, "raised by Lua");
  });
  host.bind("by_argument", [alive](lua_State* L) -> int {
    const std::shared_ptr<int> local = alive;
    luaL_checknumber(L, 1);
    return 0;
  });
  host.bind("by_cpp", [alive](lua_State*) -> int {
    const std::shared_ptr<int> local = alive;
    throw std::runtime_error("raised by C++");
  });
  const long before = alive.use_count();
  EXPECT_THROW(host.run_text("scenario.lua", "by_lua()"), InputError);
  EXPECT_THROW(host.run_text("scenario.lua", "by_argument('x')"), InputError);
  EXPECT_THROW(host.run_text("scenario.lua", "by_cpp()"), std::runtime_error);
  EXPECT_THROW(host.protect([alive](lua_State* L) {
    const std::shared_ptr<int> local = alive;
    luaL_error(L, "in a job");
  }),
               InputError);
  EXPECT_EQ(alive.use_count(), before);
}

TEST(LuaErrors, ALongTextIsCut) {
  LuaHost host;
  for (const char* text :
       {"error(('a:1: '):rep(400000), 0)", "error(('x'):rep(1e7), 0)", "error(('x:1: '):rep(4e5) .. ('y'):rep(1e6), 0)"}) {
    try {
      host.run_text("scenario.lua", text);
      FAIL();
    } catch (const InputError& e) {
      EXPECT_LT(e.diagnostics()[0].about.size(), 20'000u);
      EXPECT_LT(std::string(e.what()).size(), 20'000u);
    }
  }
}

TEST(LuaErrors, NothingGoesToTheTerminalAsItIs) {
  const std::string shown = message_of("error('\\27[31mred\\xff \\u{9b}31m\\n  second', 0)");
  EXPECT_EQ(shown,
            "error[C0503]: Lua runtime error: ?[31mred? ?31m\n  second\n"
            "  --> scenario.lua:1\n"
            "  stack:    scenario.lua:1 in main chunk\n");
}

TEST(LuaErrors, TextsThatCannotBeParsedNameTheirFile) {
  LuaHost host;
  EXPECT_EQ(message_of(host, "return " + std::string(100'000, '{')),
            "error[C0501]: Lua syntax error: nested too deeply\n"
            "  --> scenario.lua\n"
            "  hint:     brackets, tables or functions more than about 200 deep in one another\n");
  EXPECT_EQ(message_of("phase { name = 'x',\n  until = function() end }"),
            "error[C0501]: Lua syntax error: unexpected symbol near 'until'\n"
            "  --> scenario.lua:2\n"
            "  hint:     `until` is a word of Lua: the key of a phase is `until_`\n");
  EXPECT_NO_THROW(host.run_text("scenario.lua",
                                "\xEF\xBB\xBF"
                                "assert(true)"))
      << "the byte-order mark of some editors";
}

}  // namespace
}  // namespace cardan
