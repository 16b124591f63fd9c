#include "core/model/absolute.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "core/model/loops.hpp"

namespace cardan {
namespace {

bool deforms(const Model& m, int shapes) { return shapes >= 0 && m.shapes[static_cast<std::size_t>(shapes)].deforms(); }
bool is_turned(const Pose<double>& X) { return !to_eigen(X.R).isIdentity(0.0) || dot(X.p, X.p) != 0.0; }

/// A place on a body, its frame; a node of its own.
LoopEnd end_at(Model& closed, const std::string& name, int user, NodeShapes shapes) {
  const UserBody& u = closed.user[static_cast<std::size_t>(user)];
  shapes.pose = u.pose * shapes.pose;
  closed.nodes.push_back({name, user, u.sweep, std::move(shapes)});
  return {static_cast<int>(closed.nodes.size()) - 1, u.sweep, {}};
}

/// A hinge of the vehicle as a loop from O to P.
Loop joint_of(const Model& model, const UserBody& u, Model& closed) {
  const SweepBody& b = model.bodies[static_cast<std::size_t>(u.sweep)];
  const auto shapes = [&](int deforming, const Pose<double>& undeformed) {
    return deforming >= 0 ? model.shapes[static_cast<std::size_t>(deforming)] : NodeShapes{undeformed, 0, {}};
  };
  Loop out;
  out.name = "hinge of " + u.name, out.type = u.hinge_type;
  NodeShapes O = shapes(b.onode, u.onode), P = shapes(b.pnode, u.pnode);
  if (u.nv == 0 && !O.deforms())  // held at its coordinates
    O.pose = O.pose * u.merged_hinge;
  else if (u.nv == 0)
    P.pose = P.pose * inverse(u.merged_hinge);
  if (u.parent >= 0)
    out.from = end_at(closed, out.name + ".from", u.parent, std::move(O));
  else
    out.from.pose = O.pose;
  out.to = end_at(closed, out.name + ".to", static_cast<int>(&u - model.user.data()), std::move(P));
  if (out.from.sweep > 0) out.from_path = {out.from.sweep};
  if (out.to.sweep > 0) out.to_path = {out.to.sweep};
  out.closing = u.nv > 0 ? Closing::hinge : Closing::weld;
  if (u.nv > 0) out.hinge = u.hinge, out.packed = u.hinge_packed;
  out.rows = 6 - u.nv;
  return out;
}

std::vector<int> nodes_by_name(const Model& from, const Model& to) {
  std::vector<int> out;
  for (const UserNode& node : from.nodes) out.push_back(to.find_node(node.name));
  return out;
}

}  // namespace

std::string not_taken_absolutely(const Model& model) {
  if (const UserBody* u = model.find_curved_nodes()) return fmt::format("bodies whose type tells how their nodes move, as {}", u->name);
  if (!model.devices.holds.empty()) {
    const Device& d = model.devices.all[static_cast<std::size_t>(model.devices.holds[0].device)];
    return fmt::format("devices that hold a component of a hinge, as {} ({})", d.name, d.family->type);
  }
  if (model.changes()) return "masses that change";
  for (const UserBody& u : model.user) {
    const SweepBody& b = model.bodies[static_cast<std::size_t>(u.sweep)];
    if (u.nv == 0 && !u.merged && is_turned(u.merged_hinge) && deforms(model, b.onode) && deforms(model, b.pnode))
      return fmt::format("hinges held at other coordinates than zero between nodes that deform, as that of {}", u.name);
  }
  return {};
}

std::shared_ptr<const AbsoluteModel> in_absolute_coordinates(const Model& model, const Registry& registry, const CompileOptions& options) {
  if (const std::string not_taken = not_taken_absolutely(model); !not_taken.empty())
    refuse(Code::unsupported, model.spec->locate("loop_form"), "a form that takes " + not_taken, "dae, which does not",
           "auto, embedding or multipliers");
  auto spec = std::make_shared<SystemSpec>(*model.spec);
  spec->devices.clear();
  spec->assembly = {};
  std::erase_if(spec->loops, [](const LoopSpec& l) { return l.open || l.type == "coupling"; });
  for (std::size_t i = 0; i < spec->bodies.size(); ++i) {
    if (model.user[i].merged) continue;
    spec->bodies[i].hinge = {};
    spec->bodies[i].hinge.type = "free";
  }
  const std::shared_ptr<Model> closed = assemble(std::move(spec), registry, options, false);
  Loops& loops = closed->loops;
  auto out = std::make_shared<AbsoluteModel>();
  for (const Loop& given : model.loops.all) {
    const int l = loops.find(given.name);
    out->loop_of.push_back(l);
    if (l < 0) continue;
    Loop& loop = loops.all[static_cast<std::size_t>(l)];
    loop.lever = given.lever, loop.q0 = given.q0, loop.drive = given.drive;
  }
  const State start = model.initial_state();
  for (const UserBody& u : model.user) {
    if (u.merged) continue;
    out->joints.push_back({static_cast<int>(&u - model.user.data()), static_cast<int>(loops.all.size())});
    loops.all.push_back(joint_of(model, u, *closed));
    loops.all.back().q0.assign(start.q.data() + u.q, start.q.data() + u.q + u.nq);
  }
  loops.rows = 0;
  for (Loop& loop : loops.all) loop.first = loops.rows, loops.rows += loop.rows;
  auto bodies = std::make_shared<Model>(*closed);
  bodies->loops = {};
  out->closed = closed, out->bodies = std::move(bodies);
  out->node_of = nodes_by_name(model, *closed);
  return out;
}

}  // namespace cardan
