#pragma once
// A field of a family, asked at points.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "core/abi/field_family.hpp"
#include "core/abi/param_values.hpp"
#include "tests/support/builders.hpp"

namespace cardan::test {

class AskedField {
 public:
  using Texts = std::map<std::string, std::string, std::less<>>;
  /// Numbers of every parameter that `given` does not have are its fallback; of files their content.
  AskedField(const std::string& type, const std::map<std::string, std::vector<double>>& given, const Texts& texts = {},
             const Texts& files = {})
      : f_(*registry().field(type)) {
    ParamTable values;
    values.texts = texts, values.bytes = files;
    for (const auto& [name, content] : files) values.texts[name] = "file";
    for (std::uint32_t i = 0; i < f_.n_params; ++i) {
      const cardan_param_desc& d = f_.params[i];
      const bool three = d.kind == CARDAN_VECTOR || d.kind == CARDAN_UNIT_VECTOR;
      values.numbers[d.name].assign(d.fallback, d.fallback + (three ? 3 : 1));
    }
    for (const auto& [name, numbers] : given) values.numbers[name] = numbers;
    const cardan_param_values view = values.view();
    packed_.resize((f_.packed_size ? f_.packed_size(&view) : f_.params_size) / sizeof(double) + 1);
    accepted_ = f_.pack(&view, packed_.data()) == 0;
    if (!accepted_ && !values.failures.empty())
      refusal_ = values.failures.front().expected, got_ = values.failures.front().got, key_ = values.failures.front().name;
  }
  /// What was expected where pack refuses; empty where it does not.
  const std::string& refusal() const { return refusal_; }
  /// The parameter that is refused.
  const std::string& key() const { return key_; }
  /// What it was given then, where it tells.
  const std::string& got() const { return got_; }

  struct Answer {
    Eigen::Vector4d value = Eigen::Vector4d::Zero();
    Eigen::Matrix<double, 4, 3> gradient = Eigen::Matrix<double, 4, 3>::Zero();
    int beyond = 0;
  };
  Answer at(const Eigen::Vector3d& x, double t = 0.0) const {
    EXPECT_TRUE(accepted_) << refusal_;
    std::vector<double> prepared(f_.prepared_size / sizeof(double) + 1);
    const int of_time = f_.prepare ? f_.prepare(t, packed_.data(), prepared.data()) : 0;
    const cardan_field_args args{sizeof args, t, packed_.data(), f_.prepare ? prepared.data() : nullptr};
    Eigen::Matrix<double, 3, 4> rows = Eigen::Matrix<double, 3, 4>::Zero();
    Answer out;
    out.beyond = of_time | f_.evaluate(&args, 1, x.data(), out.value.data(), rows.data());
    out.gradient = rows.transpose();
    return out;
  }
  /// Where it has no derivative each of these crosses zero.
  std::vector<double> edges(const Eigen::Vector3d& x) const {
    std::vector<double> prepared(f_.prepared_size / sizeof(double) + 1), g;
    if (f_.prepare) f_.prepare(0.0, packed_.data(), prepared.data());
    const cardan_field_args args{sizeof args, 0.0, packed_.data(), f_.prepare ? prepared.data() : nullptr};
    g.resize(f_.edges(&args, x.data(), nullptr));
    f_.edges(&args, x.data(), g.data());
    return g;
  }

 private:
  const cardan_field_family& f_;
  std::vector<double> packed_;
  bool accepted_ = false;
  std::string refusal_, got_, key_;
};

/// Rows of a CSV file of tests/reference/data below comments and a line of names; texts where there are no numbers are 0.
inline std::vector<std::vector<double>> rows_of(const std::string& file, std::vector<std::vector<std::string>>* texts = nullptr) {
  std::ifstream in(std::string(CARDAN_SOURCE_DIR "/tests/reference/data/") + file);
  EXPECT_TRUE(in) << file;
  std::vector<std::vector<double>> rows;
  bool named = false;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    if (!std::exchange(named, true) && texts == nullptr) continue;
    std::vector<double> row;
    std::vector<std::string> fields;
    std::istringstream parts(line);
    for (std::string part; std::getline(parts, part, ',');) fields.push_back(part), row.push_back(std::strtod(part.c_str(), nullptr));
    rows.push_back(row);
    if (texts) texts->push_back(fields);
  }
  return rows;
}

/// n, m, C and S of every row, one after the other.
inline std::vector<double> coefficients_of(const std::string& file) {
  std::vector<double> all;
  for (const auto& row : rows_of(file)) all.insert(all.end(), row.begin(), row.begin() + 4);
  return all;
}

/// Geodetic latitude and longitude [rad] and height [m]: the place, and its directions north, east and down as columns.
struct GeodeticPlace {
  GeodeticPlace(double latitude, double longitude, double height, double radius, double flattening) {
    const double c = std::cos(latitude), s = std::sin(latitude), e2 = flattening * (2.0 - flattening);
    const double N = radius / std::sqrt(1.0 - e2 * s * s);
    x = {(N + height) * c * std::cos(longitude), (N + height) * c * std::sin(longitude), ((1.0 - e2) * N + height) * s};
    ned.col(0) = Eigen::Vector3d(-s * std::cos(longitude), -s * std::sin(longitude), c);
    ned.col(1) = Eigen::Vector3d(-std::sin(longitude), std::cos(longitude), 0.0);
    ned.col(2) = ned.col(0).cross(ned.col(1));
  }
  Eigen::Vector3d x;
  Eigen::Matrix3d ned;
};

}  // namespace cardan::test
