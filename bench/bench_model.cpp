#include "bench/bench_model.hpp"

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "bodies/modal/modal_integrals.hpp"

namespace cardan::bench {
namespace {
using nlohmann::json;

Eigen::Vector3d vector3(const json& j) { return {j[0].get<double>(), j[1].get<double>(), j[2].get<double>()}; }
Eigen::Matrix3d matrix3(const json& j) {
  Eigen::Matrix3d m;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) m(r, c) = j[static_cast<std::size_t>(3 * r + c)].get<double>();
  return m;
}
ParamValue numbers(std::vector<double> values) { return {std::move(values), {}}; }

}  // namespace

BenchModel read_model(const std::filesystem::path& file) {
  json j;
  std::ifstream(file) >> j;
  if (j.value("schema", "") != "cardan-bench/1")
    throw InputError(Diagnostic{Code::bad_result_file, {"schema", {file.string(), 0, 0}}, "\"cardan-bench/1\"", j.value("schema", "nothing"), "", "", "", 0});
  BenchModel model;
  model.name = file.stem().string();
  model.spec.name = model.name;
  model.spec.gravity.kind = GravitySpec::Kind::uniform;
  model.spec.gravity.g = vector3(j["gravity"]);
  std::vector<bool> free;
  for (const json& b : j["bodies"]) {
    BodySpec body;
    body.name = "b" + std::to_string(model.spec.bodies.size());
    body.mass = b["mass"].get<double>();
    body.com = vector3(b["com"]);
    body.inertia_com = matrix3(b["inertia_com"]);
    const int parent = b["parent"].get<int>();
    if (parent >= 0) body.hinge.inboard_body = "b" + std::to_string(parent);
    body.hinge.onode_position = vector3(b["p_parent"]);
    body.hinge.onode_R = matrix3(b["R_parent"]);
    const std::string hinge = b["hinge"].get<std::string>();
    free.push_back(hinge == "free");
    body.hinge.type = hinge == "free" ? "free_body" : hinge;  // both velocities in body axes
    if (hinge == "revolute") {
      std::vector<double> axis(3, 0.0);
      axis[b["axis"].get<std::size_t>()] = 1.0;
      body.hinge.params["axis"] = numbers(axis);
    }
    model.spec.bodies.push_back(std::move(body));
  }
  for (const json& s : j["states"]) {
    const auto read = [&](const char* key) {
      const auto values = s[key].get<std::vector<double>>();
      return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size())));
    };
    BenchState state{read("q"), read("v"), read("tau"), read("vdot")};
    Eigen::Index at = 0;
    for (const bool is_free : free) {  // [x y z, qw qx qy qz] -> [qw qx qy qz, x y z]
      if (is_free) {
        const Eigen::VectorXd q = state.q.segment(at, 7);
        state.q.segment(at, 4) = q.tail(4);
        state.q.segment(at + 4, 3) = q.head(3);
      }
      at += is_free ? 7 : 1;
    }
    model.states.push_back(std::move(state));
  }
  return model;
}

std::vector<std::filesystem::path> models_in(const std::filesystem::path& folder) {
  if (!std::filesystem::is_directory(folder)) return {folder};
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".json") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

BenchModel flexible_chain(int n, int m) {
  std::mt19937_64 rng(static_cast<std::uint64_t>(1000 * n + m));
  const auto random = [&] { return -1.0 + 2.0 * static_cast<double>(rng() >> 11) * 0x1.0p-53; };
  const auto shapes = [&](double size) { return Eigen::MatrixXd(Eigen::MatrixXd::NullaryExpr(3, m, [&] { return size * random(); })); };
  BenchModel model;
  model.name = "flexible_chain_" + std::to_string(n) + "_modes_" + std::to_string(m);
  model.spec.name = model.name;
  model.spec.gravity.kind = GravitySpec::Kind::uniform;
  model.spec.gravity.g = {0, 0, -9.81};
  for (int k = 0; k < n; ++k) {
    auto data = std::make_shared<ModalData>();
    data->n_modes = m;
    ModalIntegrals& I = data->integrals;
    I.I1 = 10.0 + random();
    I.I2 = I.I1 * Eigen::Vector3d(0.5, 0.1 * random(), 0.1 * random());
    I.I3 = shapes(0.1);
    I.I4 = shapes(0.1);
    I.I5.assign(static_cast<std::size_t>(m), Eigen::MatrixXd::Zero(3, m));
    I.I6 = Eigen::MatrixXd::Identity(m, m);
    I.I7 = (Eigen::Vector3d(2.0, 6.0, 7.0) * (1.0 + 0.1 * random())).asDiagonal();
    I.I8.assign(static_cast<std::size_t>(m), Eigen::Matrix3d::Zero());
    Eigen::VectorXd w2(m), damping(m);
    for (int i = 0; i < m; ++i) {
      w2[i] = std::pow(5.0 * (i + 1), 2);
      damping[i] = 0.01 * std::sqrt(w2[i]);
    }
    data->K = w2.asDiagonal();
    data->C = damping.asDiagonal();
    data->nodes.push_back({"tip", {1.0, 0, 0}, Eigen::Matrix3d::Identity(), shapes(0.3), shapes(0.3)});
    BodySpec body;
    body.name = "b" + std::to_string(k);
    body.type = "modal_flexible";
    body.modal = data;
    body.level = 0;
    body.hinge.type = "revolute";
    if (k > 0) {
      body.hinge.inboard_body = "b" + std::to_string(k - 1);
      body.hinge.inboard_node = "tip";
    }
    std::vector<double> axis(3, 0.0);
    axis[static_cast<std::size_t>(k % 3)] = 1.0;
    body.hinge.params["axis"] = numbers(axis);
    model.spec.bodies.push_back(std::move(body));
  }
  for (int s = 0; s < 16; ++s) {
    const int size = n * (1 + m);
    const auto vector = [&](double hinge, double mode) {
      Eigen::VectorXd x(size);
      for (int i = 0; i < size; ++i) x[i] = (i % (1 + m) == 0 ? hinge : mode) * random();
      return x;
    };
    model.states.push_back({vector(1.0, 0.01), vector(1.0, 0.1), vector(1.0, 1.0), vector(1.0, 1.0)});
  }
  return model;
}

}  // namespace cardan::bench
