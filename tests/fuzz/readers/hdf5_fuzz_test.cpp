// Readers of HDF5 files: modal files and results. Changed through the interface they are read in this process; with
// flipped bytes, which can break HDF5 itself, by what users call.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <filesystem>
#include <optional>

#include "bodies/modal/modal_file.hpp"
#include "bodies/modal/modal_integrals.hpp"
#include "bodies/modal/modal_source.hpp"
#include "core/base/diagnostic.hpp"
#include "core/io/hdf5_file.hpp"
#include "core/io/recorder.hpp"
#include "core/io/summary.hpp"
#include "scripts/report/report.hpp"
#include "tests/fuzz/hdf5_mutations.hpp"
#include "tests/support/modal_samples.hpp"
#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

using fuzz::Keep;
using fuzz::Random;

using test::beam;
using test::lumped;
using test::scratch;

/// Bytes of modal files: lumped masses, a beam, a file without integrals.
const std::vector<std::string>& modal_files() {
  static const std::vector<std::string> all = [] {
    std::vector<std::string> out;
    const std::string path = scratch("modal_seed.h5");
    for (int kind = 0; kind < 3; ++kind) {
      write_modal_file(path, kind == 1 ? beam() : lumped());
      Hdf5File file = Hdf5File::update(path);
      if (kind != 0) file.remove_attribute("/", "content_hash");  // which hides what else is wrong
      if (kind == 2) file.remove("/integrals");
      file.close();
      out.push_back(fuzz::content(path));
      modal_data_of(Hdf5File::open(path));
    }
    Hdf5File::open(path);
    return out;
  }();
  return all;
}

/// Bytes of results: finished with a summary, and as a killed run leaves them.
const std::vector<std::string>& run_files() {
  static const std::vector<std::string> all = [] {
    std::vector<std::string> out;
    const std::string path = scratch("run_seed.h5");
    for (bool finished : {true, false}) {
      auto recorder = make_hdf5_recorder(path);
      RunHeader header;
      header.scenario = "scenario.lua";
      header.title = "a run";
      header.inputs = {{"scenario.lua", "abc", "bodies:\n"}};
      header.effective_parameters = {{"bodies.bus.mass", "1 kg"}, {"bodies.arm.mass", "2 kg"}};
      header.mode_pictures = {{{"wing"}, "a beam", {0.5, 3.0}, {0, 0, 0, 1, 0, 0}, {0, 1}, {0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2, 0}}};
      recorder->begin(header, {{"bodies/bus/attitude", {"w", "x", "y", "z"}, "1", "world", "an attitude"},
                               {"bodies/bus/rate", {"x", "y", "z"}, "rad/s", "body", "a rate"},
                               {"wheels/speed", {"w"}, "rad/s", "", "a speed"}});
      recorder->note(Note::phase, 0.0, {"slew"});
      recorder->note(Note::event, 1.5, {"touch", "rising"});
      recorder->note(Note::printed, NAN, {"a line", "the scenario"});
      recorder->note(Note::warning, 2.0, {"W0301", "beyond the model", "bodies.wing", "vehicle.yaml:3", "level: 2"});
      for (int i = 0; i < 20; ++i) recorder->row(i, std::vector<double>{1.0, 0.1 * i, 0.0, 0.0, 1.0 * i, 2.0, 3.0, 1.0 * i});
      Summary summary;
      summary.checks.push_back({"c", 1.0, 2.0, true, "m", ""});
      if (finished) recorder->attach("summary", to_json(summary));
      if (finished)
        recorder->close();
      else
        recorder->flush();
      recorder.reset();  // closes the file
      out.push_back(fuzz::content(path));
      report_page(Hdf5File::open(path));
    }
    return out;
  }();
  return all;
}

/// Files changed through the interface of HDF5, made ahead by change_hdf5.
class ChangedFiles {
 public:
  ChangedFiles(const std::string& name, const std::vector<std::string>& seeds)
      : command_(std::string("exec '") + CARDAN_CHANGE_HDF5 + "' '" + scratch(name + "_made.h5") + "' {} {}") {
    for (std::size_t i = 0; i < seeds.size(); ++i) {
      const std::string path = scratch(fmt::format("{}_seed_{}.h5", name, i));
      fuzz::write(path, seeds[i]);
      command_ += " '" + path + "'";
    }
  }

  /// Bytes of the input `index`. Throws NotMade where HDF5 failed.
  const std::string& of(std::uint64_t index) {
    if (index < first_ || index >= first_ + made_.size()) make_from(index);
    const std::optional<std::string>& bytes = made_[index - first_];
    if (!bytes) throw fuzz::NotMade();
    return *bytes;
  }

 private:
  static constexpr std::uint64_t kAtOnce = 500;

  void make_from(std::uint64_t first) {
    FILE* maker = ::popen(fmt::format(fmt::runtime(command_), first, kAtOnce).c_str(), "r");
    if (!maker) throw std::runtime_error("change_hdf5 does not start");
    first_ = first;
    made_.clear();
    std::uint64_t size = 0;
    while (made_.size() < kAtOnce && std::fread(&size, sizeof size, 1, maker) == 1) {
      std::string bytes(size, '\0');
      if (std::fread(bytes.data(), 1, size, maker) != size) break;
      made_.emplace_back(std::move(bytes));
    }
    const int status = ::pclose(maker);
    if (WIFEXITED(status) && WEXITSTATUS(status) > 2) throw std::runtime_error("change_hdf5 does not start");  // 127 of the shell
    if (made_.size() < kAtOnce) made_.emplace_back();                                                          // the one that it ended with
  }

  std::string command_;
  std::uint64_t first_ = 0;
  std::vector<std::optional<std::string>> made_;
};

template <class Read>
void through_the_interface(const std::string& name, const std::vector<std::string>& seeds, const Read& read) {
  const std::string path = scratch(name + ".h5");
  ChangedFiles files(name, seeds);
  fuzz::run(name, [&](Random& random, const Keep& keep) {
    const std::string& bytes = files.of(random.index());
    keep(bytes);
    fuzz::write(path, bytes);
    read(path);
  });
}

template <class Read>
void with_flipped_bytes(const std::string& name, const std::vector<std::string>& seeds, const Read& read) {
  const std::string path = scratch(name + ".h5");
  fuzz::run(name, [&](Random& random, const Keep& keep) {
    const std::string bytes = fuzz::with_flipped_bytes(random.of(seeds), random);
    keep(bytes);
    fuzz::write(path, bytes);
    read(path);
  });
}

const ChildLimits kShort{.cpu_s = 1.0, .memory = std::size_t{1} << 30};

TEST(Fuzz, ModalFile) {
  through_the_interface("modal_file", modal_files(), [](const std::string& path) { modal_data_of(Hdf5File::open(path)); });
}
TEST(Fuzz, RunFile) {
  through_the_interface("run_file", run_files(), [](const std::string& path) { report_page(Hdf5File::open(path)); });
}
TEST(Fuzz, BytesOfAModalFile) {
  with_flipped_bytes("modal_bytes", modal_files(), [](const std::string& path) { read_modal_file(path, kShort); });
}
TEST(Fuzz, BytesOfARunFile) {
  with_flipped_bytes("run_bytes", run_files(), [](const std::string& path) { write_report(path, scratch("page.html"), kShort); });
}

/// The code of the answer to a changed run file.
template <class Change>
std::string answer(const Change& change) {
  const std::string path = scratch("changed.h5");
  fuzz::write(path, run_files()[0]);
  change(path);
  try {
    write_report(path, scratch("page.html"));
  } catch (const InputError& e) {
    return std::string(number_of(e.diagnostics().at(0).code)) + " " + e.diagnostics().at(0).at.key_path;
  }
  return "page";
}

TEST(HostileRun, WithLinksThatLeadElsewhereIsRefused) {
  EXPECT_EQ(answer([](const std::string& p) { fuzz::link_group_into_itself(p, "/channels"); }), "C0702 /channels/again");
  EXPECT_EQ(answer([](const std::string& p) { fuzz::link_group_into_itself(p, "/channels/bodies"); }), "C0702 /channels/bodies/again");
  EXPECT_EQ(answer([](const std::string& p) { fuzz::link_softly(p, "/channels/bodies/again", "/channels"); }),
            "C0702 /channels/bodies/again");
  EXPECT_EQ(answer([](const std::string& p) { fuzz::link_softly(p, "/time", "/channels/wheels/speed"); }), "C0702 /time");
  EXPECT_EQ(answer([](const std::string& p) { fuzz::link_to_file(p, "/time", "/dev/zero"); }), "C0702 /time");
  EXPECT_EQ(answer([](const std::string& p) { fuzz::make_external(p, "/time", "/dev/zero"); }), "C0702 /time");
}

TEST(HostileRun, WithDimensionsBeyondItsBytesIsRefused) {
  for (int rank : {1, 2, 3}) {
    EXPECT_EQ(answer([&](const std::string& p) { fuzz::make_huge(p, "/time", rank); }), "C0702 /time");
    EXPECT_EQ(answer([&](const std::string& p) { fuzz::make_huge(p, "/spec/parameters", rank); }), "C0702 /spec/parameters");
  }
}

TEST(HostileRun, WithAHugeModalMatrixIsRefused) {
  const std::string path = scratch("huge.h5");
  fuzz::write(path, modal_files()[1]);
  fuzz::make_huge(path, "/K", 2);
  EXPECT_THROW(read_modal_file(path), InputError);
}

}  // namespace
}  // namespace cardan
