#include "scripts/lua/host.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <fstream>
#include <iterator>
#include <limits>
#include <new>
#include <utility>

#include "core/base/poll.hpp"
#include "core/base/units.hpp"

namespace cardan {
namespace {

constexpr int kHookSteps = 500;                // instructions between two looks at the budget
constexpr std::size_t kHeader = 16;            // before each block: its serial number; keeps the alignment
constexpr std::size_t kLargeBlock = 64 << 10;  // [B] refused once the budget is used up
constexpr int kMaxFrames = 10;                 // of a traceback
constexpr char kFailure[] = "cardan.failure";  // metatable of a C++ exception on its way through Lua
constexpr std::array kAbsent = {"os", "io", "debug", "package", "dofile", "loadfile", "collectgarbage"};

void push_failure(lua_State* L, std::exception_ptr failure) {
  new (lua_newuserdatauv(L, sizeof failure, 0)) std::exception_ptr(std::move(failure));
  luaL_setmetatable(L, kFailure);
}

int failure_to_text(lua_State* L) {
  std::string text;
  try {
    std::rethrow_exception(*static_cast<std::exception_ptr*>(luaL_checkudata(L, 1, kFailure)));
  } catch (const std::exception& e) {
    text = e.what();
  }
  lua_pushlstring(L, text.data(), text.size());
  return 1;
}

int failure_collected(lua_State* L) {
  static_cast<std::exception_ptr*>(luaL_checkudata(L, 1, kFailure))->~exception_ptr();
  return 0;
}

void make_failure_type(lua_State* L) {
  luaL_newmetatable(L, kFailure);
  lua_pushcfunction(L, failure_to_text);
  lua_setfield(L, -2, "__tostring");
  lua_pushcfunction(L, failure_collected);
  lua_setfield(L, -2, "__gc");
  lua_pushboolean(L, 0);
  lua_setfield(L, -2, "__metatable");
  lua_pop(L, 1);
}

struct Call {
  void (*run)(lua_State*, const void*);
  const void* job;
};

/// "scenario.lua:18: text" -> chunk, line, text; line 0 if the message does not begin with a place. Of several places,
/// as a message gets on its way through coroutines, the last one. Time grows with the length of the message.
struct Placed {
  std::string chunk;
  int line = 0;
  std::string text;
};
Placed split_place(std::string_view message) {
  std::string_view chunk, text = message;
  int line = 0;
  for (std::size_t colon = text.find(':'); colon != std::string_view::npos; colon = text.find(':', colon + 1)) {
    const std::size_t end = text.find_first_not_of("0123456789", colon + 1);
    if (end == std::string_view::npos) break;
    if (end == colon + 1 || end > colon + 9 || text.substr(end, 2) != ": ") continue;
    const std::string_view name = text.substr(0, colon);
    if (name.find(' ') != std::string_view::npos && name.front() != '[') break;  // a text that has numbers of its own
    chunk = name;
    std::from_chars(text.data() + colon + 1, text.data() + end, line);
    text.remove_prefix(end + 2);
    colon = std::string_view::npos;  // from the start again
  }
  constexpr std::size_t kLongest = 16 << 10;
  std::string kept(text.substr(0, kLongest));
  if (text.size() > kLongest) kept += fmt::format(" ... ({} bytes more)", text.size() - kLongest);
  return {std::string(chunk.substr(0, kLongest)), line, std::move(kept)};
}

bool is_script(const lua_Debug& frame) { return *frame.what != 'C' && *frame.source != '='; }

const char* chunk_of(const lua_Debug& frame) { return *frame.source == '@' ? frame.source + 1 : frame.short_src; }

/// "did you mean" for an undefined global, or why it is absent.
std::string hint_for(lua_State* L, const std::string& message) {
  constexpr std::string_view kOpening = "(global '";
  const std::size_t start = message.find(kOpening);
  if (start == std::string::npos) return {};
  const std::size_t first = start + kOpening.size();
  const std::string name = message.substr(first, message.find('\'', first) - first);
  if (std::find(kAbsent.begin(), kAbsent.end(), name) != kAbsent.end())
    return fmt::format("scripts have no `{}`: a run must give the same result everywhere", name);
  std::vector<std::string> globals;
  lua_pushglobaltable(L);
  for (lua_pushnil(L); lua_next(L, -2); lua_pop(L, 1))
    if (lua_type(L, -2) == LUA_TSTRING) globals.emplace_back(lua_tostring(L, -2));
  lua_pop(L, 1);
  std::sort(globals.begin(), globals.end());
  return did_you_mean(name, globals);
}

/// For the key of a table that is a word of the language, which is what `until` in phase{...} runs into.
std::string keyword_hint(const std::string& message) {
  return message.ends_with("near 'until'") ? "`until` is a word of Lua: the key of a phase is `until_`" : "";
}

bool ends_with(const std::string& text, std::string_view end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

LuaHost::LuaHost(LuaOptions options) : options_(std::move(options)), state_(nullptr, &lua_close) {
  meter_.left = std::numeric_limits<std::int64_t>::max();
  state_.reset(lua_newstate(&allocate, this));
  if (!state_) throw std::bad_alloc();
  running_ = state_.get();
  *static_cast<LuaHost**>(lua_getextraspace(running_)) = this;
  protect([this](lua_State* L) {
    const auto* payload = static_cast<std::byte*>(lua_newuserdatauv(L, 1, 0));
    userdata_offset_ = payload - static_cast<std::byte*>(newest_userdata_);
    const auto is_newest = [&](std::uint64_t before) {  // an object that was made since then, with at most two blocks before it
      const std::uint64_t order = creation_order(L, -1);
      return order > before && order <= created_;
    };
    std::uint64_t before = created_;
    lua_newuserdatauv(L, 1, 0);
    knows_order_ = is_newest(before);
    before = created_;
    lua_newtable(L);
    knows_order_ = knows_order_ && is_newest(before);
    before = created_;
    lua_newthread(L);
    knows_order_ = knows_order_ && is_newest(before);
    before = created_;
    lua_pushnil(L);
    lua_pushcclosure(L, on_error, 1);
    knows_order_ = knows_order_ && is_newest(before);
    lua_settop(L, 0);
    make_failure_type(L);
    open_libraries(L);
    lua_newtable(L);
    lua_setfield(L, LUA_REGISTRYINDEX, kModules);
  });
  bind(
      "require", [this](lua_State* L) { return require(L); }, false);
}

void LuaHost::run_file(const std::string& name, const LuaBudget& budget) {
  const std::string text = read(name, {Code::file_not_found, {{}, {(options_.folder / name).string()}}, "a Lua file", {}, {}, {}, {}});
  run_text(name, text, budget);
}

void LuaHost::run_text(const std::string& name, std::string_view text, const LuaBudget& budget) {
  protect(
      [&](lua_State* L) {
        load(L, "@" + name, text);
        lua_call(L, 0, 0);
      },
      budget);
}

void LuaHost::push(lua_State* L, Binding function, bool taped) {
  bindings_.push_back({std::move(function), taped});
  lua_pushlightuserdata(L, &bindings_.back());
  lua_pushcclosure(L, dispatch, 1);
}

void LuaHost::bind(const std::string& name, Binding function, bool taped) {
  protect([&](lua_State* L) {
    lua_pushglobaltable(L);
    const std::size_t dot = name.find('.');
    if (dot != std::string::npos) luaL_getsubtable(L, -1, name.substr(0, dot).c_str());
    push(L, std::move(function), taped);
    lua_setfield(L, -2, name.substr(dot + 1).c_str());  // npos + 1 = 0
  });
}

// ---- calls ----

void LuaHost::call_protected(void (*run)(lua_State*, const void*), const void* job, const LuaBudget& budget) {
  lua_State* const L = running_;
  const Meter outer = meter_;
  meter_ = {budget, budget.steps, Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(budget.seconds)),
            Limit::none};
  const bool time_counted = std::exchange(time_counts_, true);
  const Poll look([this] { poll(); });
  lua_sethook(L, on_count, LUA_MASKCOUNT, kHookSteps);
  Call call{run, job};
  const int base = lua_gettop(L);
  int status = LUA_ERRMEM;
  if (lua_checkstack(L, LUA_MINSTACK)) {
    lua_pushcfunction(L, on_error);
    lua_pushcfunction(L, trampoline);
    lua_pushlightuserdata(L, &call);
    status = lua_pcall(L, 1, 0, base + 1);
  }
  const Meter spent = std::exchange(meter_, outer);
  running_ = L;
  time_counts_ = time_counted;
  meter_.left = std::max<std::int64_t>(meter_.left - kHookSteps, -1);  // the outer count begins anew: what it had counted at most
  lua_sethook(L, on_count, LUA_MASKCOUNT, kHookSteps);
  if (status != LUA_OK) fail(L, status, base, spent);
  lua_settop(L, base);
}

/// Runs `f`; a C++ exception becomes a Lua error that carries it, that of a poll the end of the budget. (Lua's own errors are
/// no std::exception.)
template <class F>
int LuaHost::translated(lua_State* L, F&& f) {
  std::exception_ptr failure;
  Limit limit = Limit::none;
  try {
    return f();
  } catch (const Exhausted& end) {
    limit = end.limit;
  } catch (const std::exception&) {
    failure = std::current_exception();
  }
  if (limit != Limit::none) of(L).exceed(L, limit);
  push_failure(L, std::move(failure));
  return lua_error(L);
}

int LuaHost::trampoline(lua_State* L) {
  const Call& call = *static_cast<const Call*>(lua_touserdata(L, 1));
  lua_settop(L, 0);
  return translated(L, [&] {
    call.run(L, call.job);
    return 0;
  });
}

int LuaHost::dispatch(lua_State* L) {
  const bool taped = static_cast<Bound*>(lua_touserdata(L, lua_upvalueindex(1)))->taped;
  return taped ? offered(L, call_binding) : call_binding(L);
}

int LuaHost::call_binding(lua_State* L) {
  struct InBinding {  // C++ works on this thread, and its time is not the script's
    LuaHost& host;
    lua_State* const before;
    const bool time_counted;
    const Clock::time_point start = Clock::now();
    InBinding(LuaHost& h, lua_State* thread)
        : host(h), before(std::exchange(h.running_, thread)), time_counted(std::exchange(h.time_counts_, false)) {}
    ~InBinding() {
      host.running_ = before;
      host.time_counts_ = time_counted;
      host.meter_.deadline += Clock::now() - start;
    }
  };
  charge(L, 1);
  const Binding& function = static_cast<Bound*>(lua_touserdata(L, lua_upvalueindex(1)))->function;
  return translated(L, [&] {
    const InBinding scope(of(L), L);
    return function(L);
  });
}

int LuaHost::guarded(lua_State* L, lua_CFunction function) {
  return translated(L, [&] { return function(L); });
}

int LuaHost::offered(lua_State* L, lua_CFunction function) {
  Tape* const tape = of(L).tape_;
  return tape ? translated(L, [&] { return tape->call(L, function); }) : function(L);
}

bool LuaHost::resume(lua_State* L, lua_State* coroutine, int n) {
  int given = 0;
  const int status = lua_resume(coroutine, L, n, &given);
  if (status == LUA_YIELD || status == LUA_OK) {
    lua_pop(coroutine, given);
    return status == LUA_YIELD;
  }
  if (is_exhausted(L)) exceed(L, meter_.exceeded);
  if (auto* failure = static_cast<std::exception_ptr*>(luaL_testudata(coroutine, -1, kFailure))) std::rethrow_exception(*failure);
  locate_error(coroutine);
  located_ = true;
  lua_xmove(coroutine, L, 1);
  lua_error(L);
  std::abort();  // not reached: lua_error throws
}

// ---- budget ----

void LuaHost::on_count(lua_State* L, lua_Debug*) { charge(L, kHookSteps); }

void LuaHost::charge(lua_State* L, std::int64_t steps) {
  LuaHost& host = of(L);
  Meter& meter = host.meter_;
  meter.left = steps > meter.left ? -1 : meter.left - std::max<std::int64_t>(steps, 0);
  if (host.is_interrupted()) host.exceed(L, Limit::interrupt);
  if (meter.left < 0) host.exceed(L, Limit::steps);
  if (Clock::now() > meter.deadline) host.exceed(L, Limit::seconds);
}

void LuaHost::poll() const {
  if (is_interrupted()) throw Exhausted(Limit::interrupt);
  if (time_counts_ && Clock::now() > meter_.deadline) throw Exhausted(Limit::seconds);
}

void LuaHost::exceed(lua_State* L, Limit limit) {
  if (meter_.exceeded == Limit::none) {
    meter_.exceeded = limit;
    locate(L, {});
  }
  lua_sethook(L, on_count, LUA_MASKCOUNT, 1);  // from now on every instruction raises, wherever a script catches
  lua_pushlightuserdata(L, this);              // no message: nothing may be allocated, nobody will read it
  lua_error(L);
  std::abort();  // not reached: lua_error throws
}

void* LuaHost::allocate(void* self, void* block, std::size_t old_size, std::size_t new_size) {
  LuaHost& host = *static_cast<LuaHost*>(self);
  auto* const start = block ? static_cast<std::byte*>(block) - kHeader : nullptr;
  const std::size_t held = block ? old_size + kHeader : 0;  // of a new block, old_size tells the kind of object
  if (new_size == 0) {
    std::free(start);
    host.memory_ -= held;
    return nullptr;
  }
  const std::size_t wanted = new_size + kHeader;
  if (wanted > held) {
    const std::size_t growth = wanted - held;
    std::int64_t& left = host.meter_.left;
    left = std::max<std::int64_t>(left - static_cast<std::int64_t>(growth / 64), -1);
    if (host.memory_ + growth > host.options_.memory_bytes || (left < 0 && growth > kLargeBlock)) {
      host.machine_is_short_ = false;
      if (host.running_ && host.meter_.exceeded == Limit::none) host.locate(host.running_, {});
      return nullptr;
    }
  }
  auto* const fresh = static_cast<std::byte*>(std::realloc(start, wanted));
  if (!fresh) {
    host.machine_is_short_ = true;
    if (host.running_ && host.meter_.exceeded == Limit::none) host.locate(host.running_, {});
    return nullptr;
  }
  host.memory_ += wanted - held;
  if (!block) {
    ++host.created_;
    std::memcpy(fresh, &host.created_, sizeof host.created_);
    if (old_size == LUA_TUSERDATA) host.newest_userdata_ = fresh + kHeader;
  }
  return fresh + kHeader;
}

std::uint64_t LuaHost::creation_order(lua_State* L, int index) const {
  if (!knows_order_) luaL_error(L, "objects as keys have no order that is the same on every run with this Lua (%s)", LUA_RELEASE);
  const auto* block = static_cast<const std::byte*>(lua_topointer(L, index));
  if (lua_iscfunction(L, index)) {
    if (!lua_getupvalue(L, index, 1)) return reinterpret_cast<std::uintptr_t>(block);  // no object: its place in the library
    lua_pop(L, 1);
  } else if (lua_isthread(L, index)) {
    block = static_cast<const std::byte*>(lua_getextraspace(lua_tothread(L, index)));
  } else if (lua_islightuserdata(L, index)) {
    return 0;
  } else if (lua_isuserdata(L, index)) {
    block -= userdata_offset_;
  }
  std::uint64_t order = 0;
  std::memcpy(&order, block - kHeader, sizeof order);
  return order;
}

// ---- errors ----

SourceMark LuaHost::mark_of(const std::string& chunk, int line) const {
  std::error_code ignored;
  const std::filesystem::path file = options_.folder / chunk;
  const bool there = (options_.stored && options_.stored(chunk)) || std::filesystem::is_regular_file(file, ignored);
  return {there ? file.string() : chunk, line, 0};
}

SourceMark LuaHost::caller(lua_State* L) {
  lua_Debug frame;
  for (int level = 0; lua_getstack(L, level, &frame); ++level) {
    lua_getinfo(L, "Sl", &frame);
    if (is_script(frame)) return of(L).mark_of(chunk_of(frame), frame.currentline);
  }
  return {};
}

SourceMark LuaHost::definition(lua_State* L, int index) const {
  lua_Debug function;
  lua_pushvalue(L, index);
  lua_getinfo(L, ">S", &function);
  return mark_of(chunk_of(function), function.linedefined);
}

std::string LuaHost::traceback(lua_State* L) {
  std::string out;
  lua_Debug frame;
  for (int level = 0, shown = 0; lua_getstack(L, level, &frame); ++level) {
    lua_getinfo(L, "Sln", &frame);
    if (*frame.what == 'C') continue;
    if (!out.empty()) out += "  <  ";
    if (++shown > kMaxFrames) return out + "...";
    out += fmt::format("{}:{} in ", chunk_of(frame), frame.currentline);
    if (*frame.what == 'm')
      out += "main chunk";
    else if (frame.name)
      out += fmt::format("function '{}'", frame.name);
    else
      out += fmt::format("function of line {}", frame.linedefined);
  }
  return out;
}

/// Records the place of the error whose stack still stands on `L`: the one its message names, else the nearest script
/// line.
void LuaHost::locate(lua_State* L, std::string_view message) {
  const Placed placed = split_place(message);
  fault_ = {placed.text, traceback(L), {}, caller(L)};
  const bool in_built_in = !placed.chunk.empty() && placed.chunk.front() == '[' && placed.chunk.rfind("[string", 0) != 0;
  if (placed.line > 0 && (!in_built_in || fault_.mark.file.empty())) fault_.mark = mark_of(placed.chunk, placed.line);
}

int LuaHost::on_error(lua_State* L) {
  LuaHost& host = of(L);
  if (std::exchange(host.located_, false) || is_exhausted(L) || luaL_testudata(L, 1, kFailure)) return 1;
  host.locate_error(L);
  return 1;
}

/// The same of the error object at the top, which stays there.
void LuaHost::locate_error(lua_State* L) {
  const int at = lua_gettop(L), type = lua_type(L, at);
  const bool has_text = type == LUA_TSTRING || type == LUA_TNUMBER || luaL_getmetafield(L, at, "__tostring") != LUA_TNIL;
  locate(L, has_text ? luaL_tolstring(L, at, nullptr) : lua_pushfstring(L, "error object is a %s value", luaL_typename(L, at)));
  fault_.hint = hint_for(L, fault_.message);
  lua_settop(L, at);
}

void LuaHost::fail(lua_State* L, int status, int base, const Meter& meter) {
  if (meter.exceeded == Limit::none) {
    if (auto* failure = static_cast<std::exception_ptr*>(luaL_testudata(L, -1, kFailure))) {
      const std::exception_ptr copy = *failure;
      lua_settop(L, base);
      std::rethrow_exception(copy);
    }
  }
  Fault fault = std::exchange(fault_, {});
  if (fault.message.empty() && lua_type(L, -1) == LUA_TSTRING) fault.message = split_place(lua_tostring(L, -1)).text;
  lua_settop(L, base);
  const bool is_memory = status == LUA_ERRMEM || ends_with(fault.message, "not enough memory");
  Diagnostic d{Code::lua_budget, {{}, fault.mark}, {}, {}, {}, fault.stack, {}};
  if (meter.exceeded == Limit::interrupt) {
    d.about = "interrupted";
  } else if (meter.exceeded == Limit::seconds) {
    d.expected = fmt::format("at most {:g} s in one call", meter.budget.seconds);
    d.got = "a script that is still running";
  } else if (meter.exceeded == Limit::steps || (is_memory && meter.left < 0)) {
    d.expected = fmt::format("at most {} steps in one call", meter.budget.steps);
    d.got = "a script that is still running";
    d.hint = "a loop that does not end?";
  } else if (is_memory && machine_is_short_) {
    d.code = Code::no_memory;
    d.got = fmt::format("no more memory for a script that holds {} MiB", memory_ >> 20);
    d.hint = "a larger limit (ulimit -v), or a script that keeps less";
  } else if (is_memory) {
    d.expected = fmt::format("at most {} MiB of memory", options_.memory_bytes >> 20);
    d.got = "a script that asks for more";
    d.hint = "a table or a text that grows without end?";
  } else {
    d.code = Code::lua_runtime;
    d.about = fmt::format("{}: {}", title_of(d.code), fault.message);
    d.hint = fault.hint;
  }
  throw InputError(std::move(d));
}

// ---- reading ----

void LuaHost::load(lua_State* L, const std::string& chunk, std::string_view text) {
  charge(L, static_cast<std::int64_t>(text.size()));
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);  // the byte-order mark of some editors
  const int status = luaL_loadbufferx(L, text.data(), text.size(), chunk.c_str(), "t");
  if (status == LUA_OK) return;
  const std::string_view message = lua_type(L, -1) == LUA_TSTRING ? lua_tostring(L, -1) : "";
  const bool too_deep = status == LUA_ERRRUN && message.find("C stack overflow") != std::string_view::npos;
  if (status != LUA_ERRSYNTAX && !too_deep) lua_error(L);
  const Placed placed = split_place(message);
  throw InputError(
      Diagnostic{Code::lua_syntax,
                 {{}, mark_of(chunk.substr(1), placed.line)},
                 {},
                 {},
                 too_deep ? "brackets, tables or functions more than about 200 deep in one another" : keyword_hint(placed.text),
                 {},
                 fmt::format("{}: {}", title_of(Code::lua_syntax), too_deep ? "nested too deeply" : placed.text)});
}

std::string LuaHost::read(const std::string& name, const Diagnostic& if_absent) const {
  namespace fs = std::filesystem;
  if (options_.stored) {
    const std::string* text = options_.stored(name);
    if (!text) throw InputError(if_absent);
    options_.loaded(name, *text);
    return *text;
  }
  std::error_code ignored;
  const fs::path root = fs::weakly_canonical(options_.folder.empty() ? fs::path(".") : options_.folder, ignored);
  const fs::path file = fs::weakly_canonical(root / name, ignored);
  const bool is_inside = std::mismatch(root.begin(), root.end(), file.begin(), file.end()).first == root.end();
  const auto refuse = [&](const std::string& got) {
    Diagnostic told = if_absent;
    if (told.got.empty()) told.got = got;
    throw InputError(std::move(told));
  };
  if (!is_inside) refuse("a file outside of the folder of the scenario");
  std::error_code why;
  const fs::file_status status = fs::status(file, why);
  if (why || !fs::exists(status)) refuse(why ? why.message() : "no such file");
  if (!fs::is_regular_file(status)) refuse(fs::is_directory(status) ? "a folder" : "a pipe or a device");  // opening a FIFO would wait
  std::ifstream in(file, std::ios::binary);
  if (!in) refuse(std::error_code(errno, std::generic_category()).message());
  std::string text{std::istreambuf_iterator<char>(in), {}};
  options_.loaded(name, text);
  return text;
}

int LuaHost::require(lua_State* L) {
  const std::string name = luaL_checkstring(L, 1);
  lua_getfield(L, LUA_REGISTRYINDEX, kModules);
  const int modules = lua_gettop(L);
  if (lua_getfield(L, modules, name.c_str()) != LUA_TNIL) return 1;

  if (std::find(requiring_.begin(), requiring_.end(), name) != requiring_.end())
    luaL_error(L, "module '%s' requires itself by way of '%s'", name.c_str(), requiring_.back().c_str());
  const auto built_in = options_.built_in.find(name);
  std::string text, chunk;
  if (built_in != options_.built_in.end()) {
    text = built_in->second;
    chunk = "=[" + name + "]";
  } else {
    const bool has_name = name.find_first_of("/\\") == std::string::npos && ("." + name + ".").find("..") == std::string::npos;
    std::string file = name + ".lua", known;
    std::replace(file.begin(), file.end() - 4, '.', '/');
    for (const auto& [module, unused] : options_.built_in) known += (known.empty() ? ", or one of: " : ", ") + module;
    const std::string wanted = has_name ? file + " in the scenario folder" + known
                                        : "the name of a file of the scenario folder without .lua, with points for folders: lib.law";
    const Diagnostic absent{Code::file_not_found, {"require", caller(L)}, wanted, in_quotes(name), {}, traceback(L), "module not found"};
    if (!has_name) throw InputError(absent);
    text = read(file, absent);
    chunk = "@" + file;
  }

  struct Requiring {
    std::vector<std::string>& names;
    Requiring(std::vector<std::string>& all, const std::string& name) : names(all) { names.push_back(name); }
    ~Requiring() { names.pop_back(); }
  } const scope(requiring_, name);
  load(L, chunk, text);
  lua_call(L, 0, 1);
  if (lua_isnil(L, -1)) lua_pushboolean(L, 1);
  lua_pushvalue(L, -1);
  lua_setfield(L, modules, name.c_str());
  return 1;
}

void expect_at_most(lua_State* L, int arguments, int before) {
  const int given = lua_gettop(L) - before;
  if (given <= arguments) return;
  lua_Debug frame;
  const bool named = lua_getstack(L, 0, &frame) && lua_getinfo(L, "n", &frame) && frame.name;
  refuse(L, Code::lua_argument, named ? frame.name : "a method", fmt::format("{} argument{} at most", arguments, arguments == 1 ? "" : "s"),
         fmt::format("{}", given), "a call as the last argument gives all its results: (f(x)) gives the first alone");
}

void refuse(lua_State* L, Code code, std::string key_path, std::string expected, std::string got, std::string hint) {
  throw InputError(Diagnostic{
      code, {std::move(key_path), LuaHost::caller(L)}, std::move(expected), std::move(got), std::move(hint), LuaHost::traceback(L)});
}

}  // namespace cardan
