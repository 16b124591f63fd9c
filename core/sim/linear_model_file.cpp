#include "core/sim/linear_model_file.hpp"

#include <fmt/format.h>

#include <fstream>

#include "core/io/hdf5_file.hpp"
#include "core/io/json.hpp"

namespace cardan {
namespace {

using operators::LinearModel;
using operators::SpaceLabels;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

template <class Visit>
void for_matrices(const LinearModel& m, const Visit& visit) {
  visit("A", m.A), visit("B", m.B), visit("C", m.C), visit("D", m.D);
  visit("drift", Eigen::MatrixXd(m.drift)), visit("u0", Eigen::MatrixXd(m.u0)), visit("y0", Eigen::MatrixXd(m.y0));
}
template <class Visit>
void for_labels(const LinearModel& m, const Visit& visit) {
  visit("state", m.states), visit("input", m.inputs), visit("output", m.outputs);
}

void write_hdf5(const LinearModel& m, const std::string& path) {
  Hdf5File file = Hdf5File::create(path);
  for_matrices(m, [&](const std::string& name, const Eigen::MatrixXd& A) {
    const RowMajor rows = A;
    std::vector<std::size_t> shape{static_cast<std::size_t>(A.rows())};
    if (name.size() == 1) shape.push_back(static_cast<std::size_t>(A.cols()));
    file.write("/" + name, {rows.data(), static_cast<std::size_t>(rows.size())}, shape);
  });
  for_labels(m, [&](const std::string& side, const SpaceLabels& labels) {
    file.write("/" + side + "_names", labels.names, {labels.names.size()});
    file.write("/" + side + "_units", labels.units, {labels.units.size()});
  });
  file.write("/t", m.t);
  file.set_attribute("/", "system", m.system);
  file.set_attribute("/", "meaning", "x' = A x + B u, y = C x + D u; deviations about the state at t; drift = x' there");
  file.close();
}

std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? "''" : std::string(1, c);
  return out + "'";
}

}  // namespace

std::string linear_model_script(const LinearModel& m) {
  std::string name = m.system;
  for (char& c : name)
    if (static_cast<unsigned char>(c) < ' ') c = ' ';
  std::string out =
      fmt::format("% {}: x' = A x + B u, y = C x + D u, deviations about the state at t; drift = x' there. SI units.\n", name);
  out += fmt::format("t = {:.17g};\n", m.t);
  for_matrices(m, [&](const char* matrix, const Eigen::MatrixXd& A) {
    if (A.size() == 0) {
      out += fmt::format("{} = zeros({}, {});\n", matrix, A.rows(), A.cols());
      return;
    }
    out += fmt::format("{} = [\n", matrix);
    for (Eigen::Index i = 0; i < A.rows(); ++i) {
      for (Eigen::Index j = 0; j < A.cols(); ++j) out += fmt::format("{}{:.17g}", j == 0 ? "  " : " ", A(i, j));
      out += ";\n";
    }
    out += "];\n";
  });
  for_labels(m, [&](const char* side, const SpaceLabels& labels) {
    for (const bool units : {false, true}) {
      const std::vector<std::string>& texts = units ? labels.units : labels.names;
      out += fmt::format("{}_{} = {{", side, units ? "units" : "names");
      for (std::size_t i = 0; i < texts.size(); ++i) out += (i == 0 ? "" : "; ") + quoted(texts[i]);
      out += "};\n";
    }
  });
  return out;
}

std::string linear_model_json(const LinearModel& m) {
  Json out;
  out["system"] = m.system;
  out["t"] = m.t;
  for_matrices(m, [&](const std::string& name, const Eigen::MatrixXd& A) {
    Json rows = Json::array();
    for (Eigen::Index i = 0; i < A.rows(); ++i) {
      if (name.size() > 1) {
        rows.push_back(A(i, 0));
        continue;
      }
      Json row = Json::array();
      for (Eigen::Index j = 0; j < A.cols(); ++j) row.push_back(A(i, j));
      rows.push_back(std::move(row));
    }
    out[name] = std::move(rows);
  });
  for_labels(m, [&](const std::string& side, const SpaceLabels& labels) {
    out[side + "_names"] = labels.names;
    out[side + "_units"] = labels.units;
  });
  return json_line(out) + "\n";
}

void write_linear_model(const LinearModel& m, const std::string& path) {
  const auto refuse = [&](std::string expected, std::string got) {
    cardan::refuse(Code::cannot_write, {"file of the linear model"}, std::move(expected), std::move(got));
  };
  for_matrices(m, [&](const char* name, const Eigen::MatrixXd& A) {
    if (!A.allFinite()) throw NumericsError({.code = Code::not_finite, .t = m.t, .what = std::string("linear model, ") + name});
  });
  if (path.ends_with(".h5")) return write_hdf5(m, path);
  if (!path.ends_with(".m") && !path.ends_with(".json")) refuse("a name that ends in .h5, .m or .json", "\"" + path + "\"");
  std::ofstream file(path, std::ios::binary);
  file << (path.ends_with(".m") ? linear_model_script(m) : linear_model_json(m));
  file.close();
  if (!file) refuse("a file that can be written", "\"" + path + "\"");
}

}  // namespace cardan
