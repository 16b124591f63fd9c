#include "tests/support/bench_loops.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/model/validate.hpp"

namespace cardan::bench_loops {

namespace {
using nlohmann::json;

template <class T>
T number(const json& j) {
  if (j.is_number()) return j.get<T>();
  return static_cast<T>(std::stod(j.get<std::string>()));
}
Eigen::VectorXd vector(const json& j) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(j.size()));
  for (std::size_t i = 0; i < j.size(); ++i) out[static_cast<Eigen::Index>(i)] = number<double>(j[i]);
  return out;
}
Eigen::Matrix3d matrix(const json& j) {
  const Eigen::VectorXd x = vector(j);
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(x.data());
}
/// Typed with a finite number of digits: the nearest rotation.
Eigen::Matrix3d rotation(const json& j) {
  const Eigen::Matrix3d R = matrix(j);
  return Eigen::Quaterniond(R).normalized().toRotationMatrix().isApprox(R, 1e-15) ? R
                                                                                  : Eigen::Quaterniond(R).normalized().toRotationMatrix();
}
/// A product of sines and cosines is a sum of them: 2 cos a cos b = cos(a - b) + cos(a + b).
void add_product(const json& term, const std::vector<std::string>& rate_of, LoopSpec& loop) {
  struct Cosine {
    double amplitude, phase;
    std::map<std::string, double> of;
  };
  constexpr double kQuarter = std::numbers::pi / 2.0;
  std::vector<Cosine> sum{{number<double>(term["coef"]), 0.0, {}}};
  bool first = true;
  for (const json& f : term["factors"]) {
    Cosine factor{1.0, number<double>(f["offset"]) - (f["f"] == "sin" ? kQuarter : 0.0), {}};
    for (const json& a : f["arg"]) factor.of[rate_of[a[0].get<std::size_t>()]] = number<double>(a[1]);
    std::vector<Cosine> next;
    for (const Cosine& c : sum)
      for (const double sign : {-1.0, 1.0}) {
        if (first && sign < 0.0) continue;
        Cosine both{first ? c.amplitude : 0.5 * c.amplitude, c.phase + sign * factor.phase, c.of};
        for (const auto& [name, a] : factor.of) both.of[name] += sign * a;
        next.push_back(both);
      }
    sum = std::move(next), first = false;
  }
  for (Cosine& c : sum) {  // quarters of a turn say sine or cosine, and are no rounded numbers then
    LoopSpec::Function out;
    const double quarters = std::round(c.phase / kQuarter), rest = c.phase - quarters * kQuarter;
    const int turns = ((static_cast<int>(quarters) % 4) + 4) % 4;
    out.kind = turns % 2 == 0 ? "cosine" : "sine";
    out.phase = std::abs(rest) < 1e-12 ? 0.0 : rest;
    out.numbers = {turns == 0 || turns == 3 ? c.amplitude : -c.amplitude};
    for (const auto& [name, a] : c.of)
      if (a != 0.0) out.of.push_back({name, a, {}});
    loop.functions.push_back(std::move(out));
  }
}
}  // namespace

Model read(const std::filesystem::path& file) {
  Model m;
  json j;
  std::ifstream(file) >> j;
  m.name = j["name"];
  m.spec.name = m.name;
  m.spec.gravity.kind = GravitySpec::Kind::uniform;
  m.spec.gravity.g = vector(j["gravity"]);
  std::vector<std::string> rate_of;  // name of the body per velocity index
  for (const auto& b : j["bodies"]) {
    BodySpec body;
    body.name = b["name"];
    body.mass = number<double>(b["mass"]);
    body.com = vector(b["com"]);
    body.inertia_com = matrix(b["inertia_com"]);
    // Some tensors are of no body, some rotors have no mass: what is no body is not looked at as one.
    if (!inertia_fault(body.inertia_com, false).expected.empty()) body.type = "particle";
    if (body.mass == 0.0) body.mass = 1e-30;
    const int parent = b["parent"].get<int>();
    if (parent >= 0) body.hinge.inboard_body = m.spec.bodies[static_cast<std::size_t>(parent)].name;
    const std::string type = b["hinge"];
    body.hinge.type = type == "free" ? "free_body" : type;
    if (b.contains("axis")) {
      const Eigen::VectorXd axis = vector(b["axis"]);
      body.hinge.params["axis"].value = std::vector<double>(axis.begin(), axis.end());
    }
    body.hinge.onode_R = rotation(b["R_parent"]);
    body.hinge.onode_position = vector(b["p_parent"]);
    const int nv = type == "free" ? 6 : type == "ball" ? 3 : 1;
    for (int i = 0; i < nv; ++i) rate_of.push_back(body.name);
    m.spec.bodies.push_back(std::move(body));
  }
  const auto place = [&](const json& end) {
    PlaceSpec out;
    const int body = end["body"].get<int>();
    if (body >= 0) out.body = m.spec.bodies[static_cast<std::size_t>(body)].name;
    out.position = vector(end["p"]);
    if (end.contains("R")) out.R = rotation(end["R"]);
    return out;
  };
  if (j.contains("loops"))
    for (const auto& l : j["loops"]) {
      LoopSpec loop;
      loop.name = "loop " + std::to_string(m.spec.loops.size());
      loop.type = l["type"] == "slider" ? "line" : l["type"].get<std::string>();
      loop.from = place(l["A"]), loop.to = place(l["B"]);
      if (loop.type == "revolute") loop.params["axis"].value = std::vector<double>{0.0, 0.0, 1.0};
      if (loop.type == "distance") loop.length = number<double>(l["length"]);
      m.spec.loops.push_back(std::move(loop));
    }
  if (j.contains("couplings"))
    for (const auto& c : j["couplings"]) {
      LoopSpec loop;
      loop.name = "coupling " + std::to_string(m.spec.loops.size());
      loop.type = "coupling";
      for (const auto& term : c["terms"]) loop.terms.push_back({rate_of[term[0].get<std::size_t>()], number<double>(term[1]), {}});
      if (c.contains("offset")) loop.offset = number<double>(c["offset"]);
      m.spec.loops.push_back(std::move(loop));
    }
  if (j.contains("functions"))
    for (const auto& f : j["functions"]) {
      LoopSpec loop;
      loop.name = "function " + std::to_string(m.spec.loops.size());
      loop.type = "coupling";
      loop.offset = -number<double>(f["constant"]);
      for (const auto& term : f["terms"]) add_product(term, rate_of, loop);
      m.spec.loops.push_back(std::move(loop));
    }
  m.rank = j["rank"].get<int>(), m.mobility = j["mobility"].get<int>();
  m.independent = j["independent"].get<std::vector<int>>();
  if (j.contains("springs"))
    for (const auto& s : j["springs"]) m.springs.push_back({place(s["A"]), place(s["B"])});
  for (const auto& s : j["states"]) {
    State state;
    state.q = vector(s["q"]), state.v = vector(s["v"]);
    state.tau = vector(s.contains("tau_with_springs") ? s["tau_with_springs"] : s["tau"]);
    state.vdot = vector(s["vdot"]), state.lambda = vector(s["lambda"]), state.force = vector(s["constraint_force"]);
    state.floor = number<double>(s["floor_vdot"]), state.log_det = number<double>(s["logdet_M_reduced"]);
    Eigen::Index q = 0;
    for (const auto& b : j["bodies"]) {
      if (b["hinge"] == "free") {  // theirs: [position; quaternion]
        const Eigen::Vector3d x = state.q.segment<3>(q);
        const Eigen::Vector4d attitude = state.q.segment<4>(q + 3);
        state.q.segment<4>(q) = attitude.normalized(), state.q.segment<3>(q + 4) = x;
        q += 7;
      } else if (b["hinge"] == "ball") {
        state.q.segment<4>(q).normalize();
        q += 4;
      } else {
        ++q;
      }
    }
    m.states.push_back(std::move(state));
  }
  Eigen::Index q = 0, v = 0;
  for (BodySpec& body : m.spec.bodies) {
    const bool free = body.hinge.type == "free_body", ball = body.hinge.type == "ball";
    const Eigen::Index nq = free ? 7 : ball ? 4 : 1, nv = free ? 6 : ball ? 3 : 1;
    const State& start = m.states[0];
    body.hinge.q.assign(start.q.data() + q, start.q.data() + q + nq);
    body.hinge.v.assign(start.v.data() + v, start.v.data() + v + nv);
    q += nq, v += nv;
  }
  return m;
}

std::vector<std::filesystem::path> files() {
  std::vector<std::filesystem::path> out;
  for (const auto& entry : std::filesystem::directory_iterator(CARDAN_SOURCE_DIR "/tests/reference/bench_loops"))
    if (entry.path().extension() == ".json") out.push_back(entry.path());
  std::sort(out.begin(), out.end());
  return out;
}

}  // namespace cardan::bench_loops
