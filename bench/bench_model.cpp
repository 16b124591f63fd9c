#include "bench/bench_model.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>

#include "bodies/modal/modal_integrals.hpp"
#include "bodies/modal/modal_source.hpp"
#include "bodies/vehicle/load_vehicle.hpp"
#include "core/linalg/dense.hpp"
#include "core/model/model.hpp"

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
    refuse(Code::bad_result_file, {"schema", {file.string(), 0, 0}}, "\"cardan-bench/1\"", j.value("schema", "nothing"));
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
    if (body.inertia_com.isZero(0.0)) body.type = "particle";
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

namespace {

/// A free-flying rigid hub with n flexible bodies of m modes, every other one of which turns about its length.
BenchModel hub_with(const std::string& name, int n, int m, int level, std::mt19937_64& rng,
                    const std::function<std::shared_ptr<const ModalData>()>& modes) {
  const auto random = [&] { return -1.0 + 2.0 * static_cast<double>(rng() >> 11) * 0x1.0p-53; };
  const auto tilde = [](const Eigen::Vector3d& a) {
    Eigen::Matrix3d out;
    out << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
    return out;
  };
  BenchModel model;
  model.name = fmt::format("{}_{}x{}{}", name, n, m, level > 0 ? "_level_" + std::to_string(level) : "");
  model.spec.name = model.name;
  BodySpec hub;
  hub.name = "hub";
  hub.mass = 500.0;
  hub.com = {0.02, -0.01, 0.1};
  hub.inertia_com = Eigen::Vector3d(300.0, 280.0, 250.0).asDiagonal();
  hub.hinge.type = "free";
  model.spec.bodies.push_back(hub);
  for (int k = 0; k < n; ++k) {
    BodySpec body;
    body.name = "a" + std::to_string(k);
    body.type = "modal_flexible";
    body.modal = modes();
    body.level = level;
    body.hinge.inboard_body = "hub";
    const double angle = 2.0 * M_PI * k / n;
    body.hinge.onode_position = {std::cos(angle), std::sin(angle), 0.1 * k};
    body.hinge.onode_R =
        Eigen::Matrix3d::Identity() + std::sin(angle) * tilde({0, 0, 1}) + (1 - std::cos(angle)) * tilde({0, 0, 1}) * tilde({0, 0, 1});
    if (k % 2 == 1) {  // every other one turns about its length
      body.hinge.type = "revolute";
      body.hinge.params["axis"] = numbers({1.0, 0.0, 0.0});
    }
    model.spec.bodies.push_back(std::move(body));
  }
  for (int s = 0; s < 16; ++s) {
    std::vector<double> q, v;
    const auto more = [&](int count, double size, std::vector<double>& x) {
      for (int i = 0; i < count; ++i) x.push_back(size * random());
    };
    more(7, 1.0, q);
    Eigen::Map<Eigen::Vector4d>(q.data()).normalize();
    more(6, 0.3, v);
    for (int k = 0; k < n; ++k) {
      more(k % 2, 1.0, q), more(m, 0.01, q);
      more(k % 2, 0.3, v), more(m, 0.1, v);
    }
    const auto size = static_cast<Eigen::Index>(v.size());
    const auto any = [&] { return Eigen::VectorXd(Eigen::VectorXd::NullaryExpr(size, [&] { return random(); })); };
    model.states.push_back({Eigen::Map<Eigen::VectorXd>(q.data(), static_cast<Eigen::Index>(q.size())),
                            Eigen::Map<Eigen::VectorXd>(v.data(), size), any(), any()});
  }
  return model;
}

}  // namespace

BenchModel hub_appendages(int n, int m, int level) {
  std::mt19937_64 rng(static_cast<std::uint64_t>(1000 * n + m));
  const auto random = [&] { return -1.0 + 2.0 * static_cast<double>(rng() >> 11) * 0x1.0p-53; };
  return hub_with("hub", n, m, level, rng, [&] {
    // Lumped masses along x, and as their modes any set of shapes that is orthonormal in these masses.
    const int lumps = m + 4;
    Eigen::MatrixXd shapes(3 * lumps, m);
    for (double& x : shapes.reshaped()) x = random();
    for (int j = 0; j < lumps; ++j) shapes.middleRows<3>(3 * j) *= std::pow((j + 1.0) / lumps, 2);
    const double lump = 20.0 / lumps;
    shapes = thin_qr(shapes).Q / std::sqrt(lump);
    MassField field;
    field.mass.setConstant(lumps, lump);
    field.position.setZero(3, lumps);
    for (int j = 0; j < lumps; ++j) field.position.col(j) = Eigen::Vector3d(5.0 * (j + 1) / lumps, 0.1 * random(), 0.1 * random());
    for (int a = 0; a < 3; ++a) field.Phi[a] = shapes(Eigen::seqN(a, lumps, 3), Eigen::all);
    auto data = std::make_shared<ModalData>();
    data->n_modes = m;
    data->integrals = modal_integrals(field);
    data->integrals.I6.setIdentity();
    Eigen::VectorXd w2(m), damping(m);
    for (int i = 0; i < m; ++i) {
      w2[i] = std::pow(2.0 * (i + 1), 2);
      damping[i] = 0.01 * std::sqrt(w2[i]);
    }
    data->K = w2.asDiagonal();
    data->C = damping.asDiagonal();
    return data;
  });
}

BenchModel hub_wings(int m, int level) {
  ModalSource source;  // that of scenarios/01_flexible_slew
  PlateModel wing;
  wing.length = 10.0, wing.width = 2.4;
  wing.panel = SandwichPanel{{110e9, 0.3, 1600.0}, 2e-4, 0.02, 32.0, 1.2};
  wing.elements_x = 40, wing.elements_y = 10;
  wing.yoke = {2.0, 1.8, {110e9, 0.3, 1600.0}, tube_section(0.03, 0.0015)};
  source.model = wing;
  source.modes.count = m;
  const auto data = std::make_shared<const ModalData>(make_modal_data(source));
  std::mt19937_64 rng(static_cast<std::uint64_t>(m));
  return hub_with("wings", 2, m, level, rng, [&] { return data; });
}

BenchModel vehicle_model(const std::string& name, const std::filesystem::path& vehicle, const Registry& registry) {
  const std::shared_ptr<const SystemSpec> spec = load_vehicle(vehicle.string(), registry);
  const auto model = compile(spec, registry);
  std::mt19937_64 rng(7);
  const auto random = [&] { return -1.0 + 2.0 * static_cast<double>(rng() >> 11) * 0x1.0p-53; };
  BenchModel out{name, *spec, {}};
  for (int s = 0; s < 16; ++s) {
    const auto any = [&](double hinge, double mode) {
      Eigen::VectorXd x(model->nv);
      for (double& e : x) e = hinge * random();
      for (const UserBody& u : model->user)
        for (int j = u.etadot; j < u.etadot + u.n_modes; ++j) x[j] *= mode / hinge;
      return x;
    };
    const Eigen::VectorXd u = any(1.0, 0.01);
    BenchState at{Eigen::VectorXd(model->nq), any(0.3, 0.1), any(1.0, 1.0), any(1.0, 1.0)};
    model->retract(model->initial_state().q.data(), u.data(), at.q.data());
    out.states.push_back(std::move(at));
  }
  return out;
}

}  // namespace cardan::bench
