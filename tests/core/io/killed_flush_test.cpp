// A process may be killed between any two writes of its results: what the flush before left can be read, and nothing else is shown.
#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <string>
#include <vector>

#include "core/base/diagnostic.hpp"
#include "core/io/hdf5_file.hpp"
#include "core/io/recorder.hpp"
#include "core/io/run_columns.hpp"
#include "tests/support/scratch.hpp"

namespace {
struct Write {
  off_t at;
  std::string bytes;
  bool ends = false;  // the file is cut or made longer to end here
};
std::vector<Write>* heard = nullptr;
}  // namespace

/// The writes of HDF5 come by here: a program's own function goes before that of the C library.
extern "C" __attribute__((visibility("default"))) ssize_t pwrite(int file, const void* bytes, size_t n, off_t at) {
  if (heard) heard->push_back({at, std::string(static_cast<const char*>(bytes), n)});
  return syscall(SYS_pwrite64, file, bytes, n, at);
}
extern "C" __attribute__((visibility("default"))) int ftruncate(int file, off_t size) noexcept {
  if (heard) heard->push_back({size, "", true});
  return static_cast<int>(syscall(SYS_ftruncate, file, size));
}

namespace cardan {
namespace {

struct Sizes {
  std::size_t rows = 0, lines = 0, checkpoints = 0;
  auto operator<=>(const Sizes&) const = default;
};

std::vector<double> row(std::size_t i) {
  const double t = static_cast<double>(i);
  return {t, t + 1.0, t + 2.0, -t};
}
std::string line(std::size_t i) { return "line " + std::to_string(i) + std::string(i % 90, '.'); }
std::string checkpoint(std::size_t i) { return "checkpoint " + std::to_string(i) + std::string(200 + 37 * i % 3000, 'x'); }

/// What is in the file; fails where a number or a text is not the one that was recorded.
Sizes intact(const std::string& path) {
  const auto columns = read_run_columns(path);
  const Hdf5File file = Hdf5File::open(path);
  EXPECT_EQ(file.text_attribute("/run", "title"), "Killed");
  EXPECT_EQ(file.texts_attribute("/channels/a/position", "components"), (std::vector<std::string>{"x", "y", "z"}));
  const auto lines = file.read_texts("/run/printed/text"), checkpoints = file.read_texts("/restart/checkpoints/text");
  const auto when = file.read_doubles("/run/printed/t").values, points = file.read_doubles("/restart/checkpoints/t").values;
  const Sizes n{columns.times.size(), when.size(), points.size()};
  EXPECT_EQ(lines.size(), 2 * n.lines);
  EXPECT_EQ(checkpoints.size(), n.checkpoints);
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < n.rows; ++i) {
    const std::vector<double> r = row(i);
    wrong += columns.times[i] != r[0] || columns.columns[1].values[i] != r[3];
    for (std::size_t k = 0; k < 3; ++k) wrong += columns.columns[0].values[3 * i + k] != r[k];
  }
  for (std::size_t i = 0; i < n.lines; ++i) wrong += lines[2 * i] != line(i) || when[i] != static_cast<double>(7 * i);
  for (std::size_t i = 0; i < n.checkpoints; ++i) wrong += checkpoints[i] != checkpoint(i) || points[i] != static_cast<double>(20 * i);
  EXPECT_EQ(wrong, 0u);
  return n;
}

TEST(Hdf5Recorder, KeepsWhatWasFlushedWhereverItIsKilled) {
  const std::string path = test::scratch("whole.h5"), cut = test::scratch("cut.h5");
  std::vector<Write> writes;
  struct Flush {
    std::size_t writes;  // once so many were made
    Sizes sizes;
  };
  std::vector<Flush> flushes;
  Sizes n;
  {
    heard = &writes;
    const auto recorder = make_hdf5_recorder(path, 1e9);
    RunHeader header;
    header.title = "Killed";
    recorder->begin(header, {{"a/position", {"x", "y", "z"}, "m", "world", "of a"}, {"b", {"b"}, "-", "", "one"}});
    flushes.push_back({writes.size(), n});
    for (const std::size_t more : {3, 100, 400, 30, 1000, 5, 3000}) {  // blocks hold 256; indices of blocks grow
      for (std::size_t i = 0; i < more; ++i, ++n.rows) {
        const double t = static_cast<double>(n.rows);
        recorder->row(t, row(n.rows));
        if (n.rows % 7 == 0) recorder->note(Note::printed, t, {line(n.lines++), "a controller"});
        if (n.rows % 20 == 0) recorder->checkpoint(t, checkpoint(n.checkpoints++));
      }
      recorder->flush();
      flushes.push_back({writes.size(), n});
    }
    recorder->attach("summary", "{}");
    recorder->close("complete");
    heard = nullptr;
  }
  ASSERT_GT(writes.size(), 300u);
  std::string image;
  std::size_t last = 0;  // of the flushes that ended
  for (std::size_t made = 1; made <= writes.size(); ++made) {
    const Write& w = writes[made - 1];
    const std::size_t at = static_cast<std::size_t>(w.at);
    image.resize(w.ends ? at : std::max(image.size(), at + w.bytes.size()));
    image.replace(at, w.bytes.size(), w.bytes);
    if (made < flushes[0].writes) continue;  // it has not its name yet
    while (last + 1 < flushes.size() && flushes[last + 1].writes <= made) ++last;
    std::ofstream(cut, std::ios::binary) << image;
    Sizes found;
    ASSERT_NO_THROW(found = intact(cut)) << "after " << made << " of " << writes.size() << " writes";
    const Sizes least = flushes[last].sizes;
    EXPECT_TRUE(found.rows >= least.rows && found.lines >= least.lines && found.checkpoints >= least.checkpoints)
        << "after " << made << " writes: " << found.rows << " of " << least.rows << " rows";
  }
  EXPECT_EQ(intact(path), n);
}

}  // namespace
}  // namespace cardan
