#include "core/sim/rejoin.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/base/units.hpp"
#include "core/dynamics/hinge_fit.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/model/components.hpp"
#include "core/model/device_units.hpp"
#include "core/model/model_map.hpp"
#include "core/model/params.hpp"
#include "core/model/validate.hpp"
#include "core/sim/simulation.hpp"
#include "core/spatial/rotation.hpp"

namespace cardan {
namespace {

constexpr double kGap = 1e-6;    // [rad, m] that two ends of a hinge may be apart: typed numbers have a finite number of digits
constexpr double kAfar = 2e-15;  // ... beside that, of their distance from the origin of the world: places are rounded there

/// The same pose at the same coordinates.
bool same_place(const HingeSpec& a, const HingeSpec& b) {
  const auto same_value = [](const auto& x, const auto& y) { return x.first == y.first && x.second.value == y.second.value; };
  return a.type == b.type && a.inboard_body == b.inboard_body && a.inboard_node == b.inboard_node && a.body_node == b.body_node &&
         a.onode_position == b.onode_position && a.onode_R == b.onode_R && a.pnode_position == b.pnode_position && a.pnode_R == b.pnode_R &&
         std::ranges::equal(a.params, b.params, same_value);
}
bool joined_otherwise(const HingeSpec& a, const HingeSpec& b) { return !same_place(a, b) || a.locked != b.locked; }

class Rejoining {
 public:
  Rejoining(Simulation& from, SystemSpec spec, const Registry& registry, const CompileOptions& options)
      : before_(from.model()),
        seen_(from.observe()),
        state_(from.state()),
        drives_(from.drives().begin(), from.drives().end()),
        spec_(std::move(spec)),
        registry_(registry),
        options_(options) {}

  Rejoined run() {
    spec_.assembly = {};  // what is there is where it is: nothing is moved
    for (BodySpec& body : spec_.bodies) {
      const int user = before_.find_body(body.name);
      if (user < 0) continue;
      const UserBody& u = before_.user[static_cast<std::size_t>(user)];
      const HingeSpec& was = before_.spec->bodies[static_cast<std::size_t>(user)].hinge;
      if (u.n_modes > 0) body.eta.assign(state_.q.data() + u.eta, state_.q.data() + u.eta + u.n_modes);
      body.etadot.clear(), body.hinge.v.clear();
      if (joined_otherwise(was, body.hinge)) others_.push_back(&body);
      if (!same_place(was, body.hinge))
        fit(body);
      else if (u.nq > 0)
        body.hinge.q.assign(state_.q.data() + u.q, state_.q.data() + u.q + u.nq);
      else
        body.hinge.q = was.q;
    }
    for (LoopSpec& loop : spec_.loops)
      if (loop.as_found)
        loop.type == "coupling" ? couple_as_found(loop) : hold_as_found(loop);
      else if (const LoopDrive* drive = drive_of(loop.name))
        (loop.type == "distance" ? loop.length : loop.offset) = length_of(loop.name) + drive->more;
    remember_components();
    auto model = compile(std::make_shared<const SystemSpec>(spec_), registry_, options_);
    if (hold_from_home(*model)) model = compile(std::make_shared<const SystemSpec>(spec_), registry_, options_);
    const ModelMap map = model_map(before_, *model);
    State state = carried(state_, map, *model);
    state.q = model->initial_state().q;
    for (const UserBody& u : before_.user)  // modes of another mass or stiffness begin anew
      for (int i = 0; i < u.n_modes; ++i)
        if (const int body = model->find_body(u.name); body >= 0 && map.q[static_cast<std::size_t>(u.eta + i)] < 0)
          state.q[model->user[static_cast<std::size_t>(body)].eta + i] = 0.0;
    if (!others_.empty()) set_velocities(*model, state);
    if (!model->loops.empty()) {
      const Model weighed = in_a_blow(*model, state);
      std::vector<LoopDrive> drives(static_cast<std::size_t>(model->loops.n_drives));  // at their lengths, still moving
      for (const Loop& loop : model->loops.all)
        if (const LoopDrive* drive = drive_of(loop.name); loop.drive >= 0 && drive)
          drives[static_cast<std::size_t>(loop.drive)] = {0.0, drive->rate, drive->acceleration};
      if (LoopProjection projection(weighed); !projection.close(state.q.data(), state.v.data(), drives.data())) {
        RunFailure f = describe_breakdown(weighed, projection.breakdown(), state.t);
        tell_singular_posture(weighed, projection.breakdown(), state.t, state.q.data(), drives.data(), f);
        throw NumericsError(std::move(f));
      }
    }
    return {model, std::move(state)};
  }

 private:
  /// Where the hinge components are that devices are mounted at, for those of which the hinge is not there any more.
  void remember_components() {
    for (DeviceSpec& device : spec_.devices) {
      const auto was = std::ranges::find(before_.devices.all, device.name, &Device::name);
      if (was == before_.devices.all.end()) continue;
      for (std::size_t i = 0; i < was->mounts.size(); ++i) {
        const DeviceMount& m = was->mounts[i];
        const auto mount = device.mounts.find(was->family->mounts[i].name);
        if (mount == device.mounts.end()) continue;
        mount->second.last = m.still;
        for (const UserBody& u : before_.user)
          if (m.v >= u.v && m.v < u.v + u.nv)
            mount->second.last = {m.q >= 0 ? state_.q[m.q] : 0.0, is_turn(u.v_units[static_cast<std::size_t>(m.v - u.v)])};
      }
    }
  }

  struct Place {
    Pose<double> pose;        // in the world
    Motion<double> velocity;  // its axes
  };

  /// A frame of a body as it moves now; `in_place` where it has no name.
  Place place(const std::string& body, const std::string& node, Pose<double> in_place) const {
    if (body.empty()) return {in_place, {}};
    int index = before_.find_node(node.empty() ? body : body + "." + node);
    if (index < 0) {  // the change brings it
      for (const NodeSpec& n : spec_.find(body) ? spec_.find(body)->nodes : std::vector<NodeSpec>())
        if (n.name == node) in_place = {from_eigen(n.R_BN), from_eigen(n.position)}, index = before_.find_node(body);
      if (index < 0) refuse(Code::unknown_node, spec_.locate("bodies." + body), "a node that there is", in_quotes(body + "." + node));
    }
    const NodeState s = seen_.node(index);
    const Place at{{from_eigen(s.R_WN), from_eigen(s.position)}, motion(s.velocity.data())};
    if (!node.empty() && before_.find_node(body + "." + node) >= 0) return at;
    return {at.pose * in_place, to_outboard(in_place, at.velocity)};
  }
  static Pose<double> pnode(const HingeSpec& h) { return {from_eigen(h.pnode_R), from_eigen(h.pnode_position)}; }
  static Pose<double> onode(const HingeSpec& h) { return {from_eigen(h.onode_R), from_eigen(h.onode_position)}; }
  Place outboard(const BodySpec& body) const { return place(body.name, body.hinge.body_node, pnode(body.hinge)); }

  /// The coordinates with which the hinge of the body joins its ends where they are.
  void fit(BodySpec& body) const {
    HingeSpec& hinge = body.hinge;
    const cardan_hinge_family* family = registry_.hinge(hinge.type);
    if (!family || (!hinge.inboard_body.empty() && before_.find_body(hinge.inboard_body) < 0)) return;  // compile() refuses it
    const Located at = spec_.locate(body_path(body) + ".hinge");
    DiagnosticSink sink;
    const std::vector<double> packed =
        pack_params(spec_, {body_path(body) + ".hinge", "hinge type " + hinge.type, hinge.params},
                    {{family->params, family->n_params}, family->params_size, family->pack, family->packed_size}, sink);
    sink.throw_if_any();
    hinge.q.assign(family->nq, 0.0);
    if (family->zero) family->zero(packed.data(), hinge.q.data());
    const Place O = place(hinge.inboard_body, hinge.inboard_node, onode(hinge)), P = outboard(body);
    const HingeFit found = fit_hinge(*family, packed, inverse(O.pose) * P.pose, 1.0, hinge.q);
    const double turn = found.e.head<3>().norm(), shift = found.e.tail<3>().norm();
    if (turn <= kGap && shift <= kGap + kAfar * to_eigen(O.pose.p).norm()) return;
    refuse(Code::ends_apart, at, fmt::format("ends that a hinge of type {} can join where they are", hinge.type),
           fmt::format("{:.3g} rad and {:.3g} m between them at t = {:.6g} s", turn, shift, state_.t),
           "as_found = true, without a type, holds them as they are");
  }

  /// Of a loop that was prescribed and closed; null: it was not.
  const LoopDrive* drive_of(const std::string& loop) const {
    const int i = before_.loops.find(loop), drive = i < 0 ? -1 : before_.loops.all[static_cast<std::size_t>(i)].drive;
    return drive < 0 ? nullptr : &drives_[static_cast<std::size_t>(drive)];
  }
  double length_of(const std::string& loop) const {
    const Loop& was = before_.loops.all[static_cast<std::size_t>(before_.loops.find(loop))];
    return was.closing == Closing::distance ? was.length : was.coupling.offset;
  }

  /// Its end `to` is where `from` is when it closes, and stays there, also when it is open again: the node of that place does.
  void hold_as_found(LoopSpec& loop) const {
    const auto was = std::ranges::find(before_.spec->loops, loop.name, &LoopSpec::name);
    if (was != before_.spec->loops.end()) loop.to = was->to;
    if (loop.open || (was != before_.spec->loops.end() && !was->open)) return;
    const auto in_place = [](const PlaceSpec& p) { return Pose<double>{from_eigen(p.R), from_eigen(p.position)}; };
    const auto known = [this](const PlaceSpec& p) { return p.body.empty() || before_.find_body(p.body) >= 0; };
    if (!known(loop.from) || !known(loop.to)) return;  // compile() refuses it
    const BodySpec* body = spec_.find(loop.to.body);
    if (body && body->modal && !loop.to.node.empty())
      refuse(Code::unsupported, spec_.locate("loops." + loop.name + ".as_found"), "an end `to` on a rigid body, which has a place anywhere",
             fmt::format("{}.{}, a node of a flexible body", loop.to.body, loop.to.node), "let the flexible body be `from`");
    const Pose<double> X = inverse(place(loop.to.body, "", {}).pose) * place(loop.from.body, loop.from.node, in_place(loop.from)).pose;
    loop.to.node.clear(), loop.to.R = to_eigen(X.R), loop.to.position = to_eigen(X.p);
  }

  /// Its offset is what its terms sum to when it closes, also when it is open again.
  void couple_as_found(LoopSpec& loop) const {
    const auto was = std::ranges::find(before_.spec->loops, loop.name, &LoopSpec::name);
    if (was != before_.spec->loops.end()) loop.offset = was->offset;
    if (loop.open || (was != before_.spec->loops.end() && !was->open)) return;
    const auto open = compile(std::make_shared<const SystemSpec>(bare()), registry_, options_);
    const State start = open->initial_state();
    loop.offset = 0.0;
    for (const LoopSpec::Term& term : loop.terms)
      if (const std::vector<int> v = components_of(*open, term.target); v.size() == 1)  // else compile() refuses it
        for (const UserBody& u : open->user)
          if (v[0] >= u.v && v[0] < u.v + u.nv && u.nq == u.nv) loop.offset += term.coefficient * start.q[u.q + v[0] - u.v];
  }

  /// Poses that are held as they were found are seen from the origin of the world, in orbit to 1e-9 m. From the home of the loop they are
  /// known to the size of the loop: held so, loops that imply each other do not contradict each other by rounding. false: none is another.
  bool hold_from_home(const Model& model) {
    bool other = false;
    Workspace ws(model);
    const Eigen::VectorXd q = model.initial_state().q;
    Eigen::VectorXd open;
    for (const Loop& loop : model.loops.all) {
      const auto spec = std::ranges::find(spec_.loops, loop.name, &LoopSpec::name);
      if (loop.home == 0 || !spec->as_found || !spec->to.node.empty()) continue;
      if (open.size() == 0) open = loop_rows(model, ws, q.data()).c;
      if (!(open.segment<6>(loop.first).lpNorm<Eigen::Infinity>() > 1e-14)) continue;
      const double* c = loop_forces(ws).residual.data() + loop.first;  // of a weld: rotation vector and place of `to` in `from`
      const Vec3<double> turn{c[0], c[1], c[2]};
      const Pose<double> apart{rotation_of_vector(rotation_coefficients(dot(turn, turn)), turn), {c[3], c[4], c[5]}};
      const Pose<double> to = Pose<double>{from_eigen(spec->to.R), from_eigen(spec->to.position)} * inverse(apart);
      spec->to.R = to_eigen(to.R), spec->to.position = to_eigen(to.p);
      other = true;
    }
    return other;
  }

  /// Only bodies, hinges and what gives them mass: what M is made of.
  SystemSpec bare() const {
    SystemSpec out;
    out.name = spec_.name, out.bodies = spec_.bodies;
    for (BodySpec& body : out.bodies) body.hinge.springs.clear(), body.hinge.loads.clear();
    return out;
  }

  /// The vehicle with all hinges that are others let go: [q; v] of it tell what every body does. Devices, which such hinges may carry, are
  /// left out; their masses stay.
  std::shared_ptr<const Model> let_go() const {
    SystemSpec out = bare();
    for (const BodySpec* other : others_) {
      HingeSpec& hinge = out.bodies[static_cast<std::size_t>(other - spec_.bodies.data())].hinge;
      HingeSpec free;
      free.type = "free", free.body_node = hinge.body_node, free.pnode_position = hinge.pnode_position, free.pnode_R = hinge.pnode_R;
      hinge = std::move(free);
    }
    for (const DeviceMass& m : before_.devices.masses) {
      const UserBody& u = before_.user[static_cast<std::size_t>(m.user)];
      const auto body = std::ranges::find(out.bodies, u.name, &BodySpec::name);
      if (body == out.bodies.end()) continue;
      body->type = "rigid", body->params.clear();
      body->mass = u.M.m;
      body->com = u.M.m > 0.0 ? Eigen::Vector3d(to_eigen(u.M.h) / u.M.m) : Eigen::Vector3d::Zero();
      const Eigen::Vector3d c = body->com;
      body->inertia_com = to_eigen(u.M.J) - u.M.m * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
    }
    return compile(out, registry_);
  }

  // Velocities of the bodies, let go: v_C, and their momentum p_C = M_C v_C. The hinges of the model allow v_C = T v alone, so v with M v =
  // T* p_C is the nearest in the metric of M. T* needs no matrix: a momentum [n; f] of a body that was let go is a wrench on it.
  void set_velocities(const Model& model, State& state) const {
    const auto free = let_go();
    State at = carried(state_, model_map(before_, *free), *free);
    const auto user_of = [](const Model& m, const BodySpec& body) -> const UserBody& {
      return m.user[static_cast<std::size_t>(m.find_body(body.name))];
    };
    for (const BodySpec* other : others_) {
      const UserBody& u = user_of(*free, *other);
      const Place P = outboard(*other);
      const Eigen::Quaterniond turn(to_eigen(P.pose.R));
      const Eigen::Vector3d along = to_eigen(P.pose.R * P.velocity.v);
      at.q.segment<7>(u.q) << turn.w(), turn.vec(), to_eigen(P.pose.p);
      at.v.segment<6>(u.v) << to_eigen(P.velocity.w), along;
    }
    if (std::ranges::all_of(others_, [](const BodySpec* b) { return flies(b->hinge); })) {
      const ModelMap map = model_map(*free, model);
      for (int i = 0; i < free->nv; ++i)
        if (const int to = map.v[static_cast<std::size_t>(i)]; to >= 0) state.v[to] = at.v[i];
      return;
    }
    const Eigen::VectorXd p = momentum(*free, at.q, at.v);
    const std::shared_ptr<const Model> tree =
        model.loops.empty() ? std::shared_ptr<const Model>(std::shared_ptr<void>(), &model) : open_tree();
    const Model there = in_a_blow(*tree, state);
    const ModelMap map = model_map(*free, there);
    std::vector<std::uint8_t> others(static_cast<std::size_t>(free->nv), 0);
    std::vector<NodeWrench> wrenches;
    for (const BodySpec* other : others_) {
      const UserBody& u = user_of(*free, *other);
      std::fill_n(others.begin() + u.v, 6, std::uint8_t{1});
      const Mat3<double> R = outboard(*other).pose.R;
      const Force<double> at_P{{p[u.v], p[u.v + 1], p[u.v + 2]}, transpose_times(R, Vec3<double>{p[u.v + 3], p[u.v + 4], p[u.v + 5]})};
      const HingeSpec& hinge = other->hinge;
      NodeWrench w;
      w.node = there.find_node(hinge.body_node.empty() ? other->name : other->name + "." + hinge.body_node);
      w.f = hinge.body_node.empty() ? to_inboard(pnode(hinge), at_P) : at_P;
      wrenches.push_back(w);
    }
    Workspace ws(there);
    Eigen::VectorXd f = external_force(there, ws, state.q.data(), wrenches), given = Eigen::VectorXd::Zero(there.nv);
    for (int i = 0; i < free->nv; ++i)
      if (const int to = map.v[static_cast<std::size_t>(i)]; to >= 0 && others[static_cast<std::size_t>(i)] == 0) f[to] += p[i];
    for (int i = 0; i < there.nv; ++i)
      if (there.has_prescribed() && there.prescribed[static_cast<std::size_t>(i)] != 0) given[i] = state.v[i];
    if (there.has_prescribed()) f -= momentum(there, state.q, given);
    if (!articulate_at_rest(there, ws, state.q.data())) throw NumericsError(describe_breakdown(there, ws.breakdown, state.t));
    solve_mass(there, ws, state.q.data(), f.data(), state.v.data());
    f -= momentum(there, state.q, state.v);  // once more for what rounding left of the momentum
    Eigen::VectorXd rest(there.nv);
    solve_mass(there, ws, state.q.data(), f.data(), rest.data());
    state.v += rest + given;
  }

  std::shared_ptr<const Model> open_tree() const {
    SystemSpec open = spec_;
    open.loops.clear();
    return compile(open, registry_, options_);
  }

  /// With the masses of the state; what devices hold gives way.
  static Model in_a_blow(const Model& model, const State& state) {
    Model out = model.weighed(state.z.data(), state.marks.data());
    for (const DeviceHold& h : out.devices.holds) out.prescribed[static_cast<std::size_t>(h.v)] = 0;
    return out;
  }

  /// M v.
  static Eigen::VectorXd momentum(const Model& model, const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
    Workspace ws(model);
    const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model.nv);
    Eigen::VectorXd p(model.nv);
    inverse_dynamics(model, ws, Inputs{.q = q.data(), .v = rest.data(), .vdot = v.data()}, p.data(),
                     {.velocity = false, .gravity = false, .elastic = false});
    return p;
  }

  const Model& before_;
  const Observer& seen_;
  const State& state_;
  std::vector<LoopDrive> drives_;
  SystemSpec spec_;
  const Registry& registry_;
  CompileOptions options_;
  std::vector<BodySpec*> others_;  // of spec_
};

}  // namespace

bool joined_otherwise(const SystemSpec& before, const SystemSpec& after) {
  const auto same = [](const LoopSpec& a, const LoopSpec& b) { return a.name == b.name && a.open == b.open; };
  if (!std::ranges::equal(before.loops, after.loops, same)) return true;
  return std::ranges::any_of(after.bodies, [&](const BodySpec& b) {
    const BodySpec* was = before.find(b.name);
    return was && joined_otherwise(was->hinge, b.hinge);
  });
}

Rejoined rejoin(Simulation& from, SystemSpec spec, const Registry& registry, const CompileOptions& options) {
  return Rejoining(from, std::move(spec), registry, options).run();
}

std::vector<double> initial_places(const SystemSpec& spec) {
  std::vector<double> all;
  for (const BodySpec& b : spec.bodies)
    for (const std::vector<double>* part : {&b.hinge.q, &b.eta}) {
      all.push_back(static_cast<double>(part->size()));
      all.insert(all.end(), part->begin(), part->end());
    }
  for (const LoopSpec& l : spec.loops) {
    if (l.prescribed) all.push_back(l.type == "distance" ? l.length : l.offset);
    if (!l.as_found) continue;
    if (l.type == "coupling") {
      all.push_back(l.offset);
      continue;
    }
    all.push_back(l.to.node.empty());
    all.insert(all.end(), l.to.R.data(), l.to.R.data() + 9), all.insert(all.end(), l.to.position.data(), l.to.position.data() + 3);
  }
  for (const DeviceSpec& d : spec.devices)
    for (const auto& [name, mount] : d.mounts) {
      all.push_back(mount.last.has_value());
      if (mount.last) all.insert(all.end(), {mount.last->q, static_cast<double>(mount.last->turns)});
    }
  return all;
}

bool put_initial_places(SystemSpec& spec, const std::vector<double>& places) {
  auto at = places.begin();
  for (BodySpec& b : spec.bodies) {
    for (std::vector<double>* part : {&b.hinge.q, &b.eta}) {
      if (at == places.end() || !(*at >= 0.0 && *at < static_cast<double>(places.end() - at))) return false;
      const auto n = static_cast<std::ptrdiff_t>(*at++);
      part->assign(at, at + n);
      at += n;
    }
    b.hinge.v.clear(), b.etadot.clear();
  }
  for (LoopSpec& l : spec.loops) {
    if (l.prescribed) {
      if (at == places.end()) return false;
      (l.type == "distance" ? l.length : l.offset) = *at++;
    }
    if (!l.as_found) continue;
    if (l.type == "coupling") {
      if (at == places.end()) return false;
      l.offset = *at++;
      continue;
    }
    if (places.end() - at < 13) return false;
    if (*at++ != 0.0) l.to.node.clear();
    std::copy_n(at, 9, l.to.R.data()), std::copy_n(at + 9, 3, l.to.position.data());
    at += 12;
  }
  for (DeviceSpec& d : spec.devices)
    for (auto& [name, mount] : d.mounts) {
      if (at == places.end()) return false;
      if (*at++ == 0.0) continue;
      if (places.end() - at < 2) return false;
      mount.last = {at[0], at[1] != 0.0};
      at += 2;
    }
  return at == places.end();
}

}  // namespace cardan
