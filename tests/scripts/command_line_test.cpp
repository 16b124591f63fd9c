// What a person at a shell types first, and mistypes: an answer that helps.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

using nlohmann::json;

Finished cardan(const std::vector<std::string>& arguments, const std::string& folder = kMissions) { return run_program(arguments, folder); }

/// The fields of the only error.
json error_of(std::vector<std::string> arguments) {
  arguments.emplace_back("--json-errors");
  const Finished run = cardan(arguments);
  EXPECT_EQ(run.exit_code, 2) << run.out;
  const json all = json::parse(run.err)["errors"];
  EXPECT_EQ(all.size(), 1u) << run.err;
  EXPECT_EQ(all[0]["code"], "C0801");
  return all[0];
}

/// Names of commands, from the overview.
std::vector<std::string> commands() {
  std::vector<std::string> names;
  std::istringstream overview(cardan({"help"}).out);
  std::string line, name;
  while (std::getline(overview, line) && !line.starts_with("A scenario"))
    if (line.starts_with("  ") && std::istringstream(line) >> name) names.push_back(name);
  return names;
}

TEST(CommandLine, AloneTellsTheCommands) {
  const Finished alone = cardan({});
  EXPECT_EQ(alone.exit_code, 0) << alone.err;
  for (const char* part : {"usage: cardan COMMAND", "  run           Run a scenario", "cardan check scenario.lua", "cardan help C0107"})
    EXPECT_TRUE(has(alone.out, part)) << part << "\n" << alone.out;
  EXPECT_EQ(cardan({"--help"}).out, alone.out);
  EXPECT_EQ(cardan({"help"}).out, alone.out);
  EXPECT_EQ(commands(),
            (std::vector<std::string>{"run", "check", "describe", "report", "regress", "campaign", "precision", "diff", "workbench",
                                      "modes", "types", "import", "new", "check-plugin", "help", "completion", "version"}));
}

TEST(CommandLine, TakesVersionAsAnOptionToo) {
  const Finished option = cardan({"--version"});
  EXPECT_EQ(option.exit_code, 0);
  EXPECT_TRUE(option.out.starts_with("cardan "));
  EXPECT_EQ(option.out, cardan({"version"}).out);
}

TEST(CommandLine, AsksWhetherAnotherCommandIsMeant) {
  const json rnu = error_of({"rnu", "drive"});
  EXPECT_EQ(rnu["got"], "\"rnu\"");
  EXPECT_EQ(rnu["hint"], "did you mean \"run\"?");
  EXPECT_TRUE(has(rnu["expected"], "run, check, describe"));
  EXPECT_EQ(error_of({"work", "drive"})["hint"], "did you mean \"workbench\"?") << "the beginning of one";
  EXPECT_EQ(error_of({"scenario.lua"})["hint"], "did you mean \"cardan run scenario.lua\"?");
  EXPECT_EQ(error_of({"drive"})["hint"], "did you mean \"cardan run drive\"?") << "a folder";
  EXPECT_EQ(error_of({"sat.yaml"})["hint"], "did you mean \"cardan workbench sat.yaml\"?");
  EXPECT_EQ(error_of({"arm.urdf"})["hint"], "did you mean \"cardan import arm.urdf\"?");
  EXPECT_EQ(error_of({"out/run.h5"})["hint"], "did you mean \"cardan report out/run.h5\"?");
  EXPECT_EQ(error_of({"./acme.so"})["hint"], "did you mean \"cardan check-plugin ./acme.so\"?");
}

TEST(CommandLine, AnswersNamesThatLeadNowhereOrToAnEndlessFile) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", "cardan: 1\nbodies: {a: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world}}}\n");
  write(dir / "scenario.lua", "vehicle 'vehicle.yaml' mission { duration = 1 }");
  const std::vector<std::vector<std::string>> lines = {{"workbench", ""},
                                                       {"workbench", std::string(5000, 'a')},
                                                       {"workbench", "scenario.lua", "--script", "/dev/zero"},
                                                       {"import", "/dev/zero"},
                                                       {"run", "scenario.lua", "--settings", "/dev/zero"}};
  for (const auto& line : lines) {
    const Finished run = run_program(line, dir.path(), [] { alarm(60); });
    EXPECT_EQ(run.exit_code, 2) << line[0] << ": " << run.err;
    EXPECT_EQ(run.err.find("error[C"), 0u) << run.err.substr(0, 500);
  }
  for (const std::vector<std::string>& line : {std::vector<std::string>{"new", "hinge", "a/b"}, {"regress", dir.path()}}) {
    const std::string gone = dir / "gone";
    std::filesystem::create_directory(gone);
    const Finished run = run_program(line, gone, [&] { rmdir(gone.c_str()); });
    EXPECT_EQ(run.exit_code, 2) << run.err;
    EXPECT_EQ(run.err.find("error[C"), 0u) << run.err;
  }
}

TEST(CommandLine, AsksWhetherAnotherOptionIsMeant) {
  const json outt = error_of({"run", "drive", "--outt", "x"});
  EXPECT_EQ(outt["got"], "\"--outt\"");
  EXPECT_EQ(outt["hint"], "did you mean \"--out\"?");
  EXPECT_EQ(error_of({"run", "drive", "--quite=1"})["hint"], "did you mean \"--quiet\"?");
  EXPECT_EQ(error_of({"run", "--check", "drive"})["hint"], "did you mean \"--check-against-reference\"?");
  EXPECT_EQ(error_of({"check", "drive", "--until", "3"})["hint"], "an option of run, campaign, precision");
  EXPECT_EQ(error_of({"run", "drive", "flexible"})["got"], "\"flexible\"") << "one scenario";
}

TEST(CommandLine, RefusesAnEmptyValue) {
  EXPECT_EQ(error_of({"run", "drive", "--out", ""})["got"], "--out: an empty word where a value is expected");
}

TEST(CommandLine, SaysWhichNumbersItTakes) {
  const std::pair<std::vector<std::string>, std::string> answers[] = {
      {{"run", "--until", "abc"}, "  at: --until\n  expected: a number\n  got:      \"abc\"\n"},
      {{"run", "--until", "nan"}, "  expected: a number\n  got:      \"nan\"\n"},
      {{"regress", "x", "--jobs", "0"}, "  at: --jobs\n  expected: a whole number from 1 to 1024\n  got:      \"0\"\n"},
      {{"regress", "x", "--jobs", "010"}, "  expected: a whole number from 1 to 1024\n  got:      \"010\"\n"},
      {{"check-plugin", "x", "--seed", "-3"}, "  expected: a whole number from 0 to 18446744073709551615\n  got:      \"-3\"\n"}};
  for (const auto& [words, answer] : answers) EXPECT_TRUE(has(run_program(words, ".").err, answer)) << run_program(words, ".").err;
}

TEST(CommandLine, SaysWhatIsMissing) {
  const std::pair<std::vector<std::string>, std::string> answers[] = {
      {{"run", "x", "--until"}, "  at: --until\n  expected: one value: SECONDS\n  got:      none\n  hint:     cardan help run\n"},
      {{"run", "x", "--until", "1", "--until", "2"}, "  at: --until\n  expected: one value: SECONDS\n  got:      several\n"},
      {{"run", "x", "--set"}, "  at: --set\n  expected: one value: KEY=VALUE\n  got:      none\n"},
      {{"run", "x", "--quiet=maybe"}, "  at: --quiet\n  expected: no value\n  got:      \"maybe\"\n  hint:     cardan help run\n"},
      {{"campaign", "x"}, "  expected: cardan campaign SCENARIO --runs N:1 to 1000000\n  got:      no --runs\n"},
      {{"new", "hinge"}, "  expected: cardan new KIND NAME\n  got:      no name\n  hint:     cardan help new\n"}};
  for (const auto& [words, answer] : answers) EXPECT_TRUE(has(run_program(words, ".").err, answer)) << run_program(words, ".").err;
}

TEST(CommandLine, HelpKnowsEveryCommand) {
  for (const std::string& name : commands()) {
    const Finished help = cardan({"help", name});
    EXPECT_EQ(help.exit_code, 0);
    EXPECT_TRUE(has(help.out, "cardan " + name)) << help.out;
    EXPECT_EQ(help.out, cardan({name, "--help"}).out);
  }
  EXPECT_EQ(error_of({"help", "rnu"})["hint"], "did you mean \"run\"?");
}

TEST(CommandLine, HelpExplainsEveryCode) {
  const Finished all = cardan({"help", "errors"});
  std::istringstream lines(all.out);
  int count = 0;
  for (std::string line; std::getline(lines, line) && !line.empty(); ++count) {
    const std::string code = line.substr(0, line.find(' ')), title = line.substr(line.find_first_not_of(' ', code.size()));
    const Finished one = cardan({"help", code});
    EXPECT_TRUE(one.out.starts_with(code + " " + title + "\n\n")) << one.out;
    EXPECT_GT(one.out.size(), code.size() + title.size() + 20) << "a paragraph";
    EXPECT_FALSE(has(one.out, "\n#")) << "of this code alone: " << one.out;
  }
  EXPECT_GT(count, 50);
  EXPECT_TRUE(has(cardan({"help", "c0107"}).out, "`N m/rad`"));
  EXPECT_TRUE(cardan({"help", "W0301"}).out.starts_with("W0301 "));
  EXPECT_EQ(error_of({"help", "C017"})["hint"], "did you mean \"C0107\"?");
}

// The page is made from the declarations of the commands: what the program takes and what the page tells cannot differ.
TEST(CommandLine, TheManualPageHasEveryCommandAndOption) {
  const TemporaryFolder dir;
  const std::string page = cardan({"help", "man"}).out;
  EXPECT_TRUE(page.starts_with(".TH CARDAN 1 ")) << page;
  const std::string plain = replaced(page, "\\-", "-");
  for (const std::string& name : commands()) {
    EXPECT_TRUE(has(plain, ".SS " + name + " ")) << name;
    std::istringstream help(cardan({"help", name}).out);
    for (std::string word; help >> word;) EXPECT_TRUE(!word.starts_with("--") || has(plain, word)) << name << " " << word;
  }
  std::ofstream(dir / "cardan.1") << page;
  if (std::system("command -v groff > /dev/null") != 0) GTEST_SKIP() << "groff is not installed";
  const std::string command = "groff -man -Tutf8 -ww -z " + (dir / "cardan.1") + " 2> " + (dir / "said");
  EXPECT_EQ(std::system(command.c_str()), 0);
  EXPECT_EQ(file_text(dir / "said"), "");
}

/// What bash offers for the last of these words, one per line, sorted.
std::string offered(const std::string& words, const std::string& folder) {
  const TemporaryFolder dir;
  const std::string program = CARDAN_BINARY_DIR "/cardan";
  std::ofstream(dir / "ask") << "eval \"$(" << program << " completion bash)\"\nCOMP_WORDS=(" << words
                             << ")\nCOMP_CWORD=$((${#COMP_WORDS[@]} - 1))\n_cardan\nprintf '%s\\n' \"${COMPREPLY[@]}\" | LC_ALL=C sort\n";
  const std::string command = "cd '" + folder + "' && bash --norc " + (dir / "ask") + " > " + (dir / "out") + " 2>&1";
  EXPECT_EQ(std::system(command.c_str()), 0);
  return file_text(dir / "out");
}

TEST(CommandLine, BashCompletesCommandsOptionsAndFiles) {
  const TemporaryFolder dir;
  for (const char* file : {"a.lua", "b b.lua", "sat.yaml", "run.h5", "cam.so", "notes.txt", "arm.urdf"}) std::ofstream(dir / file) << "";
  std::filesystem::create_directory(dir / "folder");
  EXPECT_EQ(offered("cardan des", dir.path()), "describe\n");
  EXPECT_EQ(offered("cardan --v", dir.path()), "--version\n");
  EXPECT_EQ(offered("cardan run --check", dir.path()), "--check-against-reference\n");
  EXPECT_EQ(offered("cardan run ''", dir.path()), "a.lua\nb b.lua\nfolder\n");
  EXPECT_EQ(offered("cardan workbench s", dir.path()), "sat.yaml\n");
  EXPECT_EQ(offered("cardan report ''", dir.path()), "folder\nrun.h5\n");
  EXPECT_EQ(offered("cardan import ''", dir.path()), "arm.urdf\nfolder\n");
  EXPECT_EQ(offered("cardan import arm.urdf --base f", dir.path()), "fixed\nfree\n");
  EXPECT_EQ(offered("cardan import arm.urdf --out ''", dir.path()), "folder\nsat.yaml\n");
  EXPECT_EQ(offered("cardan check-plugin c", dir.path()), "cam.so\n");
  EXPECT_EQ(offered("cardan run a.lua --out ''", dir.path()), "folder\n");
  EXPECT_EQ(offered("cardan types rev", dir.path()), "revolute\n");
  EXPECT_EQ(offered("cardan help C010", dir.path()), "C0101\nC0102\nC0103\nC0104\nC0105\nC0106\nC0107\nC0108\n");
  EXPECT_EQ(offered("cardan completion ''", dir.path()), "bash\nzsh\n");
}

TEST(CommandLine, ListsTheTypesWithTheirParameters) {
  const Finished list = cardan({"types"});
  EXPECT_EQ(list.exit_code, 0) << list.err;
  for (const char* part : {"  rigid ", "  modal_flexible ", "  revolute              1  rotation about one axis\n",
                           "  free                  6  ", "\nhinge loads\n  stop                    pushes back",
                           "\n  friction                against the rate", "\n  radiation_pressure      pressure of light"})
    EXPECT_TRUE(has(list.out, part)) << part << "\n" << list.out;
  EXPECT_EQ(cardan({"types", "friction"}).out,
            "hinge load friction: against the rate, smoothed about zero over `width`: what is held creeps below it\n"
            "  parameters    coulomb: number [N m or N], required\n"
            "                  while it moves\n"
            "                breakaway: number [N m or N], default `coulomb`\n"
            "                  at its largest, just as it begins to move\n"
            "                stribeck_rate: number [rad/s or m/s], default 10 `width`\n"
            "                  over which it falls from `breakaway` to `coulomb`\n"
            "                viscous: number [N m s/rad or N s/m], default 0\n"
            "                  part in proportion to the rate\n"
            "                width: number [rad/s or m/s], required\n"
            "                  below it the friction grows in proportion to the rate; a small one is stiff\n");
  const json stop = json::parse(cardan({"types", "stop", "--json"}).out)["hinge_loads"][0]["parameters"];
  EXPECT_EQ(stop[0], (json{{"name", "lower"},
                           {"kind", "number"},
                           {"unit", "rad or m"},
                           {"range", ""},
                           {"default", "optional"},
                           {"meaning", "least coordinate without contact; this or `upper`, or both"}}));
  EXPECT_EQ(stop[3]["default"], "default 1.5");
  EXPECT_EQ(cardan({"types", "helical"}).out,
            "hinge helical: screw: rotation about an axis with an advance of pitch metres per radian\n"
            "  parameters    axis: axis, 3 numbers of any length, required\n"
            "                  hinge axis, in the axes of the hinge nodes\n"
            "                pitch: number [m/rad], required\n"
            "                  advance along the axis per radian\n"
            "  coordinates   angle [rad]\n"
            "  velocities    rate [rad/s]\n");
  EXPECT_EQ(error_of({"types", "revolut"})["hint"], "did you mean \"revolute\"?");
  const json free = json::parse(cardan({"types", "free", "--json"}).out)["hinges"][0];
  EXPECT_EQ(free["coordinates"].size(), 7u);
  EXPECT_EQ(free["velocities"].size(), 6u);
  EXPECT_EQ(
      cardan({"types", "translational"}).out,
      "hinge translational: three translations in the axes of the inboard node, no rotation\n"
      "  coordinates   x [m]\n                y [m]\n                z [m]\n                [x, y, z] together: position\n"
      "  velocities    vx [m/s]\n                vy [m/s]\n                vz [m/s]\n                [vx, vy, vz] together: velocity\n");
}

TEST(CommandLine, ListsTheTypesOfAPlugin) {
  const TemporaryFolder dir;
  std::filesystem::copy(CARDAN_BINARY_DIR "/plugins/custom_cam.so", dir / "cam.so");
  const Finished cam = cardan({"types", "custom_cam", "--plugin", "cam.so"}, dir.path());
  EXPECT_EQ(cam.exit_code, 0) << cam.err;
  for (const char* part : {"a: number [1/m], required\n", "  coordinates   s [m]\n", "  plugin        cam.so\n"})
    EXPECT_TRUE(has(cam.out, part)) << part << "\n" << cam.out;
}

}  // namespace
}  // namespace cardan
