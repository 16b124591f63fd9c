#include "bodies/modal/modal_source.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "bodies/modal/eigen_modes.hpp"
#include "bodies/modal/elements.hpp"
#include "bodies/modal/modal_check.hpp"
#include "bodies/modal/modal_file.hpp"
#include "bodies/modal/modal_integrals.hpp"
#include "bodies/modal/mode_audit.hpp"
#include "bodies/modal/refuse.hpp"

namespace cardan {
namespace {

constexpr int kFirstBatch = 20, kMostModes = 500, kForEffectiveMass = 60;

void check_choice(const ModalSource& source) {
  const ModeChoice& c = source.modes;
  const auto in_range = [](double x, double most) { return x >= 0.0 && x <= most; };
  if (c.count < 0 || c.count > kMostModes)
    refuse(source.at, "modes.count", Code::out_of_range, fmt::format("0 ... {}", kMostModes),
           fmt::format("{}", c.count));
  if (!in_range(c.max_frequency, INFINITY))
    refuse(source.at, "modes.max_frequency", Code::out_of_range, "a number >= 0 [Hz]",
           fmt::format("{}", c.max_frequency));
  if (!in_range(c.effective_mass, 1.0))
    refuse(source.at, "modes.effective_mass", Code::out_of_range, "0 ... 1", fmt::format("{}", c.effective_mass));
  if (c.count == 0 && c.max_frequency == 0.0 && c.effective_mass == 0.0)
    refuse(source.at, "modes", Code::missing_key, "count, max_frequency or effective_mass", "none of them");
  if (c.effective_mass > 0.0 && source.boundary != Boundary::cantilever)
    refuse(source.at, "modes.effective_mass", Code::unsupported, "the cantilever boundary", "another one",
           "choose by count or max_frequency: free modes have no effective mass, Craig-Bampton modes come as a set");
}

/// The modes among which is chosen: as many as the limits can keep, at least.
FeModes candidates(const FeModel& model, const std::vector<int>& held, RigidModes rigid, const ModalSource& source) {
  const ModeChoice& choice = source.modes;
  const int n_free = static_cast<int>(FreePart(model.n_dofs(), held).dofs.size());
  if (choice.count > 0 || choice.max_frequency == 0.0)
    return normal_modes(model, held, choice.count > 0 ? choice.count : std::min(kForEffectiveMass, n_free / 2), rigid,
                        source.at);
  const double limit = std::pow(2 * std::numbers::pi * choice.max_frequency, 2);
  for (int count = std::min(kFirstBatch, n_free / 2);; count = std::min(2 * count, n_free / 2)) {
    FeModes modes = normal_modes(model, held, count, rigid, source.at);
    if (modes.omega2(count - 1) > limit) return modes;
    if (count >= n_free / 2 || 2 * count > kMostModes)
      refuse(source.at, "modes.max_frequency", Code::out_of_range,
             fmt::format("a limit that keeps fewer than {} modes", count + 1),
             fmt::format("{} Hz, above mode {} at {:.6g} Hz", choice.max_frequency, count,
                         std::sqrt(modes.omega2(count - 1)) / (2 * std::numbers::pi)),
             "refine the mesh or lower the limit");
  }
}

/// Named node -> mesh node; "root" first.
std::vector<std::pair<NamedPoint, int>> find_points(const FeModel& model, const ModalSource& source) {
  std::vector<std::pair<NamedPoint, int>> found;
  std::set<std::string> names;
  std::vector<NamedPoint> points = source.points;
  points.insert(points.begin(), {"root", Eigen::Vector3d::Zero(), false});
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::string field = i == 0 ? "points" : fmt::format("points[{}]", i - 1);
    const NamedPoint& p = points[i];
    if (!names.insert(p.name).second)
      refuse(source.at, field + ".name", Code::duplicate_name, "a name of its own", fmt::format("\"{}\"", p.name),
             p.name == "root" ? "\"root\", at the origin, is always there" : "");
    const int node = model.find_node(p.position);
    if (node < 0)
      refuse(source.at, field + ".position", Code::fe_model, "a point within one element of the mesh",
             fmt::format("({}, {}, {}) m", p.position.x(), p.position.y(), p.position.z()));
    found.emplace_back(p, node);
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

ModalData solve(const FeModel& model, const ModalSource& source) {
  check_choice(source);
  const auto points = find_points(model, source);
  const bool free = source.boundary == Boundary::free;
  const std::vector<int> held = free ? std::vector<int>{} : dofs_of(model.root_nodes);
  std::vector<int> interface;
  if (source.boundary == Boundary::craig_bampton) {
    for (const auto& [point, node] : points)
      if (point.interface)
        interface.insert(interface.end(),
                         {6 * node, 6 * node + 1, 6 * node + 2, 6 * node + 3, 6 * node + 4, 6 * node + 5});
    if (interface.empty())
      refuse(source.at, "points", Code::fe_model, "a point with `interface`, for the craig_bampton boundary", "none");
  }
  std::vector<int> fixed = held;
  fixed.insert(fixed.end(), interface.begin(), interface.end());
  FeModes modes = candidates(model, fixed, free ? RigidModes::remove : RigidModes::refuse, source);

  ModalData data;
  data.audit = audit_modes(model, modes, source.modes);
  if (!interface.empty()) {
    const auto count = std::count_if(data.audit.begin(), data.audit.end(), [](const ModeRecord& r) { return r.kept; });
    modes = craig_bampton(model, held, interface, static_cast<int>(count), source.at);
    data.audit = audit_modes(model, modes, {});
    for (ModeRecord& r : data.audit) {
      r.kind = "Craig-Bampton";
      r.reason = fmt::format("set of {} fixed-interface and {} constraint modes", count, interface.size());
    }
  }
  std::vector<Eigen::Index> kept;
  for (std::size_t j = 0; j < data.audit.size(); ++j)
    if (data.audit[j].kept) kept.push_back(j);
  if (kept.empty()) refuse(source.at, "modes", Code::out_of_range, "a choice that keeps a mode", "none is kept");
  const Eigen::MatrixXd shapes = modes.shapes(Eigen::all, kept);
  const Eigen::VectorXd omega2 = modes.omega2(kept);

  data.n_modes = static_cast<int>(kept.size());
  data.integrals = modal_integrals(model.mass_field(shapes));
  data.integrals.I6.setIdentity();  // what the modes are normalised to; the sum differs by rounding
  if (free) data.integrals.I3.setZero(), data.integrals.I4.setZero();  // mean axes, likewise
  data.K = omega2.asDiagonal();
  data.C = damping_matrix(source, omega2);
  for (const auto& [point, node] : points) {
    ModalNode n;
    n.name = point.name;
    n.position = model.nodes[node];
    n.Phi = shapes.middleRows(6 * node, 3);
    n.Psi = shapes.middleRows(6 * node + 3, 3);
    data.nodes.push_back(std::move(n));
  }
  data.source = model.description + ", ARPACK shift-invert";
  data.content_hash = content_hash(data);
  return data;
}

struct Maker {
  const ModalSource& source;
  ModalData operator()(const BeamModel& m) const { return solve(beam_mesh(m, source.masses, source.at), source); }
  ModalData operator()(const PlateModel& m) const { return solve(plate_mesh(m, source.masses, source.at), source); }
  ModalData operator()(const LumpedModel& m) const {
    ModalData data = lumped_modal_data(m.mass_nodes, m.K, m.C, m.nodes);
    data.content_hash = content_hash(data);
    return data;
  }
  ModalData operator()(const FileModel& m) const { return read_modal_file(m.path); }
};

}  // namespace

ModalData make_modal_data(const ModalSource& source) {
  ModalData data = std::visit(Maker{source}, source.model);
  check_nodes(data.nodes, data.n_modes, source.at);
  return data;
}

}  // namespace cardan
