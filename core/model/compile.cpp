// SystemSpec + Registry -> Model: numbers the bodies level by level, merges rigid bodies that are fixed to each other, turns
// rigid bodies into their pnode frame (B = P: then Phi* is one rigid transformation and the hinge map needs none), folds
// constants, chooses a kernel for each body and writes the program of sweeps.
#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "core/base/units.hpp"
#include "core/model/choose_frames.hpp"
#include "core/model/column_order.hpp"
#include "core/model/devices.hpp"
#include "core/model/fields.hpp"
#include "core/model/flexible_constants.hpp"
#include "core/model/initial.hpp"
#include "core/model/loops.hpp"
#include "core/model/validate.hpp"

namespace cardan {
namespace {

Pose<double> pose_of(const Eigen::Matrix3d& R, const Eigen::Vector3d& p) { return {from_eigen(R), from_eigen(p)}; }

class Compiler {
 public:
  Compiler(std::shared_ptr<const SystemSpec> spec, const Registry& registry, const CompileOptions& options, bool graded)
      : spec_(*spec), registry_(registry), options_(options), graded_(graded) {
    model_->spec = std::move(spec);
  }

  std::shared_ptr<Model> run() {
    hinges_ = validate(spec_, registry_, sink_);
    for (const auto& b : spec_.bodies) {
      const auto* family = registry_.body(b.type);
      if (family && has_modes(*family) && !b.modal)
        sink_.report({Code::bad_modal_data, b.at, "modal data (modal: beam, plate, file or lumped)", "none", "", "", "", 0});
    }
    sink_.throw_if_any();
    model_->name = spec_.name;
    model_->gravity = spec_.gravity;
    const GravitySpec& g = spec_.gravity;
    model_->field = {g.kind == GravitySpec::Kind::uniform,
                     g.kind == GravitySpec::Kind::central,
                     from_eigen(g.g),
                     g.mu,
                     from_eigen(g.centre),
                     g.gradient};
    model_->fields = compile_fields(spec_, registry_, sink_);
    if (g.kind == GravitySpec::Kind::field) {
      const int i = compile_gravity(spec_, model_->fields, sink_);
      if (i >= 0) model_->field.source = model_->fields[static_cast<std::size_t>(i)].source.get();
    }
    sink_.throw_if_any();
    number_coordinates();
    order_bodies();
    build_sweep_bodies();
    sink_.throw_if_any();
    find_varying();
    std::vector<Central> central;
    if (graded_) central = central_inertias(*model_, order_);
    if (options_.choose_frames) {
      if (graded_) turn_dense_frames(*model_, central);
      choose_frames(*model_, central);
    }
    name_nodes();
    if (!spec_.devices.empty()) {
      model_->devices = compile_devices(spec_, registry_, *model_, options_.from_home, sink_);
      sink_.throw_if_any();
    }
    if (!spec_.loops.empty()) {
      model_->loops = compile_loops(spec_, registry_, *model_, sink_);
      sink_.throw_if_any();
    }
    choose_kernels();
    if (!model_->varies.empty()) keep_varying();
    if (graded_) keep_central_inertias(*model_, std::move(central));
    write_program();
    return model_;
  }

 private:
  // q and v in the user's order: body by body [hinge; modes].
  void number_coordinates() {
    Model& m = *model_;
    m.user.reserve(spec_.bodies.size());
    for (const BodySpec& b : spec_.bodies) {
      CheckedHinge& hinge = hinges_[m.user.size()];
      UserBody& u = m.user.emplace_back();
      u.name = b.name;
      u.type = b.type;
      u.hinge_type = b.hinge.type;
      u.hinge = hinge.family;
      const auto& body_entry = *registry_.bodies.entry(b.type);
      u.family = body_entry.family;
      u.family_origin = body_entry.origin;
      u.hinge_origin = registry_.hinges.entry(b.hinge.type)->origin;
      u.hinge_packed = std::move(hinge.packed);
      u.parent = hinge.inboard_body;
      u.nq = b.hinge.locked ? 0 : static_cast<int>(u.hinge->nq);
      u.nv = b.hinge.locked ? 0 : static_cast<int>(u.hinge->nv);
      for (int i = 0; i < u.nq; ++i) {
        u.q_names.emplace_back(u.hinge->q_names[i]);
        u.q_units.emplace_back(u.hinge->q_units[i]);
      }
      for (int i = 0; i < u.nv; ++i) {
        u.v_names.emplace_back(u.hinge->v_names[i]);
        u.v_units.emplace_back(u.hinge->v_units[i]);
      }
      u.n_modes = b.modal ? b.modal->n_modes : 0;
      u.q = m.nq;
      u.v = m.nv;
      u.eta = u.q + u.nq;
      u.etadot = u.v + u.nv;
      m.nq = u.eta + u.n_modes;
      m.nv = u.etadot + u.n_modes;
      m.n_modes += u.n_modes;
      u.mass = b.modal ? b.modal->integrals.I1 : b.mass;
      if (!b.modal) {
        u.M = about_origin(b.mass, from_eigen(b.com), symmetric(b.inertia_com));
      } else if (u.n_modes == 0) {  // a flexible body without modes is a rigid one, by the same numbers
        const ModalIntegrals& I = b.modal->integrals;
        const Eigen::Vector3d com = I.I2 / I.I1;
        const Eigen::Matrix3d inertia_com = I.I7 - I.I1 * (com.squaredNorm() * Eigen::Matrix3d::Identity() - com * com.transpose());
        u.M = about_origin(I.I1, from_eigen(com), symmetric(inertia_com));
      }
    }
    find_plain_rates();
  }

  // A hinge that moves along q + v dt has q' = v (a law of hinges), modes have eta' = etadot; neighbours are one stretch.
  void find_plain_rates() {
    Model& m = *model_;
    const auto add = [&](int q, int v, int n) {
      if (n == 0) return;
      if (!m.plain_rates.empty()) {
        PlainRates& last = m.plain_rates.back();
        if (q == last.q + last.n && v == last.v + last.n) return void(last.n += n);
      }
      m.plain_rates.push_back({q, v, n});
    };
    for (std::size_t i = 0; i < m.user.size(); ++i) {
      const UserBody& u = m.user[i];
      if (u.nq > 0 && u.hinge->retract)
        m.curved.push_back(static_cast<int>(i));
      else
        add(u.q, u.v, u.nq);
      add(u.eta, u.etadot, u.n_modes);
    }
  }

  // Inboard before outboard: level by level, in the user's order, so that neighbours do not wait for each other; trees of more than
  // `limb` bodies limb by limb, so that what a body tells its outboard bodies is read while it is near.
  void order_bodies() {
    constexpr int limb = 128;
    const std::size_t n = model_->user.size();
    std::vector<std::vector<int>> outboard(n + 1);  // of the ground, then of each body
    for (std::size_t i = 0; i < n; ++i) outboard[static_cast<std::size_t>(model_->user[i].parent + 1)].push_back(static_cast<int>(i));
    const auto on = [&](int i) -> const std::vector<int>& { return outboard[static_cast<std::size_t>(i + 1)]; };
    std::vector<int> size(n, 1), found = on(-1);
    for (std::size_t at = 0; at < found.size(); ++at) found.insert(found.end(), on(found[at]).begin(), on(found[at]).end());
    for (std::size_t at = found.size(); at-- > 0;)
      if (const int parent = model_->user[found[at]].parent; parent >= 0) size[parent] += size[found[at]];

    struct Limbs {
      std::vector<int> roots;
      int bodies = 0;
    };
    std::vector<Limbs> waiting;
    const auto wait = [&](const std::vector<int>& roots) {  // side by side as far as there is room
      const std::size_t before = waiting.size();
      for (std::size_t at = roots.size(); at-- > 0;) {
        const int root = roots[at];
        if (waiting.size() == before || waiting.back().bodies + size[root] > limb) waiting.emplace_back();
        waiting.back().roots.push_back(root);
        waiting.back().bodies += size[root];
      }
    };
    wait(on(-1));
    while (!waiting.empty()) {
      const Limbs next = std::move(waiting.back());
      waiting.pop_back();
      const bool whole = next.bodies <= limb;
      for (std::vector<int> level = next.roots, outer; !level.empty(); level = std::move(outer), outer.clear()) {
        std::ranges::sort(level);
        order_.insert(order_.end(), level.begin(), level.end());
        if (!whole) break;
        for (const int i : level) outer.insert(outer.end(), on(i).begin(), on(i).end());
      }
      if (!whole) wait(on(next.roots.front()));
    }
  }

  void build_sweep_bodies() {
    Model& m = *model_;
    m.bodies.reserve(m.user.size() + 1);
    m.bodies.emplace_back();  // ground
    m.owner.push_back(-1);
    std::vector<std::uint8_t> prescribed(static_cast<std::size_t>(m.nv), 0);
    for (const int i : order_) {
      const BodySpec& spec = spec_.bodies[i];
      UserBody& u = m.user[i];
      const UserBody* parent = u.parent >= 0 ? &m.user[u.parent] : nullptr;

      // O in the inboard user's frame, P in this body's frame; then O in the inboard SWEEP frame.
      NodeShapes O, P;
      if (spec.hinge.inboard_node.empty())
        O.pose = pose_of(spec.hinge.onode_R, spec.hinge.onode_position);
      else
        O = node_of(spec_.bodies[u.parent], spec.hinge.inboard_node, registry_.body(spec_.bodies[u.parent].type));
      if (spec.hinge.body_node.empty())
        P.pose = pose_of(spec.hinge.pnode_R, spec.hinge.pnode_position);
      else
        P = node_of(spec, spec.hinge.body_node, registry_.body(spec.type));
      u.onode = O.pose;
      u.pnode = P.pose;
      if (parent) O.pose = parent->pose * O.pose;
      const int parent_sweep = parent ? parent->sweep : 0;

      // A hinge without velocities is a constant transform.
      const bool fixed = u.nv == 0;
      if (fixed) u.merged_hinge = fixed_transform(spec.hinge, u);
      const bool rigid = u.n_modes == 0;
      const bool onto_rigid = m.bodies[parent_sweep].n_modes == 0;
      if (fixed && rigid && onto_rigid && options_.merge_locked) {
        u.sweep = parent_sweep;
        u.merged = true;
        u.pose = O.pose * u.merged_hinge * inverse(P.pose);  // user's frame in the host's sweep frame
        auto& host = m.bodies[parent_sweep];
        host.M = host.M + to_inboard(u.pose, u.M);
        continue;
      }

      SweepBody b;
      b.parent = parent_sweep;
      b.nv = static_cast<std::uint8_t>(u.nv);
      b.shape = fixed ? static_cast<std::uint8_t>(CARDAN_SHAPE_FIXED) : static_cast<std::uint8_t>(u.hinge->shape);
      b.square_root = u.nv > 0 && spec.hinge.factor == HingeFactor::square_root;
      b.q = u.q;
      b.v = u.v;
      b.O = O.pose;
      b.fixed_hinge = u.merged_hinge;
      if (b.shape >= CARDAN_SHAPE_ROTATION && b.shape <= CARDAN_SHAPE_SCREW) {
        double axis[3];
        u.hinge->axis(u.hinge_packed.data(), axis, &b.pitch);
        b.axis = {axis[0], axis[1], axis[2]};
      }
      if (O.deforms()) {
        b.onode = static_cast<int>(m.shapes.size());
        b.n_parent_modes = O.n_modes;
        m.shapes.push_back(O);
      }
      if (rigid) {
        u.pose = inverse(P.pose);  // B = P
        b.M = to_inboard(u.pose, u.M);
      } else {
        b.n_modes = u.n_modes;
        b.eta = u.eta;
        b.etadot = u.etadot;
        b.flexible = static_cast<int>(m.flexible.size());
        m.flexible.push_back(flexible_of(spec_, spec, *registry_.body(spec.type), sink_));
        if (m.field.pulls() && m.field.gradient) add_inertia_derivatives(m.flexible.back());
        if (m.field.pulls() && m.field.gradient && m.flexible.back().curved && m.flexible.back().level == 0)
          sink_.report(Code::unsupported, spec_.locate(body_path(spec)),
                       "a body whose nodes move along constant shapes, at level 0 where gravity has a gradient",
                       fmt::format("{}, whose type {} tells how they move", spec.name, in_quotes(spec.type)),
                       "level 1 or 2, or gradient: false: at level 0 the gradient is formed from the integrals of modal data");
        const bool at_origin =
            P.pose.p.x == 0 && P.pose.p.y == 0 && P.pose.p.z == 0 && (to_eigen(P.pose.R) - Eigen::Matrix3d::Identity()).isZero(0.0);
        if (P.deforms() || !at_origin) {
          b.pnode = static_cast<int>(m.shapes.size());
          m.shapes.push_back(P);
        }
      }
      for (const int c : spec.hinge.prescribed) {
        if (c < 0 || c >= u.nv) continue;
        prescribed[u.v + c] = 1;
        b.has_prescribed = true;
      }
      for (const int c : spec.prescribed_modes)
        if (c >= 0 && c < u.n_modes) prescribed[u.etadot + c] = 1;
      for (const auto& s : spec.hinge.springs)
        if (s.component >= 0 && s.component < u.nv)
          m.loads.push_back({HingeLaw::spring, u.q + s.component, u.v + s.component, {s.stiffness, s.rest, s.damping}});
      for (const HingeLoadSpec& l : spec.hinge.loads)
        if (l.component >= 0 && l.component < u.nv)
          m.loads.push_back({l.law, u.q + l.component, u.v + l.component, l.parameters, l.bounce});
      u.sweep = static_cast<int>(m.bodies.size());
      m.bodies.push_back(b);
      m.owner.push_back(i);
    }
    if (std::ranges::find(prescribed, 1) != prescribed.end()) m.prescribed = std::move(prescribed);
    prepare_nodes(m);
  }

  // Nothing that is made of the mass of these may be kept: no kernel with constants of it (choose_frames), no refinement.
  void find_varying() {
    Model& m = *model_;
    for (const DeviceSpec& d : spec_.devices) {
      const cardan_device_family* family = registry_.device(d.type);
      for (std::uint32_t i = 0; family && i < family->n_mounts; ++i) {
        const auto mount = d.mounts.find(family->mounts[i].name);
        if ((family->mounts[i].use & CARDAN_USE_HOLD) != 0 && mount != d.mounts.end()) may_stand_still(mount->second.target);
        if (family->mounts[i].kind != CARDAN_MOUNT_MASS || mount == d.mounts.end()) continue;
        const int user = m.find_body(mount->second.target);
        if (user < 0) continue;  // reported with the devices
        m.varies.resize(m.bodies.size());
        m.varies[m.user[user].sweep] = 1;
      }
    }
  }

  // The kernel of its body is one that lets components be given. "boom" or "boom.rate".
  void may_stand_still(const std::string& target) {
    Model& m = *model_;
    const int user = m.find_body(target.substr(0, target.find('.')));
    if (user < 0 || m.user[user].nv == 0) return;  // reported with the devices
    m.bodies[m.user[user].sweep].has_prescribed = true;
    m.prescribed.resize(static_cast<std::size_t>(m.nv));
  }

  void keep_varying() {
    Model& m = *model_;
    for (std::size_t k = 1; k < m.bodies.size(); ++k)
      if (m.varies[k]) m.devices.varying.push_back({static_cast<int>(k), m.bodies[k].M, m.bodies[k].M_sweep, m.bodies[k].J_P});
    int device = 0;
    std::string fault = m.weigh(m.devices.z0.data(), m.devices.marks0.data(), device);
    for (const DeviceHold& h : m.devices.holds) m.prescribed[h.v] = 0;  // what closes loops is prepared for what may move
    for (const DeviceMass& own : m.devices.masses)
      if (const double mass = m.user[own.user].mass - own.own_mass; fault.empty() && mass < 0.0)
        device = own.device, fault = fmt::format("{:g} kg", mass);
    if (fault.empty()) return;
    const std::string& name = m.devices.all[device].name;
    sink_.report(Code::out_of_range, spec_.locate("devices." + name), "initial states that give a mass >= 0", fault);
    sink_.throw_if_any();
  }

  static Pose<double> fixed_transform(const HingeSpec& hinge, const UserBody& u) {
    if (u.hinge->nq == 0) return {};
    const std::vector<double> q = initial_coordinates(*u.hinge, u.hinge_packed.data(), hinge.q), v(u.hinge->nv, 0.0);
    cardan_hinge_out out{};
    const std::uint32_t zero = 0;
    u.hinge->kinematics(u.hinge_packed.data(), 1, &zero, &zero, q.data(), v.data(), &out);
    const double* R = out.R_OP;
    return {{R[0], R[1], R[2], R[3], R[4], R[5], R[6], R[7], R[8]}, {out.p_OP[0], out.p_OP[1], out.p_OP[2]}};
  }

  void name_nodes() {
    Model& m = *model_;
    m.nodes.reserve(spec_.bodies.size());
    for (std::size_t i = 0; i < spec_.bodies.size(); ++i) {
      const BodySpec& spec = spec_.bodies[i];
      const UserBody& u = m.user[i];
      const auto add = [&](std::string name, NodeShapes s) {
        s.pose = u.pose * s.pose;  // flexible bodies: u.pose is the identity, shapes need no change of axes
        m.nodes.push_back({std::move(name), static_cast<int>(i), u.sweep, std::move(s)});
      };
      add(spec.name, {});
      for (const auto& n : spec.nodes)
        if (!spec.modal || std::ranges::none_of(spec.modal->nodes, [&](const auto& x) { return x.name == n.name; }))
          add(spec.name + "." + n.name, {pose_of(n.R_BN, n.position), 0, {}});
      if (spec.modal)
        for (std::size_t k = 0; k < spec.modal->nodes.size(); ++k)
          add(spec.name + "." + spec.modal->nodes[k].name, shapes_of(*spec.modal, k, *registry_.body(spec.type)));
    }
  }

  void choose_kernels() {
    Model& m = *model_;
    for (std::size_t k = 1; k < m.bodies.size(); ++k) {
      SweepBody& b = m.bodies[k];
      const bool general = b.n_modes > 0 || b.onode >= 0 || b.has_prescribed || b.square_root;
      const int base = static_cast<int>(BodyKernel::general0);
      m.rigid = m.rigid && !general;
      if (general)
        b.kind = static_cast<BodyKernel>(base + b.nv);
      else if (b.shape == CARDAN_SHAPE_FIXED)
        b.kind = BodyKernel::fixed;
      else if (is_axis(b.kind))
        continue;  // chosen with its frame
      else if (b.shape == CARDAN_SHAPE_FREE || b.shape == CARDAN_SHAPE_FREE_BODY)
        b.kind = BodyKernel::free;
      else if (b.shape == CARDAN_SHAPE_ROTATION)
        b.kind = BodyKernel::rotation;
      else if (b.shape == CARDAN_SHAPE_SLIDE)
        b.kind = BodyKernel::slide;
      else if (b.shape == CARDAN_SHAPE_SCREW)
        b.kind = BodyKernel::screw;
      else
        b.kind = static_cast<BodyKernel>(static_cast<int>(BodyKernel::dense1) + b.nv - 1);
    }
    fold_rotors(m);
    if (m.rigid) m.columns = column_order(m);
    const auto modes_given = [&](const SweepBody& b) {
      const auto first = m.prescribed.begin() + (m.has_prescribed() ? b.etadot : 0);
      return m.has_prescribed() && std::find(first, first + b.n_modes, 1) != first + b.n_modes;
    };
    for (std::size_t k = 1; k < m.bodies.size(); ++k) {
      const SweepBody& b = m.bodies[k];
      const bool given = b.has_prescribed || modes_given(b) || (b.onode >= 0 && modes_given(m.bodies[b.parent]));
      const bool joins = !m.runs.empty() && m.runs.back().prescribed == given && m.runs.back().square_root == b.square_root &&
                         (m.runs.back().kind == b.kind || (is_axis(m.runs.back().kind) && is_axis(b.kind)));
      if (!joins) m.runs.push_back({static_cast<int>(k), static_cast<int>(k), b.kind, given, b.square_root});
      m.runs.back().end = static_cast<int>(k) + 1;
    }
    // One batch per family that fills hinge records.
    for (const auto& entry : registry_.hinges.all()) {
      const cardan_hinge_family* const family = entry.family;
      const HingeSlopes slopes = registry_.slopes(*family);
      DenseBatch batch{family, {}, {}, {}, m.n_dense, slopes};
      std::vector<char> bytes;
      const auto close = [&] {
        if (batch.iq.empty()) return;
        batch.packed.resize((bytes.size() + 7) / 8 + 1);
        if (!bytes.empty()) std::memcpy(batch.packed.data(), bytes.data(), bytes.size());
        m.batches.push_back(std::move(batch));
        batch = {family, {}, {}, {}, m.n_dense, slopes};
        bytes.clear();
      };
      for (std::size_t k = 1; k < m.bodies.size(); ++k) {
        SweepBody& b = m.bodies[k];
        if (b.shape < CARDAN_SHAPE_BALL) continue;
        const UserBody& u = m.user[m.owner[k]];
        if (u.hinge != family || b.kind == BodyKernel::free) continue;
        b.dense = m.n_dense++;
        batch.iq.push_back(static_cast<std::uint32_t>(b.q));
        batch.iv.push_back(static_cast<std::uint32_t>(b.v));
        const char* p = reinterpret_cast<const char*>(u.hinge_packed.data());
        bytes.insert(bytes.end(), p, p + (family->packed_size ? u.hinge_packed.size() * sizeof(double) : family->params_size));
        if (family->packed_size) close();
      }
      close();
    }
  }

  // Forward dynamics; what a scene does not have is not in its program.
  void write_program() {
    Model& m = *model_;
    const int n_runs = static_cast<int>(m.runs.size());
    if (!m.batches.empty() || !m.angles.empty()) m.program.push_back({OpCode::hinge_records});
    const auto rotor = [](const SweepBody& b) { return b.kind == BodyKernel::rotor; };
    for (int r = 0; r < n_runs; ++r) {
      const Run& run = m.runs[r];
      if (!std::all_of(m.bodies.begin() + run.begin, m.bodies.begin() + run.end, rotor)) m.program.push_back({OpCode::outward, r});
    }
    if (!m.flexible.empty()) m.program.push_back({OpCode::elastic});
    const bool central = m.field.pulls();
    m.world = central || options_.world_wrenches || m.devices.reads_nodes;
    if (m.world) m.program.push_back({OpCode::world});
    if (central) m.program.push_back({OpCode::central_gravity});
    if (!m.devices.all.empty()) m.program.push_back({OpCode::devices});
    const auto strikes = [](const Device& d) {
      return std::ranges::any_of(d.mounts,
                                 [](const DeviceMount& mount) { return (mount.use & CARDAN_USE_IMPULSE) != 0 && mount.node >= 0; });
    };
    if (options_.node_wrenches || m.devices.n_loads > 0 || std::ranges::any_of(m.devices.all, strikes))
      m.program.push_back({OpCode::node_wrenches});
    if (!m.loops.empty()) m.program.push_back({OpCode::keep});
    for (int r = n_runs - 1; r >= 0; --r) m.program.push_back({OpCode::inward, r});
    for (int r = 0; r < n_runs; ++r) m.program.push_back({OpCode::acceleration, r});
    if (!m.loops.empty()) m.program.push_back({OpCode::loops});
  }

  const SystemSpec& spec_;
  const Registry& registry_;
  const CompileOptions& options_;
  DiagnosticSink sink_;
  std::vector<CheckedHinge> hinges_;  // of spec_.bodies
  std::shared_ptr<Model> model_ = std::make_shared<Model>();
  std::vector<int> order_;
  const bool graded_;
};

}  // namespace

std::shared_ptr<Model> assemble(std::shared_ptr<const SystemSpec> spec, const Registry& registry, const CompileOptions& options,
                                bool graded) {
  return Compiler(std::move(spec), registry, options, graded).run();
}

}  // namespace cardan
