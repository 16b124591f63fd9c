// What a modal file is refused for. The layout is docs/modal_files.md.
#include "bodies/modal/modal_file.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "bodies/modal/lumped.hpp"
#include "bodies/modal/modal_source.hpp"
#include "core/io/hdf5_file.hpp"
#include "tests/support/modal_samples.hpp"
#include "tests/support/scratch.hpp"
#include "tests/support/worse.hpp"

namespace cardan {
namespace {

using Values = std::vector<double>;
using Shape = std::vector<std::size_t>;

using test::kNaN;
using test::lumped;
using test::scratch;

/// The code of the answer to a file made of `data` with a change, without its hash; "accepted" if there is none.
template <class Change>
std::string answer(const ModalData& data, const Change& change) {
  const std::string path = scratch("changed.h5");
  write_modal_file(path, data);
  {
    Hdf5File file = Hdf5File::update(path);
    file.remove_attribute("/", "content_hash");
    change(file);
    file.close();
  }
  const auto code_of = [](const auto& read) -> std::string {
    try {
      read();
    } catch (const InputError& e) {
      return std::string(number_of(e.diagnostics().at(0).code));
    }
    return "accepted";
  };
  const std::string code = code_of([&] { read_modal_file(path); });
  EXPECT_EQ(code, code_of([&] { modal_data_of(Hdf5File::open(path)); })) << "the same in this process";
  return code;
}

std::string with(const ModalData& data, const std::string& path, const Values& values, const Shape& shape) {
  return answer(data, [&](Hdf5File& file) { file.write(path, values, shape); });
}

TEST(ModalFile, WithoutAHashIsTaken) {
  EXPECT_EQ(answer(lumped(), [](Hdf5File&) {}), "accepted");
  EXPECT_EQ(answer(test::beam(), [](Hdf5File&) {}), "accepted");
}

TEST(ModalFile, HasNothingThatIsNotRead) {
  const ModalData data = lumped();
  const auto also = [&](const std::string& path) { return with(data, path, {0.5}, {}); };
  EXPECT_EQ(also("/nodes/0/phi"), "C0702") << "for Phi, without which the node does not move with the body";
  EXPECT_EQ(also("/nodes/9/position"), "C0702") << "beyond nodes/count";
  EXPECT_EQ(also("/mass_node/count"), "C0702");
  EXPECT_EQ(also("/D"), "C0702");
  EXPECT_EQ(answer(data, [](Hdf5File& file) { file.set_attribute("/K", "remark", std::string("from a test")); }), "accepted");
  try {
    write_modal_file(scratch("spelled.h5"), data);
    Hdf5File::update(scratch("spelled.h5")).write("/integrals/i9", 1.0);
    read_modal_file(scratch("spelled.h5"));
    ADD_FAILURE() << "not refused";
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("did you mean \"/integrals/I9\"?"), std::string::npos) << e.what();
  }
}

TEST(ModalFile, OfAnotherShapeIsRefusedBeforeItIsRead) {
  const ModalData data = lumped();
  const auto zeros = [](const Shape& shape) {
    std::size_t n = 1;
    for (std::size_t k : shape) n *= k;
    return Values(n, 0.0);
  };
  const std::vector<std::pair<std::string, std::vector<Shape>>> wrong = {{"/K", {{}, {2}, {3, 3}, {1, 1}, {2, 2, 1}, {0, 0}}},
                                                                         {"/C", {{3, 3}, {2}}},
                                                                         {"/integrals/I1", {{2}, {1, 1}}},
                                                                         {"/integrals/I2", {{4}, {3, 3}, {0}}},
                                                                         {"/integrals/I3", {{3, 9}, {2, 3}, {0, 0}, {6}}},
                                                                         {"/integrals/I4", {{0, 0}}},
                                                                         {"/integrals/I5", {{2, 1, 2}, {2, 3, 3}, {1, 3, 2}, {0, 0, 0}}},
                                                                         {"/integrals/I6", {{0, 0}, {3, 3}}},
                                                                         {"/integrals/I7", {{2, 2}, {9}}},
                                                                         {"/integrals/I8", {{2, 10, 10}, {3, 3, 3}, {0, 0, 0}, {2, 3}}},
                                                                         {"/integrals/I9", {{4, 10, 10}, {2, 3, 3}, {4, 9}}},
                                                                         {"/integrals/rotary_ww", {{2, 10, 10}, {1, 3, 3}, {0, 3, 3}}},
                                                                         {"/integrals/rotary_we", {{2, 3, 3}}},
                                                                         {"/integrals/rotary_ee", {{2, 2, 3}, {0, 2, 2}}},
                                                                         {"/nodes/0/Phi", {{3, 9}, {2, 2}}},
                                                                         {"/nodes/1/R_BN", {{9}, {3, 4}}},
                                                                         {"/nodes/0/position", {{2}, {3, 3}}},
                                                                         {"/mass_nodes/1/Q", {{1, 2, 2}, {3, 3, 3}, {3, 2}}},
                                                                         {"/mass_nodes/0/inertia", {{3}}},
                                                                         {"/mass_nodes/2/mass", {{3}}}};
  for (const auto& [path, shapes] : wrong)
    for (const Shape& shape : shapes) EXPECT_EQ(with(data, path, zeros(shape), shape), "C0702") << path << fmt::format(" {}", shape.size());
}

TEST(ModalFile, HasSymmetricSecondOrderShapes) {  // half a quadratic form: what is not symmetric has a velocity of another motion
  EXPECT_EQ(with(lumped(), "/mass_nodes/1/Q", {0, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 2}, {3, 2, 2}), "accepted");
  EXPECT_EQ(with(lumped(), "/mass_nodes/1/Q", {0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2}, {3, 2, 2}), "C0321");
}

TEST(ModalFile, MayHaveNoDrawingButNoneThatCannotBe) {
  const ModalData data = test::beam();
  const std::size_t n = static_cast<std::size_t>(data.drawing.points.rows()), k = static_cast<std::size_t>(data.drawing.lines.rows());
  EXPECT_EQ(n, 9u);
  EXPECT_EQ(k, 8u);
  EXPECT_EQ(answer(data, [](Hdf5File& file) { file.remove("/drawing"); }), "accepted");
  EXPECT_EQ(answer(data, [](Hdf5File& file) { file.remove("/drawing/shapes"); }), "accepted");
  EXPECT_EQ(answer(data, [](Hdf5File& file) { file.remove("/drawing/points"); }), "C0702");
  for (double count : {-1.0, 1e18, 5001.0, kNaN, 0.5}) {
    EXPECT_EQ(with(data, "/drawing/count", {count}, {}), "C0702") << count;
    EXPECT_EQ(with(data, "/drawing/line_count", {count}, {}), "C0702") << count;
    EXPECT_EQ(with(data, "/drawing/mode_count", {count}, {}), "C0702") << count;
  }
  EXPECT_EQ(with(data, "/drawing/mode_count", {4.0}, {}), "C0702") << "more than there are";
  EXPECT_EQ(with(data, "/drawing/lines", Values(2 * k, 9.0), {k, 2}), "C0702") << "points that are not there";
  EXPECT_EQ(with(data, "/drawing/lines", Values(2 * k, 0.5), {k, 2}), "C0702");
  EXPECT_EQ(with(data, "/drawing/lines", Values(2 * k, -1.0), {k, 2}), "C0702");
  EXPECT_EQ(with(data, "/drawing/lines", Values(2 * k, kNaN), {k, 2}), "C0702");
  EXPECT_EQ(with(data, "/drawing/points", Values(3 * n, kNaN), {n, 3}), "C0702");
  EXPECT_EQ(with(data, "/drawing/shapes", Values(9 * n, HUGE_VAL), {3, n, 3}), "C0702");
  EXPECT_EQ(with(data, "/drawing/shapes", Values(9 * n, 0.0), {3, 3, n}), "C0702");
}

TEST(ModalFile, WithCountsThatCannotBeIsRefused) {
  const ModalData data = lumped();
  for (const char* path : {"/n_modes", "/nodes/count", "/mass_nodes/count", "/audit/count"})
    for (double count : {-1.0, 1e18, 1e9, kNaN, HUGE_VAL, 0.5, 4.0})
      EXPECT_EQ(with(data, path, {count}, {}), "C0702") << path << " " << count;
  EXPECT_EQ(with(data, "/n_modes", {0.0}, {}), "C0702");
  EXPECT_EQ(with(data, "/nodes/count", {1.0}, {}), "C0702") << "the others would not be read";
  EXPECT_EQ(with(data, "/mass_nodes/count", {1.0}, {}), "C0702") << "their mass would be missing";
}

TEST(ModalFile, OfNoPhysicalBodyIsRefusedAsLumpedMassesAre) {
  const ModalData b = test::beam(), l = lumped();
  EXPECT_EQ(with(b, "/integrals/I1", {-1.0}, {}), "C0321");
  EXPECT_EQ(with(b, "/integrals/I1", {kNaN}, {}), "C0321");
  EXPECT_EQ(with(b, "/K", {-1, 0, 0, 0, 1, 0, 0, 0, 1}, {3, 3}), "C0321");
  EXPECT_EQ(with(b, "/K", {0, 0, 0, 0, 1, 0, 0, 0, 1}, {3, 3}), "C0322");
  EXPECT_EQ(with(b, "/K", {1, 1, 0, 0, 1, 0, 0, 0, 1}, {3, 3}), "C0321");
  EXPECT_EQ(with(b, "/K", {1, 0, 0, 0, kNaN, 0, 0, 0, 1}, {3, 3}), "C0321");
  EXPECT_EQ(with(b, "/C", {-1, 0, 0, 0, 1, 0, 0, 0, 1}, {3, 3}), "C0321");
  EXPECT_EQ(with(b, "/integrals/I7", {-1, 0, 0, 0, 1, 0, 0, 0, 1}, {3, 3}), "C0321");
  EXPECT_EQ(with(b, "/integrals/I7", {1, 2, 0, 0, 1, 0, 0, 0, 1}, {3, 3}), "C0321");
  EXPECT_EQ(with(b, "/integrals/I2", {1e3, 0, 0}, {3}), "C0321") << "a mass centre that far out";
  EXPECT_EQ(with(b, "/integrals/I3", Values(9, 1e3), {3, 3}), "C0321") << "more momentum than the modal mass allows";
  Values I5(27, 0.0);
  I5[3 * 3 * 1] = 1.0;  // I5_10, while I5_01 is zero
  EXPECT_EQ(with(b, "/integrals/I5", I5, {3, 3, 3}), "C0321");
  EXPECT_EQ(with(b, "/integrals/I9", Values(81, kNaN), {9, 3, 3}), "C0321");
  EXPECT_EQ(with(l, "/nodes/0/R_BN", Values(9, 0.0), {3, 3}), "C0303");
  EXPECT_EQ(with(l, "/nodes/0/R_BN", Values(9, kNaN), {3, 3}), "C0303");
  EXPECT_EQ(with(l, "/nodes/0/R_BN", {1, 0, 0, 0, 1, 0, 0, 0, -1}, {3, 3}), "C0303") << "a reflection";
  EXPECT_EQ(with(l, "/nodes/0/Phi", Values(6, kNaN), {3, 2}), "C0321");
  EXPECT_EQ(with(l, "/mass_nodes/0/mass", {-1.0}, {}), "C0321");
  EXPECT_EQ(with(l, "/mass_nodes/2/inertia", {1, 0, 0, 0, 1, 0, 0, 0, 9}, {3, 3}), "C0321");
  EXPECT_EQ(with(l, "/mass_nodes/1/mass", {2.1}, {}), "C0321") << "the integrals are of other masses";
  EXPECT_EQ(with(l, "/mass_nodes/1/Phi", Values(6, 0.0), {3, 2}), "C0321");
}

TEST(ModalFile, MayHaveRoundingWhereASumIsZero) {  // modes on mean axes of masses on a line: I3, I4, I5 and I8 are nothing else
  std::vector<MassNode> masses(3);
  for (std::size_t j = 0; j < 3; ++j) {
    masses[j].mass = j == 1 ? 2.0 : 1.0;
    masses[j].position = {static_cast<double>(j) - 1.0, 0.0, 0.0};
    masses[j].Phi = Eigen::Vector3d(0.0, j == 1 ? -0.5 : 0.5, 0.0);
  }
  const ModalData data = lumped_modal_data(masses, Eigen::MatrixXd::Constant(1, 1, 4.0), {}, {});
  const std::vector<std::pair<std::string, Shape>> sums = {{"/integrals/I2", {3}},
                                                           {"/integrals/I3", {3, 1}},
                                                           {"/integrals/I4", {3, 1}},
                                                           {"/integrals/I5", {1, 3, 1}},
                                                           {"/integrals/I8", {1, 3, 3}}};
  for (const auto& [path, shape] : sums) {
    Values values(path.ends_with("I8") ? 9 : 3, 0.0);
    values[1] = 1e-16;
    EXPECT_EQ(with(data, path, values, shape), "accepted") << path;
    values[1] = 1e-5;
    EXPECT_EQ(with(data, path, values, shape), "C0321") << path;
  }
}

TEST(ModalFile, WithNamesThatCannotBeUsedIsRefused) {
  for (const char* name : {"a.b", "world", "", "two\nlines", "\xff"})
    EXPECT_EQ(answer(lumped(), [&](Hdf5File& file) { file.write("/nodes/0/name", std::string(name)); }), "C0210") << name;
  EXPECT_EQ(answer(lumped(), [](Hdf5File& file) { file.write("/nodes/0/name", std::string("other")); }), "C0207");
  EXPECT_EQ(answer(lumped(), [](Hdf5File& file) { file.write("/nodes/0/name", 1.0); }), "C0702");
}

TEST(ModalFile, IsRefusedForWhatIsMissing) {
  for (const char* path : {"/K", "/integrals/I5", "/integrals/I7", "/n_modes", "/mass_nodes/2", "/nodes/1/position", "/nodes/count"})
    EXPECT_EQ(answer(lumped(), [&](Hdf5File& file) { file.remove(path); }), "C0702") << path;
  EXPECT_EQ(answer(lumped(), [](Hdf5File& file) { file.remove_attribute("/", "schema"); }), "C0702");
  EXPECT_EQ(answer(test::beam(), [](Hdf5File& file) { file.remove("/integrals"); }), "C0321") << "and no mass nodes";
}

TEST(ModalFile, MayLeaveOutWhatFollowsFromTheRest) {
  for (const char* path : {"/C", "/nodes", "/mass_nodes", "/audit", "/source", "/integrals/I9", "/nodes/1/Phi", "/mass_nodes/2/Q"})
    EXPECT_EQ(answer(lumped(), [&](Hdf5File& file) { file.remove(path); }), "accepted") << path;
  const std::string path = scratch("no_integrals.h5");
  const ModalData data = lumped();
  write_modal_file(path, data);
  Hdf5File file = Hdf5File::update(path);
  file.remove("/integrals");
  file.close();
  const ModalIntegrals computed = read_modal_file(path).integrals;
  EXPECT_EQ(computed.I6, data.integrals.I6);
  EXPECT_EQ(computed.rotary_ww.at(1), data.integrals.rotary_ww.at(1));
}

TEST(ModalFile, ThatWasChangedIsKnownByItsHash) {
  const std::string path = scratch("hash.h5");
  write_modal_file(path, lumped());
  Hdf5File file = Hdf5File::update(path);
  file.write("/K", Values{4, 0, 0, 9.5}, {2, 2});
  file.close();
  EXPECT_THROW(read_modal_file(path), InputError);
}

TEST(ModalFile, OfAnotherKindIsRefusedAtOnce) {
  const std::string pipe = scratch("pipe");
  std::filesystem::remove(pipe);
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  for (const std::string& path : {pipe, testing::TempDir(), std::string("/dev/zero"), std::string("/nowhere/modes.h5")})
    EXPECT_THROW(read_modal_file(path), InputError) << path;
  std::ofstream(scratch("text.h5")) << "no HDF5";
  EXPECT_THROW(read_modal_file(scratch("text.h5")), InputError);
  std::filesystem::remove(pipe);
}

/// The script of docs/modal_files.md, as it is printed there.
TEST(ModalFile, OfTheScriptInTheDocumentsIsRead) {
  std::ifstream in(std::string(CARDAN_SOURCE_DIR) + "/docs/modal_files.md");
  const std::string page{std::istreambuf_iterator<char>(in), {}};
  const auto from = page.find("```python\n");
  ASSERT_NE(from, std::string::npos);
  const std::string folder = scratch("script");
  std::filesystem::create_directories(folder);
  std::ofstream(folder + "/write.py") << page.substr(from + 10, page.find("```", from + 10) - from - 10);
  std::filesystem::remove(folder + "/wing.h5");
  const auto run = [&](const std::string& command) { return std::system(("cd " + folder + " && " + command + " > said 2>&1").c_str()); };
  std::string python;
  for (const char* name : {"python3", "/usr/bin/python3"})
    if (run(std::string(name) + " -c 'import h5py'") == 0) python = name;
  if (python.empty()) GTEST_SKIP() << "h5py is not installed";
  ASSERT_EQ(run(python + " write.py"), 0);
  const ModalData d = read_modal_file(folder + "/wing.h5");
  EXPECT_EQ(d.n_modes, 1);
  EXPECT_EQ(d.source, "a cantilever of four masses");
  EXPECT_DOUBLE_EQ(d.integrals.I1, 8.0);
  // sum m r x phi with r = x e_x, phi = (x/L)^2 e_z: -e_y m sum x^3 / L^2
  EXPECT_NEAR(d.integrals.I4(1, 0), -2.0 * 3.0 * (1 + 8 + 27 + 64) / 64.0, 1e-14);
  EXPECT_NEAR(std::sqrt(d.K(0, 0) / d.integrals.I6(0, 0)), 3.141592653589793, 1e-14) << "0.5 Hz";
  ASSERT_EQ(d.nodes.size(), 2u);
  EXPECT_EQ(d.nodes[1].name, "tip");
  EXPECT_DOUBLE_EQ(d.nodes[1].Psi(1, 0), -2.0 / 3.0);
}

TEST(Lumped, OfNoModesOrWithOneSecondOrderMatrixAreRefused) {
  MassNode node;
  node.mass = 1.0;
  EXPECT_THROW(lumped_modal_data({node}, Eigen::MatrixXd(), {}, {}), InputError);
  node.Q.assign(1, Eigen::MatrixXd::Identity(1, 1));
  EXPECT_THROW(lumped_modal_data({node}, Eigen::MatrixXd::Identity(1, 1), {}, {}), InputError);
  node.Q.assign(3, Eigen::MatrixXd::Identity(2, 2));
  EXPECT_THROW(lumped_modal_data({node}, Eigen::MatrixXd::Identity(1, 1), {}, {}), InputError);
}

}  // namespace
}  // namespace cardan
