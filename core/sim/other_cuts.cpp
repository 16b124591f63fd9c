#include "core/sim/other_cuts.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>

#include "core/base/diagnostic.hpp"
#include "core/dynamics/observe.hpp"
#include "core/model/embedding.hpp"

namespace cardan {
namespace {

constexpr std::size_t kTried = 64;  // cuts that are counted: each is compiled

bool turns_round(const HingeSpec& h) {
  return (h.type == "revolute" || h.type == "ball" || h.type == "prismatic") && !h.locked && h.prescribed.empty();
}

std::vector<double> axis_of(const ParamValues& params) {
  const auto axis = params.find("axis");
  if (axis == params.end()) return {};
  const auto* numbers = std::get_if<std::vector<double>>(&axis->second.value);
  return numbers && numbers->size() == 3 ? *numbers : std::vector<double>{};
}

/// Axes of a place in the world at the start.
Eigen::Matrix3d axes_of(const Model& model, const Observer& observer, const PlaceSpec& place) {
  if (place.body.empty()) return place.R;
  const Eigen::Matrix3d R = observer.node(model.find_node(place.node.empty() ? place.body : place.body + "." + place.node)).R_WN;
  return place.node.empty() ? R * place.R : R;
}

}  // namespace

std::optional<SystemSpec> cut_at(const Model& model, std::string_view loop_name, std::string_view body) {
  SystemSpec spec = *model.spec;
  const auto find = [&](std::string_view name) { return std::ranges::find(spec.bodies, name, &BodySpec::name); };
  const auto loop = std::ranges::find(spec.loops, loop_name, &LoopSpec::name);
  if (loop == spec.loops.end() || find(body) == spec.bodies.end()) return {};
  // `b`: the end whose way to home has the hinge.
  PlaceSpec a = loop->from, b = loop->to;
  const auto on_the_way = [&](std::string at) {
    while (!at.empty() && at != body) at = find(at)->hinge.inboard_body;
    return !at.empty();
  };
  if (on_the_way(a.body) == on_the_way(b.body)) return {};
  if (on_the_way(a.body)) std::swap(a, b);
  const HingeSpec cut = find(body)->hinge;
  if (!turns_round(cut) || cut.type == "prismatic") return {};

  // What closes the loop as a hinge of the tree, at its start.
  Workspace ws(model);
  const State start = model.initial_state();
  const Eigen::VectorXd still = Eigen::VectorXd::Zero(model.nv);
  Eigen::VectorXd vdot(model.nv);
  const Inputs at_rest{.q = start.q.data(), .v = still.data(), .tau = still.data(), .vdot = still.data(), .gravity = false};
  if (!forward_dynamics(model, ws, at_rest, vdot.data())) return {};
  Observer observer(model, ws);
  observer.update(at_rest, nullptr);
  const Eigen::Matrix3d seen = axes_of(model, observer, a).transpose() * axes_of(model, observer, b);
  HingeSpec next;
  if (loop->type == "line" || loop->type == "revolute") {
    next.type = "revolute", next.params = loop->params;
    if (loop->type == "line") next.params["axis"].value = std::vector<double>{0.0, 0.0, 1.0};
    const std::vector<double> axis = axis_of(next.params);
    if (axis.empty()) return {};
    const Eigen::AngleAxisd turn(seen);
    next.q = {turn.angle() * (turn.axis().dot(Eigen::Vector3d(axis[0], axis[1], axis[2])) > 0.0 ? 1.0 : -1.0)};
  } else if (loop->type == "point" || loop->type == "ball") {
    next.type = "ball";
    const Eigen::Quaterniond turn(seen);
    next.q = {turn.w(), turn.x(), turn.y(), turn.z()};
  } else {
    return {};
  }
  next.inboard_body = a.body, next.inboard_node = a.node, next.onode_position = a.position, next.onode_R = a.R;
  next.body_node = b.node, next.pnode_position = b.position, next.pnode_R = b.R;

  // From its end to the hinge that is cut each body hangs on the one that hung on it.
  std::map<std::string, std::string, std::less<>> now;  // whose hinge is that of this body now; "": cut
  for (std::string at = b.body;;) {
    const HingeSpec was = find(at)->hinge;
    next.at = was.at;
    find(at)->hinge = next;
    if (at == body) break;
    if (!turns_round(was)) return {};
    next = {};
    next.type = was.type, next.params = was.params, next.q = was.q;
    next.inboard_body = at, next.inboard_node = was.body_node, next.onode_position = was.pnode_position, next.onode_R = was.pnode_R;
    next.body_node = was.inboard_node, next.pnode_position = was.onode_position, next.pnode_R = was.onode_R;
    for (std::size_t i = was.type == "ball" ? 1 : 0; i < next.q.size(); ++i) next.q[i] = -next.q[i];
    now[at] = was.inboard_body;
    at = was.inboard_body;
  }
  now[std::string(body)] = "";

  // The cut, as what closes the loop was: a line in a plane, all of a hinge in space.
  LoopSpec closing;
  closing.name = loop->name, closing.at = loop->at;
  closing.from = {cut.inboard_body, cut.inboard_node, cut.onode_position, cut.onode_R, {}};
  closing.to = {std::string(body), cut.body_node, cut.pnode_position, cut.pnode_R, {}};
  if (cut.type == "ball") {
    closing.type = "point";
  } else if (const std::vector<double> axis = axis_of(cut.params); axis.empty()) {
    return {};
  } else if (loop->type == "line" && cut.inboard_node.empty() && cut.body_node.empty()) {
    closing.type = "line";
    const Eigen::Vector3d z = Eigen::Vector3d(axis[0], axis[1], axis[2]).normalized(), x = z.unitOrthogonal();
    Eigen::Matrix3d R;
    R << x, z.cross(x), z;
    closing.from.R = (closing.from.R * R).eval(), closing.to.R = (closing.to.R * R).eval();
  } else {
    closing.type = "revolute", closing.params = cut.params;
  }
  *loop = closing;
  for (LoopSpec& other : spec.loops) {
    std::vector<LoopSpec::Term*> terms;
    for (LoopSpec::Term& term : other.terms) terms.push_back(&term);
    for (LoopSpec::Function& f : other.functions)
      for (LoopSpec::Term& term : f.of) terms.push_back(&term);
    for (LoopSpec::Term* term : terms) {
      const auto moved = now.find(term->target.substr(0, term->target.find('.')));
      if (moved == now.end()) continue;
      if (moved->second.empty()) return {};  // coupled: it has to stay in the tree
      term->target.replace(0, moved->first.size(), moved->second);
      term->coefficient = -term->coefficient;
    }
  }
  for (BodySpec& x : spec.bodies) x.hinge.v.clear(), x.hinge.springs.clear(), x.hinge.loads.clear();
  spec.devices.clear(), spec.assembly = {};
  return spec;
}

std::optional<CutCosts> cut_costs(const Model& model, const Registry& registry) {
  if (!model.loops.embedding) return {};
  CutCosts out;
  out.flops = model.loops.embedding->flops;
  std::size_t tried = 0;
  for (const Loop& loop : model.loops.all) {
    std::vector<int> way = loop.from_path;
    way.insert(way.end(), loop.to_path.begin(), loop.to_path.end());
    for (const int k : way) {
      const std::string& body = model.user[static_cast<std::size_t>(model.owner[static_cast<std::size_t>(k)])].name;
      const auto other = cut_at(model, loop.name, body);
      if (!other) continue;
      if (++tried > kTried) {
        out.all = false;
        return out;
      }
      try {
        if (const auto again = compile(*other, registry); again->loops.embedding)
          out.others.push_back({loop.name, body, again->loops.embedding->flops});
      } catch (const InputError&) {  // it cannot be cut there: a body that hangs on modes by a hinge that does not, or the like
      }
    }
  }
  return out;
}

}  // namespace cardan
