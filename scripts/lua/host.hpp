#pragma once
// A Lua 5.4 state for scenarios: no files, no clock, no addresses; the same script gives the same result on every run;
// every call is bounded in instructions, time and memory; every error is an InputError with file, line and traceback.
// Lua here is the library compiled as C++ (lua5.4-c++): its errors are C++ exceptions, so destructors run.
#include <lauxlib.h>
#include <lua.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <exception>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/base/diagnostic.hpp"

namespace cardan {

/// What one call from C++ into Lua may spend. One step is one VM instruction, or the like amount of work in a library
/// function: a comparison of the pattern matcher, an element moved, 16 bytes read, 64 bytes allocated, 16 floating-point
/// operations of matrices.
struct LuaBudget {
  std::int64_t steps;
  double seconds;  ///< wall clock; only a failure depends on it, never a result
};
inline constexpr LuaBudget kSetupBudget{2'000'000'000, 60.0};
inline constexpr LuaBudget kCallBudget{100'000'000, 10.0};  ///< of a controller, an event, ...: about half a second

struct LuaOptions {
  std::filesystem::path folder;                 ///< scenario folder: `require` resolves here and nowhere above
  std::map<std::string, std::string> built_in;  ///< modules of the program itself: name -> Lua text
  std::uint64_t seed = 0;                       ///< of math.random
  std::size_t memory_bytes = std::size_t{256} << 20;
  std::function<void(std::string_view line)> print = [](std::string_view) {};
  std::function<std::size_t()> width = [] { return std::size_t{0}; };  ///< of the window, in characters; 0: tables do not wrap
  std::filesystem::path output;                                        ///< folder of the files that scripts write; empty: they write none
  const std::atomic<bool>* interrupt = nullptr;                        ///< once true, the running call ends as if its budget were used up
  /// Where it is given, files of the scenario folder come from here (null: there is none of this name) and not from the disk.
  std::function<const std::string*(const std::string& name)> stored;
  /// Called with each file of the scenario folder that is read, before it runs: the inputs whose hash is recorded.
  std::function<void(const std::string& name, std::string_view text)> loaded = [](const std::string&, std::string_view) {};
};

/// One per thread; neither copied nor moved.
class LuaHost {
 public:
  /// A function for scripts: arguments on the stack, returns the number of results, like lua_CFunction. It may throw
  /// any std::exception: a script's pcall can catch it, otherwise it leaves `protect` unchanged.
  using Binding = std::function<int(lua_State*)>;

  /// Stands between a script and what C++ offers to it, bindings and methods of handles: to keep what they gave, or to give it again.
  class Tape {
   public:
    virtual ~Tape() = default;
    /// In place of function(L).
    virtual int call(lua_State* L, lua_CFunction function) = 0;
    /// What the script does now it has done before.
    virtual bool is_played() const = 0;
  };

  static constexpr char kModules[] = "cardan.modules";  ///< key in the registry: what `require` has returned, by names

  explicit LuaHost(LuaOptions options = {});
  LuaHost(const LuaHost&) = delete;
  LuaHost& operator=(const LuaHost&) = delete;

  /// Reads and runs a file of the scenario folder. Errors: C0102, C0501, C0503, C0504, or what a binding threw.
  void run_file(const std::string& name, const LuaBudget& budget = kSetupBudget);
  /// Runs `text`; `name` stands for the file in messages.
  void run_text(const std::string& name, std::string_view text, const LuaBudget& budget = kSetupBudget);

  /// Makes a global function; "mission.phase" puts it into the global table `mission`, which is made if absent. `taped`: a Tape is told.
  void bind(const std::string& name, Binding function, bool taped = true);
  /// Pushes a function (inside protect); it is kept until the host ends, so this is for set-up.
  void push(lua_State* L, Binding function, bool taped = true);

  /// While it lives this tape is told; null: none, as at first.
  struct Taping {
    Taping(LuaHost& of, Tape* tape) : host(of), before(std::exchange(of.tape_, tape)) {}
    ~Taping() { host.tape_ = before; }
    Taping(const Taping&) = delete;
    Taping& operator=(const Taping&) = delete;
    LuaHost& host;
    Tape* before;
  };
  bool is_played() const { return tape_ && tape_->is_played(); }
  /// Inside protect: goes on with a coroutine on whose stack its function, or what its yield returns, has n arguments. True: it has
  /// yielded, and gave nothing; false: it has ended. What goes wrong in it is told with its own stack.
  bool resume(lua_State* L, lua_State* coroutine, int n);

  /// Calls job(lua_State*) where Lua errors are caught, with a fresh budget, and leaves the stack as it was: use it
  /// around anything that may raise a Lua error. May be nested (a binding that runs a simulation that calls
  /// controllers). Time that bindings spend does not count. No allocation. Errors: as run_file.
  template <class Job>
  void protect(Job&& job, const LuaBudget& budget = kSetupBudget) {
    using Plain = std::remove_reference_t<Job>;
    call_protected([](lua_State* L, const void* data) { (*static_cast<Plain*>(const_cast<void*>(data)))(L); }, std::addressof(job), budget);
  }

  // For library functions and bindings, inside protect.
  /// Calls `function`; a std::exception that it throws goes on as in a Binding. For methods of userdata: unlike a Binding,
  /// this costs nothing. Inside, Poll::now() ends it where the person interrupts or the time is up.
  static int guarded(lua_State* L, lua_CFunction function);
  /// The same of a function that a Tape is told of: function(L) is guarded.
  static int offered(lua_State* L, lua_CFunction function);
  static LuaHost& of(lua_State* L) { return **static_cast<LuaHost**>(lua_getextraspace(L)); }
  /// Spends steps of the running call's budget; raises the error that no script can catch when they are used up.
  static void charge(lua_State* L, std::int64_t steps);
  /// True once the running call is out of budget.
  static bool is_exhausted(lua_State* L) { return of(L).meter_.exceeded != Limit::none; }
  /// Place of the nearest script line on the call stack (built-in modules are passed over).
  static SourceMark caller(lua_State* L);
  /// Where the function at `index` begins.
  SourceMark definition(lua_State* L, int index) const;
  /// "scenario.lua:18 in function 'setup'  <  scenario.lua:44 in main chunk"
  static std::string traceback(lua_State* L);
  /// Order of creation of a table, Lua function, thread or userdata without user values, the same on every run. It is read from
  /// before the object's block, which Lua's manual does not promise to be where lua_topointer says: verified for 5.4.4, and looked
  /// at when a host is made. Where it is not so, objects as keys of `pairs` and `next` are refused.
  std::uint64_t creation_order(lua_State* L, int index) const;
  bool is_interrupted() const { return options_.interrupt && *options_.interrupt; }
  const LuaOptions& options() const { return options_; }
  /// What LuaFunction::call may spend; until it is set, kCallBudget.
  const LuaBudget& call_budget() const { return call_budget_; }
  void set_call_budget(const LuaBudget& budget) { call_budget_ = budget; }
  lua_State* state() const { return state_.get(); }

 private:
  using Clock = std::chrono::steady_clock;
  enum class Limit { none, steps, seconds, interrupt };
  struct Exhausted : std::exception {  // what a poll throws inside of a binding, on its way to `exceed`
    Limit limit;
    explicit Exhausted(Limit l) : limit(l) {}
  };
  struct Meter {
    LuaBudget budget{};
    std::int64_t left = 0;
    Clock::time_point deadline;
    Limit exceeded = Limit::none;
  };
  /// What is known about an error while the stack that raised it still stands.
  struct Fault {
    std::string message, stack, hint;
    SourceMark mark;
  };

  static void* allocate(void* host, void* block, std::size_t old_size, std::size_t new_size);
  static void on_count(lua_State* L, lua_Debug*);
  static int on_error(lua_State* L);
  static int trampoline(lua_State* L);
  static int dispatch(lua_State* L);
  static int call_binding(lua_State* L);
  template <class F>
  static int translated(lua_State* L, F&& f);
  void open_libraries(lua_State* L);  // sandbox.cpp
  void poll() const;
  int require(lua_State* L);

  void call_protected(void (*run)(lua_State*, const void*), const void* job, const LuaBudget& budget);
  [[noreturn]] void fail(lua_State* L, int status, int base, const Meter& meter);
  [[noreturn]] void exceed(lua_State* L, Limit limit);
  void locate(lua_State* L, std::string_view message);
  void locate_error(lua_State* L);
  SourceMark mark_of(const std::string& chunk, int line) const;
  void load(lua_State* L, const std::string& chunk, std::string_view text);
  std::string read(const std::string& name, const Diagnostic& if_absent) const;

  LuaOptions options_;
  std::size_t memory_ = 0;         // [B] in use
  bool machine_is_short_ = false;  // the last block that was refused was refused by the machine, not by the budget
  std::uint64_t created_ = 0;      // serial number of the newest block
  void* newest_userdata_ = nullptr;
  bool knows_order_ = true;             // creation_order() has been found right for one object of each kind
  std::ptrdiff_t userdata_offset_ = 0;  // from a userdata's block to its payload
  Meter meter_;
  bool time_counts_ = true;  // false in a Binding: what C++ works there is not the script's
  LuaBudget call_budget_ = kCallBudget;
  Fault fault_;
  bool located_ = false;  // of the error on its way, in a coroutine: fault_ has its place
  struct Bound {
    Binding function;
    bool taped;
  };
  std::deque<Bound> bindings_;
  Tape* tape_ = nullptr;
  std::vector<std::string> requiring_;  // modules that are being read, outermost first
  std::unique_ptr<lua_State, void (*)(lua_State*)> state_;
  lua_State* running_ = nullptr;  // the thread that C++ may use now
};

/// An error at the script line that runs now.
[[noreturn]] void refuse(lua_State* L, Code code, std::string key_path, std::string expected, std::string got, std::string hint = {});

/// More arguments than a method takes, behind what stands before its colon, are refused: none of them would be heard. Of a function
/// nothing stands `before` them.
void expect_at_most(lua_State* L, int arguments, int before = 1);

/// A global function that takes at most so many arguments.
template <class F>
LuaHost::Binding limited(int arguments, F function) {
  return [=](lua_State* L) {
    expect_at_most(L, arguments, 0);
    return function(L);
  };
}

/// LuaHost::guarded as a method of userdata that is the script's own, vectors and matrices.
template <lua_CFunction kFunction>
int own_method(lua_State* L) {
  return LuaHost::guarded(L, kFunction);
}
/// The same of one that stands for something outside of the script.
template <lua_CFunction kFunction>
int method(lua_State* L) {
  return LuaHost::offered(L, own_method<kFunction>);
}
/// The same of one that takes at most so many arguments.
template <lua_CFunction kFunction, int kArguments>
int limited(lua_State* L) {
  expect_at_most(L, kArguments);
  return kFunction(L);
}
template <lua_CFunction kFunction, int kArguments>
int own_method(lua_State* L) {
  return own_method<limited<kFunction, kArguments>>(L);
}
template <lua_CFunction kFunction, int kArguments>
int method(lua_State* L) {
  return method<limited<kFunction, kArguments>>(L);
}

}  // namespace cardan
