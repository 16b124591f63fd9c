// The bounded matcher against the library's: the same results and the same messages.
#include <gtest/gtest.h>
#include <lualib.h>

#include <random>
#include <string>
#include <vector>

#include "scripts/lua/host.hpp"

namespace cardan {
namespace {

/// Runs every pattern function on (subject, pattern) and gives all results as one text.
constexpr char kProbe[] = R"(
  local function show(...)
    local out = {}
    for i = 1, select('#', ...) do out[i] = type(select(i, ...)) .. ':' .. tostring((select(i, ...))) end
    return table.concat(out, ',')
  end
  local function try(f, ...)
    return (show(pcall(f, ...)):gsub('^(boolean:false,string:).-:%d+: ', '%1'))
  end
  local function each(s, p, init)
    local all = {}
    for a, b in string.gmatch(s, p, init) do
      all[#all + 1] = show(a, b)
      if #all > 50 then break end
    end
    return table.concat(all, ';')
  end
  function probe(s, p)
    local out = {}
    for _, init in ipairs{1, 3, -2, 0, -100, 100} do
      out[#out + 1] = try(string.find, s, p, init)
      out[#out + 1] = try(string.match, s, p, init)
      out[#out + 1] = try(each, s, p, init)
    end
    out[#out + 1] = try(string.find, s, p, 1, true)
    local replacements = {'<%0>', '%1', '%2', '%%', '%', '%x', 'x', '', 7, {a = 'A', b = false, [1] = 'one', ab = {}}}
    for _, replacement in ipairs(replacements) do
      out[#out + 1] = try(string.gsub, s, p, replacement)
      out[#out + 1] = try(string.gsub, s, p, replacement, 2)
    end
    out[#out + 1] = try(string.gsub, s, p, function(a, b) return b and (tostring(a) .. '+' .. tostring(b)) end)
    out[#out + 1] = try(string.gsub, s, p, function(a) if a == 'a' then return {} end end)
    out[#out + 1] = try(string.gsub, s, p, print, 0)
    out[#out + 1] = try(string.gsub, s, p, nil)
    return table.concat(out, '\n')
  end)";

class LuaPattern : public ::testing::Test {
 protected:
  LuaPattern() : library_(luaL_newstate(), &lua_close) {
    luaL_openlibs(library_.get());
    EXPECT_EQ(luaL_dostring(library_.get(), kProbe), LUA_OK) << lua_tostring(library_.get(), -1);
    host_.run_text("probe", kProbe);
  }

  static std::string probe(lua_State* L, const std::string& subject, const std::string& pattern) {
    lua_getglobal(L, "probe");
    lua_pushlstring(L, subject.data(), subject.size());
    lua_pushlstring(L, pattern.data(), pattern.size());
    lua_call(L, 2, 1);
    std::size_t n = 0;
    const char* text = lua_tolstring(L, -1, &n);
    std::string result(text, n);
    lua_pop(L, 1);
    return result;
  }

  void compare(const std::string& subject, const std::string& pattern) {
    std::string ours;
    host_.protect([&](lua_State* L) { ours = probe(L, subject, pattern); });
    ASSERT_EQ(ours, probe(library_.get(), subject, pattern)) << "subject \"" << subject << "\", pattern \"" << pattern << '"';
  }

  LuaHost host_;
  std::unique_ptr<lua_State, void (*)(lua_State*)> library_;
};

TEST_F(LuaPattern, AgreesWithTheLibraryOnWrittenCases) {
  const std::vector<std::string> subjects = {"",
                                             "a",
                                             "aaa",
                                             "abcabc",
                                             "hello world from Lua",
                                             "key = value, x=1",
                                             "THE (quick) fox",
                                             "((a)(b(c)))",
                                             "2024-01-02",
                                             "  trim me  ",
                                             "a.b.c",
                                             "%d[x]^$",
                                             std::string("nul\0byte\0", 9),
                                             "\xC3\xA9t\xC3\xA9",
                                             "0x1F -3.5e+7",
                                             "aXbXc\n\tend",
                                             "]^-[",
                                             "abab"};
  const std::vector<std::string> patterns = {"",
                                             "a",
                                             "a*",
                                             "a+",
                                             "a-",
                                             "a?",
                                             ".",
                                             ".*",
                                             ".-",
                                             "^",
                                             "$",
                                             "^$",
                                             "^a",
                                             "a$",
                                             "^.*$",
                                             "a*$",
                                             "%a+",
                                             "%A+",
                                             "%d%d",
                                             "%w+",
                                             "%s*",
                                             "%S+",
                                             "%p",
                                             "%P+",
                                             "%l+",
                                             "%u+",
                                             "%x+",
                                             "%X",
                                             "%c",
                                             "%C+",
                                             "%g+",
                                             "%G",
                                             "(%w+)",
                                             "()",
                                             "()a()",
                                             "(a)(b)",
                                             "(a*(.)%w(%s*))",
                                             "%b()",
                                             "%b[]",
                                             "%baa",
                                             "%f[%w]%w+",
                                             "%f[%a]",
                                             "%f[^%a]",
                                             "%f[%z]",
                                             "(%w+)%s*=%s*(%w+)",
                                             "^%s*(.-)%s*$",
                                             "[abc]",
                                             "[^abc]+",
                                             "[a-c]",
                                             "[%a_]+",
                                             "[^%s]+",
                                             "[]]",
                                             "[^]]",
                                             "[]-a]",
                                             "[a-]",
                                             "[-a]",
                                             "[%]]",
                                             "[%-x]",
                                             "[a%-z]",
                                             "[a-%%]",
                                             "[^^]",
                                             "(.)%1",
                                             "(a)%1*",
                                             "(..)%1",
                                             "((a)b)",
                                             "(a)|(b)",
                                             "%.",
                                             "%%",
                                             "%^",
                                             "%$",
                                             "\\",
                                             "x*",
                                             "(x*)",
                                             "(())",
                                             "(()a)",
                                             "%w%w-%w",
                                             ".-b",
                                             ".-$",
                                             "b.-",
                                             std::string("\0", 1),
                                             std::string("%z"),
                                             std::string("[\0]", 3),
                                             "[^\xC3]",
                                             "\xC3.",
                                             "%0",
                                             "%1",
                                             "(%1)",
                                             "(a)%2",
                                             "a(%1)",
                                             "(a",
                                             "a)",
                                             "(",
                                             ")",
                                             "((",
                                             "())",
                                             "[",
                                             "[a",
                                             "[]",
                                             "[^",
                                             "[^]",
                                             "[%",
                                             "[%a",
                                             "[a-",
                                             "%",
                                             "a%",
                                             "%b",
                                             "%bx",
                                             "%f",
                                             "%fa",
                                             "%f[",
                                             "%f[a",
                                             "*",
                                             "+",
                                             "?",
                                             "-",
                                             "**",
                                             "a**",
                                             "a+*",
                                             "a?-",
                                             "a-*",
                                             "^*",
                                             "^^",
                                             "a^",
                                             "$$",
                                             "$a",
                                             "a$b",
                                             "(^a)",
                                             "(a$)",
                                             "(a)$",
                                             "[[]",
                                             "[[:alpha:]]",
                                             ".?.?.?",
                                             "(.)(.)(.)(.)(.)",
                                             "()()()",
                                             "(((((((((((((((((((((((((((((((((a)))))))))))))))))))))))))))))))))"};
  for (const auto& subject : subjects)
    for (const auto& pattern : patterns) compare(subject, pattern);
}

TEST_F(LuaPattern, AgreesWithTheLibraryOnRandomCases) {
  std::minstd_rand engine(20240607);
  const auto random = [&] { return static_cast<std::size_t>(engine()); };
  const auto pick = [&](const std::vector<std::string>& words, std::size_t most) {
    std::string text;
    for (std::size_t n = random() % (most + 1); n > 0; --n) text += words[random() % words.size()];
    return text;
  };
  const std::vector<std::string> letters = {"a", "b", "ab", "(", ")", "[", "]", " ", "1", "A", "-", "%", "^"};
  const std::vector<std::string> pieces = {"a", "b", "%a", "%d", "%W",   ".",      "[ab]", "[^a]", "[%w-]", "*", "+", "-", "?",
                                           "(", ")", "()", "%1", "%b()", "%f[%w]", "^",    "$",    "%",     "[", "]", "1"};
  for (int i = 0; i < 1500; ++i) {
    const std::string subject = pick(letters, 10);
    compare(subject, pick(pieces, 6));
  }
}

TEST_F(LuaPattern, StopsAtTheLibrarysDepth) {
  std::string optional;
  for (int n = 190; n < 210; ++n) {
    optional.clear();
    for (int i = 0; i < n; ++i) optional += "a?";
    compare(std::string(250, 'a'), optional);
  }
}

TEST_F(LuaPattern, TakesNumbersAsTexts) {
  for (const char* call :
       {"return string.find(12345, 34)", "return string.gsub(121, 1, 3)", "return ('x'):find()", "return ('x'):gsub('x')",
        "return ('x'):gmatch()", "return string.find({}, 'x')", "return ('x'):find('x', 'y')"}) {
    std::string results[2];
    const auto run = [&](lua_State* L) {
      luaL_loadstring(L, call);
      const int base = lua_gettop(L);
      const int status = lua_pcall(L, 0, LUA_MULTRET, 0);
      std::string text = std::to_string(status);
      for (int i = base; i <= lua_gettop(L); ++i) text += std::string(" ") + luaL_tolstring(L, i, nullptr), lua_pop(L, 1);
      lua_settop(L, base - 1);
      return text;
    };
    host_.protect([&](lua_State* L) { results[0] = run(L); });
    EXPECT_EQ(results[0], run(library_.get())) << call;
  }
}

}  // namespace
}  // namespace cardan
