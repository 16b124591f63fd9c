// What a prompt shows of values, and how it completes names.
#include <gtest/gtest.h>

#include "scripts/host/lua_inspect.hpp"
#include "scripts/host/lua_matrix.hpp"

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
  EXPECT_EQ(completed("f().x", 4), Names{}) << "nothing is called";
  EXPECT_EQ(completed("loud.a.b", 7), Names{}) << "no metamethod runs";
  EXPECT_EQ(completed("loop.", 5), Names{});
}

TEST(LuaInspect, CompletesMethodsOfUserdata) {
  EXPECT_EQ(completed("A:e", 2), Names{"eigenvalues"});
  EXPECT_EQ(completed("v:", 2), (Names{"cols", "csv", "dot", "hdf5", "labels", "max_abs", "norm", "rows", "t", "table"})) << "by __members";
}

}  // namespace
}  // namespace cardan
