#include "core/model/validate.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <set>
#include <span>
#include <string_view>
#include <unordered_map>

#include "core/base/units.hpp"
#include "core/linalg/dense.hpp"
#include "core/model/initial.hpp"
#include "core/model/params.hpp"
#include "core/model/schema.hpp"

namespace cardan {
namespace {

constexpr double kMeanAxes = 1e-9;           // of sqrt(mass times modal mass): rounding of modes that are orthogonal to the rigid motions
constexpr double kTriangleTolerance = 1e-6;  // relative; moments are typed with a finite number of digits

/// Positive definite, and the pivots of L D L* say so well above round-off.
bool surely_positive(const Eigen::Matrix3d& A) {
  const double margin = 1e-9 * A.trace(), a = A(1, 0), b = A(2, 0), d0 = A(0, 0);
  if (!(d0 > margin)) return false;
  const double d1 = A(1, 1) - a * a / d0, c = A(2, 1) - a * b / d0;
  return d1 > margin && A(2, 2) - b * b / d0 - c * c / d1 > margin;
}

GivenParams params_of(const BodySpec& body, const cardan_body_family& family) {
  return {body_path(body), fmt::format("body type {}", family.type), body.params};
}
GivenParams params_of(const BodySpec& body, const cardan_hinge_family& family) {
  return {body_path(body) + ".hinge", fmt::format("hinge type {}", family.type), body.hinge.params};
}

/// The checks of one description but for its hinge families. Without a registry what depends on the types of bodies is left out.
class Structure {
 public:
  Structure(const SystemSpec& spec, const Registry* registry, DiagnosticSink& sink) : spec_(spec), registry_(registry), sink_(sink) {}

  void check() {
    if (spec_.bodies.empty()) sink_.report(Code::empty_system, spec_.locate("bodies"), "at least one body", "none");
    const std::size_t n = spec_.bodies.size();
    index_.reserve(n);
    for (std::size_t i = 0; i < n; ++i)
      if (const BodySpec& body = spec_.bodies[i]; !index_.emplace(body.name, static_cast<int>(i)).second)
        report(Code::duplicate_name, body_path(body), "a name of its own for each body", in_quotes(body.name));
    inboard_.resize(n, -1);
    for (std::size_t i = 0; i < n; ++i) {
      if (sink_.full()) return;
      check_body(spec_.bodies[i]);
      inboard_[i] = check_hinge(spec_.bodies[i]);
    }
    check_cycles();
    check_gravity();
  }
  /// Of each body the index of its inboard body; -1: the world, or no such body.
  const std::vector<int>& inboard() const { return inboard_; }

 private:
  // Key paths are functions of what stands after the path of the body: most are never put together.
  void report(Code code, std::string path, std::string expected, std::string got, std::string hint = {}) {
    sink_.report(code, spec_.locate(std::move(path)), std::move(expected), std::move(got), std::move(hint));
  }

  void check_body(const BodySpec& body) {
    const auto at = [&](const char* key) { return body_path(body) + key; };
    if (body.name.empty() || body.name == "world" || body.name.find('.') != std::string::npos)
      report(Code::bad_name, at(""), "a name without a point, other than `world`", in_quotes(body.name));
    const cardan_body_family* family = registry_ ? registry_->body(body.type) : nullptr;
    if (registry_ && !family) return report_type(body, at(".type"));
    if (family ? has_modes(*family) : body.modal || body.modal_source)
      check_flexible(body, at);
    else
      check_nodes(body);
    if (!family) return;
    if (!has_modes(*family)) check_mass(body, family->mass_source == CARDAN_MASS_POINT, at);
    checked_params(spec_, params_of(body, *family), {family->params, family->n_params}, sink_);
  }

  void report_type(const BodySpec& body, std::string at) {
    const std::vector<std::string> types = registry_->bodies.types();
    report(Code::unknown_body_type, std::move(at), "a body type: " + one_of(types), in_quotes(body.type), did_you_mean(body.type, types));
  }

  void check_mass(const BodySpec& body, bool point, const auto& at) {
    if (!(body.mass > 0.0) || !std::isfinite(body.mass))
      return report(Code::non_positive_mass, at(".mass"), "mass > 0", fmt::format("{:g} kg", body.mass),
                    body.mass == 0.0 ? "join what has no mass to a body that has some" : "");
    if (!body.com.allFinite()) return report(Code::out_of_range, at(".com"), "three finite numbers", "a value that is not finite");
    if (!point) check_inertia(body, at);
  }

  void check_inertia(const BodySpec& body, const auto& at) {
    const InertiaFault fault = inertia_fault(body.inertia_com, false);
    if (fault.expected.empty()) return;
    // A tensor about any point of a body obeys these laws too: taking `about: origin` away may help, adding it cannot.
    const bool shifted = spec_.marks.count(body_path(body) + ".inertia.about") && !body.com.isZero();
    report(Code::unphysical_inertia, at(".inertia"), fault.expected, fault.got,
           shifted ? "about: origin takes mass (|c|^2 1 - c c^T) off the tensor given, c = com; leave it out if the tensor is about the "
                     "mass centre"
                   : fault.hint);
  }

  void check_nodes(const BodySpec& body) {
    std::set<std::string_view> seen;
    for (const NodeSpec& node : body.nodes) {
      const auto at = [&](const char* key) { return fmt::format("{}.nodes.{}{}", body_path(body), node.name, key); };
      if (!seen.insert(node.name).second)
        report(Code::duplicate_name, at(""), "a name of its own for each node of a body", in_quotes(node.name));
      if (!node.position.allFinite()) report(Code::out_of_range, at(".position"), "three finite numbers", "a value that is not finite");
      check_rotation(node.R_BN, at, ".orientation");
    }
  }
  void check_rotation(const Eigen::Matrix3d& R, const auto& at, const char* key) {
    const double error = (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
    if (!(error < 1e-9) || R.determinant() < 0.0)
      report(Code::not_a_rotation, at(key), "an orthonormal right-handed matrix", fmt::format("an entry of R R^T - 1 is {:.3g}", error));
  }

  void check_flexible(const BodySpec& body, const auto& at) {
    if (body.level < 0 || body.level > 2) report(Code::out_of_range, at(".level"), "0, 1 or 2", fmt::format("{}", body.level));
    if (!body.modal) {
      if (!body.modal_source) report(Code::missing_key, at(".modal"), "modal: where the modes come from", "no such key");
      return;
    }
    const auto size_fits = [&](const std::vector<double>& values, const char* name) {
      if (!values.empty() && values.size() != static_cast<std::size_t>(body.modal->n_modes))
        report(Code::bad_initial_state, fmt::format("{}.initial.{}", at(""), name),
               fmt::format("{} values, one for each mode kept", body.modal->n_modes), fmt::format("{} values", values.size()));
    };
    if (body.level > 0 && !body.modal->integrals.of_change)
      report(Code::bad_modal_data, at(".level"),
             "0: component modes, and files without I5 and I8, do not tell how inertia changes with them", fmt::format("{}", body.level));
    size_fits(body.eta, "eta");
    size_fits(body.etadot, "etadot");
  }

  /// The index of the inboard body; -1: the world, or no such body.
  int check_hinge(const BodySpec& body) {
    const HingeSpec& hinge = body.hinge;
    const auto at = [&](const char* key) { return body_path(body) + ".hinge" + key; };
    check_node_name(body, hinge.body_node, at, ".at");
    check_rotation(hinge.pnode_R, at, ".at.orientation");
    check_rotation(hinge.onode_R, at, ".to.orientation");
    if (hinge.inboard_body.empty()) {
      if (!hinge.inboard_node.empty())
        report(Code::unknown_node, at(".to"), "world without a node name", in_quotes("world." + hinge.inboard_node),
               "give the place instead: to: {body: world, position: [x, y, z]}");
      return -1;
    }
    const auto inboard = index_.find(hinge.inboard_body);
    if (inboard == index_.end()) {
      std::vector<std::string> legal;
      for (const BodySpec& other : spec_.bodies) legal.push_back(other.name);
      legal.emplace_back("world");
      report(Code::unknown_body, at(".to"), "a body: " + one_of(legal), in_quotes(hinge.inboard_body),
             did_you_mean(hinge.inboard_body, legal));
      return -1;
    }
    check_node_name(spec_.bodies[inboard->second], hinge.inboard_node, at, ".to");
    return inboard->second;
  }
  void check_node_name(const BodySpec& body, const std::string& node, const auto& at, const char* key) {
    if (node.empty() || (body.modal_source && !body.modal)) return;  // its nodes come with its modes
    std::vector<std::string> legal;
    for (const NodeSpec& n : body.nodes) legal.push_back(n.name);
    if (body.modal)
      for (const ModalNode& n : body.modal->nodes) legal.push_back(n.name);
    if (std::ranges::find(legal, node) != legal.end()) return;
    report(Code::unknown_node, at(key),
           legal.empty() ? fmt::format("no node name: body {} has no nodes", body.name)
                         : fmt::format("a node of body {}: {}", body.name, one_of(legal)),
           in_quotes(node), did_you_mean(node, legal));
  }

  void check_cycles() {
    const int n = static_cast<int>(inboard_.size());
    const auto inboard = [&](int i) { return inboard_[i]; };
    const auto body = [&](int i) -> const BodySpec& { return spec_.bodies[i]; };
    std::vector<int> seen_from(inboard_.size(), -1);  // the body whose way to the world led here first
    for (int start = 0; start < n; ++start) {
      int i = start;
      for (; i >= 0 && seen_from[i] < 0; i = inboard(i)) seen_from[i] = start;
      if (i < 0 || seen_from[i] != start) continue;  // ended at the world, or in what was seen before
      std::string names = body(i).name + " -> ";
      for (int k = inboard(i); k != i; k = inboard(k)) names += body(k).name + " -> ";
      report(Code::cycle, body_path(body(i)) + ".hinge.to", "inboard bodies that lead to the world", names + body(i).name,
             "hang one of them on the world or on a body outside the loop");
    }
  }

  void check_gravity() {
    const GravitySpec& gravity = spec_.gravity;
    if (gravity.kind == GravitySpec::Kind::uniform && !gravity.g.allFinite())
      report(Code::out_of_range, "gravity.uniform", "three finite numbers", "a value that is not finite");
    if (gravity.kind != GravitySpec::Kind::central) return;
    if (!(gravity.mu > 0.0) || !std::isfinite(gravity.mu))
      report(Code::out_of_range, "gravity.central.mu", "a gravitational parameter > 0", fmt::format("{:g} m^3/s^2", gravity.mu));
    if (!gravity.centre.allFinite())
      report(Code::out_of_range, "gravity.central.centre", "three finite numbers", "a value that is not finite");
  }

  const SystemSpec& spec_;
  const Registry* registry_;
  DiagnosticSink& sink_;
  std::unordered_map<std::string_view, int> index_;
  std::vector<int> inboard_;
};

/// `packed`: empty after a fault of the parameters.
void check_initial_values(const SystemSpec& spec, const BodySpec& body, const cardan_hinge_family& family,
                          const std::vector<double>& packed, DiagnosticSink& sink) {
  const HingeSpec& hinge = body.hinge;
  const auto at = [&] { return spec.locate(body_path(body) + ".hinge.initial"); };
  const auto fits = [&](const std::vector<double>& values, uint32_t n, const char* what) {
    if (!values.empty() && values.size() != n)
      sink.report(Code::bad_initial_state, at(), fmt::format("{} {} of hinge type {}", n, what, family.type),
                  fmt::format("{} values", values.size()));
    else if (!std::all_of(values.begin(), values.end(), [](double x) { return std::isfinite(x); }))
      sink.report(Code::bad_initial_state, at(), "finite numbers", "a value that is not finite");
  };
  fits(hinge.q, family.nq, "coordinates");
  fits(hinge.v, family.nv, "velocities");
  if (has_quaternion(family) && hinge.q.size() == family.nq) {
    const double norm = Eigen::Map<const Eigen::Vector4d>(hinge.q.data()).norm();
    if (!(std::abs(norm - 1.0) < 1e-6))
      sink.report(Code::non_unit_quaternion, at(), "w^2 + x^2 + y^2 + z^2 = 1 (within 1e-06)", fmt::format("length {:.9g}", norm));
  } else if (std::vector<double> q = hinge.q; q.size() == family.nq && !packed.empty()) {
    settle_coordinates(family, packed.data(), q.data(), at(), sink);
  }
}

/// What is held cannot be given a motion.
void check_locked(const SystemSpec& spec, const BodySpec& body, DiagnosticSink& sink) {
  const std::string path = body_path(body) + ".hinge";
  if (!body.hinge.prescribed.empty())
    sink.report(
        Code::wrong_type, spec.locate(path + ".prescribed"), "locked or prescribed, not both", "locked: true and prescribed components",
        "`locked` holds all components at their initial coordinates; a component that is prescribed stands still until it gets a profile");
}

void check_loads(const SystemSpec& spec, const BodySpec& body, const cardan_hinge_family& family, DiagnosticSink& sink) {
  for (std::size_t i = 0; i < body.hinge.loads.size(); ++i) {
    const HingeLoadSpec& load = body.hinge.loads[i];
    const std::string at = load.at.key_path.empty() ? fmt::format("{}.hinge.loads[{}]", body_path(body), i) : load.at.key_path;
    const HingeLoad::Parameters& p = load.parameters;
    const auto demand = [&](bool holds, const char* key, const char* expected, double got, const char* hint = "") {
      if (!holds) sink.report(Code::out_of_range, spec.locate(at + "." + key), expected, fmt::format("{:g}", got), hint);
    };
    if (load.component < 0 || load.component >= static_cast<int>(family.nv)) {
      sink.report(Code::unknown_name, spec.locate(at), fmt::format("a velocity component below {}", family.nv),
                  fmt::format("{}", load.component));
      continue;
    }
    if (load.law == HingeLaw::friction) {
      demand(p[0] >= 0.0 && std::isfinite(p[0]), "coulomb", "a force >= 0", p[0]);
      demand(p[1] >= p[0] && std::isfinite(p[1]), "breakaway", "a force that is at least `coulomb`", p[1]);
      const bool follows = p[4] <= 0.0 && p[2] == 10.0 * p[4];  // by default, from a width that is told below
      demand(follows || (p[2] > 0.0 && std::isfinite(p[2])), "stribeck_rate", "a rate > 0", p[2]);
      demand(p[3] >= 0.0 && std::isfinite(p[3]), "viscous", "a number >= 0", p[3]);
      demand(p[4] > 0.0 && std::isfinite(p[4]), "width", "a rate > 0", p[4],
             "below it the friction grows in proportion to the rate; a tenth of the slowest rate that matters");
      continue;
    }
    if (family.nq != family.nv)
      sink.report(Code::unsupported, spec.locate(at), fmt::format("friction alone on a hinge of type {}", family.type), "a stop",
                  has_quaternion(family) ? "its attitude is a quaternion, which has no single coordinate to stop; a gimbal hinge has"
                                         : "its rates are no rates of its coordinates");
    demand(p[0] < p[1], "lower", "less than `upper`", p[0]);
    if (std::isinf(p[0]) && std::isinf(p[1]))
      sink.report(Code::missing_key, spec.locate(at), "lower, upper or both", "neither",
                  "a stop acts where the coordinate passes one of them");
    demand(p[2] > 0.0 && std::isfinite(p[2]), "stiffness", "a number > 0", p[2]);
    demand(load.bounce.restitution >= 0.0 && load.bounce.restitution <= 1.0, "restitution", "a number from 0 to 1",
           load.bounce.restitution);
    demand(load.bounce.speed > 0.0, "speed", "a rate > 0", load.bounce.speed);
    demand(p[3] >= 1.0 && p[3] <= 10.0, "exponent", "a number from 1 to 10", p[3]);
    demand(p[4] >= 0.0 && std::isfinite(p[4]), "dissipation", "a number >= 0", p[4]);
  }
}

void check_factor(const SystemSpec& spec, const BodySpec& body, const cardan_hinge_family& family, DiagnosticSink& sink) {
  const HingeSpec& hinge = body.hinge;
  if (hinge.factor == HingeFactor::cholesky || hinge.locked || takes_square_root(family)) return;
  sink.report(Code::unsupported, spec.locate(body_path(body) + ".hinge.factor"),
              fmt::format("cholesky for a hinge of type {}", family.type), hinge_factors()[static_cast<std::size_t>(hinge.factor)],
              family.nv < 2 ? "two columns of H* at least can become dependent: from two velocities on there is something to gain"
                            : "its H* is a rotation, and its inertia itself is factored: there is nothing to gain");
}

void check_components(const SystemSpec& spec, const BodySpec& body, const cardan_hinge_family& family, DiagnosticSink& sink) {
  const HingeSpec& hinge = body.hinge;
  if (hinge.locked) check_locked(spec, body, sink);
  check_factor(spec, body, family, sink);
  if (hinge.prescribed.empty() && hinge.springs.empty() && hinge.loads.empty()) return;
  const std::string path = body_path(body) + ".hinge";
  const auto exists = [&](int component, const std::string& at) {
    const bool ok = component >= 0 && component < static_cast<int>(family.nv);
    if (!ok)
      sink.report(Code::unknown_name, spec.locate(at), fmt::format("a velocity component below {}", family.nv),
                  fmt::format("{}", component));
    return ok;
  };
  check_loads(spec, body, family, sink);
  for (int component : body.hinge.prescribed) exists(component, path + ".prescribed");
  for (std::size_t i = 0; i < body.hinge.springs.size(); ++i) {
    const SpringDamper& spring = body.hinge.springs[i];
    const std::string at = spring.at.key_path.empty() ? fmt::format("{}.springs[{}]", path, i) : spring.at.key_path;
    if (!exists(spring.component, at)) continue;
    if (!(spring.damping >= 0.0) || !std::isfinite(spring.damping))
      sink.report(Code::out_of_range, spec.locate(at + ".damping"), "damping >= 0", fmt::format("{:g}", spring.damping));
    if (!std::isfinite(spring.stiffness) || !std::isfinite(spring.rest))
      sink.report(Code::out_of_range, spec.locate(at), "finite numbers", "a value that is not finite");
    if (spring.stiffness != 0.0 && family.nq != family.nv)
      sink.report(Code::unsupported, spec.locate(at), fmt::format("damping alone on a hinge of type {}", family.type),
                  fmt::format("stiffness {:g}", spring.stiffness),
                  has_quaternion(family)
                      ? "its attitude is a quaternion, which has no single coordinate to hold at rest; a gimbal hinge has"
                      : "its rates are no rates of its coordinates");
  }
}

/// A hinge that transmits a force needs a material point on both sides: the frame of mean axes is none.
void check_attachment(const SystemSpec& spec, const BodySpec& body, int inboard, const cardan_hinge_family& family, DiagnosticSink& sink) {
  const HingeSpec& hinge = body.hinge;
  if (family.nv == 6 && !hinge.locked && hinge.springs.empty() && hinge.loads.empty()) return;
  const auto check = [&](const BodySpec& flexible, const std::string& node, const char* key) {
    if (!node.empty() || !flexible.modal || !has_mean_axes(*flexible.modal)) return;
    std::vector<std::string> nodes;
    for (const ModalNode& n : flexible.modal->nodes) nodes.push_back(n.name);
    sink.report(Code::no_attachment, spec.locate(fmt::format("{}.hinge{}", body_path(body), key)),
                nodes.empty() ? fmt::format("a node of {}, which has none", flexible.name)
                              : fmt::format("a node of {}: {}", flexible.name, one_of(nodes)),
                "its floating frame",
                "modes of `boundary: free` leave the frame at rest, so that a hinge on it neither moves them nor is moved; a cantilever "
                "held at the "
                "hinge converges with far fewer modes");
  };
  check(body, hinge.body_node, ".at");
  if (inboard >= 0) check(spec.bodies[inboard], hinge.inboard_node, ".to");
}

}  // namespace

InertiaFault inertia_fault(const Eigen::Matrix3d& I, bool point) {
  if (!I.allFinite() || !I.isApprox(I.transpose(), 1e-12)) return {"a symmetric tensor of finite numbers", "something else", ""};
  if (point && I.isZero(0.0)) return {};
  // p_max <= (p_min + p_mid) (1 + e) is p_max <= tr I (1 + e)/(2 + e); where that and p_min > 0 hold with a margin, a look at
  // pivots is enough.
  const double largest = I.trace() * (1.0 + kTriangleTolerance) / (2.0 + kTriangleTolerance);
  if (surely_positive(I) && surely_positive(largest * Eigen::Matrix3d::Identity() - I)) return {};
  const Eigen::Vector3d p = symmetric_eigenvalues(I);
  const std::string moments = fmt::format("{:.6g}, {:.6g}, {:.6g} kg m^2 about the mass centre", p[2], p[1], p[0]);
  if (point ? p[0] < -kTriangleTolerance * p[2] : !(p[0] > 0.0))
    return {point ? "principal moments >= 0" : "principal moments > 0", moments,
            p[2] == 0.0   ? "a body without extent is `type: particle`"
            : p[0] == 0.0 ? "a thin rod turns about its own axis too: give it a small moment there, a millionth of the others"
                          : ""};
  const double excess = p[2] - p[0] - p[1];
  if (!(excess > (p[0] + p[1]) * kTriangleTolerance)) return {};
  InertiaFault fault{"principal moments that satisfy the triangle inequality",
                     fmt::format("{}   ({:.6g} > {:.6g} + {:.6g})", moments, p[2], p[0], p[1]), ""};
  if (I.isDiagonal(0.0)) return fault;
  const Eigen::Matrix3d diagonal = I.diagonal().asDiagonal(), other_sign = 2.0 * diagonal - I;
  const auto possible = [](const Eigen::Matrix3d& A) {
    const Eigen::Vector3d m = symmetric_eigenvalues(A);
    return m[0] >= 0.0 && m[2] <= (m[0] + m[1]) * (1.0 + kTriangleTolerance);
  };
  if (possible(diagonal))
    fault.hint = possible(other_sign)
                     ? "products of inertia are the entries of the tensor, xy = - sum m x y: with the other sign it would be possible"
                     : fmt::format(
                           "its products are too large for its moments (a flat body, one moment the sum of the others, has none out of its "
                           "plane); {:.3g} kg m^2 more in each moment would do, {:.2g} % of the largest",
                           excess, 100.0 * excess / p[2]);
  return fault;
}

std::string body_path(const BodySpec& body) { return "bodies." + body.name; }

void validate(const SystemSpec& spec, DiagnosticSink& sink) { Structure(spec, nullptr, sink).check(); }

std::vector<CheckedHinge> validate(const SystemSpec& spec, const Registry& registry, DiagnosticSink& sink) {
  Structure structure(spec, &registry, sink);
  structure.check();
  std::vector<CheckedHinge> hinges(spec.bodies.size());
  for (std::size_t i = 0; i < hinges.size(); ++i) {
    if (sink.full()) break;
    const BodySpec& body = spec.bodies[i];
    const cardan_hinge_family* family = registry.hinge(body.hinge.type);
    if (!family) {
      std::vector<std::string> types = registry.hinges.types();
      std::sort(types.begin(), types.end());
      sink.report(Code::unknown_hinge_type, spec.locate(body_path(body) + ".hinge.type"),
                  fmt::format("a hinge type: {}, or one from a loaded plugin", fmt::join(types, ", ")), in_quotes(body.hinge.type),
                  did_you_mean(body.hinge.type, types));
      continue;
    }
    hinges[i] = {structure.inboard()[i], family, pack_hinge(spec, body, *family, sink)};
    check_initial_values(spec, body, *family, hinges[i].packed, sink);
    check_components(spec, body, *family, sink);
    check_attachment(spec, body, structure.inboard()[i], *family, sink);
  }
  return hinges;
}

std::vector<double> pack_hinge(const SystemSpec& spec, const BodySpec& body, const cardan_hinge_family& family, DiagnosticSink& sink) {
  return pack_params(spec, params_of(body, family), {{family.params, family.n_params}, family.params_size, family.pack, family.packed_size},
                     sink);
}

const std::vector<std::string>& hinge_factors() {
  static const std::vector<std::string> all = {"cholesky", "square_root"};
  return all;
}

bool takes_square_root(const cardan_hinge_family& family) {
  return family.nv > 1 && family.shape != CARDAN_SHAPE_FREE && family.shape != CARDAN_SHAPE_FREE_BODY;
}

std::optional<ParamTable> body_params(const SystemSpec& spec, const BodySpec& body, const cardan_body_family& family,
                                      DiagnosticSink& sink) {
  return checked_params(spec, params_of(body, family), {family.params, family.n_params}, sink);
}

void report_refused(const SystemSpec& spec, const BodySpec& body, const cardan_body_family& family, const ParamTable& values, Code whole,
                    DiagnosticSink& sink) {
  report_refused(spec, params_of(body, family), {family.params, family.n_params}, values, whole, sink);
}

void compute_mass(const SystemSpec& spec, BodySpec& body, const cardan_body_family& family, DiagnosticSink& sink) {
  if (!family.rigid) return;
  std::optional<ParamTable> values = body_params(spec, body, family, sink);
  if (!values) return;
  const cardan_param_values view = values->view();
  double inertia[6] = {};
  if (family.rigid(&view, &body.mass, body.com.data(), inertia) != 0)
    return report_refused(spec, body, family, *values, Code::out_of_range, sink);
  body.inertia_com << inertia[0], inertia[3], inertia[4], inertia[3], inertia[1], inertia[5], inertia[4], inertia[5], inertia[2];
}

bool has_mean_axes(const ModalData& modal) {
  const ModalIntegrals& I = modal.integrals;
  for (int j = 0; j < modal.n_modes; ++j) {
    const double m = I.I6(j, j), about = std::sqrt(std::max(0.0, I.I7.trace()) * m);
    if (I.I3.col(j).norm() > kMeanAxes * std::sqrt(I.I1 * m) || I.I4.col(j).norm() > kMeanAxes * about) return false;
  }
  return modal.n_modes > 0;
}

}  // namespace cardan
