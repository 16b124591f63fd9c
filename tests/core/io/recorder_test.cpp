#include "core/io/recorder.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <sstream>

#include "core/base/diagnostic.hpp"
#include "core/io/hdf5_file.hpp"
#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

using test::scratch;

RunHeader example_header() {
  RunHeader h;
  h.scenario = "example";
  h.title = "An example";
  h.program_version = "0.1.0";
  h.commit = "abc";
  h.seed = std::numeric_limits<std::uint64_t>::max();
  h.inputs = {{"vehicle.yaml", "00ff", "bodies:\n"}};
  h.settings = {{"mission.duration", "5 s"}};
  h.command = {"cardan", "run", "."};
  h.sweeps = "x86-64-v3";
  h.until = "0.1";
  h.effective_parameters = {{"bodies.bus.mass", "1200 kg"}, {"bodies.bus.inertia", "[1, 2, 3] kg m^2"}};
  h.sweep_program = "position base_to_tip\n";
  h.integrator = "rk4";
  return h;
}

const std::vector<Channel> kChannels = {
    {"bodies/bus/attitude", {"w", "x", "y", "z"}, "-", "world", "bus into world"},
    {"wheels/speed", {"w1", "w2"}, "rad/s", "", "about the spin axis"},
};

/// Row i of the example; the first number counts.
std::vector<double> example_row(std::size_t i) {
  std::vector<double> row{static_cast<double>(i)};
  for (int k = 1; k < 6; ++k) row.push_back(std::sin(0.1 * static_cast<double>(i) * k));
  return row;
}

/// Rows in the file; fails unless every channel holds the example's numbers in all of them.
std::size_t intact_rows(const std::string& path) {
  const auto file = Hdf5File::open(path);
  const auto time = file.read_doubles("/time");
  const auto attitude = file.read_doubles("/channels/bodies/bus/attitude");
  const auto speed = file.read_doubles("/channels/wheels/speed");
  const std::size_t n = std::min({time.shape[0], attitude.shape[0], speed.shape[0]});
  for (std::size_t i = 0; i < n; ++i) {
    const auto row = example_row(i);
    EXPECT_EQ(time.values[i], 0.1 * static_cast<double>(i));
    for (std::size_t k = 0; k < 4; ++k) EXPECT_EQ(attitude.values[4 * i + k], row[k]);
    for (std::size_t k = 0; k < 2; ++k) EXPECT_EQ(speed.values[2 * i + k], row[4 + k]);
  }
  return n;
}

/// Runs `work` in a process of its own and returns how it ended.
int in_child(const std::function<int()>& work) {
  const pid_t child = fork();
  if (child == 0) _exit(work());
  int status = 0;
  waitpid(child, &status, 0);
  return status;
}

std::string command_output(const std::string& command) {
  std::string out;
  FILE* pipe = popen(command.c_str(), "r");
  for (int c = 0; (c = std::fgetc(pipe)) != EOF;) out += static_cast<char>(c);
  return pclose(pipe) == 0 ? out : "failed: " + out;
}

std::string content(const std::string& path) {
  std::stringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

TEST(Hdf5Recorder, KeepsRowsUnitsAndProvenance) {
  const std::string path = scratch("run.h5");
  const auto recorder = make_hdf5_recorder(path);
  recorder->begin(example_header(), kChannels);
  for (std::size_t i = 0; i < 1000; ++i) recorder->row(0.1 * static_cast<double>(i), example_row(i));
  recorder->restart_state(1.0, std::vector<double>{1, 2, 3});
  recorder->restart_state(99.9, std::vector<double>{4, 5, 6});
  recorder->attach("summary", "{}");
  recorder->close("passed");
  EXPECT_EQ(intact_rows(path), 1000u);

  const auto file = Hdf5File::open(path);
  EXPECT_EQ(file.members("/"),
            (std::vector<std::string>{"run", "spec", "mode_shapes", "restart", "time", "channels", "attachments", "flushed"}));
  const std::string speed = "/channels/wheels/speed";
  EXPECT_EQ(file.text_attribute(speed, "unit"), "rad/s");
  EXPECT_EQ(file.texts_attribute(speed, "components"), (std::vector<std::string>{"w1", "w2"}));
  EXPECT_EQ(file.text_attribute(speed, "meaning"), "about the spin axis");
  EXPECT_EQ(file.text_attribute(speed, "shape"), "time x 2");
  EXPECT_EQ(file.text_attribute("/channels/bodies/bus/attitude", "frame"), "world");
  EXPECT_EQ(file.text_attribute("/time", "unit"), "s");
  EXPECT_EQ(file.text_attribute("/run", "title"), "An example");
  EXPECT_EQ(file.text_attribute("/run", "seed"), "18446744073709551615");
  EXPECT_EQ(file.text_attribute("/run", "integrator"), "rk4");
  EXPECT_EQ(file.text_attribute("/run", "finished").size(), std::string("2000-01-01T00:00:00Z").size());
  EXPECT_EQ(file.read_texts("/run/inputs"), (std::vector<std::string>{"vehicle.yaml", "00ff"}));
  EXPECT_EQ(file.read_texts("/spec/parameters")[1], "1200 kg");
  EXPECT_EQ(file.shape("/spec/parameters"), (std::vector<std::size_t>{2, 2}));
  EXPECT_EQ(file.shape("/spec/defaults"), (std::vector<std::size_t>{0, 2}));
  EXPECT_EQ(file.read_texts("/spec/files"), (std::vector<std::string>{"vehicle.yaml", "bodies:\n"}));
  EXPECT_EQ(file.read_texts("/run/command"), (std::vector<std::string>{"cardan", "run", "."}));
  EXPECT_EQ(file.read_texts("/run/settings"), (std::vector<std::string>{"mission.duration", "5 s"}));
  EXPECT_EQ(file.text_attribute("/run", "sweeps"), "x86-64-v3");
  EXPECT_EQ(file.text_attribute("/run", "until"), "0.1");
  EXPECT_EQ(file.text_attribute("/run", "verdict"), "passed");
  EXPECT_EQ(file.read_text("/spec/sweeps"), "position base_to_tip\n");
  EXPECT_EQ(file.read_doubles("/restart/t").values, std::vector<double>{99.9});
  EXPECT_EQ(file.read_doubles("/restart/x").values, (std::vector<double>{4, 5, 6}));
  EXPECT_EQ(file.read_text("/attachments/summary"), "{}");
}

TEST(Hdf5Recorder, OpensInH5dump) {
  if (std::system("command -v h5dump > /dev/null") != 0) GTEST_SKIP() << "h5dump is not installed";
  const std::string path = scratch("dump.h5");
  const auto recorder = make_hdf5_recorder(path);
  recorder->begin(example_header(), kChannels);
  for (std::size_t i = 0; i < 300; ++i) recorder->row(0.1 * static_cast<double>(i), example_row(i));
  recorder->close();
  const std::string text = command_output("h5dump -d /channels/wheels/speed " + path + " 2>&1");
  EXPECT_NE(text.find("( 300, 2 )"), std::string::npos) << text;
  EXPECT_NE(text.find("\"rad/s\""), std::string::npos) << text;
  EXPECT_EQ(command_output("h5dump " + path + " 2>&1").rfind("HDF5", 0), 0u);  // all of it is readable
}

// The process dies without any warning at several moments, with rows beyond the last flush in memory and half on disk.
TEST(Hdf5Recorder, LeavesAReadableFileWhenTheProcessIsKilled) {
  const std::string path = scratch("killed.h5");
  for (const std::size_t rows_after_flush : {0u, 1u, 255u, 256u, 257u, 3000u, 40000u}) {
    constexpr std::size_t kFlushed = 700;  // not a multiple of the block size
    const int status = in_child([&] {
      const auto recorder = make_hdf5_recorder(path, 1e9);
      recorder->begin(example_header(), kChannels);
      for (std::size_t i = 0; i < kFlushed + rows_after_flush; ++i) {
        if (i == kFlushed / 2 || i == kFlushed) recorder->flush();
        recorder->row(0.1 * static_cast<double>(i), example_row(i));
      }
      if (rows_after_flush == 0) recorder->flush();
      return raise(SIGKILL);
    });
    ASSERT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
    const std::size_t rows = intact_rows(path);
    EXPECT_GE(rows, kFlushed) << rows_after_flush << " rows after the flush";
    EXPECT_GE(2 * rows, kFlushed + rows_after_flush) << "blocks are flushed after 1, 2, 4, ... of them";
  }
}

// Few rows in blocks that hold them all: the same promise, without an index of blocks.
TEST(Hdf5Recorder, OfFewRowsLeavesAReadableFileWhenTheProcessIsKilled) {
  const std::string path = scratch("killed_few.h5");
  RunHeader few = example_header();
  few.most_rows = 20;
  for (const std::size_t flushed : {1u, 7u, 20u}) {
    const int status = in_child([&] {
      const auto recorder = make_hdf5_recorder(path, 1e9);
      recorder->begin(few, kChannels);
      for (std::size_t i = 0; i < 20; ++i) {
        recorder->row(0.1 * static_cast<double>(i), example_row(i));
        if (i + 1 == flushed / 2 || i + 1 == flushed) recorder->flush();
      }
      return raise(SIGKILL);
    });
    ASSERT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
    EXPECT_EQ(intact_rows(path), flushed);
  }
}

// 1000 channels of two numbers and 11 rows are 176 kB of numbers; what HDF5 and the descriptions of the channels add stays within 1 kB a
// channel (blocks of 256 rows, of which 245 stay empty, with an index each: 5 kB).
TEST(Hdf5Recorder, OfFewRowsAndManyChannelsStaysSmall) {
  const std::string path = scratch("wide.h5");
  RunHeader few = example_header();
  few.most_rows = 12;
  std::vector<Channel> channels;
  for (int i = 0; i < 1000; ++i)
    channels.push_back({"hinges/b" + std::to_string(i) + "/angle", {"x", "y"}, "rad", "", "coordinate of the hinge of a body"});
  const auto recorder = make_hdf5_recorder(path);
  recorder->begin(few, channels);
  for (int i = 0; i < 11; ++i) recorder->row(i, std::vector<double>(2000, i));
  recorder->close();
  EXPECT_LT(std::filesystem::file_size(path), 12u * 2000 * 8 + 1000u * 1024);
  EXPECT_EQ(Hdf5File::open(path).read_doubles("/channels/hinges/b999/angle").values.back(), 10.0);
}

// Until the header is on disk the earlier file is whole, and where that comes to nothing it stays.
TEST(Hdf5Recorder, TakesItsNameWhenTheHeaderIsWritten) {
  const std::string path = scratch("named.h5"), beside = scratch(".named.h5.new");
  std::ofstream(path) << "earlier";
  {
    const auto recorder = make_hdf5_recorder(path);
    EXPECT_THROW(recorder->begin({}, {{"a", {"a"}, "", "", ""}, {"a", {"a"}, "", "", ""}}), InputError);
    EXPECT_EQ(content(path), "earlier");
  }
  {
    const auto recorder = make_hdf5_recorder(path, 2.0, [] { throw InputError({Code::cannot_write, {}, "", "", "", "", "", 0}); });
    EXPECT_THROW(recorder->begin(example_header(), kChannels), InputError);
  }
  EXPECT_EQ(content(path), "earlier");
  EXPECT_FALSE(std::filesystem::exists(beside));
  bool was_earlier = false;
  const auto recorder = make_hdf5_recorder(path, 2.0, [&] { was_earlier = content(path) == "earlier"; });
  recorder->begin(example_header(), kChannels);
  EXPECT_TRUE(was_earlier);
  EXPECT_FALSE(std::filesystem::exists(beside));
  recorder->close();
  EXPECT_EQ(intact_rows(path), 0u);
}

TEST(Hdf5Recorder, FlushesByItself) {
  const std::string path = scratch("periodic.h5");
  const int status = in_child([&] {
    const auto recorder = make_hdf5_recorder(path, 0.0);  // every row
    recorder->begin(example_header(), kChannels);
    for (std::size_t i = 0; i < 20; ++i) recorder->row(0.1 * static_cast<double>(i), example_row(i));
    return raise(SIGKILL);
  });
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(intact_rows(path), 20u);
}

// A limit on the size of files stands for the full disk: the write fails in the same place.
TEST(Hdf5Recorder, StopsWithoutLossWhenTheDiskIsFull) {
  const std::string path = scratch("full.h5");
  for (const rlim_t limit : {100'000u, 130'000u, 200'000u, 300'000u}) {
    const int status = in_child([&] {
      signal(SIGXFSZ, SIG_IGN);
      const auto recorder = make_hdf5_recorder(path, 1e9);
      recorder->begin(example_header(), kChannels);
      const rlimit size{limit, limit};
      setrlimit(RLIMIT_FSIZE, &size);
      try {
        for (std::size_t i = 0; i < 1'000'000; ++i) {
          if (i % 300 == 0) recorder->flush();
          recorder->row(0.1 * static_cast<double>(i), example_row(i));
        }
      } catch (const NumericsError& error) {
        const bool told = error.failure().code == Code::disk_full && error.failure().t > 0.0 &&
                          std::string(error.what()).find("File too large") != std::string::npos;
        return told ? 3 : 1;
      }
      return 2;
    });
    ASSERT_TRUE(WIFEXITED(status)) << "ended by signal " << WTERMSIG(status);
    EXPECT_EQ(WEXITSTATUS(status), 3);
    const std::size_t rows = intact_rows(path);
    EXPECT_GT(rows, 0u);
    EXPECT_EQ(rows % 300, 0u) << "a flush was torn";
  }
}

// Lists of times and texts, which grow while the run goes on.
TEST(Hdf5Recorder, KeepsWhatHappenedInARunThatIsKilled) {
  const std::string path = scratch("notes.h5");
  const auto line = [](int i) { return "line " + std::to_string(i) + " of a text that takes some bytes \xc3\xa9"; };
  for (const int flushed : {0, 1, 63, 64, 65, 700}) {
    const int status = in_child([&] {
      const auto recorder = make_hdf5_recorder(path, 1e9);
      recorder->begin(example_header(), kChannels);
      recorder->note(Note::warning, NAN, {"W0301", "beyond the model", "bodies.wing", "vehicle.yaml:12", "level: 2"});
      for (int i = 0; i < flushed + 500; ++i) {
        if (i == flushed / 2 || i == flushed) recorder->flush();
        recorder->note(Note::printed, 0.1 * i, {line(i), "controller \"a\""});
        if (i % 10 == 0) recorder->note(Note::event, 0.1 * i, {"touch", "rising"});
        StepInterval interval;
        interval.end = 0.1 * i, interval.steps = i, interval.worst = line(i);
        note(*recorder, interval);
      }
      return raise(SIGKILL);
    });
    ASSERT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
    const auto file = Hdf5File::open(path);
    EXPECT_TRUE(std::isnan(file.read_doubles("/run/warnings/t").values.at(0)));
    EXPECT_EQ(file.read_texts("/run/warnings/text"),
              (std::vector<std::string>{"W0301", "beyond the model", "bodies.wing", "vehicle.yaml:12", "level: 2"}));
    EXPECT_EQ(file.texts_attribute("/run/warnings/text", "columns"), (std::vector<std::string>{"code", "about", "path", "place", "hint"}));
    EXPECT_EQ(file.shape("/run/phases/text"), (std::vector<std::size_t>{0, 1}));
    const auto t = file.read_doubles("/run/printed/t").values;
    const auto texts = file.read_texts("/run/printed/text");
    ASSERT_EQ(t.size(), static_cast<std::size_t>(flushed));
    ASSERT_EQ(texts.size(), 2 * t.size());
    for (int i = 0; i < flushed; ++i) {
      EXPECT_EQ(t[static_cast<std::size_t>(i)], 0.1 * i);
      EXPECT_EQ(texts[2 * static_cast<std::size_t>(i)], line(i));
    }
    const auto steps = file.read_doubles("/run/steps/numbers");
    const auto worst = file.read_texts("/run/steps/worst"), columns = file.texts_attribute("/run/steps/numbers", "columns");
    ASSERT_EQ(worst.size(), t.size());
    ASSERT_EQ(steps.shape, (std::vector<std::size_t>{t.size(), columns.size()}));
    for (std::size_t i = 0; i < t.size(); ++i) {
      EXPECT_EQ(steps.values[i * columns.size() + 1], t[i]) << columns[1];
      EXPECT_EQ(steps.values[i * columns.size() + 2], static_cast<double>(i)) << columns[2];
      EXPECT_EQ(worst[i], texts[2 * i]);
    }
    EXPECT_EQ(file.shape("/run/events/text"), (std::vector<std::size_t>{(static_cast<std::size_t>(flushed) + 9) / 10, 2}));
  }
}

TEST(Hdf5Recorder, BoundsWhatHappened) {
  const std::string path = scratch("many_notes.h5");
  const auto recorder = make_hdf5_recorder(path);
  recorder->begin(example_header(), kChannels);
  std::string huge(5000, 'x');
  huge.replace(996, 2, "\xc3\xa9");  // a character where it is cut
  for (int i = 0; i < 10'123; ++i) recorder->note(Note::printed, i, {i == 7 ? huge : "x", ""});
  EXPECT_THROW(recorder->note(Note::phase, 0.0, {"one", "too many"}), std::invalid_argument);
  recorder->close();
  const auto file = Hdf5File::open(path);
  EXPECT_EQ(file.shape("/run/printed/text"), (std::vector<std::size_t>{10'000, 2}));
  EXPECT_EQ(file.read_doubles("/run/printed/left_out").values.at(0), 123.0);
  EXPECT_EQ(file.read_texts("/run/printed/text").at(14), huge.substr(0, 996) + "...");
}

TEST(Hdf5Recorder, KeepsPicturesOfModes) {
  const std::string path = scratch("pictures.h5");
  RunHeader header = example_header();
  header.mode_pictures = {{{"left", "right"}, "a beam", {0.5, 3.0}, {0, 0, 0, 1, 0, 0}, {0, 1}, {0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2, 0}},
                          {{"huge"}, "", std::vector<double>(200, 1.0), std::vector<double>(3000), {}, std::vector<double>(600'000)}};
  const auto recorder = make_hdf5_recorder(path);
  recorder->begin(header, kChannels);
  recorder->close();
  const auto file = Hdf5File::open(path);
  EXPECT_EQ(file.members("/mode_shapes"), std::vector<std::string>{"0"});
  EXPECT_EQ(file.texts_attribute("/mode_shapes", "left_out"), std::vector<std::string>{"huge"});
  EXPECT_EQ(file.texts_attribute("/mode_shapes/0", "bodies"), (std::vector<std::string>{"left", "right"}));
  EXPECT_EQ(file.shape("/mode_shapes/0/shapes"), (std::vector<std::size_t>{2, 2, 3}));
  EXPECT_EQ(file.read_doubles("/mode_shapes/0/shapes").values, header.mode_pictures[0].shapes);
  EXPECT_EQ(file.read_integers("/mode_shapes/0/lines").values, header.mode_pictures[0].lines);
  EXPECT_EQ(file.read_doubles("/mode_shapes/0/frequency").values, header.mode_pictures[0].frequency);
}

TEST(Hdf5Recorder, RefusesAChannelThatIsAFolder) {
  const auto recorder = make_hdf5_recorder(scratch("clash.h5"));
  EXPECT_THROW(recorder->begin({}, {{"wheels", {"a"}, "", "", ""}, {"wheels/speed", {"a"}, "", "", ""}}), InputError);
  EXPECT_THROW(recorder->begin({}, {{"a/b", {"a"}, "", "", ""}, {"a/b", {"a"}, "", "", ""}}), InputError);
}

TEST(TextRecorder, WritesOneLinePerRowWithUnitsAndExactNumbers) {
  const std::string path = scratch("run.csv");
  {
    const auto recorder = make_text_recorder(path);
    recorder->begin(
        example_header(),
        {{"bus/rate", {"x", "y"}, "rad/s", "", ""}, {"pose", {"a", "l"}, "rad m", "", ""}, {"momentum", {"h"}, "N m s", "", ""}});
    recorder->row(0.1, std::vector<double>{1.0 / 3.0, -2, 5e-324, 1e300, 7});
    recorder->attach("summary", "{\n}");
    recorder->close();
  }
  EXPECT_EQ(content(path),
            "# scenario: example\n# version: 0.1.0 abc\n# seed: 18446744073709551615\n"
            "t [s],bus/rate.x [rad/s],bus/rate.y [rad/s],pose.a [rad],pose.l [m],momentum.h [N m s]\n"
            "0.1,0.3333333333333333,-2,5e-324,1e+300,7\n"
            "# summary: {\n# }\n");
}

TEST(TextRecorder, TellsWhenTheDiskIsFull) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  const auto recorder = make_text_recorder("/dev/full");
  recorder->begin({}, kChannels);
  recorder->row(2.5, example_row(1));
  try {
    recorder->close();
    FAIL();
  } catch (const NumericsError& error) {
    EXPECT_STREQ(error.what(),
                 "failure[N0204]: the results cannot be written any more\n  t = 2.5 s\n"
                 "  /dev/full: No space left on device\n  hint:     free space, or write to another disk\n");
  }
}

TEST(TextRecorder, TellsWhenTheFileCannotBeCreated) { EXPECT_THROW(make_text_recorder("/nowhere/run.csv"), InputError); }

}  // namespace
}  // namespace cardan
