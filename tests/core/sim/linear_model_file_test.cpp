#include "core/sim/linear_model_file.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/base/diagnostic.hpp"
#include "core/io/hdf5_file.hpp"
#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

operators::LinearModel sample() {
  operators::LinearModel m;
  m.system = "it's a test";
  m.t = 0.1;
  m.A = (Eigen::MatrixXd(2, 2) << 0.0, 1.0, -1.0 / 3.0, 1e-300).finished();
  m.B = (Eigen::MatrixXd(2, 1) << 0.0, 2.0).finished();
  m.C = (Eigen::MatrixXd(1, 2) << 7.0, 8.0).finished();
  m.D.setZero(1, 1);
  m.drift = Eigen::Vector2d(0.25, -3.0);
  m.u0.setConstant(1, 5.0), m.y0.setConstant(1, 6.0);
  m.states = {{"wing.angle", "wing.rate"}, {"rad", "rad/s"}};
  m.inputs = {{"wing.angle"}, {"N m"}};
  m.outputs = {{"tip'"}, {"m"}};
  return m;
}

TEST(LinearModelFile, Script) {
  const std::string text = linear_model_script(sample());
  for (const char* line : {"t = 0.10000000000000001;\n", "A = [\n  0 1;\n  -0.33333333333333331 1e-300;\n];\n",
                           "state_names = {'wing.angle'; 'wing.rate'};\n", "input_units = {'N m'};\n", "output_names = {'tip'''};\n"})
    EXPECT_NE(text.find(line), std::string::npos) << line << text;
  operators::LinearModel none = sample();
  none.B.resize(2, 0), none.D.resize(1, 0), none.u0.resize(0), none.inputs = {};
  EXPECT_NE(linear_model_script(none).find("B = zeros(2, 0);\n"), std::string::npos);
  EXPECT_NE(linear_model_script(none).find("input_names = {};\n"), std::string::npos);
}

TEST(LinearModelFile, JsonAndHdf5KeepEveryBit) {
  const operators::LinearModel m = sample();
  const auto json = nlohmann::json::parse(linear_model_json(m));
  EXPECT_EQ(json["A"][1][0].get<double>(), -1.0 / 3.0);
  EXPECT_EQ(json["drift"][1].get<double>(), -3.0);
  EXPECT_EQ(json["state_units"][1], "rad/s");
  const std::string path = test::scratch("model.h5");
  write_linear_model(m, path);
  const Hdf5File file = Hdf5File::open(path);
  const auto A = file.read_doubles("/A");
  EXPECT_EQ(A.shape, (std::vector<std::size_t>{2, 2}));
  EXPECT_EQ(A.values, (std::vector<double>{0.0, 1.0, -1.0 / 3.0, 1e-300}));
  EXPECT_EQ(file.read_doubles("/C").shape, (std::vector<std::size_t>{1, 2}));
  EXPECT_EQ(file.read_texts("/input_names"), m.inputs.names);
  EXPECT_EQ(file.read_doubles("/t").values[0], 0.1);
  const std::string other = path + ".h5";
  operators::LinearModel none = m;  // without inputs
  none.B.resize(2, 0), none.D.resize(1, 0), none.u0.resize(0), none.inputs = {};
  write_linear_model(none, other);
  EXPECT_EQ(Hdf5File::open(other).read_doubles("/B").shape, (std::vector<std::size_t>{2, 0}));
  EXPECT_TRUE(Hdf5File::open(other).read_texts("/input_names").empty());
  std::filesystem::remove(other);
  std::filesystem::remove(path);
}

TEST(LinearModelFile, RefusesWhatItCannotWrite) {
  EXPECT_THROW(write_linear_model(sample(), "model.xls"), InputError);
  EXPECT_THROW(write_linear_model(sample(), "/nowhere/at/all/model.m"), InputError);
  operators::LinearModel bad = sample();
  bad.A(0, 0) = std::nan("");
  EXPECT_THROW(write_linear_model(bad, "model.m"), NumericsError);
}

}  // namespace
}  // namespace cardan
