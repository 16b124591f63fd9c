// `cardan workbench`: a script, lines from a pipe, and a person at a terminal.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/io/hdf5_file.hpp"
#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const std::string kPendulum = kMissions + "/pendulum", kPhases = kMissions + "/phases";

/// The lines through a pipe; what is told about errors stands between the values, as a person sees it.
Finished piped(const std::vector<std::string>& arguments, const std::string& lines, const std::string& folder, bool mixed = false) {
  const TemporaryFolder dir;
  write(dir / "lines", lines);
  std::vector<std::string> all{"workbench"};
  all.insert(all.end(), arguments.begin(), arguments.end());
  return run_program(all, folder, [&] {
    const int in = open((dir / "lines").c_str(), O_RDONLY);
    if (dup2(in, STDIN_FILENO) < 0 || (mixed && dup2(STDOUT_FILENO, STDERR_FILENO) < 0)) _exit(99);
  });
}

Finished script(const std::string& text, const std::vector<std::string>& more = {}) {
  const TemporaryFolder dir;
  write(dir / "look.lua", text);
  std::vector<std::string> all{"workbench", kPendulum, "--script", "look.lua"};
  all.insert(all.end(), more.begin(), more.end());
  return run_program(all, dir.path());
}

// ---- scripts ----

TEST(Workbench, AScriptSeesTheSceneAtItsInitialState) {
  const Finished run = script(
      "local q, v = sim:q(), sim:v()\n"
      "assert(sim:t() == 0 and #q == 1 and q['rod.angle'] == math.rad(30) and v['rod.rate'] == 0)\n"
      "assert(q:labels().units[1] == 'rad' and v:labels().units[1] == 'rad/s')\n"
      "assert(sim:vehicle():mass() == 2)\n"
      // J phi'' = -m g c sin phi about the hinge, J = 0.2 + 2 * 0.5^2
      "assert(math.abs(sim:vdot()[1] + 2 * 9.81 * 0.5 * math.sin(q[1]) / 0.7) < 1e-13)\n"
      "print('seen')");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(run.out, "seen\n");
}

TEST(Workbench, AStateThatIsSetIsTheOneThatIsSeen) {
  const Finished run = script(
      "local s = sim:state()\n"
      "sim:state { q = { 0.3 }, v = vector{2}, t = '5 s' }\n"
      "assert(sim:q()[1] == 0.3 and sim:v()[1] == 2 and sim:t() == 5 and sim:vehicle():hinge('rod'):angle() == 0.3)\n"
      "assert(math.abs(sim:vdot()[1] + 9.81 * math.sin(0.3) / 0.7) < 1e-13, 'of the new state')\n"
      "sim:state(s)\n"
      "assert(sim:q() == s.q and sim:v() == s.v and sim:t() == 0)\n"
      "initial { rod = { angle = '10 deg' } }  assert(sim:q()[1] == math.rad(10))");
  EXPECT_EQ(run.exit_code, 0) << run.err;
}

TEST(Workbench, CoordinatesThatHaveANormAreNormalised) {
  const TemporaryFolder dir;
  write(dir / "look.lua",
        "local q = sim:q() for i = 1, 4 do q[i] = 2 * q[i] end sim:state { q = q }\n"
        "local n = 0 for i = 1, 4 do n = n + sim:q()[i] ^ 2 end assert(math.abs(n - 1) < 1e-15)");
  const Finished run = run_program({"workbench", kMissions + "/free_body", "--script", dir / "look.lua"}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.err;
}

TEST(Workbench, RunsTheMissionAsRunDoes) {
  const TemporaryFolder dir;
  const Finished run = run_program({"run", kPhases, "--out", dir / "out"}, dir.path());
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const Hdf5File file = Hdf5File::open(dir / "out/run.h5");
  const auto rows = file.read_doubles("/time").values;
  write(dir / "look.lua",
        "print(string.format('%.17g', sim:run_to(100)))\n"  // an event ends it before
        "for i = 1, #sim:v() do print(string.format('%.17g', sim:v()[i])) end");
  const Finished look = run_program({"workbench", kPhases, "--script", dir / "look.lua"}, dir.path());
  EXPECT_EQ(look.exit_code, 0) << look.err;
  // The last velocity of each hinge in the results is the one that the workbench shows, to the last bit.
  std::istringstream values(look.out);
  double t = 0.0, v = 0.0;
  ASSERT_TRUE(values >> t);
  EXPECT_EQ(t, rows.back());
  int compared = 0;
  for (const std::string& body : file.members("/channels/hinges")) {
    ASSERT_TRUE(values >> v);
    const auto rate = file.read_doubles("/channels/hinges/" + body + "/rate").values;
    EXPECT_EQ(v, rate.back()) << body;
    ++compared;
  }
  EXPECT_GT(compared, 0);
}

TEST(Workbench, RunsOnInPartsAndAgainFromAnotherState) {
  const Finished run = script(
      "local start = sim:state()\n"
      "local ok, why = pcall(sim.run_to, sim, -1) assert(not ok and tostring(why):find('a time from 0 s on', 1, true))\n"
      "assert(sim:run_to(0.2) == 0.2) assert(sim:run_to(2) == 2)\n"  // the ticks of the mission's controller go on
      "local there = sim:state()\n"
      "ok, why = pcall(check, {}) assert(not ok and tostring(why):find('a declaration before the run', 1, true))\n"
      "sim:state(start) sim:run_to(0.5)\n");
  EXPECT_EQ(run.exit_code, 3) << "the scenario's controller counts its ticks: a second run is another one";
  EXPECT_NE(run.err.find("controller \"clock\""), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("stack:    look.lua:6 in main chunk"), std::string::npos) << run.err;
}

TEST(Workbench, ExitCodesTellWhoseFaultItWas) {
  struct Case {
    const char* text;
    int exit_code;
    std::vector<std::string> parts;
  };
  for (const Case& c :
       std::vector<Case>{{"print(1)", 0, {}},
                         {"local function inner()\n  assert(1 == 2, 'numbers differ')\nend\ninner()",
                          1,
                          {"error[C0503]: Lua runtime error: numbers differ", "look.lua:2",
                           "look.lua:2 in function 'inner'  <  look.lua:4 in main chunk"}},
                         {"assert(false)", 1, {"assertion failed!", "look.lua:1"}},
                         {"assert(sim:t() == 0) error('my own')", 2, {"error[C0503]: Lua runtime error: my own", "look.lua:1"}},
                         {"pcall(assert, false, 'caught') local x = nil + 1", 2, {"arithmetic on a nil value"}},
                         {"local x =", 2, {"error[C0501]: Lua syntax error", "look.lua:1"}},
                         {"sim:state { q = { 1, 2 } }",
                          2,
                          {"error[C0502]", "at: sim:state.q", "expected: a vector or a table of 1 numbers", "got:      a table of 2"}},
                         {"sim:state { angle = 1 }", 2, {"sim:state.angle"}},
                         {"sim:state { q = { 0/0 } }", 2, {"finite numbers"}},
                         {"sim:stat()", 2, {"did you mean \"state\"?"}},
                         {"io.open('x')", 2, {"scripts have no `io`"}},
                         {"vector{1}:csv('../x')", 2, {"error[C0701]", "a name that leads out of"}}}) {
    const Finished run = script(c.text);
    EXPECT_EQ(run.exit_code, c.exit_code) << c.text << run.err;
    for (const std::string& part : c.parts) EXPECT_NE(run.err.find(part), std::string::npos) << part << "\n" << run.err;
  }
  const Finished failed = script("assert(false, 'as data')", {"--json-errors"});
  EXPECT_EQ(failed.exit_code, 1);
  EXPECT_EQ(json::parse(failed.err)["exit_code"], 1);
  EXPECT_EQ(script("", {"--script", "absent.lua"}).exit_code, 2);
  EXPECT_EQ(script("", {"--set", "no_such_parameter=1"}).exit_code, 2);
}

TEST(Workbench, ScriptsWriteIntoTheFolderOfResults) {
  const TemporaryFolder dir;
  write(dir / "look.lua", "sim:q():csv('q.csv') sim:q():hdf5('all.h5', 'q')");
  EXPECT_EQ(run_program({"workbench", kPendulum, "--script", "look.lua"}, dir.path()).exit_code, 0);
  EXPECT_EQ(file_text(dir / "out/pendulum/q.csv"), "rod.angle [rad],0.5235987755982988\n");
  const Hdf5File file = Hdf5File::open(dir / "out/pendulum/all.h5");
  EXPECT_EQ(file.texts_attribute("/q", "names"), std::vector<std::string>{"rod.angle"});
  EXPECT_EQ(file.texts_attribute("/q", "units"), std::vector<std::string>{"rad"});
  write(dir / "scenario.lua", "vehicle 'vehicle.yaml' mission { duration = 1 } vector{1}:csv('x.csv')");
  fs::copy(kPendulum + "/vehicle.yaml", dir / "vehicle.yaml");
  EXPECT_EQ(run_program({"run", "."}, dir.path()).exit_code, 2) << "a mission writes its results and nothing else";
}

TEST(Workbench, TellsWhereAFileWentAlsoOfTheFolderItStandsIn) {
  const TemporaryFolder dir;
  fs::copy(kPendulum, dir / "swing", fs::copy_options::recursive);
  for (const std::string& here : {std::string("."), std::string("./"), std::string("scenario.lua"), std::string("../swing")}) {
    const Finished run = piped({here}, "sim:q():csv('m.csv')\nsim:linearize{file = 'sub/plant.m'}.file\n", dir / "swing");
    EXPECT_EQ(run.exit_code, 0) << here << run.err;
    EXPECT_EQ(run.out, "out/swing/m.csv\nout/swing/sub/plant.m\n") << here;
    EXPECT_TRUE(fs::exists(dir / "swing/out/swing/m.csv")) << here;
    fs::remove_all(dir / "swing/out");
  }
}

TEST(Workbench, StatesWithoutARotationAreRefused) {
  const auto answer = [](const std::string& w, const std::string& of = "q[1], q[2], q[3], q[4] = ") {
    const TemporaryFolder dir;
    write(dir / "look.lua", "local q = sim:q() " + of + w + ", 0, 0, 0 sim:state { q = q } assert(sim:q()[1] == sim:q()[1])");
    return run_program({"workbench", kMissions + "/free_body", "--script", dir / "look.lua"}, dir.path());
  };
  for (const char* w : {"0", "1e-200", "1e200"}) {
    const Finished run = answer(w);
    EXPECT_EQ(run.exit_code, 2) << w;
    EXPECT_NE(run.err.find("error[C0304]"), std::string::npos) << run.err;
    EXPECT_NE(run.err.find("a quaternion of body hub with a length from 1e-6 to 1e6"), std::string::npos) << run.err;
  }
  EXPECT_EQ(answer("1e-3").exit_code, 0);
}

TEST(Workbench, TimesMayHaveUnits) {
  const Finished run = script(
      "assert(sim:run_to('100 ms') == 0.1) assert(sim:run_to '0.5 s' == 0.5) local ok, why = pcall(sim.run_to, sim, '5 m') "
      "assert(not ok and tostring(why):find('time [s]', 1, true), tostring(why))");
  EXPECT_EQ(run.exit_code, 0) << run.err;
}

TEST(Workbench, OpensAVehicleWithoutAMission) {
  const TemporaryFolder dir;
  fs::copy(kPendulum + "/vehicle.yaml", dir / "vehicle.yaml");
  const Finished run =
      piped({"vehicle.yaml", "--set", "vehicle.bodies.rod.mass=3 kg"}, "sim\nsim:vehicle():mass()\nsim:run_to(1)\n", dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(run.out, "sim: pendulum, t = 0 s, 1 in q, 1 in v\n3.0\n1.0\n");
}

// ---- lines from a pipe ----

TEST(Workbench, LinesArePrintedAsValuesAndErrorsDoNotEndThem) {
  const Finished run = piped({kPendulum},
                             "1 + 1\n"
                             "x = 5\n"
                             "x, 'text', nil, {a = x}\n"
                             "\n"
                             "for i = 1, 2 do\n"
                             "  print(i)\n"
                             "end\n"
                             "boom()\n"
                             "sim:vehicle():hinge 'rod'\n"
                             "vector{1}, x\n"
                             "local unfinished = (",
                             kMissions);
  EXPECT_EQ(run.exit_code, 2) << "that of the first error";
  EXPECT_EQ(run.out, "2\n5\ttext\tnil\t{a = 5}\n1\n2\nhinge \"rod\": angle\nvector of 1\n  1\n5\n");
  EXPECT_EQ(run.err,
            "error[C0503]: Lua runtime error: attempt to call a nil value (global 'boom')\n  --> prompt:1\n"
            "  stack:    prompt:1 in main chunk\n"
            "error[C0501]: Lua syntax error: unexpected symbol near <eof>\n  --> prompt:1\n");
}

TEST(Workbench, EachFailureOfARunIsToldAsItsOwn) {
  const TemporaryFolder dir;
  fs::copy(kPendulum + "/vehicle.yaml", dir / "vehicle.yaml");
  write(dir / "scenario.lua",
        "vehicle 'vehicle.yaml'\n"
        "mission { duration = '4 s' }\n"
        "event { name = 'looks', when = function() assert(not first, 'the first fault') return 1 end }\n"
        "controller { name = 'acts', rate = '10 Hz', step = function() assert(not second, 'the second fault') end }\n");
  const Finished run =
      piped({"."}, "first = true\nsim:run_to(1)\nfirst = false\nsim:run_to(1)\nsecond = true\nsim:run_to(2)\n", dir.path());
  EXPECT_EQ(run.out, "1.0\n") << "between the two failures";
  const std::size_t first = run.err.find("event \"looks\""), second = run.err.find("controller \"acts\"");
  ASSERT_NE(first, std::string::npos) << run.err;
  ASSERT_NE(second, std::string::npos) << run.err;
  EXPECT_LT(first, second);
  EXPECT_EQ(run.err.find("event \"looks\"", first + 1), std::string::npos) << run.err;
}

TEST(Workbench, APlanThatFailsIsStoppedAndMayBeginAgain) {
  const TemporaryFolder dir;
  fs::copy(kPendulum + "/vehicle.yaml", dir / "vehicle.yaml");
  write(dir / "scenario.lua",
        "vehicle 'vehicle.yaml'\n"
        "mission { duration = '4 s', checkpoint = { period = '1 s' } }\n"
        "plan = sequence { name = 'plan', run = function() wait '0.5 s' assert(good) end }\n");
  const Finished run =
      piped({"."}, "sim:run_to(2)\nplan:state()\nsim:run_to(2)\ngood = true\nplan:start()\nsim:run_to(4)\nplan:state()\n", dir.path());
  EXPECT_EQ(run.out, "stopped\n2.0\n4.0\nended\n") << run.err;
  EXPECT_EQ(run.err.find("internal error"), std::string::npos) << run.err;
}

TEST(Workbench, WhatIsRefusedAtTheStartIsRefusedAgain) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml",
        "cardan: 1\n"
        "bodies:\n"
        "  bob: {mass: 2 kg, inertia: [1, 1, 1], hinge: {type: free, to: world, initial: {position: [0, 0, -2]}}}\n"
        "loops:\n"
        "  rope: {type: distance, from: world, to: bob, length: 2 m, prescribed: true}\n");
  const Finished run = piped({"vehicle.yaml"}, "sim:state { v = {0, 0, 0, 0, 0, 0.3} }\nsim:run_to(0.5)\nsim:run_to(0.5)\n", dir.path());
  EXPECT_EQ(run.out, "");
  const std::size_t first = run.err.find("error[C1103]");
  ASSERT_NE(first, std::string::npos) << run.err;
  EXPECT_NE(run.err.find("error[C1103]", first + 1), std::string::npos) << run.err;
}

/// The sessions of docs/workbench.md: what follows a prompt is given, all else must come back.
TEST(Workbench, TheSessionsOfTheDocumentAreWhatComesBack) {
  std::istringstream page(file_text(CARDAN_SOURCE_DIR "/docs/workbench.md"));
  std::string input, expected;
  bool inside = false;
  for (std::string line; std::getline(page, line);) {
    if (line.starts_with("```")) {
      inside = line == "```text";
    } else if (inside && (line.starts_with("> ") || line.starts_with(">> "))) {
      input += line.substr(line.find(' ') + 1) + "\n";
    } else if (inside) {
      expected += line + "\n";
    }
  }
  ASSERT_FALSE(input.empty());
  const TemporaryFolder dir;
  const Finished run = piped({CARDAN_SOURCE_DIR "/scenarios/01_flexible_slew"}, input, dir.path(), true);
  EXPECT_EQ(replaced(run.out, "\t", "    "), expected) << "a tab is four blanks on the page";
}

// ---- a terminal ----

/// The program on a terminal of its own.
class Terminal {
 public:
  Terminal(const std::vector<std::string>& arguments, const std::string& state_folder) {
    const std::string program = CARDAN_BINARY_DIR "/cardan";
    std::vector<char*> argv{const_cast<char*>(program.c_str())};
    for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
    argv.push_back(nullptr);
    winsize size{40, 200, 0, 0};
    child_ = forkpty(&master_, nullptr, nullptr, &size);
    if (child_ == 0) {
      setenv("XDG_STATE_HOME", state_folder.c_str(), 1);
      setenv("HOME", state_folder.c_str(), 1);
      setenv("TERM", "dumb", 1);
      execv(program.c_str(), argv.data());
      _exit(99);
    }
  }
  ~Terminal() {
    if (child_ > 0) kill(child_, SIGKILL), waitpid(child_, nullptr, 0);
    close(master_);
  }
  bool is_there() const { return child_ > 0; }
  void type(const std::string& text) { ASSERT_EQ(::write(master_, text.data(), text.size()), static_cast<ssize_t>(text.size())); }
  /// Reads until `text` appears after what was matched before.
  bool shows(const std::string& text) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);  // of a hang, not of speed
    while (std::chrono::steady_clock::now() < deadline) {
      if (const auto at = seen_.find(text, matched_); at != std::string::npos) {
        matched_ = at + text.size();
        return true;
      }
      if (!more()) break;
    }
    return seen_.find(text, matched_) != std::string::npos;
  }
  /// Reads until the next line is asked for; "> " alone may be a part of an error's "-->".
  bool asks() {
    if (matched_ > 0) --matched_;  // the end of line that comes first
    return shows("\n> ");
  }
  /// Leaves by Ctrl-D. It counts only once the line is edited, a moment after the prompt is there: hence again and again.
  int leave() {
    for (int i = 0; i < 100 && is_open_; ++i) {
      if (::write(master_, "\x04", 1) != 1) break;
      while (more(100)) {
      }
    }
    if (is_open_) kill(child_, SIGKILL);  // it does not end
    int status = 0;
    waitpid(std::exchange(child_, -1), &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  const std::string& seen() const { return seen_; }

 private:
  bool more(int milliseconds = 10'000) {
    pollfd p{master_, POLLIN, 0};
    if (poll(&p, 1, milliseconds) <= 0) return false;
    char buffer[4096];
    const ssize_t n = read(master_, buffer, sizeof buffer);  // an error once the program has ended
    is_open_ = n > 0;
    if (is_open_) seen_.append(buffer, static_cast<std::size_t>(n));
    return is_open_;
  }
  bool is_open_ = true;
  int master_ = -1;
  pid_t child_ = -1;
  std::string seen_;
  std::size_t matched_ = 0;
};

TEST(WorkbenchTerminal, CompletesInterruptsAndRemembers) {
  const TemporaryFolder state;
  {
    Terminal t({"workbench", kPendulum}, state.path());
    if (!t.is_there()) GTEST_SKIP() << "this system gives no pseudo-terminal (no /dev/pts)";
    ASSERT_TRUE(t.shows("Ctrl-D leaves.\r\n")) << t.seen();
    ASSERT_TRUE(t.asks());
    t.type("sim:ru\t(0.5)\r");
    ASSERT_TRUE(t.shows("\r\n0.5\r\n")) << "completed to run_to\n" << t.seen();
    t.type("sim:v\t");
    ASSERT_TRUE(t.shows("vdot") && t.shows("vehicle") && t.shows("\n> sim:v")) << "all that fit\n" << t.seen();
    t.type("\x03");  // gives the line up
    ASSERT_TRUE(t.asks());
    t.type("print('be' .. 'gun') while true do pcall(function() while true do end end) end\r");
    ASSERT_TRUE(t.shows("\r\nbegun\r\n")) << t.seen();
    t.type("\x03");
    ASSERT_TRUE(t.shows("interrupted")) << t.seen();
    ASSERT_TRUE(t.shows("prompt:1")) << t.seen();
    ASSERT_TRUE(t.asks());
    t.type("print('run' .. 'ning') sim:run_to(1e9)\r");
    ASSERT_TRUE(t.shows("\r\nrunning\r\n")) << t.seen();
    t.type("\x03");
    ASSERT_TRUE(t.shows("interrupted")) << "between two steps\n" << t.seen();
    ASSERT_TRUE(t.asks());
    t.type("sim:vehicle():hinge(\"ro\t\"):an\t()\r");
    ASSERT_TRUE(t.shows("rod\"):angle()\r\n")) << "a name in quotes, and what a call returns\n" << t.seen();
    ASSERT_TRUE(t.asks());
    t.type("s = sim:operators()\r");
    ASSERT_TRUE(t.asks());
    t.type("s:subt\t('rod')\r");
    ASSERT_TRUE(t.shows("subtree('rod')\r\n") && t.shows("operators of the subtree of rod") && t.asks()) << t.seen();
    t.type("help\r");
    ASSERT_TRUE(t.shows("tells about an object") && t.shows("controller(options)") && t.asks()) << t.seen();
    t.type("if sim then\r");
    ASSERT_TRUE(t.shows(">> ")) << t.seen();
    t.type("print(6 * 7) end\r");
    ASSERT_TRUE(t.shows("\r\n42\r\n") && t.asks()) << t.seen();
    EXPECT_EQ(t.leave(), 0) << t.seen();
  }
  Terminal t({"workbench", kPendulum}, state.path());
  ASSERT_TRUE(t.asks()) << t.seen();
  t.type("\x10\r");  // Ctrl-P: the line before
  ASSERT_TRUE(t.shows("print(6 * 7) end") && t.asks()) << t.seen();
  EXPECT_EQ(t.leave(), 0) << t.seen();
}

TEST(WorkbenchTerminal, AnInterruptedFunctionOfTheMissionIsNoFailure) {
  const TemporaryFolder dir;
  fs::copy(kPendulum + "/vehicle.yaml", dir / "vehicle.yaml");
  write(
      dir / "scenario.lua",
      "vehicle 'vehicle.yaml' mission { duration = 10, budget = { steps = 1e12, time = '1 h' } }\n"
      "controller { name = 'slow', rate = '10 Hz', step = function(t) if t > 0.15 then print('wor' .. 'king') while true do end end end }\n"
      "event { name = 'slow', when = function(t) if mission.time() > 100 then print('wor' .. 'king') while true do end end return 1 end, "
      "action = print }\n");
  Terminal t({"workbench", dir.path()}, dir.path());
  if (!t.is_there()) GTEST_SKIP() << "this system gives no pseudo-terminal (no /dev/pts)";
  for (const char* start : {"sim:run_to(1)\r", "sim:state { t = 200 } sim:run_to(201)\r"}) {
    ASSERT_TRUE(t.asks()) << t.seen();
    t.type(start);
    ASSERT_TRUE(t.shows("working")) << t.seen();
    t.type("\x03");
    ASSERT_TRUE(t.shows("error[C0504]: interrupted\r\n")) << t.seen();
  }
  EXPECT_EQ(t.seen().find("exceeded its budget"), std::string::npos) << t.seen();
  ASSERT_TRUE(t.asks());
  EXPECT_EQ(t.leave(), 0) << t.seen();
}

TEST(WorkbenchTerminal, AHistoryThatCannotBeWrittenDoesNotMatter) {
  const TemporaryFolder dir;
  write(dir / "file", "");
  Terminal t({"workbench", kPendulum}, dir / "file");  // no folder can be made below a file
  if (!t.is_there()) GTEST_SKIP() << "this system gives no pseudo-terminal (no /dev/pts)";
  ASSERT_TRUE(t.asks()) << t.seen();
  t.type("print(6 * 7)\r");
  ASSERT_TRUE(t.shows("\r\n42\r\n") && t.asks()) << t.seen();
  EXPECT_EQ(t.leave(), 0) << t.seen();
}

}  // namespace
}  // namespace cardan
