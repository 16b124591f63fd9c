#include "core/reference/dense_model.hpp"

#include <algorithm>
#include <cctype>

#include "core/reference/quad.hpp"

namespace cardan::reference {
namespace {

template <class T>
ModalPoint<T> point(const std::string& name, const Eigen::Vector3d& position, const Eigen::Matrix3d& R, int n_modes,
                    const Eigen::MatrixXd& Phi = {}, const Eigen::MatrixXd& Psi = {}) {
  ModalPoint<T> out{name, position.cast<T>(), R.cast<T>(), Mat3X<T>::Zero(3, n_modes), Mat3X<T>::Zero(3, n_modes), {}};
  if (Phi.size() > 0) out.Phi = Phi.cast<T>();
  if (Psi.size() > 0) out.Psi = Psi.cast<T>();
  return out;
}

template <class T>
MassPoint<T> mass_point(const MassNode& node, int n_modes) {
  MassPoint<T> out{T(node.mass), node.inertia.cast<T>(),
                   point<T>("", node.position, Eigen::Matrix3d::Identity(), n_modes, node.Phi, node.Psi)};
  for (const Eigen::MatrixXd& q : node.Q) out.point.Q.push_back(q.cast<T>());
  return out;
}

/// Unit axes: `axis` (one vector), `axes` (several) or the letters of a gimbal `sequence`.
template <class T>
Mat3X<T> hinge_axes(const HingeSpec& hinge) {
  if (const auto it = hinge.params.find("sequence"); it != hinge.params.end()) {
    const auto& letters = std::get<std::string>(it->second.value);
    Mat3X<T> out = Mat3X<T>::Zero(3, letters.size());
    for (std::size_t i = 0; i < letters.size(); ++i) {
      const int c = std::tolower(static_cast<unsigned char>(letters[i]));
      out(c >= 'x' ? c - 'x' : c - '1', i) = T(1);
    }
    return out;
  }
  for (const char* key : {"axis", "axes"}) {
    const auto it = hinge.params.find(key);
    if (it == hinge.params.end()) continue;
    const auto& flat = std::get<std::vector<double>>(it->second.value);
    Mat3X<T> out = Eigen::Map<const Eigen::Matrix3Xd>(flat.data(), 3, flat.size() / 3).cast<T>();
    out.colwise().normalize();
    if (hinge.type == "constant_velocity") out.col(1) = (out.col(1) - out.col(0) * out.col(0).dot(out.col(1))).normalized();
    return out;
  }
  return Mat3X<T>(3, 0);
}

template <class T>
void set_hinge(DenseBody<T>& b, const ForeignHinges& foreign) {
  b.shape.type = b.hinge.type;
  b.size = hinge_size(b.hinge.type);
  if (b.size.nq < 0) {
    const auto it = foreign.find(b.hinge.type);
    if (it == foreign.end()) refuse(Code::unsupported, b.hinge.at, "a hinge type known to the dense twin", b.hinge.type);
    b.foreign = it->second;
    b.size = {b.foreign->nq, b.foreign->nv};
  } else {
    b.shape.axes = hinge_axes<T>(b.hinge);
    if (const auto it = b.hinge.params.find("pitch"); it != b.hinge.params.end()) b.shape.pitch = T(std::get<double>(it->second.value));
  }
  if (!b.hinge.locked) return;
  b.held = VecX<T>::Zero(b.size.nq);
  if (b.size.nq > b.size.nv) b.held[0] = T(1);  // identity quaternion
  for (std::size_t i = 0; i < b.hinge.q.size(); ++i) b.held[i] = T(b.hinge.q[i]);
}

template <class T>
DenseBody<T> dense_body(const BodySpec& spec, const ForeignHinges& foreign) {
  DenseBody<T> b;
  b.name = spec.name;
  b.hinge = spec.hinge;
  b.level = spec.level;
  if (spec.modal) {
    const ModalData& modal = *spec.modal;
    b.modal = spec.modal;
    b.n_modes = modal.n_modes;
    b.K = modal.K.cast<T>();
    b.C = modal.C.size() > 0 ? modal.C.cast<T>().eval() : MatX<T>::Zero(b.n_modes, b.n_modes);
    for (const MassNode& node : modal.mass_nodes)
      if (!modal.whole) b.masses.push_back(mass_point<T>(node, b.n_modes));
    for (const ModalNode& n : modal.nodes) b.nodes.push_back(point<T>(n.name, n.position, n.R_BN, b.n_modes, n.Phi, n.Psi));
  } else {
    b.masses.push_back(mass_point<T>({spec.mass, spec.com, spec.inertia_com, {}, {}, {}}, 0));
    for (const NodeSpec& n : spec.nodes) b.nodes.push_back(point<T>(n.name, n.position, n.R_BN, 0));
  }
  set_hinge(b, foreign);
  b.pnode =
      spec.hinge.body_node.empty() ? point<T>("", spec.hinge.pnode_position, spec.hinge.pnode_R, b.n_modes) : b.node(spec.hinge.body_node);
  return b;
}

/// Parent and O of every body, and an order with parents first.
template <class T>
void connect(DenseModel<T>& model) {
  std::map<std::string, int> index;
  for (std::size_t i = 0; i < model.bodies.size(); ++i) index[model.bodies[i].name] = static_cast<int>(i);
  std::map<int, std::vector<int>> children;
  for (DenseBody<T>& b : model.bodies) {
    const HingeSpec& h = b.hinge;
    if (!h.inboard_body.empty()) {
      const auto it = index.find(h.inboard_body);
      if (it == index.end()) refuse(Code::unknown_body, h.at, "the name of a body", h.inboard_body);
      b.parent = it->second;
    }
    children[b.parent].push_back(index[b.name]);
    const int parent_modes = b.parent < 0 ? 0 : model.bodies[b.parent].n_modes;
    b.onode = h.inboard_node.empty() || b.parent < 0 ? point<T>("", h.onode_position, h.onode_R, parent_modes)
                                                     : model.bodies[b.parent].node(h.inboard_node);
  }
  model.outward = children[-1];
  for (std::size_t i = 0; i < model.outward.size(); ++i)
    for (const int c : children[model.outward[i]]) model.outward.push_back(c);
  if (model.outward.size() < model.bodies.size()) refuse(Code::cycle, {}, "a tree", "a closed loop");
  std::map<int, int> first;  // of those that are fixed to each other, and not to the world
  std::map<int, std::vector<int>> as_one;
  for (const int k : model.outward) {
    DenseBody<T>& b = model.bodies[k];
    if (b.parent >= 0) b.moving = model.bodies[b.parent].moving;
    for (int i = 0; i < b.free_nv() + b.n_modes; ++i) b.moving.push_back(b.iv + i);
    const bool fixed = b.parent >= 0 && !b.moving.empty() && b.free_nv() + b.n_modes + model.bodies[b.parent].n_modes == 0;
    as_one[first[k] = fixed ? first[b.parent] : k].push_back(k);
  }
  for (const auto& [_, members] : as_one)
    for (const int k : members)
      if (members.size() > 1) model.bodies[k].as_one = members;
}

/// "motor" of a hinge with one coordinate, "arm.angle" of others: the twin knows the coordinates by their place alone.
template <class T>
typename DenseLoop<T>::Term term_of(const DenseModel<T>& model, const LoopSpec::Term& term) {
  static const std::map<std::string, std::vector<std::string>, std::less<>> names = {{"revolute", {"angle"}},
                                                                                     {"prismatic", {"displacement"}},
                                                                                     {"helical", {"angle"}},
                                                                                     {"cylindrical", {"angle", "displacement"}},
                                                                                     {"universal", {"angle_1", "angle_2"}},
                                                                                     {"constant_velocity", {"tilt_1", "tilt_2"}},
                                                                                     {"gimbal", {"angle_1", "angle_2", "angle_3"}},
                                                                                     {"planar", {"x", "y", "angle"}},
                                                                                     {"translational", {"x", "y", "z"}}};
  const auto point = term.target.find('.');
  for (const DenseBody<T>& b : model.bodies) {
    if (b.name != term.target.substr(0, point) || b.free_nv() == 0) continue;
    int at = 0;
    if (point != std::string::npos && b.free_nv() > 1) {
      const auto known = names.find(b.hinge.type);
      if (known == names.end()) break;
      const auto name = std::ranges::find(known->second, term.target.substr(point + 1));
      if (name == known->second.end()) break;
      at = static_cast<int>(name - known->second.begin());
    }
    return {b.iq + at, b.iv + at, T(term.coefficient)};
  }
  refuse(Code::unsupported, term.at, "a coordinate known to the dense twin", term.target);
}

template <class T>
DenseLoop<T> dense_loop(const DenseModel<T>& model, const LoopSpec& spec) {
  if (!knows_loop(spec.type)) refuse(Code::unsupported, spec.at, "a loop of a type known to the dense twin", spec.type);
  DenseLoop<T> loop;
  loop.name = spec.name;
  loop.shape.type = spec.type;
  HingeSpec hinge;
  hinge.type = spec.type, hinge.params = spec.params;
  loop.shape.axes = hinge_axes<T>(hinge);
  if (const auto it = spec.params.find("pitch"); it != spec.params.end()) loop.shape.pitch = T(std::get<double>(it->second.value));
  loop.length = T(spec.length), loop.offset = T(spec.offset);
  loop.prescribed = spec.prescribed;
  for (const LoopSpec::Term& term : spec.terms) loop.terms.push_back(term_of(model, term));
  for (const LoopSpec::Function& f : spec.functions) {
    typename DenseLoop<T>::Function function;
    function.kind = f.kind, function.phase = T(f.phase), function.periodic = f.periodic;
    const auto n = static_cast<Eigen::Index>(f.numbers.size());
    const VecX<T> numbers = Eigen::Map<const Eigen::VectorXd>(f.numbers.data(), n).template cast<T>();
    if (f.kind == "table") {
      function.numbers = numbers(Eigen::seq(0, n - 2, 2)), function.values = T(f.scale) * numbers(Eigen::seq(1, n - 1, 2));
      function.slopes = slopes_of_table<T>(function.numbers, function.values, f.periodic);
    } else {
      function.numbers = T(f.scale) * numbers;
    }
    for (const LoopSpec::Term& term : f.of) function.of.push_back(term_of(model, term));
    loop.functions.push_back(std::move(function));
  }
  const auto end = [&](const PlaceSpec& place, int& body, ModalPoint<T>& at) {
    for (std::size_t k = 0; k < model.bodies.size() && !place.body.empty(); ++k)
      if (model.bodies[k].name == place.body) body = static_cast<int>(k);
    if (body < 0 && !place.body.empty()) refuse(Code::unknown_body, place.at, "the name of a body", place.body);
    at = place.node.empty() || body < 0
             ? point<T>("", place.position, place.R, body < 0 ? 0 : model.bodies[static_cast<std::size_t>(body)].n_modes)
             : model.bodies[static_cast<std::size_t>(body)].node(place.node);
  };
  if (spec.type != "coupling") end(spec.from, loop.from, loop.A), end(spec.to, loop.to, loop.B);
  return loop;
}

}  // namespace

template <class T>
const ModalPoint<T>& DenseBody<T>::node(std::string_view wanted) const {
  for (const ModalPoint<T>& n : nodes)
    if (n.name == wanted) return n;
  refuse(Code::unknown_node, hinge.at, "a node of body \"" + name + "\"", std::string(wanted));
}

template <class T>
DenseModel<T> dense_model(const SystemSpec& spec, const ForeignHinges& foreign) {
  DenseModel<T> model;
  const GravitySpec& g = spec.gravity;
  model.gravity = {g.kind, g.g.cast<T>(), g.centre.cast<T>(), T(g.mu), g.gradient, {}};
  for (const BodySpec& body : spec.bodies) {
    DenseBody<T> b = dense_body<T>(body, foreign);
    b.iq = model.nq;
    b.iv = model.nv;
    model.nq += b.free_nq() + b.n_modes;
    model.nv += b.free_nv() + b.n_modes;
    model.bodies.push_back(std::move(b));
  }
  connect(model);
  for (const LoopSpec& loop : spec.loops)
    if (!loop.open) model.loops.push_back(dense_loop(model, loop));
  return model;
}

template struct DenseBody<double>;
template struct DenseBody<Quad>;
template DenseModel<double> dense_model(const SystemSpec&, const ForeignHinges&);
template DenseModel<Quad> dense_model(const SystemSpec&, const ForeignHinges&);

}  // namespace cardan::reference
