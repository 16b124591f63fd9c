// Missions in Lua, as far as `cardan check` goes.
#include <gtest/gtest.h>

#include <filesystem>

#include "scripts/bindings/open.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
using fuzz::Keep;
using fuzz::Random;

const fs::path kSource = CARDAN_SOURCE_DIR;

const std::vector<std::string> kLuaWords = {"vehicle",      "mission",
                                            "initial",      "signals",
                                            "controller",   "phase",
                                            "event",        "check",
                                            "figure",       "parameters",
                                            "require",      "plugin",
                                            "sat",          "sim",
                                            "body",         "hinge",
                                            "node",         "modes",
                                            "load",         "set",
                                            "torque",       "force",
                                            "profile",      "hold",
                                            "sine",         "rate_table",
                                            "rate",         "period",
                                            "step",         "function",
                                            "return",       "end",
                                            "local",        "nil",
                                            "true",         "false",
                                            "for",          "while",
                                            "do",           "if",
                                            "then",         "pairs",
                                            "ipairs",       "next",
                                            "setmetatable", "getmetatable",
                                            "__index",      "__gc",
                                            "__close",      "__len",
                                            "pcall",        "error",
                                            "string",       "rep",
                                            "format",       "gsub",
                                            "table",        "concat",
                                            "sort",         "unpack",
                                            "math",         "huge",
                                            "random",       "coroutine",
                                            "wrap",         "yield",
                                            "vec",          "quat",
                                            "matrix",       "vector",
                                            "operators",    "linearize",
                                            "system_modes", "inverse_kinematics",
                                            "state",        "print",
                                            "tostring",     "duration",
                                            "integrator",   "method",
                                            "relative",     "absolute",
                                            "max_step",     "output",
                                            "reactions",    "ledger",
                                            "title",        "below",
                                            "above",        "within",
                                            "equal",        "tolerance",
                                            "unit",         "value",
                                            "until_",       "when",
                                            "direction",    "rising",
                                            "action",       "_G",
                                            "_ENV",         "goto",
                                            "1e308",        "0x7fffffffffffffff",
                                            "-1",           "0/0",
                                            "[[",           "]]",
                                            "--[[",         "~=",
                                            "//",           "<close>",
                                            "..",           "..."};

TEST(Fuzz, Mission) {
  const std::vector<std::string> seeds =
      fuzz::sources({"tests/scripts/errors", "tests/scripts/missions", "tests/fuzz", "scenarios"}, ".lua");
  ASSERT_GT(seeds.size(), 30u);
  // The vehicles that the missions name, in the folders where they look for them.
  const fs::path folder = test::scratch("missions");
  fs::remove_all(folder);
  fs::create_directories(folder / "mission");
  for (const char* from : {"tests/scripts/errors", "tests/scripts/missions", "tests/fuzz/seeds"})
    for (const auto& entry : fs::recursive_directory_iterator(kSource / from))
      if (entry.path().extension() == ".yaml")
        for (const fs::path& to : {folder, folder / "mission"})
          fs::copy_file(entry.path(), to / entry.path().filename(), fs::copy_options::overwrite_existing);
  const fs::path file = folder / "mission/scenario.lua";
  const auto load = [&](const std::string& text, ScenarioOptions options) {
    fuzz::write(file.string(), text);
    options.file = file;
    open_scenario(options);
  };
  std::vector<std::string> good;
  for (const std::string& seed : seeds) {
    try {
      load(seed, {});
      good.push_back(seed);
    } catch (const InputError&) {
    } catch (const NumericsError&) {  // what tests/scripts/errors has
    }
  }
  ASSERT_GT(good.size(), 8u);
  fuzz::run("mission", [&](Random& random, const Keep& keep) {
    const std::string text = fuzz::mutated(random.of(random.one_in(4) ? seeds : good), seeds, kLuaWords, random);
    ScenarioOptions options;
    options.seed = random.below(3);
    if (random.one_in(6))
      options.settings.push_back({fuzz::mutated(random.of(std::vector<std::string>{"mission.duration", "vehicle.bodies.bus.mass",
                                                                                   "mission.integrator.relative", "spin"}),
                                                seeds, kLuaWords, random),
                                  fuzz::mutated("20 deg", {"1e-9", "[1, 2]", "true"}, kLuaWords, random)});
    keep(text + (options.settings.empty() ? "" : "\n-- --set " + options.settings[0].key + "=" + options.settings[0].value));
    load(text, options);
  });
}

}  // namespace
}  // namespace cardan
