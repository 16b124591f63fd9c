// MuJoCo: composite inertias and a sparse L'DL factorisation. Contacts and constraints are switched off.
#include <mujoco/mujoco.h>

#include <cstring>
#include <map>
#include <sstream>

#include "bench/peers/peer.hpp"

namespace {

using namespace peer;

/// The model as files of MJCF. The reader of XML stops at a depth of 100 elements, so deep trees go on in included files.
class Mjcf {
 public:
  Mjcf(const Model& m) : m_(m), children_(m.bodies.size() + 1) {
    for (std::size_t i = 0; i < m.bodies.size(); ++i) children_[static_cast<std::size_t>(m.bodies[i].parent + 1)].push_back(i);
    std::ostringstream x;
    x.precision(17);
    x << "<mujoco><compiler angle='radian' balanceinertia='false' boundmass='0' boundinertia='0'/><size njmax='1' nconmax='1'/>"
      << "<option gravity='" << m.gravity.transpose() << "'><flag contact='disable' constraint='disable' equality='disable' "
      << "limit='disable' frictionloss='disable' passive='disable' actuation='disable' clampctrl='disable' warmstart='disable'/>"
      << "</option><worldbody>";
    for (const std::size_t i : children_[0]) body(x, i, 0);
    x << "</worldbody></mujoco>";
    files["model.xml"] = x.str();
  }

  std::map<std::string, std::string> files;

 private:
  void body(std::ostream& x, std::size_t i, int depth) {
    if (depth == 80) {
      const std::string name = "part" + std::to_string(files.size()) + ".xml";
      x << "<include file='" << name << "'/>";
      files[name];  // takes its number
      std::ostringstream part;
      part.precision(17);
      part << "<mujocoinclude>";
      body(part, i, 0);
      part << "</mujocoinclude>";
      files[name] = part.str();
      return;
    }
    const Body& b = m_.bodies[i];
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(b.inertia);  // its own is good to 1e-9 only
    Eigen::Matrix3d axes = principal.eigenvectors();
    if (axes.determinant() < 0) axes.col(0) *= -1;
    x << "<body pos='" << b.p.transpose() << "' quat='" << quaternion(b.R) << "'><inertial mass='" << b.mass << "' pos='"
      << b.com.transpose() << "' quat='" << quaternion(axes) << "' diaginertia='" << principal.eigenvalues().transpose() << "'/>";
    if (b.free)
      x << "<freejoint name='" << i << "'/>";
    else
      x << "<joint name='" << i << "' type='hinge' axis='" << Eigen::Vector3d::Unit(b.axis).transpose() << "'/>";
    for (const std::size_t c : children_[i + 1]) body(x, c, depth + 1);
    x << "</body>";
  }
  static Eigen::RowVector4d quaternion(const Eigen::Matrix3d& R) {
    const Eigen::Quaterniond q = Eigen::Quaterniond(R).normalized();
    return {q.w(), q.x(), q.y(), q.z()};
  }

  const Model& m_;
  std::vector<std::vector<std::size_t>> children_;
};

/// [linear in world axes; angular in body axes].
RootMap root_map(const Root& r) {
  RootMap map;
  map.T << Eigen::Matrix3d::Zero(), r.R, Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Zero();
  map.b.head<3>() = r.R * r.omega.cross(r.velocity);
  return map;
}

struct Mujoco : Peer {
  struct Set {
    Eigen::VectorXd q, v, tau, vdot;
    Velocities map;
  };
  const Model& m;
  mjModel* model = nullptr;
  mjData* d = nullptr;
  std::vector<int> body, q_at, v_at;
  std::vector<Set> sets;
  Eigen::VectorXd tau;
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Rows unit, matrix;

  Mujoco(const Model& source) : m(source) {
    const auto vfs = std::make_unique<mjVFS>();
    mj_defaultVFS(vfs.get());
    for (const auto& [name, text] : Mjcf(m).files) {
      mj_makeEmptyFileVFS(vfs.get(), name.c_str(), static_cast<int>(text.size()));
      std::memcpy(vfs->filedata[mj_findFileVFS(vfs.get(), name.c_str())], text.data(), text.size());
    }
    char error[1000] = "";
    model = mj_loadXML("model.xml", vfs.get(), error, sizeof error);
    mj_deleteVFS(vfs.get());
    if (!model) throw Refused(std::string(error, std::strcspn(error, "\n")));
    d = mj_makeData(model);
    for (std::size_t i = 0; i < m.bodies.size(); ++i) {
      const int joint = mj_name2id(model, mjOBJ_JOINT, std::to_string(i).c_str());
      body.push_back(model->jnt_bodyid[joint]);
      q_at.push_back(model->jnt_qposadr[joint]);
      v_at.push_back(model->jnt_dofadr[joint]);
    }
    tau.resize(m.nv);
  }
  ~Mujoco() override {
    mj_deleteData(d);
    mj_deleteModel(model);
  }

  void set_q(int k) { std::memcpy(d->qpos, sets[static_cast<std::size_t>(k)].q.data(), sizeof(double) * static_cast<std::size_t>(m.nq)); }
  void set_v(int k) { std::memcpy(d->qvel, sets[static_cast<std::size_t>(k)].v.data(), sizeof(double) * static_cast<std::size_t>(m.nv)); }
  void set_tau(int k) {
    std::memcpy(d->qfrc_applied, sets[static_cast<std::size_t>(k)].tau.data(), sizeof(double) * static_cast<std::size_t>(m.nv));
  }

  std::vector<Call> calls() override {
    for (const State& s : m.states) {
      const Velocities map(m, v_at, m.has_free_root() ? root_map(Root(s)) : RootMap());
      Eigen::VectorXd q(m.nq);
      for (std::size_t i = 0; i < m.bodies.size(); ++i) {
        const int n = m.bodies[i].free ? 7 : 1;
        q.segment(q_at[i], n) = s.q.segment(m.bodies[i].q, n);
      }
      sets.push_back({q, map.velocity(s.v), map.force(s.tau), map.acceleration(s.vdot), map});
    }
    unit.setIdentity(m.nv, m.nv);
    matrix.setZero(m.nv, m.nv);
    const auto set = [this](int k) -> const Set& { return sets[static_cast<std::size_t>(k)]; };
    const auto state = [this](int k) -> const State& { return m.states[static_cast<std::size_t>(k)]; };
    const auto qacc = [this, set](int k) { return set(k).map.our_acceleration(Eigen::Map<const Eigen::VectorXd>(d->qacc, m.nv)); };
    return {
        {"forward_dynamics", "mj_forward",
         [this](int k) {
           set_q(k), set_v(k), set_tau(k);
           mj_forward(model, d);
         },
         qacc},
        {"forward_dynamics", "mj_crb + mj_rne + mj_solveM",  // the stages that forward dynamics needs, alone
         [this](int k) {
           set_q(k), set_v(k), set_tau(k);
           mj_kinematics(model, d);
           mj_comPos(model, d);
           mj_crb(model, d);
           mj_factorM(model, d);
           mj_comVel(model, d);
           mj_rne(model, d, 0, d->qfrc_bias);
           mju_sub(d->qacc, d->qfrc_applied, d->qfrc_bias, m.nv);
           mj_solveM(model, d, d->qacc, d->qacc, 1);
         },
         qacc},
        {"inverse_dynamics", "mj_rne",
         [this, set](int k) {
           set_q(k), set_v(k);
           std::memcpy(d->qacc, set(k).vdot.data(), sizeof(double) * static_cast<std::size_t>(m.nv));
           mj_kinematics(model, d);
           mj_comPos(model, d);
           mj_comVel(model, d);
           mj_rne(model, d, 1, tau.data());
         },
         [this, set](int k) { return set(k).map.our_force(tau); }},
        {"mass_matrix", "mj_crb",  // its sparse form; unfolded for the check only
         [this](int k) {
           set_q(k);
           mj_kinematics(model, d);
           mj_comPos(model, d);
           mj_crb(model, d);
         },
         [this, set, state](int k) {
           mj_fullM(model, matrix.data(), d->qM);
           return set(k).map.mass_times(matrix, state(k).vdot);
         }},
        {"mass_matrix_inverse", "mj_solveM of the identity",
         [this](int k) {
           set_q(k);
           mj_kinematics(model, d);
           mj_comPos(model, d);
           mj_crb(model, d);
           mj_factorM(model, d);
           mj_solveM(model, d, matrix.data(), unit.data(), m.nv);
         },
         [this, set, state](int k) { return set(k).map.inverse_mass_times(matrix, state(k).tau); }},
    };
  }

  std::vector<Call> analyses() override {
    const auto set = [this](int k) -> const Set& { return sets[static_cast<std::size_t>(k)]; };
    const auto factor = [this](int k) {
      set_q(k);
      mj_kinematics(model, d);
      mj_comPos(model, d);
      mj_crb(model, d);
      mj_factorM(model, d);
    };
    // J M^-1 J* by half of the solution each: the way in which MuJoCo makes the inertia of its constraints.
    const auto compliance = [this](const std::vector<int>& nodes) {
      for (std::size_t a = 0; a < nodes.size(); ++a) {
        const int id = body[static_cast<std::size_t>(nodes[a])];
        double* rows = jacobian.data() + 6 * static_cast<std::ptrdiff_t>(a) * m.nv;
        mj_jac(model, d, rows + 3 * m.nv, rows, d->xpos + 3 * id, id);
      }
      mj_solveM2(model, d, half.data(), jacobian.data(), static_cast<int>(jacobian.rows()));
      product.noalias() = half * half.transpose();
    };
    const auto size_for = [this](const std::vector<int>& nodes) {
      const auto rows = 6 * static_cast<Eigen::Index>(nodes.size());
      if (jacobian.rows() != rows) jacobian.setZero(rows, m.nv), half.setZero(rows, m.nv), product.setZero(rows, rows);
    };
    const auto turned = [this](const std::vector<int>& nodes, const Eigen::MatrixXd& C) {
      std::vector<Eigen::Matrix3d> R;
      for (const int i : nodes)
        R.emplace_back(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(d->xmat + 9 * body[static_cast<std::size_t>(i)]));
      return in_node_axes(C, R);
    };
    const std::vector<int> ends = m.ends(), hand{m.hand()};
    // A step of the length 1 is v + v', q + v + v': derivatives of v' are those of v less the unit matrix.
    const auto derivatives = [this, set](bool centred, int k) {
      model->opt.timestep = 1.0;
      set_q(k), set_v(k), set_tau(k);
      mjd_transitionFD(model, d, centred ? 1e-5 : 1e-7, centred, transition.data(), nullptr, nullptr, nullptr);
      mj_solveM(model, d, matrix.data(), unit.data(), m.nv);
    };
    transition.setZero(2 * m.nv, 2 * m.nv);
    const auto our = [this, set](int k) {
      set_q(k), set_v(k), set_tau(k);
      mj_forward(model, d);
      const Eigen::VectorXd a = Eigen::Map<const Eigen::VectorXd>(d->qacc, m.nv);
      const Eigen::MatrixXd a_v = Eigen::MatrixXd(transition.bottomRightCorner(m.nv, m.nv)) - Eigen::MatrixXd::Identity(m.nv, m.nv);
      return our_derivatives(m, m.states[static_cast<std::size_t>(k)], set(k).map, root_map, a, transition.bottomLeftCorner(m.nv, m.nv),
                             a_v, matrix);
    };
    return {
        {"node_compliance", "mj_jac + mj_solveM2", [=](int k) { size_for(ends), factor(k), compliance(ends); },
         [=, this](int) { return turned(ends, product); }},
        {"operational_inertia", "mj_jac + mj_solveM2, inverted",
         [=, this](int k) {
           size_for(hand), factor(k), compliance(hand);
           inertia = product.topLeftCorner<6, 6>().llt().solve(Matrix6d::Identity());
         },
         [=, this](int) { return turned(hand, inertia); }},
        {"forward_derivatives", "mjd_transitionFD", [=](int k) { derivatives(false, k); }, our},
        {"forward_derivatives", "mjd_transitionFD, centred", [=](int k) { derivatives(true, k); }, our},
    };
  }

  Rows jacobian, half, product, transition;
  Matrix6d inertia;
};

}  // namespace

int main(int argc, char** argv) {
  mju_user_warning = [](const char*) {};  // else it writes a log file
  mju_user_error = [](const char* text) { throw peer::Refused(text); };
  return peer::run(argc, argv, "mujoco", mj_versionString(), [](const peer::Model& m) { return std::make_unique<Mujoco>(m); });
}
