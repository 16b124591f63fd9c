// SystemSpec + Registry -> Model: numbers the bodies level by level, merges rigid bodies that are fixed to each other, turns
// rigid bodies into their pnode frame (B = P: then Phi* is one rigid transformation and the hinge map needs none), folds
// constants, chooses a kernel for each body and writes the program of sweeps.
#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <numeric>
#include <span>

#include "core/model/model.hpp"
#include "core/model/validate.hpp"
#include "core/spatial/rotation.hpp"

namespace cardan {
namespace {

Pose<double> pose_of(const Eigen::Matrix3d& R, const Eigen::Vector3d& p) { return {from_eigen(R), from_eigen(p)}; }

std::vector<double> columns_of(const Eigen::MatrixXd& Phi, const Eigen::MatrixXd& Psi, int m) {
  const auto zero = [](const Eigen::MatrixXd& a) { return a.size() == 0 || a.isZero(0.0); };
  if (m == 0 || (zero(Phi) && zero(Psi))) return {};
  std::vector<double> c(static_cast<std::size_t>(6 * m), 0.0);
  Eigen::Map<Eigen::MatrixXd> out(c.data(), 6, m);
  if (Psi.size() > 0) out.topRows<3>() = Psi;
  if (Phi.size() > 0) out.bottomRows<3>() = Phi;
  return c;
}

NodeShapes shapes_of(const ModalNode& n, int n_modes) {
  NodeShapes s{pose_of(n.R_BN, n.position), 0, columns_of(n.Phi, n.Psi, n_modes)};
  if (s.deforms()) s.n_modes = n_modes;
  return s;
}

/// A node of a body as the spec gives it, in the user's body frame.
NodeShapes node_of(const BodySpec& body, const std::string& node) {
  if (node.empty()) return {};
  if (body.modal)
    for (const auto& n : body.modal->nodes)
      if (n.name == node) return shapes_of(n, body.modal->n_modes);
  for (const auto& n : body.nodes)
    if (n.name == node) return {pose_of(n.R_BN, n.position), 0, {}};
  return {};
}

FlexibleBody flexible_of(const BodySpec& body, const cardan_body_family& family, DiagnosticSink& sink) {
  const ModalData& d = *body.modal;
  const ModalIntegrals& I = d.integrals;
  const auto m = static_cast<std::uint32_t>(d.n_modes);
  const auto flat = [](const auto& list) {
    std::vector<double> out;
    for (const auto& a : list) out.insert(out.end(), a.data(), a.data() + a.size());
    return out;
  };
  const std::vector<double> I5 = flat(I.I5), I8 = flat(I.I8), I9 = flat(I.I9), ww = flat(I.rotary_ww),
                            we = flat(I.rotary_we), ee = flat(I.rotary_ee);
  std::vector<double> mass, position, inertia, Phi, Psi, Q;
  bool any_inertia = false, any_Psi = false, any_Q = false;
  for (const auto& n : d.mass_nodes) {
    any_inertia = any_inertia || !n.inertia.isZero(0.0);
    any_Psi = any_Psi || (n.Psi.size() > 0 && !n.inertia.isZero(0.0));
    any_Q = any_Q || !n.Q.empty();
  }
  const auto append = [&](std::vector<double>& to, const Eigen::MatrixXd& a, Eigen::Index rows, Eigen::Index cols) {
    const Eigen::MatrixXd full = a.size() > 0 ? a : Eigen::MatrixXd::Zero(rows, cols);
    to.insert(to.end(), full.data(), full.data() + full.size());
  };
  for (const auto& n : d.mass_nodes) {
    mass.push_back(n.mass);
    append(position, n.position, 3, 1);
    append(inertia, n.inertia, 3, 3);
    append(Phi, n.Phi, 3, m);
    append(Psi, n.Psi, 3, m);
    for (std::size_t i = 0; i < 3 && any_Q; ++i) append(Q, n.Q.empty() ? Eigen::MatrixXd() : n.Q[i], m, m);
  }
  cardan_modal_view view{};
  view.struct_size = sizeof view;
  view.n_modes = m;
  view.level = static_cast<std::uint32_t>(body.level);
  view.I1 = I.I1;
  view.I2 = I.I2.data();
  view.I3 = I.I3.data();
  view.I4 = I.I4.data();
  view.I5 = I5.data();
  view.I6 = I.I6.data();
  view.I7 = I.I7.data();
  view.I8 = I8.data();
  view.I9 = I9.empty() ? nullptr : I9.data();
  view.rotary_ww = ww.empty() ? nullptr : ww.data();
  view.rotary_we = we.empty() ? nullptr : we.data();
  view.rotary_ee = ee.empty() ? nullptr : ee.data();
  view.n_mass_nodes = static_cast<std::uint32_t>(d.mass_nodes.size());
  view.node_mass = mass.data();
  view.node_position = position.data();
  view.node_inertia = any_inertia ? inertia.data() : nullptr;
  view.node_Phi = Phi.data();
  view.node_Psi = any_Psi ? Psi.data() : nullptr;
  view.node_Q = any_Q ? Q.data() : nullptr;

  FlexibleBody f;
  f.family = &family;
  f.level = body.level;
  f.data = body.modal;
  f.packed.resize((family.packed_size(&view) + 7) / 8);
  if (family.pack(&view, f.packed.data()) != 0) {
    sink.report({Code::bad_modal_data, body.at, "lumped masses or the integrals I9 for level 2 (at most 128 modes with nodal rotary inertia)",
                 "modal data without them",
                 "level 2 takes `lumped`, and a `plate` with `rotary_inertia: false` and no yoke; a `beam` has rotary inertia at every node: take level 1", "", "", 0});
    return f;
  }
  cardan_body_facts facts{};
  facts.struct_size = sizeof facts;
  family.facts(f.packed.data(), &facts);
  f.M_ee_constant = facts.m_ee_constant;
  f.M_re_constant = facts.m_re_constant;
  f.constant = facts.m_ee_constant && facts.m_re_constant && facts.j_constant;
  f.M_re.resize(6 * m);
  f.M_ee.resize(m * m);
  double M_rr[10];
  const std::vector<double> eta(m, 0.0);
  family.mass(f.packed.data(), eta.data(), M_rr, f.M_re.data(), f.M_ee.data());
  f.M_rr = {M_rr[0], {M_rr[1], M_rr[2], M_rr[3]}, {M_rr[4], M_rr[5], M_rr[6], M_rr[7], M_rr[8], M_rr[9]}};
  const Eigen::Map<const Eigen::MatrixXd> M_ee(f.M_ee.data(), m, m), M_re(f.M_re.data(), 6, m);
  f.M_ee_identity = (M_ee - Eigen::MatrixXd::Identity(m, m)).cwiseAbs().maxCoeff() == 0.0;
  const Eigen::LLT<Eigen::MatrixXd> llt(M_ee);
  if (llt.info() != Eigen::Success) {
    sink.report({Code::bad_modal_data, body.at, "a positive definite modal mass matrix", "one that is not", "are two modes equal?", "", "", 0});
    return f;
  }
  const Eigen::MatrixXd L = llt.matrixL(), U = llt.solve(M_re.transpose());
  f.L_ee.assign(L.data(), L.data() + L.size());
  const Eigen::MatrixXd M_re_rows = M_re.transpose();
  f.M_re_rows.assign(M_re_rows.data(), M_re_rows.data() + M_re_rows.size());
  f.U.assign(U.data(), U.data() + U.size());
  const Eigen::Matrix<double, 6, 6> gram = M_re * U;
  f.gramian = {symmetric(gram.topLeftCorner<3, 3>()), from_eigen(Eigen::Matrix3d(gram.topRightCorner<3, 3>())),
               symmetric(gram.bottomRightCorner<3, 3>())};
  const auto diagonal = [](const Eigen::MatrixXd& a) { return a.size() == 0 || Eigen::MatrixXd(a - Eigen::MatrixXd(a.diagonal().asDiagonal())).isZero(0.0); };
  f.K_diagonal = diagonal(d.K) && diagonal(d.C);
  const auto store = [&](Stream& to, const Eigen::MatrixXd& a) {
    const Eigen::MatrixXd full = a.size() > 0 ? a : Eigen::MatrixXd::Zero(m, m);
    for (std::uint32_t j = 0; j < m; ++j)
      for (std::uint32_t i = 0; i < m; ++i)
        if (!f.K_diagonal || i == j) to.push_back(full(i, j));
  };
  store(f.K, d.K);
  store(f.C, d.C);
  return f;
}

/// dJ/d eta_k = I8_k + I8_k* (+ rotary), and at level 2 d^2 J / d eta_k d eta_l = I9 + I9*.
void add_inertia_derivatives(FlexibleBody& f) {
  const ModalIntegrals& I = f.data->integrals;
  const auto append = [](std::vector<double>& to, const Eigen::Matrix3d& d) {
    for (const double x : {d(0, 0), d(1, 1), d(2, 2), d(0, 1), d(0, 2), d(1, 2)}) to.push_back(x);
  };
  for (std::size_t k = 0; k < I.I8.size(); ++k) {
    Eigen::Matrix3d d = I.I8[k] + I.I8[k].transpose();
    if (!I.rotary_ww.empty()) d += I.rotary_ww[k];
    append(f.dJ, d);
  }
  if (f.level == 2)
    for (const Eigen::Matrix3d& a : I.I9) append(f.d2J, a + a.transpose());
}
/// Which elements of a list stand under each number 0 ... n - 1 that their member gives, in order.
class Groups {
 public:
  template <class T>
  Groups(const std::vector<T>& list, int T::*key, int n) : first_(static_cast<std::size_t>(n) + 1, 0), members_(list.size()) {
    for (const T& x : list) ++first_[static_cast<std::size_t>(x.*key) + 1];
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    std::vector<int> next = first_;
    for (std::size_t i = 0; i < list.size(); ++i) members_[static_cast<std::size_t>(next[static_cast<std::size_t>(list[i].*key)]++)] = static_cast<int>(i);
  }
  std::span<const int> operator[](int k) const {
    return {members_.begin() + first_[static_cast<std::size_t>(k)], members_.begin() + first_[static_cast<std::size_t>(k) + 1]};
  }

 private:
  std::vector<int> first_, members_;  // those of k: members_[first_[k]] ... members_[first_[k + 1] - 1]
};

using Long = long double;
using Mat3L = Eigen::Matrix<Long, 3, 3>;
using Vec3L = Eigen::Matrix<Long, 3, 1>;

/// CentralInertia on its way through frames: turned, moved and merged it is what it was, a particle stays one.
struct Central {
  Long m = 0;
  Vec3L c = Vec3L::Zero();
  Mat3L S = Mat3L::Zero();

  static Central of(const BodySpec& b) {
    Central out{b.mass, b.com.cast<Long>(), Mat3L::Zero()};
    Mat3L J = b.inertia_com.cast<Long>();
    if (b.modal) {
      const ModalIntegrals& I = b.modal->integrals;
      out.m = I.I1;
      out.c = I.I2.cast<Long>() / out.m;
      J = I.I7.cast<Long>() - out.m * (out.c.squaredNorm() * Mat3L::Identity() - out.c * out.c.transpose());
    }
    out.S = J.trace() / 2 * Mat3L::Identity() - J;
    return out;
  }
  Central in(const Pose<double>& X) const {
    const Mat3L R = to_eigen(X.R).cast<Long>();
    return {m, R * c + to_eigen(X.p).cast<Long>(), R * S * R.transpose()};
  }
  void operator+=(const Central& b) {
    if (m == 0) return void(*this = b);
    const Vec3L d = b.c - c;
    S += b.S + m * b.m / (m + b.m) * d * d.transpose();
    c += b.m / (m + b.m) * d;
    m += b.m;
  }
  CentralInertia down() const {
    const Eigen::Matrix3d s = S.cast<double>();
    return {static_cast<double>(m), from_eigen(Eigen::Vector3d(c.cast<double>())), symmetric(s)};
  }
};

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
      if (family && family->has_modes && !b.modal)
        sink_.report({Code::bad_modal_data, b.at, "modal data (modal: beam, plate, file or lumped)", "none", "", "", "", 0});
    }
    sink_.throw_if_any();
    model_->name = spec_.name;
    model_->gravity = spec_.gravity;
    const GravitySpec& g = spec_.gravity;
    model_->field = {g.kind == GravitySpec::Kind::uniform, g.kind == GravitySpec::Kind::central, from_eigen(g.g), g.mu, from_eigen(g.centre), g.gradient};
    number_coordinates();
    order_bodies();
    build_sweep_bodies();
    sink_.throw_if_any();
    if (graded_) take_central_inertias();
    choose_frames();
    name_nodes();
    choose_kernels();
    if (graded_) keep_central_inertias();
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

  // Inboard before outboard; within a level in the user's order.
  void order_bodies() {
    const std::size_t n = model_->user.size();
    std::vector<int> depth(n, -1), path;
    for (std::size_t i = 0; i < n; ++i) {
      for (int k = static_cast<int>(i); k >= 0 && depth[static_cast<std::size_t>(k)] < 0; k = model_->user[static_cast<std::size_t>(k)].parent)
        path.push_back(k);
      for (; !path.empty(); path.pop_back()) {
        const int parent = model_->user[static_cast<std::size_t>(path.back())].parent;
        depth[static_cast<std::size_t>(path.back())] = parent < 0 ? 0 : depth[static_cast<std::size_t>(parent)] + 1;
      }
    }
    order_.resize(n);
    std::iota(order_.begin(), order_.end(), 0);
    std::ranges::stable_sort(order_, {}, [&](int i) { return depth[static_cast<std::size_t>(i)]; });
  }

  void build_sweep_bodies() {
    Model& m = *model_;
    m.bodies.reserve(m.user.size() + 1);
    m.bodies.emplace_back();  // ground
    std::vector<std::uint8_t> prescribed(static_cast<std::size_t>(m.nv), 0);
    for (const int i : order_) {
      const BodySpec& spec = spec_.bodies[static_cast<std::size_t>(i)];
      UserBody& u = m.user[static_cast<std::size_t>(i)];
      const UserBody* parent = u.parent >= 0 ? &m.user[static_cast<std::size_t>(u.parent)] : nullptr;

      // O in the inboard user's frame, P in this body's frame; then O in the inboard SWEEP frame.
      NodeShapes O, P;
      if (spec.hinge.inboard_node.empty())
        O.pose = pose_of(spec.hinge.onode_R, spec.hinge.onode_position);
      else
        O = node_of(spec_.bodies[static_cast<std::size_t>(u.parent)], spec.hinge.inboard_node);
      if (spec.hinge.body_node.empty())
        P.pose = pose_of(spec.hinge.pnode_R, spec.hinge.pnode_position);
      else
        P = node_of(spec, spec.hinge.body_node);
      u.onode = O.pose;
      u.pnode = P.pose;
      if (parent) O.pose = parent->pose * O.pose;
      const int parent_sweep = parent ? parent->sweep : 0;

      // A hinge without velocities is a constant transform.
      const bool fixed = u.nv == 0;
      if (fixed) u.merged_hinge = fixed_transform(spec.hinge, u);
      const bool rigid = u.n_modes == 0;
      const bool onto_rigid = m.bodies[static_cast<std::size_t>(parent_sweep)].n_modes == 0;
      if (fixed && rigid && onto_rigid && options_.merge_locked) {
        u.sweep = parent_sweep;
        u.merged = true;
        u.pose = O.pose * u.merged_hinge * inverse(P.pose);  // user's frame in the host's sweep frame
        auto& host = m.bodies[static_cast<std::size_t>(parent_sweep)];
        host.M = host.M + to_inboard(u.pose, u.M);
        continue;
      }

      SweepBody b;
      b.parent = parent_sweep;
      b.nv = static_cast<std::uint8_t>(u.nv);
      b.shape = fixed ? static_cast<std::uint8_t>(CARDAN_SHAPE_FIXED) : static_cast<std::uint8_t>(u.hinge->shape);
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
        m.flexible.push_back(flexible_of(spec, *registry_.body(spec.type), sink_));
        if (m.field.central) add_inertia_derivatives(m.flexible.back());
        const bool at_origin = P.pose.p.x == 0 && P.pose.p.y == 0 && P.pose.p.z == 0 &&
                               (to_eigen(P.pose.R) - Eigen::Matrix3d::Identity()).isZero(0.0);
        if (P.deforms() || !at_origin) {
          b.pnode = static_cast<int>(m.shapes.size());
          m.shapes.push_back(P);
        }
      }
      for (const int c : spec.hinge.prescribed) {
        if (c < 0 || c >= u.nv) continue;
        prescribed[static_cast<std::size_t>(u.v + c)] = 1;
        b.has_prescribed = true;
      }
      for (const int c : spec.prescribed_modes)
        if (c >= 0 && c < u.n_modes) prescribed[static_cast<std::size_t>(u.etadot + c)] = 1;
      for (const auto& s : spec.hinge.springs)
        if (s.component >= 0 && s.component < u.nv) m.springs.push_back({u.q + s.component, u.v + s.component, s.stiffness, s.rest, s.damping});
      u.sweep = static_cast<int>(m.bodies.size());
      m.bodies.push_back(b);
    }
    if (std::ranges::find(prescribed, 1) != prescribed.end()) m.prescribed = std::move(prescribed);
    prepare_nodes();
  }

  // Which flexible bodies are eliminated through their outboard nodes (flexible.md, 7), and the constants for it.
  void prepare_nodes() {
    Model& m = *model_;
    for (std::size_t k = 1; k < m.bodies.size(); ++k)
      if (m.bodies[k].onode >= 0) m.flexible[static_cast<std::size_t>(m.bodies[static_cast<std::size_t>(m.bodies[k].parent)].flexible)].attached.push_back(static_cast<int>(k));
    for (const SweepBody& b : m.bodies) {
      if (b.n_modes == 0) continue;
      FlexibleBody& f = m.flexible[static_cast<std::size_t>(b.flexible)];
      bool masked = false;
      for (int j = b.etadot; m.has_prescribed() && j < b.etadot + b.n_modes; ++j) masked = masked || m.prescribed[static_cast<std::size_t>(j)];
      const bool moves_at_P = b.pnode >= 0 && m.shapes[static_cast<std::size_t>(b.pnode)].deforms();
      // With more than six modes per node the factor of P_ee takes more operations (and more time from six on); 6 n <= m must hold.
      f.by_nodes = f.M_ee_constant && !moves_at_P && !masked && !f.attached.empty() && b.n_modes > 6 * static_cast<int>(f.attached.size());
      const Eigen::Index n = static_cast<Eigen::Index>(6 * f.attached.size()), modes = b.n_modes;
      const Eigen::Map<const Eigen::MatrixXd> M_re(f.M_re.data(), 6, modes), U(f.U.data(), modes, 6);
      Eigen::MatrixXd S(n, modes);
      for (std::size_t c = 0; c < f.attached.size(); ++c) {
        const SweepBody& child = m.bodies[static_cast<std::size_t>(f.attached[c])];
        S.middleRows<6>(static_cast<Eigen::Index>(6 * c)) =
            Eigen::Map<const Eigen::Matrix<double, 6, Eigen::Dynamic>>(m.shapes[static_cast<std::size_t>(child.onode)].columns.data(), 6, modes);
      }
      const auto append = [](const Eigen::MatrixXd& a, auto& to) { to.insert(to.end(), a.data(), a.data() + a.size()); };
      const auto below = [](const Eigen::MatrixXd& top, const Eigen::MatrixXd& bottom) {
        Eigen::MatrixXd both(top.rows() + bottom.rows(), bottom.cols());
        both << top, bottom;
        return both;
      };
      append(f.constant ? below(M_re, S) : S, f.shapes);
      Eigen::MatrixXd V(modes, 0);
      if (f.by_nodes) {
        const Eigen::Map<const Eigen::MatrixXd> L(f.L_ee.data(), modes, modes);
        // L^-1 S* = Z R by reflections (nothing is squared): V = L^-* Z, Q = R*
        const Eigen::HouseholderQR<Eigen::MatrixXd> qr(L.triangularView<Eigen::Lower>().solve(S.transpose()));
        const Eigen::MatrixXd Z = qr.householderQ() * Eigen::MatrixXd::Identity(modes, n);
        const Eigen::MatrixXd R = qr.matrixQR().topRows(n).triangularView<Eigen::Upper>();
        V = L.transpose().triangularView<Eigen::Upper>().solve(Z);
        append(M_re * V, f.MV);
        append(R, f.Q);
      }
      if (!f.M_re_constant && !f.by_nodes) continue;
      const Eigen::MatrixXd columns = f.M_re_constant ? below(U.transpose(), V.transpose()) : V.transpose();
      append(columns, f.UV_columns);
      append(columns.transpose(), f.UV);
    }
  }

  static Pose<double> fixed_transform(const HingeSpec& hinge, const UserBody& u) {
    if (u.hinge->nq == 0) return {};
    std::vector<double> q(u.hinge->nq, 0.0), v(u.hinge->nv, 0.0);
    if (u.hinge->zero) u.hinge->zero(u.hinge_packed.data(), q.data());
    if (hinge.q.size() == q.size()) q = hinge.q;
    cardan_hinge_out out{};
    const std::uint32_t zero = 0;
    u.hinge->kinematics(u.hinge_packed.data(), 1, &zero, &zero, q.data(), v.data(), &out);
    const double* R = out.R_OP;
    return {{R[0], R[1], R[2], R[3], R[4], R[5], R[6], R[7], R[8]}, {out.p_OP[0], out.p_OP[1], out.p_OP[2]}};
  }

  /// Of the sweep bodies, before their frames are chosen.
  void take_central_inertias() {
    Model& m = *model_;
    central_.resize(m.bodies.size());
    for (const int i : order_)
      if (const UserBody& u = m.user[static_cast<std::size_t>(i)]; u.sweep > 0)
        central_[static_cast<std::size_t>(u.sweep)] += Central::of(spec_.bodies[static_cast<std::size_t>(i)]).in(u.pose);
    if (options_.choose_frames) turn_dense_frames();
  }

  // A light body between two heavy ones feels their tension along the line between its hinges, p x f with f along p. Where its inboard
  // hinge lets it turn about that line (a ball), rounding of this couple would turn it: hence a frame whose x axis is p of the
  // heaviest outboard part, in which the component is exactly zero.
  void turn_dense_frames() {
    Model& m = *model_;
    const int n = static_cast<int>(m.bodies.size());
    const Groups outboard(m.bodies, &SweepBody::parent, n), carried(m.user, &UserBody::sweep, n);
    std::vector<Long> subtree(m.bodies.size(), 0);
    for (std::size_t k = m.bodies.size() - 1; k > 0; --k) {
      subtree[k] += central_[k].m;
      subtree[static_cast<std::size_t>(m.bodies[k].parent)] += subtree[k];
    }
    for (int k = 1; k < n; ++k) {
      SweepBody& b = m.bodies[static_cast<std::size_t>(k)];
      if (b.nv < 2 || b.shape < CARDAN_SHAPE_BALL || b.shape == CARDAN_SHAPE_FREE || b.shape == CARDAN_SHAPE_FREE_BODY) continue;
      const auto heaviest = std::ranges::max_element(outboard[k], {}, [&](int c) { return subtree[static_cast<std::size_t>(c)]; });
      if (heaviest == outboard[k].end()) continue;
      SweepBody& child = m.bodies[static_cast<std::size_t>(*heaviest)];
      const Vec3L p = to_eigen(child.O.p).cast<Long>();
      if ((p.array() != 0).count() < 2) continue;
      Mat3L R;  // S in P
      int least = 0;
      p.cwiseAbs().minCoeff(&least);
      R.col(0) = p.normalized();
      R.col(1) = (Vec3L::Unit(least) - R.col(0) * R(least, 0)).normalized();
      R.col(2) = R.col(0).cross(R.col(1));
      const Pose<double> S{from_eigen(Eigen::Matrix3d(R.cast<double>())), {}}, back = inverse(S);
      for (const int u : carried[k]) m.user[static_cast<std::size_t>(u)].pose = back * m.user[static_cast<std::size_t>(u)].pose;
      for (const int c : outboard[k]) m.bodies[static_cast<std::size_t>(c)].O = back * m.bodies[static_cast<std::size_t>(c)].O;
      child.O.p = {static_cast<double>(p.norm()), 0.0, 0.0};
      b.M = to_inboard(back, b.M);
      Central& central = central_[static_cast<std::size_t>(k)];
      central.c = (R.transpose() * central.c).eval();
      central.S = (R.transpose() * central.S * R).eval();
      m.graded.turned.push_back({k, S.R});
    }
  }

  /// As the sweeps read them, in the frames chosen.
  void keep_central_inertias() {
    Model& m = *model_;
    std::vector<Central> swept = central_;
    for (const int k : m.rotors) {
      const SweepBody& b = m.bodies[static_cast<std::size_t>(k)];
      Central& rotor = central_[static_cast<std::size_t>(k)];
      rotor = rotor.in(b.O);
      swept[static_cast<std::size_t>(b.parent)] += rotor;
    }
    for (std::size_t k = 0; k < m.bodies.size(); ++k) {
      m.graded.own.push_back(central_[k].down());
      m.graded.swept.push_back(swept[k].down());
    }
    std::vector<int> parts(m.bodies.size(), 0);  // user bodies and rotors that make up a sweep body
    for (const UserBody& u : m.user) ++parts[static_cast<std::size_t>(u.sweep)];
    for (const int k : m.rotors) ++parts[static_cast<std::size_t>(m.bodies[static_cast<std::size_t>(k)].parent)];
    for (const UserNode& node : m.nodes) {  // a force at the mass centre of a body by itself has no couple, to the last bit
      const auto k = static_cast<std::size_t>(node.sweep);
      const UserBody& u = m.user[static_cast<std::size_t>(node.body)];
      const BodySpec& spec = spec_.bodies[static_cast<std::size_t>(node.body)];
      const Central own = Central::of(spec);
      const std::string name = node.name == spec.name ? std::string() : node.name.substr(spec.name.size() + 1);
      Vec3L arm = to_eigen(u.pose.R).cast<Long>() * (to_eigen(node_of(spec, name).pose.p).cast<Long>() - own.c);
      if (parts[k] > 1) arm += own.in(u.pose).c - swept[k].c;
      m.graded.arm.push_back(from_eigen(Eigen::Vector3d(arm.cast<double>())));
    }
  }

  // Frames of rigid bodies on one rotation, re-chosen so that the axis is a coordinate axis of the body and the constant
  // rotation between O and the inboard body vanishes or is one or two rotations in a plane (kernels_axis.hpp).
  void choose_frames() {
    Model& m = *model_;
    if (!options_.choose_frames) return;
    const int n = static_cast<int>(m.bodies.size());
    m.axis_bodies.resize(m.bodies.size());
    const Groups outboard(m.bodies, &SweepBody::parent, n), carried(m.user, &UserBody::sweep, n);  // by sweep body
    const auto served = [&](int k) {
      const SweepBody& b = m.bodies[static_cast<std::size_t>(k)];
      return b.shape == CARDAN_SHAPE_ROTATION && b.n_modes == 0 && b.onode < 0 && !b.has_prescribed;
    };
    for (int k = 1; k < n; ++k) {
      if (!served(k)) continue;
      SweepBody& b = m.bodies[static_cast<std::size_t>(k)];
      AxisBody& a = m.axis_bodies[static_cast<std::size_t>(k)];
      const Eigen::Matrix3d R_AO = to_eigen(b.O.R);
      const Eigen::Vector3d axis_A = R_AO * to_eigen(b.axis), p_A = to_eigen(b.O.p);
      const double slide = axis_A.dot(p_A);
      int i = -1;
      for (int c = 0; c < 3; ++c)
        if (std::abs(axis_A[c] - 1.0) < 1e-15 && axis_A.cwiseAbs().sum() - std::abs(axis_A[c]) < 4e-16) i = c;
      Eigen::Matrix3d R_AS;  // new frame S at q = 0 in A
      Eigen::Vector3d offset = p_A - slide * axis_A;
      if (i >= 0) {
        R_AS.setIdentity();
        offset[i] = 0.0;
        b.kind = static_cast<KernelKind>(static_cast<int>(KernelKind::axis_x) + i);
      } else {
        i = 2;
        const double beta = std::atan2(std::hypot(axis_A.x(), axis_A.y()), axis_A.z());
        const double alpha = std::abs(axis_A.y()) < 1e-15 * std::abs(axis_A.x()) && axis_A.x() > 0 ? 0.0 : std::atan2(axis_A.y(), axis_A.x());
        a.cos_alpha = std::cos(alpha), a.sin_alpha = std::sin(alpha), a.cos_beta = std::cos(beta), a.sin_beta = std::sin(beta);
        R_AS << a.cos_alpha * a.cos_beta, -a.sin_alpha, a.cos_alpha * a.sin_beta, a.sin_alpha * a.cos_beta, a.cos_alpha,
            a.sin_alpha * a.sin_beta, -a.sin_beta, 0.0, a.cos_beta;
        b.kind = alpha == 0.0 ? KernelKind::tilt : KernelKind::tilt2;
      }
      Eigen::Vector3d l = R_AS.transpose() * offset;
      l[i] = 0.0;
      Eigen::Matrix3d R_PS = R_AO.transpose() * R_AS;  // S in the old frame P, at q = 0
      // The frame may still be turned about its own axis: if that brings the axis of an outboard hinge onto a coordinate
      // axis, or at least into the x-z plane, so that the outboard body needs less.
      const double turn = best_turn(outboard[k], i, R_PS, served);
      if (turn != 0.0) {
        Eigen::Vector3d e = Eigen::Vector3d::Zero();
        e[i] = 1.0;
        R_PS = R_PS * to_eigen(rotation_about(from_eigen(e), std::sin(turn), std::cos(turn)));
        b.q0 = turn;
      }
      const Pose<double> C{from_eigen(R_PS), from_eigen(Eigen::Vector3d(-slide * to_eigen(b.axis)))};  // S in P
      const Pose<double> back = inverse(C);
      turn_inertia(C, i, b, a, graded_ ? &central_[static_cast<std::size_t>(k)] : nullptr);
      for (const int u : carried[k]) m.user[static_cast<std::size_t>(u)].pose = back * m.user[static_cast<std::size_t>(u)].pose;
      for (const int child : outboard[k]) m.bodies[static_cast<std::size_t>(child)].O = back * m.bodies[static_cast<std::size_t>(child)].O;
      b.O = pose_of(R_AS, R_AS * l);
      b.axis = {i == 0 ? 1.0 : 0.0, i == 1 ? 1.0 : 0.0, i == 2 ? 1.0 : 0.0};
      a.parent = b.parent;
      a.q = b.q;
      a.v = b.v;
      a.q0 = b.q0;
      a.p[0] = b.O.p.x, a.p[1] = b.O.p.y, a.p[2] = b.O.p.z;
      a.l[0] = l[(i + 1) % 3], a.l[1] = l[(i + 2) % 3];
    }
  }

  // The inertia of body b seen from S (pose C in P), whose axis i is the hinge axis u, exactly: the inertia about a hinge may be
  // ten orders below the others, and a rotation that is orthogonal to round-off only would lose it. Hence long double, u kept
  // as it is, and the second moments S = (tr J/2) 1 - J in place of J: those of a slender body are small by themselves.
  static void turn_inertia(const Pose<double>& C, int i, SweepBody& b, AxisBody& a, Central* central) {
    const Mat3L R = to_eigen(C.R).cast<Long>();
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    Mat3L Q;
    Q.col(i) = to_eigen(b.axis).cast<Long>().normalized();
    Q.col(j) = (R.col(j) - Q.col(i) * Q.col(i).dot(R.col(j))).normalized();
    Q.col(k) = Q.col(i).cross(Q.col(j));
    const RigidInertia<Long> M = cast<Long>(b.M);
    Mat3L S;
    S << 0.5L * ((M.J.yy - M.J.xx) + M.J.zz), -M.J.xy, -M.J.xz, -M.J.xy, 0.5L * ((M.J.xx - M.J.yy) + M.J.zz), -M.J.yz, -M.J.xz, -M.J.yz,
        0.5L * ((M.J.xx - M.J.zz) + M.J.yy);
    const Vec3L d = to_eigen(C.p).cast<Long>(), h = to_eigen(b.M.h).cast<Long>();
    S += M.m * d * d.transpose() - d * h.transpose() - h * d.transpose();
    S = (Q.transpose() * S * Q).eval();
    Vec3L h_S = Q.transpose() * (h - M.m * d);
    const auto without_noise = [](Mat3L& moments, Vec3L& first, Long size) {  // round-off of the rotation itself
      const Long noise = 1e-18L * moments.trace();
      for (int r = 0; r < 3; ++r) {
        if (std::abs(first[r]) < 1e-18L * size) first[r] = 0;
        for (int c = 0; c < 3; ++c)
          if (r != c && std::abs(moments(r, c)) < noise) moments(r, c) = 0;
      }
    };
    without_noise(S, h_S, h.norm() + M.m * d.norm());
    if (central) {
      const Long size = central->c.norm() + d.norm();
      central->c = (Q.transpose() * (central->c - d)).eval();
      central->S = (Q.transpose() * central->S * Q).eval();
      without_noise(central->S, central->c, size);
    }
    const auto down = [](Long x) { return static_cast<double>(x); };
    b.M.h = {down(h_S[0]), down(h_S[1]), down(h_S[2])};
    b.M.J = {down(S(1, 1) + S(2, 2)), down(S(0, 0) + S(2, 2)), down(S(0, 0) + S(1, 1)), down(-S(0, 1)), down(-S(0, 2)), down(-S(1, 2))};
    const Long second[6] = {S(0, 0), S(1, 1), S(2, 2), S(0, 1), S(0, 2), S(1, 2)};
    std::transform(second, second + 6, a.S, down);
  }

  // Angle about axis i of a body (frame R_PS) that serves its first outboard axis hinge best; 0 if some fits already.
  template <class Served>
  double best_turn(std::span<const int> outboard, int i, const Eigen::Matrix3d& R_PS, const Served& served) const {
    const Model& m = *model_;
    double best = 0.0;
    bool found = false;
    for (const int child : outboard) {
      const SweepBody& c = m.bodies[static_cast<std::size_t>(child)];
      if (!served(child)) continue;
      const Eigen::Vector3d a = R_PS.transpose() * (to_eigen(c.O.R) * to_eigen(c.axis));
      if (a.maxCoeff() > 1.0 - 1e-15) return 0.0;
      if (found) continue;
      found = true;
      const int j = (i + 1) % 3, h = (i + 2) % 3;
      if (std::hypot(a[j], a[h]) < 1e-12) continue;           // parallel or opposite: nothing to gain
      if (std::abs(a[i]) < 1e-15 || i != 1) {
        // rotate so that the component across the axis points along x (i = z), z (i = x), or any coordinate axis
        const double now = std::atan2(a[h], a[j]);              // angle in the j, h plane
        const double wanted = i == 0 ? 0.5 * std::numbers::pi : 0.0;  // i = 0: j = y, h = z -> along z;  i = 2: j = x -> along x
        best = now - wanted;
      }
    }
    return best;
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
        for (const auto& n : spec.modal->nodes) add(spec.name + "." + n.name, shapes_of(n, spec.modal->n_modes));
    }
  }

  void choose_kernels() {
    Model& m = *model_;
    for (std::size_t k = 1; k < m.bodies.size(); ++k) {
      SweepBody& b = m.bodies[k];
      const bool general = b.n_modes > 0 || b.onode >= 0 || b.has_prescribed;
      const int base = static_cast<int>(KernelKind::general0);
      m.rigid = m.rigid && !general;
      if (general)
        b.kind = static_cast<KernelKind>(base + b.nv);
      else if (b.shape == CARDAN_SHAPE_FIXED)
        b.kind = KernelKind::fixed;
      else if (is_axis(b.kind))
        continue;  // chosen with its frame
      else if (b.shape == CARDAN_SHAPE_FREE || b.shape == CARDAN_SHAPE_FREE_BODY)
        b.kind = KernelKind::free;
      else if (b.shape == CARDAN_SHAPE_ROTATION)
        b.kind = KernelKind::rotation;
      else if (b.shape == CARDAN_SHAPE_SLIDE)
        b.kind = KernelKind::slide;
      else if (b.shape == CARDAN_SHAPE_SCREW)
        b.kind = KernelKind::screw;
      else
        b.kind = static_cast<KernelKind>(static_cast<int>(KernelKind::dense1) + b.nv - 1);
    }
    fold_rotors();
    const auto modes_given = [&](const SweepBody& b) {
      const auto first = m.prescribed.begin() + (m.has_prescribed() ? b.etadot : 0);
      return m.has_prescribed() && std::find(first, first + b.n_modes, 1) != first + b.n_modes;
    };
    for (std::size_t k = 1; k < m.bodies.size(); ++k) {
      const SweepBody& b = m.bodies[k];
      const bool given = b.has_prescribed || modes_given(b) || (b.onode >= 0 && modes_given(m.bodies[static_cast<std::size_t>(b.parent)]));
      const bool joins = !m.runs.empty() && m.runs.back().prescribed == given &&
                         (m.runs.back().kind == b.kind || (is_axis(m.runs.back().kind) && is_axis(b.kind)));
      if (!joins) m.runs.push_back({static_cast<int>(k), static_cast<int>(k), b.kind, given});
      m.runs.back().end = static_cast<int>(k) + 1;
    }
    // One batch per family that fills hinge records.
    std::vector<int> carrier(m.bodies.size(), -1);
    for (std::size_t i = 0; i < m.user.size(); ++i)
      if (!m.user[i].merged) carrier[static_cast<std::size_t>(m.user[i].sweep)] = static_cast<int>(i);
    for (const auto& entry : registry_.hinges()) {
      DenseBatch batch{entry.family, {}, {}, {}, m.n_dense};
      const std::size_t words = (entry.family->params_size + 7) / 8;
      std::vector<char> bytes;
      for (std::size_t k = 1; k < m.bodies.size(); ++k) {
        SweepBody& b = m.bodies[k];
        if (b.shape < CARDAN_SHAPE_BALL) continue;
        const UserBody& u = m.user[static_cast<std::size_t>(carrier[k])];
        if (u.hinge != entry.family || b.kind == KernelKind::free) continue;
        b.dense = m.n_dense++;
        batch.iq.push_back(static_cast<std::uint32_t>(b.q));
        batch.iv.push_back(static_cast<std::uint32_t>(b.v));
        const char* p = reinterpret_cast<const char*>(u.hinge_packed.data());
        bytes.insert(bytes.end(), p, p + entry.family->params_size);
      }
      if (batch.iq.empty()) continue;
      batch.packed.resize(words * batch.iq.size() + 1);
      if (!bytes.empty()) std::memcpy(batch.packed.data(), bytes.data(), bytes.size());
      m.batches.push_back(std::move(batch));
    }
  }

  // Axisymmetric leaves on one rotation, on a rigid body: their inertia seen from that body is constant, so it becomes part of
  // it (kernels_axis.hpp). Then what the axis kernels read of each body.
  void fold_rotors() {
    Model& m = *model_;
    const std::size_t n = m.bodies.size();
    std::vector<std::uint8_t> carries(n, 0);  // something hangs on it
    for (std::size_t k = 1; k < n; ++k) carries[static_cast<std::size_t>(m.bodies[k].parent)] = 1;
    for (std::size_t k = 1; k < n; ++k) m.bodies[k].M_sweep = m.bodies[k].M, m.bodies[k].J_P = m.bodies[k].M.J;
    for (std::size_t k = 1; k < n; ++k) {
      SweepBody& b = m.bodies[k];
      SweepBody& carrier = m.bodies[static_cast<std::size_t>(b.parent)];
      if (!is_axis(b.kind) || carries[k] || b.parent == 0 || carrier.n_modes > 0 || !is_axisymmetric(b)) continue;
      AxisBody& a = m.axis_bodies[k];
      const int i = axis_index(b.kind);
      const Eigen::Vector3d u = to_eigen(b.O.R).col(i);
      a.J_axial = to_eigen(b.M.J)(i, i);
      for (int c = 0; c < 3; ++c) a.u[c] = u[c];
      const RigidInertia<double> seen = to_inboard(b.O, b.M);
      b.M_sweep = seen;
      carrier.M_sweep = carrier.M_sweep + seen;
      carrier.J_P = carrier.J_P + seen.J + symmetric(-a.J_axial * u * u.transpose());
      if (is_axis(carrier.kind)) {
        const Eigen::Matrix3d J = to_eigen(seen.J), S = 0.5 * J.trace() * Eigen::Matrix3d::Identity() - J;
        double* to = m.axis_bodies[static_cast<std::size_t>(b.parent)].S;
        for (const double x : {S(0, 0), S(1, 1), S(2, 2), S(0, 1), S(0, 2), S(1, 2)}) *to++ += x;
      }
      b.kind = KernelKind::rotor;
      m.rotors.push_back(static_cast<int>(k));
    }
    std::vector<int> last(n, 0);  // child with the highest index that is no rotor: the first that comes from the tip
    for (std::size_t k = 1; k < n; ++k)
      if (m.bodies[k].kind != KernelKind::rotor) last[static_cast<std::size_t>(m.bodies[k].parent)] = static_cast<int>(k);
    for (std::size_t k = 1; k < n; ++k) {
      SweepBody& b = m.bodies[k];
      if (!is_axis(b.kind)) continue;
      AxisBody& a = m.axis_bodies[k];
      a.kind = b.kind;
      if (b.kind != KernelKind::rotor) {
        a.angle = static_cast<int>(m.angles.size());
        m.angles.push_back({a.q, a.q0});
      }
      const int child = last[k];
      a.leaf = child == 0;
      if (child > 0 && is_axis(m.bodies[static_cast<std::size_t>(child)].kind)) m.axis_bodies[static_cast<std::size_t>(child)].first = a.written_by_child = true;
      const RigidInertia<double>& M = b.M_sweep;
      a.m = M.m;
      a.h[0] = M.h.x, a.h[1] = M.h.y, a.h[2] = M.h.z;
      a.P = articulated(M);
      a.P.J = b.J_P;
    }
  }

  static int axis_index(KernelKind kind) { return kind == KernelKind::axis_x ? 0 : kind == KernelKind::axis_y ? 1 : 2; }

  /// To round-off: mass centre on the hinge axis, which is a principal axis between two equal moments.
  static bool is_axisymmetric(const SweepBody& b) {
    const int i = axis_index(b.kind), j = (i + 1) % 3, k = (i + 2) % 3;
    const Eigen::Matrix3d J = to_eigen(b.M.J);
    const Eigen::Vector3d h = to_eigen(b.M.h);
    const double small = 4e-16 * J.trace(), small_h = 4e-16 * std::sqrt(b.M.m * J.trace());
    return J(i, i) > 0 && std::abs(J(j, j) - J(k, k)) <= small && std::abs(J(i, j)) <= small && std::abs(J(i, k)) <= small &&
           std::abs(J(j, k)) <= small && std::abs(h[j]) <= small_h && std::abs(h[k]) <= small_h;
  }

  // Forward dynamics; what a scene does not have is not in its program.
  void write_program() {
    Model& m = *model_;
    const int n_runs = static_cast<int>(m.runs.size());
    if (!m.batches.empty() || !m.angles.empty()) m.program.push_back({Kernel::hinge_records});
    const auto rotor = [](const SweepBody& b) { return b.kind == KernelKind::rotor; };
    for (int r = 0; r < n_runs; ++r) {
      const Run& run = m.runs[static_cast<std::size_t>(r)];
      if (!std::all_of(m.bodies.begin() + run.begin, m.bodies.begin() + run.end, rotor)) m.program.push_back({Kernel::outward, r});
    }
    if (!m.flexible.empty()) m.program.push_back({Kernel::elastic});
    const bool central = m.gravity.kind == GravitySpec::Kind::central;
    m.world = central || options_.world_wrenches;
    if (m.world) m.program.push_back({Kernel::world});
    if (central) m.program.push_back({Kernel::central_gravity});
    if (options_.node_wrenches) m.program.push_back({Kernel::node_wrenches});
    for (int r = n_runs - 1; r >= 0; --r) m.program.push_back({Kernel::inward, r});
    for (int r = 0; r < n_runs; ++r) m.program.push_back({Kernel::acceleration, r});
  }

  const SystemSpec& spec_;
  const Registry& registry_;
  const CompileOptions& options_;
  DiagnosticSink sink_;
  std::vector<CheckedHinge> hinges_;  // of spec_.bodies
  std::shared_ptr<Model> model_ = std::make_shared<Model>();
  std::vector<int> order_;
  const bool graded_;
  std::vector<Central> central_;      // per sweep body, where `graded_`
};

}  // namespace

std::shared_ptr<Model> assemble(std::shared_ptr<const SystemSpec> spec, const Registry& registry, const CompileOptions& options, bool graded) {
  return Compiler(std::move(spec), registry, options, graded).run();
}

int Model::find_body(std::string_view wanted) const {
  for (std::size_t i = 0; i < user.size(); ++i)
    if (user[i].name == wanted) return static_cast<int>(i);
  return -1;
}

int Model::find_node(std::string_view wanted) const {
  for (std::size_t i = 0; i < nodes.size(); ++i)
    if (nodes[i].name == wanted) return static_cast<int>(i);
  return -1;
}

State Model::initial_state() const {
  State s;
  s.q = Eigen::VectorXd::Zero(nq);
  s.v = Eigen::VectorXd::Zero(nv);
  for (std::size_t i = 0; i < user.size(); ++i) {
    const UserBody& u = user[i];
    const BodySpec& b = spec->bodies[i];
    if (u.nq > 0) {
      if (u.hinge->zero) u.hinge->zero(u.hinge_packed.data(), s.q.data() + u.q);
      for (std::size_t j = 0; j < b.hinge.q.size() && j < static_cast<std::size_t>(u.nq); ++j) s.q[u.q + static_cast<int>(j)] = b.hinge.q[j];
      for (std::size_t j = 0; j < b.hinge.v.size() && j < static_cast<std::size_t>(u.nv); ++j) s.v[u.v + static_cast<int>(j)] = b.hinge.v[j];
    }
    for (std::size_t j = 0; j < b.eta.size() && j < static_cast<std::size_t>(u.n_modes); ++j) s.q[u.eta + static_cast<int>(j)] = b.eta[j];
    for (std::size_t j = 0; j < b.etadot.size() && j < static_cast<std::size_t>(u.n_modes); ++j) s.v[u.etadot + static_cast<int>(j)] = b.etadot[j];
  }
  return s;
}

void Model::qdot(const double* q, const double* v, double* out) const {
  for (const PlainRates& r : plain_rates) std::copy_n(v + r.v, r.n, out + r.q);
  for (const int i : curved) {
    const UserBody& u = user[static_cast<std::size_t>(i)];
    u.hinge->qdot(u.hinge_packed.data(), q + u.q, v + u.v, out + u.q);
  }
}

void Model::normalise(double* q) const {
  for (const auto& u : user)
    if (u.nq > 0 && u.hinge->normalise) u.hinge->normalise(u.hinge_packed.data(), q + u.q);
}

void Model::retract(const double* q, const double* d, double* out) const {
  for (const auto& u : user) {
    if (u.nq > 0 && u.hinge->retract)
      u.hinge->retract(u.hinge_packed.data(), q + u.q, d + u.v, out + u.q);
    else
      for (int j = 0; j < u.nq; ++j) out[u.q + j] = q[u.q + j] + d[u.v + j];
    for (int j = 0; j < u.n_modes; ++j) out[u.eta + j] = q[u.eta + j] + d[u.etadot + j];
  }
}

void Model::difference(const double* q1, const double* q2, double* d) const {
  for (const auto& u : user) {
    if (u.nq > 0 && u.hinge->difference)
      u.hinge->difference(u.hinge_packed.data(), q1 + u.q, q2 + u.q, d + u.v);
    else
      for (int j = 0; j < u.nq; ++j) d[u.v + j] = q2[u.q + j] - q1[u.q + j];
    for (int j = 0; j < u.n_modes; ++j) d[u.etadot + j] = q2[u.eta + j] - q1[u.eta + j];
  }
}

}  // namespace cardan
