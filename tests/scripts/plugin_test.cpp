// Plugins by the program: a good one in C, and every way in which one may be no plugin, a bad one or a dangerous one.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "core/io/hdf5_file.hpp"
#include "core/io/sha256.hpp"
#include "tests/scripts/run_program.hpp"
#include "tests/support/sanitized.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
const std::string kPlugins = CARDAN_BINARY_DIR "/plugins/";

/// A folder with the plugin as p.so, and a scenario that uses the hinge faulty/slide.
struct PluginFolder : TemporaryFolder {
  explicit PluginFolder(const std::string& plugin = "faulty.so") {
    fs::copy(kPlugins + plugin, *this / "p.so");
    std::ofstream(*this / "vehicle.yaml")
        << "cardan: 1\nbodies:\n  a: {mass: 1, inertia: [1, 1, 1], hinge: {type: faulty/slide, to: world}}\n";
    std::ofstream(*this / "scenario.lua") << "plugin 'p.so' vehicle 'vehicle.yaml' mission { duration = 1, integrator "
                                             "= { method = 'rk4', step = 0.25 } }\n"
                                             "initial { a = { rate = 1 } }\n";
  }
};

Finished with_fault(const std::string& fault, const std::vector<std::string>& arguments, const std::string& folder) {
  return run_program(arguments, folder, [&] { setenv("CARDAN_FAULT", fault.c_str(), 1); });
}

TEST(Plugins, InCAsPrintedInTheDocuments) {
  const TemporaryFolder dir;
  fs::copy(kPlugins + "arc.so", dir / "arc.so");
  const Finished check = run_program({"check-plugin", "arc.so"}, dir.path());
  EXPECT_EQ(check.exit_code, 0) << check.out << check.err;
  EXPECT_EQ(check.out, "ok    hinge acme/arc: motion along a circle\n");
  // One body of 2 kg on a circle of 0.4 m, at rate 3: it goes on, 0.4 m/rad * 3 rad/s, and a torque-free circle needs
  // no energy.
  std::ofstream(dir / "vehicle.yaml")
      << "cardan: 1\nbodies:\n  a: {mass: 2, inertia: [1, 1, 1], hinge: {type: acme/arc, radius: 0.4 m, to: world}}\n";
  std::ofstream(dir / "scenario.lua") << "plugin 'arc.so' vehicle 'vehicle.yaml' mission { duration = 1 } initial { a = { rate = 3 } }\n";
  const Finished run = run_program({"run", ".", "--out", "out", "--quiet", "--check-against-reference"}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
  EXPECT_NEAR(Hdf5File::open(dir / "out/run.h5").read_doubles("/channels/hinges/a/angle").values.back(), 3.0, 1e-8);
}

TEST(Plugins, WithAFieldPullOnWhatDoesNotMove) {
  const TemporaryFolder dir;
  fs::copy(kPlugins + "twins.so", dir / "twins.so");
  std::ofstream(dir / "vehicle.yaml")
      << "cardan: 1\nfields: {earth: {type: twin/point_mass, mu: 398600 km^3/s^2}}\ngravity: {field: earth}\n"
         "bodies:\n  mast: {mass: 2, inertia: [1, 1, 1], hinge: {type: locked, to: {body: world, position: [6378 km, 0, 0]}}}\n";
  std::ofstream(dir / "scenario.lua") << "plugin 'twins.so' vehicle 'vehicle.yaml' mission { duration = 1 }\n";
  const Finished run = run_program({"run", ".", "--out", "out", "--quiet"}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
}

TEST(Plugins, AGoodOneIsUsed) {
  const PluginFolder dir;
  EXPECT_EQ(run_program({"check-plugin", "p.so"}, dir.path()).exit_code, 0);
  const Finished run = run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.err;
}

TEST(Plugins, WhatIsNoPluginIsAnswered) {
  const TemporaryFolder dir;
  std::ofstream(dir / "text.so") << "not a library\n";
  fs::copy(kPlugins + "faulty.so", dir / "short.so");
  fs::resize_file(dir / "short.so", fs::file_size(dir / "short.so") / 2);
  fs::create_directory(dir / "folder");
  ASSERT_EQ(mkfifo((dir / "pipe").c_str(), 0600), 0);
  for (const char* name : {"", "absent.so", "text.so", "short.so", "folder", "pipe", "/dev/null"}) {
    const Finished check = run_program({"check-plugin", name}, dir.path());
    EXPECT_EQ(check.exit_code, 2) << name << check.err;
    EXPECT_TRUE(has(check.err, "error[C0601]: plugin cannot be loaded")) << name << check.err;
  }
  const TemporaryFolder gone;
  const Finished deleted = run_program({"check-plugin", "p.so"}, gone.path(), [&] { fs::remove_all(gone.path()); });
  EXPECT_EQ(deleted.exit_code, 2) << deleted.err;
}

// ---- the report ----

struct Report {
  int exit_code;
  std::string text;
  nlohmann::ordered_json json;
};
/// Of a plugin, as text and as data.
Report report_on(const std::string& plugin, const std::string& fault = "", const std::vector<std::string>& more = {}) {
  const PluginFolder dir(plugin);
  std::vector<std::string> words{"check-plugin", "p.so", "--out", "report.txt", "--json"};
  words.insert(words.end(), more.begin(), more.end());
  const Finished check = with_fault(fault, words, dir.path());
  const auto told = nlohmann::ordered_json::parse(check.out);
  EXPECT_EQ(told["sha256"], sha256_of_file(dir / "p.so"));
  return {check.exit_code, file_text(dir / "report.txt"), told};
}

TEST(PluginReports, TellWhatWasTriedOfEachKind) {
  std::set<std::string> kinds;
  for (const char* plugin : {"arc.so", "acme_bodies.so", "frozen_2_1.so", "frozen_2_2.so"}) {
    const Report report = report_on(plugin, "", {"--samples", "60"});
    EXPECT_EQ(report.exit_code, 0) << plugin;
    EXPECT_EQ(report.json["samples"], 60);
    EXPECT_TRUE(report.json["obeys"]) << plugin;
    EXPECT_TRUE(has(report.text, "verdict          every law that was tried holds\n")) << report.text;
    for (const auto& family : report.json["families"]) {
      kinds.insert(family["kind"]);
      EXPECT_GT(family["laws"].size(), 5u);
      for (const auto& law : family["laws"]) {
        EXPECT_NE(law.contains("not_tried"), law["trials"] > 0) << law;
        EXPECT_TRUE(!law.contains("limit") || law["worst_error"].get<double>() <= law["limit"].get<double>()) << law;
      }
    }
  }
  EXPECT_EQ(kinds, (std::set<std::string>{"hinge", "body", "device", "field"}));
  const Report arc = report_on("arc.so");
  EXPECT_EQ(arc.json["plugin"], (nlohmann::ordered_json{{"name", "acme"}, {"version", "0.1"}, {"licence", "MIT"}}));
  EXPECT_EQ(arc.json["samples"], 1000);
  EXPECT_TRUE(has(arc.text, "the declared shape is true: R                                   its shape is CARDAN_SHAPE_DENSE\n"))
      << arc.text;
}

TEST(PluginReports, TellTheLawThatIsBrokenAndItsError) {
  const Report report = report_on("faulty.so", "law");
  EXPECT_EQ(report.exit_code, 1);
  EXPECT_FALSE(report.json["obeys"]);
  EXPECT_TRUE(has(report.text, "\nverdict          FAIL\n")) << report.text;
  for (const auto& law : report.json["families"][0]["laws"]) {
    if (law["law"] != "linear part of Ht v = R* dl/dt") continue;
    EXPECT_EQ(law["trials"], 1000);
    EXPECT_EQ(law["broken"], 1000);
    // |-2 g v| / (1 + g v + g s (v + u)): below 2 for any gain g.
    EXPECT_GT(law["worst_error"].get<double>(), 1.0);
    EXPECT_LT(law["worst_error"].get<double>(), 2.0);
    return;
  }
  ADD_FAILURE() << "the law is not in the report";
}

TEST(PluginReports, TellOfAPluginThatCrashed) {
  const Report report = report_on("faulty.so", "crash_pack");
  EXPECT_EQ(report.exit_code, 2);
  EXPECT_TRUE(has(report.text, "refused: C0604: expected functions that return, got Segmentation fault, in pack of hinge")) << report.text;
  EXPECT_FALSE(report.json["obeys"]);
}

TEST(PluginReports, AreTheSameBytesForTheSameSeed) {
  const PluginFolder dir("arc.so");
  const auto report = [&](const std::string& file, const char* seed) {
    run_program({"check-plugin", "p.so", "--out", file, "--seed", seed, "--samples", "60"}, dir.path());
    return file_text(dir / file);
  };
  EXPECT_EQ(report("a.json", "1"), run_program({"check-plugin", "p.so", "--json", "--samples", "60"}, dir.path()).out);
  EXPECT_EQ(report("a.txt", "1"), report("b.txt", "1"));
  EXPECT_NE(report("a.txt", "1"), report("b.txt", "2"));
}

struct PluginFault {
  const char *name, *code, *text;
};
class FaultyPlugin : public testing::TestWithParam<PluginFault> {};

// `check` refuses it as an input; so does `check-plugin`, or it tells the list of what is wrong with a family.
TEST_P(FaultyPlugin, IsAnswered) {
  const auto& [name, code, text] = GetParam();
  const PluginFolder dir;
  const Finished check = with_fault(name, {"check", "."}, dir.path());
  EXPECT_EQ(check.exit_code, 2) << check.out << check.err;
  EXPECT_TRUE(has(check.err, std::string("error[") + code + "]")) << check.err;
  EXPECT_TRUE(has(check.err, text)) << check.err;
  EXPECT_TRUE(has(check.err, "scenario.lua:1")) << check.err;
  const Finished alone = with_fault(name, {"check-plugin", "p.so"}, dir.path());
  EXPECT_TRUE(alone.exit_code == 2 || alone.exit_code == 1) << alone.exit_code;
  EXPECT_TRUE(has(alone.exit_code == 1 ? alone.out : alone.err, text)) << alone.out << alone.err;
  EXPECT_FALSE(has(alone.err, "check-plugin p.so")) << "no hint at what ran just now";
}
INSTANTIATE_TEST_SUITE_P(
    Every, FaultyPlugin,
    testing::Values(PluginFault{"refuses", "C0603", "it refused"},
                    PluginFault{"refuses_with_a_reason", "C0603", "it refused: no licence on?this machine"},
                    PluginFault{"no_families", "C0602", "families of one of the kinds \"hinge\", \"body\""},
                    PluginFault{"short_table", "C0604", "struct_size: 40, expected at least"},
                    PluginFault{"short_params", "C0604", "param_size: 8, expected"}, PluginFault{"other_major", "C0603", "ABI 99."},
                    PluginFault{"newer_minor", "C0603", "ABI 2.99"}, PluginFault{"null_name", "C0602", "a null pointer"},
                    PluginFault{"null_family", "C0602", "a null pointer"}, PluginFault{"short_plugin", "C0602", "struct_size = 8"},
                    PluginFault{"endless_families", "C0602", "a table again at index 1"}, PluginFault{"null_type", "C0604", "type: null"},
                    PluginFault{"null_params", "C0604", "params: null"}, PluginFault{"many_params", "C0604", "n_params: 1000000"},
                    PluginFault{"null_units", "C0604", "v_units: null"},
                    PluginFault{"small_params", "C0604", "pack writes 8 bytes, 0 are its own"},
                    PluginFault{"law", "C0604", "linear part of Ht v"},
                    PluginFault{"crash_load", "C0601", "Segmentation fault, in the loading of the library"},
                    PluginFault{"crash_entry", "C0604", "Segmentation fault, in cardan_plugin_entry"},
                    PluginFault{"crash_family", "C0604", "Segmentation fault, in family(\"hinge\", 0)"},
                    PluginFault{"crash_pack", "C0604", "Segmentation fault, in pack of hinge \"faulty/slide\""},
                    PluginFault{"abort_kinematics", "C0604", "Aborted, in kinematics of hinge \"faulty/slide\""},
                    PluginFault{"exit_pack", "C0604", "the process was ended (exit), in pack of"},
                    PluginFault{"exit_kinematics", "C0604", "the process was ended (exit), in kinematics"},
                    PluginFault{"throw_entry", "C0604", "an exception in cardan_plugin_entry"},
                    PluginFault{"throw_qdot", "C0604", "an exception in hinge \"faulty/slide\""},
                    PluginFault{"error_pack", "C0604", "no luck today"},
                    PluginFault{"loop_kinematics", "C0604", ", in kinematics of hinge \"faulty/slide\""}),
    [](const auto& tested) { return std::string(tested.param.name); });

// ---- the codes with their whole text ----

TEST(Plugins, AreRefusedWithTheseWords) {
  const PluginFolder dir;
  const auto answer = [&](const char* fault) { return with_fault(fault, {"check", "."}, dir.path()).err; };
  const std::string place =
      "  --> ./scenario.lua:1\n  at: plugin\n    1 | plugin 'p.so' vehicle 'vehicle.yaml' mission { duration = 1, integrator = { method = "
      "'rk4', step = 0...\n";
  const std::string end = "\n1 error. Nothing was run.\n";
  EXPECT_EQ(answer("no_families"),
            "error[C0602]: not a Cardan plugin\n" + place +
                "  expected: families of one of the kinds \"hinge\", \"body\", \"device\", \"field\"\n  got:      none\n"
                "  hint:     one that was built against another draft of a kind has none of this one: rebuild it\n" +
                end);
  EXPECT_EQ(answer("constraint"),
            "error[C0605]: plugin brings a kind that is not honoured\n" + place +
                "  expected: families of the kinds that this version honours: hinge, body, device, field\n"
                "  got:      a constraint (\"constraint.draft0\")\n"
                "  hint:     its header says what it will be: a run without it would not be the run that was asked for\n" +
                end);
  EXPECT_EQ(answer("newer_minor"), "error[C0603]: plugin was built for another Cardan\n" + place +
                                       "  expected: ABI 2.0 to 2.6\n  got:      ABI 2.99\n"
                                       "  hint:     rebuild it against core/abi/cardan_abi.h of this version\n" +
                                       end);
  EXPECT_EQ(answer("short_table"),
            "error[C0604]: plugin breaks a law of its family\n" + place +
                "  expected: hinge \"no. 0\" to obey the laws of its kind\n  got:      struct_size: 40, expected at least 120 bytes\n"
                "  hint:     the whole list: cardan check-plugin ./p.so\n" +
                end);
}

TEST(Plugins, WithATypeThatIsTakenAreToldSoBeforeTheFirstRun) {
  const PluginFolder dir;
  const std::string told = with_fault("taken_type", {"check", "."}, dir.path()).err;
  EXPECT_TRUE(has(told, "error[C0207]: name used twice\n  --> ./scenario.lua:1\n  at: plugin\n")) << told;
  EXPECT_TRUE(has(told, "got:      \"prismatic\" twice: built-in, and ./p.so\n")) << told;
  const Finished alone = with_fault("taken_type", {"check-plugin", "p.so"}, dir.path());
  EXPECT_EQ(alone.exit_code, 1);
  EXPECT_EQ(alone.out,
            "FAIL  hinge prismatic: a slide along x\n"
            "      type: expected a type that is not taken yet, got \"prismatic\" twice: built-in, and p.so; prefix the type with the name "
            "of the plugin: "
            "\"acme/...\"\n");
}

TEST(Plugins, WithMoreRatesThanSixAreToldThatAlone) {
  const PluginFolder dir;
  EXPECT_EQ(with_fault("seven_rates", {"check-plugin", "p.so"}, dir.path()).out,
            "FAIL  hinge no. 0: its table is refused\n      nq, nv: nq = 1, nv = 7, expected nv <= 6 and nv <= nq <= 64\n");
}

TEST(Plugins, MaySaySomething) {
  const PluginFolder dir;
  const Finished check = with_fault("talks", {"check-plugin", "p.so"}, dir.path());
  const std::string said = "p.so: warning: a trial version\n";
  // With sanitizers it is seen from the processes that try it too: they tell their findings there.
  EXPECT_TRUE(test::sanitized ? check.err.starts_with(said) : check.err == said) << check.err;
  EXPECT_EQ(check.exit_code, 0);
}

// ---- docs/extending/hinge.md: parameters that are tables and files ----

struct TrackFolder : TemporaryFolder {
  TrackFolder() {
    fs::copy(kPlugins + "track.so", *this / "track.so");
    std::ofstream(*this / "scenario.lua")
        << "plugin 'track.so' vehicle 'vehicle.yaml' mission { duration = 1 } initial { a = { rate = 1 } }\n";
  }
  Finished with_coefficients(const std::string& value, const std::vector<std::string>& arguments) const {
    std::ofstream(*this / "vehicle.yaml")
        << "cardan: 1\nbodies:\n  a: {mass: 1, inertia: [1, 1, 1], hinge: {type: acme/track, to: world, coefficients: " + value + "}}\n";
    return run_program(arguments, path());
  }
  /// The first answer without its place.
  std::string refusal(const std::string& value) const {
    const std::string err = with_coefficients(value, {"check", "."}).err;
    const std::size_t from = err.find("  expected: ");
    return err.substr(0, err.find('\n')) + "\n" + (from == err.npos ? err : err.substr(from, err.find("\n\n") - from));
  }
};

TEST(PluginTables, AreTheSameInPlaceAndInAFile) {
  const TrackFolder dir;
  const Finished in_place = dir.with_coefficients("[[0, 0, 0], [1 m, 0, 0], [0, 20 cm, 0]]", {"run", ".", "--out", "a", "--quiet"});
  EXPECT_EQ(in_place.exit_code, 0) << in_place.err;
  write(dir / "track.csv", "# of s^0, s^1, s^2\nx [mm], y, z [m]\r\n0, 0, 0\n1000, 0 cm, 0  # forward\n\n0, 20 cm, 0\n");
  const Finished file = dir.with_coefficients("track.csv", {"run", ".", "--out", "b", "--quiet"});
  EXPECT_EQ(file.exit_code, 0) << file.err;
  EXPECT_EQ(channels_of(dir / "a"), channels_of(dir / "b"));
  const auto hashes = Hdf5File::open(dir / "b/run.h5").read_texts("/run/modal_files");
  ASSERT_EQ(hashes.size(), 2u) << "the file is recorded as files of modes are";
  EXPECT_EQ(hashes[0], "track.csv");
  write(dir / "track.csv", "\xEF\xBB\xBFz, name, y, x [mm]\n0, start, 0, 0\n0, ahead, 0, 1000\n0, aside, 20 cm, 0\n");
  const Finished others = dir.with_coefficients("track.csv", {"run", ".", "--out", "d", "--quiet"});
  EXPECT_EQ(others.exit_code, 0) << others.err;
  EXPECT_EQ(channels_of(dir / "a"), channels_of(dir / "d")) << "columns by their names";
  write(dir / "track.csv", "0, 0, 0\n1, 0, 0\n0, 0.3, 0\n");
  EXPECT_TRUE(has(run_program({"run", "--again", "b/run.h5", "--out", "c"}, dir.path()).err, "error[C0703]"));
}

TEST(PluginTables, AreRefusedWithTheirLine) {
  const TrackFolder dir;
  const std::string columns = "x [m], y [m], z [m]";
  EXPECT_EQ(dir.refusal("7 m"), "error[C0102]: file not found\n  expected: a CSV file that can be read, with the columns " + columns +
                                    "\n  got:      \"./7 m\"\n  hint:     give its path relative to the vehicle file");
  EXPECT_EQ(dir.refusal("{}"), "error[C0106]: wrong type of value\n  expected: a list of rows [" + columns +
                                   "], or the name of a CSV file\n  got:      a map of 0 keys");
  EXPECT_EQ(dir.refusal("[[1, 2]]"),
            "error[C0106]: wrong type of value\n  expected: a row [" + columns + "]\n  got:      a list of 2 values");
  EXPECT_EQ(dir.refusal("[[1, 2, 3]]"),
            "error[C0301]: value out of range\n  expected: two rows or more\n  got:      one row\n"
            "  hint:     with one row the body would not move: type: locked");
  write(dir / "t.csv", "x, y, w\n");
  EXPECT_EQ(dir.refusal("t.csv"), "error[C0106]: wrong type of value\n  expected: the columns " + columns + "\n  got:      \"x, y, w\"");
  // Rows as wide as a first line without the columns were read beyond their end: the program crashed.
  write(dir / "t.csv", "x, y\n1, 2\n3, 4\n");
  EXPECT_EQ(dir.refusal("t.csv"), "error[C0106]: wrong type of value\n  expected: the columns " + columns + "\n  got:      \"x, y\"");
  for (const char* mark : {";", "\t"}) {
    std::string table = "x; y; z\n1; 2; 3\n4; 5; 6\n";
    for (std::size_t at; *mark != ';' && (at = table.find(';')) != std::string::npos;) table.replace(at, 1, mark);
    write(dir / "t.csv", table);
    const std::string told = dir.refusal("t.csv");
    EXPECT_TRUE(told.starts_with("error[C0106]: wrong type of value\n  expected: the columns " + columns)) << told;
    EXPECT_TRUE(has(told, "hint:     commas part the columns, and a point is the decimal sign")) << told;
  }
  write(dir / "t.csv", "x [kg], y, z\n");
  EXPECT_EQ(dir.refusal("t.csv"), "error[C0106]: wrong type of value\n  expected: the columns " + columns + "\n  got:      \"x [kg]\"");
  write(dir / "t.csv", "1, 2, 3\n4, 5\n");
  EXPECT_EQ(dir.refusal("t.csv"), "error[C0106]: wrong type of value\n  expected: 3 values: " + columns + "\n  got:      2 values");
  EXPECT_TRUE(has(dir.with_coefficients("t.csv", {"check", "."}).err, "--> ./t.csv:2\n")) << "the line of the file";
  write(dir / "t.csv", "x [mm], y, z\n1, 2, 3\n1, 2, three\n");
  EXPECT_TRUE(has(dir.refusal("t.csv"), "error[C0108]"));
  write(dir / "t.csv", "x [mm], y, z\n1 m, 2, 3\n");
  EXPECT_EQ(dir.refusal("t.csv"), "error[C0108]: not a number\n  expected: a number, its unit is in the first line\n  got:      \"1 m\"");
  write(dir / "t.csv", "# nothing\n");
  EXPECT_EQ(dir.refusal("t.csv"), "error[C0106]: wrong type of value\n  expected: rows of " + columns + "\n  got:      0 numbers");
}

// ---- the other kinds of parameters, by the plugin that was built against contract 2.0 ----

struct FrozenFolder : TemporaryFolder {
  FrozenFolder() {
    fs::copy(kPlugins + "frozen_2_0.so", *this / "p.so");
    std::ofstream(*this / "scenario.lua") << "plugin 'p.so' vehicle 'vehicle.yaml' mission { duration = 1 } initial { a = { rate = 1 } }\n";
  }
  Finished with(const std::string& parameters, const std::vector<std::string>& arguments) const {
    std::ofstream(*this / "vehicle.yaml")
        << "cardan: 1\ngravity: {uniform: [1, 0, 0]}\nbodies:\n  a: {mass: 1, inertia: [1, 1, 1], hinge: {type: frozen/slide, to: world, " +
               parameters + "}}\n";
    return run_program(arguments, path());
  }
  /// What a pull of 1 m/s^2 along x adds to s within a second from rate 1 on: s'' = 1 / gain. Tells the gain.
  double gain_of(const std::string& parameters) const {
    const Finished run = with(parameters, {"run", ".", "--out", "out", "--quiet"});
    EXPECT_EQ(run.exit_code, 0) << parameters << run.err;
    return run.exit_code != 0 ? NAN : 0.5 / (channels_of(*this / "out").at("/channels/hinges/a/s").back() - 1.0);
  }
  void expect_refusal(const std::string& parameters, const std::string& text) const {
    const Finished check = with(parameters, {"check", "."});
    EXPECT_EQ(check.exit_code, 2);
    EXPECT_TRUE(has(check.err, text)) << parameters << "\n" << check.err;
  }
};

TEST(PluginParameters, AreNumbersInTheirRangesChoicesAndFiles) {
  const FrozenFolder dir;
  write(dir / "gain.txt", "2.5\n");
  EXPECT_NEAR(dir.gain_of("gain: 1 m"), 1.0, 1e-9);
  EXPECT_NEAR(dir.gain_of("gain: 2, sense: backward"), -2.0, 1e-9);
  EXPECT_NEAR(dir.gain_of("gain: 2, gears: 3"), 6.0, 1e-9);
  EXPECT_NEAR(dir.gain_of("gain_file: gain.txt"), 2.5, 1e-9);
  EXPECT_EQ(Hdf5File::open(dir / "out/run.h5").read_texts("/run/modal_files").at(0), "gain.txt");
  const std::string range = "error[C0301]: value out of range\n";
  dir.expect_refusal("gain: 0", "  expected: a number > 0 and <= 10\n  got:      0\n");
  dir.expect_refusal("gain: 0", range);
  dir.expect_refusal("gears: 7", "  expected: a whole number from 1 to 5\n  got:      7\n");
  dir.expect_refusal("gears: 1.5", "  expected: a whole number\n  got:      1.5\n");
  dir.expect_refusal("sense: sideways", "error[C0208]: unknown name\n");
  dir.expect_refusal("sense: sideways", "  expected: forward or backward (which way)\n  got:      \"sideways\"\n");
  dir.expect_refusal("sense: forwards", "  hint:     did you mean \"forward\"?\n");
  dir.expect_refusal("gain_file: none.txt", "error[C0102]: file not found\n");
  dir.expect_refusal("gain_file: none.txt", "  expected: a file that can be read: a text that is the gain, in place of `gain`\n");
  write(dir / "gain.txt", "-1\n");
  dir.expect_refusal("gain_file: gain.txt", "  expected: a file with a number > 0\n  got:      \"./gain.txt\"\n");
  const Finished told = run_program({"types", "frozen/slide", "--plugin", "p.so"}, dir.path());
  EXPECT_EQ(told.out,
            "hinge frozen/slide: a slide of contract 2.0\n"
            "  parameters    gain: number [m] > 0 and <= 10, default 1\n"
            "                  metres per unit\n"
            "                sense: one of forward, backward, default forward\n"
            "                  which way\n"
            "                gears: whole number from 1 to 5, default 1\n"
            "                  how often the gain\n"
            "                gain_file: file, optional\n"
            "                  a text that is the gain, in place of `gain`\n"
            "  coordinates   s\n"
            "  velocities    rate [1/s]\n"
            "  plugin        p.so\n");
}

// ---- docs/extending/device.md ----

/// A mass at 3 m/s on the honeycomb of the page, without weight: half of m v^2 is crushed but for what springs back, F^2 / 2k.
TEST(PluginDevices, InCAreAsPrinted) {
  const TemporaryFolder dir;
  fs::copy(kPlugins + "crush.so", dir / "p.so");
  const Finished check = run_program({"check-plugin", "p.so"}, dir.path());
  EXPECT_EQ(check.out, "ok    device acme/crush: a honeycomb that a strut crushes\n") << check.err;
  write(dir / "vehicle.yaml",
        "cardan: 1\nbodies:\n  strut: {mass: 50, inertia: [1, 1, 1], hinge: {type: prismatic, axis: [0, 0, 1], to: world, initial: {rate: "
        "-3}}}\n"
        "devices:\n  honeycomb: {type: acme/crush, at: strut, stiffness: 400 kN/m, crush_force: 0.9 kN}\n");
  write(dir / "scenario.lua",
        "plugin 'p.so' local sat = vehicle 'vehicle.yaml' mission { duration = 1 }\n"
        "local hinge, core = sat:hinge 'strut', sat:device 'honeycomb'\n"
        "check { name = 'crushed', value = function() return core:get 'crushed' end, equal = { (25 * 9 - 0.9e3 ^ 2 / 0.8e6) / 0.9e3, "
        "tolerance = 1e-10 } }\n"
        "check { name = 'springs back', value = function() return hinge:rate() end, equal = { 0.9e3 / math.sqrt(400e3 * 50), tolerance = "
        "1e-9 } }\n");
  const Finished run = run_program({"run", ".", "--quiet"}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
}

// ---- docs/extending/body.md ----

constexpr const char* kBodies =
    "cardan: 1\nbodies:\n"
    "  bus: {type: acme/box, size: [2 m, 1 m, 1 m], density: 120, nodes: {edge: {position: [1, 0, 0]}}, hinge: {type: free, to: world}}\n"
    "  wing:\n    type: acme/wing\n    level: 0\n"
    "    modal: {beam: {length: 5 m, material: {E: 70 GPa, rho: 2700}, section: {tube: {radius: 5 cm, wall: 2 mm}}}, modes: {count: 3}}\n"
    "    hinge: {type: revolute, axis: [0, 1, 0], to: bus.edge, at: root, initial: {rate: 0.1}}\n";

struct BodiesFolder : TemporaryFolder {
  BodiesFolder() {
    fs::copy(kPlugins + "acme_bodies.so", *this / "p.so");
    std::ofstream(*this / "scenario.lua") << "plugin 'p.so' vehicle 'vehicle.yaml' mission { duration = 1 }\n";
  }
  Finished with(const std::string& vehicle, const std::vector<std::string>& arguments) const {
    write(*this / "vehicle.yaml", vehicle);
    return run_program(arguments, path());
  }
};

TEST(PluginBodies, AreBodiesLikeTheBuiltInOnes) {
  const BodiesFolder dir;
  const std::string built_in = replaced(replaced(kBodies, "acme/wing", "modal_flexible"),
                                        "type: acme/box, size: [2 m, 1 m, 1 m], density: 120", "mass: 240, inertia: [40, 100, 100]");
  for (const auto& [out, vehicle] : {std::pair<std::string, std::string>{"a", kBodies}, {"b", built_in}}) {
    const Finished run = dir.with(vehicle, {"run", ".", "--out", out, "--quiet"});
    EXPECT_EQ(run.exit_code, 0) << run.err;
  }
  EXPECT_EQ(channels_of(dir / "a"), channels_of(dir / "b")) << "level 0 by a plugin and by us, a box by its edges and by its mass";
  const Finished coupled = dir.with(kBodies, {"run", ".", "--out", "c", "--quiet", "--set", "bodies.wing.mean_axes=true"});
  EXPECT_EQ(coupled.exit_code, 0) << coupled.err;
  EXPECT_NE(channels_of(dir / "a"), channels_of(dir / "c")) << "its parameter matters";
  const std::string told = run_program({"describe", "."}, dir.path()).out;
  EXPECT_TRUE(has(told, "acme/wing")) << told;
}

TEST(PluginBodies, RefuseInTheirOwnWords) {
  const BodiesFolder dir;
  const std::string level = dir.with(replaced(kBodies, "level: 0", "level: 2"), {"check", "."}).err;
  EXPECT_TRUE(has(level, "error[C0301]: value out of range\n  --> ./vehicle.yaml:6:12\n  at: bodies.wing.level\n")) << level;
  EXPECT_TRUE(has(level, "  expected: level: 0, the only one of acme/wing\n  got:      2\n")) << level;
  const std::string range = dir.with(replaced(kBodies, "density: 120", "density: 0"), {"check", "."}).err;
  EXPECT_TRUE(has(range, "error[C0301]: value out of range\n")) << range;
  EXPECT_TRUE(has(range, "  at: bodies.bus.density\n")) << range;
  EXPECT_TRUE(has(range, "  expected: a number > 0\n  got:      0\n")) << range;
  const std::string truth = dir.with(replaced(kBodies, "level: 0", "level: 0\n    mean_axes: 1"), {"check", "."}).err;
  EXPECT_TRUE(has(truth, "error[C0106]")) << truth;
  const std::string key = dir.with(replaced(kBodies, "density", "denstiy"), {"check", "."}).err;
  EXPECT_TRUE(has(key, "error[C0104]: unknown key")) << key;
  EXPECT_TRUE(has(key, "did you mean \"density\"?")) << key;
  const std::string mass = dir.with(replaced(kBodies, "density: 120", "mass: 3"), {"check", "."}).err;
  EXPECT_TRUE(has(mass, "error[C0104]: unknown key")) << mass;
  const std::string type = dir.with(replaced(kBodies, "acme/box", "acme/bx"), {"check", "."}).err;
  EXPECT_TRUE(has(type, "  expected: a body type: rigid, particle, modal_flexible, acme/box or acme/wing\n")) << type;
  const std::string twin = dir.with(kBodies, {"run", ".", "--out", "d", "--quiet", "--check-against-reference"}).err;
  EXPECT_TRUE(has(twin, "error[C0401]: not supported by the chosen method\n")) << twin;
  EXPECT_TRUE(has(twin, "a body with modes of a built-in type")) << twin;
}

// The carriage of the page on a slide, and what hangs on its bob, against the same of two bodies.
TEST(PluginBodies, MayBeMechanisms) {
  const TemporaryFolder dir;
  fs::copy(kPlugins + "acme_swing.so", dir / "p.so");
  const Finished check = run_program({"check-plugin", "p.so"}, dir.path());
  EXPECT_EQ(check.exit_code, 0) << check.out << check.err;
  EXPECT_EQ(check.out, "ok    body acme/swing: a carriage with a pendulum\n");
  const std::string begin = "cardan: 1\ngravity: {uniform: [0, 0, -9.81]}\nbodies:\n  carriage:\n";
  const std::string slide = "    hinge: {type: prismatic, axis: [1, 0, 0], to: world, initial: {rate: 0.5}}\n";
  const std::string lamp =
      "  lamp: {mass: 0.5, inertia: [0.01, 0.02, 0.03], com: [0.1, 0, -0.2],\n"
      "         hinge: {type: revolute, axis: [0, 0, 1], to: BOB, initial: {rate: 2}}}\n";
  const std::string one = begin +
                          "    type: acme/swing\n    pivot: [0, 0, 1]\n    axis: [0, 1, 0]\n    initial: {eta: [0.7]}\n"
                          "    modal:\n      lumped:\n        masses:\n          - {mass: 4 kg, position: [0.2, 0, 0]}\n"
                          "          - {mass: 1 kg, position: [0, 0, 0.2], Phi: [[-0.8], [0], [0]]}\n        K: [[2]]\n"
                          "        nodes: {bob: {position: [0, 0, 0.2], Phi: [[-0.8], [0], [0]], Psi: [[0], [1], [0]]}}\n" +
                          slide + replaced(lamp, "BOB", "carriage.bob");
  const std::string two =
      begin + "    type: particle\n    mass: 4\n    com: [0.2, 0, 0]\n" + slide +
      "  pendulum:\n    type: particle\n    mass: 1\n    com: [0, 0, -0.8]\n    nodes: {bob: {position: [0, 0, -0.8]}}\n"
      "    hinge: {type: revolute, axis: [0, 1, 0], to: {body: carriage, position: [0, 0, 1]}, spring: {stiffness: 2 N m/rad},\n"
      "            initial: {angle: 0.7 rad}}\n" +
      replaced(lamp, "BOB", "pendulum.bob");
  write(dir / "scenario.lua",
        "plugin 'p.so' vehicle 'vehicle.yaml' mission { duration = 3, integrator = { method = 'dop853', relative = 1e-12 } }\n");
  std::map<std::string, std::vector<double>> channels[2];
  for (const bool parts : {false, true}) {
    write(dir / "vehicle.yaml", parts ? two : one);
    const std::string out = parts ? "two" : "one";
    const Finished run = run_program({"run", ".", "--out", out, "--quiet"}, dir.path());
    ASSERT_EQ(run.exit_code, 0) << run.err;
    channels[parts] = channels_of(dir / out);
  }
  const auto expect_alike = [&](const std::string& in_one, const std::string& in_two) {
    const auto &a = channels[0].at(in_one), &b = channels[1].at(in_two);
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], b[i], 1e-9) << in_one << " " << i;
  };
  for (const char* body : {"carriage/displacement", "carriage/rate", "carriage/force", "lamp/angle", "lamp/rate", "lamp/force"})
    expect_alike(std::string("/channels/hinges/") + body, std::string("/channels/hinges/") + body);
  expect_alike("/channels/modes/carriage/eta", "/channels/hinges/pendulum/angle");
  expect_alike("/channels/modes/carriage/etadot", "/channels/hinges/pendulum/rate");
  write(dir / "vehicle.yaml", one);
  const std::string told = run_program({"describe", "."}, dir.path()).out;
  EXPECT_TRUE(has(told, "carriage          acme/swing")) << told;
  EXPECT_FALSE(has(told, "carriage: inertia to first order") || has(told, "carriage: centrifugal stiffening")) << told;
}

// At 0.75 m, where no sample was: the run cannot be answered by a law any more, but it does not end with success.
TEST(Plugins, ThatEndTheProcessDoNotEndItWithSuccess) {
  const PluginFolder dir;
  const Finished run = with_fault("exit_late", {"run", ".", "--quiet", "--out", "out"}, dir.path());
  EXPECT_EQ(run.exit_code, 70) << run.out << run.err;
  EXPECT_TRUE(has(run.err, "exit")) << run.err;
}

TEST(Plugins, ThatGiveNoNumberInARunAreNamed) {
  const PluginFolder dir;
  const Finished run = with_fault("late_nan", {"run", ".", "--quiet", "--out", "out"}, dir.path());
  EXPECT_EQ(run.exit_code, 3) << run.out << run.err;
  EXPECT_TRUE(has(run.err, "failure[N0108]")) << run.err;
  EXPECT_TRUE(has(run.err, "kinematics of hinge \"faulty/slide\" (./p.so) of bodies.a gives a value that is not finite")) << run.err;
  EXPECT_TRUE(fs::exists(dir / "out/run.h5")) << "what was recorded is kept";
}

// Where it throws is a state that is tried, 0.75 m; the last accepted one is 0.5 m, where it does not.
TEST(Plugins, ThatThrowAtATrialStateAreNamed) {
  const PluginFolder dir;
  const Finished run = with_fault("error_late", {"run", ".", "--quiet", "--out", "out"}, dir.path());
  EXPECT_EQ(run.exit_code, 3) << run.out << run.err;
  EXPECT_TRUE(has(run.err, "failure[N0503]")) << run.err;
  EXPECT_TRUE(has(run.err, "kinematics of hinge \"faulty/slide\" (./p.so) of bodies.a throws: no luck today")) << run.err;
}

// ---- coordinates that are none of the velocities ----

/// A wheel of 1 kg m^2 that turns about z by the cosine and sine of its angle; `initial` of its hinge.
struct TurnFolder : TemporaryFolder {
  explicit TurnFolder(const std::string& hinge, const std::string& script = "") {
    fs::copy(kPlugins + "turn.so", *this / "p.so");
    write(*this / "vehicle.yaml",
          "cardan: 1\nbodies:\n  a: {mass: 1, inertia: [1, 1, 1], hinge: {type: told/turn, to: world, " + hinge + "}}\n");
    write(*this / "scenario.lua", "plugin 'p.so'\nlocal sat = vehicle 'vehicle.yaml'\nmission { duration = 1 }\n" + script);
  }
  /// The coordinates at the start, or what was answered.
  std::string start() const {
    write(*this / "look.lua", "print(string.format('%.15g %.15g', sim:q()[1], sim:q()[2]))\n");
    const Finished told = run_program({"workbench", ".", "--script", "look.lua"}, path());
    return told.exit_code == 0 ? told.out : told.err;
  }
};

TEST(CoordinatesOfPlugins, BeginWhereTheFamilySaysOrAsGiven) {
  EXPECT_EQ(TurnFolder("start: 90 deg, initial: {rate: 1}").start(), "6.12323399573677e-17 1\n");
  EXPECT_EQ(TurnFolder("start: 1, initial: {cos: 0.540302305868140}").start(), "0.54030230586814 0.841470984807897\n")
      << "what is not given is as the family has it";
  EXPECT_EQ(TurnFolder("initial: {cos: 0.6, sin: 0.8000004}").start(), "0.599999808000044 0.800000143999931\n") << "normalised";
  EXPECT_EQ(TurnFolder("initial: {cos: 0.6, sin: 0.8}", "initial { a = { cos = 0, sin = -1.0000004 } }").start(), "0 -1\n");
}

// They would be computed with as they are, a rotation that is none.
TEST(CoordinatesOfPlugins, ThatBelongToNoPlaceAreRefused) {
  const std::string file = TurnFolder("initial: {cos: 2}").start();
  EXPECT_TRUE(has(file, "error[C0402]: initial state does not fit\n  --> ./vehicle.yaml:3:")) << file;
  EXPECT_TRUE(has(file,
                  "  expected: coordinates cos, sin of hinge type told/turn that belong to a place, within 1e-6\n"
                  "  got:      2, 0\n  hint:     normalised they are 1, 0\n"))
      << file;
  EXPECT_TRUE(has(TurnFolder("locked: true, initial: {cos: 2}").start(), "error[C0402]"));
  EXPECT_TRUE(has(TurnFolder("spring: {stiffness: 5}").start(), "  hint:     its rates are no rates of its coordinates\n"));
  const std::string script = TurnFolder("", "initial { a = { cos = 0, sin = 0 } }").start();
  EXPECT_TRUE(has(script, "error[C0402]: initial state does not fit\n  --> ./scenario.lua:4")) << script;
  const TurnFolder dir("");
  write(dir / "look.lua", "sim:state { q = { 0, 0 } }\n");
  const Finished bench = run_program({"workbench", ".", "--script", "look.lua"}, dir.path());
  EXPECT_TRUE(has(bench.err, "error[C0402]: initial state does not fit\n  --> ./look.lua:1")) << bench.err;
}

// ---- what obeys the laws and goes wrong in the run ----

struct LateFault {
  const char *name, *code, *told;
};
class LatePlugin : public testing::TestWithParam<LateFault> {};

struct LateFolder : TemporaryFolder {
  LateFolder() {
    fs::copy(kPlugins + "late.so", *this / "p.so");
    write(*this / "vehicle.yaml",
          "cardan: 1\nfields: {air: {type: late/air}}\nbodies:\n"
          "  sled: {mass: 1e6, inertia: [1e6, 1e6, 1e6], hinge: {type: late/slide, to: world}}\n"
          "  boom:\n    type: late/wing\n"
          "    modal: {beam: {length: 1 m, material: {E: 70 GPa, rho: 2700}, section: {tube: {radius: 5 cm, wall: 2 mm}}}, modes: {count: "
          "1}}\n"
          "    hinge: {type: locked, to: sled, at: root}\n"
          "devices: {pusher: {type: late/push, at: sled, air: air}}\n");
    write(*this / "scenario.lua",
          "plugin 'p.so' vehicle 'vehicle.yaml' mission { duration = 1, integrator = { method = 'rk4', step = 1 / 4096 }, "
          "output = { rate = '32 Hz' } }\ninitial { sled = { rate = 1 } }\n");
  }
};

/// At t = 0.75 s: answered with the file, the type, whose it is, the call and the time; rows until then are kept.
TEST_P(LatePlugin, IsNamedAndWhatWasRecordedIsKept) {
  const auto& [name, code, told] = GetParam();
  const LateFolder dir;
  const Finished run = with_fault(name, {"run", ".", "--quiet", "--out", "out"}, dir.path());
  EXPECT_EQ(run.exit_code, 3) << run.out << run.err;
  EXPECT_TRUE(has(run.err, std::string("failure[") + code + "]")) << run.err;
  EXPECT_TRUE(has(run.err, told)) << run.err;
  EXPECT_TRUE(has(run.err, "  t = 0.7")) << run.err;
  const Hdf5File kept = Hdf5File::open(dir / "out/run.h5");
  EXPECT_GE(kept.read_doubles("/channels/hinges/sled/s").values.size(), 24u);
  EXPECT_NEAR(kept.read_doubles("/channels/hinges/sled/s").values.back(), 0.75, 1.1 / 32);
}
INSTANTIATE_TEST_SUITE_P(
    Every, LatePlugin,
    testing::Values(LateFault{"throw_hinge", "N0503", "kinematics of hinge \"late/slide\" (./p.so) of bodies.sled throws: no luck today"},
                    LateFault{"nan_hinge", "N0108",
                              "kinematics of hinge \"late/slide\" (./p.so) of bodies.sled gives a value that is not finite"},
                    LateFault{"hidden_hinge", "N0503", "kinematics of hinge \"late/slide\" (./p.so) of bodies.sled gives other numbers"},
                    LateFault{"throw_body", "N0503", "mass of body \"late/wing\" (./p.so) of bodies.boom throws: no luck today"},
                    LateFault{"nan_body", "N0108", "mass of body \"late/wing\" (./p.so) of bodies.boom gives a value that is not finite"},
                    LateFault{"hidden_body", "N0503", "mass of body \"late/wing\" (./p.so) of bodies.boom gives other numbers"},
                    LateFault{"throw_node", "N0503", "node of body \"late/wing\" (./p.so) of bodies.boom throws: no luck today"},
                    LateFault{"nan_node", "N0108", "node of body \"late/wing\" (./p.so) of bodies.boom gives a value that is not finite"},
                    LateFault{"hidden_node", "N0503", "node of body \"late/wing\" (./p.so) of bodies.boom gives other numbers"},
                    LateFault{"throw_device", "N0503", "device pusher (late/push, ./p.so): evaluate throws: no luck today"},
                    LateFault{"nan_device", "N0501", "device pusher (late/push, ./p.so): evaluate: force at at = nan"},
                    LateFault{"code_device", "N0501", "device pusher (late/push, ./p.so): evaluate: it has had enough"},
                    LateFault{"overrun_device", "N0503", "device pusher (late/push, ./p.so): evaluate writes beyond its arrays"},
                    LateFault{"hidden_device", "N0503", "device pusher (late/push, ./p.so): evaluate gives other numbers"},
                    LateFault{"throw_impulse", "N0503", "device pusher (late/push, ./p.so): impulse throws: no luck today"},
                    LateFault{"nan_impulse", "N0501", "device pusher (late/push, ./p.so): impulse: force at at = nan"},
                    LateFault{"code_impulse", "N0501", "device pusher (late/push, ./p.so): impulse: it has had enough"},
                    LateFault{"throw_field", "N0503", "field air (late/air, ./p.so): evaluate throws: no luck today"},
                    LateFault{"nan_field", "N0501", "device pusher (late/push, ./p.so): the field air (late/air, ./p.so) is not finite"},
                    LateFault{"code_field", "N0501", "the field air (late/air, ./p.so): evaluate returned -1"},
                    LateFault{"overrun_field", "N0503", "field air (late/air, ./p.so): evaluate writes beyond what it is handed"},
                    LateFault{"hidden_field", "N0503", "field air (late/air, ./p.so): evaluate gives other numbers"}),
    [](const auto& tested) { return std::string(tested.param.name); });

/// Nothing but a signal ends it, and the first one only says what is waited for; the second keeps what is on disk.
TEST(LatePlugins, ThatDoNotComeBackAreEndedByASecondSignal) {
  const LateFolder dir;
  const std::string told = dir / "told";
  Started run({"run", ".", "--quiet", "--out", "out"}, dir.path(), [&] {
    setenv("CARDAN_FAULT", "stuck_device", 1);
    dup2(open(told.c_str(), O_CREAT | O_WRONLY | O_APPEND, 0600), STDERR_FILENO);
  });
  const auto tells = [&](const std::string& what) { return wait_until([&] { return fs::exists(told) && has(file_text(told), what); }); };
  ASSERT_TRUE(tells("stuck"));
  run.send(SIGTERM);
  ASSERT_TRUE(tells("asked to end: waiting for the step under way"));
  run.send(SIGTERM);  // at once: the same order
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));
  EXPECT_FALSE(run.has_ended());
  run.send(SIGTERM);
  EXPECT_EQ(run.wait().exit_code, -1) << "ended by the signal";
  EXPECT_NO_THROW(Hdf5File::open(dir / "out/run.h5").read_doubles("/time"));
}

TEST(LatePlugins, AreToldInTheseWords) {
  const LateFolder dir;
  const std::string err = with_fault("hidden_device", {"run", ".", "--quiet", "--out", "out"}, dir.path()).err;
  EXPECT_TRUE(
      has(err,
          "failure[N0503]: a function of a plugin failed in the run\n  t = 0.75 s\n"
          "  device pusher (late/push, ./p.so): evaluate gives other numbers when it is asked the same again: it keeps something between "
          "calls\n  last accepted state: out/run.h5:/restart\n"
          "  hint:     a fault of the plugin: cardan check-plugin tries what it can\n"))
      << err;
  const Finished good = run_program({"run", ".", "--quiet", "--out", "good"}, dir.path());
  EXPECT_EQ(good.exit_code, 0) << good.err;
}

}  // namespace
}  // namespace cardan
