#pragma once
// What a program that measures another library needs: the models and the exact results as data, the map from the velocities
// of the models to those of the peer, and the main program. Nothing of Cardan but the stopwatch.

#include <CLI/CLI.hpp>
#include <Eigen/Dense>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <iostream>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "bench/time_ring.hpp"

namespace peer {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// As in tests/reference/bench/README.md. All quantities in body axes but R and p, which place the body in its parent at q = 0.
struct Body {
  int parent;  // -1: inertial frame
  bool free;   // else revolute about coordinate axis `axis`
  int axis;
  Eigen::Matrix3d R;
  Eigen::Vector3d p;
  double mass;
  Eigen::Vector3d com;
  Eigen::Matrix3d inertia;  // about com
  int q, v;                 // its first coordinate and velocity in the state
};

struct State {
  Eigen::VectorXd q, v, tau, vdot;
};

struct Model {
  std::string name;
  Eigen::Vector3d gravity;
  int nq, nv;
  std::vector<Body> bodies;
  std::vector<State> states;

  bool has_free_root() const { return bodies[0].free; }
  /// The bodies that carry no other, and of them the first at the end of the longest path: nodes that analyses look at, at their origins.
  std::vector<int> ends() const {
    std::vector<int> list;
    for (int i = 0; i < static_cast<int>(bodies.size()); ++i)
      if (std::none_of(bodies.begin(), bodies.end(), [&](const Body& b) { return b.parent == i; })) list.push_back(i);
    return list;
  }
  int hand() const {
    const auto depth = [&](int i) {
      int d = 0;
      for (; i >= 0; i = bodies[static_cast<std::size_t>(i)].parent) ++d;
      return d;
    };
    const std::vector<int> list = ends();
    return *std::max_element(list.begin(), list.end(), [&](int a, int b) { return depth(a) < depth(b); });
  }
  bool is_serial() const {
    for (std::size_t i = 0; i < bodies.size(); ++i)
      if (bodies[i].parent != static_cast<int>(i) - 1) return false;
    return true;
  }
};

/// Thrown where a peer cannot represent a model.
struct Refused : std::runtime_error {
  using std::runtime_error::runtime_error;
};

inline Eigen::VectorXd to_vector(const nlohmann::json& j) {
  const auto x = j.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(x.data(), static_cast<Eigen::Index>(x.size()));
}
inline Eigen::Matrix3d to_matrix(const nlohmann::json& j) {
  const Eigen::VectorXd x = to_vector(j);
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(x.data());
}

inline Model read_model(const std::string& file) {
  nlohmann::json j;
  std::ifstream(file) >> j;
  if (j.value("schema", "") != "cardan-bench/1") throw std::runtime_error(file + " is not of the schema cardan-bench/1");
  const std::string name = file.substr(file.find_last_of('/') + 1);
  Model m{name.substr(0, name.rfind('.')), to_vector(j["gravity"]), 0, 0, {}, {}};
  for (const auto& b : j["bodies"]) {
    const bool free = b["hinge"] == "free";
    const Body body{b["parent"],
                    free,
                    free ? -1 : b["axis"].get<int>(),
                    to_matrix(b["R_parent"]),
                    to_vector(b["p_parent"]),
                    b["mass"],
                    to_vector(b["com"]),
                    to_matrix(b["inertia_com"]),
                    m.nq,
                    m.nv};
    if (free && !(m.bodies.empty() && body.R.isIdentity(0) && body.p.isZero(0)))
      throw Refused("free hinges only of the first body and in the inertial frame");
    m.bodies.push_back(body);
    m.nq += free ? 7 : 1;
    m.nv += free ? 6 : 1;
  }
  for (const auto& s : j["states"]) m.states.push_back({to_vector(s["q"]), to_vector(s["v"]), to_vector(s["tau"]), to_vector(s["vdot"])});
  return m;
}

/// The free root of a state: rotation body to inertial axes, angular and linear velocity in body axes.
struct Root {
  Eigen::Matrix3d R;
  Eigen::Vector3d position, omega, velocity;
  explicit Root(const State& s)
      : R(Eigen::Quaterniond(s.q[3], s.q[4], s.q[5], s.q[6]).toRotationMatrix()),
        position(s.q.head<3>()),
        omega(s.v.head<3>()),
        velocity(s.v.segment<3>(3)) {}
};

inline Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& a) {
  return (Eigen::Matrix3d() << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0).finished();
}

/// How the peer writes the velocity of a free root: its v = T v, its v' = T v' + b.
struct RootMap {
  Matrix6d T = Matrix6d::Identity();
  Vector6d b = Vector6d::Zero();
};
/// The same of any root: T is a constant and what is linear in R, b is linear in each of R, omega and velocity.
using RootConvention = RootMap (*)(const Root&);

/// The same for all velocities of one state: hinges permuted, the root by RootMap.
struct Velocities {
  std::vector<int> offset;
  Eigen::SparseMatrix<double> T, inverse;
  Eigen::VectorXd b;

  /// offset[i]: where the peer keeps the (first) velocity of body i.
  Velocities(const Model& m, const std::vector<int>& at, const RootMap& root = {}) : offset(at), T(m.nv, m.nv), inverse(m.nv, m.nv) {
    b.setZero(m.nv);
    std::vector<Eigen::Triplet<double>> forth, back;
    const Matrix6d root_inverse = root.T.inverse();
    for (std::size_t i = 0; i < m.bodies.size(); ++i) {
      const int ours = m.bodies[i].v, theirs = offset[i];
      if (!m.bodies[i].free) {
        forth.emplace_back(theirs, ours, 1.0);
        back.emplace_back(ours, theirs, 1.0);
        continue;
      }
      b.segment<6>(theirs) = root.b;
      for (int r = 0; r < 6; ++r)
        for (int c = 0; c < 6; ++c) {
          if (root.T(r, c) != 0.0) forth.emplace_back(theirs + r, ours + c, root.T(r, c));
          if (root_inverse(r, c) != 0.0) back.emplace_back(ours + r, theirs + c, root_inverse(r, c));
        }
    }
    T.setFromTriplets(forth.begin(), forth.end());
    inverse.setFromTriplets(back.begin(), back.end());
  }

  // To the peer.
  Eigen::VectorXd velocity(const Eigen::VectorXd& v) const { return T * v; }
  Eigen::VectorXd acceleration(const Eigen::VectorXd& vdot) const { return T * vdot + b; }
  Eigen::VectorXd force(const Eigen::VectorXd& tau) const { return inverse.transpose() * tau; }
  // From the peer.
  Eigen::VectorXd our_acceleration(const Eigen::VectorXd& a) const { return inverse * (a - b); }
  Eigen::VectorXd our_force(const Eigen::VectorXd& f) const { return T.transpose() * f; }
  /// M x and M^-1 x from the peer's matrices.
  Eigen::VectorXd mass_times(const Eigen::MatrixXd& M, const Eigen::VectorXd& x) const { return our_force(M * velocity(x)); }
  Eigen::VectorXd inverse_mass_times(const Eigen::MatrixXd& Minv, const Eigen::VectorXd& x) const { return inverse * (Minv * force(x)); }
};

/// dv'/dq, dv'/dv and dv'/dtau side by side, from what the peer says of its own a = v' with its own velocities and forces (and q along its
/// own velocities): all at one state, where a is its v'.
inline Eigen::VectorXd our_derivatives(const Model& m, const State& s, const Velocities& map, RootConvention convention,
                                       const Eigen::VectorXd& a, const Eigen::MatrixXd& a_q, const Eigen::MatrixXd& a_v,
                                       const Eigen::MatrixXd& a_tau) {
  const Eigen::MatrixXd T = map.T, inverse = map.inverse;
  const Eigen::VectorXd vdot = map.our_acceleration(a), force = map.force(s.tau);
  Eigen::MatrixXd of_q = a_q * T, of_v = a_v * T;
  for (int j = 0; m.has_free_root() && j < 6; ++j) {
    const Root root(s);
    const Eigen::Vector3d unit = Eigen::Vector3d::Unit(j % 3);
    Root rate = root;  // as v moves along component j
    (j < 3 ? rate.omega : rate.velocity) = unit;
    of_v.col(j) -= Velocities(m, map.offset, convention(rate)).b;
    if (j >= 3) continue;
    Root turn = root;  // as the root turns about its own axis j
    turn.R = root.R * cross_matrix(unit);
    Root none = root;
    none.R.setZero();
    const Velocities turned(m, map.offset, convention(turn)), constant(m, map.offset, convention(none));
    const Eigen::MatrixXd dT = Eigen::MatrixXd(turned.T) - Eigen::MatrixXd(constant.T);
    of_q.col(j) += a_v * (dT * s.v) - a_tau * (inverse.transpose() * (dT.transpose() * force)) - dT * vdot - turned.b;
  }
  Eigen::MatrixXd all(m.nv, 3 * m.nv);
  all << inverse * of_q, inverse * of_v, inverse * a_tau * inverse.transpose();
  return all.reshaped();
}

/// A 6s x 6s matrix of nodes, [angular; linear] in world axes, in the axes of the nodes, which R has.
inline Eigen::VectorXd in_node_axes(const Eigen::MatrixXd& C, const std::vector<Eigen::Matrix3d>& R) {
  Eigen::MatrixXd turn = Eigen::MatrixXd::Zero(C.rows(), C.cols());
  for (std::size_t a = 0; a < R.size(); ++a)
    for (int part = 0; part < 2; ++part) {
      const auto at = static_cast<Eigen::Index>(6 * a + 3 * static_cast<std::size_t>(part));
      turn.block<3, 3>(at, at) = R[a];
    }
  return Eigen::MatrixXd(turn.transpose() * C * turn).reshaped();
}

/// One way to compute something. `run(k)` is what is timed: it puts state k into the peer and calls it. `result(k)` follows
/// run(k): what came out, in the convention of the model: v', tau, M(q) v' of the state, or M(q)^-1 tau of the state.
struct Call {
  std::string op;  // forward_dynamics, inverse_dynamics, mass_matrix, mass_matrix_inverse; or an analysis
  std::string name;
  std::function<void(int)> run;
  std::function<Eigen::VectorXd(int)> result;
};

/// A library with a model in it. Its constructor makes the system (and may throw Refused); calls() converts the states.
/// The first call is forward dynamics.
struct Peer {
  virtual ~Peer() = default;
  virtual std::vector<Call> calls() = 0;
  /// What it offers of node_compliance (of Model::ends(), 6 rows each), operational_inertia (of Model::hand()) and forward_derivatives; the
  /// matrices one column after the other, as cardan-bench-analyses has them. After calls().
  virtual std::vector<Call> analyses() { return {}; }
};

/// Largest relative error (2-norm) over the states whose results are known; infinite where it is not a number.
inline double forward_error(const Call& call, const nlohmann::json& exact) {
  const char* key = call.op == "forward_dynamics"      ? "vdot"
                    : call.op == "inverse_dynamics"    ? "tau"
                    : call.op == "mass_matrix"         ? "M_vdot"
                    : call.op == "mass_matrix_inverse" ? "Minv_tau"
                                                       : call.op.c_str();
  double error = 0.0;
  for (int k = 0; k < static_cast<int>(exact.size()); ++k) {
    const Eigen::VectorXd truth = to_vector(exact[static_cast<std::size_t>(k)][key]);
    call.run(k);
    const double e = (call.result(k) - truth).stableNorm() / truth.stableNorm();
    error = std::isfinite(e) ? std::max(error, e) : std::numeric_limits<double>::infinity();
  }
  return error;
}

/// The main program: --model FILE [--exact FILE] [--op OP] [--analyses] [--seconds S] --out FILE.json, rows as those of cardan-bench and
/// the name of the call.
inline int run(int argc, char** argv, const std::string& program, const std::string& version,
               const std::function<std::unique_ptr<Peer>(const Model&)>& make) {
  CLI::App app("Times " + program + " on a model in the schema cardan-bench/1.");
  std::string file, exact_file, only, out;
  double seconds = 0.3;
  app.add_option("--model", file, "the model")->required();
  bool analyses = false;
  app.add_option("--exact", exact_file,
                 "its exact results, written by cardan-bench --exact; of analyses, by cardan-bench-analyses --exact");
  app.add_flag("--analyses", analyses, "what is offered of analyses, in place of dynamics");
  app.add_option("--op", only, "only this operation");
  app.add_option("--seconds", seconds, "time spent on each figure");
  app.add_option("--out", out, "write the rows as JSON")->required();
  CLI11_PARSE(app, argc, argv);

  const nlohmann::json head{{"program", program}, {"version", version}, {"build", PEER_BUILD}};
  nlohmann::json rows = nlohmann::json::array();
  const auto add = [&](nlohmann::json row) {
    row.update(head);
    rows.push_back(row);
  };
  try {
    const Model m = read_model(file);
    nlohmann::json exact = nlohmann::json::array();
    if (!exact_file.empty()) std::ifstream(exact_file) >> exact;
    const int states = static_cast<int>(m.states.size());
    const double bodies = static_cast<double>(m.bodies.size());
    double bytes = -cardan::bench::heap_bytes();
    const std::unique_ptr<Peer> peer = make(m);
    bytes += cardan::bench::heap_bytes();
    std::vector<Call> calls = peer->calls();
    bytes -= cardan::bench::heap_bytes();
    calls[0].run(0);
    bytes += cardan::bench::heap_bytes();
    if (analyses) calls = peer->analyses();
    for (const Call& call : calls) {
      if (!only.empty() && call.op != only) continue;
      nlohmann::json row{{"model", m.name}, {"op", call.op}, {"call", call.name}, {"bodies", m.bodies.size()}};
      row["forward_error"] = nullptr;
      if (!exact.empty()) {
        const double error = forward_error(call, exact);
        if (std::isfinite(error))
          row["forward_error"] = error;
        else
          row["reason"] = "fails";
      }
      const cardan::bench::Timing t = cardan::bench::time_ring(states, seconds, call.run);
      row["ns_min"] = t.min_ns;
      row["ns_median"] = t.median_ns;
      row["bytes_per_body"] = bytes / bodies;
      add(row);
    }
  } catch (const Refused& e) {
    add({{"model", file.substr(file.find_last_of('/') + 1, file.rfind('.') - file.find_last_of('/') - 1)}, {"reason", e.what()}});
  } catch (const std::exception& e) {
    std::cerr << program << ": " << file << ": " << e.what() << "\n";
    return 2;
  }
  std::ofstream(out) << rows.dump(1) << "\n";
  return 0;
}

}  // namespace peer
