// Lua's patterns with a price: the library's own matcher cannot be interrupted, so one bad pattern would never return.
// Each comparison is a step of the script's budget. The language is that of the Lua 5.4 manual, section 6.4.1, and the
// tests compare results and messages with the library's functions.
#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <cstring>
#include <optional>
#include <string_view>
#include <utility>

#include "scripts/lua/host.hpp"
#include "scripts/lua/sandbox.hpp"

namespace cardan {
namespace {

constexpr int kMaxDepth = 200;            // nested attempts, as in the library
constexpr int kMaxCaptures = 32;          // likewise
constexpr lua_Integer kBatch = 1024;      // steps between two looks at the budget
constexpr std::ptrdiff_t kOpen = -1;      // capture lengths: not closed yet,
constexpr std::ptrdiff_t kPosition = -2;  // and `()`

int byte_of(char c) { return static_cast<unsigned char>(c); }

bool in_class(int c, char letter) {
  const auto test = [c](int lower) -> std::optional<bool> {
    switch (lower) {
      case 'a':
        return std::isalpha(c) != 0;
      case 'c':
        return std::iscntrl(c) != 0;
      case 'd':
        return std::isdigit(c) != 0;
      case 'g':
        return std::isgraph(c) != 0;
      case 'l':
        return std::islower(c) != 0;
      case 'p':
        return std::ispunct(c) != 0;
      case 's':
        return std::isspace(c) != 0;
      case 'u':
        return std::isupper(c) != 0;
      case 'w':
        return std::isalnum(c) != 0;
      case 'x':
        return std::isxdigit(c) != 0;
      case 'z':
        return c == 0;  // no longer in the manual, still in the library
      default:
        return std::nullopt;
    }
  };
  const std::optional<bool> is_in = test(std::tolower(byte_of(letter)));
  if (!is_in) return byte_of(letter) == c;  // an escaped character stands for itself
  return *is_in != (std::isupper(byte_of(letter)) != 0);
}

class Matcher {
 public:
  Matcher(lua_State* L, std::string_view subject, std::string_view pattern)
      : L_(L), begin_(subject.data()), end_(begin_ + subject.size()), pattern_end_(pattern.data() + pattern.size()) {}

  /// End of the match of the pattern from `p` on, at `s`; null if there is none. Forgets earlier captures.
  const char* match_at(const char* s, const char* p) {
    n_captures_ = 0;
    depth_ = 0;
    return match(s, p);
  }

  /// Pushes a capture (from 0); capture 0 of a pattern without captures is the whole match.
  void push_capture(int i, const char* s, const char* e) const {
    if (i >= n_captures_) {
      if (i != 0) luaL_error(L_, "invalid capture index %%%d", i + 1);
      lua_pushlstring(L_, s, static_cast<std::size_t>(e - s));
      return;
    }
    const Capture& c = captures_[static_cast<std::size_t>(i)];
    if (c.length == kOpen) luaL_error(L_, "unfinished capture");
    if (c.length == kPosition)
      lua_pushinteger(L_, c.start - begin_ + 1);
    else
      lua_pushlstring(L_, c.start, static_cast<std::size_t>(c.length));
  }
  int push_captures(const char* s, const char* e, bool whole_if_none) const {
    const int n = n_captures_ == 0 && whole_if_none ? 1 : n_captures_;
    luaL_checkstack(L_, n, "too many captures");
    for (int i = 0; i < n; ++i) push_capture(i, s, e);
    return n;
  }

  void spend(lua_Integer steps = 1) {
    work_ += steps;
    if (work_ >= kBatch) settle();
  }
  void settle() { LuaHost::charge(L_, std::exchange(work_, 0)); }

 private:
  struct Capture {
    const char* start;
    std::ptrdiff_t length;
  };

  const char* match(const char* s, const char* p) {
    if (depth_++ == kMaxDepth) luaL_error(L_, "pattern too complex");
    const char* const e = match_items(s, p);
    --depth_;
    return e;
  }

  char peek(const char* p) const { return p < pattern_end_ ? *p : '\0'; }

  const char* match_items(const char* s, const char* p) {
    while (p != pattern_end_) {
      spend();
      const char next = peek(p + 1);
      if (*p == '(') return next == ')' ? open_capture(s, p + 2, kPosition) : open_capture(s, p + 1, kOpen);
      if (*p == ')') return close_capture(s, p + 1);
      if (*p == '$' && p + 1 == pattern_end_) return s == end_ ? s : nullptr;
      if (*p == '%' && next == 'b') {
        s = balanced(s, p + 2);
        p += 4;
      } else if (*p == '%' && next == 'f') {
        const char* const set = p + 2;
        if (peek(set) != '[') luaL_error(L_, "missing '[' after '%%f' in pattern");
        p = item_end(set);
        const int before = s == begin_ ? 0 : byte_of(s[-1]), here = s == end_ ? 0 : byte_of(*s);
        if (in_set(before, set, p - 1) || !in_set(here, set, p - 1)) return nullptr;
      } else if (*p == '%' && std::isdigit(byte_of(next))) {
        s = same_as_capture(s, next - '1');
        p += 2;
      } else {
        const char* const after = item_end(p);
        switch (peek(after)) {
          case '*':
            return longest(s, p, after);
          case '+':
            return is_item(s, p, after) ? longest(s + 1, p, after) : nullptr;
          case '-':
            return shortest(s, p, after);
          case '?':
            if (is_item(s, p, after))
              if (const char* const e = match(s + 1, after + 1)) return e;
            p = after + 1;
            continue;
          default:
            s = is_item(s, p, after) ? s + 1 : nullptr;
            p = after;
        }
      }
      if (!s) return nullptr;
    }
    return s;
  }

  /// Where the single item (character, class or set) at `p` ends.
  const char* item_end(const char* p) const {
    const char first = *p++;
    if (first == '%') {
      if (p == pattern_end_) luaL_error(L_, "malformed pattern (ends with '%%')");
      return p + 1;
    }
    if (first != '[') return p;
    if (peek(p) == '^') ++p;
    for (bool at_start = true; p < pattern_end_; at_start = false) {
      if (*p == ']' && !at_start) return p + 1;
      p += *p == '%' && p + 1 < pattern_end_ ? 2 : 1;
    }
    luaL_error(L_, "malformed pattern (missing ']')");
    return p;
  }

  bool is_item(const char* s, const char* p, const char* after) {
    spend();
    if (s == end_) return false;
    switch (*p) {
      case '.':
        return true;
      case '%':
        return in_class(byte_of(*s), p[1]);
      case '[':
        return in_set(byte_of(*s), p, after - 1);
      default:
        return *p == *s;
    }
  }

  /// `p` at the opening, `closing` at the closing bracket.
  bool in_set(int c, const char* p, const char* closing) {
    spend((closing - p) / 4);
    const bool negated = p[1] == '^';
    p += negated ? 2 : 1;
    while (p < closing) {
      if (*p == '%') {
        if (in_class(c, p[1])) return !negated;
        p += 2;
      } else if (p[1] == '-' && p + 2 < closing) {
        if (byte_of(p[0]) <= c && c <= byte_of(p[2])) return !negated;
        p += 3;
      } else {
        if (byte_of(*p) == c) return !negated;
        ++p;
      }
    }
    return negated;
  }

  const char* longest(const char* s, const char* p, const char* after) {
    std::ptrdiff_t n = 0;
    while (is_item(s + n, p, after)) ++n;
    for (; n >= 0; --n)
      if (const char* const e = match(s + n, after + 1)) return e;
    return nullptr;
  }

  const char* shortest(const char* s, const char* p, const char* after) {
    for (;; ++s) {
      if (const char* const e = match(s, after + 1)) return e;
      if (!is_item(s, p, after)) return nullptr;
    }
  }

  const char* balanced(const char* s, const char* p) {
    if (pattern_end_ - p < 2) luaL_error(L_, "malformed pattern (missing arguments to '%%b')");
    if (s == end_ || *s != p[0]) return nullptr;
    for (int open = 1; ++s < end_;) {
      spend();
      if (*s == p[1]) {
        if (--open == 0) return s + 1;
      } else if (*s == p[0]) {
        ++open;
      }
    }
    return nullptr;
  }

  const char* open_capture(const char* s, const char* p, std::ptrdiff_t kind) {
    if (n_captures_ >= kMaxCaptures) luaL_error(L_, "too many captures");
    captures_[static_cast<std::size_t>(n_captures_++)] = {s, kind};
    const char* const e = match(s, p);
    if (!e) --n_captures_;
    return e;
  }

  const char* close_capture(const char* s, const char* p) {
    int i = n_captures_ - 1;
    while (i >= 0 && captures_[static_cast<std::size_t>(i)].length != kOpen) --i;
    if (i < 0) luaL_error(L_, "invalid pattern capture");
    Capture& c = captures_[static_cast<std::size_t>(i)];
    c.length = s - c.start;
    const char* const e = match(s, p);
    if (!e) c.length = kOpen;
    return e;
  }

  const char* same_as_capture(const char* s, int i) {
    if (i < 0 || i >= n_captures_ || captures_[static_cast<std::size_t>(i)].length == kOpen)
      luaL_error(L_, "invalid capture index %%%d", i + 1);
    const Capture& c = captures_[static_cast<std::size_t>(i)];
    if (c.length == kPosition || end_ - s < c.length) return nullptr;
    spend(c.length / 16);
    return std::memcmp(c.start, s, static_cast<std::size_t>(c.length)) == 0 ? s + c.length : nullptr;
  }

  lua_State* L_;
  const char *begin_, *end_, *pattern_end_;
  std::array<Capture, kMaxCaptures> captures_;
  int n_captures_ = 0, depth_ = 0;
  lua_Integer work_ = 0;
};

std::string_view text_at(lua_State* L, int index) {
  std::size_t n = 0;
  const char* const text = luaL_checklstring(L, index, &n);
  return {text, n};
}

/// Argument 3 as an offset from 0: negative ones count from the end. May exceed the length.
std::size_t start_offset(lua_State* L, std::size_t length) {
  const lua_Integer init = luaL_optinteger(L, 3, 1);
  if (init > 0) return static_cast<std::size_t>(init) - 1;
  if (init == 0 || init < -static_cast<lua_Integer>(length)) return 0;
  return length - static_cast<std::size_t>(-init);
}

const char* find_plain(Matcher& m, std::string_view s, std::string_view wanted) {
  if (wanted.empty()) return s.data();
  while (s.size() >= wanted.size()) {
    const std::size_t at = s.find(wanted.front());
    m.spend(1 + static_cast<lua_Integer>(std::min(at, s.size()) / 64 + wanted.size() / 16));
    if (at == std::string_view::npos || s.size() - at < wanted.size()) return nullptr;
    if (std::memcmp(s.data() + at, wanted.data(), wanted.size()) == 0) return s.data() + at;
    s.remove_prefix(at + 1);
  }
  return nullptr;
}

int find_or_match(lua_State* L, bool is_find) {
  const std::string_view s = text_at(L, 1), p = text_at(L, 2);
  const std::size_t init = start_offset(L, s.size());
  const bool is_plain = is_find && (lua_toboolean(L, 4) || p.find_first_of("^$*+?.([%-") == std::string_view::npos);
  const bool is_anchored = !is_plain && !p.empty() && p.front() == '^';
  Matcher m(L, s, p);
  const char *start = nullptr, *end = nullptr;
  if (init <= s.size() && is_plain) {
    start = find_plain(m, s.substr(init), p);
    end = start ? start + p.size() : nullptr;
  } else if (init <= s.size()) {
    const char* const last = is_anchored ? s.data() + init : s.data() + s.size();
    for (start = s.data() + init; start <= last; ++start)
      if ((end = m.match_at(start, p.data() + is_anchored))) break;
  }
  m.settle();
  if (!end) {
    lua_pushnil(L);
    return 1;
  }
  if (!is_find) return m.push_captures(start, end, true);
  lua_pushinteger(L, start - s.data() + 1);
  lua_pushinteger(L, end - s.data());
  return 2 + m.push_captures(start, end, false);
}

int find(lua_State* L) { return find_or_match(L, true); }
int match(lua_State* L) { return find_or_match(L, false); }

/// Upvalues: text, pattern, offset to go on from, offset where the last match ended (-1 at first).
int next_match(lua_State* L) {
  const std::string_view s = text_at(L, lua_upvalueindex(1)), p = text_at(L, lua_upvalueindex(2));
  const lua_Integer last_end = lua_tointeger(L, lua_upvalueindex(4));
  Matcher m(L, s, p);
  for (const char* start = s.data() + lua_tointeger(L, lua_upvalueindex(3)); start <= s.data() + s.size(); ++start) {
    const char* const end = m.match_at(start, p.data());
    if (!end || end - s.data() == last_end) continue;
    m.settle();
    for (const int upvalue : {3, 4}) {
      lua_pushinteger(L, end - s.data());
      lua_replace(L, lua_upvalueindex(upvalue));
    }
    return m.push_captures(start, end, true);
  }
  m.settle();
  return 0;
}

int gmatch(lua_State* L) {
  const std::string_view s = text_at(L, 1);
  text_at(L, 2);
  const std::size_t init = std::min(start_offset(L, s.size()), s.size() + 1);
  lua_settop(L, 2);
  lua_pushinteger(L, static_cast<lua_Integer>(init));
  lua_pushinteger(L, -1);
  lua_pushcclosure(L, next_match, 4);
  return 1;
}

/// Adds a replacement text, in which %0 ... %9 stand for the match and its captures.
void add_replacement(lua_State* L, luaL_Buffer* out, const Matcher& m, std::string_view replacement, const char* s, const char* e) {
  for (std::size_t i = 0; i < replacement.size(); ++i) {
    if (replacement[i] != '%') {
      luaL_addchar(out, replacement[i]);
      continue;
    }
    const char c = ++i < replacement.size() ? replacement[i] : '\0';
    if (c == '%') {
      luaL_addchar(out, '%');
    } else if (c == '0') {
      luaL_addlstring(out, s, static_cast<std::size_t>(e - s));
    } else if (std::isdigit(byte_of(c))) {
      m.push_capture(c - '1', s, e);
      luaL_addvalue(out);
    } else {
      luaL_error(L, "invalid use of '%%' in replacement string");
    }
  }
}

int gsub(lua_State* L) {
  const std::string_view s = text_at(L, 1), p = text_at(L, 2);
  const int type = lua_type(L, 3);
  const bool is_text = type == LUA_TSTRING || type == LUA_TNUMBER;
  luaL_argexpected(L, is_text || type == LUA_TTABLE || type == LUA_TFUNCTION, 3, "string/function/table");
  const lua_Integer limit = luaL_optinteger(L, 4, static_cast<lua_Integer>(s.size()) + 1);
  const bool is_anchored = !p.empty() && p.front() == '^';
  const std::string_view replacement = is_text ? text_at(L, 3) : std::string_view{};

  Matcher m(L, s, p);
  const char *at = s.data(), *last_end = nullptr;
  const char* const stop = at + s.size();
  lua_Integer n = 0;
  luaL_Buffer out;
  luaL_buffinit(L, &out);
  while (n < limit) {
    const char* const end = m.match_at(at, p.data() + is_anchored);
    if (end && end != last_end) {
      ++n;
      m.spend(static_cast<lua_Integer>(replacement.size() / 16));
      if (is_text) {
        add_replacement(L, &out, m, replacement, at, end);
      } else {
        if (type == LUA_TTABLE) {
          m.push_capture(0, at, end);
          lua_gettable(L, 3);
        } else {
          lua_pushvalue(L, 3);
          lua_call(L, m.push_captures(at, end, true), 1);
        }
        if (!lua_toboolean(L, -1)) {  // nil and false keep the text
          lua_pop(L, 1);
          lua_pushlstring(L, at, static_cast<std::size_t>(end - at));
        } else if (!lua_isstring(L, -1)) {
          return luaL_error(L, "invalid replacement value (a %s)", luaL_typename(L, -1));
        }
        luaL_addvalue(&out);
      }
      at = last_end = end;
    } else if (at < stop) {
      luaL_addchar(&out, *at++);
    } else {
      break;
    }
    if (is_anchored) break;
  }
  m.settle();
  luaL_addlstring(&out, at, static_cast<std::size_t>(stop - at));
  luaL_pushresult(&out);
  lua_pushinteger(L, n);
  return 2;
}

}  // namespace

void open_patterns(lua_State* L) {
  constexpr luaL_Reg kFunctions[] = {{"find", find}, {"match", match}, {"gmatch", gmatch}, {"gsub", gsub}, {nullptr, nullptr}};
  luaL_setfuncs(L, kFunctions, 0);
}

}  // namespace cardan
