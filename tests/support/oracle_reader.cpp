#include "tests/support/oracle_reader.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <map>

#include "bodies/modal/lumped.hpp"

namespace cardan::oracle {
namespace {
using nlohmann::json;

Eigen::Matrix3d rotation(const json& frame) {
  if (!frame.contains("rotvec")) return Eigen::Matrix3d::Identity();
  const Eigen::Vector3d t = vector<double>(frame["rotvec"]);
  return t.norm() == 0.0 ? Eigen::Matrix3d::Identity() : Eigen::AngleAxisd(t.norm(), t.normalized()).toRotationMatrix();
}

Eigen::MatrixXd shapes(const json& node, const char* key, int n_modes) {
  return node.contains(key) ? matrix<double>(node[key]) : Eigen::MatrixXd::Zero(3, n_modes);
}

MassNode mass_node(const json& j, int n_modes) {
  MassNode out;
  out.mass = number<double>(j["mass"]);
  out.position = vector<double>(j["pos"]);
  if (j.contains("inertia")) out.inertia = matrix<double>(j["inertia"]);
  out.Phi = shapes(j, "Phi", n_modes);
  out.Psi = shapes(j, "Psi", n_modes);
  if (j.contains("Q"))
    for (const json& q : j["Q"]) out.Q.push_back(matrix<double>(q));
  return out;
}

/// Modal data under construction: BodySpec holds a const one.
struct BodyRead {
  BodySpec body;
  std::shared_ptr<ModalData> modal;

  void add_node(const std::string& name, const json& j) {
    if (modal)
      modal->nodes.push_back(
          {name, vector<double>(j["pos"]), rotation(j), shapes(j, "Phi", modal->n_modes), shapes(j, "Psi", modal->n_modes)});
    else
      body.nodes.push_back({name, vector<double>(j["pos"]), rotation(j), {}});
  }
};

/// Mass, mass centre and inertia of rigidly joined mass nodes.
void set_rigid(BodySpec& body, const std::vector<MassNode>& nodes) {
  for (const MassNode& n : nodes) {
    body.mass += n.mass;
    body.com += n.mass * n.position;
  }
  body.com /= body.mass;
  for (const MassNode& n : nodes) {
    const Eigen::Vector3d r = n.position - body.com;
    body.inertia_com += n.inertia + n.mass * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
  }
}

BodyRead read_body(const json& j) {
  BodyRead out;
  out.body.name = j.value("name", "b1");
  const int m = j["nmodes"].get<int>();
  std::vector<MassNode> nodes;
  for (const json& n : j["nodes"]) nodes.push_back(mass_node(n, m));
  if (m == 0) {
    set_rigid(out.body, nodes);
    return out;
  }
  // The files with a single body have no stiffness: any regular one does there.
  const Eigen::MatrixXd K = j.contains("K") ? matrix<double>(j["K"]) : Eigen::MatrixXd::Identity(m, m);
  const Eigen::MatrixXd C = j.contains("C") ? matrix<double>(j["C"]) : Eigen::MatrixXd();
  out.modal = std::make_shared<ModalData>(lumped_modal_data(std::move(nodes), K, C, {}));
  out.body.type = "modal_flexible";
  out.body.level = 2;
  out.body.rotary_tolerance = 0.0;
  return out;
}

ParamValues hinge_params(const json& hinge) {
  ParamValues out;
  for (const auto& [key, value] : hinge.items()) {
    if (key == "type") continue;
    if (key == "axes") {
      std::vector<double> flat;
      for (const json& axis : value)
        for (const json& x : axis) flat.push_back(number<double>(x));
      out[value.size() == 1 ? "axis" : "axes"].value = flat;
    } else {
      out[key].value = number<double>(value);
    }
  }
  return out;
}

int hinge_nq(const std::string& type) {
  static const std::map<std::string, int> sizes = {{"locked", 0}, {"cylindrical", 2}, {"universal", 2},     {"gimbal", 3},   {"ball", 4},
                                                   {"planar", 3}, {"free", 7},        {"translational", 3}, {"free_body", 7}};
  const auto it = sizes.find(type);
  return it == sizes.end() ? 1 : it->second;
}
int hinge_nv(const std::string& type) {
  const int nq = hinge_nq(type);
  return nq == 4 || nq == 7 ? nq - 1 : nq;
}

std::vector<double> slice(const Eigen::VectorXd& x, int from, int n) { return {x.data() + from, x.data() + from + n}; }

void set_initial_state(Case& c) {
  int iq = 0, iv = 0;
  for (BodySpec& b : c.spec.bodies) {
    const int nq = hinge_nq(b.hinge.type), nv = hinge_nv(b.hinge.type), m = b.modal ? b.modal->n_modes : 0;
    b.hinge.q = slice(c.q, iq, nq);
    b.hinge.v = slice(c.v, iv, nv);
    b.eta = slice(c.q, iq + nq, m);
    b.etadot = slice(c.v, iv + nv, m);
    iq += nq + m;
    iv += nv + m;
  }
}

void read_single_body(Case& c) {
  BodyRead draft = read_body(c.json);
  draft.body.hinge.type = "free_body";
  draft.body.modal = draft.modal;
  c.spec.bodies.push_back(draft.body);
  const json& state = c.json["state"];
  const Eigen::VectorXd eta = vector<double>(state["eta"]), etadot = vector<double>(state["etadot"]);
  c.q = Eigen::VectorXd::Zero(7 + eta.size());
  c.q[0] = 1.0;
  c.q.tail(eta.size()) = eta;
  c.v.resize(6 + eta.size());
  c.v << vector<double>(state["V"]), etadot;
}

void read_system(Case& c) {
  const json& model = c.json["model"];
  c.spec.gravity.kind = GravitySpec::Kind::uniform;
  c.spec.gravity.g = vector<double>(model["gravity"]);
  std::vector<BodyRead> drafts;
  for (const json& j : model["bodies"]) {
    BodyRead draft = read_body(j);
    HingeSpec& hinge = draft.body.hinge;
    hinge.type = j["hinge"]["type"];
    hinge.params = hinge_params(j["hinge"]);
    hinge.body_node = "pnode";
    draft.add_node("pnode", j["pnode"]);
    const int parent = j["parent"].get<int>();
    if (parent == 0) {
      hinge.onode_position = vector<double>(j["attach"]["pos"]);
      hinge.onode_R = rotation(j["attach"]);
    } else {
      BodyRead& inboard = drafts[parent - 1];
      hinge.inboard_body = inboard.body.name;
      hinge.inboard_node = "o_" + draft.body.name;
      inboard.add_node(hinge.inboard_node, j["attach"]);
    }
    drafts.push_back(std::move(draft));
  }
  const json points = c.json.value("nodes", json::array());
  for (std::size_t i = 0; i < points.size(); ++i) {
    BodyRead& on = drafts[points[i]["body"].get<int>() - 1];
    c.points.push_back({on.body.name, "n_" + std::to_string(i)});
    on.add_node(c.points[i].node, points[i]);
    const json& input = c.json["input"];
    if (input.contains("node_wrenches")) c.points[i].wrench = vector<double>(input["node_wrenches"][i]);
  }
  for (BodyRead& draft : drafts) {
    draft.body.modal = draft.modal;
    c.spec.bodies.push_back(std::move(draft.body));
  }
  c.q = vector<double>(c.json["state"]["q"]);
  c.v = vector<double>(c.json["state"]["v"]);
}

}  // namespace

Case read(const std::filesystem::path& path) {
  Case c;
  std::ifstream(path) >> c.json;
  c.name = path.stem().string();
  c.schema = c.json["schema"];
  c.spec.name = c.name;
  if (c.schema == "cardan-oracle-body/1")
    read_single_body(c);
  else
    read_system(c);
  c.tau = Eigen::VectorXd::Zero(c.v.size());
  if (c.json.contains("input") && c.json["input"].contains("tau")) c.tau = vector<double>(c.json["input"]["tau"]);
  set_initial_state(c);
  return c;
}

SystemSpec with_loops(const Case& c) {
  SystemSpec spec = c.spec;
  const auto place = [&](const json& j, const std::string& name) {
    PlaceSpec out;
    const int body = j["body"].get<int>();
    if (body == 0) {
      out.position = vector<double>(j["pos"]);
      out.R = rotation(j);
      return out;
    }
    BodyRead on{spec.bodies[static_cast<std::size_t>(body - 1)], nullptr};
    if (on.body.modal) on.modal = std::make_shared<ModalData>(*on.body.modal);
    on.add_node(name, j);
    if (on.modal) on.body.modal = on.modal;
    out.body = on.body.name, out.node = name;
    spec.bodies[static_cast<std::size_t>(body - 1)] = on.body;
    return out;
  };
  int i = 0;
  for (const json& j : c.json["constraints"]) {
    LoopSpec loop;
    loop.name = "loop_" + std::to_string(i++);
    loop.type = j["type"];
    if (loop.type == "coupling") {
      for (const json& term : j["terms"]) {
        int at = 0;
        for (const BodySpec& b : spec.bodies) {
          if (at == term[1].get<int>()) loop.terms.push_back({b.name, number<double>(term[2]), {}});
          at += hinge_nv(b.hinge.type) + (b.modal ? b.modal->n_modes : 0);
        }
      }
      loop.offset = number<double>(j["offset"]);
    } else {
      loop.from = place(j["A"], loop.name + "_A"), loop.to = place(j["B"], loop.name + "_B");
      if (loop.type == "hinge") loop.type = "revolute", loop.params["axis"].value = std::vector<double>{0.0, 0.0, 1.0};
      if (loop.type == "slider") loop.type = "line";
      if (loop.type == "distance") loop.length = number<double>(j["L"]);
    }
    spec.loops.push_back(std::move(loop));
  }
  return spec;
}

SystemSpec at_level(SystemSpec spec, int level) {
  for (BodySpec& b : spec.bodies) b.level = level;
  return spec;
}

std::vector<std::filesystem::path> files() {
  std::vector<std::filesystem::path> folders = {CARDAN_SOURCE_DIR "/tests/reference/oracle"}, out;
  if (const char* more = std::getenv("CARDAN_ORACLE_DIR")) folders.emplace_back(more);
  for (const auto& folder : folders)
    for (const auto& entry : std::filesystem::directory_iterator(folder))
      if (entry.path().extension() == ".json") out.push_back(entry.path());
  std::sort(out.begin(), out.end());
  return out;
}

}  // namespace cardan::oracle
