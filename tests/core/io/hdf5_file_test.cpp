#include "core/io/hdf5_file.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <numeric>

#include "core/base/diagnostic.hpp"
#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

using test::scratch;

std::string error_of(const std::function<void()>& act) {
  try {
    act();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

TEST(Hdf5File, GivesBackWhatWasWritten) {
  const std::string path = scratch("round_trip.h5");
  const std::vector<double> matrix{1, 2, 3, 4, 5, std::numeric_limits<double>::denorm_min()};
  const std::vector<std::int64_t> integers{-1, std::numeric_limits<std::int64_t>::max()};
  const std::vector<std::string> texts{"Ω", "", "two\nlines", "d"};
  {
    auto file = Hdf5File::create(path);
    file.write("/a/b/matrix", matrix, {2, 3});
    file.write("/a/scalar", 0.1);
    file.write("/a/integers", integers);
    file.write("/text", std::string("naïve"));
    file.write("/a/texts", texts, {2, 2});
    file.set_attribute("/a", "unit", std::string("rad/s"));
    file.set_attribute("/a", "components", std::vector<std::string>{"x", "y"});
    file.set_attribute("/text", "size", 2.5);
    file.set_attribute("/text", "size", std::int64_t{7});  // replaces
    file.close();
  }
  const auto file = Hdf5File::open(path);
  EXPECT_EQ(file.read_doubles("/a/b/matrix").values, matrix);
  EXPECT_EQ(file.read_doubles("/a/b/matrix").shape, (std::vector<std::size_t>{2, 3}));
  EXPECT_EQ(file.read_doubles("/a/scalar").values, std::vector<double>{0.1});
  EXPECT_TRUE(file.read_doubles("/a/scalar").shape.empty());
  EXPECT_EQ(file.read_integers("/a/integers").values, integers);
  EXPECT_EQ(file.read_text("/text"), "naïve");
  EXPECT_EQ(file.read_texts("/a/texts"), texts);
  EXPECT_EQ(file.shape("/a/texts"), (std::vector<std::size_t>{2, 2}));
  EXPECT_EQ(file.text_attribute("/a", "unit"), "rad/s");
  EXPECT_EQ(file.texts_attribute("/a", "components"), (std::vector<std::string>{"x", "y"}));
  EXPECT_TRUE(file.has_attribute("/text", "size"));
  EXPECT_TRUE(file.is_group("/a/b"));
  EXPECT_FALSE(file.is_group("/text"));
  EXPECT_FALSE(file.has("/a/c/d"));
  EXPECT_FALSE(file.has_attribute("/a", "frame"));
}

TEST(Hdf5File, ListsMembersInTheOrderOfTheirCreation) {
  auto file = Hdf5File::create(scratch("order.h5"));
  for (const char* name : {"/z", "/a", "/m/y", "/m/b"}) file.write(name, 1.0);
  EXPECT_EQ(file.members("/"), (std::vector<std::string>{"z", "a", "m"}));
  EXPECT_EQ(file.members("/m"), (std::vector<std::string>{"y", "b"}));
}

TEST(Hdf5File, ReplacesADatasetOfAnotherShape) {
  auto file = Hdf5File::create(scratch("replace.h5"));
  file.write("/x", std::vector<double>{1, 2, 3});
  file.write("/x", std::vector<double>{4, 5, 6});
  EXPECT_EQ(file.read_doubles("/x").values, (std::vector<double>{4, 5, 6}));
  file.write("/x", std::vector<double>{7});
  EXPECT_EQ(file.read_doubles("/x").values, std::vector<double>{7});
}

TEST(Hdf5File, AppendsRowsAcrossBlocks) {
  auto file = Hdf5File::create(scratch("rows.h5"));
  file.make_rows("/vectors", 3, 4);
  file.make_rows("/time", 0, 4);
  std::vector<double> written;
  for (std::size_t rows : {1u, 5u, 4u, 9u}) {  // never in step with blocks of 4
    std::vector<double> block(3 * rows);
    std::iota(block.begin(), block.end(), static_cast<double>(written.size()));
    file.append_rows("/vectors", block);
    file.append_rows("/time", std::vector<double>(rows, 0.5));
    written.insert(written.end(), block.begin(), block.end());
  }
  EXPECT_EQ(file.shape("/vectors"), (std::vector<std::size_t>{19, 3}));
  EXPECT_EQ(file.shape("/time"), std::vector<std::size_t>{19});
  EXPECT_EQ(file.read_doubles("/vectors").values, written);
}

TEST(Hdf5File, TellsWhyAFileCannotBeCreated) {
  EXPECT_EQ(error_of([] { Hdf5File::create("/nowhere/run.h5"); }),
            "error[C0701]: result cannot be written\n"
            "  --> /nowhere/run.h5\n"
            "  expected: a file that can be written\n"
            "  got:      No such file or directory\n"
            "  hint:     is the folder there, and may it be written to?\n"
            "\n1 error. Nothing was run.\n");
}

TEST(Hdf5File, TellsWhyAFileCannotBeRead) {
  const std::string path = scratch("not_hdf5.h5");
  std::ofstream(path) << "plain text";
  EXPECT_EQ(error_of([&] { Hdf5File::open(path); }), "error[C0702]: HDF5 file cannot be read\n  --> " + path +
                                                         "\n  expected: an HDF5 file\n"
                                                         "  got:      file signature not found\n"
                                                         "\n1 error. Nothing was run.\n");
  EXPECT_NE(error_of([] { Hdf5File::open("/nowhere/run.h5"); }).find("No such file or directory"), std::string::npos);
}

TEST(Hdf5File, TellsWhatIsMissingOrOfAnotherType) {
  auto file = Hdf5File::create(scratch("missing.h5"));
  file.write("/run/title", std::string("t"));
  EXPECT_NE(error_of([&] { file.read_doubles("/run/other"); }).find("/run/other"), std::string::npos);
  EXPECT_NE(error_of([&] { file.read_doubles("/run/title"); }).find("expected: numbers"), std::string::npos);
  EXPECT_NE(error_of([&] { file.text_attribute("/run", "unit"); }).find("an attribute \"unit\""), std::string::npos);
  EXPECT_NE(error_of([&] { file.members("/run/title"); }).find("expected: a group"), std::string::npos);
}

}  // namespace
}  // namespace cardan
