#include "scripts/mission/workbench.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <limits>

#include "core/io/yaml_reader.hpp"
#include "scripts/bindings/help.hpp"
#include "scripts/bindings/open.hpp"
#include "scripts/bindings/sim.hpp"
#include "scripts/commands/commands.hpp"
#include "scripts/commands/line_editor.hpp"
#include "scripts/commands/streams.hpp"
#include "scripts/lua/inspect.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

// A person waits and can interrupt: only memory is bounded.
constexpr LuaBudget kPatience{std::numeric_limits<std::int64_t>::max() / 2, 1e9};

std::atomic<bool> interrupt{false};
static_assert(std::atomic<bool>::is_always_lock_free);  // so that a signal may set it
std::atomic<int> unanswered{0};
static_assert(std::atomic<int>::is_always_lock_free);
/// What runs looks at the flag between its parts. Where that takes too long, a large factorisation for one, the third Ctrl-C ends
/// the program.
void on_interrupt(int) {
  if (interrupt && ++unanswered >= 2) _exit(130);
  interrupt = true;
}

/// Of the window of a terminal, in characters; 0 where the output is none.
std::size_t window_width() {
  winsize size{};
  return ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 ? size.ws_col : 0;
}

struct WorkbenchArguments {
  ScenarioArguments scenario;
  std::string script, out;
};

class WorkbenchCommand {
 public:
  WorkbenchCommand(const WorkbenchArguments& a, bool json_errors) : json_errors_(json_errors), scenario_(load(a)), bench_(*scenario_) {
    bind_sim(*scenario_, &bench_);
    bind_help(*scenario_);
    scenario_->lua.bind("assert", [this](lua_State* L) { return check_assertion(L); });
  }

  int run_script(const std::string& path) {
    const std::string text = read_text_file(path);
    return guarded([&] { scenario_->lua.run_text(path, text, kPatience); });
  }

  /// Lines of a file or a pipe: what fails is told, and the rest goes on; the exit code is that of the first failure.
  int run_lines(std::istream& in) {
    int code = 0;
    std::string statement, line;
    const auto finish = [&] {
      const int answer = execute(statement);
      if (code == 0) code = answer;
      statement.clear();
    };
    while (std::getline(in, line)) {
      statement += (statement.empty() ? "" : "\n") + line;
      if (!is_unfinished(statement)) finish();
    }
    if (!statement.empty()) finish();
    return code;
  }

  int run_prompt() {
    struct sigaction action {};
    action.sa_handler = on_interrupt;
    action.sa_flags = SA_RESTART;  // a line of output that it meets goes out whole; the wait for input gives up all the same
    sigaction(SIGINT, &action, nullptr);
    LineEditor editor(
        state_file("workbench_history"),
        [this](std::string_view line) {
          Completion c =
              complete(scenario_->lua, line, {&api_reference(), [this](std::string_view word) { return names_for(*scenario_, word); }});
          return LineEditor::Completion{c.start, std::move(c.names)};
        },
        interrupt);
    fmt::print("The loaded scene is `sim`; `help` tells what there is, TAB completes, Ctrl-C interrupts, Ctrl-D leaves.\n");
    std::string statement, line;
    for (;;) {
      std::fflush(stdout);
      interrupt = false, unanswered = 0;
      const auto answer = editor.read(statement.empty() ? "> " : ">> ", line);
      if (answer == LineEditor::Answer::end) return 0;
      if (answer == LineEditor::Answer::interrupt) {
        statement.clear();
        continue;
      }
      editor.remember(line);
      statement += (statement.empty() ? "" : "\n") + line;
      if (is_unfinished(statement)) continue;
      execute(statement);
      statement.clear();
    }
  }

 private:
  static std::unique_ptr<Scenario> load(const WorkbenchArguments& a) {
    ScenarioOptions options = a.scenario.options();
    options.print = [](std::string_view line) { fmt::print("{}\n", line); };
    options.interrupt = &interrupt;
    options.width = window_width;
    std::error_code ignored;  // what is wrong with the name is told where it is opened
    const fs::path script =
        fs::is_directory(options.file, ignored) ? options.file / "scenario.lua" : options.file;  // of `.` too its folder has a name
    options.output =
        a.out.empty() ? fs::path("out") / fs::absolute(script, ignored).lexically_normal().parent_path().filename() : fs::path(a.out);
    const std::string ending = options.file.extension().string();
    return ending == ".yaml" || ending == ".yml" ? open_vehicle(options) : open_scenario(options);
  }

  /// Pushes the function of an expression or a statement, or what is wrong with it.
  static bool compile(lua_State* L, const std::string& text) {
    const auto load = [L](const std::string& all) {
      LuaHost::charge(L, static_cast<std::int64_t>(all.size()));
      return luaL_loadbufferx(L, all.data(), all.size(), "@prompt", "t") == LUA_OK;
    };
    if (load("return " + text)) return true;
    const std::string as_expression = lua_tostring(L, -1);
    lua_pop(L, 1);
    if (load(text)) return true;
    const std::string as_statement = lua_tostring(L, -1);
    lua_pop(L, 1);
    const bool unfinished = as_statement.ends_with("<eof>") || as_expression.ends_with("<eof>");
    lua_pushboolean(L, unfinished);
    return false;
  }

  bool is_unfinished(const std::string& statement) {
    bool unfinished = false;
    try {
      scenario_->lua.protect([&](lua_State* L) { unfinished = !compile(L, statement) && lua_toboolean(L, -1); }, kPatience);
    } catch (const InputError&) {  // interrupted: execute() will tell
    }
    return unfinished;
  }

  /// Runs one statement and prints its values; what is wrong is told. Returns an exit code.
  int execute(const std::string& statement) {
    return guarded([&] {
      bool legal = true;
      std::string out;
      scenario_->lua.protect(
          [&](lua_State* L) {
            legal = compile(L, statement);
            if (!legal) return;
            const int base = lua_gettop(L) - 1;
            lua_call(L, 0, LUA_MULTRET);
            for (int i = base + 1, top = lua_gettop(L); i <= top; ++i) {
              const std::string text = value_text(L, i);
              const bool long_text = text.find('\n') != std::string::npos || out.find('\n') != std::string::npos;
              out += (out.empty() ? "" : long_text ? "\n" : "\t") + text;
            }
            if (lua_gettop(L) > base) out += '\n';
          },
          kPatience);
      if (!legal) scenario_->lua.run_text("prompt", statement, kPatience);  // tells what is wrong
      fmt::print("{}", out);
    });
  }

  template <class Work>
  int guarded(Work&& work) {
    failed_assertion_.reset();
    try {
      work();
      std::fflush(stdout);
      return 0;
    } catch (const InputError& e) {
      std::fflush(stdout);
      const Diagnostic& first = e.diagnostics().front();
      const bool is_assertion = failed_assertion_ && first.code == Code::lua_runtime && first.about.ends_with(*failed_assertion_);
      if (json_errors_) return report_error(e, true, is_assertion ? 1 : 2);
      if (interrupt) complain("\n");  // after the ^C that the terminal shows
      for (const Diagnostic& d : e.diagnostics()) complain(render(d));
      return is_assertion ? 1 : 2;
    } catch (const std::exception& e) {
      std::fflush(stdout);
      return report_error(e, json_errors_);
    }
  }

  /// `assert`, which remembers what failed: that is an exit code of its own.
  int check_assertion(lua_State* L) {
    luaL_checkany(L, 1);
    if (lua_toboolean(L, 1)) return lua_gettop(L);
    if (lua_isnone(L, 2)) lua_pushliteral(L, "assertion failed!");
    failed_assertion_ = lua_isstring(L, 2) ? lua_tostring(L, 2) : "";
    lua_settop(L, 2);
    return lua_error(L);
  }

  bool json_errors_;
  std::optional<std::string> failed_assertion_;
  std::unique_ptr<Scenario> scenario_;
  Workbench bench_;
};

}  // namespace

void add_workbench(CommandLine& line) {
  Command& command = line.command("workbench", "A prompt, or a script, on a loaded scene: states, quantities, matrices");
  auto a = std::make_shared<WorkbenchArguments>();
  a->scenario.add_to(command, line, "The scenario: a Lua file, or a folder with scenario.lua; or a vehicle: a YAML file",
                     "SCENARIO|VEHICLE");
  command.option("--script", a->script, "Run this Lua file instead of a prompt").type_name("SCRIPT");
  command.option("--out", a->out, "Folder of the files that scripts write; default: out/<folder of the scenario>").type_name("DIR");
  command.action([&line, a] {
    WorkbenchCommand workbench(*a, line.json_errors());
    if (!a->script.empty()) return workbench.run_script(a->script);
    return isatty(STDIN_FILENO) ? workbench.run_prompt() : workbench.run_lines(std::cin);
  });
}

}  // namespace cardan
