// What a prompt shows of values, and how it completes names.
#include <gtest/gtest.h>

#include "scripts/lua/inspect.hpp"
#include "scripts/lua/matrix.hpp"

namespace cardan {
namespace {

std::string shown(const std::string& expression) {
  LuaHost host;
  open_matrices(host);
  std::string text;
  const std::string chunk = "return " + expression;
  host.protect([&](lua_State* L) {
    if (luaL_loadbufferx(L, chunk.data(), chunk.size(), "@test.lua", "t") != LUA_OK) lua_error(L);
    lua_call(L, 0, 1);
    const int top = lua_gettop(L);
    text = value_text(L, -1);
    EXPECT_EQ(lua_gettop(L), top);
  });
  return text;
}

TEST(LuaInspect, NumbersHaveTheDigitsThatGiveThemBack) {
  EXPECT_EQ(shown("0.1"), "0.1");
  EXPECT_EQ(shown("0.1 + 0.2"), "0.30000000000000004");
  EXPECT_EQ(shown("3"), "3");
  EXPECT_EQ(shown("3.0"), "3.0");
  EXPECT_EQ(shown("1e300"), "1e+300");
  EXPECT_EQ(shown("-1/0"), "-inf");
  EXPECT_EQ(shown("0/0"), "nan");
}

TEST(LuaInspect, WhatIsNoNumberHasNoSign) {  // it differs between processors
  for (const char* zero : {"0/0", "-(0/0)"}) {
    const std::string n = zero;
    EXPECT_EQ(shown("tostring(" + n + ")"), "nan");
    EXPECT_EQ(shown("string.format('%s %g %d', " + n + ", " + n + ", 3)"), "nan nan 3");
    EXPECT_EQ(shown("matrix{{" + n + "}}"), "matrix 1x1\n  nan");
    EXPECT_EQ(shown("{{re = " + n + "}, {re = 1.5}}"), "      re\n  1  nan\n  2  1.5");
  }
}

TEST(LuaInspect, TablesAreOneLevelDeepAndInOrder) {
  EXPECT_EQ(shown("{}"), "{}");
  EXPECT_EQ(shown("{zeta = 1, alpha = 'two', [3] = 3, 1, 2, [2.5] = true, ['end'] = 0, ['a b'] = 0}"),
            "{1, 2, [2.5] = true, [3] = 3, [\"a b\"] = 0, alpha = \"two\", [\"end\"] = 0, zeta = 1}");
  EXPECT_EQ(shown("{{1}, {}, matrix{{1, 2}}, 'a\\n\"b\"'}"), "{{...}, {}, matrix 1x2, \"a\\n\\\"b\\\"\"}");
  EXPECT_EQ(shown("setmetatable({1}, {__tostring = function() return 'mine' end})"), "mine");
  EXPECT_EQ(shown("print"), "function: #1");
  const std::string many = shown("(function() local t = {} for i = 1, 150 do t[i] = i end return t end)()");
  EXPECT_TRUE(many.ends_with("99, 100, ... 50 more}")) << many;
}

std::vector<std::string> completed(const std::string& line, std::size_t start) {
  LuaHost host;
  open_matrices(host);
  host.run_text("test.lua",
                "v, A = vector{1, 2}, matrix{{1}}  scene = { wheel = { rate = 1, spin = function() end, _x = 1 }, ['no name'] = 1 }"
                "child = setmetatable({ own = 1 }, { __index = scene })"
                "loud = setmetatable({}, { __index = function() error('looked') end })  loop = {} setmetatable(loop, { __index = loop })");
  const Completion c = complete(host, line);
  EXPECT_EQ(c.start, start) << line;
  return c.names;
}
using Names = std::vector<std::string>;

TEST(LuaInspect, CompletesGlobalsAndKeywords) {
  EXPECT_EQ(completed("sce", 0), Names{"scene"});
  EXPECT_EQ(completed("x = 2 * mat", 8), (Names{"math", "matrix"}));
  EXPECT_EQ(completed("re", 0), (Names{"repeat", "require", "return"}));
  EXPECT_EQ(completed("nothing_like_it", 0), Names{});
  EXPECT_EQ(completed("f(12", 2), Names{}) << "a number";
}

TEST(LuaInspect, CompletesFieldsAlongAPath) {
  EXPECT_EQ(completed("math.fl", 5), Names{"floor"});
  EXPECT_EQ(completed("print(scene.wheel.", 18), (Names{"_x", "rate", "spin"}));
  EXPECT_EQ(completed("scene.wheel:", 12), Names{"spin"}) << "after a colon functions alone";
  EXPECT_EQ(completed("scene.", 6), Names{"wheel"}) << "a key that is no name cannot follow a point";
  EXPECT_EQ(completed("child.", 6), (Names{"own", "wheel"})) << "through __index";
  EXPECT_EQ(completed("child.wheel.r", 12), Names{"rate"});
  EXPECT_EQ(completed("scene.none.x", 11), Names{});
  EXPECT_EQ(completed("f().x", 4), Names{}) << "nothing is known about it";
  EXPECT_EQ(completed("loud.a.b", 7), Names{}) << "no metamethod runs";
  EXPECT_EQ(completed("loop.", 5), Names{});
}

TEST(LuaInspect, CompletesMethodsOfUserdata) {
  EXPECT_EQ(completed("A:e", 2), Names{"eigenvalues"});
  EXPECT_EQ(completed("v:", 2), (Names{"cols", "csv", "dot", "hdf5", "labels", "max_abs", "norm", "rows", "t", "table"})) << "by __members";
}

TEST(LuaInspect, ArraysOfLikeTablesAreShownAsATable) {
  EXPECT_EQ(shown("{{re = 0.5, im = -1.0, name = 'a'}, {re = 10.25, im = 1.0, name = 'long'}}"),
            "     im    name     re\n"
            "  1  -1     \"a\"    0.5\n"
            "  2   1  \"long\"  10.25");
  EXPECT_EQ(shown("{{a = 1}, {b = 1}}"), "{{...}, {...}}") << "unlike";
  EXPECT_EQ(shown("{{a = {}}, {a = {}}}"), "{{...}, {...}}") << "not plain";
  EXPECT_EQ(shown("{{1, 2}, {3, 4}}"), "{{...}, {...}}") << "without names";
}

TEST(LuaInspect, AVeryLongTextIsCut) {
  const std::string text = shown("('x'):rep(1e6)");
  EXPECT_LT(text.size(), 100'000u);
  EXPECT_TRUE(text.ends_with("bytes more)")) << text.substr(text.size() - 40);
}

TEST(LuaInspect, CompletesWhatCallsReturnAndNamesInQuotes) {
  const ApiReference api(
      {"---@class Hinge\nlocal Hinge = {}\n---@return number q\nfunction Hinge:angle() end\n"
       "---@return Scene scene\nfunction Hinge:scene() end\n\n"
       "---@class Scene\n---@field poles number\nlocal Scene = {}\n---@return Hinge hinge\nfunction Scene:hinge(name) end\n\n"
       "---@return Scene scene\nfunction vehicle(path) end\n"});
  LuaHost host;
  host.protect([](lua_State* L) {
    lua_newuserdatauv(L, 1, 0);
    luaL_newmetatable(L, "cardan.scene");
    lua_setmetatable(L, -2);
    lua_setglobal(L, "sat");
  });
  std::string asked;
  const CompletionSources sources{&api, [&asked](std::string_view word) {
                                    asked = word;
                                    return Names{"wing_left", "wing_right", "bus"};
                                  }};
  const auto names = [&](const std::string& line) { return complete(host, line, sources).names; };
  EXPECT_EQ(names("sat:hinge(\"wheel\"):"), (Names{"angle", "scene"}));
  EXPECT_EQ(names("x = sat:hinge \"wheel\":an"), Names{"angle"});
  EXPECT_EQ(names("sat:hinge('a)b'):scene():h"), Names{"hinge"});
  EXPECT_EQ(names("sat:hinge('a'):scene()."), Names{"poles"});
  EXPECT_EQ(names("vehicle 'v.yaml':hi"), Names{"hinge"});
  EXPECT_EQ(names("sat:none():"), Names{});
  EXPECT_EQ(names("sat:hinge(\"wi"), (Names{"wing_left", "wing_right"}));
  EXPECT_EQ(asked, "hinge");
  EXPECT_EQ(names("s:passive { 'bus', 'wing_l"), Names{"wing_left"});
  EXPECT_EQ(names("f('done') .. 'b"), Names{"bus"});
  EXPECT_EQ(complete(host, "sat:hinge(\"wi", sources).start, 11u);
}

}  // namespace
}  // namespace cardan
