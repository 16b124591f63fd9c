// Bodies whose family tells how their nodes move. The type of docs/extending/body.md, a carriage with a pendulum as one body of one
// coordinate, against the same mechanism of two bodies and a revolute hinge; and modal_flexible with its constant shapes told by node().
#include <Eigen/Geometry>
#include <random>

#include "core/abi/body_laws.hpp"
#include "core/dynamics/batch.hpp"
#include "core/dynamics/momenta.hpp"
#include "core/operators/apply.hpp"
#include "core/operators/linear_model.hpp"
#include "core/operators/sensitivity.hpp"
#include "core/sim/simulation.hpp"
#include "tests/plugins/told_modal.hpp"
#include "tests/properties/accurate.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {
namespace {

using Eigen::Matrix3d;

// ---- modal_flexible in other coordinates ----

/// eta of the modal data = (exp(a_k x_k) - 1) / a_k: its value and two derivatives.
struct Bent {
  VectorXd eta, slope, curve;
  explicit Bent(const Eigen::Ref<const VectorXd>& x) : eta(x.size()), slope(x.size()), curve(x.size()) {
    for (Eigen::Index k = 0; k < x.size(); ++k) {
      const double a = 0.8 + 0.3 * static_cast<double>(k % 3);
      eta[k] = std::expm1(a * x[k]) / a, slope[k] = std::exp(a * x[k]), curve[k] = a * slope[k];
    }
  }
};
Eigen::Map<const VectorXd> numbers_of(const void* packed, const double* x) {
  return {x, static_cast<Eigen::Index>(ToldShapes::of(packed).n_modes)};
}

/// modal_flexible with x for coordinates: nothing of it is constant, all of its nodes are curved.
const cardan_body_family& bent_modal() {
  static const cardan_body_family table = [] {
    cardan_body_family t = told_modal();
    t.type = "test/bent_modal";
    t.facts = nullptr;
    t.mass = [](const void* packed, const double* x, double* rr, double* re, double* ee) {
      const Bent at(numbers_of(packed, x));
      modal_flexible_family().mass(ToldShapes::of(packed).rest(), at.eta.data(), rr, re, ee);
      const Eigen::Index m = at.eta.size();
      for (Eigen::Index k = 0; k < m; ++k) {
        for (int r = 0; re && r < 6; ++r) re[6 * k + r] *= at.slope[k];
        for (Eigen::Index l = 0; ee && l < m; ++l) ee[m * k + l] *= at.slope[k] * at.slope[l];
      }
    };
    t.bias = [](const void* packed, const double* x, const double* xdot, const double* omega, double* b) {
      const Bent at(numbers_of(packed, x));
      const Eigen::Index m = at.eta.size();
      const VectorXd rate = at.slope.cwiseProduct(numbers_of(packed, xdot)),
                     more = at.curve.cwiseProduct(numbers_of(packed, xdot).cwiseAbs2());  // eta'' = slope x'' + more
      double rr[10];
      MatrixXd re(6, m), ee(m, m);
      modal_flexible_family().mass(ToldShapes::of(packed).rest(), at.eta.data(), rr, re.data(), ee.data());
      modal_flexible_family().bias(ToldShapes::of(packed).rest(), at.eta.data(), rate.data(), omega, b);
      Eigen::Map<VectorXd>(b, 6) += re * more;
      Eigen::Map<VectorXd> b_e(b + 6, m);
      b_e = at.slope.cwiseProduct(b_e + ee * more);
    };
    t.node = [](const void* packed, std::uint32_t i, const double* x, const double* xdot, double* moved, double* S, double* a) {
      const Bent at(numbers_of(packed, x));
      const Eigen::Index m = at.eta.size();
      const Eigen::Map<const MatrixXd> shapes(ToldShapes::of(packed).shapes() + 6 * m * i, 6, m);
      if (moved) Eigen::Map<VectorXd>(moved, 6) = shapes * at.eta;
      if (S) Eigen::Map<MatrixXd>(S, 6, m) = shapes * at.slope.asDiagonal();
      if (a) Eigen::Map<VectorXd>(a, 6) = shapes * at.curve.cwiseProduct(numbers_of(packed, xdot).cwiseAbs2());
    };
    return t;
  }();
  return table;
}

const Registry& with_curves() {
  static const Registry all = [] {
    Registry r = registry();
    r.bodies.add(told_modal(), "test");
    r.bodies.add(bent_modal(), "test");
    load_plugin(CARDAN_BINARY_DIR "/plugins/acme_swing.so", r);
    return r;
  }();
  return all;
}
std::shared_ptr<const Model> made(const SystemSpec& spec, bool world_wrenches = true) {
  CompileOptions options;
  options.world_wrenches = world_wrenches;
  return compile(spec, with_curves(), options);
}

SystemSpec with_modal_type(SystemSpec spec, const std::string& type) {
  for (BodySpec& b : spec.bodies)
    if (b.modal) b.type = type;
  return spec;
}

// ---- what is compared ----

/// A state, forces and loads, of two models that have the same components and, as far as they are loaded, the same nodes.
struct Point {
  VectorXd q, v, tau, vdot;
  std::vector<std::pair<std::string, NodeWrench>> loads;
};

class At {
 public:
  At(std::shared_ptr<const Model> of, const Point& p) : model(std::move(of)), ws(*model), p_(p) {
    for (const auto& [name, load] : p.loads) {
      wrenches.push_back(load);
      wrenches.back().node = model->find_node(name);
      EXPECT_GE(wrenches.back().node, 0) << name;
    }
  }
  Inputs in(const double* vdot = nullptr) const {
    return {.q = p_.q.data(), .v = p_.v.data(), .tau = p_.tau.data(), .vdot = vdot, .wrenches = wrenches};
  }
  VectorXd forward() {
    VectorXd out(model->nv);
    given = VectorXd::Zero(model->nv);
    for (std::size_t i = 0; i < model->prescribed.size(); ++i)
      if (model->prescribed[i]) given[static_cast<Eigen::Index>(i)] = p_.vdot[static_cast<Eigen::Index>(i)];
    if (!forward_dynamics(*model, ws, in(given.data()), out.data())) throw NumericsError(describe_breakdown(*model, ws.breakdown, 0.0));
    return out;
  }
  VectorXd inverse() {
    VectorXd out(model->nv);
    inverse_dynamics(*model, ws, in(p_.vdot.data()), out.data());
    return out;
  }

  std::shared_ptr<const Model> model;
  Workspace ws;
  std::vector<NodeWrench> wrenches;
  VectorXd given;  // v' of given motions, the others zero

 private:
  const Point& p_;
};

double apart_nodes(const NodeState& a, const NodeState& b) {
  double out = distance(a.R_WN, b.R_WN);
  out = worse(out, apart(a.position, b.position, 1.0));
  out = worse(out, apart(a.velocity, b.velocity, 1.0));
  out = worse(out, apart(a.acceleration, b.acceleration, 1.0));
  return worse(out, apart(a.specific_force, b.specific_force, 1.0));
}
VectorXd in_one(const Force<double>& f) { return (VectorXd(6) << f.n.x, f.n.y, f.n.z, f.f.x, f.f.y, f.f.z).finished(); }
VectorXd in_one(const Energy& e) { return Eigen::Vector4d(e.kinetic, e.gravity, e.modal + e.springs, e.total()); }
VectorXd in_one(const Momentum& m) { return (VectorXd(10) << m.linear, m.angular, m.com, m.mass).finished(); }
VectorXd in_one(const ExternalLoads& e) { return (VectorXd(7) << e.force, e.moment, e.power).finished(); }

using Names = std::vector<std::pair<std::string, std::string>>;

/// v', nodes, reactions, energy, momentum, inverse dynamics, M and its inverse of the two at a point, by names of nodes and bodies of
/// the one and the other. `springs`: forces along v of `a` that are springs on hinges of `b`, which neither forward nor inverse dynamics
/// knows. `flipped`: that component of v, and coordinate of q, counts the other way round in `b`.
void expect_alike(const Point& p, const std::shared_ptr<const Model>& of_a, const std::shared_ptr<const Model>& of_b, const Names& nodes,
                  const Names& hinges, const VectorXd& springs, double tolerance = 1e-12, std::pair<int, int> flipped = {-1, -1}) {
  VectorXd sign = VectorXd::Ones(of_a->nv);
  Point p_b = p;
  if (flipped.first >= 0) sign[flipped.first] = -1.0, p_b.q[flipped.second] *= -1.0;
  for (VectorXd* x : {&p_b.v, &p_b.tau, &p_b.vdot}) *x = x->cwiseProduct(sign);
  for (auto& [name, load] : p_b.loads)
    for (const auto& [in_a, in_b] : nodes)
      if (name == in_a) {
        name = in_b;
        break;
      }
  At a(of_a, p), b(of_b, p_b);
  p_b.tau += springs.cwiseProduct(sign);
  const VectorXd x = a.forward(), y = b.forward();
  EXPECT_LT(apart(x, VectorXd(y.cwiseProduct(sign))), tolerance) << x.transpose() << "\n" << y.transpose();
  Observer see_a(*of_a, a.ws), see_b(*of_b, b.ws);
  see_a.update(a.in(), x.data()), see_b.update(b.in(), y.data());
  for (const auto& [in_a, in_b] : nodes)
    EXPECT_LT(apart_nodes(see_a.node(of_a->find_node(in_a)), see_b.node(of_b->find_node(in_b))), tolerance) << in_a;
  for (const auto& [in_a, in_b] : hinges)
    EXPECT_LT(apart(in_one(see_a.hinge_wrench(of_a->find_body(in_a))), in_one(see_b.hinge_wrench(of_b->find_body(in_b))), 1.0), tolerance)
        << in_a;
  EXPECT_LT(apart(in_one(see_a.momentum()), in_one(see_b.momentum()), 1.0), tolerance);
  EXPECT_LT(apart(in_one(see_a.energy()), in_one(see_b.energy()), 1.0), tolerance);
  EXPECT_LT(apart(see_a.locked_inertia({0.1, 0.2, 0.3}), see_b.locked_inertia({0.1, 0.2, 0.3})), tolerance);
  const ExternalLoads from = see_a.external(a.in(), x.data()), to = see_b.external(b.in(), y.data());
  EXPECT_LT(apart(VectorXd(in_one(from).head(6)), VectorXd(in_one(to).head(6)), 1.0), tolerance);

  EXPECT_LT(apart(a.inverse(), VectorXd(b.inverse().cwiseProduct(sign) - springs)), tolerance);
  const MatrixXd M = mass_matrix(*of_a, a.ws, p.q.data());
  EXPECT_LT(apart(M, MatrixXd(sign.asDiagonal() * mass_matrix(*of_b, b.ws, p_b.q.data()) * sign.asDiagonal())), tolerance);
  MatrixXd inverse_a(of_a->nv, of_a->nv), inverse_b = inverse_a;
  EXPECT_TRUE(mass_matrix_inverse(*of_a, a.ws, p.q.data(), inverse_a.data()));
  EXPECT_TRUE(mass_matrix_inverse(*of_b, b.ws, p_b.q.data(), inverse_b.data()));
  EXPECT_LT(apart(inverse_a, MatrixXd(sign.asDiagonal() * inverse_b * sign.asDiagonal())), 10 * tolerance);

  operators::TreeOperators tree(of_a);  // M v, and the velocities of nodes, as products of operators
  tree.at(p.q.data());
  using namespace operators::letters;
  VectorXd Mv(of_a->nv), V(static_cast<Eigen::Index>(6 * tree.nodes().size()));
  operators::apply(H * phi * operators::letters::M * operators::star(phi) * operators::star(H), tree, p.v.data(), Mv.data());
  EXPECT_LT(apart(Mv, VectorXd(M * p.v)), tolerance);
  operators::apply(operators::star(B) * operators::star(phi) * operators::star(H), tree, p.v.data(), V.data());
  for (std::size_t i = 0; i < tree.nodes().size(); ++i)
    EXPECT_LT(apart(V.segment<6>(static_cast<Eigen::Index>(6 * i)), see_a.node(tree.nodes()[i]).velocity, 1.0), tolerance);
}

// ---- the mechanism ----

struct Random {
  std::mt19937_64 rng;
  double operator()(double size = 1.0) { return std::uniform_real_distribution<double>(-size, size)(rng); }
  Vector3d vector(double size = 1.0) {
    const double x = (*this)(size), y = (*this)(size);
    return {x, y, (*this)(size)};
  }
  VectorXd numbers(Eigen::Index n) {
    return VectorXd::NullaryExpr(n, [&] { return (*this)(); });
  }
  Matrix3d rotation() { return Eigen::AngleAxisd(2.0 + (*this)(), vector().normalized()).toRotationMatrix(); }
  Matrix3d inertia() {
    const Matrix3d a = Matrix3d::NullaryExpr([&] { return (*this)(); });
    const Matrix3d s = a * a.transpose() + 0.2 * Matrix3d::Identity();  // second moments
    return 0.3 * (s.trace() * Matrix3d::Identity() - s);
  }
};

struct Mass {
  double m;
  Vector3d at;
  Matrix3d inertia;
};

/// The rigid body of these masses, seen from `origin`.
BodySpec body_of(const std::string& name, const std::vector<Mass>& masses, const Vector3d& origin) {
  BodySpec b = rigid(name, 0.0, Vector3d::Zero(), Matrix3d::Zero());
  for (const Mass& p : masses) b.mass += p.m, b.com += p.m * (p.at - origin);
  b.com /= b.mass;
  for (const Mass& p : masses) {
    const Vector3d r = p.at - origin - b.com;
    b.inertia_com += p.inertia + p.m * (r.squaredNorm() * Matrix3d::Identity() - r * r.transpose());
  }
  return b;
}

struct Pair {
  SystemSpec one, two;  // the compound body; its parts
  double K = 0.0, C = 0.0;
};

/// The body on that hinge of another, at its origin, along any axes.
BodySpec joined(BodySpec body, const std::string& inboard, const std::string& type, Random& random) {
  const bool has_axis = type == "revolute" || type == "prismatic" || type == "cylindrical";
  return on(std::move(body), inboard, type, has_axis ? std::vector<Vector3d>{random.vector().normalized()} : std::vector<Vector3d>{});
}

/// A carriage on `hinge` with a pendulum; on the pendulum's bob an arm on `outboard`, on the carriage's seat a box. Nodes "carriage.bob"
/// and "carriage.seat", and "pendulum.bob", "carriage.seat".
Pair mechanism(std::uint64_t seed, const std::string& hinge, const std::string& outboard) {
  Random random{std::mt19937_64(seed - 1 + first_seed())};
  const Vector3d pivot = random.vector(0.5), axis = random.vector().normalized();
  std::vector<Mass> still, swinging;
  for (int i = 0; i < 2; ++i) still.push_back({2.0 + random(), random.vector(), random.inertia()});
  for (int i = 0; i < 2; ++i) swinging.push_back({1.0 + 0.5 * random(), random.vector(), random.inertia()});
  const Vector3d seat = random.vector(), bob = random.vector();
  const Matrix3d R_seat = random.rotation(), R_bob = random.rotation();
  Pair out;
  out.K = 3.0 + random(), out.C = 0.4;

  ModalData data;
  data.n_modes = 1;
  data.K = MatrixXd::Constant(1, 1, out.K), data.C = MatrixXd::Constant(1, 1, out.C);
  const auto add = [&](const Mass& p, bool swings) {
    MassNode n;
    n.mass = p.m, n.position = p.at, n.inertia = p.inertia;
    n.Phi = swings ? MatrixXd(axis.cross(p.at - pivot)) : MatrixXd::Zero(3, 1);
    n.Psi = swings ? MatrixXd(axis) : MatrixXd::Zero(3, 1);
    data.mass_nodes.push_back(n);
  };
  for (const Mass& p : still) add(p, false);
  for (const Mass& p : swinging) add(p, true);
  ModalIntegrals& I = data.integrals;
  I.I3 = I.I4 = MatrixXd::Zero(3, 1), I.I6 = MatrixXd::Identity(1, 1), I.I5 = {MatrixXd::Zero(3, 1)}, I.I8 = {Matrix3d::Zero()};
  I.I9 = {Matrix3d::Zero()};
  for (const MassNode& n : data.mass_nodes) {
    I.I1 += n.mass, I.I2 += n.mass * n.position, I.I3 += n.mass * n.Phi;
    I.I4 += n.mass * n.position.cross(Vector3d(n.Phi)) + n.inertia * n.Psi;
  }
  data.nodes.push_back({"seat", seat, R_seat, MatrixXd::Zero(3, 1), MatrixXd::Zero(3, 1)});
  data.nodes.push_back({"bob", bob, R_bob, axis.cross(bob - pivot), axis});

  BodySpec compound;
  compound.name = "carriage", compound.type = "acme/swing", compound.level = 2, compound.rotary_tolerance = 0.0;
  compound.params["pivot"].value = std::vector<double>(pivot.data(), pivot.data() + 3);
  compound.params["still"].value = static_cast<double>(still.size());
  compound.params["axis"].value = std::vector<double>(axis.data(), axis.data() + 3);
  compound.modal = std::make_shared<ModalData>(data);
  BodySpec carriage = body_of("carriage", still, Vector3d::Zero()), pendulum = body_of("pendulum", swinging, pivot);
  carriage.nodes.push_back({"seat", seat, R_seat, {}});
  pendulum.nodes.push_back({"bob", bob - pivot, R_bob, {}});
  compound = joined(compound, "", hinge, random);
  carriage.hinge = compound.hinge;
  pendulum = on(pendulum, "carriage", "revolute", {axis}, pivot);
  SpringDamper spring;
  spring.stiffness = out.K, spring.damping = out.C;
  pendulum.hinge.springs = {spring};

  BodySpec arm = joined(rigid("arm", 1.5, random.vector(), random.inertia()), "carriage", outboard, random);
  arm.hinge.inboard_node = "bob";
  arm.hinge.pnode_position = random.vector(0.3), arm.hinge.pnode_R = random.rotation();
  BodySpec box = on(rigid("box", 0.7, random.vector(), random.inertia()), "carriage", "ball");
  box.hinge.inboard_node = "seat";
  BodySpec tip = on(rigid("tip", 0.3, random.vector(), random.inertia()), "arm", "prismatic", {random.vector().normalized()});
  out.one = system({compound, arm, box, tip}, uniform_gravity(random.vector(3.0)));
  arm.hinge.inboard_body = "pendulum";
  out.two = system({carriage, pendulum, arm, box, tip}, out.one.gravity);
  return out;
}

const Names kNodes = {{"carriage.bob", "pendulum.bob"},
                      {"carriage.seat", "carriage.seat"},
                      {"carriage", "carriage"},
                      {"arm", "arm"},
                      {"box", "box"},
                      {"tip", "tip"}};
const Names kHinges = {{"carriage", "carriage"}, {"arm", "arm"}, {"box", "box"}, {"tip", "tip"}};

Point random_point(const Model& m, std::uint64_t seed) {
  Random random{std::mt19937_64(seed - 1 + first_seed())};
  Point p;
  p.q = m.initial_state().q;
  const VectorXd to = 1.5 * random.numbers(m.nv), from = p.q;
  m.retract(from.data(), to.data(), p.q.data());
  p.v = random.numbers(m.nv), p.tau = random.numbers(m.nv), p.vdot = random.numbers(m.nv);
  for (const auto& [node, other] : kNodes)
    for (const bool world : {false, true}) {
      NodeWrench w;
      w.world_axes = world;
      const VectorXd f = random.numbers(6);
      w.f = force(f.data());
      p.loads.emplace_back(node, w);
    }
  return p;
}

/// The place of the pendulum's angle in v of both.
int swing_of(const Model& one) { return one.user[0].etadot; }

VectorXd springs_of(const Pair& pair, const Model& one, const Point& p) {
  VectorXd f = VectorXd::Zero(one.nv);
  f[swing_of(one)] = -pair.K * p.q[one.user[0].eta] - pair.C * p.v[swing_of(one)];
  return f;
}

constexpr const char* kOutboard[] = {"revolute", "prismatic", "ball", "free", "locked", "cylindrical", "translational"};

TEST(CurvedNodes, OfACompoundBodyMoveAsItsPartsDo) {
  for (std::uint64_t seed = 1; seed <= 28; ++seed) {
    const Pair pair = mechanism(seed, seed % 3 == 0 ? "revolute" : "free", kOutboard[seed % 7]);
    const auto one = made(pair.one), two = made(pair.two);
    ASSERT_EQ(one->nq, two->nq);
    const Point p = random_point(*one, 100 + seed);
    SCOPED_TRACE(seed);
    expect_alike(p, one, two, kNodes, kHinges, springs_of(pair, *one, p));
  }
}

TEST(CurvedNodes, OfTheseModalBodiesObeyTheLaws) {
  for (const cardan_body_family* family : {&told_modal(), &bent_modal()})
    for (const std::string& broken : body_law_violations(*family, 48)) ADD_FAILURE() << family->type << ": " << broken;
}

/// The compound body hangs on its bob, which is undone from there to its frame; of the two bodies the carriage then hangs on the pendulum.
TEST(CurvedNodes, MayBeWhereTheBodyHangs) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Pair pair = mechanism(seed, "free", "ball");
    Random random{std::mt19937_64(50 + seed - 1 + first_seed())};
    const BodySpec bus = on(rigid("bus", 3.0, random.vector(), random.inertia()), "", seed % 3 == 0 ? "ball" : "free");
    const HingeSpec to_bus = joined({}, "bus", seed % 2 == 0 ? "ball" : "revolute", random).hinge;
    const auto hang = [&](BodySpec& b) {
      b.hinge = to_bus;
      b.hinge.onode_position = {0.3, 0.1, -0.2};
      b.hinge.body_node = "bob";
    };
    BodySpec &compound = pair.one.bodies[0], carriage = pair.two.bodies[0], pendulum = pair.two.bodies[1];
    const Vector3d pivot = pendulum.hinge.onode_position;
    carriage.hinge = pendulum.hinge;
    carriage.hinge.inboard_body = "pendulum";
    carriage.hinge.onode_position.setZero(), carriage.hinge.pnode_position = pivot;
    hang(compound), hang(pendulum);
    pair.one.bodies.insert(pair.one.bodies.begin(), bus);
    pair.two.bodies = {bus, pendulum, carriage, pair.two.bodies[2], pair.two.bodies[3], pair.two.bodies[4]};
    const auto one = made(pair.one), two = made(pair.two);
    const Point p = random_point(*one, 200 + seed);
    const int eta = one->user[1].eta, etadot = one->user[1].etadot;
    VectorXd springs = VectorXd::Zero(one->nv);
    springs[etadot] = -pair.K * p.q[eta] - pair.C * p.v[etadot];
    SCOPED_TRACE(seed);
    Names nodes = kNodes;
    nodes.emplace_back("bus", "bus");
    expect_alike(p, one, two, nodes, {{"bus", "bus"}, {"carriage", "pendulum"}, {"arm", "arm"}, {"box", "box"}, {"tip", "tip"}}, springs,
                 1e-12, {etadot, eta});
  }
}

/// The angle follows a given motion, in the one as a mode, in the other as a hinge: the same forces of it, too.
TEST(CurvedNodes, FollowAGivenMotion) {
  for (std::uint64_t seed = 1; seed <= 7; ++seed) {
    Pair pair = mechanism(seed, "free", kOutboard[seed % 7]);
    pair.one.bodies[0].prescribed_modes = {0};
    pair.two.bodies[1].hinge.prescribed = {0};
    const auto one = made(pair.one), two = made(pair.two);
    const Point p = random_point(*one, 600 + seed);
    SCOPED_TRACE(seed);
    const VectorXd springs = springs_of(pair, *one, p);
    expect_alike(p, one, two, kNodes, kHinges, springs);
    const auto force = [&](const std::shared_ptr<const Model>& m) {
      Point q = p;
      for (auto& [name, load] : q.loads)
        if (m == two && name == "carriage.bob") name = "pendulum.bob";
      At at(m, q);
      VectorXd x = at.forward(), tau(m->nv);
      Observer(*m, at.ws).prescribed_forces(at.in(at.given.data()), x.data(), tau.data());
      return tau[swing_of(*one)];
    };
    const double of_one = force(one), of_two = force(two) - springs[swing_of(*one)];
    EXPECT_NEAR(of_one, of_two, 1e-12 * worse(1.0, std::abs(of_two)));
  }
}

TEST(CurvedNodes, HaveTheLinearModelOfTheParts) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const Pair pair = mechanism(seed, "free", "ball");
    const auto one = made(pair.one), two = made(pair.two);
    const Point p = random_point(*one, 300 + seed);
    const auto linear = [&](const std::shared_ptr<const Model>& m, const std::string& body, const std::string& angle) {
      std::vector<NodeWrench> loads;
      for (const auto& [name, load] : p.loads) {
        loads.push_back(load);
        loads.back().node = m->find_node(name == "carriage.bob" ? body + ".bob" : name);
      }
      const std::string bob = body + ".bob";
      operators::LinearPorts ports{{angle, "carriage", bob + ":force", bob + ":torque", "carriage.seat:force"}, {}};
      for (const std::string& node : {bob, std::string("carriage.seat"), std::string("arm")})
        for (const char* what : {":position", ":velocity", ":acceleration", ":attitude", ":rate", ":specific_force"})
          ports.outputs.push_back(node + what);
      ports.outputs.insert(ports.outputs.end(), {"momentum:linear", "momentum:angular"});
      return operators::linearize(*m, {.q = p.q.data(), .v = p.v.data(), .tau = p.tau.data(), .wrenches = loads}, ports);
    };
    const operators::LinearModel a = linear(one, "carriage", "carriage.eta_1"), b = linear(two, "pendulum", "pendulum.angle");
    EXPECT_LT(apart(a.A, b.A), 1e-11) << seed;
    EXPECT_LT(apart(a.B, b.B), 1e-11) << seed;
    EXPECT_LT(apart(a.C, b.C), 1e-11) << seed;
    EXPECT_LT(apart(a.D, b.D), 1e-11) << seed;
  }
}

TEST(CurvedNodes, AreTheSameInLanes) {
  const Pair pair = mechanism(5, "free", "revolute");
  const auto one = made(pair.one);
  const int n = 11;
  MatrixXd q(one->nq, n), v(one->nv, n), tau(one->nv, n), vdot(one->nv, n), back(one->nv, n);
  std::vector<Point> points;
  for (int i = 0; i < n; ++i) {
    points.push_back(random_point(*one, 400 + static_cast<std::uint64_t>(i)));
    points.back().loads.clear();
    q.col(i) = points.back().q, v.col(i) = points.back().v, tau.col(i) = points.back().tau;
  }
  Batch batch(*one);
  EXPECT_EQ(batch.forward_dynamics({.n = n, .q = q.data(), .v = v.data(), .tau = tau.data()}, vdot.data()), 0);
  batch.inverse_dynamics({.n = n, .q = q.data(), .v = v.data(), .vdot = vdot.data()}, back.data());
  for (int i = 0; i < n; ++i) {
    EXPECT_LT(apart(VectorXd(vdot.col(i)), At(one, points[idx(i)]).forward()), 1e-12) << i;
    EXPECT_LT(apart(VectorXd(back.col(i)), points[idx(i)].tau, largest(MatrixXd(vdot.col(i)))), 1e-12) << i;
  }
}

/// With a spring between the pendulum and the carriage.
SystemSpec sprung(SystemSpec spec, const std::string& bob) {
  DeviceSpec d;
  d.name = "strut", d.type = "spring_damper";
  d.params["stiffness"].value = 30.0, d.params["rest"].value = 0.2, d.params["damping"].value = 0.5;
  d.mounts["from"] = {bob, {}}, d.mounts["to"] = {"carriage.seat", {}};
  spec.devices = {d};
  return spec;
}

/// J v of Newton's equations, by sweeps and devices on numbers that carry a derivative, against differences.
TEST(CurvedNodes, HaveTheDerivativesOfARun) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SystemSpec spec = sprung(mechanism(seed, seed % 2 == 0 ? "free" : "revolute", kOutboard[seed % 7]).one, "carriage.bob");
    spec.bodies[0].eta = {0.9}, spec.bodies[0].etadot = {0.7};
    EXPECT_LT(jacobian_error(made(spec)), 1e-9) << seed;
  }
}

/// The same motion, and the same ledgers.
TEST(CurvedNodes, RunAsThePartsDo) {
  Pair pair = mechanism(7, "free", "revolute");
  pair.one = sprung(pair.one, "carriage.bob"), pair.two = sprung(pair.two, "pendulum.bob");
  SimulationOptions options;
  options.integrator.method = "dop853", options.integrator.relative_tolerance = 1e-12;
  Simulation one(made(pair.one), options), two(made(pair.two), options);
  const Point p = random_point(one.model(), 500);
  for (Simulation* s : {&one, &two}) {
    State at = s->state();
    at.q = p.q, at.v = p.v;
    s->set_state(at);
    s->run(5.0);
    const LedgerState ledger = s->ledger();
    EXPECT_LT(worse(ledger.linear_relative, ledger.angular_relative), 1e-10);
    EXPECT_LT(ledger.energy_relative, 1e-10);
  }
  EXPECT_LT(apart(one.state().q, two.state().q), 1e-9);
  EXPECT_LT(apart(one.state().v, two.state().v), 1e-9);
  EXPECT_GT(std::abs(one.state().q[one.model().user[0].eta] - p.q[one.model().user[0].eta]), 0.03) << "it swings";
}

/// At rest the forces that hold a body against a field with a gradient are the slope of its potential energy.
TEST(CurvedNodes, FeelTheGradientOfGravity) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SystemSpec spec = mechanism(seed, "free", kOutboard[seed % 7]).one;
    spec.gravity = central_gravity(3000.0, true, {11.0, -7.0, 4.0});
    const auto model = made(spec);
    Point p = random_point(*model, 40 + seed);
    p.v.setZero(), p.vdot.setZero(), p.loads.clear();
    const int eta = model->user[0].eta;
    const auto energy_at = [&](double moved) {
      Point there = p;
      there.q[eta] += moved;
      At at(model, there);
      const VectorXd vdot = at.forward();
      Observer see(*model, at.ws);
      see.update(at.in(), vdot.data());
      return see.energy().gravity;
    };
    constexpr double kStep = 1e-2;  // of fourth order: 1e-9 of the slope, and the rounding of U over it
    const double slope = (8 * (energy_at(kStep) - energy_at(-kStep)) - (energy_at(2 * kStep) - energy_at(-2 * kStep))) / (12 * kStep);
    At loaded(model, p);
    spec.gravity.mu = 1e-300;
    At free(made(spec), p);
    const double held = loaded.inverse()[model->user[0].etadot] - free.inverse()[model->user[0].etadot];
    EXPECT_NEAR(held / slope, 1.0, 1e-7) << seed;
  }
}

/// Constant shapes by another way: told by node(), they take the general elimination.
TEST(CurvedNodes, MayBeStraight) {
  int curved = 0;
  for (const TreeOptions& options :
       {TreeOptions{}, TreeOptions{.bodies = 5, .flexible = 1.0}, TreeOptions{.bodies = 5, .flexible = 1.0, .level = 0},
        TreeOptions{.bodies = 4, .flexible = 0.6, .modes = 20, .plain_masses = true}, TreeOptions{.flexible = 0.7, .prescribed = 0.3},
        TreeOptions{.bodies = 4, .flexible = 0.7, .level = 1, .gravity = GravitySpec::Kind::central},
        TreeOptions{.bodies = 4, .flexible = 0.7, .level = 2, .gravity = GravitySpec::Kind::central}})
    for (unsigned seed = first_seed(); seed < first_seed() + 20; ++seed) {
      const RandomTree tree = random_tree(seed, options);
      const auto plain = made(tree.spec), told = made(with_modal_type(tree.spec, "test/told_modal"));
      for (const UserNode& n : told->nodes) curved += n.shapes.is_curved();
      const State state = plain->initial_state();
      Point p{state.q, state.v, in_user_order(*plain, tree.tau), in_user_order(*plain, tree.vdot), {}};
      for (const Load& l : tree.loads) {
        NodeWrench w;
        w.world_axes = l.world_axes, w.f = force(l.wrench.data());
        p.loads.emplace_back(l.body + "." + l.node, w);
      }
      At a(told, p), b(plain, p);
      const double tolerance = 1e-10;
      const VectorXd x = a.forward(), y = b.forward();
      EXPECT_LT(apart(x, y), tolerance) << describe(tree);
      EXPECT_LT(apart(a.inverse(), b.inverse()), tolerance) << seed;
      EXPECT_LT(apart(mass_matrix(*told, a.ws, p.q.data()), mass_matrix(*plain, b.ws, p.q.data())), 1e-13) << seed;
      operators::Sensitivities of_a(told), of_b(plain);
      of_a.at(a.in(p.vdot.data())), of_b.at(b.in(p.vdot.data()));
      EXPECT_LT(apart(of_a.inverse().q, of_b.inverse().q), tolerance) << seed;
      EXPECT_LT(apart(of_a.inverse().v, of_b.inverse().v), tolerance) << seed;
    }
  EXPECT_GT(curved, 100);
}

/// Modal bodies in other coordinates, along which nothing is straight: the same motion, eta = f(x), and tau for x is f' times that for eta.
TEST(CurvedNodes, MayHaveAnyCoordinates) {
  for (const TreeOptions& options :
       {TreeOptions{}, TreeOptions{.bodies = 5, .flexible = 1.0}, TreeOptions{.bodies = 5, .flexible = 1.0, .level = 0},
        TreeOptions{.bodies = 4, .flexible = 0.6, .modes = 12, .plain_masses = true},
        TreeOptions{.bodies = 4, .flexible = 0.7, .level = 1, .gravity = GravitySpec::Kind::central},
        TreeOptions{.bodies = 4, .flexible = 0.7, .level = 2, .gravity = GravitySpec::Kind::central}})
    for (unsigned seed = first_seed(); seed < first_seed() + 20; ++seed) {
      const RandomTree tree = random_tree(seed, options);
      const auto plain = made(tree.spec), bent = made(with_modal_type(tree.spec, "test/bent_modal"));
      const State state = plain->initial_state();
      Point in_x{state.q, state.v, in_user_order(*plain, tree.tau), in_user_order(*plain, tree.vdot), {}};
      for (const Load& l : tree.loads) {
        NodeWrench w;
        w.world_axes = l.world_axes, w.f = force(l.wrench.data());
        in_x.loads.emplace_back(l.body + "." + l.node, w);
      }
      Point in_eta = in_x;
      VectorXd slope = VectorXd::Ones(plain->nv), more = VectorXd::Zero(plain->nv);
      for (const UserBody& u : plain->user) {
        if (u.n_modes == 0) continue;
        const Bent at(in_x.q.segment(u.eta, u.n_modes));
        in_eta.q.segment(u.eta, u.n_modes) = at.eta;
        slope.segment(u.etadot, u.n_modes) = at.slope;
        more.segment(u.etadot, u.n_modes) = at.curve.cwiseProduct(in_x.v.segment(u.etadot, u.n_modes).cwiseAbs2());
      }
      in_eta.v = slope.cwiseProduct(in_x.v);
      in_eta.vdot = slope.cwiseProduct(in_x.vdot) + more;
      // What the host takes for elastic forces are K and C of its coordinates.
      const VectorXd of_x = elastic_force(*bent, in_x.q.data(), in_x.v.data()),
                     of_eta = elastic_force(*plain, in_eta.q.data(), in_eta.v.data());
      in_x.tau = slope.cwiseProduct(in_eta.tau + of_eta) - of_x;
      At a(bent, in_x), b(plain, in_eta);
      const VectorXd x = a.forward(), y = b.forward(), wanted = (y - more).cwiseQuotient(slope);
      EXPECT_LT(apart(x, wanted, largest(y)), 1e-10) << describe(tree);
      const VectorXd tau = slope.cwiseProduct(b.inverse() + of_eta) - of_x;
      EXPECT_LT(apart(a.inverse(), tau, largest(b.inverse())), 1e-12) << describe(tree);
      const MatrixXd M = slope.asDiagonal() * mass_matrix(*plain, b.ws, in_eta.q.data()) * slope.asDiagonal();
      EXPECT_LT(apart(mass_matrix(*bent, a.ws, in_x.q.data()), M), 1e-12) << seed;
      a.forward(), b.forward();
      Observer see_a(*bent, a.ws), see_b(*plain, b.ws);
      see_a.update(a.in(), wanted.data()), see_b.update(b.in(), y.data());
      for (int i = 0; i < static_cast<int>(bent->nodes.size()); ++i)
        EXPECT_LT(apart_nodes(see_a.node(i), see_b.node(i)), 1e-10 * worse(1.0, largest(y))) << bent->nodes[idx(i)].name << seed;

      // Derivatives of inverse dynamics by sweeps that carry them, against differences of eighth order.
      operators::Sensitivities d(bent);
      d.at(a.in(in_x.vdot.data()));
      VectorXd along_q(bent->nv), along_v(bent->nv), got(bent->nv), differences(bent->nv), work(bent->nv), moved_q(bent->nq),
          moved_v(bent->nv), to(bent->nv);
      Random random{std::mt19937_64(seed - 1 + first_seed())};
      along_q = random.numbers(bent->nv), along_v = random.numbers(bent->nv);
      d.inverse({.q = along_q.data(), .v = along_v.data()}, got.data());
      soa::derivative(
          [&](double s, double* out) {
            to = s * along_q;
            bent->retract(in_x.q.data(), to.data(), moved_q.data());
            moved_v = in_x.v + s * along_v;
            Inputs in = a.in(in_x.vdot.data());
            in.q = moved_q.data(), in.v = moved_v.data();
            inverse_dynamics(*bent, a.ws, in, out);
          },
          0.01, bent->nv, differences.data(), work.data());
      EXPECT_LT(apart(got, differences, largest(tau)), 1e-9) << describe(tree);
    }
}

/// Four bars on the box and two on the arm: loops that such a body is not on the way of, inboard of them or beside them, in both forms.
TEST(CurvedNodes, LetLoopsBesideThemBe) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed)
    for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers}) {
      Pair pair = mechanism(seed, "free", seed % 2 == 0 ? "revolute" : "ball");
      Random random{std::mt19937_64(700 + seed - 1 + first_seed())};
      std::vector<BodySpec> links;
      for (int i = 0; i < 4; ++i)
        links.push_back(joined(rigid("link" + std::to_string(i), 0.5, random.vector(), random.inertia()),
                               i < 2    ? "box"
                               : i == 2 ? "arm"
                                        : "link2",
                               "ball", random));
      LoopSpec rod, joint;
      rod.name = "rod", rod.type = "distance";  // closed at the start, where the links lie on what they hang on
      rod.from.body = "link0", rod.to.body = "link1", rod.from.position = random.vector(), rod.to.position = random.vector();
      rod.length = (rod.to.position - rod.from.position).norm();
      joint.name = "joint", joint.type = "point";
      joint.from.body = "link3", joint.to.body = "arm", joint.from.position = joint.to.position = random.vector();
      for (SystemSpec* spec : {&pair.one, &pair.two}) {
        spec->bodies.insert(spec->bodies.end(), links.begin(), links.end());
        spec->loops = {rod, joint};
        spec->loop_form = form;
      }
      const auto one = made(pair.one), two = made(pair.two);
      Point p = random_point(*one, 800 + seed), p_two = p;
      p_two.tau += springs_of(pair, *one, p);
      for (auto& [name, load] : p_two.loads)
        if (name == "carriage.bob") name = "pendulum.bob";
      At a(one, p), b(two, p_two);
      EXPECT_EQ(one->has(OpCode::embedding), form == LoopForm::embedding);
      const VectorXd x = a.forward(), y = b.forward();
      EXPECT_LT(apart(x, y), 1e-11) << seed;
      Observer see_a(*one, a.ws), see_b(*two, b.ws);
      see_a.update(a.in(), x.data()), see_b.update(b.in(), y.data());
      for (const auto& [in_a, in_b] : kHinges)
        EXPECT_LT(apart(in_one(see_a.hinge_wrench(one->find_body(in_a))), in_one(see_b.hinge_wrench(two->find_body(in_b))), 1.0), 1e-10)
            << in_a;
    }
}

std::string refusal_of(const std::function<void()>& of) {
  try {
    of();
  } catch (const InputError& e) {
    return e.what();
  }
  return "nothing";
}

/// What does not honour them says so, by name.
TEST(CurvedNodes, AreRefusedByName) {
  const SystemSpec spec = mechanism(1, "free", "revolute").one;
  const std::string carriage = "  got:      carriage, whose type \"acme/swing\" tells how they move\n",
                    end = "\n1 error. Nothing was run.\n", unsupported = "error[C0401]: not supported by the chosen method\n";
  const auto closed = [&](const char* type, const std::string& from, const std::string& to) {
    SystemSpec with = spec;
    LoopSpec loop;
    loop.name = "loop", loop.type = type, loop.length = 1.0;
    loop.from.body = from, loop.to.body = to;
    if (loop.type == "coupling") loop.terms = {{from, 1.0, {}}, {to, 1.0, {}}};
    with.loops = {loop};
    return refusal_of([&] { made(with); });
  };
  const std::string on_the_way =
      unsupported + "  at: loops.loop\n  expected: a way of bodies whose nodes move along constant shapes\n" + carriage + end;
  EXPECT_EQ(closed("distance", "arm", "box"), on_the_way) << "home";
  EXPECT_EQ(closed("distance", "arm", ""), on_the_way) << "on the way";
  EXPECT_EQ(closed("distance", "carriage", ""), on_the_way) << "an end";
  EXPECT_EQ(closed("coupling", "arm", "tip"), on_the_way) << "home of a coupling";

  SystemSpec pulled = spec;
  pulled.gravity = central_gravity(100.0, true, {20, 0, 0});
  EXPECT_EQ(refusal_of([&] { made(pulled); }), "nothing");
  pulled.bodies[0].level = 0;
  EXPECT_EQ(refusal_of([&] { made(pulled); }),
            unsupported +
                "  at: bodies.carriage\n  expected: a body whose nodes move along constant shapes, at level 0 where gravity has a "
                "gradient\n" +
                carriage +
                "  hint:     level 1 or 2, or gradient: false: at level 0 the gradient is formed from the integrals of modal data\n" + end);
  pulled.gravity.gradient = false;
  EXPECT_EQ(refusal_of([&] { made(pulled); }), "nothing");

  const auto model = made(spec);
  EXPECT_EQ(refusal_of([&] { Momenta of(*model); }),
            unsupported + "  at: momenta\n  expected: bodies whose nodes move along constant shapes\n" + carriage + end);
  for (const std::string& method : std::vector<std::string>{"exponential", "multirate", "variational"}) {
    SimulationOptions options;
    options.integrator.method = method, options.integrator.fixed_step = method == "variational" ? 0.01 : 0.0;
    EXPECT_EQ(refusal_of([&] {
                Simulation sim(model, options);
                sim.run(0.1);
              }),
              unsupported +
                  "  at: integrator.method\n  expected: a method that takes bodies whose type tells how their nodes move, as carriage\n  "
                  "got:      " +
                  method + ", which does not\n  hint:     dopri5, dop853; auto finds one\n" + end);
  }
}

}  // namespace
}  // namespace cardan::test
