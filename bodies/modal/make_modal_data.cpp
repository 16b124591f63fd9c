#include "bodies/modal/modal_source.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <set>

#include "bodies/modal/eigen_modes.hpp"
#include "bodies/modal/elements.hpp"
#include "bodies/modal/lumped.hpp"
#include "bodies/modal/matrices.hpp"
#include "bodies/modal/modal_check.hpp"
#include "bodies/modal/modal_file.hpp"
#include "bodies/modal/modal_integrals.hpp"
#include "bodies/modal/mode_audit.hpp"
#include "bodies/modal/node_sets.hpp"
#include "bodies/modal/refuse.hpp"
#include "bodies/modal/solids.hpp"

namespace cardan {
namespace {

constexpr int kFirstBatch = 20, kMostModes = 500, kForEffectiveMass = 60;

void check_choice(const ModalSource& source) {
  const ModeChoice& c = source.modes;
  const auto in_range = [](double x, double most) { return x >= 0.0 && x <= most; };
  if (const int fewest = source.boundary == Boundary::craig_bampton ? 0 : 1; c.count && (*c.count < fewest || *c.count > kMostModes))
    refuse(source.at, "modes.count", Code::out_of_range, fmt::format("{} ... {}", fewest, kMostModes), fmt::format("{}", *c.count));
  if (!in_range(c.max_frequency, INFINITY))
    refuse(source.at, "modes.max_frequency", Code::out_of_range, "a number >= 0 [Hz]", fmt::format("{}", c.max_frequency));
  if (!in_range(c.effective_mass, 1.0))
    refuse(source.at, "modes.effective_mass", Code::out_of_range, "0 ... 1", fmt::format("{}", c.effective_mass));
  if (!c.count && c.max_frequency == 0.0 && c.effective_mass == 0.0)
    refuse(source.at, "modes", Code::missing_key, "count, max_frequency or effective_mass", "none of them");
  if (c.effective_mass > 0.0 && source.boundary != Boundary::cantilever)
    refuse(source.at, "modes.effective_mass", Code::unsupported, "the cantilever boundary", "another one",
           "choose by count or max_frequency: free modes have no effective mass, Craig-Bampton modes come as a set");
}

/// The modes among which is chosen: as many as the limits can keep, at least.
FeModes candidates(const FeModel& model, const std::vector<int>& held, RigidModes rigid, const ModalSource& source) {
  const ModeChoice& choice = source.modes;
  const int most = std::max(1, static_cast<int>(FreePart(model.n_dofs(), held).dofs.size()) / 2);
  if (choice.count || choice.max_frequency == 0.0)
    return normal_modes(model, held, choice.count.value_or(std::min(kForEffectiveMass, most)), rigid, source.at);
  const double limit = std::pow(2 * std::numbers::pi * choice.max_frequency, 2);
  for (int count = std::min(kFirstBatch, most);; count = std::min(2 * count, most)) {
    FeModes modes = normal_modes(model, held, count, rigid, source.at);
    if (modes.omega2(count - 1) > limit) return modes;
    if (count >= most || 2 * count > kMostModes)
      refuse(source.at, "modes.max_frequency", Code::out_of_range, fmt::format("a limit that keeps fewer than {} modes", count + 1),
             fmt::format("{} Hz, above mode {} at {:.6g} Hz", choice.max_frequency, count,
                         std::sqrt(modes.omega2(count - 1)) / (2 * std::numbers::pi)),
             "refine the mesh or lower the limit");
  }
}

/// A named node, and what moves it.
struct Attached {
  NamedPoint point;
  FeModel::Grip grip;
};

/// "root" first.
std::vector<Attached> find_points(const FeModel& model, const ModalSource& source) {
  std::vector<Attached> found;
  std::set<std::string> names;
  std::vector<NamedPoint> points = source.points;
  points.insert(points.begin(), {.name = "root"});
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::string field = i == 0 ? "points" : fmt::format("points[{}]", i - 1);
    const NamedPoint& p = points[i];
    if (!names.insert(p.name).second)
      refuse(source.at, field + ".name", Code::duplicate_name, "a name of its own", fmt::format("\"{}\"", p.name),
             p.name == "root" ? "\"root\", at the origin, is always there" : "");
    if (i > 0) {
      found.push_back({p, grip_of(model, p.nodes, p.position, field, source.at)});
      continue;
    }
    const bool free = source.boundary == Boundary::free;
    if (model.per_node == 3) {
      const auto* solid = std::get_if<SolidModel>(&source.model);
      found.push_back({p, solid ? root_grip(model, solid->root, free, "solid.root", source.at)
                                : root_grip(model, std::get<MatrixModel>(source.model).root, free, "matrices.root", source.at)});
      continue;
    }
    const int node = model.find_node(p.position);
    found.push_back({p, *model.grip(p.position, {node < 0 ? model.root_nodes.front() : node})});
  }
  return found;
}

Eigen::MatrixXd damping_matrix(const ModalSource& source, const Eigen::VectorXd& omega2) {
  const auto m = static_cast<std::size_t>(omega2.size());
  const std::vector<double>& zeta = source.damping;
  if (zeta.size() != 1 && zeta.size() != m)
    refuse(source.at, "damping", Code::bad_modal_data, fmt::format("one ratio, or {}: one for each kept mode", m),
           fmt::format("{}", zeta.size()));
  Eigen::VectorXd c(omega2.size());
  for (std::size_t k = 0; k < m; ++k) {
    const double z = zeta.size() == 1 ? zeta[0] : zeta[k];
    if (!(z >= 0.0)) refuse(source.at, "damping", Code::out_of_range, "a ratio >= 0", fmt::format("{}", z));
    c(k) = 2 * z * std::sqrt(omega2(k));
  }
  return c.asDiagonal();
}

/// Doubts about the choice of modes and their damping.
class ModeDoubts {
 public:
  ModeDoubts(const FeModel& model, const ModalSource& source, Warnings& warnings) : model_(model), source_(source), warnings_(warnings) {
    const RigidShapes R = model.rigid_shapes();
    rigid_ = (R.transpose() * (model.M * R)).diagonal();
    const double least = kNoInertia * rigid_.head<3>().maxCoeff();
    for (double& inertia : rigid_.head<3>())
      if (!(inertia > least)) inertia = INFINITY;  // masses on one line have none about it, and no share of it
  }

  /// Of a cantilever: modes that were found but are not kept, below or close above the highest one kept, and what all of them carry.
  void truncation(const FeModes& found, const std::vector<ModeRecord>& audit) {
    double highest = 0.0;
    bool has_others = found.next_omega2.size() > 0;
    Vector6 kept = Vector6::Zero(), all = Vector6::Zero();
    for (const ModeRecord& r : audit) {
      all += r.effective_mass;
      has_others |= !r.kept;
      if (r.kept) highest = std::max(highest, r.frequency), kept += r.effective_mass;
    }
    const auto look = [&](double frequency, const Vector6& mass) {
      Eigen::Index d;
      const double share = mass.cwiseQuotient(rigid_).maxCoeff(&d);
      if (frequency > kNear * highest || share < kMatters) return;
      add(Code::truncated_modes, "modes",
          fmt::format("a mode at {:.4g} Hz with {:.3g} % of the effective mass in {} is left out; the highest one kept has {:.4g} Hz",
                      frequency, 100.0 * share, direction(d), highest),
          "keep it, or the others of its frequency move without it");
    };
    for (const ModeRecord& r : audit)
      if (!r.kept) look(r.frequency, r.effective_mass);
    if (found.next_omega2.size() > 0) {
      const Eigen::MatrixXd next = participation(model_, {found.next_omega2, found.next_shapes});
      for (Eigen::Index j = 0; j < next.cols(); ++j)
        look(std::sqrt(std::max(0.0, found.next_omega2(j))) / (2 * std::numbers::pi), next.col(j).cwiseAbs2());
    }
    Eigen::Index best;
    if (const double share = kept.cwiseQuotient(rigid_).maxCoeff(&best); share < kLittle && has_others)
      add(Code::truncated_modes, "modes",
          fmt::format("the modes kept carry at most {:.3g} % of the effective mass in any direction ({})", 100.0 * share, direction(best)),
          "the rest moves as if it were rigid; keep more modes");
    const double wanted = source_.modes.effective_mass;
    if (wanted == 0.0 || source_.modes.count || source_.modes.max_frequency > 0.0) return;
    std::string short_of;  // of the directions that were to reach the share
    for (Eigen::Index d = 0; d < 6; ++d)
      if (all(d) > kMatters * rigid_(d) && kept(d) < (2.0 * wanted - 1.0 - kRounding) * rigid_(d))
        short_of += fmt::format("{}{:.3g} % in {}", short_of.empty() ? "" : ", ", 100.0 * kept(d) / rigid_(d), direction(d));
    if (!short_of.empty())
      add(Code::truncated_modes, "modes.effective_mass",
          fmt::format("{:.4g} % is of what the {} modes computed carry, up to {:.4g} Hz; of the mass of the body they carry {}",
                      100.0 * wanted, audit.size(), audit.back().frequency, short_of),
          "`count` or `max_frequency` beside it computes more modes");
  }

  /// First-order rotary terms are n_modes matrices of n_modes squared, here and in the compiled model.
  void memory(int n_modes) {
    const bool rotary =
        std::any_of(model_.point_inertia.begin(), model_.point_inertia.end(), [](const Eigen::Matrix3d& J) { return !J.isZero(0.0); });
    const double bytes = 3.0 * std::pow(n_modes, 3) * sizeof(double);
    if (rotary && bytes > kLargeBytes)
      add(Code::large_run, "modes",
          fmt::format("the rotary inertia of {} modes takes about {:.2g} GB, and each step reads a third of it", n_modes, bytes / 1e9),
          "keep fewer modes");
  }

  /// Points and masses stand on nodes of the mesh: those that lay elsewhere were moved.
  void places(const std::vector<Attached>& points) {
    const auto look = [&](const std::string& field, const Eigen::Vector3d& wanted, const Eigen::Vector3d& got) {
      if ((got - wanted).norm() > kElsewhere * model_.element_size && model_.exact_points)
        add(Code::unusual_value, field.c_str(),
            fmt::format("({:.6g}, {:.6g}, {:.6g}) m is not on the mesh: it was moved to its nearest node at ({:.6g}, {:.6g}, {:.6g}) m",
                        wanted.x(), wanted.y(), wanted.z(), got.x(), got.y(), got.z()),
            "give the place of a node, or choose the number of elements so that there is one");
    };
    for (std::size_t i = 1; i < points.size(); ++i)
      if (!points[i].point.nodes.at_mean)
        look(fmt::format("points[{}].position", i - 1), points[i].point.position, points[i].grip.position);
    for (std::size_t i = 0; i < source_.masses.size(); ++i)
      look(fmt::format("masses[{}].position", i), source_.masses[i].position, place_of_mass(source_.masses[i]));
  }

  Eigen::Vector3d place_of_mass(const PointMass& mass) const {
    return mass.nodes.nearest() ? model_.nodes[static_cast<std::size_t>(model_.find_node(mass.position))] : mass.position;
  }

  void damping(const Eigen::VectorXd& omega2, const Eigen::MatrixXd& C) {
    for (Eigen::Index j = 0; j < omega2.size(); ++j)
      if (const double zeta = C(j, j) / (2.0 * std::sqrt(omega2(j))); zeta >= kCritical)
        return add(Code::unusual_value, "damping",
                   fmt::format("mode {} at {:.4g} Hz has {:.4g} % of critical damping: it does not vibrate", j + 1,
                               std::sqrt(omega2(j)) / (2 * std::numbers::pi), 100.0 * zeta),
                   "structures in space have 0.1 ... 2 %");
  }

 private:
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  static constexpr double kNear = 1.5, kMatters = 0.1, kLittle = 0.5, kCritical = 1.0, kRounding = 1e-9, kLargeBytes = 5e8,
                          kElsewhere = 1e-6, kNoInertia = 1e-14;
  static const char* direction(Eigen::Index d) {
    constexpr std::array names = {"rotation about x",    "rotation about y",    "rotation about z",
                                  "translation along x", "translation along y", "translation along z"};
    return names[static_cast<std::size_t>(d)];
  }
  void add(Code code, const char* field, std::string about, std::string hint) {
    warnings_.add(code, {source_.at.key_path + "." + field, source_.at.mark}, std::move(about), std::move(hint));
  }
  const FeModel& model_;
  const ModalSource& source_;
  Warnings& warnings_;
  Vector6 rigid_;  // [kg m^2 | kg] of the body as it stands, about its origin; infinite where it has none
};

/// What M itself says of the body and of its modes at first order. Where the masses between the nodes are not all of M, I8 is theirs about
/// the mass centre, from where it is moved by I3 of M: about any other point the error would grow with its distance.
void set_rigid_and_first(const FeModel& model, const Eigen::MatrixXd& shapes, ModalIntegrals& I) {
  const RigidShapes R = model.rigid_shapes();
  const Eigen::MatrixXd MR = model.M * R;
  const Eigen::Matrix<double, 6, 6> A = R.transpose() * MR;
  const Eigen::MatrixXd first = MR.transpose() * shapes;
  I.I1 = A.bottomRightCorner<3, 3>().trace() / 3.0;
  I.I2 = first_moment(A);
  I.I7 = A.topLeftCorner<3, 3>();
  const auto n = static_cast<Eigen::Index>(model.nodes.size()), own = model.per_node == 6 ? 4 * n : n;  // behind: what the vehicle adds
  const Eigen::Vector3d centre = model.point_position.leftCols(own) * model.point_mass.head(own) / model.point_mass.head(n).sum();
  for (std::size_t k = 0; k < I.I8.size(); ++k) {
    const auto mode = static_cast<Eigen::Index>(k);
    const Eigen::Vector3d more = first.col(mode).tail<3>() - I.I3.col(mode);
    I.I8[k] += centre.dot(more) * Eigen::Matrix3d::Identity() - more * centre.transpose();
  }
  I.I3 = first.bottomRows(3);
  I.I4 = first.topRows(3);
  for (std::size_t k = 0; k < I.I8.size() && I.rotary_ww.empty(); ++k) {  // I8 - I8* = -I4~, which a file of these modes has to obey
    const Eigen::Vector3d a = I.I4.col(static_cast<Eigen::Index>(k));
    Eigen::Matrix3d turn;
    turn << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
    I.I8[k] = (0.5 * (I.I8[k] + I.I8[k].transpose() - turn)).eval();
  }
}

/// `shape`: what the mesh was doubtful about.
ModalData solve(const FeModel& model, const ModalSource& source, const Warnings& shape, Warnings* warnings) {
  check_choice(source);
  const auto points = find_points(model, source);
  const bool free = source.boundary == Boundary::free;
  const std::vector<int> held = free ? std::vector<int>{} : dofs_of(model.root_nodes, model.per_node);
  std::vector<int> interface;
  Eigen::MatrixXd unit(model.n_dofs(), 0);  // of the interface: rigid motions of the nodes of each point
  if (source.boundary == Boundary::craig_bampton) {
    for (std::size_t i = 1; i < points.size(); ++i)  // the first is the root
      if (const auto& [point, grip] = points[i]; point.interface) {
        const std::string field = fmt::format("points[{}].interface", i - 1);
        const std::vector<int> dofs = dofs_of(grip.nodes, model.per_node);
        const auto among = [&](const std::vector<int>& list) { return std::ranges::find_first_of(dofs, list) != dofs.end(); };
        if (among(held)) refuse(source.at, field, Code::fe_model, "a node of the mesh that can move", "one that the root holds");
        if (among(interface))
          refuse(source.at, field, Code::fe_model, "a node of the mesh for each point with `interface`", "that of another such point",
                 "leave one of the two out, or refine the mesh");
        interface.insert(interface.end(), dofs.begin(), dofs.end());
        unit.conservativeResize(Eigen::NoChange, unit.cols() + 6);
        unit.rightCols(6) = model.rigid_motion(grip);
      }
    if (interface.empty()) refuse(source.at, "points", Code::fe_model, "a point with `interface`, for the craig_bampton boundary", "none");
  } else if (const auto i = std::ranges::find(points, true, [](const auto& p) { return p.point.interface; }); i != points.end()) {
    refuse(source.at, fmt::format("points[{}].interface", i - points.begin() - 1), Code::unsupported,
           "the craig_bampton boundary for a point with `interface`", free ? "free" : "cantilever",
           "boundary: craig_bampton, or leave `interface` out");
  }
  std::vector<int> fixed = held;
  fixed.insert(fixed.end(), interface.begin(), interface.end());
  FeModes modes = candidates(model, fixed, free ? RigidModes::remove : RigidModes::refuse, source);

  ModalData data;
  data.audit = audit_modes(model, modes, source.modes);
  if (warnings && source.boundary == Boundary::cantilever) ModeDoubts(model, source, *warnings).truncation(modes, data.audit);
  if (!interface.empty()) {
    const auto count = std::count_if(data.audit.begin(), data.audit.end(), [](const ModeRecord& r) { return r.kept; });
    if (const auto all = count + unit.cols(); all > kMostModesOfBody)
      refuse(source.at, "modes", Code::out_of_range,
             fmt::format("at most {} modes, six of each point with `interface` among them", kMostModesOfBody),
             fmt::format("{}: {} with interfaces held, {} of interfaces", all, count, unit.cols()));
    modes = craig_bampton(model, held, interface, unit, static_cast<int>(count), source.at);
    data.audit = audit_modes(model, modes, {});
    for (ModeRecord& r : data.audit) {
      r.kind = "Craig-Bampton";
      r.reason = fmt::format("set of {} fixed-interface and {} constraint modes", count, unit.cols());
    }
  }
  std::vector<Eigen::Index> kept;
  for (std::size_t j = 0; j < data.audit.size(); ++j)
    if (data.audit[j].kept) kept.push_back(j);
  if (kept.empty()) refuse(source.at, "modes", Code::out_of_range, "a choice that keeps a mode", "none is kept");
  const Eigen::MatrixXd shapes = modes.shapes(Eigen::all, kept);
  const Eigen::VectorXd omega2 = modes.omega2(kept);

  data.n_modes = static_cast<int>(kept.size());
  if (warnings) ModeDoubts(model, source, *warnings).memory(data.n_modes);
  if (warnings) ModeDoubts(model, source, *warnings).places(points);
  data.integrals = modal_integrals(model.mass_field(shapes));
  if (!model.exact_points) set_rigid_and_first(model, shapes, data.integrals);
  if (model.component_modes > 0) forget_changes(data.integrals);
  forget_rounding(data.integrals);
  data.integrals.I6.setIdentity();                                     // what the modes are normalised to; the sum differs by rounding
  if (free) data.integrals.I3.setZero(), data.integrals.I4.setZero();  // mean axes, likewise
  data.K = omega2.asDiagonal();
  if (model.C.size() > 0) {
    const Eigen::MatrixXd C = shapes.transpose() * (model.C * shapes);
    data.C = 0.5 * (C + C.transpose());
  } else {
    data.C = damping_matrix(source, omega2);
  }
  if (warnings) ModeDoubts(model, source, *warnings).damping(omega2, data.C);
  for (const auto& [point, grip] : points) {
    const Eigen::MatrixXd motion = grip.of(shapes, model.per_node);
    ModalNode n;
    n.name = point.name;
    n.position = grip.position;
    n.R_BN = point.R_BN;
    n.Phi = motion.topRows(3);
    n.Psi = motion.bottomRows(3);
    data.nodes.push_back(std::move(n));
  }
  data.drawing = model.drawing(shapes);
  if (warnings)
    for (Warning w : shape.all()) {
      w.what.about += fmt::format("; the first mode has {:.4g} Hz", std::sqrt(omega2(0)) / (2 * std::numbers::pi));
      warnings->add(std::move(w.what));
    }
  data.source = model.description + ", ARPACK shift-invert";
  data.content_hash = content_hash(data);
  return data;
}

struct Maker {
  const ModalSource& source;
  Warnings* warnings;
  ModalData operator()(const BeamModel& m) const {
    Warnings shape;
    const FeModel mesh = beam_mesh(m, source.masses, source.at, &shape);
    return solve(mesh, source, shape, warnings);
  }
  ModalData operator()(const PlateModel& m) const {
    Warnings shape;
    const FeModel mesh = plate_mesh(m, source.masses, source.at, &shape);
    return solve(mesh, source, shape, warnings);
  }
  ModalData operator()(const SolidModel& m) const {
    if (m.root.nearest() && source.boundary != Boundary::free)
      refuse(source.at, "solid.root", Code::missing_key, "the nodes that the body frame holds", "none",
             "root: {group: base}, {numbers: [1, 2, 3]}, {position: [0, 0, 0], normal: [1, 0, 0]} or {position: [0, 0, 0], within: 10 cm}");
    return solve(solid_model(m, source.masses, source.at, warnings), source, {}, warnings);
  }
  ModalData operator()(const LumpedModel& m) const {
    ModalData data = lumped_modal_data(m.mass_nodes, m.K, m.C, m.nodes);
    data.content_hash = content_hash(data);
    return data;
  }
  ModalData operator()(const FileModel& m) const {
    std::error_code unusable;  // a name too long for a file, say
    if (!std::filesystem::exists(m.path, unusable))
      refuse(Code::file_not_found, {source.at.key_path.empty() ? "" : source.at.key_path + ".file", source.at.mark},
             "a modal file, relative to the folder of the vehicle", fmt::format("\"{}\"", m.path),
             "`cardan modes` writes one of a beam, a plate, solids or matrices");
    return read_modal_file(m.path);
  }
  ModalData operator()(const MatrixModel& m) const { return solve(matrix_mesh(m, source.masses, source.at), source, {}, warnings); }
};

}  // namespace

ModalData make_modal_data(const ModalSource& source, Warnings* warnings) {
  ModalData data = std::visit(Maker{source, warnings}, source.model);
  check_nodes(data.nodes, data.n_modes, source.at);
  return data;
}

}  // namespace cardan
